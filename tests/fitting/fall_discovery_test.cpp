// The loop on synthetic accelerometers in free fall, and on slips, whose missing piece is known.
#include "fitting/measured/fall_discovery.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <random>

#include "fitting/measured/measured_discovery.hpp"
#include "fitting/slips/surface_discovery.hpp"
#include "slip_simulator.hpp"
#include "tests/fitting/found_size.hpp"

namespace unhand::fitting {
namespace {

using support::named;

struct Truth {
  double bias_x{}, bias_y{}, bias_z{}, drag{}, drift_z{};
  double bias_scatter{};  // from fall to fall
  double wander{};        // m/s²: of every axis in every fall, a slow wave of its own phase
  double swing_z{};       // m/s²: at 7 Hz along z, in phase with the start of the fall
};

/// Drops and (every third) throws upwards: held still for 0.6 s, let go or pushed, flying for 0.6 s.
datasets::ThrowLog falls(const Truth& truth, int n, unsigned seed) {
  constexpr double g = 9.81, rate = 200, sigma = 0.03, push = 0.25, thrust = 12;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  datasets::ThrowLog log;
  log.dimension = 3;
  log.title = "synthetic falls";
  log.source = "synthetic";
  log.gravity = g;
  datasets::Object phone;
  phone.mass = 0.2;
  log.objects.emplace("phone", phone);
  for (int k = 0; k < n; ++k) {
    datasets::Throw one;
    one.id = "fall-" + std::to_string(1000 + k);
    one.object = "phone";
    one.condition = k % 3 == 2 ? "up" : "fall";
    one.repetition = k;
    one.split = k % 4 == 3 ? datasets::Split::test : datasets::Split::train;
    auto& imu = one.imu.emplace();
    imu.time.cols = 1, imu.specific_force.cols = 3;
    imu.specific_force.sigma = {sigma, sigma, sigma};
    const bool up = k % 3 == 2;
    double bias[3] = {truth.bias_x, truth.bias_y, truth.bias_z};
    if (truth.bias_scatter > 0)
      for (double& b : bias) b += truth.bias_scatter * normal(random);
    double phase[3] = {0, 0, 0};
    if (truth.wander > 0)
      for (double& p : phase) p = 2 * std::numbers::pi * normal(random);
    const double still = 0.6, free = still + (up ? push : 0), end = free + 0.6;
    double v = up ? thrust * push : 0, begin = 0, last = 0;
    for (int i = 0; i / rate < end + 0.1; ++i) {
      const double t = i / rate;
      double along = t < still ? g : t < free ? g + thrust : 0;
      if (t >= free && t <= end) {
        if (begin == 0) begin = t;
        last = t;
        along = -truth.drag * std::abs(v) * v;
        for (int s = 0; s < 10; ++s) v += (-g - truth.drag * std::abs(v) * v) / rate / 10;  // Euler: 5 µm/s
      }
      if (t > end) along = 60;
      imu.time.data.push_back(t);
      const double drift = t >= free && t <= end ? truth.drift_z * (t - begin) : 0;
      const double swing =
          t >= free && t <= end ? truth.swing_z * std::sin(2 * std::numbers::pi * 7 * (t - begin)) : 0;
      const auto slow = [&](int a) {
        return t >= free && t <= end
                   ? truth.wander * std::sin(2 * std::numbers::pi * (t - begin) / 0.5 + phase[a])
                   : 0.0;
      };
      imu.specific_force.data.insert(
          imu.specific_force.data.end(),
          {bias[0] + slow(0) + sigma * normal(random), bias[1] + slow(1) + sigma * normal(random),
           bias[2] + slow(2) + swing + drift + along + sigma * normal(random)});
    }
    imu.time.rows = imu.time.data.size();
    imu.specific_force.rows = imu.time.rows;
    one.free_flight = {begin, last};
    log.throws.push_back(std::move(one));
  }
  return log;
}

double value_of(const AcceptedEffect& effect, const std::string& name) {
  for (const auto& p : effect.parameters)
    if (p.name == name) return p.value;
  return std::nan("");
}

TEST(FallDiscovery, APerfectSensorInAVacuumReadsZero) {
  const auto found = discover_falls(falls({}, 30, 1), {});
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  EXPECT_FALSE(found.first.any) << "nor does anything leave the noise: " << found.first.chi2_per_dof;
}

TEST(FallDiscovery, ABumpOfTimeIsEstimatedWithoutAForm) {
  constexpr double kSize = 0.4, kDuration = 0.6;
  const auto bump = [&](double t) { return kSize * std::pow(std::sin(std::numbers::pi * t / kDuration), 2); };
  auto log = falls({}, 30, 21);
  for (auto& one : log.throws) {
    auto& imu = *one.imu;
    for (std::size_t i = 0; i < imu.time.rows; ++i)
      if (const double t = imu.time(i) - one.free_flight->first; t >= 0 && t <= kDuration)
        imu.specific_force(i, 2) += bump(t);
  }
  const FallProblem problem(log);
  const auto train = fit_groups(problem, datasets::Split::train, {}, Eigen::VectorXd());
  const auto missing =
      missing_acceleration(problem, train, fit_own(problem, datasets::Split::test, train), {});
  ASSERT_TRUE(missing.has_value());
  EXPECT_TRUE(missing->helps);
  EXPECT_EQ(missing->of, "along the axes of the body");
  EXPECT_EQ(missing->against, "time [s]");
  ASSERT_EQ(missing->components.size(), 3u);
  for (std::size_t c = 0; c < 3; ++c) {
    const auto& component = missing->components[c];
    for (std::size_t j = 0; j < component.at.size(); ++j)  // a tenth for the straight lines between knots
      EXPECT_NEAR(component.value[j], c == 2 ? bump(component.at[j]) : 0.0,
                  4 * component.sigma[j] + 0.1 * kSize)
          << c << ' ' << component.at[j];
  }
  EXPECT_GT(missing->test_before, 3);
  EXPECT_LT(missing->test_after, 1.3);
}

// One reading that is out by fifty sigmas says nothing of the noise of the others.
TEST(FallDiscovery, AStrayReadingIsNoPartOfAnUndeclaredNoise) {
  auto log = falls({}, 30, 1);
  for (auto& one : log.throws) one.imu->specific_force.sigma.clear();
  const FallProblem clean(log);
  auto& imu = *log.throws.front().imu;
  const double begin = log.throws.front().free_flight->first;
  std::size_t i = 0;
  while (imu.time(i) < begin + 0.3) ++i;
  imu.specific_force(i, 0) += 1.5;
  const FallProblem stray(log);
  EXPECT_NEAR(stray.sigma(0)[0], clean.sigma(0)[0], 0.1 * clean.sigma(0)[0]);
}

TEST(FallDiscovery, BiasAndDragAreToldApart) {
  const auto found = discover_falls(falls({-0.9, 0.4, 0.05, 0.045, 0}, 30, 2), {});
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  const auto *bias = named(found, "sensor.accelerometer_bias"), *drag = named(found, "flight.quadratic_drag");
  ASSERT_NE(bias, nullptr);
  ASSERT_NE(drag, nullptr);
  EXPECT_EQ(found.effects.size(), 2U);
  // The bias tilts the vertical that the sensor shows at rest by a tenth: drag along it is off by 1 - cos.
  EXPECT_NEAR(value_of(*drag, "k[phone]"), 0.045, 0.002);
  EXPECT_NEAR(value_of(*bias, "x"), -0.9, 0.02);
  EXPECT_NEAR(value_of(*bias, "y"), 0.4, 0.02);
  EXPECT_NEAR(value_of(*bias, "z"), 0.05, 0.02);
  // A traceless tensor pushes along some axis: it refines a drag, and is none.
  for (const auto& e : found.effects)
    for (const auto& [other, correlation] : e.equivalent) EXPECT_NE(other, "flight.drag_by_axis") << e.id;
}

// A reading of a drag is the sensor's scale times its size: only at rest is the scale seen.
TEST(FallDiscovery, AScaleThatIsOffAtRestMakesTheDragDoubtful) {
  const auto doubted = [](double scale) {
    auto log = falls({0, 0, 0, 0.045, 0}, 30, 2);
    for (auto& one : log.throws)
      for (double& f : one.imu->specific_force.data) f *= scale;
    const auto found = discover_falls(log, {});
    const auto* drag = named(found, "flight.quadratic_drag");
    EXPECT_NE(drag, nullptr);
    EXPECT_NEAR(value_of(*drag, "k[phone]"), 0.045 * scale, 0.001);
    for (const auto& e : found.evidence)
      if (const auto at = e.text.find("k[phone] = "); e.text.starts_with("At rest before") && e.against)
        return std::stod(e.text.substr(at + 11));
    return 0.0;
  };
  EXPECT_EQ(doubted(1), 0) << "nothing to say";
  EXPECT_NEAR(doubted(1.04), 0.045, 5e-4);
}

TEST(FallDiscovery, StartsThatTheSensorDidNotSeeMakeTheDragUndetermined) {
  // Before the throws upwards the sensor misses most of the push: what it gained is not what they start with.
  auto log = falls({.bias_z = 0.3, .drag = 0.05}, 24, 7);
  const auto speaks = [](const MeasuredDiscovery& found) {
    return std::any_of(found.evidence.begin(), found.evidence.end(), [](const Evidence& e) {
      return e.against && e.text.starts_with("The fit starts the falls");
    });
  };
  EXPECT_FALSE(speaks(discover_falls(log, {})));
  for (auto& one : log.throws)
    for (std::size_t i = 0; i < one.imu->time.rows; ++i)
      if (double& f = one.imu->specific_force.data[3 * i + 2];
          one.imu->time(i) < one.free_flight->first && f > 15)
        f = 9.81;
  EXPECT_TRUE(speaks(discover_falls(log, {})));
}

/// The throws upwards alone: the drag, the bias along the vertical and the speeds at the start trade against
/// each other, and what the sensor saw before them settles it.
datasets::ThrowLog throws_upwards(const Truth& truth, int n, unsigned seed) {
  auto log = falls(truth, 3 * n, seed);
  std::erase_if(log.throws, [](const datasets::Throw& one) { return one.condition != "up"; });
  return log;
}

/// The falls from rest alone, where a drag never changes its sign.
datasets::ThrowLog falls_from_rest(const Truth& truth, int n, unsigned seed) {
  auto log = falls(truth, 3 * n / 2, seed);
  std::erase_if(log.throws, [](const datasets::Throw& one) { return one.condition == "up"; });
  return log;
}

/// A bias and a drag of 0.0436 1/m, and nothing else.
void expect_bias_and_drag(const MeasuredDiscovery& found, const Truth& truth, double near) {
  const auto *bias = named(found, "sensor.accelerometer_bias"), *drag = named(found, "flight.quadratic_drag");
  EXPECT_EQ(found.effects.size(), 2U);
  ASSERT_NE(bias, nullptr);
  ASSERT_NE(drag, nullptr);
  EXPECT_NEAR(value_of(*drag, "k[phone]"), truth.drag, 0.0015);
  EXPECT_NEAR(value_of(*bias, "x"), truth.bias_x, near);
  EXPECT_NEAR(value_of(*bias, "y"), truth.bias_y, near);
  EXPECT_NEAR(value_of(*bias, "z"), truth.bias_z, near);
}

// Biases wander from recording to recording. Turned a little in each fall, a drag several times as large and
// a drift against it would take that up.
TEST(FallDiscovery, ZerosThatDifferFromFallToFallAreNeitherADriftNorALargerDrag) {
  const Truth truth{.bias_x = -0.34, .bias_y = -0.24, .bias_z = -0.15, .drag = 0.0436, .bias_scatter = 0.05};
  for (const unsigned seed : {61U, 62U})
    expect_bias_and_drag(discover_falls(falls_from_rest(truth, 22, seed), {}), truth, 0.05);
}

// What the readings of falls differ by at rest is that scatter, whatever slows them later.
TEST(FallDiscovery, AFallHasAZeroOfItsOwn) {
  for (const double scatter : {0.0, 0.06}) {
    const auto log = falls({.bias_x = 0.5, .drag = 0.045, .bias_scatter = scatter}, 60, 71);
    const FallProblem shared(log), own(log, GroupedFit{});
    std::vector<std::string> names{"flight.quadratic_drag.k"};
    const double k[] = {0.045};
    double squares = 0, noise = 0;
    for (std::size_t i = 0; i < own.groups().size(); ++i) {
      const Eigen::Map<const Eigen::VectorXd> start(own.groups()[i].start.data(), 7);
      const auto a = shared.equations(i, names, k, start, Derivatives::none),
                 b = own.equations(i, names, k, start, Derivatives::none);
      const Eigen::VectorXd left = shared.left_of(i, a.residual);
      EXPECT_LT((left - own.left_of(i, b.residual)).norm(), 1e-9 * left.norm()) << "the same readings";
      EXPECT_NEAR(left[1], -0.03 * a.residual[1], 1e-12);
      const auto rows = left.size() / 3;
      const double mean = b.residual(Eigen::seqN(1, rows, 3)).sum() / std::sqrt(static_cast<double>(rows));
      squares += mean * mean, noise += 1;
    }
    // Of the mean of y, whose bias is none: one where what it scatters by is known.
    EXPECT_GT(squares / noise, 0.3) << scatter;
    EXPECT_LT(squares / noise, 2) << scatter;
  }
}

/// Falls that turn, each steadily: as a gyroscope with some noise sees it, and a sensor off the CoM feels it.
void turn_steadily(datasets::ThrowLog& log, const flight::Vec3<double>& arm, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (auto& one : log.throws) {
    auto& imu = *one.imu;
    // About an axis near the plane of the screen, as phones that are let go turn; up to some 4 rad/s.
    const flight::Vec3<double> axis{normal(random), normal(random), 0.3 * normal(random)};
    const auto omega = flight::scaled(2 * normal(random) / flight::norm(axis), axis);
    const auto felt = flight::cross(omega, flight::cross(omega, arm));
    imu.angular_rate.rows = imu.time.rows, imu.angular_rate.cols = 3;
    imu.angular_rate.data.assign(3 * imu.time.rows, 0);
    for (std::size_t i = 0; i < imu.time.rows; ++i) {
      const double t = imu.time(i) - one.free_flight->first;
      if (t < 0 || imu.time(i) > one.free_flight->second) continue;
      const flight::Vec3<double> force{imu.specific_force(i, 0), imu.specific_force(i, 1),
                                       imu.specific_force(i, 2)};
      const auto reads = flight::sum(flight::rotate(flight::exp(flight::scaled(-t, omega)), force), felt);
      for (std::size_t a = 0; a < 3; ++a)
        imu.angular_rate(i, a) = omega[a] + 0.002 * normal(random), imu.specific_force(i, a) = reads[a];
    }
  }
}

// A steady turn adds a constant, as a zero does. Where a gyroscope saw the turns it is the lever arm's.
TEST(FallDiscovery, WhatALeverArmMakesOfTurnsThatWereSeenIsNoZero) {
  const flight::Vec3<double> arm{0.03, 0.04, 0};
  for (const unsigned seed : {81U, 83U}) {
    auto log = falls({.drag = 0.04}, 40, seed);
    turn_steadily(log, arm, seed);
    const auto found = discover_falls(log, {});
    const auto *lever = named(found, "sensor.lever_arm"), *drag = named(found, "flight.quadratic_drag");
    EXPECT_EQ(found.effects.size(), 2U) << seed;
    ASSERT_TRUE(lever != nullptr && drag != nullptr) << seed;
    EXPECT_NEAR(value_of(*drag, "k[phone]"), 0.04, 0.0015);
    for (std::size_t a = 0; a < 3; ++a)
      EXPECT_NEAR(value_of(*lever, std::string(1, "xyz"[a])), arm[a], 1e-3) << seed;
    for (const auto& e : found.evidence)
      EXPECT_EQ(e.text.find("only a gyroscope could say"), std::string::npos) << e.text;
  }
}

// A decay of two seconds is a bias for a fall of 0.6 s: an effect whose shape has become open is another one.
TEST(FallDiscovery, ABiasIsNoDecayWithoutEnd) {
  const Truth truth{.bias_x = -0.34, .bias_y = -0.24, .bias_z = 0.77, .drag = 0.0436};
  for (const unsigned seed : {61U, 62U})
    expect_bias_and_drag(discover_falls(falls_from_rest(truth, 22, seed), {}), truth, 0.01);
}

/// The fit of a bias and a drag to the train groups.
GroupedFit bias_and_drag(const FallProblem& problem) {
  std::vector<SharedParameter> shared;
  for (const auto& effect : experiment::known_fall_effects())
    if (effect.id == "sensor.accelerometer_bias" || effect.id == "flight.quadratic_drag")
      for (auto& p : shared_parameters(effect, {"phone"})) shared.push_back(std::move(p));
  return fit_groups(problem, datasets::Split::train, shared, Eigen::VectorXd::Zero(4));
}

// Hundreds of samples that err alike their neighbours are few, and do not outvote what was seen before.
TEST(FallDiscovery, SamplesThatErrAlikeDoNotOutvoteWhatTheSensorSawBefore) {
  for (unsigned seed = 31; seed < 35; ++seed) {
    const FallProblem problem(throws_upwards({.bias_z = 0.1, .drag = 0.045, .wander = 0.4}, 16, seed));
    const GroupedFit fit = bias_and_drag(problem);
    ASSERT_TRUE(fit.solved);
    double squares = 0;
    for (std::size_t i = 0; i < fit.groups.size(); ++i)
      if (fit.groups[i].used) squares += std::pow(fit.groups[i].own[0] - problem.groups()[i].start[0], 2);
    // As the sensor saw them, and the drag within a fifth or so: outvoted, the starts are 0.3 to 8 m/s off,
    // and the drag twice as large or a sixth.
    EXPECT_LT(std::sqrt(squares / fit.used), 0.1) << seed;
    EXPECT_NEAR(fit.values[3], 0.045, 0.01) << seed;
  }
}

// A start fitted to all samples is the start of the fit: what is known beforehand counts as much in both.
TEST(FallDiscovery, WhatIsKnownBeforehandCountsInAPartAsInTheWhole) {
  const FallProblem problem(throws_upwards({.bias_z = 0.1, .drag = 0.045, .wander = 0.1}, 12, 41));
  const GroupedFit fit = bias_and_drag(problem);
  ASSERT_TRUE(fit.solved);
  ASSERT_GT(fit.weights.prior, 2);
  for (std::size_t i = 0; i < fit.groups.size(); ++i) {
    if (!fit.groups[i].used) continue;
    const GroupFit part = fit_own_part(problem, i, fit, [](const GroupRow&) { return true; });
    ASSERT_TRUE(part.solved);
    EXPECT_NEAR(part.own[0], fit.groups[i].own[0], 1e-3) << problem.groups()[i].id;
  }
}

// Nothing but noise between falls: the scatter between them may be smaller than what independent noise
// allows, of some parameters and not of others.
TEST(FallDiscovery, TheCovarianceOfAConstantBiasIsOne) {
  const Eigen::Vector3d truth(0.4, -0.3, 0.2);
  double chi2 = 0;
  for (unsigned seed = 5; seed < 8; ++seed) {
    const auto found = discover_falls(falls({0.4, -0.3, 0.2, 0, 0}, 30, seed), {});
    ASSERT_EQ(found.effects.size(), 1U);
    EXPECT_EQ(found.effects.front().id, "sensor.accelerometer_bias") << "no decay without end";
    ASSERT_EQ(found.parameters.size(), 3U);
    ASSERT_EQ(found.covariance.size(), 9U);
    Eigen::Vector3d off;
    for (std::size_t a = 0; a < 3; ++a) {
      const Parameter& p = found.effects.front().parameters.at(a);
      EXPECT_EQ(p.name, std::string(1, "xyz"[a]));
      EXPECT_EQ(found.parameters[a], "sensor.accelerometer_bias." + p.name);
      EXPECT_NEAR(found.covariance[4 * a], p.sigma * p.sigma, 1e-6 * p.sigma * p.sigma) << p.name;
      off[static_cast<Eigen::Index>(a)] = p.value - truth[static_cast<Eigen::Index>(a)];
    }
    const Eigen::Map<const Eigen::Matrix3d> covariance(found.covariance.data());
    EXPECT_LT((covariance - covariance.transpose()).norm(), 1e-12 * covariance.norm());
    const Eigen::LLT<Eigen::Matrix3d> factor(covariance);
    ASSERT_EQ(factor.info(), Eigen::Success) << "positive definite";
    chi2 += off.dot(factor.solve(off));
  }
  EXPECT_GT(chi2, 0.66);  // of nine numbers: one in 10,000 is below, one above
  EXPECT_LT(chi2, 33.7);
}

// A phone that was shaken as it fell hides neither an effect nor that there is none.
TEST(FallDiscovery, AWildFallIsSetAsideAndNamed) {
  for (const bool missing : {false, true}) {
    const auto all = falls(missing ? Truth{.bias_x = -0.5, .drag = 0.045} : Truth{}, 24, 51);
    const auto clean = discover_falls(all, {});
    for (const auto split : {datasets::Split::train, datasets::Split::test}) {
      auto log = all;
      const auto wild = std::find_if(log.throws.begin(), log.throws.end(),
                                     [&](const datasets::Throw& one) { return one.split == split; });
      auto& imu = *wild->imu;
      for (std::size_t i = 0; i < imu.time.rows; ++i)
        if (imu.time(i) >= wild->free_flight->first && imu.time(i) <= wild->free_flight->second)
          for (std::size_t a = 0; a < 3; ++a)
            imu.specific_force.data[3 * i + a] += 2 * std::sin(60 * imu.time(i) + static_cast<double>(a));
      const auto found = discover_falls(log, {});
      ASSERT_EQ(found.skipped.size(), 1U);
      EXPECT_EQ(found.skipped.front().first, wild->id);
      EXPECT_EQ(found.verdict, clean.verdict);
      EXPECT_FALSE(found.unexplained.has_value());
      ASSERT_EQ(found.effects.size(), clean.effects.size());
      for (std::size_t k = 0; k < found.effects.size(); ++k) {
        EXPECT_EQ(found.effects[k].id, clean.effects[k].id);
        for (std::size_t j = 0; j < found.effects[k].parameters.size(); ++j) {
          const Parameter &is = found.effects[k].parameters[j], &was = clean.effects[k].parameters[j];
          EXPECT_NEAR(is.value, was.value, 2 * was.sigma) << is.name;
        }
      }
    }
  }
}

// A sensor that rounds to steps of five times its noise: the samples of a fall stand still, and what they are
// off by is half a step at most.
TEST(FallDiscovery, ASensorThatRoundsHasTheNoiseOfItsSteps) {
  constexpr double step = 0.15;
  auto log = falls({-0.9, 0.4, 0.05, 0.045, 0}, 30, 2);
  for (auto& one : log.throws) {
    one.imu->specific_force.sigma = {};
    for (double& f : one.imu->specific_force.data) f = step * std::round(f / step);
  }
  const FallProblem problem(log);
  for (std::size_t a = 0; a < 3; ++a) EXPECT_GE(problem.sigma(0)[a], 0.999 * step / std::sqrt(12.0));
  const auto found = discover_falls(log, {});
  const auto *bias = named(found, "sensor.accelerometer_bias"), *drag = named(found, "flight.quadratic_drag");
  ASSERT_NE(bias, nullptr);
  ASSERT_NE(drag, nullptr);
  EXPECT_EQ(named(found, "sensor.accelerometer_drift"), nullptr);
  EXPECT_NEAR(value_of(*drag, "k[phone]"), 0.045, 0.004);
  EXPECT_NEAR(value_of(*bias, "x"), -0.9, step / 2);
  EXPECT_NEAR(value_of(*bias, "y"), 0.4, step / 2);
  EXPECT_TRUE(std::any_of(found.evidence.begin(), found.evidence.end(), [](const Evidence& e) {
    return e.text.starts_with("force_y of phone reads in steps of 0.15");
  }));
}

// What an axis reads at the end of its range, or all the time, says nothing of the falls.
TEST(FallDiscovery, AnAxisThatIsCutOffOrDeadIsLeftOut) {
  const auto whole = falls({-0.9, 0.4, 0.05, 0.045, 0}, 30, 2);
  for (const double highest : {-0.9, 9.0}) {  // above half of the noise; a dead axis
    auto log = whole;
    for (auto& one : log.throws)
      for (std::size_t i = 0; i < one.imu->specific_force.data.size(); i += 3) {
        double& f = one.imu->specific_force.data[i];
        f = highest > 0 ? 1.5 : std::min(f, highest);
      }
    if (highest > 0)  // nor is one fall in which it reads asked for its bias
      for (std::size_t i = 0; i < log.throws[0].imu->specific_force.data.size(); i += 6)
        log.throws[0].imu->specific_force.data[i] = 2 + 1e-3 * static_cast<double>(i % 7);
    const auto found = discover_falls(log, {});
    const auto *bias = named(found, "sensor.accelerometer_bias"),
               *drag = named(found, "flight.quadratic_drag");
    ASSERT_NE(bias, nullptr);
    ASSERT_NE(drag, nullptr);
    EXPECT_EQ(bias->parameters.size(), 2U);  // y and z
    EXPECT_NEAR(value_of(*bias, "y"), 0.4, 0.02);
    EXPECT_NEAR(value_of(*drag, "k[phone]"), 0.045, 0.003);
    EXPECT_TRUE(std::none_of(found.misfit.begin(), found.misfit.end(),
                             [](const MeasuredMisfit& m) { return m.channel == "force_x"; }));
    EXPECT_TRUE(std::any_of(found.evidence.begin(), found.evidence.end(), [](const Evidence& e) {
      return e.text.starts_with("force_x of phone") && e.text.ends_with("left out of 30 falls");
    }));
    for (const auto& m : found.misfit) EXPECT_LT(m.after_test, 1.5) << m.channel;
  }
}

// A swing that no catalogue lists, on the axis that a drag acts on: a bias of the other axes that is
// explained does not vouch for a drift or a recovery that leave it there.
TEST(FallDiscovery, AnOscillationIsNeitherADriftNorARecovery) {
  const auto found = discover_falls(
      falls({.bias_x = 0.1, .bias_y = 0.05, .bias_z = -0.2, .drag = 0.03, .swing_z = 0.25}, 24, 5), {});
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_EQ(named(found, "sensor.accelerometer_drift"), nullptr);
  EXPECT_EQ(named(found, "sensor.settling"), nullptr);
  // Nor is the drag an answer, of whatever size: the swing is in the channel that it acts in. It was the
  // nearest name, and that is said.
  EXPECT_EQ(named(found, "flight.quadratic_drag"), nullptr);
  EXPECT_TRUE(std::any_of(found.evidence.begin(), found.evidence.end(), [](const Evidence& e) {
    return e.text.starts_with("Withdrawn: ") && e.text.find("flight.quadratic_drag") != std::string::npos;
  }));
  EXPECT_EQ(found.unexplained->channel, "force_z");
}

TEST(FallDiscovery, ADriftIsNotDrag) {
  const auto found = discover_falls(falls({0, 0, 0, 0, 1.0}, 30, 3), {});
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  const auto* drift = named(found, "sensor.accelerometer_drift");
  ASSERT_NE(drift, nullptr) << found.effects.front().id;
  EXPECT_NEAR(value_of(*drift, "z"), 1.0, 0.03);
  EXPECT_EQ(named(found, "flight.quadratic_drag"), nullptr);
}

// Five falls cannot say how three components of a bias scatter together, and still that one is there.
TEST(FallDiscovery, SixFallsShowTheBiasThatTheyShare) {
  for (unsigned seed = 11; seed < 14; ++seed) {
    const auto found =
        discover_falls(falls({.bias_x = -0.9, .bias_y = 0.4, .bias_scatter = 0.06}, 6, seed), {});
    EXPECT_NE(named(found, "sensor.accelerometer_bias"), nullptr) << seed;
  }
}

// What is common to all falls is no scatter between them.
TEST(FallDiscovery, ScatterBetweenFallsIsAboutTheirMean) {
  MeasuredOptions options;
  for (const auto& effect : experiment::known_fall_effects()) options.search.forget.push_back(effect.id);
  const auto found = discover_falls(falls({.bias_x = 0.9}, 12, 15), options);
  const auto says = [&](const std::string& text) {
    return std::any_of(found.evidence.begin(), found.evidence.end(),
                       [&](const Evidence& e) { return e.text.find(text) != std::string::npos; });
  };
  EXPECT_TRUE(says("scatters by (0.00"));
  EXPECT_TRUE(says("has a mean of (0.9") || says("has a mean of (0.8"));
}

// The same falls: what has the form of a drag by axis is no answer where no drag is listed.
TEST(FallDiscovery, DragByAxisIsNoAnswerWithoutADrag) {
  MeasuredOptions options;
  options.search.forget = {"flight.quadratic_drag", "flight.linear_drag"};
  const auto log = falls({-0.9, 0.4, 0.05, 0.045, 0}, 30, 2);
  EXPECT_EQ(named(discover_falls(log, options), "flight.drag_by_axis"), nullptr);
}

TEST(FallDiscovery, NoDragIsAThrust) {
  const FallProblem problem(falls({}, 4, 1));
  GroupedFit fit;
  for (const auto& effect : experiment::known_fall_effects())
    if (effect.id == "flight.quadratic_drag" || effect.id == "flight.drag_by_axis")
      for (auto& p : shared_parameters(effect, {"phone"})) fit.shared.push_back(std::move(p));
  ASSERT_EQ(fit.shared.size(), 3U);
  fit.values = Eigen::Vector3d(0.04, -0.08, 0.01);  // along x: -0.04
  fit.covariance = 1e-6 * Eigen::Matrix3d::Identity();
  EXPECT_FALSE(problem.may_be(fit));
  fit.covariance *= 1e3;  // two sigmas are 0.09
  EXPECT_TRUE(problem.may_be(fit));
  fit.covariance *= 1e-3;
  fit.values[1] = -0.03;
  EXPECT_TRUE(problem.may_be(fit));
  EXPECT_FALSE(problem.may_act("flight.drag_by_axis", {"flight.linear_drag"}));
  EXPECT_TRUE(problem.may_act("flight.drag_by_axis", {"flight.quadratic_drag"}));
}

/// One of a toy problem's groups without samples, every fourth held out.
Group toy_group(int k) {
  const auto split = k % 4 == 3 ? datasets::Split::test : datasets::Split::train;
  return {"group-" + std::to_string(k), "thing", "all", split, {}, {0}, {static_cast<double>(k)}};
}

/// Groups of four kinds of samples, ten of each, with noise of one. What acts are `one` and `other`, 20 sigma
/// in the first and in the second kind; `both` looks much like the two together, and `around` takes most of
/// what it leaves.
class TwoThatLookLikeOne final : public GroupedProblem {
 public:
  TwoThatLookLikeOne() {
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    channels_ = {"reading"}, covariates_ = {"order"};
    for (int k = 0; k < 24; ++k) {
      Group group = toy_group(k);
      Eigen::VectorXd noise(40);
      for (Eigen::Index i = 0; i < noise.size(); ++i) {
        group.rows.push_back({0, 0.01 * static_cast<double>(i)});
        noise[i] = normal(random);
      }
      group.rows.push_back({kPriorChannel, 0});
      noise_.push_back(noise);
      groups_.push_back(std::move(group));
    }
  }
  std::vector<dynamics::Effect> effects() const override {
    std::vector<dynamics::Effect> out;
    for (const auto& [id, kinds] : kinds_)
      out.push_back({.id = id, .mechanism = "", .parameters = {{"size", "1", 0, -1e3, 1e3, 1}}});
    return out;
  }
  GroupEquations equations(std::size_t group, std::span<const std::string> names,
                           std::span<const double> values, const Eigen::VectorXd& own,
                           Derivatives) const override {
    GroupEquations out{true, Eigen::VectorXd(41), Eigen::MatrixXd::Zero(41, static_cast<long>(names.size())),
                       Eigen::MatrixXd::Zero(41, 1)};
    for (Eigen::Index i = 0; i < 40; ++i) {
      const auto kind = static_cast<std::size_t>(i / 10);
      out.residual[i] = -(kind < 2 ? 20 : 0) - noise_[group][i];
      for (std::size_t k = 0; k < names.size(); ++k) {
        const double by = kinds_.at(names[k].substr(0, names[k].rfind('.')))[kind];
        out.shared(i, static_cast<Eigen::Index>(k)) = by;
        out.residual[i] += by * values[k];
      }
    }
    out.residual[40] = own[0], out.own(40, 0) = 1;
    return out;
  }

