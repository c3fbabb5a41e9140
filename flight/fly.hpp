// Free flight to the landing, whatever acts on the way.
#pragma once

#include <vector>

#include "dynamics/integrator.hpp"
#include "flight/projectile.hpp"

namespace unhand::flight {

/// A planar flight. Where gravity alone acts (is_ballistic) and the CoM is tracked, the closed form is used,
/// otherwise the integrator with the landing as an event.
template <class S>
struct FlightProblem {
  dynamics::Pose<S> pose;     ///< of the CoM
  dynamics::Twist<S> twist;   ///< of the CoM [m/s, m/s, rad/s]
  dynamics::Vec2<S> gravity;  ///< m/s²
  S drag_k{};                 ///< quadratic drag, a = −k |v| v [1/m]
  S landing_height{};         ///< [m]
  dynamics::Vec2<S>
      tracked{};       ///< tracked point from the CoM, in the object's frame [m]: the event is its passage
  double longest{30};  ///< [s]; a flight that has not landed by then never reaches the height
  S lift_km{};         ///< Magnus lift, a = k_m ω J v [-]
  dynamics::Vec2<S> wind{};  ///< velocity of the air [m/s]; drag and lift see v − wind
};

/// Whether gravity alone acts, without derivatives by what else might: the CoM then moves as ballistic()
/// says. What a new effect of the air adds to FlightProblem is asked for here.
template <class S>
bool is_ballistic(const FlightProblem<S>& problem);

/// How a flight ended.
enum class FlightOutcome {
  landed,         ///< passed the landing height on its way down
  never_reaches,  ///< starts below it and does not rise above it, or `longest` passed
  not_solved,     ///< the integrator stopped
};
/// The outcome's name, as it is written above.
const char* to_string(FlightOutcome);
/// The same as a clause, for people.
const char* in_words(FlightOutcome);

/// How a flight ended, and where.
template <class S>
struct FlightResult {
  FlightOutcome outcome{};  ///< only `landed` has a landing
  dynamics::Outcome integration{
      dynamics::Outcome::finished};  ///< how the integrator ended, where it was needed
  Landing<S> landing;                ///< pose and twist of the tracked point, if it landed
};

/// Flies to the landing. Throws std::invalid_argument when an input is not finite, or drag_k or longest
/// negative. Instantiated for double and Dual.
template <class S>
FlightResult<S> fly(const FlightProblem<S>& problem, const dynamics::IntegratorOptions& options = {});

/// A flight that was integrated, to be read at any instant.
template <class S>
struct RecordedFlight {
  dynamics::Trajectory<S, 6> trajectory;  ///< pose and twist of the CoM
};
/// Flies for `longest` > 0 [s], without landing. Throws std::invalid_argument as fly() does, and
/// std::runtime_error if the flight is not solved.
template <class S>
RecordedFlight<S> record_flight(const FlightProblem<S>& problem, double longest,
                                const dynamics::IntegratorOptions& options = {});
/// The CoM's pose `t` [s] after the start of a recorded flight.
template <class S>
dynamics::Pose<S> sample_flight(const RecordedFlight<S>& flight, const S& t) {
  const auto y = flight.trajectory.at(t);
  return {y[0], y[1], y[2]};
}

/// Poses of the tracked point at `times` >= 0 [s] after the problem's state, without landing. Throws
/// std::invalid_argument for others.
template <class S>
std::vector<dynamics::Pose<S>> fly_through(const FlightProblem<S>& problem, const std::vector<double>& times,
                                           const dynamics::IntegratorOptions& options = {});

}  // namespace unhand::flight
