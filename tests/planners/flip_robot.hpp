// The robot that the tests of the throw-flip share.
#pragma once

#include "planners/flip/robot.hpp"

namespace unhand::planners::flip {

inline const FlipRobot& robot() {
  static const FlipRobot it = read_flip_robot("panda-flip");
  return it;
}

}  // namespace unhand::planners::flip
