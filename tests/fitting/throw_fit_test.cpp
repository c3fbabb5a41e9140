// Fits to campaigns whose parameters are known, and what they say where the log knows little.
#include <fmt/core.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "contact/gripper_delay.hpp"
#include "contact/limit_surface.hpp"
#include "contact/registry.hpp"
#include "fitting/card.hpp"
#include "fitting/distributions.hpp"
#include "fitting/evaluate.hpp"
#include "fitting/fit_rounds.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

using datasets::Split;
using experiment::Channel;
using testing::HasSubstr;
using testing_support::small_design;
using testing_support::truth_of;

constexpr const char* kTrueLaw = "limit_surface_disc";

datasets::ThrowLog campaign(const std::string& model, std::uint64_t seed = 11) {
  return experiment::generate_campaign(small_design(model), seed);
}

/// The campaign of the disc, made once.
const datasets::ThrowLog& disc_log() {
  static const datasets::ThrowLog log = campaign(kTrueLaw);
  return log;
}

CampaignProblem problem_of(const datasets::ThrowLog& log, const std::string& model = kTrueLaw) {
  CampaignOptions options;
  options.model = model;
  return CampaignProblem(log, "(in memory)", options);
}

FitResult fit_of_log(const datasets::ThrowLog& log, int threads = 0) {
  FitOptions options;
  options.threads = threads;
  return fit(problem_of(log), options);
}

const FitResult& disc_fit() {
  static const FitResult result = fit_of_log(disc_log());
  return result;
}

void expect_truth(const FitResult& result, const std::string& model) {
  for (const auto& u : result.campaign) {
    const double truth = truth_of(small_design(model), u.unknown.name);
    // One campaign, whose seed is fixed: three sigma, and a sigma that says something.
    EXPECT_NEAR(u.value, truth, 3 * u.sigma) << u.unknown.name;
    EXPECT_LT(u.sigma, 0.05 * truth) << u.unknown.name;
    EXPECT_TRUE(std::isfinite(u.data_sigma)) << u.unknown.name;
  }
}

/// Moves by less than `sigmas` of the fit to the log without damage.
void expect_unmoved(const FitResult& result, double sigmas, const std::string& damage) {
  ASSERT_EQ(result.outcome, FitOutcome::converged) << damage << ": " << result.message;
  for (std::size_t k = 0; k < result.campaign.size(); ++k)
    EXPECT_NEAR(result.campaign[k].value, disc_fit().campaign[k].value, sigmas * disc_fit().campaign[k].sigma)
        << damage << ": " << result.campaign[k].unknown.name;
}

class EveryLaw : public testing::TestWithParam<const char*> {};

TEST_P(EveryLaw, ParametersComeBack) {
  const auto result = fit(problem_of(campaign(GetParam()), GetParam()));
  ASSERT_EQ(result.outcome, FitOutcome::converged) << result.message;
  EXPECT_EQ(result.throws.size(), 12u);
  expect_truth(result, GetParam());
  EXPECT_TRUE(result.open.empty());
}

