// The corners of what may be asked of a fit and of discover: campaigns too small or too poor to answer. Each
// has a typed answer, finite where there are numbers, and an end: the runner's time limit says which has
// none.
#include <gmock/gmock.h>

#include <cmath>
#include <functional>

#include "fitting/discovery/discover.hpp"
#include "tests/fitting/loop_campaign.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

using datasets::Series;
using datasets::Split;
using datasets::Throw;
using datasets::ThrowLog;
using testing::StartsWith;

ThrowLog campaign(double mu = 0.5) {
  auto design = testing_support::small_design("limit_surface_disc");
  design.patch.mu = mu;
  return experiment::generate_campaign(design, 11);
}

ThrowLog first_throws(std::size_t n) {
  ThrowLog log = campaign();
  log.throws.resize(n);
  for (Throw& one : log.throws) one.split = Split::train;
  return log;
}

/// Every throw the same one, noise included.
ThrowLog one_throw_again() {
  ThrowLog log = campaign();
  const Throw first = log.throws.front();
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    const Split split = log.throws[i].split;
    const std::string id = log.throws[i].id;
    log.throws[i] = first;
    log.throws[i].id = id;
    log.throws[i].split = split;
    log.throws[i].repetition = static_cast<int>(i);
  }
  return log;
}

/// The samples up to `end` [s].
void cut(const Series& time, double end, std::initializer_list<Series*> tables) {
  std::size_t n = 0;
  while (n < time.rows && time(n) <= end) ++n;
  for (Series* table : tables) {
    table->rows = n;
    table->data.resize(n * table->cols);
  }
}

/// Recordings that end before the gripper opens: nothing ever slips, nothing leaves.
ThrowLog never_released() {
  ThrowLog log = campaign();
  constexpr double kEnd = 0.02;  // s; the command to open comes at 0.025
  for (Throw& one : log.throws) {
    one.landing.reset();
    const Series ft = one.ft->time, mocap = one.mocap->time;
    cut(ft, kEnd, {&one.ft->time, &one.ft->wrench, &one.ft->normal_force});
    cut(mocap, kEnd, {&one.mocap->time, &one.mocap->pose});
    if (!one.mocap->valid.empty()) one.mocap->valid.resize(one.mocap->time.rows);
  }
  return log;
}

struct Corner {
  const char* name;
  std::function<ThrowLog()> log;
  const char *fit, *discover;  // how the answers begin
};

class Corners : public testing::TestWithParam<Corner> {};
INSTANTIATE_TEST_SUITE_P(
    , Corners,
    testing::Values(
        Corner{"NoThrow", [] { return first_throws(0); }, "refused: (in memory): /throws: is empty",
               "refused: (in memory): /throws: is empty"},
        Corner{
            "OneThrow", [] { return first_throws(1); }, "converged",
            "not_answered: nothing can be held out to judge an effect by: needed are train and test throws"},
        Corner{
            "TwoThrows", [] { return first_throws(2); }, "converged",
            "not_answered: nothing can be held out to judge an effect by: needed are train and test throws"},
        Corner{
            "OneTestThrow",
            [] {
              auto log = first_throws(1);
              for (Throw& one : log.throws) one.split = Split::test;
              return log;
            },
            "no_start",
            "not_answered: nothing can be held out to judge an effect by: needed are train and test throws"},
        // its noise is the same every time, so it is no noise: something is left that no effect explains
        Corner{"OneThrowAgainAndAgain", one_throw_again, "converged", "unexplained"},
        Corner{"HeldToTheVeryEnd", [] { return campaign(5); }, "converged", "no_missing_effect"},
        Corner{"NeverReleased", never_released, "no_start",
               "not_answered: the base model could not be fitted"}),
    [](const auto& corner) { return std::string(corner.param.name); });

/// The corner's answer in words; "refused: ..." where a typed error said no.
template <class Ask>
std::string answered(const Ask& ask) {
  try {
    return ask();
  } catch (const datasets::LogError& error) {
    return std::string("refused: ") + error.what();
  }
}

/// The outcome; numbers, where there are any, are finite.
std::string outcome_of(const FitResult& result) {
  const std::string outcome(to_string(result.outcome));
  for (const auto& u : result.campaign) {
    EXPECT_TRUE(std::isfinite(u.value)) << u.unknown.name << ", " << outcome;
    EXPECT_FALSE(std::isnan(u.sigma)) << u.unknown.name << ", " << outcome;
  }
  return outcome;
}

FitResult fit_of(const ThrowLog& log) {
  CampaignOptions options;
  options.model = "limit_surface_disc";
  return fit(CampaignProblem(log, "(in memory)", options));
}

TEST_P(Corners, FitAnswers) {
  EXPECT_THAT(answered([] { return outcome_of(fit_of(GetParam().log())); }), StartsWith(GetParam().fit));
}

TEST_P(Corners, DiscoverAnswers) {
  const std::string answer = answered([] {
    DiscoverOptions options = support::loop_options();
    options.refits = 1;
    const Discovery found = discover(GetParam().log(), "(in memory)", options);
    EXPECT_GT(found.seconds, 0);
    outcome_of(found.before.fit);
    return std::string(to_string(found.verdict)) + ": " + found.message;
  });
  EXPECT_THAT(answer, StartsWith(GetParam().discover));
}

// Few throws, or throws that stick until the very end, say less and nothing wrong: the truth is within four
// sigma, and one throw's sigma is the larger one.
TEST(CornerFits, SayTheTruthWithinWhatTheySayOfThemselves) {
  const auto parameter = [](const FitResult& result) { return result.campaign.at(0); };
  const auto all = parameter(fit_of(campaign())), one = parameter(fit_of(first_throws(1))),
             two = parameter(fit_of(first_throws(2))), held = parameter(fit_of(campaign(5)));
  for (const auto& u : {all, one, two}) EXPECT_NEAR(u.value, 0.5, 4 * u.sigma);
  EXPECT_NEAR(held.value, 5, 4 * held.sigma);
  EXPECT_EQ(all.unknown.name, "mu");
  EXPECT_GT(one.sigma, two.sigma);
  EXPECT_GT(two.sigma, all.sigma);
}

}  // namespace
}  // namespace unhand::fitting
