#include "experiment/free_flight.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "datasets/summary.hpp"
#include "dynamics/parallel.hpp"
#include "dynamics/straight_line.hpp"
#include "experiment/flight_samples.hpp"
#include "experiment/least_squares.hpp"
#include "flight/spatial_flight.hpp"

namespace unhand::experiment {

using datasets::Object;
using datasets::Throw;
using datasets::ThrowLog;
using dynamics::Dual;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using flight::Quaternion;
using flight::RotationState;
using flight::Vec3;

const char* to_string(FreeFlightOutcome outcome) {
  switch (outcome) {
    case FreeFlightOutcome::fitted:
      return "fitted";
    case FreeFlightOutcome::no_tracking:
      return "no_tracking";
    case FreeFlightOutcome::not_free:
      return "not_free";
    case FreeFlightOutcome::too_short:
      return "too_short";
    case FreeFlightOutcome::not_solved:
      return "not_solved";
  }
  return "unknown";
}

namespace {

const dynamics::IntegratorOptions kFine =
    dynamics::error_controlled({1e-10, 1e-12});  // far below any tracker

/// Residuals of a flight that the integrator did not solve.
constexpr double kNotSolved = std::numeric_limits<double>::quiet_NaN();

/// Where the CoM is at `times`; empty if the flight was not solved.
template <class S>
std::vector<Vec3<S>> places(const flight::SpatialStart<S>& start, const Vec3<double>& gravity, double drag_k,
                            const std::vector<double>& times) {
  flight::SpatialAir<S> air;
  for (std::size_t a = 0; a < 3; ++a) air.gravity[a] = S(gravity[a]);
  air.drag_k = S(drag_k);
  std::vector<Vec3<S>> out;
  for (const auto& state :
       flight::fly_in_space<S>(start, air, std::vector<S>(times.begin(), times.end()), kFine).states)
    out.push_back(state.position);
  return out;
}

/// The flight of the CoM. With drag the closed form without it is where Gauss-Newton begins.
bool fit_translation(const FlightSamples& s, const Vec3<double>& gravity, double drag_k, std::size_t n,
                     FreeFlightFit& fit) {
  const std::vector<double> fitted(s.elapsed.begin(), s.elapsed.begin() + static_cast<long>(n));
  for (const int a : s.axes) {
    std::vector<double> y(n);
    for (std::size_t i = 0; i < n; ++i) y[i] = s.position[i][a] - 0.5 * gravity[a] * fitted[i] * fitted[i];
    const auto line = dynamics::fit_line(fitted, y);
    fit.position[a] = line.at(0);
    fit.velocity[a] = line.slope;
  }
  if (drag_k > 0) {
    struct Start {
      Vec3<double> p, v;
    };
    const int axes = static_cast<int>(s.axes.size());
    Start x{fit.position, fit.velocity};
    const auto moved = [&](const VectorXd& d) {
      Start out = x;
      for (int j = 0; j < axes; ++j) out.p[s.axes[j]] += d[j], out.v[s.axes[j]] += d[axes + j];
      return out;
    };
    const auto evaluate = [&](const VectorXd& d, VectorXd& r, MatrixXd& J) {
      const Start at = moved(d);
      flight::SpatialStart<Dual> start;
      for (int a = 0; a < 3; ++a) start.position[a] = Dual(at.p[a]), start.velocity[a] = Dual(at.v[a]);
      for (int j = 0; j < axes; ++j) {
        const int a = s.axes[j];
        start.position[a] = dynamics::independent(at.p[a], j);
        start.velocity[a] = dynamics::independent(at.v[a], axes + j);
      }
      const auto predicted = places(start, gravity, drag_k, fitted);
      r.resize(static_cast<long>(n) * axes);
      J.resize(r.size(), 2 * axes);
      if (predicted.empty()) r.setConstant(kNotSolved), J.setZero();
      for (std::size_t i = 0; i < predicted.size(); ++i)
        for (int j = 0; j < axes; ++j) {
          const int a = s.axes[j];
          const long row = static_cast<long>(i) * axes + j;
          r[row] = (predicted[i][a].a - s.position[i][a]) / s.sigma[a];
          J.row(row) = predicted[i][a].v.head(2 * axes).transpose() / s.sigma[a];
        }
    };
    if (!gauss_newton(
            evaluate, [&](const VectorXd& d) { x = moved(d); }, 2 * axes,
            *std::min_element(s.sigma.begin(), s.sigma.end())))
      return false;
    fit.position = x.p;
    fit.velocity = x.v;
  }
  const auto predicted =
      places<double>({.position = fit.position, .velocity = fit.velocity}, gravity, drag_k, s.elapsed);
  for (std::size_t i = 0; i < predicted.size(); ++i)
    fit.position_residuals.push_back(flight::difference(s.position[i], predicted[i]));
  return !predicted.empty();
}

/// Torque-free rotation in space. The window grows from the first few samples: however many turns the flight
/// has, the start is good to a fraction of one by then.
bool fit_rotation(const FlightSamples& s, const Vec3<double>& inertia, std::size_t n, FreeFlightFit& fit) {
  const Vec3<Dual> inertia_dual{Dual(inertia[0]), Dual(inertia[1]), Dual(inertia[2])};
  RotationState<double> x{s.attitude[0], flight::rotation_between(s.attitude[0], s.attitude[1])};
  for (double& w : x.omega) w /= s.elapsed[1];
  std::vector<double> window;
  const auto moved = [&x](const VectorXd& d) {
    RotationState<double> out = x;
    out.attitude = flight::normalised(out.attitude * flight::exp(Vec3<double>{d[0], d[1], d[2]}));
    for (int a = 0; a < 3; ++a) out.omega[a] += d[3 + a];
    return out;
  };
  const auto evaluate = [&](const VectorXd& d, VectorXd& r, MatrixXd& J) {
    const RotationState<double> state = moved(d);
    const Quaternion<double>& q = state.attitude;
    const Vec3<Dual> turn{dynamics::independent(0, 0), dynamics::independent(0, 1),
                          dynamics::independent(0, 2)};
    const Vec3<Dual> omega{dynamics::independent(state.omega[0], 3), dynamics::independent(state.omega[1], 4),
                           dynamics::independent(state.omega[2], 5)};
    const RotationState<Dual> start{
        Quaternion<Dual>{Dual(q.w), Dual(q.x), Dual(q.y), Dual(q.z)} * flight::exp(turn), omega};
    const auto predicted = flight::rotate_freely(inertia_dual, start, window, kFine).states;
    r.resize(3 * static_cast<long>(window.size()));
    J.resize(r.size(), 6);
    if (predicted.empty()) r.setConstant(kNotSolved), J.setZero();
    for (std::size_t i = 0; i < predicted.size(); ++i) {
      const Quaternion<double>& m = s.attitude[i];
      const Vec3<Dual> error = flight::rotation_between(
          Quaternion<Dual>{Dual(m.w), Dual(m.x), Dual(m.y), Dual(m.z)}, predicted[i].attitude);
      for (int a = 0; a < 3; ++a) {
        const long row = 3 * static_cast<long>(i) + a;
        r[row] = error[a].a / s.sigma_angle;
        J.row(row) = error[a].v.head<6>().transpose() / s.sigma_angle;
      }
    }
  };
  for (std::size_t size = std::min<std::size_t>(3, n);; size = std::min(4 * size, n)) {
    window.assign(s.elapsed.begin(), s.elapsed.begin() + static_cast<long>(size));
    if (!gauss_newton(
            evaluate, [&](const VectorXd& d) { x = moved(d); }, 6, s.sigma_angle))
      return false;
    if (size == n) break;
  }
  fit.rotation = x;
  const auto predicted = flight::rotate_freely(inertia, x, s.elapsed, kFine).states;
  for (std::size_t i = 0; i < predicted.size(); ++i)
    fit.orientation_residuals.push_back(flight::rotation_between(predicted[i].attitude, s.attitude[i]));
  return !predicted.empty();
}

void fit_angle(const FlightSamples& s, std::size_t n, FreeFlightFit& fit) {
  const auto line = dynamics::fit_line(std::span(s.elapsed).first(n), std::span(s.theta).first(n));
  fit.theta = line.at(0);
  fit.rotation = {flight::exp(Vec3<double>{0, -fit.theta, 0}), {0, -line.slope, 0}};
  for (std::size_t i = 0; i < s.elapsed.size(); ++i)
    fit.orientation_residuals.push_back({0, -(s.theta[i] - fit.theta - line.slope * s.elapsed[i]), 0});
}

Spread spread(std::vector<double> x) {
  Spread out;
  out.n = x.size();
  if (x.empty()) return out;
  std::sort(x.begin(), x.end());
  const auto n = static_cast<double>(x.size());
  out.median = 0.5 * (x[(x.size() - 1) / 2] + x[x.size() / 2]);
  double squares = 0;
  for (const double e : x) out.mean += e / n;
  for (const double e : x) squares += (e - out.mean) * (e - out.mean);
  if (x.size() > 1) out.std = std::sqrt(squares / (n - 1));
  return out;
}

FreeFlightStatistics statistics(const std::vector<FreeFlightErrors>& each, datasets::Split split) {
  FreeFlightStatistics out;
  std::vector<double> position, angle;
  double squares = 0, samples = 0;
  for (const FreeFlightErrors& one : each) {
    if (one.split != split || one.outcome != FreeFlightOutcome::fitted) continue;
    ++out.n;
    const auto n = static_cast<double>(one.whole.times.size());
    squares += n * one.trajectory_rms * one.trajectory_rms;
    samples += n;
    position.push_back(one.end_position_error);
    if (one.end_orientation_error) angle.push_back(*one.end_orientation_error * 180 / std::numbers::pi);
  }
  if (samples > 0) out.trajectory_rms_m = std::sqrt(squares / samples);
  out.end_position_error_m = spread(std::move(position));
  out.end_orientation_error_deg = spread(std::move(angle));
  return out;
}

}  // namespace

FreeFlightFit fit_free_flight(const ThrowLog& log, const Throw& one, double fraction) {
  if (!(fraction > 0 && fraction <= 1))
    throw std::invalid_argument(fmt::format("free flight: fraction = {} is not in (0, 1]", fraction));
  FreeFlightFit fit;
  const auto stop = [&fit](FreeFlightOutcome outcome, std::string reason) {
    fit.outcome = outcome;
    fit.reason = std::move(reason);
    return fit;
  };
  if (!one.mocap) return stop(FreeFlightOutcome::no_tracking, "no mocap");
  if (one.hand && !one.free_flight)
    return stop(FreeFlightOutcome::not_free, "a hand and no free_flight: it is not known when it flies");
  if (const std::string held = datasets::held_by(log, one); !held.empty())
    return stop(FreeFlightOutcome::not_free,
                held + " and no free_flight: it is held at first, and not known when it flies");
  FlightSamples s = read_flight_samples(log, one);
  fit.removed = remove_glitches(s);
  fit.times = s.times;
  if (fit.times.size() < kFewestFlightSamples)
    return stop(FreeFlightOutcome::too_short, fmt::format("{} valid samples in free flight, fewer than {}",
                                                          fit.times.size(), kFewestFlightSamples));
  const auto samples = static_cast<double>(fit.times.size());
  fit.fitted = std::max<std::size_t>(2, static_cast<std::size_t>(std::ceil(fraction * samples - 1e-9)));
  fit.oriented = !s.attitude.empty() || !s.theta.empty();
  const Object& object = log.objects.at(one.object);
  try {
    if (!fit_translation(s, {0, 0, -log.gravity}, object.drag_k.value_or(0), fit.fitted, fit))
      return stop(FreeFlightOutcome::not_solved, "the fit of the position did not converge");
    if (!s.theta.empty()) fit_angle(s, fit.fitted, fit);
    if (!s.attitude.empty()) {
      Vec3<double> inertia{1, 1, 1};
      if (object.inertia && object.inertia->size() == 3)
        std::copy_n(object.inertia->begin(), 3, inertia.begin());
      if (!fit_rotation(s, inertia, fit.fitted, fit))
        return stop(FreeFlightOutcome::not_solved, "the fit of the orientation did not converge");
    }
  } catch (const std::runtime_error& error) {
    return stop(FreeFlightOutcome::not_solved, error.what());
  }
  return fit;
}

FreeFlightErrors free_flight_errors(const ThrowLog& log, const Throw& one) {
  FreeFlightErrors out;
  out.id = one.id;
  out.split = one.split;
  out.whole = fit_free_flight(log, one, 1.0);
  out.half = fit_free_flight(log, one, 0.5);
  const FreeFlightFit& worse = out.whole.outcome != FreeFlightOutcome::fitted ? out.whole : out.half;
  out.outcome = worse.outcome;
  out.reason = worse.reason;
  if (out.outcome != FreeFlightOutcome::fitted) return out;
  const std::vector<double>& t = out.whole.times;
  double squares = 0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    out.normalised_time.push_back((t[i] - t.front()) / (t.back() - t.front()));
    squares += flight::dot(out.whole.position_residuals[i], out.whole.position_residuals[i]);
  }
  out.trajectory_rms = std::sqrt(squares / static_cast<double>(t.size()));
  out.end_position_error = flight::norm(out.half.position_residuals.back());
  if (out.half.oriented) out.end_orientation_error = flight::norm(out.half.orientation_residuals.back());
  return out;
}

FreeFlightComparison compare_free_flights(const ThrowLog& log, int threads) {
  using Clock = std::chrono::steady_clock;
  if (threads < 0) throw std::invalid_argument(fmt::format("free flight: threads = {} is not >= 0", threads));
  FreeFlightComparison out;
  const std::size_t n = log.throws.size();
  out.each.resize(n);
  std::vector<double> seconds(n);
  if (n > 0) free_flight_errors(log, log.throws[0]);  // warms up, untimed
  dynamics::parallel_for(n, threads, [&](std::size_t i) {
    const auto begin = Clock::now();
    out.each[i] = free_flight_errors(log, log.throws[i]);
    seconds[i] = std::chrono::duration<double>(Clock::now() - begin).count();
  });
  out.train = statistics(out.each, datasets::Split::train);
  out.test = statistics(out.each, datasets::Split::test);
  out.skipped = n - out.train.n - out.test.n;
  for (const double s : seconds) out.microseconds_per_throw += 1e6 * s / static_cast<double>(n);
  return out;
}

}  // namespace unhand::experiment
