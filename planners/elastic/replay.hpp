// A planned throw of a clutched arm, run by the event-detected integrator.
#pragma once

#include <vector>

#include "dynamics/integrator.hpp"
#include "planners/elastic/throw_program.hpp"

namespace unhand::planners::elastic {

/// (ξ, ξ̇)
inline constexpr int kStates = 2 * kCoordinates;

/// Motor torques over time: parabolas through three values per interval.
struct TorqueInterval {
  double begin{}, end{};                     ///< s
  MotorTorques<double> first, middle, last;  ///< N m, at the begin, middle and end
};

/// A phase of the schedule.
struct ScheduledPhase {
  ClutchMode mode{};  ///< clutches that are engaged
  double begin{};     ///< s: its clutches close here, with the impact that this takes
};

/// Torques and a schedule of clutch modes. The clutches switch at time events, where the rates become what
/// `engage` leaves of them; a spring at its largest deflection ends the run.
class ClutchedArmSystem final : public dynamics::HybridSystemFrom<ClutchedArmSystem, kStates> {
 public:
  /// (ξ, ξ̇) [rad, rad/s]
  template <class S>
  using Full = dynamics::State<S, kStates>;

  /// The arm is kept by reference; phases and intervals in order of time.
  ClutchedArmSystem(const ClutchedArm& arm, std::vector<ScheduledPhase> phases,
                    std::vector<TorqueInterval> torques);

  int spring_stop() const { return static_cast<int>(phases_.size()); }  ///< the mode after the last phase

  dynamics::FlowKind kind(int mode) const override;
  std::string_view mode_name(int mode) const override;
  int guard_count(int mode) const override { return mode == spring_stop() ? 0 : 1; }
  dynamics::Guard guard(int, int) const override {
    return {"spring at its stop", dynamics::Crossing::falling, false};
  }

  /// The begins of phases and intervals [s], increasing.
  template <class S>
  void time_events_(std::vector<S>& out) const {
    out.clear();
    for (const double begin : begins_) out.push_back(S(begin));
  }
  /// d/dt (ξ, ξ̇) in the phase's mode.
  template <class S>
  void flow_(const dynamics::Phase& phase, const S& t, const Full<S>& y, Full<S>& dy) const;
  /// The spring's deflection against its largest one.
  template <class S>
  void guards_(const dynamics::Phase&, const S&, const Full<S>& y, S* g) const {
    const S share = (y[0] - y[1]) / arm_.last.deflection;
    g[0] = 1.0 - share * share;
  }
  /// To the mode after the last phase, which ends the run.
  template <class S>
  dynamics::Entry<S, kStates> on_guard_(const dynamics::Phase&, int, const S& t, const Full<S>& y) const {
    return {spring_stop(), t, y, S(0.0)};
  }
  /// The next phase, its clutches closing by `engage`.
  template <class S>
  dynamics::Entry<S, kStates> on_time_(int mode, const dynamics::Window& window, const S& t,
                                       const Full<S>& y) const;

  /// The clutches of a phase; the arm's own modes are phases.
  ClutchMode clutches(int mode) const { return phases_[mode].mode; }
  /// The torques at t, in the interval that holds at the right of `begin`.
  template <class S>
  MotorTorques<S> torque_at(double begin, const S& t) const;

 private:
  ClutchedArm arm_;
  std::vector<ScheduledPhase> phases_;
  std::vector<TorqueInterval> torques_;
  std::vector<double> begins_;  ///< of both, those of one instant once
};

/// One instant of a run.
struct ReplaySample {
  double t{};                    ///< s
  ClutchMode mode{};             ///< clutches that are engaged
  Coordinates<double> at, rate;  ///< ξ [rad]; ξ̇ [rad/s]
  MotorTorques<double> torque;   ///< N m
};

/// The largest share of each limit that is used, 1 = at the limit.
struct UsedShares {
  double angle{}, speed{}, acceleration{}, torque{};            ///< of the links [-]
  double motor_speed{}, motor_torque{}, deflection{}, brake{};  ///< of the last joint's drive [-]
  /// The largest of them.
  double largest() const;
};

/// How a run ended, and what it used.
struct Replay {
  dynamics::Outcome outcome{};        ///< how the integrator ended
  bool spring_stop{};                 ///< the spring came to its largest deflection
  std::vector<ReplaySample> samples;  ///< in order of time; two at an instant where two intervals meet
  TipState<double> release;           ///< the tip at the end
  UsedShares use;                     ///< over the run
  // Energy from start to end [J]: work of the motors − damping − friction − clutch impacts = gain, but for
  // `unexplained`.
  double motor_work{}, damping{}, friction{}, impacts{}, gain{};  ///< J
  /// What the balance lacks [J]: the error of quadrature and integrator.
  double unexplained() const { return motor_work - damping - friction - impacts - gain; }
};

/// Runs the torques of a plan from its first state. The record has `samples_per_interval` >= 2 samples of
/// each of the plan's intervals (node to node), evenly from one end to the other, both included; the shares
/// of the limits are the largest of these samples. Where the spring stops the run, the last interval ends
/// there.
Replay replay(const ClutchedArm& arm, const ElasticThrow& plan, int samples_per_interval = 21);

/// Where the object comes down at the height z, released at the end; empty: it never gets there.
std::optional<double> landing_x(const TipState<double>& release, double z, double gravity = 9.81);

}  // namespace unhand::planners::elastic
