// The acceleration without a form that flights and falls leave, where it is known what is missing.
#include "fitting/measured/missing_acceleration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "dynamics/twice_integrated.hpp"
#include "fitting/measured/flight_discovery.hpp"
#include "tests/support/spatial_flights.hpp"

namespace unhand::fitting {
namespace {

using flight::Vec3;
using unhand::test::spatial_flights;
using unhand::test::SpatialDesign;

/// A base fit without effects, of the train flights and of the held-out ones.
struct Base {
  FlightProblem problem;
  GroupedFit train, test;
  explicit Base(const datasets::ThrowLog& log)
      : problem(log, 1),
        train(fit_groups(problem, datasets::Split::train, {}, Eigen::VectorXd())),
        test(fit_own(problem, datasets::Split::test, train)) {}
  std::optional<MissingAcceleration> missing() const {
    return missing_acceleration(problem, train, test, {});
  }
  GroupMotion motion(std::size_t i) const {
    const GroupedFit& of = train.groups[i].used ? train : test;
    return problem.motion(i, {}, {}, of.groups[i].own);
  }
};

/// The flights of a log as they would have been seen if an acceleration [m/s²] had moved them beside.
datasets::ThrowLog accelerated(
    datasets::ThrowLog log, const std::function<Vec3<double>(const GroupMotion&, std::size_t sample)>& by) {
  const Base base(log);
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    const GroupMotion motion = base.motion(i);
    auto& position = log.throws[i].mocap->pose;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::vector<double> a;
      for (std::size_t k = 0; k < motion.time.size(); ++k) a.push_back(by(motion, k)[axis]);
      const auto moved = dynamics::twice_integrated(motion.time, a);
      for (std::size_t k = 0; k < moved.size(); ++k) position(k, axis) += moved[k];
    }
  }
  return log;
}

/// The largest distance from the truth, in sigmas, where a tenth of `scale` more is allowed for what straight
/// lines between knots miss.
double farthest(const MissingComponent& c, double scale, const std::function<double(double)>& truth) {
  double out = 0;
  for (std::size_t j = 0; j < c.at.size(); ++j)
    out = std::max(out, std::abs(c.value[j] - truth(c.at[j])) / std::hypot(c.sigma[j], 0.1 * scale / 4));
  return out;
}

TEST(MissingAcceleration, TheMotionIsThatOfTheFlight) {
  const auto log = spatial_flights({}, {}, 4);
  const Base base(log);
  for (const std::size_t i : {0u, 7u}) {
    const auto motion = base.motion(i);
    ASSERT_EQ(motion.time.size(), motion.velocity.size());
    for (std::size_t k = 1; k < motion.time.size(); ++k) {
      EXPECT_NEAR(motion.velocity[k][0], motion.velocity[0][0], 1e-6);
      EXPECT_NEAR(motion.velocity[k][2] - motion.velocity[0][2],
                  -log.gravity * (motion.time[k] - motion.time[0]),
                  2e-3);  // of half a tenth of a millisecond at the start
      EXPECT_NEAR(flight::norm(motion.body[k][1]), 1, 1e-12);
      EXPECT_NEAR(flight::dot(motion.body[k][0], motion.body[k][2]), 0, 1e-12);
    }
  }
}

TEST(MissingAcceleration, AWaveOfTimeIsFoundAlongItsAxis) {
  constexpr double kSize = 0.4;
  SpatialDesign design;
  const double duration = design.samples / design.rate;
  const auto wave = [&](double t) { return kSize * std::sin(2 * std::numbers::pi * t / duration); };
  const auto log = accelerated(spatial_flights({}, design, 11), [&](const GroupMotion& m, std::size_t k) {
    return Vec3<double>{0, wave(m.time[k]), 0};
  });
  const auto missing = Base(log).missing();
  ASSERT_TRUE(missing.has_value());
  EXPECT_TRUE(missing->helps);
  EXPECT_EQ(missing->of, "along the axes of the world");
  EXPECT_EQ(missing->against, "time [s]");
  ASSERT_EQ(missing->components.size(), 3u);
  // A straight line in the acceleration, whose double integral the free start hardly tells from nothing, is
  // left open: the wave's distance from its own.
  EXPECT_LT(farthest(missing->components[1], kSize, wave), 4);
  const auto none = [](double) { return 0.0; };
  EXPECT_LT(farthest(missing->components[0], kSize, none), 4);
  EXPECT_LT(farthest(missing->components[2], kSize, none), 4);
  EXPECT_GT(missing->test_before, 2);
  EXPECT_LT(missing->test_after, 1.2);
}

