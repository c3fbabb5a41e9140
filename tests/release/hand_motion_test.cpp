// Hand motions as piecewise polynomials, and their recovery from logs.
#include "release/hand_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/refusal.hpp"

namespace {

using namespace unhand;
using namespace unhand::release;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Window kAlways{-kInfinity, kInfinity};

std::array<double, 9> flat(const HandState<double>& h) {
  return {h.pose.x,      h.pose.z,          h.pose.theta,      h.twist.vx,          h.twist.vz,
          h.twist.omega, h.acceleration.ax, h.acceleration.az, h.acceleration.alpha};
}

struct Log {
  std::vector<double> time, pose, twist, acceleration;
  std::array<double, 3> sigma{};
  HandSeries series() const {
    const auto all = [](double s) { return std::array{s, s, s}; };
    return {time, pose, twist, acceleration, all(sigma[0]), all(sigma[1]), all(sigma[2])};
  }
};

// Samples f, a state over time, at 1 kHz; at a jump the log holds the later value.
template <class F>
Log record(const F& f, double from, int n, std::array<double, 3> sigma, std::mt19937_64* random) {
  Log log;
  log.sigma = sigma;
  std::normal_distribution<double> normal;
  for (int i = 0; i < n; ++i) {
    const double t = (std::round(1000.0 * from) + i) / 1000.0;
    const auto h = f(t);
    log.time.push_back(t);
    for (int c = 0; c < 9; ++c)
      (c < 3   ? log.pose
       : c < 6 ? log.twist
               : log.acceleration)
          .push_back(h[c] + (random ? sigma[c / 3] * normal(*random) : 0.0));
  }
  return log;
}

// An arm swinging about its shoulder, q(t) = q0 + w t + ½ a t² with another a from t_jump on; the hand turns
// with it.
struct Swing {
  double radius = 0.8, q0 = 0.4, w = 3.0, before = 2.0, after = -25.0, t_jump = 0.05;
  std::array<double, 9> operator()(double t) const {
    const double a = t < t_jump ? before : after, s = t < t_jump ? t : t_jump, r = t - s;
    const double q = q0 + w * s + 0.5 * before * s * s + (w + before * s) * r + 0.5 * a * r * r;
    const double v = w + before * s + a * r;
    const double c = std::cos(q), n = std::sin(q);
    return {radius * c,
            radius * n,
            q,
            -radius * n * v,
            radius * c * v,
            v,
            -radius * (c * v * v + n * a),
            radius * (c * a - n * v * v),
            a};
  }
};

TEST(PolynomialHand, SegmentsJoinWithContinuousTwist) {
  const auto hand =
      PolynomialHand::segments(1.0, {0.1, 0.2, 0.3}, {1.0, -1.0, 2.0},
                               {{1.5, {2.0, 0.0, -4.0}, {0.0, 6.0, 0.0}}, {2.0, {0.0, 0.0, 8.0}, {}}});
  EXPECT_EQ(hand.begin(), 1.0);
  EXPECT_EQ(hand.end(), 2.0);
  EXPECT_EQ(hand.jumps(), std::vector<double>{1.5});
  const auto left = hand.at(Window{1.0, 1.5}, 1.5), right = hand.at(Window{1.5, 2.0}, 1.5);
  EXPECT_NEAR(left.pose.x, 0.1 + 0.5 + 0.25, 1e-15);
  EXPECT_NEAR(left.pose.z, 0.2 - 0.5 + 0.125, 1e-15);
  EXPECT_NEAR(left.pose.x, right.pose.x, 1e-15);
  EXPECT_NEAR(left.twist.vz, right.twist.vz, 1e-15);
  EXPECT_NEAR(left.twist.omega, 0.0, 1e-15);
  EXPECT_NEAR(left.acceleration.az, 3.0, 1e-14);
  EXPECT_EQ(right.acceleration.az, 0.0);
  EXPECT_EQ(left.acceleration.alpha, -4.0);
  EXPECT_EQ(right.acceleration.alpha, 8.0);
  EXPECT_THROW(PolynomialHand::segments(1.0, {}, {}, {{0.5, {}, {}}}), std::invalid_argument);
  EXPECT_THROW(PolynomialHand::segments(1.0, {}, {}, {{1.5, {NAN, 0, 0}, {}}}), std::invalid_argument);
  EXPECT_THROW(PolynomialHand::segments(1.0, {NAN, 0, 0}, {}, {{1.5, {}, {}}}), std::invalid_argument);
  EXPECT_THROW(PolynomialHand(hand.path(), {1.25}), std::invalid_argument);
}

TEST(PolynomialHand, TwistAndAccelerationAreDerivatives) {
  const auto hand = PolynomialHand::segments(0.0, {0.1, 0.2, 0.3}, {1.0, -1.0, 2.0},
                                             {{1.0, {2.0, 1.0, -4.0}, {3.0, 6.0, -2.0}}});
  const auto h = hand.at(kAlways, dynamics::independent(0.4, 0));
  EXPECT_NEAR(h.pose.theta.v[0], h.twist.omega.a, 1e-14);
  EXPECT_NEAR(h.twist.vx.v[0], h.acceleration.ax.a, 1e-14);
  EXPECT_NEAR(h.acceleration.az.v[0], 6.0, 1e-14);
}

TEST(FitHandMotion, FollowsAnExactLogToItsDeclaredPrecision) {
  const Swing swing;
  const Log log = record(swing, -0.01, 311, {1e-6, 1e-6, 1e-6}, nullptr);
  const HandFit fit = fit_hand_motion(log.series());
  ASSERT_EQ(fit.motion.jumps().size(), 1u);
  EXPECT_EQ(fit.motion.jumps()[0], log.time[60]);
  EXPECT_TRUE(fit.summary.noise_reached);
  EXPECT_LT(fit.summary.chi2_per_dof, 1.1);
  // Also between the samples, and on both sides of the jump: the spline's error is the declared 1e-6 times a
  // few in the acceleration, and less in its integrals.
  for (double t = -0.01; t < 0.3; t += 0.37e-3) {
    const auto truth = swing(t), got = flat(fit.motion.at(kAlways, t));
    for (int c = 0; c < 9; ++c)
      EXPECT_NEAR(got[c], truth[c], c < 6 ? 1e-7 : 2e-5) << "t " << t << " column " << c;
  }
  const double jump = fit.motion.jumps()[0];
  EXPECT_NEAR(fit.motion.at(Window{-0.01, jump}, jump).acceleration.alpha, 2.0, 1e-5);
  EXPECT_NEAR(fit.motion.at(Window{jump, 0.3}, jump).acceleration.alpha, -25.0, 1e-5);
}

TEST(FitHandMotion, PlacesAJumpBetweenSamplesWhereTheTwistsMeet) {
  Swing swing;
  swing.t_jump = 0.0503;
  const HandFit fit = fit_hand_motion(record(swing, -0.01, 311, {1e-6, 1e-6, 1e-6}, nullptr).series());
  ASSERT_EQ(fit.motion.jumps().size(), 1u);
  EXPECT_NEAR(fit.motion.jumps()[0], 0.0503, 2e-7);  // a twist of 1e-6 rad/s against a jump of 27 rad/s²
  EXPECT_TRUE(fit.summary.noise_reached);
}

TEST(FitHandMotion, FindsWeakJumps) {
  Swing swing;
  swing.after = swing.before + 0.05;  // 0.05 rad/s² in 2
  const HandFit fit = fit_hand_motion(record(swing, -0.01, 311, {1e-6, 1e-6, 1e-6}, nullptr).series());
  ASSERT_EQ(fit.motion.jumps().size(), 1u);
  EXPECT_NEAR(fit.motion.jumps()[0], 0.05, 1e-12);
}

TEST(FitHandMotion, FindsJumpsThatOnlyTheLongestStretchesShow) {
  std::mt19937_64 random(13);
  constexpr int kRuns = 40;
  int found = 0;
  for (int run = 0; run < kRuns; ++run) {
    Swing swing;
    swing.t_jump = 0.15;
    swing.after = swing.before + 12.0 * 0.05;  // 8 σ of the difference of two cubics through 14 samples each
    const HandFit fit = fit_hand_motion(record(swing, -0.01, 311, {1e-4, 2e-3, 0.05}, &random).series());
    found += fit.motion.jumps().size() == 1 && std::abs(fit.motion.jumps()[0] - 0.15) < 0.01;
  }
  EXPECT_GE(found, kRuns - 2);
}

TEST(FitHandMotion, FindsJumpsInNoiseWithoutInventingAny) {
  std::mt19937_64 random(11);
  int found = 0, misplaced = 0, invented = 0;
  double error = 0.0, total = 0.0;
  constexpr int kRuns = 200;
  for (int run = 0; run < kRuns; ++run) {
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    Swing swing;
    swing.w = 3.0 + uniform(random);
    swing.before = 5.0 * uniform(random);
    swing.after = swing.before;
    const double noise = std::pow(10.0, -2.0 + 1.5 * uniform(random));  // 0.3 to 300 mm/s²
    const std::array<double, 3> sigma = {1e-4, 2e-3, noise};
    const Log smooth = record(swing, -0.01, 311, sigma, &random);
    const HandFit none = fit_hand_motion(smooth.series());
    invented += static_cast<int>(none.motion.jumps().size());
    total += none.summary.chi2_per_dof;
    for (std::size_t k = 0; k < smooth.time.size(); ++k)
      error += std::pow(
          (none.motion.at(kAlways, smooth.time[k]).acceleration.ax - swing(smooth.time[k])[6]) / noise, 2);
    swing.after = swing.before + 20.0 * noise + 10.0 * noise;
    const HandFit one = fit_hand_motion(record(swing, -0.01, 311, sigma, &random).series());
    found += one.motion.jumps().size() == 1;
    misplaced += one.motion.jumps().size() == 1 && std::abs(one.motion.jumps()[0] - 0.05) > 1e-9;
  }
  EXPECT_EQ(invented, 0);
  EXPECT_EQ(found, kRuns);  // a jump of 30 σ of one sample
  EXPECT_EQ(misplaced, 0);
  EXPECT_NEAR(total / kRuns, 1.0, 0.05);
  // Noise reduction: 8 to 20 parameters for 311 samples of acceleration alone.
  EXPECT_LT(std::sqrt(error / kRuns / 311), 1.0 / 3.0);
}

TEST(FitHandMotion, OptimisticNoiseInventsNoJumps) {
  std::mt19937_64 random(12);
  Swing swing;
  swing.after = swing.before;
  for (int run = 0; run < 50; ++run) {
    Log log = record(swing, -0.01, 311, {1e-4, 2e-3, 0.3}, &random);
    log.sigma = {1e-4, 2e-3, 0.03};
    const HandFit fit = fit_hand_motion(log.series());
    EXPECT_TRUE(fit.motion.jumps().empty());
    EXPECT_GT(fit.summary.acceleration_chi2[0], 20.0);
  }
}

TEST(FitHandMotion, DeclaredJumpsAreTaken) {
  const Log log = record(Swing{}, -0.01, 311, {1e-6, 1e-6, 1e-6}, nullptr);
  const std::array<double, 3> declared = {-5.0, 0.05,
                                          0.12};  // the first is outside, at the last nothing happens
  const HandFit fit = fit_hand_motion(log.series(), declared);
  EXPECT_EQ(fit.motion.jumps(), (std::vector<double>{0.05, 0.12}));
  EXPECT_TRUE(fit.summary.noise_reached);
}

TEST(FitHandMotion, ReportsSeriesThatContradictEachOther) {
  // A tracking error: the logged pose lags the integral of the twist by 5 ms.
  const Swing swing;
  Log log = record(swing, -0.01, 311, {1e-4, 1e-3, 1e-2}, nullptr);
  for (int i = 0; i < 311; ++i)
    for (int c = 0; c < 3; ++c) log.pose[3 * i + c] = swing(log.time[i] - 0.005)[c];
  const HandFit fit = fit_hand_motion(log.series());
  EXPECT_FALSE(fit.summary.noise_reached);
  double worst = 0.0;
  for (int c = 0; c < 3; ++c)
    worst = std::max(
        {worst, fit.summary.pose_chi2[c], fit.summary.twist_chi2[c], fit.summary.acceleration_chi2[c]});
  EXPECT_GT(worst, 3.0);
}

// Encoders alone: twist and acceleration are difference quotients of the pose, and agree with its noise.
TEST(FitHandMotion, WhatWasDifferencedIsNoMeasurementOfItsOwn) {
  const Swing swing{.t_jump = 10};
  std::mt19937_64 random(12);
  for (const auto& [noise, turns] : {std::pair(1e-6, true), std::pair(2e-5, true), std::pair(1e-6, false)}) {
    Log log = record(swing, 0, 200, {noise, 0, 0}, &random);
    for (std::size_t i = 0; i < log.time.size() && !turns; ++i)
      log.pose[3 * i + 2] = 0;                                     // a robot of two axes
    const auto differenced = [&](const std::vector<double>& of) {  // central; at the ends to one side
      std::vector<double> out(of.size());
      const std::size_t n = log.time.size();
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t c = 0; c < 3; ++c) {
          const std::size_t a = i == 0 ? 0 : i - 1, b = std::min(i + 1, n - 1);
          out[3 * i + c] = (of[3 * b + c] - of[3 * a + c]) / (log.time[b] - log.time[a]);
        }
      return out;
    };
    log.twist = differenced(log.pose);
    log.acceleration = differenced(log.twist);
    const HandFit fit = fit_hand_motion(log.series());
    EXPECT_TRUE(fit.summary.twist_differenced && fit.summary.acceleration_differenced);
    EXPECT_TRUE(fit.motion.jumps().empty());
    // Three series that agreed would follow the noise to some noise/(2 ms)²; a smooth motion of 0.2 s is
    // known far better.
    double worst = 0;
    for (double t = 0.02; t < 0.18; t += 1e-3) {
      const auto got = flat(fit.motion.at(kAlways, t)), right = swing(t);
      for (std::size_t k = 6; k < (turns ? 9U : 8U); ++k)
        worst = std::max(worst, std::abs(got[k] - right[k]));
    }
    EXPECT_LT(worst, 0.02 * noise / (2e-3 * 2e-3)) << noise;
  }
  // Measured beside the pose: noise of their own.
  const Log own = record(swing, 0, 200, {1e-5, 1e-3, 0.1}, &random);
  const auto kept = fit_hand_motion(own.series()).summary;
  EXPECT_FALSE(kept.twist_differenced || kept.acceleration_differenced);
  // Of a motion without noise every derivative is its difference quotient, as nearly as samples are dense.
  const Log exact = record([](double t) { return std::array{t, t, t, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0}; }, 0, 200,
                           {0, 0, 0}, nullptr);
  const auto smooth = fit_hand_motion(exact.series()).summary;
  EXPECT_FALSE(smooth.twist_differenced || smooth.acceleration_differenced);
}

