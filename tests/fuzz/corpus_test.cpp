// The fuzzers' corpora as tests: a seed of every reader is accepted, every prefix and every damaged byte of
// it has an answer, and so has every input that a fuzzer once found to have none (corpus/READER/found-*).
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include "tests/fuzz/readers.hpp"

namespace unhand::fuzz {
namespace {

namespace fs = std::filesystem;

std::vector<std::uint8_t> bytes_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class Corpus : public testing::TestWithParam<std::string> {
 protected:
  fs::path folder() const { return fs::path(UNHAND_CORPUS) / GetParam(); }
};
INSTANTIATE_TEST_SUITE_P(, Corpus, testing::ValuesIn(reader_names()),
                         [](const auto& test) { return test.param; });

TEST_P(Corpus, EveryFileHasAnAnswer) {
  bool accepted = false;
  for (const auto& entry : fs::directory_iterator(folder())) {
    SCOPED_TRACE(entry.path().filename().string());
    const auto bytes = bytes_of(entry.path());
    EXPECT_NO_THROW(accepted = read(GetParam(), bytes.data(), bytes.size()) == Reading::accepted || accepted);
  }
  EXPECT_TRUE(accepted) << "a corpus without one good file tests the first refusal only";
}

TEST_P(Corpus, DamagedFilesHaveAnAnswer) {
  std::mt19937_64 random(5);
  for (const auto& entry : fs::directory_iterator(folder())) {
    const auto bytes = bytes_of(entry.path());
    if (bytes.empty() || entry.path().filename().string().rfind("seed", 0) != 0) continue;
    for (int k = 0; k < 200; ++k) {
      auto damaged = bytes;
      const int kind = k % 4;
      const std::size_t at = random() % bytes.size();
      if (kind == 0) damaged.resize(at);
      if (kind == 1) damaged[at] = static_cast<std::uint8_t>(random());
      if (kind == 2)
        damaged.insert(damaged.begin() + static_cast<long>(at), bytes.begin(),
                       bytes.begin() + static_cast<long>(std::min<std::size_t>(40, bytes.size())));
      if (kind == 3)
        for (int n = 0; n < 8; ++n)
          damaged[random() % bytes.size()] ^= static_cast<std::uint8_t>(1u << (random() % 8));
      EXPECT_NO_THROW(read(GetParam(), damaged.data(), damaged.size()))
          << entry.path().filename() << ", kind " << kind << " at " << at << ", k " << k;
    }
  }
}

/// One byte of a seed, and the value with which libhdf5 1.10 ends the process that reads it: numbers of text
/// in its heap, lengths of names and sizes of types.
struct Killer {
  const char *reader, *seed;
  std::size_t at;
  std::uint8_t value;
};

TEST(Killers, AreRefused) {
  constexpr Killer kKillers[] = {{"throw_log", "seed-spatial.h5", 894, 128},
                                 {"throw_log", "seed-spatial.h5", 8940, 255},
                                 {"throw_log", "seed-spatial.h5", 8959, 1},
                                 {"throw_log", "seed-spatial.h5", 8976, 129},
                                 {"throw_log", "seed-spatial.h5", 24910, 128},
                                 {"throw_log", "seed-spatial.h5", 38133, 1},
                                 {"slip_log", "seed.h5", 895, 8},
                                 {"slip_log", "seed.h5", 6935, 255},
                                 {"slip_log", "seed.h5", 11302, 1},
                                 {"slip_log", "seed.h5", 16310, 255},
                                 {"slip_log", "seed.h5", 16311, 255},
                                 {"slip_log", "seed.h5", 19365, 255}};
  for (const Killer& killer : kKillers) {
    auto bytes = bytes_of(fs::path(UNHAND_CORPUS) / killer.reader / killer.seed);
    ASSERT_GT(bytes.size(), killer.at);
    bytes[killer.at] = killer.value;
    EXPECT_EQ(read(killer.reader, bytes.data(), bytes.size()), Reading::refused)
        << killer.reader << ", byte " << killer.at;
  }
}

}  // namespace
}  // namespace unhand::fuzz
