#include "fitting/measured/flight_discovery.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <stdexcept>

#include "dynamics/parallel.hpp"
#include "dynamics/twice_integrated.hpp"
#include "experiment/free_flight.hpp"
#include "experiment/tracked_flight.hpp"

namespace unhand::fitting {

using datasets::ThrowLog;
using flight::Quaternion;
using flight::Vec3;

namespace {

const dynamics::IntegratorOptions kFine =
    dynamics::error_controlled({1e-8, 1e-10});  // m, rad: far below any tracker

/// Of a flight that could not be integrated: its equations are not finite, and so not solved.
constexpr double kNotSolved = std::numeric_limits<double>::quiet_NaN();

template <class S>
Quaternion<S> converted(const Quaternion<double>& q) {
  return {S(q.w), S(q.x), S(q.y), S(q.z)};
}

/// What a flight in the plane x, z cannot tell goes.
void restrict_to_plane(std::vector<dynamics::Effect>& effects) {
  for (auto& e : effects)
    std::erase_if(e.parameters, [](const dynamics::EffectParameter& p) { return p.in_space_only; });
  std::erase_if(effects, [](const dynamics::Effect& e) { return e.parameters.empty(); });
}

}  // namespace

FlightProblem::FlightProblem(const ThrowLog& log, int threads) : gravity_(log.gravity) {
  datasets::validate(log);
  const bool planar = log.dimension == 2;
  if (planar) {
    axes_ = {0, 2}, turns_ = {1}, turn_sign_ = -1;
    channels_ = {"position_x", "position_z", "theta"};
  } else {
    axes_ = turns_ = {0, 1, 2};
    channels_ = {"position_x", "position_y", "position_z", "rotation_x", "rotation_y", "rotation_z"};
  }
  covariates_ = {"launch speed [m/s]", "spin [rad/s]", "duration [s]", "start height [m]", "start x [m]"};
  if (!planar) covariates_.push_back("start y [m]");
  covariates_.push_back("order");
  const auto splits = splits_of(log);
  std::vector<experiment::FreeFlightFit> starts(log.throws.size());
  dynamics::parallel_for(starts.size(), threads, [&](std::size_t i) {
    starts[i] = experiment::fit_free_flight(log, log.throws[i], 1.0);
  });
  // Where no sigma is declared: the scatter from sample to sample, of all flights of an object together.
  std::map<std::string, std::vector<experiment::FlightScatter>> scatter;
  for (std::size_t i = 0; i < log.throws.size(); ++i)
    if (starts[i].outcome == experiment::FreeFlightOutcome::fitted)
      scatter[log.throws[i].object].push_back(
          experiment::scatter_of(experiment::read_flight_samples(log, log.throws[i])));
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    const auto& one = log.throws[i];
    if (const std::string why = add(log, one, splits[i], starts[i], experiment::pooled(scatter[one.object]));
        !why.empty())
      skipped_.push_back({one.id, why});
  }
  if (groups_.empty())
    throw std::invalid_argument("free flights: no throw is one" +
                                (skipped_.empty() ? "" : ": " + skipped_.front().second));
}

std::string FlightProblem::add(const ThrowLog& log, const datasets::Throw& one, datasets::Split split,
                               const experiment::FreeFlightFit& fit, const experiment::FlightScatter& usual) {
  constexpr std::size_t kFewest = 6;
  if (fit.outcome != experiment::FreeFlightOutcome::fitted || fit.times.size() < kFewest)
    return fit.reason.empty() ? fmt::format("fewer than {} samples", kFewest) : fit.reason;
  Flight flight;
  flight.samples = experiment::read_flight_samples(log, one);
  auto& s = flight.samples;
  if (!s.declared) {
    constexpr double kLeast = 1e-9;  // m, rad
    for (std::size_t a = 0; a < 3; ++a) s.sigma[a] = std::max(kLeast, usual.position[a]);
    s.sigma_angle = std::max(kLeast, usual.angle);
  }
  glitches_ += experiment::remove_glitches(s);
  const auto& object = log.objects.at(one.object);
  flight.drag_k = object.drag_k.value_or(0);
  declared_["flight.quadratic_drag.k[" + one.object + "]"] = flight.drag_k;
  if (object.inertia && object.inertia->size() == 3)
    std::copy_n(object.inertia->begin(), 3, flight.inertia.begin());
  flight.reference = fit.rotation.attitude;
  for (const double theta : s.theta) s.attitude.push_back(flight::exp(Vec3<double>{0, -theta, 0}));

  Group group{one.id, one.object, one.condition, split, {}, {}, {}};
  const bool turns = !s.attitude.empty();
  for (const auto* start : {&fit.position, &fit.velocity})
    for (const std::size_t a : axes_) group.start.push_back((*start)[a]);
  if (turns) {
    group.start.insert(group.start.end(), turns_.size(), 0.0);
    for (const std::size_t a : turns_) group.start.push_back(fit.rotation.omega[a]);
  }
  for (const double t : s.elapsed)
    for (int c = 0; c < (turns ? static_cast<int>(channels_.size()) : position_channels()); ++c)
      group.rows.push_back({c, t});
  group.covariates = {flight::norm(fit.velocity), turns ? flight::norm(fit.rotation.omega) : 0,
                      s.elapsed.back(), fit.position[2], fit.position[0]};
  if (log.dimension == 3) group.covariates.push_back(fit.position[1]);
  group.covariates.push_back(static_cast<double>(groups_.size()));
  groups_.push_back(std::move(group));
  flights_.push_back(std::move(flight));
  return {};
}

