// The release: from a grasp in a moving hand to the state at detach.
#pragma once

#include <string>
#include <vector>

#include "contact/contact_model.hpp"
#include "dynamics/integrator.hpp"
#include "release/grasp.hpp"
#include "release/hand_motion.hpp"

namespace unhand::release {

/// Everything that determines a release. The references must outlive the simulation, and the readings of its
/// result (mode_events, sample_release). A held object starts in the mode that its grip allows; one that
/// slips already starts slipping. Accepted: mass (0, 1e4] kg, inertia (0, 1e6] kg m², com_offset and across
/// [-100, 100] m, start [-1e6, 1e6] s and within the hand's motion but not at its end, everything else
/// finite. Units cannot be seen here: metres and radians are taken as they are given.
template <class S>
struct ReleaseProblem {
  const HandMotion& hand;                    ///< in the world
  const contact::NormalForce& normal_force;  ///< of one pad [N]
  const contact::ContactModel& contact;      ///< the friction law and its modes
  dynamics::RigidBody<S> body;               ///< kg, kg m²
  dynamics::Vec2<S> gravity;                 ///< m/s²
  Grasp<S> grasp;                            ///< where the pads hold the object
  double start{};                            ///< [s]
  dynamics::Vec2<S> slip{};                  ///< of the patch at the start [m/s]; zero: held
  /// ω_O − ω_H at the start [rad/s]. A law that knows no slip (gripper_delay) starts without slip and spin.
  S spin{};
};

/// How a release ended.
enum class ReleaseOutcome {
  detached,         ///< free: the state at detach is the answer
  never_separated,  ///< the normal force is still there at the end of the hand's motion
  not_solved,       ///< the integrator stopped, see `integration`
};
/// The outcome's name, as it is written above.
const char* to_string(ReleaseOutcome);
/// The same as a clause, for people.
const char* in_words(ReleaseOutcome);

/// The one value that flight gets.
template <class S>
struct DetachState {
  S time{};                  ///< [s]
  dynamics::Pose<S> pose;    ///< of the CoM, in the world
  dynamics::Twist<S> twist;  ///< of the CoM, in the world [m/s, m/s, rad/s]
};

/// What happened, in order: the mode entered at `time`, and why. The first mode of an object that is held at
/// the start is no event; where it slips at once, or moves against the hand there, that mode is one of cause
/// "start". A mode entered again at a kink or a jump ("time") is told again; pads that give at every point
/// have no modes but "free".
struct ModeEvent {
  double time{};      ///< s
  std::string cause;  ///< the guard's name, "start", "time" or "limit"
  std::string mode;   ///< the mode entered
};

/// Energy from the start to detach [J]: kinetic + potential change = hand + friction, and what is left is
/// `residual`.
struct EnergyLedger {
  double mechanical_change{};  ///< ½ m v² + ½ I ω² − m g·p
  double hand_work{};          ///< of the wrench through the hand's motion
  double
      linear_friction{};  ///< ∫ f · v_r dt <= 0, without the part below; plus what compliant pads give back
  double torsional_friction{};  ///< ∫ τ ω_r dt <= 0, likewise
  double nonphysical_work{};    ///< ∫ max(f · v_r, 0) dt where the law is a surrogate that may feed energy
  double residual{};  ///< mechanical_change − all the others: the quadrature's and integrator's error
};

/// How the release is integrated, and what is kept.
struct ReleaseOptions {
  dynamics::IntegratorOptions integrator{};  ///< tolerances, budgets, method
  bool ledger{false};  ///< book the energy (records the trajectory); of problems of double alone
};

/// How a release ended: state at detach, events, energy.
template <class S>
struct ReleaseResult {
  ReleaseOutcome outcome{};         ///< only `detached` has a state to fly from
  dynamics::Outcome integration{};  ///< how the integrator ended
  bool slips_at_start{};            ///< the grip cannot hold the object even before it opens
  /// The answer, if detached. Of its derivatives no error is controlled. Against differences of 700 shaken
  /// throws of the sliding pivot (8,135 of them, 1,000 behind brakes) one, behind a brake, is 2 % off with a
  /// relative tolerance of 1e-6, none by more than 2e-4 of itself with 1e-7, nor by 3e-6 with 1e-8.
  DetachState<S> detach;
  contact::Relative<S> relative;  ///< the object against the hand at detach
  /// In order of time; mode_events puts them into words. The time at which a brake of the sliding pivot stops
  /// has a derivative that is up to 2 % off with 1e-8, 2e-4 with 1e-9 (197 comparisons in the same throws).
  std::vector<dynamics::Event<S, 6>> events;
  dynamics::Trajectory<S, 6> trajectory;      ///< relative states, if recorded
  dynamics::IntegratorStatistics statistics;  ///< what the integration cost
  EnergyLedger ledger;                        ///< zero unless options.ledger
};

/// Throws std::invalid_argument, naming parameter, value and range, for a problem that is none. Instantiated
/// for double and Dual.
template <class S>
void validate(const ReleaseProblem<S>& problem);

/// Simulates from `problem.start` to detach. Throws std::invalid_argument when an input is not finite (an
/// instant of the hand or of the normal force, too; a release at +infinity is none) or out of range
/// (ReleaseProblem), where a ledger is asked for with derivatives, where the normal force is not zero after
/// its own release_time() (looked at right after it, at the end of the hand's motion and midway), and where
/// it is below zero at an instant that the integration looks at: a dip between two of them is not seen. A
/// release before the start is none of these: the object is free from the start on, detached there without an
/// event. A hand that is not finite where it is followed, or at detach, leaves it `not_solved`, `not_finite`.
/// Throws std::logic_error for a law that breaks what ContactModel says of modes and guards. Instantiated for
/// double and Dual.
template <class S>
ReleaseResult<S> simulate_release(const ReleaseProblem<S>& problem, const ReleaseOptions& options = {});

/// The event log in words.
template <class S>
std::vector<ModeEvent> mode_events(const ReleaseProblem<S>& problem, const ReleaseResult<S>& result);

/// A recorded release at t: pose, twist, and the wrench about the patch, all of the object in the world.
template <class S>
struct ReleaseSample {
  std::string_view mode;          ///< the mode in force; of the law, as long as that lives
  dynamics::Pose<S> pose;         ///< of the CoM [m, m, rad]
  dynamics::Twist<S> twist;       ///< of the CoM [m/s, m/s, rad/s]
  dynamics::Wrench<S> wrench;     ///< by the pads, about the patch [N, N, N m]
  HandState<S> hand;              ///< the hand at that instant
  S normal_force{};               ///< of one pad [N]
  contact::Relative<S> relative;  ///< the object against the hand
};
/// The release at t [s], start <= t <= detach; throws std::out_of_range for another t, and without a recorded
/// trajectory.
template <class S>
ReleaseSample<S> sample_release(const ReleaseProblem<S>& problem, const ReleaseResult<S>& result, const S& t);

}  // namespace unhand::release
