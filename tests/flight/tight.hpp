// Integration to the limit of what doubles hold.
#pragma once

#include "dynamics/integrator.hpp"

namespace unhand::flight {

inline const dynamics::IntegratorOptions kTight{.tolerances = {1e-12, 1e-13}};

}  // namespace unhand::flight
