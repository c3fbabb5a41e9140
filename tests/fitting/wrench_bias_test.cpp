// A force/torque sensor that is off by a constant, seen in slips: a limit surface is symmetric, a bias is
// not.
#include "fitting/slips/wrench_bias.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

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
