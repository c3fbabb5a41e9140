// Composed logs, read the users' way: what the schema allows is accepted, all else is refused.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include "tests/fuzz/composed_log.hpp"

namespace unhand::fuzz {
namespace {

namespace fs = std::filesystem;

class Composed : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, Composed, testing::ValuesIn(composed_names()),
                         [](const auto& test) { return test.param; });

TEST_P(Composed, NoDecisionIsAGoodLog) {
  EXPECT_EQ(read_composed(GetParam(), nullptr, 0), Reading::accepted);
}

TEST_P(Composed, FewOddDecisionsAreJudgedAsTheSchemaSays) {
  std::mt19937_64 random(11);
  int accepted = 0, refused = 0;
  for (int k = 0; k < 400; ++k) {
    std::vector<std::uint8_t> bytes(120);
    for (int n = 0; n < 4; ++n) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random() % 16);
    SCOPED_TRACE("case " + std::to_string(k));
    Reading reading{};
    EXPECT_NO_THROW(reading = read_composed(GetParam(), bytes.data(), bytes.size()));
    ++(reading == Reading::accepted ? accepted : refused);
  }
  EXPECT_GT(accepted, 40);
  EXPECT_GT(refused, 40);
}

TEST_P(Composed, EveryFoundCaseHasAnAnswer) {
  for (const auto& entry : fs::directory_iterator(fs::path(UNHAND_CORPUS) / ("composed_" + GetParam()))) {
    SCOPED_TRACE(entry.path().filename().string());
    std::ifstream in(entry.path(), std::ios::binary);
    const std::vector<char> bytes{std::istreambuf_iterator<char>(in), {}};
    EXPECT_NO_THROW(
        read_composed(GetParam(), reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()));
  }
}

}  // namespace
}  // namespace unhand::fuzz