TEST(FitHandMotion, EstimatesNoiseThatIsNotDeclared) {
  std::mt19937_64 random(13);
  Log log = record(Swing{}, -0.01, 311, {1e-4, 2e-3, 0.1}, &random);
  log.sigma = {0.0, NAN, kInfinity};
  const HandFit fit = fit_hand_motion(log.series());
  EXPECT_NEAR(fit.summary.twist_sigma[0], 2e-3, 0.6e-3);  // a median of 300 correlated differences
  EXPECT_NEAR(fit.summary.acceleration_sigma[2], 0.1, 0.03);
  ASSERT_EQ(fit.motion.jumps().size(), 1u);
  EXPECT_NEAR(fit.motion.jumps()[0], 0.05, 1e-9);
}

TEST(FitHandMotion, TakesShortLogsAndRejectsBrokenOnes) {
  for (int n : {4, 5, 9, 20})
    EXPECT_NO_THROW(fit_hand_motion(record(Swing{}, 0.045, n, {1e-6, 1e-6, 1e-6}, nullptr).series())) << n;
  EXPECT_THROW(fit_hand_motion(record(Swing{}, 0.0, 3, {1e-6, 1e-6, 1e-6}, nullptr).series()),
               std::invalid_argument);
  Log log = record(Swing{}, 0.0, 50, {1e-6, 1e-6, 1e-6}, nullptr);
  log.twist[17] = NAN;
  EXPECT_THROW(fit_hand_motion(log.series()), std::invalid_argument);
  log.twist[17] = 0.0;
  log.twist.pop_back();
  EXPECT_THROW(fit_hand_motion(log.series()), std::invalid_argument);
  log.twist.push_back(0.0);
  std::swap(log.time[3], log.time[4]);
  EXPECT_THROW(fit_hand_motion(log.series()), std::invalid_argument);
}

