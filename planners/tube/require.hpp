// Checks of what a throw is asked for. Internal to planners/tube.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <set>
#include <stdexcept>
#include <vector>

#include "planners/arm/chain.hpp"

namespace unhand::planners {

/// Throws std::invalid_argument, naming what and the accepted range, unless `ok`.
inline void require(bool ok, const char* of, const char* name, double value, const char* range) {
  if (!ok) throw std::invalid_argument(fmt::format("{}: {} = {} is not in {}", of, name, value, range));
}

/// Throws std::invalid_argument unless there is one finite number for each joint.
inline void require_joints(const Chain& chain, const char* of, const char* name,
                           const JointVector<double>& x) {
  if (x.size() != chain.size())
    throw std::invalid_argument(
        fmt::format("{}: {} has {} values for {} joints", of, name, x.size(), chain.size()));
  for (const double one : x) require(std::isfinite(one), of, name, one, "(-inf, inf)");
}

/// Throws std::invalid_argument for a joint that the chain does not have, or one that is named twice.
inline void require_distinct(const Chain& chain, const char* of, const std::vector<int>& joints) {
  std::set<int> seen;
  for (const int joint : joints) {
    if (joint < 0 || joint >= chain.size())
      throw std::invalid_argument(fmt::format("{}: joint {} is not in [0, {}]", of, joint, chain.size() - 1));
    if (!seen.insert(joint).second)
      throw std::invalid_argument(fmt::format("{}: joint {} is named twice", of, joint));
  }
}

}  // namespace unhand::planners
