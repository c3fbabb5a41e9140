// The opening profile with its derivatives, and normal forces recovered from noisy series.
#include "contact/normal_force.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "contact/friction_effects.hpp"
#include "tests/support/best_difference.hpp"
#include "tests/support/refusal.hpp"

namespace {

using namespace unhand;
using namespace unhand::contact;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Window kAlways{-kInfinity, kInfinity};

OpeningProfile<double> profile(double p) { return {0.05, 25.0, 0.007, 0.055, p}; }

TEST(ProfileNormalForce, IsTheFormula) {
  for (double p : {0.7, 1.0, 1.25, 2.5}) {
    const ProfileNormalForce f(profile(p));
    EXPECT_EQ(f.at(kAlways, -1.0), 25.0);
    EXPECT_EQ(f.at(kAlways, 0.057), 25.0);
    EXPECT_NEAR(f.at(kAlways, 0.057 + 0.25 * 0.055), 25.0 * std::pow(0.75, p), 1e-12);
    EXPECT_EQ(f.at(kAlways, 0.2), 0.0);
    EXPECT_NEAR(f.release_time(), 0.112, 1e-15);
    EXPECT_EQ(f.kinks(), (std::vector<double>{0.05 + 0.007, f.release_time()}));
  }
}

TEST(ProfileNormalForce, DerivativesAreThoseOfTheFormula) {
  // parameters 0 ... 3, time 4
  const double t = 0.08;
  for (double p : {0.7, 1.0, 2.0}) {
    const OpeningProfile<double> q = profile(p);
    const OpeningProfile<Dual> d{q.open_command, Dual(q.grip_force, 0), Dual(q.dead_time, 1),
                                 Dual(q.opening_time, 2), Dual(q.shape, 3)};
    const Dual f = ProfileNormalForce(d).at(kAlways, Dual(t, 4));
    EXPECT_EQ(f.a, ProfileNormalForce(q).at(kAlways, t));
    for (int k = 0; k < 5; ++k) {
      const auto shifted = [&](double h) {
        OpeningProfile<double> x = q;
        if (k == 0) x.grip_force += h;
        if (k == 1) x.dead_time += h;
        if (k == 2) x.opening_time += h;
        if (k == 3) x.shape += h;
        return ProfileNormalForce(x).at(kAlways, k == 4 ? t + h : t);
      };
      EXPECT_LT(unhand::support::best_difference(shifted, 0, f.v[k], 1e-4),
                1e-8 * std::max(1.0, std::abs(f.v[k])))
          << "p " << p << " parameter " << k;
    }
    std::vector<Dual> kinks;
    ProfileNormalForce(d).kinks(kinks);
    ASSERT_EQ(kinks.size(), 2u);
    EXPECT_EQ(kinks[1].a, ProfileNormalForce(q).release_time());
    EXPECT_EQ(kinks[0].v[1], 1.0);
    EXPECT_EQ(kinks[0].v[2], 0.0);
    EXPECT_EQ(kinks[1].v[2], 1.0);
  }
}

TEST(ProfileNormalForce, TakesTheBranchOfTheWindowAndStaysFinite) {
  for (double p : {0.5, 1.0, 1.5, 3.0}) {
    const OpeningProfile<double> q = profile(p);
    const ProfileNormalForce f(OpeningProfile<Dual>{q.open_command, Dual(q.grip_force), Dual(q.dead_time),
                                                    Dual(q.opening_time), Dual(q.shape, 3)});
    const double start = f.kinks()[0], end = f.kinks()[1];
    EXPECT_EQ(f.at(Window{0.0, start}, Dual(start, 0)).v[0], 0.0);
    EXPECT_NEAR(f.at(Window{start, end}, Dual(start, 0)).v[0], -25.0 * p / 0.055, 1e-9);
    EXPECT_EQ(f.at(Window{end, 1.0}, Dual(end, 0)).v[0], 0.0);
    const Dual last = f.at(Window{start, end}, Dual(end, 0));
    EXPECT_GE(last.a, 0.0);
    EXPECT_LT(last.a, 1e-6);
    for (int k = 0; k < dynamics::kDualSize; ++k) EXPECT_TRUE(std::isfinite(last.v[k]));
    if (p == 1.0) {
      EXPECT_NEAR(last.v[0], -25.0 / 0.055, 1e-9);
    }  // the limit from the left
  }
}

TEST(ProfileNormalForce, RejectsWhatIsOutOfRange) {
  const auto message = [](const OpeningProfile<double>& q) {
    return unhand::support::refusal([&] { ProfileNormalForce{q}; });
  };
  OpeningProfile<double> q = profile(1.0);
  EXPECT_EQ(message(q), "accepted");
  q.shape = 0.0;
  EXPECT_NE(message(q).find("shape"), std::string::npos);
  q = profile(1.0);
  q.opening_time = -0.1;
  EXPECT_NE(message(q).find("opening_time = -0.1"), std::string::npos);
  q = profile(1.0);
  q.dead_time = -1e-3;
  EXPECT_NE(message(q).find("dead_time"), std::string::npos);
  q = profile(1.0);
  q.grip_force = NAN;
  EXPECT_NE(message(q).find("grip_force"), std::string::npos);
}

struct Log {
  std::vector<double> time, value;
};

template <class F>
Log record(const F& f, double noise, std::mt19937_64& random, double from = -0.01, int n = 311) {
  std::normal_distribution<double> normal;
  Log log;
  for (int k = 0; k < n; ++k) {
    log.time.push_back(from + 1e-3 * k);
    log.value.push_back(f(log.time.back()) + noise * normal(random));
  }
  return log;
}

double ramp(double t, double f0, double start, double length, double p) {
  return f0 * std::pow(std::clamp((start + length - t) / length, 0.0, 1.0), p);
}

// Every promise of the class, whatever the series was.
void expect_sound(const NormalForceFit& fit, const Log& log) {
  const double release = fit.force.release_time();
  const auto kinks = fit.force.kinks();
  std::vector<double> events = {log.time.front()};
  for (double k : kinks)
    if (k > events.back() && k < log.time.back()) events.push_back(k);
  events.push_back(log.time.back());
  double before = -1.0;
  for (std::size_t i = 0; i + 1 < events.size(); ++i) {
    const Window window{events[i], events[i + 1]};
    for (int k = 0; k <= 50; ++k) {
      const double t = window.begin + (window.end - window.begin) * k / 50.0;
      const double f = fit.force.at(window, t);
      ASSERT_TRUE(std::isfinite(f) && f >= 0.0) << t;
      if (window.begin >= release) {
        ASSERT_EQ(f, 0.0) << t;
      }
      if (k == 0 && before >= 0.0) {
        EXPECT_NEAR(f, before, 1e-3) << "the force jumps at " << t;
      }
      before = f;
    }
  }
  if (std::isfinite(release)) {
    ASSERT_FALSE(kinks.empty());
    EXPECT_EQ(kinks.back(), release);
    EXPECT_EQ(fit.force.at(kAlways, release + 1.0), 0.0);
  }
  EXPECT_EQ(fit.summary.release_time, release);
}

TEST(SmoothNormalForce, FindsTheReleaseToAFractionOfASample) {
  std::mt19937_64 random(21);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  // With 25 N over 55 ms and 0.05 N of noise, the covariance of (release, p) gives 0.03, 0.06, 0.09, 0.21
  // samples: the flatter the end, the less it is seen.
  struct Case {
    double p, bound;
  };
  for (const Case& c : {Case{0.7, 0.05}, {1.0, 0.08}, {1.25, 0.12}, {2.0, 0.30}}) {
    const double p = c.p, bound = c.bound;
    double sum = 0.0, square = 0.0, claimed = 0.0, error = 0.0;
    int samples = 0;
    constexpr int kRuns = 200;
    for (int run = 0; run < kRuns; ++run) {
      const double start = 0.057 + 1e-3 * uniform(random), length = 0.05 + 0.01 * uniform(random);
      const auto truth = [&](double t) { return ramp(t, 25.0, start, length, p); };
      const Log log = record(truth, 0.05, random);
      const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
      expect_sound(fit, log);
      const double e = (fit.summary.release_time - start - length) / 1e-3;
      sum += e;
      square += e * e;
      claimed += fit.summary.release_sigma / 1e-3;
      for (double t : log.time)
        if (t < start + length) {
          error += std::pow(fit.force.at(kAlways, t) - truth(t), 2);
          ++samples;
        }
      EXPECT_NEAR(fit.summary.opening_start, start, 0.5e-3);
      EXPECT_NEAR(fit.summary.shape, p, 0.08 * p);
    }
    const double mean = sum / kRuns, scatter = std::sqrt(square / kRuns - mean * mean);
    EXPECT_LT(std::abs(mean), 0.1) << p;
    EXPECT_LT(scatter, bound) << p;
    EXPECT_NEAR(scatter, claimed / kRuns, 0.2 * scatter) << p;  // 200 runs know their scatter to 5 %
    EXPECT_LT(std::sqrt(error / samples), 0.05 / 3.0) << p;  // noise reduction: six parameters, 120 samples
  }
}

TEST(SmoothNormalForce, ExactSeriesIsReproduced) {
  std::mt19937_64 random(1);
  for (double p : {0.8, 1.0, 1.5}) {
    const auto truth = [&](double t) { return ramp(t, 25.0, 0.0573, 0.0542, p); };
    const Log log = record(truth, 0.0, random);
    const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
    expect_sound(fit, log);
    EXPECT_NEAR(fit.summary.release_time, 0.1115, 1e-6);
    // the pieces follow the curve to a fraction of the declared noise
    for (double t = -0.01; t < 0.12; t += 0.31e-3) EXPECT_NEAR(fit.force.at(kAlways, t), truth(t), 0.01) << t;
  }
}

TEST(SmoothNormalForce, SlopeIsTheDerivative) {
  std::mt19937_64 random(22);
  const Log log = record([](double t) { return ramp(t, 25.0, 0.057, 0.055, 1.25); }, 0.05, random);
  const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
  const double t = 0.08, h = 1e-6;
  const Dual f = fit.force.at(kAlways, Dual(t, 0));
  EXPECT_EQ(f.a, fit.force.at(kAlways, t));
  EXPECT_NEAR(f.v[0], (fit.force.at(kAlways, t + h) - fit.force.at(kAlways, t - h)) / (2 * h), 1e-5);
  EXPECT_NEAR(f.v[0], -25.0 * 1.25 / 0.055 * std::pow(32.0 / 55.0, 0.25), 5.0);
}

TEST(SmoothNormalForce, BiasIsReportedAndDoesNotMoveTheRelease) {
  std::mt19937_64 random(23);
  for (double bias : {0.3, -0.3}) {
    double sum = 0.0, chi2 = 0.0, pulls = 0.0;
    for (int run = 0; run < 50; ++run) {
      const Log log =
          record([&](double t) { return ramp(t, 25.0, 0.0575, 0.055, 1.0) + bias; }, 0.05, random);
      const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
      expect_sound(fit, log);
      sum += fit.summary.release_time - 0.1125;
      EXPECT_NEAR(fit.summary.tail_mean, bias, 6.0 * fit.summary.tail_mean_sigma);
      pulls += std::pow((fit.summary.tail_mean - bias) / fit.summary.tail_mean_sigma, 2) / 50;
      chi2 += fit.summary.chi2_per_dof / 50;
      EXPECT_NEAR(fit.force.at(kAlways, 0.0), 25.0 + bias, 0.05);  // the grip is as measured
    }
    EXPECT_LT(std::abs(sum / 50), 0.1e-3);
    EXPECT_NEAR(pulls, 1, 4 * std::sqrt(2.0 / 50)) << "the bias is known as well as it is said to be";
    EXPECT_NEAR(chi2, 1, 0.1) << "force and bias together are the series: 311 samples, 50 times";
  }
  // A pad that keeps pressing is not a bias.
  const Log log = record([](double t) { return ramp(t, 20.0, 0.0575, 0.055, 1.0) + 5.0; }, 0.05, random);
  const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
  expect_sound(fit, log);
  EXPECT_EQ(fit.summary.release_time, kInfinity);
  EXPECT_NEAR(fit.force.at(kAlways, 0.2), 5.0, 0.05);
  EXPECT_NEAR(fit.force.at(kAlways, 9.0), 5.0, 0.2);
}

// A filter before the sampling, or a cable: noise that stays for ten samples makes them one witness.
TEST(SmoothNormalForce, NoiseThatStaysIsCounted) {
  std::mt19937_64 random(26);
  for (const double stays : {0.0, 0.7, 0.9}) {
    std::normal_distribution<double> normal(0.0, 0.05 * std::sqrt(1 - stays * stays));
    double squares = 0, claimed = 0;
    constexpr int kRuns = 200;
    for (int run = 0; run < kRuns; ++run) {
      double noise = 0;
      const Log log = record(
          [&](double t) {
            noise = stays * noise + normal(random);
            return ramp(t, 25.0, 0.057, 0.055, 1.25) + noise;
          },
          0.0, random);
      const auto summary = smooth_normal_force(log.time, log.value, 0.05).summary;
      squares += std::pow(summary.release_time - 0.112, 2) / kRuns;
      claimed += std::pow(summary.release_sigma, 2) / kRuns;
    }
    // Of some ten witnesses the correlation itself is known to a factor.
    const double ratio = std::sqrt(claimed / squares);
    EXPECT_GT(ratio, stays > 0 ? 0.7 : 0.8) << stays;
    EXPECT_LT(ratio, stays > 0 ? 2.0 : 1.2) << stays;
  }
}

// Two or three samples of a ramp do not tell its shape, and with it not where it ends: σ says so, and no more
// than that the force was seen to fall.
TEST(SmoothNormalForce, OfAHandfulOfSamplesTheReleaseIsAsUncertainAsItIs) {
  std::mt19937_64 random(25);
  std::normal_distribution<double> noise(0.0, 0.05);
  double squares = 0;
  int runs = 0;
  for (const double shape : {1.0, 2.0})
    for (const double step : {0.02, 0.025})
      for (double begin = 0; begin < step; begin += step / 7) {
        Log log;
        for (double t = begin; t < 0.3; t += step) {
          log.time.push_back(t);
          log.value.push_back(ramp(t, 25.0, 0.057, 0.055, shape) + noise(random));
        }
        const auto summary = smooth_normal_force(log.time, log.value, 0.05).summary;
        ASSERT_TRUE(std::isfinite(summary.release_time)) << shape << ' ' << step << ' ' << begin;
        EXPECT_LE(summary.release_sigma, 0.5 * (summary.release_time - summary.ramp_start));
        EXPECT_LT(summary.release_sigma, 2 * step);
        squares += std::pow((summary.release_time - 0.112) / summary.release_sigma, 2);
        ++runs;
      }
  EXPECT_LT(std::sqrt(squares / runs), 1.2);
  EXPECT_GT(std::sqrt(squares / runs), 0.1);
}

TEST(SmoothNormalForce, NoReleaseWhereTheSeriesEndsFirst) {
  std::mt19937_64 random(24);
  for (int n :
       {20, 66, 90, 115, 122}) {  // in the grip, at the start, in the ramp, near its end (122: 0.5 ms before)
    const Log log =
        record([](double t) { return ramp(t, 25.0, 0.0575, 0.055, 1.0); }, 0.05, random, -0.01, n);
    const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
    expect_sound(fit, log);
    EXPECT_EQ(fit.summary.release_time, kInfinity) << n;
  }
}

// A level of four sigma of a sample is seventy of the mean of three hundred.
TEST(SmoothNormalForce, ALightGripIsNoRelease) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise;
  for (const auto& [level, sigma] : {std::pair{4.0, 1.0}, {2.0, 0.5}, {6.0, 1.0}, {0.0, 1.0}}) {
    std::vector<double> time, value;
    for (int k = 0; k < 300; ++k) {
      time.push_back(1e-3 * k);
      value.push_back(level + sigma * noise(random));
    }
    const auto fit = smooth_normal_force(time, value, sigma);
    if (level == 0) {
      EXPECT_EQ(fit.force.release_time(), time.front());
      continue;
    }
    EXPECT_EQ(fit.force.release_time(), std::numeric_limits<double>::infinity()) << level;
    EXPECT_NEAR(fit.force.at({0.0, 0.3}, 0.15), level, sigma) << level;
  }
}

