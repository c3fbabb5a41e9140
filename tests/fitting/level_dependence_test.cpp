// What forces of slips depend on beside their direction: friction that rises or falls with speed, wear,
// another force one way than the other. All slips are synthetic.
#include "fitting/slips/level_dependence.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>
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

// Twice the slips with the same scatter: half the variance, but for the two numbers (the level and its
// change with speed) that were fitted to them.
TEST(LevelDependence, SizesTakeDegreesOfFreedomOfTheirSlips) {
  constexpr int kFew = 12;
  const SlipSamples few = slips(
      8, [](const auto& s) { return 1 + 5 * reduced_speed(s); }, 0.01, kFew);
  SlipSamples twice = few;
  for (SlipSample s : few.samples) s.slip += kFew, twice.samples.push_back(s);
  for (const std::string& id : few.slips) twice.slips.push_back("again-" + id);
  SurfaceDiscoveryOptions options = quick();
  options.comparison.folds = 3;
  const Parameter once = only_size(level_dependence({few}, {kPatch}, options)),
                  again = only_size(level_dependence({twice}, {kPatch}, options));
  EXPECT_EQ(once.name, "1/v_0[simulated]");
  EXPECT_EQ(once.degrees_of_freedom, kFew - 2);
  EXPECT_NEAR(again.value, once.value, 0.02 * once.value);
  EXPECT_NEAR(std::pow(again.sigma / once.sigma, 2), (kFew - 2.0) / (2 * kFew - 2.0), 0.02);
}

// Sizes of many slips are as sure as leaving out a tenth of them, one after the other, says: of the rise
// with speed over the level at rest, and of the speed at which friction falls.
TEST(LevelDependence, SizesAreAsSureAsLeavingOutSlipsSays) {
  constexpr int kParts = 10;
  struct Case {
    std::function<double(const SlipSample&)> factor;
    std::size_t sizes;
  };
  for (const auto& [factor, sizes] :
       {Case{[](const SlipSample& s) { return 1 + 20 * reduced_speed(s); }, 1},
        Case{[](const SlipSample& s) { return 1 + 0.3 * std::exp(-std::pow(reduced_speed(s) / 0.02, 2)); },
             2}}) {
    const SlipSamples all = slips(9, factor, 0.01, 200);
    const auto sized = [](const SlipSamples& of) {
      const auto answer = level_dependence({of}, {kPatch}, quick());
      EXPECT_EQ(answer.found.size(), 1U);
      return answer.found.at(0).parameters;
    };
    const auto whole = sized(all);
    ASSERT_EQ(whole.size(), sizes);
    std::vector<double> sum(sizes), squares(sizes);
    for (int part = 0; part < kParts; ++part) {
      SlipSamples rest = all;
      std::erase_if(rest.samples, [&](const SlipSample& s) { return s.slip % kParts == part; });
      const auto without = sized(rest);
      for (std::size_t k = 0; k < sizes; ++k) {
        const double value = without.at(k).value - whole[k].value;
        sum[k] += value, squares[k] += value * value;
      }
    }
    for (std::size_t k = 0; k < sizes; ++k) {
      const double sigma = std::sqrt((squares[k] - sum[k] * sum[k] / kParts) * (kParts - 1) / kParts);
      EXPECT_GT(whole[k].sigma, 0.6 * sigma) << whole[k].name;  // of ten: 1 ± 0.24
      EXPECT_LT(whole[k].sigma, 1.3 * sigma) << whole[k].name;
    }
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
