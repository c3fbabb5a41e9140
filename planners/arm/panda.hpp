// The Franka Emika Panda, from what is published of it.
#pragma once

#include "planners/arm/chain.hpp"

namespace unhand::planners {

/// Seven joints, up to the flange: modified Denavit-Hartenberg parameters and limits of position, velocity,
/// acceleration, jerk and torque as the manufacturer publishes them [FrankaFCI]; masses, centres of mass,
/// inertias and friction as identified by [Gaz2019]. They move the arm as measured; single ones that the
/// torques do not determine (the inertia of link 1 about x, say) are what the identification left there.
Chain panda();

/// Its usual ready pose [rad].
JointVector<double> panda_ready();

}  // namespace unhand::planners
