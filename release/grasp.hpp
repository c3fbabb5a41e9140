// How the object is held before the gripper opens.
#pragma once

#include "dynamics/frames.hpp"

namespace unhand::release {

/// p_WO = p_WH + com_offset · e_x(θ_O): the pads hold a point of the object's x axis, `com_offset` [m] behind
/// the CoM; `angle` is θ_O − θ_H [rad].
template <class S>
struct Grasp {
  S com_offset{};  ///< m; positive: the CoM is ahead of the pads along the object's x axis
  S angle{};       ///< rad
};

}  // namespace unhand::release