TEST_P(EveryLaw, StartsNearTheTruth) {
  // Priors sit at the start, as wide as a fifth of it: from a start far off they pull at the answer.
  auto design = small_design(GetParam());
  design.sensors.ft_rate = 1000;  // samples enough for the plain estimate of friction
  const auto problem = problem_of(experiment::generate_campaign(design, 3), GetParam());
  for (const auto& u : problem.campaign()) {
    EXPECT_NEAR(u.start, truth_of(small_design(GetParam()), u.name), 0.1 * u.start) << u.name;
    if (problem.model().contact_model != "gripper_delay") {
      EXPECT_NEAR(u.prior_sigma.value(), 0.2 * u.start, 1e-12) << u.name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Throws, EveryLaw,
                         testing::Values("limit_surface_disc", "limit_surface", "sliding_pivot",
                                         "gripper_delay"));

// A law of a program's own that carries until a delay is over is fitted as the library's is.
TEST(ThrowFit, ALawThatDoesNotFollowThePadsIsFittedByItsDelay) {
  static const bool once = [] {  // a name is taken for good: the test may run again
    contact::register_contact_model({"carried_until",
                                     [](const contact::ContactParameters<dynamics::Dual>& p) {
                                       return std::make_unique<contact::GripperDelay>(p.open_command,
                                                                                      p.delay);
                                     },
                                     {},
                                     false});
    return true;
  }();
  ASSERT_TRUE(once);
  const auto log = campaign("gripper_delay");
  const FitResult own = fit(problem_of(log, "carried_until")), known = fit(problem_of(log, "gripper_delay"));
  ASSERT_EQ(own.campaign.size(), known.campaign.size());
  for (std::size_t k = 0; k < own.campaign.size(); ++k) {
    EXPECT_EQ(own.campaign[k].unknown.name, known.campaign[k].unknown.name);
    EXPECT_EQ(own.campaign[k].value, known.campaign[k].value);
    EXPECT_EQ(own.campaign[k].sigma, known.campaign[k].sigma);
  }
}

TEST(ThrowFit, ParametersComeBackFromWhateverTheStartIs) {
  // The plain estimate puts the sliding pivot's start far off in some campaigns. Seven of them, two unknowns:
  // all within 4 sigma of eight throws.
  for (std::uint64_t seed = 1; seed <= 7; ++seed) {
    const auto result = fit(problem_of(campaign("sliding_pivot", seed), "sliding_pivot"));
    for (const auto& u : result.campaign) {
      const double truth = truth_of(small_design("sliding_pivot"), u.unknown.name);
      EXPECT_NEAR(u.value, truth, 4 * u.sigma) << u.unknown.name << ", seed " << seed;
      EXPECT_LT(u.sigma, 0.05 * truth) << u.unknown.name << ", seed " << seed;
    }
  }
}

// The spread of friction is that of the throws' true coefficients about the mean of their condition, and
// three rounds find it: more of them do not move it.
TEST(ThrowFit, SpreadsAreThoseOfTheThrows) {
  for (const double scatter : {0.01, 0.05}) {
    experiment::CampaignDesign design = experiment::campaign_design("batch180");
    design.variation.mu = scatter;
    datasets::ThrowLog log = experiment::campaign_header(design, 5);
    std::map<std::string, std::vector<double>> mu;  // of the train throws, by condition
    for (int i = 0; i < design.throws(); ++i) {
      auto [record, truth] = experiment::generate_throw(design, 5, i);
      if (record.split == Split::train)
        mu[record.object + record.condition].push_back(truth.patch.mu / design.patch.mu);
      log.throws.push_back(std::move(record));
    }
    double square = 0, degrees = 0;
    for (const auto& [condition, all] : mu) {
      double mean = 0;
      for (const double x : all) mean += x / static_cast<double>(all.size());
      for (const double x : all) square += (x - mean) * (x - mean);
      degrees += static_cast<double>(all.size()) - 1;
    }
    const auto problem = problem_of(log);
    FitOptions options;
    const FitResult few = fit(problem, options);
    options.rounds = 10;
    const FitResult many = fit(problem, options);
    const std::size_t k = 2;
    ASSERT_EQ(problem.own()[k].name, "mu_deviation");
    EXPECT_NEAR(few.own_spread[k] / std::sqrt(square / degrees), 1, 0.05) << scatter;
    EXPECT_NEAR(few.own_spread[k] / many.own_spread[k], 1, 0.02) << scatter;
  }
}

TEST(ThrowFit, NothingLeaksFromTestThrows) {
  auto other = disc_log();
  for (auto& one : other.throws) {
    if (one.split != Split::test) continue;
    for (double& x : one.ft->wrench.data) x *= 1.3;
    for (double& x : one.ft->normal_force.data) x *= 0.9;
    for (double& x : one.mocap->pose.data) x += 0.05;
    for (double& x : one.landing->pose.data) x -= 0.2;
  }
  const auto result = fit_of_log(other);
  EXPECT_EQ(result.values(), disc_fit().values());  // bit for bit
  EXPECT_EQ(result.covariance, disc_fit().covariance);
  EXPECT_EQ(result.own_spread, disc_fit().own_spread);
  EXPECT_EQ(problem_of(other).model().reference_force, problem_of(disc_log()).model().reference_force);
}

TEST(ThrowFit, ThreadsDoNotMatter) {
  const auto one = fit_of_log(disc_log(), 1), two = fit_of_log(disc_log(), 2);
  EXPECT_EQ(one.values(), two.values());
  EXPECT_EQ(one.covariance, two.covariance);
  const auto problem = problem_of(disc_log());
  const auto a = predict_some(problem, one, {0, 5, 9}, {true, 1}),
             b = predict_some(problem, one, {0, 5, 9}, {true, 2});
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].comparison.prediction.landing.pose.x, b[i].comparison.prediction.landing.pose.x);
    EXPECT_EQ(a[i].sigma->landing_theta, b[i].sigma->landing_theta);
  }
}

TEST(ThrowFit, NanWhereMocapIsNotValidIsNotSeen) {
  auto zero = disc_log(), nan = disc_log();
  for (auto* log : {&zero, &nan})
    for (auto& one : log->throws) {
      auto& mocap = *one.mocap;
      if (mocap.valid.empty()) mocap.valid.assign(mocap.time.rows, 1);
      for (std::size_t i = 20; i < 24; ++i) {
        mocap.valid[i] = 0;
        for (std::size_t c = 0; c < 3; ++c)
          mocap.pose.data[3 * i + c] = log == &nan ? std::numeric_limits<double>::quiet_NaN() : 0.0;
      }
    }
  EXPECT_NO_THROW(datasets::validate(nan));
  EXPECT_EQ(fit_of_log(nan).values(), fit_of_log(zero).values());
  // Anywhere else it is an error of the log.
  auto bad = disc_log();
  bad.throws[3].ft->wrench.data[17] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(datasets::validate(bad), datasets::LogError);
}

TEST(ThrowFit, OneWildThrowCountsLess) {
  auto wild = disc_log();
  const auto bad =
      static_cast<std::size_t>(std::find_if(wild.throws.begin(), wild.throws.end(),
                                            [](const auto& t) { return t.split == Split::train; }) -
                               wild.throws.begin());
  for (double& x : wild.throws[bad].ft->wrench.data) x *= 1.5;
  for (std::size_t i = 0; i < wild.throws[bad].mocap->time.rows; ++i)
    wild.throws[bad].mocap->pose.data[3 * i + 2] *= 1.2;
  wild.throws[bad].landing->pose.data[0] += 0.3;
  const auto result = fit_of_log(wild);
  // One throw in eight less, and what is left of its pull: no more than the uncertainty claimed.
  expect_unmoved(result, 2, "wild throw");
  EXPECT_LT(result.throws[bad].weight, 0.5);
  for (const ChannelMisfit& m : result.misfit)
    if (m.channel == Channel::landing_x) {
      EXPECT_EQ(m.worst_n, 1) << "it landed once";
      EXPECT_GT(m.worst_chi2, 0.9 * m.chi2);
      EXPECT_LT(m.without_worst().chi2_per_sample(), 0.1 * m.chi2_per_sample());
    }
}