std::vector<dynamics::Effect> FlightProblem::effects() const {
  auto out = experiment::known_flight_effects();
  if (std::all_of(flights_.begin(), flights_.end(),
                  [](const Flight& f) { return f.samples.attitude.empty(); }))
    std::erase_if(out, [](const dynamics::Effect& e) { return e.needs.attitude; });
  if (axes_.size() == 2) restrict_to_plane(out);
  return out;
}

double FlightProblem::sigma(std::size_t group, int channel) const {
  const auto& s = flights_[group].samples;
  return channel < position_channels() ? s.sigma[axes_[static_cast<std::size_t>(channel)]] : s.sigma_angle;
}

template <class S>
experiment::TrackedFlight<S> FlightProblem::started(const Flight& flight, const std::vector<S>& x) const {
  experiment::TrackedFlight<S> declared;
  declared.gravity = gravity_;
  declared.drag_k = flight.drag_k;
  for (std::size_t a = 0; a < 3; ++a) declared.start.inertia[a] = S(flight.inertia[a]);
  const std::size_t axes = axes_.size(), turns = turns_.size();
  for (std::size_t k = 0; k < axes; ++k) {
    declared.start.position[axes_[k]] = x[k];
    declared.start.velocity[axes_[k]] = x[axes + k];
  }
  if (x.size() > 2 * axes) {
    Vec3<S> turn{S(0.0), S(0.0), S(0.0)}, omega = turn;
    for (std::size_t k = 0; k < turns; ++k) {
      turn[turns_[k]] = x[2 * axes + k];
      omega[turns_[k]] = x[2 * axes + turns + k];
    }
    declared.start.rotation = {converted<S>(flight.reference) * flight::exp(turn), omega};
  }
  return declared;
}

GroupEquations FlightProblem::equations(std::size_t group, std::span<const std::string> names,
                                        std::span<const double> values, const Eigen::VectorXd& own,
                                        Derivatives derivatives) const {
  const Flight& flight = flights_[group];
  const OwnNames mine(names, groups_[group].object);
  const std::vector<double> shared = mine.values(values);
  const auto residual = [&]<class S>(const std::vector<S>& effects, const std::vector<S>& x) {
    const auto declared = started(flight, x);
    const bool oriented = x.size() > 2 * axes_.size();
    const auto& s = flight.samples;
    const auto poses =
        experiment::tracked_poses(declared, dynamics::Values<S>(mine.names, effects), s.elapsed, kFine);
    std::vector<S> out;
    if (poses.size() != s.elapsed.size()) out.assign(groups_[group].rows.size(), S(kNotSolved));
    out.reserve(poses.size() * channels_.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      for (const std::size_t a : axes_) out.push_back((poses[i].position[a] - s.position[i][a]) / s.sigma[a]);
      if (!oriented) continue;
      const Vec3<S> error = flight::rotation_between(converted<S>(s.attitude[i]), poses[i].attitude);
      for (const std::size_t a : turns_) out.push_back(turn_sign_ * error[a] / s.sigma_angle);
    }
    return out;
  };
  GroupEquations out;
  try {
    out = swept(shared, own, derivatives, residual);
  } catch (const std::invalid_argument&) {
    return {};  // a step led where no flight is
  }
  if (derivatives == Derivatives::all) mine.spread(out, names.size());
  return out;
}

