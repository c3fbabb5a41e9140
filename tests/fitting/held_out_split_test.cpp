// Which throws are held out where a log does not say.
#include "fitting/discovery/held_out_split.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <string>

#include "experiment/synthetic_campaign.hpp"
#include "fitting/measured/grouped_problem.hpp"

namespace unhand::fitting {
namespace {

using datasets::Split;
using datasets::ThrowLog;

/// Two bars, three postures, `accelerations` of them, two repetitions; all of one split.
ThrowLog unsplit(std::size_t accelerations) {
  auto design = experiment::campaign_design("batch180");
  design.postures.resize(3);
  design.release_accelerations.resize(accelerations);
  design.repetitions = 2;
  design.sensors.ft_rate = 250;
  auto log = experiment::generate_campaign(design, 4);
  for (auto& t : log.throws) t.split = Split::train;
  return log;
}

/// The sides on which each level of each factor is seen: "bar-100/pitch-42/acc+6" has three.
std::map<std::string, std::set<Split>> sides_of(const ThrowLog& log) {
  std::map<std::string, std::set<Split>> out;
  for (const auto& t : log.throws) {
    out[t.object].insert(t.split);
    std::size_t begin = t.condition.find('/');
    while (begin != std::string::npos) {
      const std::size_t end = t.condition.find('/', begin + 1);
      out[t.object + " " + t.condition.substr(begin + 1, end - begin - 1)].insert(t.split);
      begin = end;
    }
  }
  return out;
}

TEST(HeldOutSplit, EveryPostureAndAccelerationOfEachObjectIsOnBothSides) {
  for (const std::size_t accelerations : {2, 3, 4}) {
    const auto log = with_held_out(unsplit(accelerations));
    for (const auto& [level, sides] : sides_of(log))
      EXPECT_EQ(sides.size(), 2U) << level << ", " << accelerations << " accelerations";
    const auto held_out = std::count_if(log.throws.begin(), log.throws.end(),
                                        [](const auto& t) { return t.split == Split::test; });
    EXPECT_GE(3 * held_out, static_cast<std::ptrdiff_t>(log.throws.size()));
    std::map<std::string, std::set<Split>> conditions;
    for (const auto& t : log.throws) conditions[t.condition].insert(t.split);
    for (const auto& [condition, sides] : conditions) EXPECT_EQ(sides.size(), 1U) << condition;
  }
}

TEST(HeldOutSplit, EveryGripIsOnBothSides) {
  auto log = unsplit(2);
  std::map<std::string, bool> firm;  // every other condition is gripped with half the force
  for (const auto& t : log.throws) firm.try_emplace(t.condition, firm.size() % 2 == 0);
  for (auto& t : log.throws)
    for (double& f : t.ft->normal_force.data) f *= firm[t.condition] ? 1 : 0.5;
  log = with_held_out(log);
  std::map<bool, std::set<Split>> sides;
  for (const auto& t : log.throws) sides[firm[t.condition]].insert(t.split);
  EXPECT_EQ(sides[true].size(), 2U);
  EXPECT_EQ(sides[false].size(), 2U);
}

// Motions that are alike are shared out, but no object gives up its share: of its n conditions n/2 are held
// out, whatever other objects were thrown like.
TEST(HeldOutSplit, EveryObjectKeepsItsHalfOfTheConditions) {
  std::mt19937_64 random(7);
  std::uniform_int_distribution<int> count(2, 5);
  std::normal_distribution<double> normal;
  for (int set = 0; set < 100; ++set) {
    ThrowLog log;
    std::map<std::string, int> conditions;
    for (const char* object : {"a", "b", "c"}) {
      conditions[object] = count(random);
      for (int k = 0; k < conditions[object]; ++k) {
        auto& t = log.throws.emplace_back();
        t.object = object, t.condition = std::to_string(k);
        const auto moved = [&] {
          return datasets::Series{1, 3, {normal(random), normal(random), normal(random)}, {}};
        };
        t.hand = datasets::HandLog{{1, 1, {0}, {}}, moved(), moved(), moved()};
      }
    }
    std::map<std::string, int> held_out;
    for (const auto& t : with_held_out(log).throws) held_out[t.object] += t.split == Split::test;
    for (const auto& [object, n] : conditions)
      EXPECT_EQ(held_out[object], n / 2) << object << " of set " << set;
  }
}

TEST(HeldOutSplit, AnObjectWithOneConditionIsSplitByRepetition) {
  auto log = unsplit(2);
  const std::string object = log.throws.front().object, condition = log.throws.front().condition;
  std::erase_if(log.throws, [&](const auto& t) { return t.object == object && t.condition != condition; });
  log = with_held_out(log);
  EXPECT_EQ(sides_of(log)[object].size(), 2U);
}

TEST(HeldOutSplit, NothingIsHeldOutOfOneConditionAndALogsOwnSplitIsKept) {
  auto log = unsplit(2);
  auto one = log;
  one.throws.resize(2);
  for (const auto& t : with_held_out(one).throws) EXPECT_EQ(t.split, Split::train);
  log.throws[5].split = Split::test;
  const auto kept = with_held_out(log);
  for (std::size_t i = 0; i < log.throws.size(); ++i)
    EXPECT_EQ(kept.throws[i].split, log.throws[i].split) << i;
}

TEST(HeldOutSplit, FewRepetitionsOfManyConditionsAreHeldOutToo) {
  ThrowLog log;
  for (int condition = 0; condition < 5; ++condition)
    for (int repetition = 0; repetition < 3; ++repetition) {
      auto& t = log.throws.emplace_back();
      t.condition = std::string(1, static_cast<char>('a' + condition)), t.repetition = repetition;
    }
  const auto splits = splits_of(log);
  EXPECT_EQ(std::count(splits.begin(), splits.end(), Split::test), 3);
}

}  // namespace
}  // namespace unhand::fitting