TEST(SmoothNormalForce, OtherRampsAreFollowedByASpline) {
  std::mt19937_64 random(25);
  // A slowly varying grip, and a ramp that is no power: steep, a shelf, steep again.
  const auto truth = [](double t) {
    const double grip = 25.0 + 0.8 * std::sin(40.0 * std::min(t, 0.0575));
    const double u = std::clamp((0.1125 - t) / 0.055, 0.0, 1.0);
    return grip * (u + 0.12 * std::sin(2.0 * 3.14159265358979 * u));
  };
  double sum = 0.0, square = 0.0;
  for (int run = 0; run < 50; ++run) {
    const Log log = record(truth, 0.05, random);
    const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
    expect_sound(fit, log);
    EXPECT_FALSE(fit.summary.power_law);
    EXPECT_LT(fit.summary.chi2_per_dof, 1.6);
    const double e = (fit.summary.release_time - 0.1125) / 1e-3;
    sum += e;
    square += e * e;
    EXPECT_LT(std::abs(e), 4 * fit.summary.release_sigma / 1e-3);  // which form the end has is not known
  }
  EXPECT_LT(std::sqrt(square / 50), 0.5);
  EXPECT_LT(std::abs(sum / 50), 0.3);  // the power that stands in for the ramp's end is not its form
}