GroupMotion FlightProblem::motion(std::size_t group, std::span<const std::string> names,
                                  std::span<const double> values, const Eigen::VectorXd& own) const {
  const Flight& flight = flights_[group];
  const OwnNames mine(names, groups_[group].object);
  const std::vector<double> shared = mine.values(values);
  const auto start = started(flight, std::vector<double>(own.data(), own.data() + own.size()));
  const auto& time = flight.samples.elapsed;
  constexpr double kBeside = 1e-4;  // s
  std::vector<double> before, after;
  for (const double t : time) before.push_back(std::max(0.0, t - kBeside)), after.push_back(t + kBeside);
  const auto poses = [&](const std::vector<double>& times) {
    return experiment::tracked_poses(start, dynamics::Values<double>(mine.names, shared), times, kFine);
  };
  const auto from = poses(before), to = poses(after);
  GroupMotion out;
  if (from.size() != time.size() || to.size() != time.size()) return out;
  out.time = time;
  out.in_world = true;
  for (std::size_t i = 0; i < time.size(); ++i) {
    const double per_second = 1 / (after[i] - before[i]);
    out.velocity.push_back(flight::scaled(per_second, flight::difference(to[i].position, from[i].position)));
    if (!oriented(group)) continue;
    const auto& attitude = from[i].attitude;
    const auto turned = flight::rotation_between(attitude, to[i].attitude);
    out.spin.push_back(flight::rotate(attitude, flight::scaled(per_second, turned)));
    out.body.push_back({flight::rotate(attitude, Vec3<double>{1, 0, 0}),
                        flight::rotate(attitude, Vec3<double>{0, 1, 0}),
                        flight::rotate(attitude, Vec3<double>{0, 0, 1})});
  }
  return out;
}

Eigen::VectorXd FlightProblem::response(std::size_t group,
                                        const std::vector<Vec3<double>>& acceleration) const {
  const auto& s = flights_[group].samples;
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(groups_[group].rows.size()));
  const std::size_t width = oriented(group) ? channels_.size() : axes_.size();
  for (std::size_t k = 0; k < axes_.size(); ++k) {
    std::vector<double> along;
    for (const auto& a : acceleration) along.push_back(a[axes_[k]]);
    const auto moved = dynamics::twice_integrated(s.elapsed, along);
    for (std::size_t i = 0; i < moved.size(); ++i)
      out[static_cast<Eigen::Index>(i * width + k)] = moved[i] / s.sigma[axes_[k]];
  }
  return out;
}

FlightErrors flight_errors(const FlightProblem& problem, const GroupedFit& fit, int threads) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();
  const int positions = problem.position_channels();
  FlightErrors out;
  const auto used = fit.solved_groups();
  struct One {
    double squares{}, n{}, position{}, angle{};
    bool solved{}, oriented{};
  };
  std::vector<One> each(used.size());
  dynamics::parallel_for(used.size(), threads, [&](std::size_t k) {
    const std::size_t i = used[k];
    const auto& group = problem.groups()[i];
    One& one = each[k];
    const auto size = [&](const Eigen::VectorXd& residual, std::size_t row) {
      return residual[static_cast<Eigen::Index>(row)] * problem.sigma(i, group.rows[row].channel);
    };
    for (std::size_t j = 0; j < group.rows.size(); ++j)
      if (group.rows[j].channel < positions)
        one.squares += std::pow(size(fit.groups[i].residual, j), 2), one.n += 1.0 / positions;
    one.oriented = problem.oriented(i);
    const std::size_t width = one.oriented ? problem.channels().size() : static_cast<std::size_t>(positions);
    const std::size_t samples = group.rows.size() / width;
    const double half = group.rows[(samples - 1) / 2 * width].time;
    const GroupFit part =
        fit_own_part(problem, i, fit, [&](const GroupRow& row) { return row.time <= half; });
    one.solved = part.solved;
    if (!part.solved) return;
    double position = 0, angle = 0;
    for (std::size_t j = group.rows.size() - width; j < group.rows.size(); ++j)
      (group.rows[j].channel < positions ? position : angle) += std::pow(size(part.residual, j), 2);
    one.position = std::sqrt(position);
    one.angle = kDegrees * std::sqrt(angle);
  });
  double squares = 0, n = 0;
  std::vector<double> position, angle;
  for (const One& one : each) {
    squares += one.squares, n += one.n;
    if (!one.solved) continue;
    position.push_back(one.position);
    if (one.oriented) angle.push_back(one.angle);
  }
  const auto mean_median = [](std::vector<double> x, double& mean, double& median) {
    mean = median = kNotMeasured;
    if (x.empty()) return;
    std::sort(x.begin(), x.end());
    mean = 0;
    median = 0.5 * (x[(x.size() - 1) / 2] + x[x.size() / 2]);
    for (const double v : x) mean += v / static_cast<double>(x.size());
  };
  out.n = static_cast<int>(used.size());
  out.trajectory_rms = n > 0 ? std::sqrt(squares / n) : kNotMeasured;
  mean_median(std::move(position), out.end_position_mae, out.end_position_median);
  mean_median(std::move(angle), out.end_orientation_mae, out.end_orientation_median);
  out.chi2_per_dof = fit.chi2_per_dof();
  return out;
}

}  // namespace unhand::fitting
