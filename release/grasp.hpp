// How the object is held before the gripper opens.
#pragma once

#include "dynamics/frames.hpp"

namespace unhand::release {

/// p_WO = p_WH + com_offset · e_x(θ_O) + across · e_z(θ_O): the pads hold a point `com_offset` [m] behind the
/// CoM along the object's x axis, and beside that axis by `across`; `angle` is θ_O − θ_H [rad].
template <class S>
struct Grasp {
  S com_offset{};  ///< m; positive: the CoM is ahead of the pads along the object's x axis
  S angle{};       ///< rad
  S across{};      ///< m; positive: the CoM is ahead of the pads along the object's z axis
};

}  // namespace unhand::release
