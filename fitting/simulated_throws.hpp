// The throws of a fit, simulated at a point of its unknowns. Internal to fitting.
#pragma once

#include <vector>

#include "fitting/fit_state.hpp"

namespace unhand::fitting {

/// Keeps what the last two points gave. Ceres asks for a point up to three times (line search, candidate,
/// Jacobian) and ends at the one before the last; the next round begins there. Simulations are what a fit's
/// time is spent on.
class SimulatedThrows {
 public:
  SimulatedThrows(Shared& shared, const std::vector<std::size_t>& used) : shared_(shared), used_(used) {}

  /// One per throw used, not weighted; not solved where the point is outside the physics. `campaign` and
  /// `own` (throw by throw) in units of their scales. Valid until the next call.
  const std::vector<Linearisation>& at(const std::vector<double>& campaign, const std::vector<double>& own,
                                       bool derivatives);

 private:
  Shared& shared_;
  const std::vector<std::size_t>& used_;
  struct Point {
    std::vector<double> campaign, own;
    bool derivatives{};
    std::vector<Linearisation> throws;
  };
  Point last_, before_;
};

}  // namespace unhand::fitting