TEST(ThrowFit, DeadForceChannelIsDropped) {
  auto dead = disc_log();
  for (auto& one : dead.throws)
    for (std::size_t i = 0; i < one.ft->time.rows; ++i) one.ft->wrench.data[3 * i] = 0.125;
  const auto problem = problem_of(dead);
  EXPECT_THAT(problem.notes(),
              testing::ElementsAre(HasSubstr("ft.fx is dead (always the same) in 12 of 12 throws")));
  for (const auto& t : problem.throws())
    for (const auto& o : t.observed.all) ASSERT_NE(o.channel, Channel::wrench_fx);
  expect_unmoved(fit(problem), 3, "dead channel");  // less data: another estimate, of the same thing
}

TEST(ThrowFit, ACardTellsHowTheGripperOpened) {
  const auto card = card_of(problem_of(disc_log()), disc_fit());
  const auto& opening = small_design(kTrueLaw).opening;
  const auto expect_around = [&](const char* name, double truth, double within) {
    const auto& range = card.valid_range.at(name);
    EXPECT_LT(range.low, truth + within) << name;
    EXPECT_GT(range.high, truth - within) << name;
    EXPECT_LT(range.high - range.low, 10 * within) << name;
  };
  expect_around("dead_time", opening.dead_time, 5e-4);
  expect_around("opening_time", opening.opening_time, 5e-4);
  expect_around("shape", opening.shape, 0.05);
}

// A wind in which nothing drags.
TEST(ThrowFit, ACardTellsOfWhatLeavesNoTrace) {
  CampaignOptions options;
  options.model = kTrueLaw;
  options.effects = {"flight.wind"};
  const CampaignProblem problem(disc_log(), "(in memory)", options);
  datasets::ModelCard card = card_of(problem, fit(problem));
  card.log.file = "a log";
  card.library_version = "a version";
  const auto again = datasets::parse_model_card(datasets::to_json(card));
  EXPECT_EQ(again, card);
  const auto& wind = again.parameters.at("flight.wind.w_x");
  EXPECT_FALSE(wind.determined);
  EXPECT_FALSE(wind.sigma);
  EXPECT_TRUE(again.parameters.at("mu").determined);
  for (const double x : fit_of(again, problem, "a card").covariance) EXPECT_TRUE(std::isfinite(x));
}

TEST(ThrowFit, MocapDropouts) {
  auto gaps = disc_log();
  for (auto& one : gaps.throws) {
    auto& mocap = *one.mocap;
    mocap.valid.assign(mocap.time.rows, 1);
    for (std::size_t i = 0; i < mocap.time.rows; ++i) mocap.valid[i] = i % 10 < 3;
  }
  expect_unmoved(fit_of_log(gaps), 3, "seven of ten mocap samples lost");
}

TEST(ThrowFit, ChannelInAnotherUnitDoesNotMoveIt) {
  using datasets::Throw;
  const auto wrench = [](Throw& t) -> datasets::Series& { return t.ft->wrench; };
  const auto mocap = [](Throw& t) -> datasets::Series& { return t.mocap->pose; };
  const auto landing = [](Throw& t) -> datasets::Series& { return t.landing->pose; };
  struct Unit {
    Channel channel;
    std::function<datasets::Series&(Throw&)> series;
    std::size_t column;
    double factor;
  };
  const Unit units[] = {{Channel::wrench_tau, wrench, 2, 1e3},                     // N mm for N m
                        {Channel::wrench_fx, wrench, 0, 1e-3},                     // kN for N
                        {Channel::mocap_x, mocap, 0, 1e3},                         // mm for m
                        {Channel::landing_x, landing, 0, 1e3},                     // mm for m
                        {Channel::landing_theta, landing, 1, 57.29577951308232}};  // degrees for rad
  for (const auto& [channel, series_of, column, factor] : units) {
    auto wrong = disc_log();
    for (auto& one : wrong.throws) {
      auto& series = series_of(one);
      for (std::size_t i = 0; i < series.rows; ++i) series(i, column) *= factor;
    }
    CampaignOptions as_written;
    as_written.model = kTrueLaw;
    as_written.check_units = false;
    const auto result = fit(CampaignProblem(wrong, "(in memory)", as_written));
    bool seen = false;
    for (const auto& m : result.misfit)
      if (m.channel == channel && (m.phase == Phase::release || m.phase == Phase::landing)) {
        seen = true;
        EXPECT_LT(m.weight, 0.1) << to_string(channel);
      }
    EXPECT_TRUE(seen);
    // One column of seven less: another estimate, of the same thing.
    expect_unmoved(result, 1, std::string(to_string(channel)));
  }
}

TEST(ThrowFit, TheQuarticsShapeComesBack) {
  constexpr double kKappa = 0.5;  // bulges where the disc (1.62) does not: 2.3 priors away
  auto design = small_design("limit_surface_quartic");
  design.train_share = 1;
  design.contact_factory = [](const contact::Patch<double>& patch, const contact::OpeningProfile<double>&) {
    return std::make_unique<contact::LimitSurface<contact::ConvexQuartic>>(
        "limit_surface_quartic", patch, contact::ConvexQuartic::isotropic_blend(kKappa));
  };
  const auto result = fit(problem_of(experiment::generate_campaign(design, 3), "limit_surface_quartic"));
  const auto& kappa = result.campaign.at(2);
  ASSERT_EQ(kappa.unknown.name, "kappa");
  EXPECT_NEAR(kappa.value, kKappa, 3 * kappa.sigma);
  EXPECT_LT(kappa.sigma, 0.2 * *kappa.unknown.prior_sigma);  // the log's word, not the prior's
}

TEST(ThrowFit, ALawThatCannotFollowStillPredicts) {
  // The sliding pivot, fitted to throws of a disc, against itself with the plain estimate from its wrenches.
  const auto problem = problem_of(disc_log(), "sliding_pivot");
  FitOptions plain;
  plain.all_fixed = true;
  const auto fitted = fit(problem), estimate = fit(problem, plain);
  const auto errors = [&](const FitResult& of) {
    return comparison_of(problem, of, predict_throws(problem, of, {false, 0}))
        .statistics(2, Split::train)
        .mae;
  };
  // A compromise between channels: it may cost a tenth where it lands.
  EXPECT_LT(errors(fitted), 1.1 * errors(estimate));
}