// Ramps that end more flatly, or more steeply, than the power that fits the whole of them: taken for one,
// they end a millisecond early or late, with a σ that does not know.
TEST(SmoothNormalForce, TheReleaseOfARampThatIsNoPowerIsAsUncertainAsItIs) {
  std::mt19937_64 random(31);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const auto cosine = [](double s) { return 0.5 * (1.0 + std::cos(3.14159265358979 * s)); };
  const auto quarter = [](double s) { return std::cos(0.5 * 3.14159265358979 * s); };
  const auto parabola = [](double s) { return 1.0 - s * s; };
  const auto exponential = [](double s) {
    return (std::exp(-2.0 * s) - std::exp(-2.0)) / (1.0 - std::exp(-2.0));
  };
  // Bounds on the mean error [ms]: a third of what the power that fits misses by.
  const std::vector<std::pair<std::function<double(double)>, double>> shapes = {
      {cosine, 0.35}, {quarter, 0.06}, {parabola, 0.06}, {exponential, 0.6}};
  for (std::size_t shape = 0; shape < shapes.size(); ++shape) {
    double sum = 0.0, squares = 0.0;
    constexpr int kRuns = 100;
    for (int run = 0; run < kRuns; ++run) {
      const double start = 0.057 + 1e-3 * uniform(random), length = 0.05 + 0.01 * uniform(random);
      const auto truth = [&](double t) {
        return 40.0 * shapes[shape].first(std::clamp((t - start) / length, 0.0, 1.0));
      };
      const Log log = record(truth, 0.05, random);
      const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
      expect_sound(fit, log);
      EXPECT_FALSE(fit.summary.power_law);
      const double e = fit.summary.release_time - start - length;
      sum += 1e3 * e / kRuns;
      squares += std::pow(e / fit.summary.release_sigma, 2) / kRuns;
    }
    EXPECT_LT(std::abs(sum), shapes[shape].second) << shape;
    EXPECT_LT(std::sqrt(squares), 1.3) << shape;
    EXPECT_GT(std::sqrt(squares), 0.5) << shape;
  }
}

