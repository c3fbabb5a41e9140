// Which joints of an arm move it in a vertical plane with the target, and where the others stay.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "planners/tube/nominal_throw.hpp"

namespace unhand::planners {

/// Joints that stay at an angle so that, however the others move, the tip and its z axis stay in a vertical
/// plane with `target` (in the base's frame [m]): those whose axes are not normal to the plane. A first joint
/// that stands upright turns the plane to the target, on the side on which the arm rests at `home` [rad] if
/// its range allows. The others stay as they are at `home` where that keeps the tip's axis in the plane; else
/// single ones are turned within their ranges, by as little as does it. Of several planes, the one in which
/// most joints move, two at least. Nothing where there is none, and `reason`, where given, says why. Throws
/// std::invalid_argument unless chain and target are finite and there is one finite number per joint.
std::optional<std::vector<NominalOptions::Fixed>> planar_joints(const Chain& chain,
                                                                const JointVector<double>& home,
                                                                const Eigen::Vector3d& target,
                                                                std::string* reason = nullptr);

}  // namespace unhand::planners