// An end of a profile is where the other unknowns cannot make up for this one any more. In units of what the
// least cost rises by as this one is held a sigma off, by its curvature, it has risen by t² there.
TEST(ThrowFit, ProfilesWhatTheLogHardlyKnows) {
  auto bare = disc_log();
  for (auto& one : bare.throws) one.mocap.reset(), one.grasp_angle = -0.7;
  int left = 3;  // train throws: where more say it, the cost is as good as a parabola
  std::erase_if(bare.throws, [&](const auto& one) { return one.split == Split::train && left-- <= 0; });
  CampaignOptions options;
  options.model = kTrueLaw;
  options.observations.wrench = options.observations.normal_force = false;  // landings are all there is
  FitOptions profiled;
  profiled.profile = true;
  const CampaignProblem problem(bare, "(in memory)", options);
  const auto result = fit(problem, profiled);
  FitRounds rounds(problem, profiled, problem.start());
  for (int round = 0; round < profiled.rounds; ++round) {
    const bool last = round + 1 == profiled.rounds;
    ASSERT_TRUE(rounds.solve(last)) << rounds.solution().message;
    if (!last) rounds.learn();
  }
  int ends = 0;
  for (const auto& u : result.campaign) {
    const auto [low, high] = u.interval95();
    const double truth = truth_of(small_design(kTrueLaw), u.unknown.name);
    EXPECT_LT(low, u.value) << u.unknown.name;
    EXPECT_GT(high, u.value) << u.unknown.name;
    EXPECT_LT(low, truth) << u.unknown.name;
    EXPECT_GT(high, truth) << u.unknown.name;
    if (!u.profile) continue;
    const auto k = static_cast<std::size_t>(&u - result.campaign.data());
    ASSERT_NEAR(rounds.campaign()[k], u.value, 1e-12 * u.value) << u.unknown.name;
    const auto rise = [&](double value) {
      FitRounds::Point point = rounds.solution_point();
      return rounds.cost_with(k, value, point) - rounds.solution().cost;
    };
    const double h = 0.1, t = student_factor(u.degrees_of_freedom);
    const double unit = 0.5 * (rise(u.value + h * u.sigma) + rise(u.value - h * u.sigma)) / (h * h);
    for (const double end : *u.profile) {
      if (std::isinf(end)) continue;
      EXPECT_NEAR(rise(end) / unit, t * t, 0.1 * t * t) << u.unknown.name << " at " << end;
      ++ends;
    }
  }
  EXPECT_GT(ends, 0);
  for (const auto& u : disc_fit().campaign) EXPECT_FALSE(u.profile) << u.unknown.name;
}

TEST(ThrowFit, WithoutANormalForceOnlyTheProductOfGripAndFrictionIsKnown) {
  auto log = disc_log();
  for (auto& one : log.throws) one.ft.reset();
  FitOptions profiled;
  profiled.profile = true;
  const auto result = fit(problem_of(log), profiled);
  const auto& opening = small_design(kTrueLaw).opening;
  const std::map<std::string, double> truth{{"mu", truth_of(small_design(kTrueLaw), "mu")},
                                            {"length", truth_of(small_design(kTrueLaw), "length")},
                                            {"grip_force", opening.grip_force},
                                            {"dead_time", opening.dead_time},
                                            {"opening_time", opening.opening_time},
                                            {"shape", opening.shape}};
  double product = 1;
  for (const auto& u : result.campaign) {
    const auto [low, high] = u.interval95();
    EXPECT_LT(low, truth.at(u.unknown.name)) << u.unknown.name;
    EXPECT_GT(high, truth.at(u.unknown.name)) << u.unknown.name;
    const bool scales = u.unknown.name == "mu" || u.unknown.name == "grip_force";
    EXPECT_EQ(scales, std::isinf(low) && std::isinf(high)) << u.unknown.name;
    if (scales) product *= u.value / truth.at(u.unknown.name);
  }
  // The card tells the same, also where an interval is open.
  datasets::ModelCard card = card_of(problem_of(log), result);
  card.log.file = "a log";
  card.library_version = "a version";
  card = datasets::parse_model_card(datasets::to_json(card));
  const auto again = fit_of(card, problem_of(log), "a card");
  ASSERT_EQ(again.campaign.size(), result.campaign.size());
  for (std::size_t k = 0; k < again.campaign.size(); ++k) {
    EXPECT_EQ(again.campaign[k].interval95(), result.campaign[k].interval95())
        << result.campaign[k].unknown.name;
    EXPECT_EQ(is_determined(again, k), is_determined(result, k));
  }
  // Eight throws whose grip and friction scatter by 3 and 2 % each.
  EXPECT_NEAR(product, 1, 4 * std::sqrt((0.03 * 0.03 + 0.02 * 0.02) / 8));
  ASSERT_EQ(result.open.size(), 1u);
  EXPECT_THAT(result.open.front().meaning, HasSubstr("mu"));
  EXPECT_THAT(result.open.front().meaning, HasSubstr("grip_force"));
}