// No sensor measured what a spline through spikes swings to.
TEST(SmoothNormalForce, StaysWithinWhatWasMeasured) {
  std::mt19937_64 random(32);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal;
  for (int run = 0; run < 1000; ++run) {
    const int n = 20 + static_cast<int>(100 * uniform(random));
    const double start = 0.3 * n * uniform(random), length = n * (0.02 + 0.5 * uniform(random));
    Log log;
    double most = 0.0;
    for (int k = 0; k < n; ++k) {
      log.time.push_back(1e-3 * k);
      double f = ramp(k, 25.0, start, length, 0.4 + 2.0 * (run % 10) / 10) + 0.05 * normal(random);
      if (run % 2 == 0 && uniform(random) < 0.05) f += 30.0 * normal(random);
      if (run % 4 == 1) f = k < n - 5 ? (k % 2 ? 20.0 : -20.0) * uniform(random) : 0.0;
      log.value.push_back(f);
      most = std::max(most, std::abs(f));
    }
    const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
    expect_sound(fit, log);
    for (double t = log.time.front(); t < log.time.back(); t += 1.3e-4)
      ASSERT_LT(fit.force.at(kAlways, t), 1.5 * most) << run << ' ' << t;
  }
}

// Too few samples of a ramp to judge its form: the model is followed, and nothing is said to be to within
// noise.
TEST(SmoothNormalForce, AFormThatMissesIsNotCalledAPower) {
  std::mt19937_64 random(33);
  const auto truth = [](double t) { return t < 0.1 ? 25.0 : t < 0.1025 ? 5.0 : t < 0.1045 ? 8.0 : 0.0; };
  const Log log = record(truth, 0.05, random);
  const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
  expect_sound(fit, log);
  EXPECT_GT(fit.summary.chi2_per_dof, 1.5);
  EXPECT_FALSE(fit.summary.power_law);
}

