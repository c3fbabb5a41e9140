#include "planners/elastic/replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include "dynamics/rigid_body.hpp"
#include "flight/projectile.hpp"

namespace unhand::planners::elastic {
namespace {

using dynamics::State;

constexpr double kTogether = 1e-12;  ///< instants that are no further apart are one [s]

template <class S>
void split(const State<S, kStates>& y, Coordinates<S>& at, Coordinates<S>& rate) {
  for (int i = 0; i < kCoordinates; ++i) at[i] = y[i], rate[i] = y[kCoordinates + i];
}
template <class S>
State<S, kStates> joined(const Coordinates<S>& at, const Coordinates<S>& rate) {
  State<S, kStates> y;
  for (int i = 0; i < kCoordinates; ++i) y[i] = at[i], y[kCoordinates + i] = rate[i];
  return y;
}

}  // namespace

ClutchedArmSystem::ClutchedArmSystem(const ClutchedArm& arm, std::vector<ScheduledPhase> phases,
                                     std::vector<TorqueInterval> torques)
    : arm_(arm), phases_(std::move(phases)), torques_(std::move(torques)) {
  if (phases_.empty() || torques_.empty())
    throw std::invalid_argument("clutched arm: a run needs at least one phase and one interval of torques");
  for (const ScheduledPhase& one : phases_) begins_.push_back(one.begin);
  for (const TorqueInterval& one : torques_) begins_.push_back(one.begin);
  std::sort(begins_.begin(), begins_.end());
  const auto together = [](double a, double b) { return b - a <= kTogether; };
  begins_.erase(std::unique(begins_.begin(), begins_.end(), together), begins_.end());
}

dynamics::FlowKind ClutchedArmSystem::kind(int mode) const {
  return mode == spring_stop() ? dynamics::FlowKind::finished : dynamics::FlowKind::smooth;
}

std::string_view ClutchedArmSystem::mode_name(int mode) const {
  return mode == spring_stop() ? "spring stop" : to_string(phases_[mode].mode);
}

template <class S>
MotorTorques<S> ClutchedArmSystem::torque_at(double begin, const S& t) const {
  auto next = std::upper_bound(torques_.begin(), torques_.end(), begin + kTogether,
                               [](double at, const TorqueInterval& one) { return at < one.begin; });
  const TorqueInterval& here = next == torques_.begin() ? *next : *std::prev(next);
  const S u = (t - here.begin) / (here.end - here.begin);
  const S first = (1.0 - u) * (1.0 - 2.0 * u), middle = 4.0 * u * (1.0 - u), last = u * (2.0 * u - 1.0);
  MotorTorques<S> out;
  for (int i = 0; i < 3; ++i) out[i] = first * here.first[i] + middle * here.middle[i] + last * here.last[i];
  return out;
}

template <class S>
void ClutchedArmSystem::flow_(const dynamics::Phase& phase, const S& t, const Full<S>& y, Full<S>& dy) const {
  Coordinates<S> at, rate;
  split<S>(y, at, rate);
  dy = joined<S>(rate, acceleration_in<S>(arm_, phases_[phase.mode].mode, at, rate,
                                          torque_at<S>(phase.window.begin, t)));
}

template <class S>
dynamics::Entry<S, kStates> ClutchedArmSystem::on_time_(int mode, const dynamics::Window& window, const S& t,
                                                        const Full<S>& y) const {
  int now = mode;
  while (now + 1 < spring_stop() && phases_[now + 1].begin <= window.begin + kTogether) ++now;
  if (now == mode) return {mode, t, y, S(0.0)};
  Coordinates<S> at, rate;
  split<S>(y, at, rate);
  return {now, t, joined<S>(at, engage<S>(arm_, phases_[now].mode, at, rate)), S(0.0)};
}

// The virtual functions of HybridSystemFrom are written where the templates can be seen.
template void ClutchedArmSystem::flow_(const dynamics::Phase&, const double&, const Full<double>&,
                                       Full<double>&) const;
template void ClutchedArmSystem::flow_(const dynamics::Phase&, const Dual&, const Full<Dual>&,
                                       Full<Dual>&) const;
template dynamics::Entry<double, kStates> ClutchedArmSystem::on_time_(int, const dynamics::Window&,
                                                                      const double&,
                                                                      const Full<double>&) const;
template dynamics::Entry<Dual, kStates> ClutchedArmSystem::on_time_(int, const dynamics::Window&, const Dual&,
                                                                    const Full<Dual>&) const;

double UsedShares::largest() const {
  return std::max({angle, speed, acceleration, torque, motor_speed, motor_torque, deflection, brake});
}

namespace {

void use_limits(const ClutchedArm& arm, const ReplaySample& s, UsedShares& use) {
  const auto most = [](double& largest, double share) { largest = std::max(largest, std::abs(share)); };
  const Coordinates<double> acceleration = acceleration_in<double>(arm, s.mode, s.at, s.rate, s.torque);
  for (int i = 0; i < kLinks; ++i) {
    const JointLimits& l = arm.chain.joints[i].limits;
    most(use.acceleration, acceleration[2 + i] / l.acceleration);
    most(use.angle, (2 * s.at[2 + i] - l.lower - l.upper) / (l.upper - l.lower));
    most(use.speed, s.rate[2 + i] / l.velocity);
    if (i < 2) most(use.torque, s.torque[i] / l.torque);
  }
  most(use.motor_speed, s.rate[0] / arm.last.motor_speed);
  most(use.motor_torque, s.torque[2] / arm.last.motor_torque);
  if (s.mode != ClutchMode::rigid) most(use.deflection, (s.at[0] - s.at[1]) / arm.last.deflection);
  if (s.mode == ClutchMode::brk) {
    const Links<double> need =
        joint_torque<double>(arm, s.at.tail<3>(), s.rate.tail<3>(), acceleration.tail<3>());
    const double spring =
        arm.last.stiffness * (s.at[0] - s.at[1]) + arm.last.damping * (s.rate[0] - s.rate[1]);
    most(use.brake, (need[2] - spring) / arm.last.brake_torque);
  }
}

/// The samples with the shares of the limits, and what the clutches take where the mode changes.
void record(const ClutchedArm& arm, const ClutchedArmSystem& system,
            const dynamics::Trajectory<double, kStates>& trajectory, int samples_per_interval, Replay& out) {
  const auto& pieces = trajectory.pieces;
  for (auto first = pieces.begin(); first != pieces.end();) {
    const dynamics::Phase& phase = first->phase;
    if (phase.mode >= system.spring_stop()) break;
    const auto next = std::find_if(first, pieces.end(), [&](const auto& piece) {
      return piece.phase.mode != phase.mode || piece.phase.window.begin != phase.window.begin;
    });
    const auto& last = *std::prev(next);
    for (int k = 0; k < samples_per_interval; ++k) {
      const bool ends = k == samples_per_interval - 1;
      ReplaySample s;
      s.t = ends ? last.t1 : first->t0 + (last.t1 - first->t0) * k / (samples_per_interval - 1);
      s.mode = system.clutches(phase.mode);
      split<double>(ends ? last.nodes.back() : trajectory.at(s.t), s.at, s.rate);
      s.torque = system.torque_at<double>(phase.window.begin, s.t);
      use_limits(arm, s, out.use);
      if (!out.samples.empty() && out.samples.back().mode != s.mode) {
        const Coordinates<double> lost = out.samples.back().rate - s.rate;
        out.impacts += 0.5 * lost.dot(inertia_of<double>(arm, s.at.tail<3>()) * lost);  // Carnot
      }
      out.samples.push_back(s);
    }
    first = next;
  }
}

}  // namespace

Replay replay(const ClutchedArm& arm, const ElasticThrow& plan, int samples_per_interval) {
  if (plan.phases.empty()) throw std::invalid_argument("replay: the plan has no phases");
  if (samples_per_interval < 2)
    throw std::invalid_argument(
        fmt::format("replay: samples_per_interval = {}; accepted: 2 and more", samples_per_interval));
  std::vector<ScheduledPhase> phases;
  std::vector<TorqueInterval> torques;
  for (const ThrowPhase& phase : plan.phases) {
    phases.push_back({phase.mode, phase.points.front().t});
    for (std::size_t k = 0; k + 2 < phase.points.size(); k += 2)
      torques.push_back({phase.points[k].t, phase.points[k + 2].t, phase.points[k].torque,
                         phase.points[k + 1].torque, phase.points[k + 2].torque});
  }
  const ClutchedArmSystem system(arm, phases, torques);
  dynamics::IntegratorOptions options;
  options.record = true;
  options.tolerances = {1e-10, 1e-12};
  const ThrowPoint& first = plan.phases.front().points.front();
  const auto solution = dynamics::integrate<double, kStates>(
      system, {0, first.t, joined<double>(first.at, first.rate), 0.0}, plan.duration(), options);

  Replay out;
  out.outcome = solution.outcome;
  out.spring_stop = solution.mode == system.spring_stop();
  Coordinates<double> at, rate;
  split<double>(solution.y, at, rate);
  out.release = tip_of<double>(arm, at.tail<3>(), rate.tail<3>());
  out.gain = energy_of<double>(arm, at, rate) - energy_of<double>(arm, first.at, first.rate);
  // Power over the pieces of the trajectory, by Gauss's rule of five points: order 10, as the pieces are of
  // order 8.
  constexpr int kNodes = 5;
  constexpr double node[kNodes]{0.04691007703066800, 0.23076534494715845, 0.5, 0.76923465505284155,
                                0.95308992296933200},
      weight[kNodes]{0.11846344252809454, 0.23931433524968324, 0.28444444444444444, 0.23931433524968324,
                     0.11846344252809454};
  for (const auto& piece : solution.trajectory.pieces) {
    if (piece.phase.mode >= system.spring_stop()) break;
    const double length = piece.t1 - piece.t0;
    for (int k = 0; k < kNodes; ++k) {
      split<double>(piece.at_fraction(node[k]), at, rate);
      const MotorTorques<double> tau =
          system.torque_at<double>(piece.phase.window.begin, piece.t0 + node[k] * length);
      const double slip = rate[0] - rate[1];
      const JointVector<double> qd = rate.tail<3>();
      out.motor_work += weight[k] * length * (tau[0] * rate[2] + tau[1] * rate[3] + tau[2] * rate[0]);
      out.damping += weight[k] * length * arm.last.damping * slip * slip;
      out.friction += weight[k] * length * friction_torque<double>(arm.chain, qd).dot(qd);
    }
  }
  record(arm, system, solution.trajectory, samples_per_interval, out);
  return out;
}

std::optional<double> landing_x(const TipState<double>& release, double z, double gravity) {
  const auto landing = flight::project<double>({release.x, release.z, 0}, {release.vx, release.vz, 0},
                                               dynamics::level_gravity(gravity), z);
  if (!landing) return std::nullopt;
  return landing->pose.x;
}

}  // namespace unhand::planners::elastic
