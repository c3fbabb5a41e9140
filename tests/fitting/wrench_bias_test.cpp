// A force/torque sensor that is off by a constant, seen in slips: a limit surface is symmetric, a bias is
// not.
#include "fitting/slips/wrench_bias.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "datasets/import_planar_pushes.hpp"
#include "fitting/slips/surface_discovery.hpp"
#include "slip_simulator.hpp"
#include "tests/support/data_folder.hpp"

namespace unhand::fitting::test {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre;
using testing::IsEmpty;

const Eigen::Matrix3d unequal_axes = Vector3d(1 / 16.0, 1 / 9.0, 1 / 25.0).asDiagonal();
const Vector3d sensor_bias(0.6, -0.3, 0.012);  // N, N, N m; forces are 3 to 5 N

SlipSamples with_bias(const SlipSurface& surface, int n, double noise, unsigned seed) {
  return without_bias(simulate(surface, n, noise, noise, seed), -sensor_bias);
}

std::vector<std::string> found_ids(const SurfaceDiscovery& found) {
  std::vector<std::string> out;
  for (const auto& effect : found.answer.effects) out.push_back(effect.id);
  return out;
}

SurfaceDiscoveryOptions one_draw() {
  SurfaceDiscoveryOptions out;
  out.comparison.null_draws = 1;
  return out;
}

TEST(WrenchBias, IsFoundWithinItsSigma) {
  double z2 = 0;
  int small = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const WrenchBias with =
        fit_wrench_bias({with_bias(ellipsoid(unequal_axes), 50, 0.15, seed)}, SurfaceModel::ellipsoid);
    ASSERT_TRUE(with.solved);
    EXPECT_LT(with.p_value, 1e-3);
    const Vector3d off = with.value - sensor_bias;
    z2 += off.dot(Eigen::Matrix3d(with.covariance.inverse()) * off) / 3 / 40;
    const WrenchBias none =
        fit_wrench_bias({simulate(ellipsoid(unequal_axes), 50, 0.15, 0.15, seed)}, SurfaceModel::ellipsoid);
    ASSERT_TRUE(none.solved);
    small += none.p_value < 0.1;
  }
  EXPECT_GT(z2, 0.6);  // 1 with a standard deviation of 0.13, and what a scatter of 50 slips adds
  EXPECT_LT(z2, 1.6);
  EXPECT_LE(small, 10);  // 4 ± 1.9
}

TEST(WrenchBias, OneSensorReadsOneBiasOnAllSurfaces) {
  const SlipSurface rounder = quartic(contact::ConvexQuartic::isotropic_blend(2.8), 4.0);
  const WrenchBias found =
      fit_wrench_bias({with_bias(ellipsoid(unequal_axes), 40, 0.05, 1), with_bias(rounder, 40, 0.05, 2)},
                      SurfaceModel::convex_quartic);
  ASSERT_TRUE(found.solved);
  for (Eigen::Index j = 0; j < 3; ++j)
    EXPECT_NEAR(found.value[j], sensor_bias[j], 4 * std::sqrt(found.covariance(j, j))) << j;
}

TEST(WrenchBias, SlipsTheOtherWayShowTheOppositeBias) {
  SlipSamples slips = with_bias(ellipsoid(unequal_axes), 40, 0.1, 3);
  const WrenchBias there = fit_wrench_bias({slips}, SurfaceModel::ellipsoid_full);
  for (SlipSample& s : slips.samples)
    for (std::size_t j = 0; j < 3; ++j) s.wrench[j] *= -1, s.direction[j] *= -1;
  const WrenchBias back = fit_wrench_bias({slips}, SurfaceModel::ellipsoid_full);
  ASSERT_TRUE(there.solved && back.solved);
  EXPECT_LT((there.value + back.value).norm(), 1e-4);
}

/// The same slips, and once more as others.
SlipSamples twice(SlipSamples slips) {
  const auto samples = slips.samples;
  const auto n = static_cast<int>(slips.slips.size());
  for (SlipSample s : samples) s.slip += n, slips.samples.push_back(s);
  for (int k = 0; k < n; ++k) slips.slips.push_back("again-" + std::to_string(k));
  return slips;
}

