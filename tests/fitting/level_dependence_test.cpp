// What forces of slips depend on beside their direction: friction that rises or falls with speed, wear,
// another force one way than the other. All slips are synthetic.
#include "fitting/slips/level_dependence.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "datasets/slip_log.hpp"
#include "fitting/slips/surface_discovery.hpp"
#include "tests/fitting/slip_simulator.hpp"

namespace unhand::fitting {
namespace {

const SlipSurface kPatch = test::ellipsoid(test::along_axes);

/// Speed of the reduced laws [m/s]: turning counts by the torque that a patch bears over its force.
double reduced_speed(const SlipSample& s) {
  const auto e = kPatch.extremes();
  const double share = e.torque / std::sqrt(e.least_force * e.largest_force) / kPatch.characteristic_length;
  return s.speed * std::hypot(s.direction[0], s.direction[1], share * s.direction[2]);
}

/// Slips at speeds of 2 to 200 mm/s, their forces times a factor.
SlipSamples slips(unsigned seed, const std::function<double(const SlipSample&)>& factor, double noise = 0.01,
                  int n = 60) {
  SlipSamples out = test::simulate(kPatch, n, 5 * noise, noise, seed);
  std::mt19937_64 random(seed + 1000);
  std::uniform_real_distribution<double> decades(-2.7, -0.7);
  for (SlipSample& s : out.samples) {
    s.speed = std::pow(10, decades(random));
    for (double& w : s.wrench) w *= factor(s);
  }
  return out;
}

SurfaceDiscoveryOptions quick() {
  SurfaceDiscoveryOptions out;
  out.comparison.null_draws = 0;
  return out;
}

const AcceptedEffect* named(const MeasuredDiscovery& found, const std::string& id) {
  for (const AcceptedEffect& effect : found.effects)
    if (effect.id == id) return &effect;
  return nullptr;
}

void expect_size(const Parameter& p, const std::string& name, double truth) {
  EXPECT_EQ(p.name, name);
  EXPECT_NEAR(p.value, truth, 4 * p.sigma) << name;
  EXPECT_LT(p.sigma, 0.2 * std::abs(truth)) << name;
}

TEST(LevelDependence, FrictionThatRisesWithSpeedIsNamedWithItsSize) {
  constexpr double kViscous = 5;  // s/m
  const auto found =
      discover_surfaces({slips(1, [](const auto& s) { return 1 + kViscous * reduced_speed(s); })}, quick())
          .answer;
  EXPECT_EQ(found.verdict, Verdict::effect_found);
  EXPECT_FALSE(found.unexplained) << found.unexplained->description;
  ASSERT_EQ(found.effects.size(), 1U);
  EXPECT_EQ(found.effects.front().id, "contact.viscous");
  EXPECT_LT(found.effects.front().test_error_ratio.value(), 0.3);
  expect_size(found.effects.front().parameters.at(0), "1/v_0[simulated]", kViscous);
}

TEST(LevelDependence, FrictionThatFallsWithSpeedIsNamedWithItsSpeed) {
  constexpr double kRatio = 1.3, kSpeed = 0.02;  // -, m/s
  const auto found = discover_surfaces({slips(2,
                                              [](const auto& s) {
                                                const double u = reduced_speed(s) / kSpeed;
                                                return 1 + (kRatio - 1) * std::exp(-u * u);
                                              })},
                                       quick())
                         .answer;
  EXPECT_FALSE(found.unexplained) << found.unexplained->description;
  ASSERT_EQ(found.effects.size(), 1U);
  EXPECT_EQ(found.effects.front().id, "contact.stribeck");
  expect_size(found.effects.front().parameters.at(0), "mu_s/mu_k[simulated]", kRatio);
  expect_size(found.effects.front().parameters.at(1), "v_s[simulated]", kSpeed);
}

TEST(LevelDependence, WearAndAnotherForceOneWayAreUnexplained) {
  struct Case {
    const char* words;
    std::function<double(const SlipSample&)> factor;
  };
  for (const auto& [words, factor] :
       {Case{"order of the slips", [](const SlipSample& s) { return 1 - 0.2 * s.slip / 59.0; }},
        Case{"one way than the other", [](const SlipSample& s) { return s.wrench[1] > 0 ? 1.1 : 0.9; }}}) {
    SurfaceDiscoveryOptions options = quick();
    options.forget = {kWrenchBias};  // which is another reading of the second
    const auto found = discover_surfaces({slips(3, factor)}, options).answer;
    EXPECT_EQ(found.verdict, Verdict::unexplained) << words;
    EXPECT_THAT(found.effects, testing::IsEmpty());
    ASSERT_TRUE(found.unexplained) << words;
    EXPECT_EQ(found.unexplained->channel, "level");
    EXPECT_THAT(found.unexplained->description, testing::HasSubstr(words));
  }
}

TEST(LevelDependence, BesideFrictionOfSpeedWearIsStillSeen) {
  const auto found =
      discover_surfaces(
          {slips(4, [](const auto& s) { return (1 + 5 * reduced_speed(s)) * (1 - 0.2 * s.slip / 59.0); })},
          quick())
          .answer;
  ASSERT_NE(named(found, "contact.viscous"), nullptr);
  ASSERT_TRUE(found.unexplained);
  EXPECT_THAT(found.unexplained->description, testing::HasSubstr("order of the slips"));
}

TEST(LevelDependence, WhatIsForgottenIsNotNamed) {
  SurfaceDiscoveryOptions options = quick();
  options.forget = {"contact.viscous"};
  const auto found =
      discover_surfaces({slips(1, [](const auto& s) { return 1 + 5 * reduced_speed(s); })}, options).answer;
  EXPECT_EQ(named(found, "contact.viscous"), nullptr);
  EXPECT_EQ(named(found, "contact.stribeck"), nullptr) << "friction does not fall";
}

// From end to end, of the mean level: forces that fall from 1 to 0.8 change by −0.2/0.9; ones that are a
// tenth larger one way and a tenth smaller the other, by 0.2.
TEST(LevelDependence, ChangesAreFromEndToEndOfTheMeanLevel) {
  struct Case {
    std::function<double(const SlipSample&)> factor;
    LevelBy by;
    double change;
  };
  for (const auto& [factor, by, change] :
       {Case{[](const SlipSample& s) { return 1 - 0.2 * s.slip / 59.0; }, LevelBy::order, -0.2 / 0.9},
        Case{[](const SlipSample& s) {
               return 1 + 0.1 * s.wrench[1] / std::hypot(s.wrench[0], s.wrench[1], s.wrench[2]);
             },
             LevelBy::sense, 0.2}}) {
    const auto answer = level_dependence({slips(5, factor)}, {kPatch}, quick());
    ASSERT_EQ(answer.found.size(), 1U);
    EXPECT_EQ(answer.found.front().by, by);
    ASSERT_EQ(answer.found.front().parameters.size(), 1U);
    expect_size(answer.found.front().parameters.front(), "change[simulated]", change);
    // Sixty levels of 1 % noise: an end from an end is known to 1 % √(12/60), times what the surface takes
    // up.
    EXPECT_NEAR(answer.found.front().parameters.front().sigma, 0.005, 0.004);
  }
}

// The level of significance of all questions together is 2 %, and a change must be worth 5 % of the error.
TEST(LevelDependence, NoiseAloneIsHardlyEverADependence) {
  constexpr unsigned kSets = 200;
  int named = 0;
  for (unsigned set = 0; set < kSets; ++set)
    named += !level_dependence({slips(100 + set, [](const auto&) { return 1.0; })}, {kPatch}, quick())
                  .found.empty();
  EXPECT_LE(named, 10) << "of " << kSets;  // four expected at most; more than ten by chance in one run of 400
}

double wearing(const SlipSample& s) { return 1 - 0.2 * s.slip / 59.0; }

const Parameter& only_size(const LevelAnswer& answer) {
  EXPECT_EQ(answer.found.size(), 1U);
  EXPECT_EQ(answer.found.at(0).parameters.size(), 1U);
  return answer.found.at(0).parameters.at(0);
}

// Almost without noise: forces that fall from 1 to 0.8 have changed by −0.2 of a mean of 0.9.
TEST(LevelDependence, WearIsMeasuredByTheMeanOfTheForces) {
  const Parameter change = only_size(level_dependence({slips(6, wearing, 1e-3)}, {kPatch}, quick()));
  EXPECT_NEAR(change.value, -0.2 / 0.9, 2e-3);
  EXPECT_LT(change.sigma, 1e-3);
}

// "slip-9" comes before "slip-10", as "slip-109" does before "slip-110".
TEST(LevelDependence, NumbersInIdsAreInOrderHoweverManyDigitsTheyHave) {
  SlipSamples plain = slips(7, wearing, 1e-3), longer = plain;
  for (std::size_t k = 0; k < plain.slips.size(); ++k) longer.slips[k] = "slip-" + std::to_string(100 + k);
  const Parameter as_is = only_size(level_dependence({plain}, {kPatch}, quick())),
                  same = only_size(level_dependence({longer}, {kPatch}, quick()));
  EXPECT_EQ(as_is.value, same.value);
  EXPECT_EQ(as_is.sigma, same.sigma);
}

// Of every slip that is left out, or of twenty parts where there are more, but for the two numbers (the level
// and its change with speed) that are fitted.
TEST(LevelDependence, SizesTakeDegreesOfFreedomOfTheirSlips) {
  for (const auto& [n, freedom] : {std::pair{12, 12 - 2}, {40, 20 - 2}}) {
    SurfaceDiscoveryOptions options = quick();
    options.comparison.folds = 3;
    const SlipSamples rising = slips(
        8, [](const auto& s) { return 1 + 5 * reduced_speed(s); }, 0.01, n);
    EXPECT_EQ(only_size(level_dependence({rising}, {kPatch}, options)).degrees_of_freedom, freedom);
  }
}

// The surface takes up what is like its own shape: sizes err by more than the slips scatter about their law.
// With some 18 degrees of freedom the mean of (error/σ)² is 9/8, that of forty scatters by 0.27. Without
// fitting the surface again it would be 1.65 for the last.
TEST(LevelDependence, SizesErrAsTheirSigmasSayThoughTheSurfaceIsFittedToFewSlips) {
  struct Case {
    LevelBy by;
    std::function<double(const SlipSample&)> factor;
    std::vector<double> sizes;
  };
  constexpr unsigned kSets = 40;
  for (const auto& [by, factor, sizes] :
       {Case{LevelBy::viscous, [](const auto& s) { return 1 + 5 * reduced_speed(s); }, {5}},
        Case{LevelBy::stribeck,
             [](const auto& s) { return 1 + 0.3 * std::exp(-std::pow(reduced_speed(s) / 0.02, 2)); },
             {1.3, 0.02}},
        Case{LevelBy::sense,
             [](const auto& s) {
               return 1 + 0.15 * s.wrench[1] / std::hypot(s.wrench[0], s.wrench[1], s.wrench[2]);
             },
             {0.3}}}) {
    std::vector<double> squares(sizes.size());
    for (unsigned set = 0; set < kSets; ++set) {
      const SlipSamples few = slips(300 + set, factor, 0.01, 40);
      const SurfaceFit fit = fit_surface(few, SurfaceModel::ellipsoid_full);
      ASSERT_TRUE(fit.fitted());
      const auto answer = level_dependence({few}, {fit.surface}, quick());
      ASSERT_EQ(answer.found.size(), 1U) << set;
      ASSERT_EQ(answer.found.front().by, by) << set;
      const auto& found = answer.found.front().parameters;
      ASSERT_EQ(found.size(), sizes.size());
      for (std::size_t k = 0; k < sizes.size(); ++k)
        squares[k] += std::pow((found[k].value - sizes[k]) / found[k].sigma, 2) / kSets;
    }
    for (const double square : squares) EXPECT_NEAR(square, 1.125, 0.45) << static_cast<int>(by);
  }
}

// The level of significance is shared by the four questions: viscous friction, Stribeck's, order and sense.
TEST(LevelDependence, FourQuestionsShareTheLevelOfSignificance) {
  const SlipSamples weak = slips(10, [](const auto& s) { return 1 + 0.2 * reduced_speed(s); });
  const auto viscous = [&](double level) {
    SurfaceDiscoveryOptions options = quick();
    options.family_wise_level = level;
    for (const Ranked& r : level_dependence({weak}, {kPatch}, options).ranking)
      if (r.id == "contact.viscous") return r;
    return Ranked{};
  };
  const double p = viscous(0.02).p_value;
  ASSERT_LT(p, 0.2);
  EXPECT_EQ(viscous(3.9 * p).fate, Fate::not_significant);
  EXPECT_NE(viscous(4.1 * p).fate, Fate::not_significant);
}

// Slips along x are fast here and those along y slow: a surface that is fitted to them as they are takes the
// friction that rises with speed for a patch that is stronger along x. In turn with it, it is not. Directions
// are too noisy to show the shape.
TEST(LevelDependence, TheSurfaceIsFittedWithoutWhatGoesWithSpeed) {
  constexpr double kViscous = 5;
  SlipSamples all = test::simulate(kPatch, 80, 0.3, 2e-3, 11);
  std::mt19937_64 random(12);
  std::uniform_real_distribution<double> decades(-0.6, 0);
  for (SlipSample& s : all.samples) {
    s.speed = 0.1 * std::pow(10, decades(random)) * (std::abs(s.direction[0]) > 0.6 ? 1 : 0.3);
    const double factor = 1 + kViscous * reduced_speed(s);
    for (double& w : s.wrench) w *= factor;
  }
  const SurfaceFit as_they_are = fit_surface(all, SurfaceModel::ellipsoid_full);
  ASSERT_TRUE(as_they_are.fitted());
  const Parameter from_there = only_size(level_dependence({all}, {as_they_are.surface}, quick())),
                  from_truth = only_size(level_dependence({all}, {kPatch}, quick()));
  EXPECT_EQ(from_there.name, "1/v_0[simulated]");
  EXPECT_NEAR(from_there.value, kViscous, 4 * from_there.sigma);
  EXPECT_NEAR(from_there.value, from_truth.value, 0.2 * from_truth.sigma) << "whatever it began with";
}

// A slip at constant velocity: the speed of its sample is that of its rows, however these are spaced.
TEST(LevelDependence, ASampleKnowsItsSpeed) {
  datasets::Surface patch;
  patch.mass = 1, patch.characteristic_length = 0.05;
  patch.slips = {{"1",
                  datasets::Split::train,
                  {3, 1, {0, 0.01, 0.05}, {}},
                  {3, 3, {1, 0, 0, 1, 0, 0, 1, 0, 0}, {}},
                  {3, 3, {0.03, 0, 0.8, 0.03, 0, 0.8, 0.03, 0, 0.8}, {}}}};
  const SlipSamples samples = slip_samples("patch", patch);
  ASSERT_EQ(samples.samples.size(), 1U);
  EXPECT_NEAR(samples.samples.front().speed, std::hypot(0.03, 0.05 * 0.8), 1e-12);
}

}  // namespace
}  // namespace unhand::fitting