TEST(MissingAcceleration, ABrakeThatSetsInAtASpeedIsFoundAlongTheVelocity) {
  constexpr double kSlope = 0.2, kFrom = 3;  // 1/s, m/s
  const auto brake = [&](double speed) { return -kSlope * std::max(0.0, speed - kFrom); };
  const auto log = accelerated(spatial_flights({}, {}, 12), [&](const GroupMotion& m, std::size_t k) {
    const double speed = flight::norm(m.velocity[k]);
    return flight::scaled(brake(speed) / speed, m.velocity[k]);
  });
  const auto missing = Base(log).missing();
  ASSERT_TRUE(missing.has_value());
  EXPECT_TRUE(missing->helps);
  EXPECT_EQ(missing->of, "along the velocity");
  EXPECT_EQ(missing->against, "speed [m/s]");
  ASSERT_EQ(missing->components.size(), 1u);
  const auto& c = missing->components.front();
  EXPECT_LT(farthest(c, std::abs(brake(c.at.back())), brake), 4);
  EXPECT_GT(missing->test_before, 2);
  EXPECT_LT(missing->test_after, 1.2);
}

// Two objects of one log, of which something brakes both alike, or one only.
TEST(MissingAcceleration, ObjectsThatDifferHaveFunctionsOfTheirOwn) {
  constexpr double kBrake = -0.5;  // m/s^2
  const auto plain = spatial_flights({}, {}, 12);
  const auto braked = accelerated(plain, [&](const GroupMotion& m, std::size_t k) {
    return flight::scaled(kBrake / flight::norm(m.velocity[k]), m.velocity[k]);
  });
  for (const bool alike : {true, false}) {
    datasets::ThrowLog log = braked;
    log.objects.emplace("other", log.objects.at("body"));
    for (std::size_t i = 0; i < log.throws.size(); i += 3) {
      if (!alike) log.throws[i] = plain.throws[i];
      log.throws[i].object = "other";
    }
    const auto missing = Base(log).missing();
    ASSERT_TRUE(missing.has_value());
    EXPECT_TRUE(missing->helps);
    EXPECT_EQ(missing->of, "along the velocity");
    EXPECT_LT(missing->test_after, 1.2);
    ASSERT_EQ(missing->components.size(), alike ? 1u : 2u);
    for (const MissingComponent& c : missing->components) {
      EXPECT_EQ(c.name(), alike ? "the velocity" : "the velocity of " + c.object);
      const double size = c.object == "other" ? 0 : kBrake;
      EXPECT_LT(farthest(c, std::abs(kBrake), [&](double) { return size; }), 4) << c.name();
    }
  }
}

TEST(MissingAcceleration, ASideForceIsFoundAlongTheBody) {
  unhand::test::SpatialTruth truth;
  truth.side_force = 0.3;
  const auto missing = Base(spatial_flights(truth, {}, 13)).missing();
  ASSERT_TRUE(missing.has_value());
  EXPECT_TRUE(missing->helps);
  EXPECT_EQ(missing->of, "along the axes of the body");
  ASSERT_EQ(missing->components.size(), 3u);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_LT(farthest(missing->components[c], 0.1, [&](double) { return c == 0 ? truth.side_force : 0; }), 4)
        << c;
  EXPECT_LT(missing->test_after, 1.2);
}

TEST(MissingAcceleration, NoiseIsHardlyEverTakenForOne) {
  int helps = 0;
  constexpr int kCampaigns = 20;
  for (unsigned seed = 100; seed < 100 + kCampaigns; ++seed) {
    const auto missing = Base(spatial_flights({}, {}, seed)).missing();
    helps += missing && missing->helps;
  }
  EXPECT_LE(helps, 3);  // two standard errors: one in 40 by chance; more than three of 20: one in 5,000
}

}  // namespace
}  // namespace unhand::fitting