TEST(SmoothNormalForce, LaterGripsAndOddSeriesAreSurvived) {
  std::mt19937_64 random(26);
  const auto again = [](double t) {  // opens, closes once more, opens for good
    if (t < 0.1) return ramp(t, 25.0, 0.02, 0.04, 1.0);
    if (t < 0.13) return 15.0 * (t - 0.1) / 0.03;
    return ramp(t, 15.0, 0.16, 0.05, 1.0);
  };
  Log log = record(again, 0.05, random);
  NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
  expect_sound(fit, log);
  EXPECT_NEAR(fit.summary.release_time, 0.21, 0.5e-3);

  log = record([](double) { return 0.0; }, 0.05, random);  // never gripped
  fit = smooth_normal_force(log.time, log.value, 0.05);
  expect_sound(fit, log);
  EXPECT_EQ(fit.summary.release_time, log.time.front());

  log = record([](double) { return 20.0; }, 0.05, random);  // never opened
  fit = smooth_normal_force(log.time, log.value, 0.05);
  expect_sound(fit, log);
  EXPECT_EQ(fit.summary.release_time, kInfinity);

  log = record([](double t) { return t < 0.1 ? 20.0 : 0.0; }, 0.05, random);  // at once
  fit = smooth_normal_force(log.time, log.value, 0.05);
  expect_sound(fit, log);
  EXPECT_NEAR(fit.summary.release_time, 0.1, 1.5e-3);
  EXPECT_GE(fit.summary.release_sigma, 1e-3 / std::sqrt(12.0));  // between two samples nothing is seen

  log = record([](double t) { return ramp(t, 20.0, -0.05, 0.1, 1.0); }, 0.05,
               random);  // opening before the log
  fit = smooth_normal_force(log.time, log.value, 0.05);
  expect_sound(fit, log);
  EXPECT_NEAR(fit.summary.release_time, 0.05, 0.5e-3);
  EXPECT_TRUE(std::isnan(fit.summary.opening_start));
  EXPECT_EQ(fit.summary.ramp_start, log.time.front());
  EXPECT_NEAR(fit.summary.release_time, 0.05, 4 * fit.summary.release_sigma);

  for (int n = 4; n < 14; ++n) {  // hardly any samples
    log = record([](double t) { return ramp(t, 20.0, 0.002, 0.003, 1.0); }, 0.05, random, 0.0, n);
    expect_sound(smooth_normal_force(log.time, log.value, 0.05), log);
  }
  std::normal_distribution<double> normal;
  for (int run = 0; run < 200; ++run) {  // random walks
    double level = 0.0;
    for (double& f : log.value) f = level += normal(random);
    expect_sound(smooth_normal_force(log.time, log.value, run % 2 ? 0.05 : 0.0), log);
  }
  for (int run = 0; run < 200; ++run) {  // random walks that end at zero
    log = record([](double) { return 0.0; }, 0.0, random, 0.0, 80);
    double level = 30.0;
    for (int k = 0; k < 70; ++k) log.value[k] = level += normal(random);
    expect_sound(smooth_normal_force(log.time, log.value, run % 2 ? 0.05 : 0.0), log);
  }
}