 private:
  std::map<std::string, std::array<double, 4>> kinds_{{"toy.around", {0, 0, 1, 0.6}},
                                                      {"toy.both", {1, 1, 0.5, 0}},
                                                      {"toy.one", {1, 0, 0, 0}},
                                                      {"toy.other", {0, 1, 0, 0}}};
  std::vector<Eigen::VectorXd> noise_;
};

// Neither of what stands in for the two can be exchanged for one of them alone.
TEST(EffectSearch, TwoThatLookLikeOneAreFoundWhereTheSearchBeginsOtherwise) {
  const EffectSearch found = search_effects(TwoThatLookLikeOne(), {});
  ASSERT_TRUE(found.solved);
  std::vector<std::string> ids;
  for (const auto& effect : found.effects) {
    ids.push_back(effect.id);
    EXPECT_NEAR(effect.parameters.at(0).value, 20, 0.5) << effect.id;
  }
  EXPECT_THAT(ids, testing::UnorderedElementsAre("toy.one", "toy.other"));
  EXPECT_LT(found.final_test.chi2, 1.3 * static_cast<double>(found.final_test.samples));
}

/// A drag along three axes, of which groups show one directly and the two others `seen` times as much: k is
/// 20 sigma along z, and what they show of x is 5 sigma.
class DragAlongAxes final : public GroupedProblem {
 public:
  explicit DragAlongAxes(double seen) : seen_(seen) {
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    channels_ = {"x", "y", "z"}, covariates_ = {"order"};
    for (int k = 0; k < 24; ++k) {
      Group group = toy_group(k);
      Eigen::VectorXd noise(30);
      for (int i = 0; i < 30; ++i) group.rows.push_back({i % 3, 0.01 * i}), noise[i] = normal(random);
      group.rows.push_back({kPriorChannel, 0});
      noise_.push_back(noise);
      groups_.push_back(std::move(group));
    }
  }
  std::vector<dynamics::Effect> effects() const override {
    std::vector<dynamics::Effect> out;
    for (auto& effect : experiment::known_fall_effects())
      if (effect.id == "flight.quadratic_drag" || effect.id == "flight.drag_by_axis") {
        effect.per_object = false;
        for (auto& p : effect.parameters) p.high = 1e6, p.low = p.low < 0 ? -1e6 : 0;
        out.push_back(effect);
      }
    return out;
  }
  GroupEquations equations(std::size_t group, std::span<const std::string> names,
                           std::span<const double> values, const Eigen::VectorXd& own,
                           Derivatives) const override {
    const std::map<std::string, std::array<double, 3>> along{{"flight.quadratic_drag.k", {1, 1, 1}},
                                                             {"flight.drag_by_axis.a_x", {1, 0, -1}},
                                                             {"flight.drag_by_axis.a_y", {0, 1, -1}}};
    GroupEquations out{true, Eigen::VectorXd(31), Eigen::MatrixXd::Zero(31, static_cast<long>(names.size())),
                       Eigen::MatrixXd::Zero(31, 1)};
    for (Eigen::Index i = 0; i < 30; ++i) {
      const auto axis = static_cast<std::size_t>(i % 3);
      out.residual[i] = -std::array{5.0, 0.0, 20.0}[axis] - noise_[group][i];
      for (std::size_t k = 0; k < names.size(); ++k) {
        const double by = (axis < 2 ? seen_ : 1) * along.at(names[k])[axis];
        out.shared(i, static_cast<Eigen::Index>(k)) = by;
        out.residual[i] += by * values[k];
      }
    }
    out.residual[30] = own[0], out.own(30, 0) = 1;
    return out;
  }

