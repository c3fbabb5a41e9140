// Limit surfaces fitted to slips.
#include "fitting/slips/slip_surface.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "contact/registry.hpp"
#include "slip_simulator.hpp"
#include "tests/support/refusal.hpp"

namespace unhand::fitting::test {
namespace {

Eigen::Matrix3d tilted() {
  const Eigen::Matrix3d r =
      (Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return r * along_axes * r.transpose();
}

void expect_coefficients(const SurfaceFit& fit, const SlipSurface& truth, double tolerance) {
  ASSERT_TRUE(fit.fitted()) << fit.reason;
  ASSERT_EQ(fit.surface.coefficients.size(), truth.coefficients.size());
  double largest = 0;
  for (const double c : truth.coefficients) largest = std::max(largest, std::abs(c));
  for (std::size_t k = 0; k < truth.coefficients.size(); ++k)
    EXPECT_NEAR(fit.surface.coefficients[k], truth.coefficients[k], tolerance * largest)
        << "coefficient " << k;
}

TEST(SlipSurface, EllipsoidsComeBackWithoutNoise) {
  // Ceres stops at a relative change of 1e-10; the noise has a floor of 1e-4.
  expect_coefficients(fit_surface(simulate(ellipsoid(along_axes), 40, 0, 0, 1), SurfaceModel::ellipsoid),
                      ellipsoid(along_axes), 1e-6);
  expect_coefficients(fit_surface(simulate(ellipsoid(tilted()), 40, 0, 0, 2), SurfaceModel::ellipsoid_full),
                      ellipsoid(tilted()), 1e-6);
}

TEST(SlipSurface, NoiseIsEstimated) {
  // 400 slips: a median's relative standard error is about 1.2/sqrt(400) = 6 %; three of them.
  const SurfaceFit fit =
      fit_surface(simulate(ellipsoid(tilted()), 400, 0.1, 0.05, 3), SurfaceModel::ellipsoid_full);
  expect_coefficients(fit, ellipsoid(tilted()), 0.05);
  EXPECT_NEAR(fit.sigma_direction, 0.1, 0.018);
  EXPECT_NEAR(fit.sigma_level, 0.05, 0.009);
}

TEST(SlipSurface, QuarticComesBack) {
  for (const double kappa : {0.4, 1.6219, 2.7}) {
    const SlipSurface truth = quartic(contact::ConvexQuartic::isotropic_blend(kappa), 4.0);
    const SlipSamples slips = simulate(truth, 80, 0, 0, 4);
    const SurfaceFit fit = fit_surface(slips, SurfaceModel::convex_quartic);
    ASSERT_TRUE(fit.fitted()) << fit.reason;
    // Near the rim of the convex set the solver creeps: 1e-3 rad is a hundredth of what is measured.
    for (const SlipSample& s : slips.samples) {
      EXPECT_LT(direction_error(fit.surface, s), 1e-3) << "kappa " << kappa;
      EXPECT_NEAR(fit.surface.gauge(s.wrench), 1, 1e-3) << "kappa " << kappa;
    }
  }
}

// Little data, much noise, and data whose own quartic is not convex: the class accepts every result.
TEST(SlipSurface, QuarticIsAlwaysConvex) {
  for (unsigned seed = 0; seed < 12; ++seed) {
    SlipSamples slips = simulate(ellipsoid(tilted()), 15 + static_cast<int>(seed), 0.5, 0.4, 100 + seed);
    if (seed % 3 == 0)  // a star: H = a⁴ + 2κ a²b² + b⁴ with κ = 6 is dented
      slips = simulate({SurfaceModel::convex_quartic, 0.05, {1, 0, 0, 2, 0, 12, 0, 0, 0, 0, 1, 0, 12, 0, 1}},
                       40, 0.05, 0.05, seed);
    const SurfaceFit fit = fit_surface(slips, SurfaceModel::convex_quartic);
    ASSERT_TRUE(fit.fitted()) << fit.reason;
    std::array<double, 15> c{};
    std::copy(fit.surface.coefficients.begin(), fit.surface.coefficients.end(), c.begin());
    EXPECT_NO_THROW(contact::ConvexQuartic{c}) << "seed " << seed;
  }
}

// The same physics in a turned object frame: f and v turn, τ and ω stay.
TEST(SlipSurface, FullEllipsoidTurnsWithTheFrame) {
  const SlipSamples slips = simulate(ellipsoid(tilted()), 60, 0.15, 0.1, 5);
  SlipSamples turned = slips;
  const Eigen::Matrix3d r = Eigen::AngleAxisd(1.1, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  for (SlipSample& s : turned.samples)
    for (auto* x : {&s.wrench, &s.direction}) {
      const Eigen::Vector3d y = r * Eigen::Vector3d(x->data());
      *x = {y[0], y[1], y[2]};
    }
  const SurfaceFit a = fit_surface(slips, SurfaceModel::ellipsoid_full),
                   b = fit_surface(turned, SurfaceModel::ellipsoid_full);
  ASSERT_TRUE(a.fitted() && b.fitted());
  // Noise and fit alternate until the noise moves by less than 1e-3 of itself.
  for (std::size_t k = 0; k < slips.samples.size(); ++k)
    EXPECT_NEAR(direction_error(a.surface, slips.samples[k]), direction_error(b.surface, turned.samples[k]),
                1e-3);
}

TEST(SlipSurface, GaugeAndNormalAgreeWithTheContactModel) {
  const contact::ConvexQuartic shape = contact::ConvexQuartic::isotropic_blend(1.3);
  const SlipSurface surface = quartic(shape, 1.0);
  std::mt19937_64 random(6);
  for (int k = 0; k < 50; ++k) {
    const Eigen::Vector3d w = gauss(random);
    const std::array<double, 3> x{w[0], w[1], w[2]};
    EXPECT_NEAR(surface.gauge(x), shape.gauge(x), 1e-13 * shape.gauge(x));
    const auto n = surface.normal(x), back = shape.slip_direction(x);
    for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(n[j], -back[j], 1e-13);  // the class opposes the slip
  }
}

TEST(SlipSurface, RefusesWhatDoesNotDetermineASurface) {
  const SlipSamples slips = simulate(ellipsoid(along_axes), 14, 0.1, 0.1, 7);
  const SurfaceFit few = fit_surface(slips, SurfaceModel::convex_quartic);
  EXPECT_EQ(few.outcome, SurfaceOutcome::too_few_slips);
  EXPECT_THAT(few.reason, testing::HasSubstr("surface 'simulated': 14 slips"));
  SlipSamples one = slips;
  for (SlipSample& s : one.samples) s.direction = {1, 0, 0};
  EXPECT_EQ(fit_surface(one, SurfaceModel::ellipsoid).outcome, SurfaceOutcome::directions_do_not_span);
  SlipSamples plane = slips;
  for (SlipSample& s : plane.samples) {
    const double size = std::hypot(s.direction[0], s.direction[1]);
    s.direction = {s.direction[0] / size, s.direction[1] / size, 0};
  }
  const SurfaceFit flat = fit_surface(plane, SurfaceModel::ellipsoid_full);
  EXPECT_EQ(flat.outcome, SurfaceOutcome::directions_do_not_span);
  EXPECT_THAT(flat.reason, testing::HasSubstr("surface 'simulated': all twists are in one plane"));
  SlipSamples none{"empty", 0.05, {}, {}};
  EXPECT_EQ(fit_surface(none, SurfaceModel::ellipsoid).outcome, SurfaceOutcome::too_few_slips);
  none.characteristic_length = 0;
  EXPECT_THROW(fit_surface(none, SurfaceModel::ellipsoid), std::invalid_argument);
  EXPECT_THROW(surface_model("cube"), std::invalid_argument);
}

TEST(SlipSamples, OneSampleWhileTheTwistKeepsItsDirection) {
  datasets::Surface surface{1, 0.05, "", {}, {}};
  datasets::Slip slip;
  slip.id = "a";
  slip.time = {4, 1, {0, 1, 2, 3}, {}};
  slip.wrench = {4, 3, {1, 0, 0, 3, 0, 0.1, 9, 9, 9, 0, 2, 0}, {}};
  slip.twist = {4, 3, {1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0}, {}};
  surface.slips = {slip};
  const SlipSamples out = slip_samples("felt", surface);
  ASSERT_EQ(out.samples.size(), 2U);  // cut where the twist turns; the row at rest is left out
  // The first row lasts half a second, the second one a whole.
  EXPECT_NEAR(out.samples[0].wrench[0], (0.5 * 1 + 3) / 1.5, 1e-12);
  EXPECT_NEAR(out.samples[0].wrench[2], 2.0 / 1.5, 1e-12);
  EXPECT_EQ(out.samples[1].direction, (std::array<double, 3>{0, 1, 0}));
  EXPECT_EQ(out.slips, std::vector<std::string>{"a"});
}

// Twists that have nothing to do with the wrenches (a push log read with the outline of another object): no
// limit surface has them. A fit of them ends or says that it did not; it does not end the comparison of the
// others.
TEST(SlipSurface, SlipsOfNoSurfaceAreNoError) {
  constexpr unsigned seed = 17;  // of forty, the first whose quartic tends to one that vanishes somewhere
  const Eigen::Matrix3d flat = Eigen::Vector3d(1, 1, 1e-6).asDiagonal();
  auto slips = test::simulate(test::ellipsoid(flat), 20, 0.0, 2.0, seed);
  std::mt19937_64 random(seed);
  for (auto& sample : slips.samples) {
    const Eigen::Vector3d u = test::gauss(random).normalized();
    sample.direction = {u[0], u[1], u[2]};
  }
  SurfaceFit fit;
  ASSERT_NO_THROW(fit = fit_surface(slips, SurfaceModel::convex_quartic));
  EXPECT_EQ(fit.outcome, SurfaceOutcome::not_converged);
}

TEST(SlipSurface, NoContactLawTakesTheNameOfAModel) {
  for (const SurfaceModel model : surface_models)
    EXPECT_THAT(
        unhand::support::refusal([&] {
          contact::register_contact_model({to_string(model), [](const auto&) { return nullptr; }, {}});
        }),
        testing::HasSubstr("no contact law"))
        << to_string(model);
}

}  // namespace
}  // namespace unhand::fitting::test
