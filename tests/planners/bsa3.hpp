// The arm BSA3 that the library brings along.
#pragma once

#include "planners/elastic/clutched_arm.hpp"

namespace unhand::planners::elastic {

inline ClutchedArm bsa3() { return read_clutched_arm("bsa3"); }

}  // namespace unhand::planners::elastic