// Of a product one factor is known once the other is.
TEST(ThrowFit, WhatIsFixedLeavesNothingOpen) {
  auto log = disc_log();
  for (auto& one : log.throws) one.ft.reset();
  const auto problem = problem_of(log);
  FitOptions options;
  options.start = problem.start();
  const auto index = [&](const std::string& name) {
    return static_cast<std::size_t>(std::find_if(problem.campaign().begin(), problem.campaign().end(),
                                                 [&](const Unknown& u) { return u.name == name; }) -
                                    problem.campaign().begin());
  };
  const std::size_t mu = index("mu"), grip = index("grip_force");
  options.start[grip] = small_design(kTrueLaw).opening.grip_force;
  options.fixed = {"grip_force"};
  const auto result = fit(problem, options);
  ASSERT_TRUE(result.is_answer()) << result.message;
  EXPECT_TRUE(result.open.empty()) << result.open.front().meaning;
  EXPECT_TRUE(is_determined(result, mu));
  EXPECT_FALSE(is_determined(result, grip)) << "it was not asked for";
  EXPECT_NEAR(result.campaign[mu].value, truth_of(small_design(kTrueLaw), "mu"),
              3 * result.campaign[mu].sigma);
  EXPECT_LT(result.campaign[mu].data_sigma, 0.1 * result.campaign[mu].value);
  EXPECT_LT(result.campaign[grip].sigma, 1e-9);
}

// An effect that is held and has no start of its own is held at none.
TEST(ThrowFit, WhatIsFixedStaysAtItsStart) {
  const auto log = disc_log();
  CampaignOptions campaign;
  campaign.effects = {"contact.adhesion"};
  const CampaignProblem problem(log, "synthetic", campaign);
  FitOptions options;
  options.fixed = {"contact.adhesion.f_adh", "contact.adhesion.parting_time"};
  const auto result = fit(problem, options);
  ASSERT_TRUE(result.is_answer()) << result.message;
  for (const FittedUnknown& u : result.campaign)
    if (u.unknown.name == "contact.adhesion.f_adh") {
      EXPECT_EQ(u.value, 0);
    }
  options.fixed.clear();
  options.all_fixed = true;
  for (const FittedUnknown& u : fit(problem, options).campaign)
    EXPECT_DOUBLE_EQ(u.value, u.unknown.start) << "but for the rounding of its unit";
}

TEST(ThrowFit, AGripperThatOpensBeforeItIsToldToIsNoAnswerAndNoError) {
  auto log = disc_log();
  for (auto& one : log.throws) one.ft.reset();
  const auto problem = problem_of(log);
  auto values = problem.start();
  for (std::size_t k = 0; k < values.size(); ++k)
    if (problem.campaign()[k].name == "dead_time") values[k] = -1e-6;
  const std::vector<double> own(problem.own().size(), 0.0);
  for (const auto by : {DerivativesBy::nothing, DerivativesBy::all}) {
    const auto l = problem.linearise(problem.throws().front(), values, own, by);
    EXPECT_FALSE(l.solved);
    EXPECT_THAT(l.why_not, HasSubstr("dead_time"));
  }
}

// Nor is one whose numbers are none: a reading that is not finite, or a sigma of zero.
TEST(ThrowFit, WhatIsNotFiniteIsNoAnswer) {
  const auto problem = problem_of(disc_log());
  const CampaignThrow& thrown = problem.throws().front();
  const std::vector<double> own(problem.own().size(), 0.0);
  auto unread = thrown.observed, certain = thrown.observed;
  unread.all[3].value = NAN, certain.all[3].sigma = 0;
  for (const auto by : {DerivativesBy::nothing, DerivativesBy::own, DerivativesBy::all}) {
    EXPECT_TRUE(problem.linearise(thrown, problem.start(), own, by).solved);
    for (const auto& observed : {unread, certain}) {
      const auto l = problem.linearise(thrown.prepared, observed, problem.start(), own, by);
      EXPECT_FALSE(l.solved);
      EXPECT_THAT(l.why_not, HasSubstr("not finite"));
    }
  }
}

TEST(ThrowFit, RefusesOptionsThatMeanNothing) {
  const auto problem = problem_of(disc_log());
  const auto message = [&](auto&& change) {
    FitOptions options;
    change(options);
    return unhand::support::refusal([&] { fit(problem, options); });
  };
  EXPECT_THAT(message([](auto& o) { o.rounds = 0; }), HasSubstr("rounds = 0"));
  EXPECT_THAT(message([](auto& o) { o.iterations = -1; }), HasSubstr("iterations = -1"));
  EXPECT_THAT(message([](auto& o) { o.accuracy = NAN; }), HasSubstr("accuracy = nan"));
  EXPECT_THAT(message([](auto& o) { o.start = {0.5}; }), HasSubstr("start has 1 values, not 0 or 2"));
  EXPECT_THAT(message([](auto& o) { o.start = {0.5, NAN}; }), HasSubstr("start: length = nan is not in ["));
  for (const double mu : {-1.0, 50.0})
    EXPECT_THAT(message([=](auto& o) { o.start = {mu, 0.007}; }), HasSubstr("is not in [0.01, 5]"));
  EXPECT_THAT(message([](auto& o) { o.own_spread = {0.01}; }), HasSubstr("own_spread has 1 values"));
  EXPECT_THAT(message([](auto& o) { o.throws = {true}; }), HasSubstr("throws has 1 values"));
  EXPECT_THAT(message([](auto& o) { o.fixed = {"nu"}; }), HasSubstr("no unknown 'nu'"));
}

// Rigid pads are a law of their own, of which no compliance has no derivative: a fit that is there stays.
// From the size of soft pads it overshoots to it where the pads give by micrometres only.
TEST(ThrowFit, AnEffectWithoutADerivativeAtNeutralIsNotStuckThere) {
  for (const double compliance : {5e-6, 1e-7}) {  // m/N
    auto design = small_design(kTrueLaw);
    design.effects = {{"contact.pad_compliance.compliance", compliance}};
    CampaignOptions options;
    options.model = kTrueLaw;
    options.effects = {"contact.pad_compliance"};
    options.integrator.tolerances = {1e-5, 1e-8};
    const auto result =
        fit(CampaignProblem(experiment::generate_campaign(design, 7), "(in memory)", options));
    ASSERT_EQ(result.outcome, FitOutcome::converged) << result.message;
    const auto& fitted = result.campaign.at(2);
    ASSERT_EQ(fitted.unknown.name, "contact.pad_compliance.compliance");
    EXPECT_NEAR(fitted.value, compliance, 3 * fitted.sigma);
    EXPECT_GT(fitted.value, 4 * fitted.sigma) << "told from none, by noise as declared";
  }
}