// Twice the slips with the same scatter know a bias to half the variance, but that its three numbers were
// fitted to them: of n slips, n − 3 degrees of freedom are left.
TEST(WrenchBias, TakesThreeDegreesOfFreedomOfItsSlips) {
  constexpr int kFew = 8;
  const SlipSamples few = with_bias(ellipsoid(unequal_axes), kFew, 0.03, 6);
  const WrenchBias once = fit_wrench_bias({few}, SurfaceModel::ellipsoid),
                   again = fit_wrench_bias({twice(few)}, SurfaceModel::ellipsoid);
  ASSERT_TRUE(once.solved && again.solved);
  constexpr double kLeft = kFew - 3, kLeftOfTwice = 2 * kFew - 3;
  for (Eigen::Index j = 0; j < 3; ++j)
    EXPECT_NEAR(again.covariance(j, j) / once.covariance(j, j), kLeft / kLeftOfTwice, 0.03) << j;
}

// Slips one way only can hardly tell a bias from a surface that is larger. How sure it is, is what leaving
// out one slip after the other says.
TEST(WrenchBias, IsAsSureAsLeavingOutSlipsSays) {
  SlipSamples one_way = with_bias(ellipsoid(unequal_axes), 100, 0.05, 8);
  std::erase_if(one_way.samples, [](const SlipSample& s) { return s.wrench[0] < 0.5; });
  const WrenchBias all = fit_wrench_bias({one_way}, SurfaceModel::ellipsoid);
  ASSERT_TRUE(all.solved);
  std::vector<Vector3d> without;
  for (std::size_t i = 0; i < one_way.samples.size(); ++i) {
    SlipSamples rest = one_way;
    rest.samples.erase(rest.samples.begin() + static_cast<std::ptrdiff_t>(i));
    const WrenchBias one = fit_wrench_bias({rest}, SurfaceModel::ellipsoid, all.value);
    ASSERT_TRUE(one.solved);
    without.push_back(one.value);
  }
  const auto n = static_cast<double>(without.size());
  Vector3d mean = Vector3d::Zero(), squares = Vector3d::Zero();
  for (const Vector3d& b : without) mean += b / n;
  for (const Vector3d& b : without) squares += (b - mean).cwiseAbs2();
  for (Eigen::Index j = 0; j < 3; ++j)
    EXPECT_NEAR(std::sqrt(all.covariance(j, j) / (squares[j] * (n - 1) / n)), 1, 0.2) << j;
}

// Left-out slips are judged by their wrenches without the bias that the others show: as well as slips that
// never had one.
TEST(WrenchBias, SlipsThatAreLeftOutAreFreedOfItToo) {
  const SlipSamples clean = simulate(ellipsoid(unequal_axes), 50, 0.02, 0.02, 9);
  const auto score = [](const SlipSamples& slips) {
    const WrenchBias whole = fit_wrench_bias({slips}, SurfaceModel::ellipsoid);
    return score_with_bias({slips}, SurfaceModel::ellipsoid, whole, {}).at(0).mean_deg;
  };
  const double as_clean = score(clean);
  EXPECT_LT(as_clean, 3);
  EXPECT_NEAR(score(without_bias(clean, -sensor_bias)), as_clean, 0.2 * as_clean);
}

// Of five folds, the slips 0, 5, 10, ... are left out together: what one of them says, the others are not
// predicted by.
TEST(WrenchBias, SlipsHaveNoSayWhereTheyAreLeftOut) {
  SlipSamples slips = with_bias(ellipsoid(unequal_axes), 50, 0.05, 10);
  const WrenchBias whole = fit_wrench_bias({slips}, SurfaceModel::ellipsoid);
  const auto errors = [&] {
    return score_with_bias({slips}, SurfaceModel::ellipsoid, whole, {}).at(0).errors_deg;
  };
  const auto before = errors();
  for (double& w : slips.samples[5].wrench) w *= 1.5;
  const auto after = errors();
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (i == 5) continue;
    if (i % 5 == 0) {
      EXPECT_EQ(after[i], before[i]) << i;
    } else {
      EXPECT_NE(after[i], before[i]) << i;
    }
  }
}

