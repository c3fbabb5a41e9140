// Free flight to the landing, whatever acts on the way.
#pragma once

#include <vector>

#include "dynamics/integrator.hpp"
#include "flight/projectile.hpp"

namespace unhand::flight {

/// A planar flight. With no drag the closed form is used, otherwise the integrator with the landing as an
/// event.
template <class S>
struct FlightProblem {
  dynamics::Pose<S> pose;  ///< of the CoM
  dynamics::Twist<S> twist;
  dynamics::Vec2<S> gravity;  ///< m/s²
  S drag_k{};                 ///< quadratic drag, a = −k |v| v [1/m]
  S landing_height{};         ///< [m]
  dynamics::Vec2<S>
      tracked{};       ///< tracked point from the CoM, in the object's frame [m]: the event is its passage
  double longest{30};  ///< [s]; a flight that has not landed by then never reaches the height
};

enum class FlightOutcome { landed, never_reaches, not_solved };
const char* to_string(FlightOutcome);

template <class S>
struct FlightResult {
  FlightOutcome outcome{};
  dynamics::Outcome integration{dynamics::Outcome::finished};
  Landing<S> landing;  ///< pose and twist of the tracked point, if it landed
};

/// Flies to the landing. Throws std::invalid_argument when an input is not finite or drag_k < 0. Instantiated
/// for double and Dual.
template <class S>
FlightResult<S> fly(const FlightProblem<S>& problem, const dynamics::IntegratorOptions& options = {});

/// Poses of the tracked point at `times` [s] after the problem's state, without landing.
template <class S>
std::vector<dynamics::Pose<S>> fly_through(const FlightProblem<S>& problem, const std::vector<double>& times,
                                           const dynamics::IntegratorOptions& options = {});

}  // namespace unhand::flight