 private:
  double seen_;
  std::vector<Eigen::VectorXd> noise_;
};

// What hardly moves along an axis cannot say how it brakes there: the mean over all axes would be a guess.
TEST(EffectSearch, ADragByAxisIsNotFoundAlongAxesThatNothingMovesAlong) {
  std::vector<std::vector<std::string>> found;
  for (const double seen : {1.0, 0.02}) {
    const EffectSearch search = search_effects(DragAlongAxes(seen), {});
    ASSERT_TRUE(search.solved);
    auto& ids = found.emplace_back();
    for (const auto& effect : search.effects) ids.push_back(effect.id);
  }
  EXPECT_THAT(found[0], testing::UnorderedElementsAre("flight.quadratic_drag", "flight.drag_by_axis"));
  EXPECT_THAT(found[1], testing::ElementsAre("flight.quadratic_drag"));
}

TEST(SurfaceDiscovery, AnEllipsoidMissesNothing) {
  SurfaceDiscoveryOptions options;
  options.comparison.null_draws = 1;
  const auto found =
      discover_surfaces({test::simulate(test::ellipsoid(test::along_axes), 50, 0.15, 0.1, 21)}, options);
  EXPECT_EQ(found.answer.verdict, Verdict::no_missing_effect);
}

// As from a program of one's own, which no reader has looked through.
TEST(SurfaceDiscovery, SlipsThatAreNoNumbersAreRefused) {
  datasets::SlipLog log;
  datasets::Surface& patch = log.surfaces["patch"];
  patch.mass = 1, patch.characteristic_length = 0.05;
  patch.slips = {{"1",
                  datasets::Split::train,
                  {2, 1, {0, 0.01}, {}},
                  {2, 3, {1, 0, 0, 1, 0, 0}, {}},
                  {2, 3, {0.1, 0, 0, 0.1, 0, 0}, {}}}};
  EXPECT_NO_THROW(discover_surfaces(log, {}));
  patch.slips[0].wrench.data[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(discover_surfaces(log, {}), datasets::LogError);
}

TEST(SurfaceDiscovery, NoSurfaceIsNotAnsweredAndItsTimeIsTold) {
  const auto none = discover_surfaces(std::vector<SlipSamples>{}, {}).answer;
  EXPECT_EQ(none.verdict, Verdict::not_answered);
  EXPECT_GT(none.seconds, 0);
}

TEST(FallDiscovery, OneFallIsNotAnsweredAndItsTimeIsTold) {
  const auto none = discover_falls(falls({}, 1, 1), {});
  EXPECT_EQ(none.verdict, Verdict::not_answered);
  EXPECT_GT(none.seconds, 0);
}

TEST(SurfaceDiscovery, AQuarticIsFound) {
  const SlipSurface truth = test::quartic(contact::ConvexQuartic::isotropic_blend(2.8), 4.0);
  SurfaceDiscoveryOptions options;
  options.comparison.null_draws = 1;
  const auto found = discover_surfaces({test::simulate(truth, 60, 0.05, 0.03, 22)}, options);
  ASSERT_EQ(found.answer.verdict, Verdict::effect_found);
  EXPECT_EQ(found.answer.effects.front().id, "contact.law:convex_quartic");
  EXPECT_LT(found.answer.effects.front().test_error_ratio.value(), 0.8);
}

// Two samples that are each other's nearest are one observation: of noise alone, the correlation of
// neighbours is as uncertain as it is said to be.
TEST(SurfaceDiscovery, NeighboursOfNoiseCorrelateAsTheirSigmaSays) {
  SurfaceDiscoveryOptions options;
  options.comparison.null_draws = 0;
  options.forget = {"contact.law:ellipsoid_full", "contact.law:convex_quartic"};
  constexpr unsigned kSets = 200;
  double squares = 0;
  for (unsigned set = 0; set < kSets; ++set) {
    const auto found = discover_surfaces(
        {test::simulate(test::ellipsoid(test::along_axes), 60, 0.08, 0.03, 100 + set)}, options);
    const auto& left = found.evidence.front();
    squares += std::pow(left.left / left.left_sigma, 2) / kSets;
  }
  EXPECT_NEAR(std::sqrt(squares), 1, 0.2);  // known to 5 %, and some scatter is fitted away
}

// A control that was not made is no evidence, and one in which the law gains does not speak for it.
TEST(SurfaceDiscovery, TheNullControlSaysWhatItFound) {
  const auto control = [](const SlipSamples& slips, SurfaceModel base, int draws) {
    SurfaceDiscoveryOptions options;
    options.base = base;
    options.comparison.null_draws = draws;
    std::optional<Evidence> out;
    for (const Evidence& e : discover_surfaces({slips}, options).answer.evidence)
      if (e.text.starts_with("Null control")) out = e;
    return out;
  };
  const SlipSamples quartic =
      test::simulate(test::quartic(contact::ConvexQuartic::isotropic_blend(2.8), 4.0), 60, 0.05, 0.03, 22);
  EXPECT_FALSE(control(quartic, SurfaceModel::ellipsoid, 0));
  const auto loses = control(quartic, SurfaceModel::ellipsoid, 1);
  ASSERT_TRUE(loses);
  EXPECT_FALSE(loses->against);
  EXPECT_NE(loses->text.find("the same law loses 0."), std::string::npos) << loses->text;
  const auto gains = control(test::simulate(test::ellipsoid(test::along_axes), 30, 0.1, 0.1, 2),
                             SurfaceModel::convex_quartic, 1);
  ASSERT_TRUE(gains);
  EXPECT_TRUE(gains->against);
  EXPECT_NE(gains->text.find("the same law gains "), std::string::npos) << gains->text;
}

TEST(SurfaceDiscovery, ErrorsBeforeAndAfterAreOfTheSameSurfaces) {
  const SlipSurface truth = test::quartic(contact::ConvexQuartic::isotropic_blend(2.8), 4.0);
  SurfaceDiscoveryOptions options;
  options.comparison.null_draws = 1;
  const SlipSamples rich = test::simulate(truth, 60, 0.05, 0.03, 22),
                    poor = test::simulate(truth, 12, 0.4, 0.2,
                                          23);  // too few for a quartic, not for an ellipsoid
  const auto alone = discover_surfaces({rich}, options), both = discover_surfaces({rich, poor}, options);
  ASSERT_FALSE(both.answer.skipped.empty());
  ASSERT_EQ(both.answer.verdict, Verdict::effect_found);
  EXPECT_DOUBLE_EQ(both.answer.before_test.front().second, alone.answer.before_test.front().second);
  EXPECT_DOUBLE_EQ(both.answer.effects.front().test_error_ratio.value(),
                   alone.answer.effects.front().test_error_ratio.value());
}

}  // namespace
}  // namespace unhand::fitting
