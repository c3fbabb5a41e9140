// How the hand moves: pose, twist and acceleration of the frame midway between the pads, as functions of time that
// are derivatives of each other.
#pragma once

#include <vector>

#include "dynamics/frames.hpp"
#include "dynamics/scalar.hpp"
#include "dynamics/window.hpp"

namespace unhand::release {

using dynamics::Dual;
using dynamics::Window;

/// The hand at an instant, in the world.
template <class S>
struct HandState {
  dynamics::Pose<S> pose;                  ///< m, m, rad
  dynamics::Twist<S> twist;                ///< m/s, m/s, rad/s
  dynamics::Acceleration<S> acceleration;  ///< m/s², m/s², rad/s²
};

class HandMotion {
 public:
  virtual ~HandMotion() = default;
  virtual HandState<double> at(const Window&, double t) const = 0;
  virtual HandState<Dual> at(const Window&, const Dual& t) const = 0;
  /// Instants [s], increasing, strictly inside (begin, end), at which the acceleration jumps.
  virtual std::vector<double> jumps() const = 0;
  /// First and last instant [s] at which the motion is known.
  virtual double begin() const = 0;
  virtual double end() const = 0;
};

}  // namespace unhand::release