// A sensor that rings once it is unloaded, or pads that touch once more while the object leaves: the opening
// is the one from the grip, and what comes later is told.
TEST(SmoothNormalForce, ALaterRiseIsNotTheOpening) {
  std::mt19937_64 random(27);
  for (const double p : {1.0, 2.0})
    for (const double height : {1.0, 2.0, 5.0}) {
      const auto touches = [=](double t) {
        const double s = (t - 0.105) / 0.006;
        return ramp(t, 25.0, 0.02, 0.07, p) + (s > 0 && s < 1 ? height * std::sin(M_PI * s) : 0.0);
      };
      const auto rings = [=](double t) {
        return ramp(t, 25.0, 0.02, 0.07, p) +
               (t > 0.09 ? -height * std::exp(-(t - 0.09) / 0.02) * std::sin(2 * M_PI * 80 * (t - 0.09))
                         : 0.0);
      };
      const Log clean = record([=](double t) { return ramp(t, 25.0, 0.02, 0.07, p); }, 0.05, random);
      EXPECT_EQ(smooth_normal_force(clean.time, clean.value, 0.05).summary.later_rise, 0.0);
      const Log log = record(touches, 0.05, random);
      const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.05);
      expect_sound(fit, log);
      EXPECT_NEAR(fit.summary.release_time, 0.09, 6 * fit.summary.release_sigma) << p << " " << height;
      EXPECT_LT(fit.summary.release_sigma, 1.5e-3);
      EXPECT_NEAR(fit.summary.grip_force, 25.0, 0.05);
      EXPECT_NEAR(fit.summary.tail_mean, 0.0, 0.05);
      EXPECT_NEAR(fit.summary.later_rise, height, 0.2);
      EXPECT_GT(fit.summary.chi2_per_dof, 2.0);

      const Log rung = record(rings, 0.05, random);
      const NormalForceFit within = smooth_normal_force(rung.time, rung.value, 0.05);
      expect_sound(within, rung);
      EXPECT_NEAR(within.summary.release_time, 0.09, 6e-3) << p << " " << height;
      EXPECT_NEAR(within.summary.grip_force, 25.0, 0.1);
    }
}

TEST(SmoothNormalForce, UndeclaredNoiseIsEstimated) {
  std::mt19937_64 random(27);
  const Log log = record([](double t) { return ramp(t, 25.0, 0.0575, 0.055, 1.0); }, 0.05, random);
  const NormalForceFit fit = smooth_normal_force(log.time, log.value, 0.0);
  EXPECT_NEAR(fit.summary.sigma, 0.05, 0.015);
  EXPECT_NEAR(fit.summary.release_time, 0.1125, 0.3e-3);
}

// Of many releases, in ms: the scatter of the release about the truth, the mean claim, the worst error; and
// that in its own σ.
struct Releases {
  double scatter{}, claimed{}, worst{}, worst_in_sigmas{};
};

template <class Spoil>
Releases releases(double declared, std::mt19937_64& random, const Spoil& spoil) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  constexpr int kRuns = 200;
  Releases out;
  for (int run = 0; run < kRuns; ++run) {
    const double start = 0.057 + 1e-3 * uniform(random), length = 0.05 + 0.01 * uniform(random);
    Log log = record([&](double t) { return ramp(t, 25.0, start, length, 1.25); }, 0.0, random);
    for (double& f : log.value) f += spoil();
    const NormalForceFit fit = smooth_normal_force(log.time, log.value, declared);
    const double e = (fit.summary.release_time - start - length) / 1e-3;
    EXPECT_GT(fit.summary.release_sigma, 0.0);
    out.scatter += e * e / kRuns;
    out.claimed += fit.summary.release_sigma / 1e-3 / kRuns;
    out.worst = std::max(out.worst, std::abs(e));
    out.worst_in_sigmas = std::max(out.worst_in_sigmas, std::abs(e) / fit.summary.release_sigma * 1e-3);
  }
  out.scatter = std::sqrt(out.scatter);
  return out;
}