TEST(WrenchBias, IsNamedWhereItIsAndNowhereElse) {
  const auto found =
      discover_surfaces(std::vector{with_bias(ellipsoid(unequal_axes), 50, 0.15, 4)}, one_draw());
  EXPECT_THAT(found_ids(found), ElementsAre("sensor.ft_bias"));
  ASSERT_EQ(found.answer.effects.front().parameters.size(), 3U);
  for (std::size_t j = 0; j < 3; ++j) {
    const Parameter& p = found.answer.effects.front().parameters[j];
    EXPECT_NEAR(p.value, sensor_bias[static_cast<Eigen::Index>(j)], 4 * p.sigma) << p.name;
  }
  // Two components of 0.15 rad: mean length 0.15 √(π/2) rad = 10.8°.
  EXPECT_GT(found.answer.before_test.front().second, 12);
  EXPECT_NEAR(found.answer.after_test.front().second, 10.8, 2.5);

  const auto none =
      discover_surfaces(std::vector{simulate(ellipsoid(unequal_axes), 50, 0.15, 0.15, 4)}, one_draw());
  EXPECT_THAT(found_ids(none), IsEmpty());
  auto without = one_draw();
  without.forget = {kWrenchBias};
  const auto forgotten =
      discover_surfaces(std::vector{with_bias(ellipsoid(unequal_axes), 50, 0.15, 4)}, without);
  EXPECT_THAT(found_ids(forgotten), testing::Not(testing::Contains("sensor.ft_bias")));
}

// Directions as a bias would bend them, and forces as without it: evident, and no bias of the sensor's.
TEST(WrenchBias, DirectionsAloneDoNotNameIt) {
  const SlipSurface surface = ellipsoid(unequal_axes);
  SlipSamples bent = simulate(surface, 60, 0, 0.1, 7);
  const SlipSamples biased = without_bias(bent, 2 * sensor_bias);
  std::mt19937_64 random(16);
  for (std::size_t i = 0; i < bent.samples.size(); ++i) {
    const auto n = surface.normal(biased.samples[i].wrench);
    const Vector3d u = (Vector3d(n[0], n[1], n[2]) + 0.1 * gauss(random)).normalized();
    bent.samples[i].direction = {u[0], u[1], u[2]};
  }
  const auto found = discover_surfaces(std::vector{bent}, one_draw());
  EXPECT_THAT(found_ids(found), testing::Not(testing::Contains("sensor.ft_bias")));
  for (const Ranked& one : found.answer.ranking) {
    if (one.id == kWrenchBias) {
      EXPECT_LT(one.p_value, 1e-6);
    }
  }
}

TEST(WrenchBias, StandsBesideAnotherLaw) {
  const SlipSurface rounder = quartic(contact::ConvexQuartic::isotropic_blend(2.8), 4.0);
  const auto found = discover_surfaces(std::vector{with_bias(rounder, 60, 0.05, 5)}, one_draw());
  EXPECT_THAT(found_ids(found), ElementsAre("sensor.ft_bias", "contact.law:convex_quartic"));
  for (const auto& effect : found.answer.effects)
    EXPECT_LT(effect.test_error_ratio.value(), 0.7) << effect.id;
}

TEST(WrenchBias, MeasuredPushesHaveNoneButAnAddedOne) {
  const auto [pushes, missing] = unhand::support::from_data_folder("measured/planar_pushes");
  if (!missing.empty()) GTEST_SKIP() << missing;
  const auto log = datasets::import_planar_pushes(std::vector<std::filesystem::path>{pushes});
  std::vector<SlipSamples> measured;
  for (const char* name : {"patch", "wood_patch"})
    measured.push_back(slip_samples(name, log.surfaces.at(name)));
  auto options = one_draw();
  options.comparison.null_draws = 0;
  EXPECT_THAT(found_ids(discover_surfaces(measured, options)), ElementsAre("contact.law:convex_quartic"));
  const char* const three_feet = "wood_30_63.33_43.33_30_43.33_63.33";
  const std::vector alone{slip_samples(three_feet, log.surfaces.at(three_feet))};
  EXPECT_THAT(found_ids(discover_surfaces(alone, options)), IsEmpty());
  const Vector3d added(1.0, 0.5, 0);
  const auto found = discover_surfaces(without_bias(measured, -added), options);
  EXPECT_THAT(found_ids(found), ElementsAre("sensor.ft_bias", "contact.law:convex_quartic"));
  for (std::size_t j = 0; j < 3; ++j) {
    const Parameter& p = found.answer.effects.front().parameters[j];
    EXPECT_NEAR(p.value, added[static_cast<Eigen::Index>(j)], 4 * p.sigma) << p.name;
  }
}

}  // namespace
}  // namespace unhand::fitting::test
