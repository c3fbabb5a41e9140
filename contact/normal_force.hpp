// The normal force of one pad while the gripper opens: a profile, or a measured series smoothed with its noise known.
#pragma once

#include <span>
#include <vector>

#include "dynamics/piecewise_polynomial.hpp"
#include "dynamics/scalar.hpp"
#include "dynamics/window.hpp"

namespace unhand::contact {

using dynamics::Dual;
using dynamics::Window;

/// f_N(t) of one pad [N], >= 0, and the instants at which it kinks.
class NormalForce {
 public:
  virtual ~NormalForce() = default;
  virtual double at(const Window&, double t) const = 0;
  virtual Dual at(const Window&, const Dual& t) const = 0;
  /// Instants [s], increasing, at which f_N or its slope jumps; the last is the release, if there is one.
  virtual std::vector<double> kinks() const = 0;
  /// Start of the final interval with f_N = 0 [s]; +infinity when the pads never part.
  virtual double release_time() const = 0;
};