/// What the constructor says of x(t) in two pieces that meet at 1 s.
std::string refusal_of(const std::vector<double>& first, const std::vector<double>& second) {
  std::vector<PolynomialHand::Polynomial::Coefficients> pieces(2);
  for (std::size_t k = 0; k < first.size(); ++k) pieces[0][k][0] = first[k];
  for (std::size_t k = 0; k < second.size(); ++k) pieces[1][k][0] = second[k];
  return unhand::support::refusal([&] { PolynomialHand({{0.0, 1.0, 2.0}, pieces}); });
}

TEST(PolynomialHand, RefusesPathsThatJumpOrAreNoNumbers) {
  EXPECT_EQ(refusal_of({0.05, 0.1, 0.2}, {0.35, 0.5}), "accepted");
  EXPECT_EQ(refusal_of({0.05, 0.1, 0.2}, {0.35 + 1e-10, 0.5}), "accepted") << "rounding";
  EXPECT_EQ(refusal_of({0.05, 0, 0}, {100, 0}), "PolynomialHand: x jumps by 99.95 at 1 s");
  EXPECT_EQ(refusal_of({0, 1, 0}, {1, 1.5}), "PolynomialHand: the rate of x jumps by 0.5 at 1 s");
  EXPECT_EQ(refusal_of({0, 0}, {0, 0, NAN}), "PolynomialHand: x is not finite between 1 and 2 s");
}

TEST(PolynomialHand, SegmentsNameTheirOwnArguments) {
  const auto refusal = [](double begin, const std::vector<HandSegment>& stretches) {
    return unhand::support::refusal([&] { PolynomialHand::segments(begin, {}, {}, stretches); });
  };
  EXPECT_EQ(refusal(0, {}), "PolynomialHand::segments: stretches is empty; at least one is needed");
  EXPECT_EQ(refusal(NAN, {{1, {}, {}}}), "PolynomialHand::segments: t_start = nan s is not finite");
  EXPECT_EQ(refusal(0, {{INFINITY, {}, {}}}),
            "PolynomialHand::segments: t_end = inf s is not in (0, inf) s, after the end before it");
  EXPECT_EQ(refusal(0, {{1e-9, {}, {}}, {1e-10, {}, {}}}),
            "PolynomialHand::segments: t_end = 1e-10 s is not in (1e-09, inf) s, after the end before it");
  EXPECT_EQ(refusal(0, {{1e200, {1e200, 0, 0}, {}}}),
            "PolynomialHand::segments: pose and twist at 1e+200 s are not finite");
}

}  // namespace