TEST(SmoothNormalForce, ANoiseDeclaredTooSmallIsSeenInTheScatter) {
  std::mt19937_64 random(28);
  std::normal_distribution<double> normal;
  for (double factor : {0.0, 0.1, 0.5, 0.67, 0.8, 0.9, 1.0}) {
    const auto found = releases(0.05 * factor, random, [&] { return 0.05 * normal(random); });
    EXPECT_LT(found.scatter, 0.12) << factor;  // that of the right declaration
    // In one of some hundreds noise passes for a bend of the ramp, and σ says what that leaves open.
    EXPECT_LT(found.worst_in_sigmas, 5) << factor;
    EXPECT_NEAR(found.scatter, found.claimed, 0.2 * found.scatter) << factor;
  }
  // One that is too large is kept: the noise may be slow.
  const auto found = releases(0.15, random, [&] { return 0.05 * normal(random); });
  EXPECT_NEAR(found.claimed, 3 * found.scatter, 0.2 * found.claimed);
}

TEST(SmoothNormalForce, SpikesAndHeavyTailsDoNotMoveTheRelease) {
  std::mt19937_64 random(29);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (double height : {0.5, 5.0, 50.0}) {
    const auto found = releases(0.05, random, [&] {
      return 0.05 * normal(random) + (uniform(random) < 0.01 ? height * normal(random) : 0.0);
    });
    EXPECT_LT(found.worst, 0.5) << height;
    EXPECT_NEAR(found.scatter, found.claimed, 0.2 * found.scatter) << height;
  }
  std::student_t_distribution<double> heavy(3);  // of variance 3
  const auto found = releases(0.05, random, [&] { return 0.05 / std::sqrt(3.0) * heavy(random); });
  EXPECT_LT(found.worst, 0.5);
  EXPECT_LT(found.scatter, 1.1 * found.claimed);  // its core is narrower than its variance
}

TEST(SmoothNormalForce, RejectsBrokenSeries) {
  std::vector<double> t = {0, 1, 2, 3}, f = {1, 1, 1, 1};
  EXPECT_NO_THROW(smooth_normal_force(t, f, 0.1));
  EXPECT_THROW(smooth_normal_force(std::span(t).first(3), std::span(f).first(3), 0.1), std::invalid_argument);
  EXPECT_THROW(smooth_normal_force(t, std::span(f).first(3), 0.1), std::invalid_argument);
  f[2] = NAN;
  EXPECT_THROW(smooth_normal_force(t, f, 0.1), std::invalid_argument);
  f[2] = 1;
  t[2] = 0.5;
  EXPECT_THROW(smooth_normal_force(t, f, 0.1), std::invalid_argument);
}

/// What is no force: below zero, or no number.
class NoForce final : public NormalForce {
 public:
  explicit NoForce(double value) : value_(value) {}
  double at(const Window&, double) const override { return value_; }
  dynamics::Dual at(const Window&, const dynamics::Dual&) const override { return dynamics::Dual(value_); }
  void kinks(std::vector<double>& out) const override { out.push_back(0.1); }
  void kinks(std::vector<dynamics::Dual>& out) const override { out.push_back(dynamics::Dual(0.1)); }
  double release_time() const override { return 0.1; }

 private:
  double value_;
};

TEST(NormalForce, WhatIsNoForceStaysNoneUnderEffects) {
  const Window pressed{0.0, 0.1};
  for (const double value : {-5.0, double(NAN)}) {
    const NoForce base(value);
    const BiasedForce biased(base, dynamics::Dual(-20.0), 0.05);
    const AdhesiveForce sticky(base, dynamics::Dual(20.0), dynamics::Dual(0.01));
    for (const double t : {0.0, 0.02, 0.07}) {
      EXPECT_FALSE(biased.at(pressed, t) >= 0) << value << " at " << t;
      EXPECT_FALSE(sticky.at(pressed, t) >= 0) << value << " at " << t;
      EXPECT_FALSE(biased.at(pressed, dynamics::Dual(t)).a >= 0) << value << " at " << t;
      EXPECT_FALSE(sticky.at(pressed, dynamics::Dual(t)).a >= 0) << value << " at " << t;
    }
  }
}

TEST(SampledNormalForce, RefusesCoefficientsThatAreNoNumbers) {
  SampledNormalForce::Polynomial::Coefficients piece{};
  piece[0][0] = 10;
  EXPECT_NO_THROW(SampledNormalForce(SampledNormalForce::Polynomial({0.0, 1.0}, {piece}), {0.5}, 0.5));
  piece[1][0] = NAN;
  EXPECT_THROW(SampledNormalForce(SampledNormalForce::Polynomial({0.0, 1.0}, {piece}), {0.5}, 0.5),
               std::invalid_argument);
}