// Pads that give and pads that press more in their middle stand for each other: started at a typical give the
// fit ends with three times the true one and hardly a profile.
TEST(ThrowFit, OfSeveralMinimaTheLikeliestIsTheAnswer) {
  experiment::CampaignDesign design = experiment::random_campaign(9104);
  design.effects = {{"contact.pressure_profile.s", 0.8},
                    {"contact.pad_compliance.compliance", 1.5e-7},
                    {"contact.pad_compliance.loss_time", 0.005}};
  CampaignOptions options;
  options.effects = {"contact.pressure_profile", "contact.pad_compliance"};
  options.integrator.tolerances = {1e-5, 1e-8};
  const CampaignProblem problem(experiment::generate_campaign(design, 9104), "synthetic", options);
  const auto value = [](const FitResult& result, const std::string& name) {
    for (const auto& u : result.campaign)
      if (u.unknown.name == name) return u.value;
    return std::nan("");
  };
  const FitResult best = fit(problem);
  EXPECT_NEAR(value(best, "contact.pressure_profile.s"), 0.8, 0.05);
  EXPECT_NEAR(value(best, "contact.pad_compliance.compliance"), 1.5e-7, 0.2e-7);
}

// Pads that ring: a fit that begins at another pitch ends there, at 4.2e-7 m/N here with an interval of a
// tenth.
TEST(ThrowFit, PadsThatRingAreFoundAtTheirPitch) {
  experiment::CampaignDesign design = experiment::random_campaign(4);
  design.effects = {{"contact.pad_compliance.compliance", 1.2e-7},
                    {"contact.pad_compliance.loss_time", 0.001}};
  CampaignOptions options;
  options.effects = {"contact.pad_compliance"};
  options.integrator.tolerances = {1e-5, 1e-8};
  const FitResult best = fit(CampaignProblem(experiment::generate_campaign(design, 4), "synthetic", options));
  const auto value = [&](const std::string& name) {
    for (const auto& u : best.campaign)
      if (u.unknown.name == "contact.pad_compliance." + name) return u.value;
    return std::nan("");
  };
  EXPECT_NEAR(value("compliance"), 1.2e-7, 0.03e-7);
  EXPECT_NEAR(value("loss_time"), 0.001, 0.0001);
}

TEST(ThrowFit, UnknownsAtTheirBoundsDoNotStopTheOthers) {
  // Pads that part later than the force says would have the smoothing's deviation beyond its range.
  auto design = small_design(kTrueLaw);
  design.effects = {{"release.opening_delay.delay", 0.006}};
  const auto problem = problem_of(experiment::generate_campaign(design, 14));
  FitOptions options;
  options.weigh = Weigh::variances;
  FitRounds rounds(problem, options, problem.start());
  for (int round = 0; round < options.rounds; ++round) {
    const bool last = round + 1 == options.rounds;
    ASSERT_TRUE(rounds.solve(last)) << rounds.solution().message;
    if (!last) rounds.learn();
  }
  ASSERT_EQ(problem.own()[3].name, "force_deviation");
  int at_bound = 0;
  for (std::size_t i = 0; i < rounds.used().size(); ++i)
    at_bound += std::abs(rounds.own(i)[3]) == problem.own()[3].high;
  EXPECT_GT(at_bound, 2);
  // The least is the same from wherever the other unknowns start. (From two scales below, some campaigns,
  // those of seeds 11, 12 and 21 among them, have another minimum, 0.1 to 0.4 % higher.)
  for (const double by : {-2.0, -0.5, 0.5, 2.0}) {
    FitRounds::Point away = rounds.solution_point();
    away.campaign[1] += by;
    EXPECT_NEAR(rounds.cost_with(0, rounds.campaign()[0], away) / rounds.solution().cost, 1, 1e-4) << by;
  }
}

TEST(ThrowFit, CountsTheThrowsWhoseModesTheLastRoundChanged) {
  // With half the friction more of the objects slip from the start. One step of the solver in every round: it
  // comes nearer to the truth from round to round, and objects are held one after the other.
  const CampaignProblem problem = problem_of(disc_log());
  FitOptions options;
  options.start = problem.start();
  ASSERT_EQ(problem.campaign()[0].name, "mu");
  options.start[0] = 0.25;
  options.iterations = 1;
  std::vector<std::vector<int>> before;
  for (const auto& thrown : problem.throws())
    before.push_back(problem
                         .linearise(thrown, options.start, std::vector<double>(problem.own().size()),
                                    DerivativesBy::nothing)
                         .modes);
  std::vector<int> changes;
  for (options.rounds = 1; options.rounds <= 4; ++options.rounds) {
    const auto result = fit(problem, options);
    int expected = 0;
    for (std::size_t i = 0; i < result.throws.size(); ++i) {
      if (!result.throws[i].used) continue;
      ASSERT_FALSE(result.throws[i].modes.empty());
      expected += result.throws[i].modes != before[i];
      before[i] = result.throws[i].modes;
    }
    EXPECT_EQ(result.mode_changes, expected) << options.rounds << " rounds, mu " << result.campaign[0].value;
    changes.push_back(result.mode_changes);
  }
  EXPECT_GT(changes[1], 0);
  EXPECT_EQ(changes[3], 0);  // near the truth
  EXPECT_EQ(disc_fit().mode_changes, 0);
  // Nor where the campaign's unknowns are fixed at the answer.
  FitOptions still;
  still.start = disc_fit().values();
  still.all_fixed = true;
  EXPECT_EQ(fit(problem, still).mode_changes, 0);
}

