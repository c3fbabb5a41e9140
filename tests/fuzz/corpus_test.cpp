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

}  // namespace
}  // namespace unhand::fuzz