TEST(SampledNormalForce, IsNoneWhereTheCurveIsBelowZero) {
  SampledNormalForce::Polynomial::Coefficients falling{};
  falling[0][0] = 10, falling[1][0] = -100;  // zero at 0.1 s
  const SampledNormalForce force(SampledNormalForce::Polynomial({0.0, 1.0}, {falling}), {0.1}, 0.1);
  EXPECT_DOUBLE_EQ(force.at(kAlways, 0.04), 6);
  EXPECT_EQ(force.at(kAlways, 0.3), 0);
  const Dual pressed = force.at(kAlways, Dual(0.04, 2)), gone = force.at(kAlways, Dual(0.3, 2));
  EXPECT_DOUBLE_EQ(pressed.a, 6);
  EXPECT_NEAR(pressed.v[2], -100, 1e-12);
  EXPECT_EQ(gone.a, 0);
  EXPECT_EQ(gone.v[2], 0);
}

TEST(SampledNormalForce, RefusesKinksOutOfOrder) {
  const auto message = [](std::vector<double> kinks) {
    const SampledNormalForce::Polynomial::Coefficients none{};
    return unhand::support::refusal([&] {
      SampledNormalForce(SampledNormalForce::Polynomial({0.0, 1.0}, {none}), kinks, 0.5);
    });
  };
  EXPECT_EQ(message({0.2, 0.5}), "accepted");
  EXPECT_EQ(message({0.5, 0.2, 0.5}), "SampledNormalForce: kinks must increase");
  EXPECT_EQ(message({0.5, 0.5}), "SampledNormalForce: kinks must increase");
}

/// f_N − b up to the start of the opening, f_N − b (t₁ − t)/(t₁ − t₀) while it opens, and never below zero.
TEST(BiasedForce, FadesOutWhileThePadsOpen) {
  constexpr double kStart = 0.03, kLength = 0.05, kRelease = kStart + kLength;
  const ProfileNormalForce base(
      OpeningProfile<Dual>{0.02, Dual(40.0), Dual(0.01), Dual(kLength, 1), Dual(1.3)});
  for (const double bias : {2.0, -3.0}) {
    const BiasedForce biased(base, Dual(bias, 0), kStart);
    EXPECT_DOUBLE_EQ(biased.release_time(), kRelease);
    EXPECT_DOUBLE_EQ(biased.at(kAlways, 0.01), 40 - bias);
    EXPECT_EQ(biased.at(kAlways, 0.1), 0);
    for (const double t : {0.035, 0.05, 0.06}) {
      const double left = (kRelease - t) / kLength;
      EXPECT_NEAR(biased.at(kAlways, t), base.at(kAlways, t) - bias * left, 1e-12) << t;
      const Dual f = biased.at(kAlways, Dual(t));
      EXPECT_NEAR(f.a, biased.at(kAlways, t), 1e-12);
      EXPECT_NEAR(f.v[0], -left, 1e-12) << t;
      EXPECT_NEAR(f.v[1], base.at(kAlways, Dual(t)).v[1] - bias * (t - kStart) / (kLength * kLength), 1e-9)
          << t << ": by the release";
    }
  }
  const BiasedForce more(base, Dual(50.0), kStart);  // than the pads press
  for (const double t : {0.01, 0.035, 0.06}) EXPECT_EQ(more.at(kAlways, t), 0) << t;
  EXPECT_EQ(more.at(kAlways, Dual(0.035, 0)).v[0], 0);
}

TEST(BiasedForce, AtTheWindowsEndHasTheLimitFromTheLeft) {
  const NoForce holds(40);  // 40 N up to the release, where it drops
  EXPECT_EQ(BiasedForce(holds, dynamics::Dual(1.0), 1.0).at({0.0, 0.1}, 0.1), 39);
  EXPECT_EQ(BiasedForce(holds, dynamics::Dual(1.0), 1.0).at({0.1, 0.2}, 0.1), 0);
}

TEST(BiasedForce, RefusesWhatIsNoNumber) {
  const ProfileNormalForce opens(OpeningProfile<double>{0.0, 40, 0.01, 0.05, 1});
  EXPECT_THROW(BiasedForce(opens, dynamics::Dual(NAN), 0.01), std::invalid_argument);
  EXPECT_THROW(BiasedForce(opens, dynamics::Dual(1.0), NAN), std::invalid_argument);
  // an opening after the release: all of the bias until then
  EXPECT_EQ(BiasedForce(opens, dynamics::Dual(1.0), 1.0).at({0.0, 0.01}, 0.0), 39);
}

TEST(OpeningProfile, TellsSmallValuesAsTheyAre) {
  EXPECT_EQ(unhand::support::refusal([] {
              ProfileNormalForce(OpeningProfile<double>{0.0, -1e-9, 0.01, 0.05, 1});
            }),
            "OpeningProfile: grip_force = -1e-09 is not in (0, inf) N");
}

}  // namespace