TEST(ThrowFit, SaysWhyThereIsNothingToFit) {
  auto bare = disc_log();
  for (auto& one : bare.throws) {
    one.ft.reset();
    one.mocap.reset();
    one.landing.reset();
    one.detach_time = 0.1;
    one.grasp_angle = -0.7;
  }
  EXPECT_THAT(unhand::support::refusal([&] { problem_of(bare); }), HasSubstr("nothing to fit to"));
  auto pressing = disc_log();
  for (auto& one : pressing.throws)
    for (double& f : one.ft->normal_force.data) f += 50;
  EXPECT_THAT(fit_of_log(pressing).message, HasSubstr("the pads still press"));
  auto test_only = disc_log();
  for (auto& one : test_only.throws) one.split = Split::test;
  const auto nothing = fit_of_log(test_only);
  EXPECT_EQ(nothing.outcome, FitOutcome::no_start);
  for (std::size_t k = 0; k < nothing.campaign.size(); ++k) {
    EXPECT_TRUE(std::isinf(nothing.campaign[k].sigma));
    EXPECT_FALSE(is_determined(nothing, k));
  }
}

TEST(CampaignInput, LogsInMemoryObeyTheRulesOfFiles) {
  const auto expect_refused = [](const char* what, auto&& change) {
    auto log = disc_log();
    change(log);
    EXPECT_THAT(unhand::support::refusal<datasets::LogError>([&] { problem_of(log); }), HasSubstr(what));
  };
  expect_refused("mass", [](auto& log) { log.objects.begin()->second.mass = -1; });
  expect_refused("mass", [](auto& log) { log.objects.begin()->second.mass = NAN; });
  expect_refused("gravity", [](auto& log) { log.gravity = NAN; });
  expect_refused("there is no object", [](auto& log) { log.throws.front().object = "another"; });
}

// Another unit is no model error that weights could take up: the fit would converge, to other parameters.
TEST(CampaignInput, ColumnsInAnotherUnitAreRefusedUnlessTheyAreWanted) {
  auto log = disc_log();
  for (auto& one : log.throws)
    for (std::size_t i = 0; i < one.mocap->pose.rows; ++i)
      for (const std::size_t j : {0, 1}) one.mocap->pose(i, j) *= 1e3;  // mm for m
  EXPECT_THAT(unhand::support::refusal<datasets::LogError>([&] { CampaignProblem(log, "log.h5", {}); }),
              testing::AllOf(HasSubstr("log.h5"), HasSubstr("mm")));
  CampaignOptions as_written;
  as_written.check_units = false;
  EXPECT_NO_THROW(CampaignProblem(log, "log.h5", as_written));
}

// Where no pad was seen to slip, its declared radius says how long its lever is: c a, 2/3 of a disc's radius.
TEST(CampaignInput, ADeclaredRadiusStandsForPadsThatNobodyMeasured) {
  auto log = disc_log();
  for (auto& one : log.throws) one.ft.reset();
  log.gripper->pad_radius = 0.012;
  const auto known = problem_of(log);
  ASSERT_EQ(known.campaign()[1].name, "length");
  EXPECT_NEAR(known.campaign()[1].start, 0.008, 1e-12);
  EXPECT_NEAR(known.campaign()[1].prior_sigma.value(), 0.2 * 0.008, 1e-12);
  log.gripper->pad_radius.reset();
  EXPECT_FALSE(problem_of(log).campaign()[1].prior_sigma) << "nobody says";
  EXPECT_FALSE(known.campaign()[0].prior_sigma) << "nor of the friction";
}

// A radius is known to a factor of two: what slipping pads say is believed within that, and told beyond it.
TEST(CampaignInput, PadsThatMissTheirDeclaredRadiusByAFactorOfTwoAreNoStart) {
  const double length = problem_of(disc_log()).campaign()[1].start;
  for (const auto& [share, is_patch] : {std::pair{0.45, false}, {0.55, true}, {1.8, true}, {2.2, false}}) {
    auto log = disc_log();
    log.gripper->pad_radius = length / share / (2.0 / 3.0);
    const auto problem = problem_of(log);
    if (is_patch) {
      EXPECT_THAT(problem.notes(), testing::IsEmpty()) << share;
      EXPECT_NEAR(problem.campaign()[1].start, length, 1e-12) << share;
    } else {
      EXPECT_THAT(problem.notes(), testing::ElementsAre(HasSubstr("which is no patch"))) << share;
      EXPECT_NEAR(problem.campaign()[1].start, length / share, 1e-12) << share;
    }
  }
}

TEST(CampaignInput, TheReleaseBeginsWhereThePadsBeginToOpen) {
  const auto problem = problem_of(disc_log());
  for (const CampaignThrow& one : problem.throws()) {
    const double dead = small_design(kTrueLaw).opening.dead_time;
    EXPECT_NEAR(one.opening - one.prepared.open_command, dead, 0.3 * dead) << one.prepared.id;
    EXPECT_GT(one.release, one.opening) << one.prepared.id;
  }
}

// What only one object has is no other's: the drag of a box changes no throw of a jar.
TEST(CampaignInput, EveryObjectReadsItsOwnDrag) {
  const auto problem = problem_of(disc_log()).with(kTrueLaw, {"flight.quadratic_drag"});
  std::map<std::string, Eigen::Index> column;
  for (std::size_t k = 0; k < problem.campaign().size(); ++k)
    if (const std::string& name = problem.campaign()[k].name; name.ends_with(']'))
      column[name.substr(name.find('[') + 1, name.size() - name.find('[') - 2)] =
          static_cast<Eigen::Index>(k);
  ASSERT_EQ(column.size(), 2u);
  const std::vector<double> own(problem.own().size(), 0.0);
  for (const CampaignThrow& one : problem.throws()) {
    const auto l = problem.linearise(one, problem.start(), own, DerivativesBy::all);
    ASSERT_TRUE(l.solved) << l.why_not;
    for (const auto& [object, k] : column)
      EXPECT_EQ(l.campaign.col(k).norm() > 0, object == one.prepared.object) << one.prepared.id;
    const auto alone = problem.linearise(one, problem.start(), own, DerivativesBy::own);
    EXPECT_LT((alone.own - l.own).norm(), 1e-6 * l.own.norm()) << "by the throw's own unknowns alone";
    EXPECT_EQ(alone.campaign.norm(), 0);
  }
}

TEST(CampaignInput, AnotherLawIsTheOneThatPredicts) {
  const auto disc = problem_of(disc_log()), pivot = problem_of(disc_log(), "sliding_pivot");
  const auto turned = disc.with("sliding_pivot", {});
  const std::vector<double> values{0.5, 0.007}, own(disc.own().size(), 0.0);
  const auto landing = [&](const CampaignProblem& problem) {
    return problem.predict(problem.throws()[2], values, own).landing.pose.theta;
  };
  EXPECT_EQ(landing(turned), landing(pivot));
  EXPECT_NE(landing(turned), landing(disc));
}

// The smoothing says how far it leaves the force open; no log teaches it another spread.
TEST(ThrowFit, TheSpreadOfTheSmoothingIsNotLearned) {
  ASSERT_EQ(problem_of(disc_log()).own()[3].name, "force_deviation");
  EXPECT_EQ(disc_fit().own_spread[3], 1);
  EXPECT_NE(disc_fit().own_spread[2], problem_of(disc_log()).own()[2].prior_sigma);
}

// Sensors that see a throw's friction to no better than it scatters: values are drawn towards zero, and the
// spread is not theirs. Of 48 such throws it is known to some 15 %.
TEST(ThrowFit, SpreadsAreNotThoseOfValuesThatNoiseHidesHalfOf) {
  constexpr double kSpread = 0.05;
  auto design = small_design(kTrueLaw);
  design.repetitions = 8;
  design.train_share = 1;
  design.variation.mu = kSpread;
  design.sensors.wrench_sigma = {1, 1, 0.01};
  CampaignOptions campaign;
  campaign.observations.mocap = campaign.observations.landing = false;
  const CampaignProblem problem(experiment::generate_campaign(design, 3), "(in memory)", campaign);
  FitOptions options;
  options.rounds = 8;
  options.all_fixed = true;
  options.start = {design.patch.mu, design.patch.length()};
  const auto result = fit(problem, options);
  ASSERT_EQ(result.throws.size(), 48u);
  ASSERT_EQ(problem.own()[2].name, "mu_deviation");
  double square = 0;
  for (const ThrowFit& one : result.throws) square += one.own[2] * one.own[2] / 48;
  EXPECT_LT(std::sqrt(square), 0.8 * kSpread) << "values drawn towards zero";
  EXPECT_NEAR(result.own_spread[2], kSpread, 0.35 * kSpread);
}

TEST(CampaignInput, RefusesOptionsOutOfRange) {
  const auto message = [](auto&& change) {
    CampaignOptions options;
    change(options);
    return unhand::support::refusal([&] { CampaignProblem(disc_log(), "(in memory)", options); });
  };
  EXPECT_EQ(message([](auto& o) { o.pads = 1, o.reference_force = 5; }), "accepted");
  for (const int pads : {0, -2, 1001})
    EXPECT_EQ(message([=](auto& o) { o.pads = pads; }), fmt::format("pads = {} is not in [1, 1000]", pads));
  for (const double force : {0.0, -1.0, HUGE_VAL})
    EXPECT_EQ(message([=](auto& o) { o.reference_force = force; }),
              fmt::format("reference_force = {} is not in (0, inf) N", force));
  EXPECT_THAT(message([](auto& o) {
                o.effects = {"contact.viscous", "flight.wind", "contact.viscous"};
              }),
              HasSubstr("\"contact.viscous\" is named twice"));
  // It has no derivatives.
  EXPECT_THAT(message([](auto& o) { o.model = "limit_surface_naive"; }), HasSubstr("that can be fitted"));
  const auto problem = problem_of(disc_log());
  EXPECT_THROW(problem.with("limit_surface_naive", {}), std::invalid_argument);
  EXPECT_THROW(problem.with(kTrueLaw, {"flight.wind", "flight.wind"}), std::invalid_argument);
}

TEST(CampaignInput, ThrowsThatCannotBeSimulatedAreCountedAndSayWhy) {
  auto log = disc_log();
  std::vector<std::string> pressing;  // two throws whose pads stay on the object
  for (auto& one : log.throws) {
    if (one.split != Split::train || pressing.size() == 2) continue;
    pressing.push_back(one.id);
    auto& force = one.ft->normal_force.data;
    const double most = *std::max_element(force.begin(), force.end());
    for (double& f : force) f = std::max(f, 0.7 * most);
  }
  FitOptions options;
  options.rounds = options.iterations = 1;
  const auto result = fit(problem_of(log), options);
  ASSERT_TRUE(result.is_answer()) << result.message;
  EXPECT_EQ(result.not_simulated, 2);
  EXPECT_THAT(result.why_not(), HasSubstr("the pads still press"));
  EXPECT_THAT(result.why_not(), HasSubstr("(2 throws)"));
  for (const auto& one : result.throws)
    if (std::count(pressing.begin(), pressing.end(), one.id)) {
      EXPECT_FALSE(one.used);
      EXPECT_THAT(one.why_not, HasSubstr("the pads still press"));
    } else {
      EXPECT_EQ(one.why_not, "");
    }
}

}  // namespace
}  // namespace unhand::fitting
