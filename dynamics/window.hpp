// A window of time inside which nothing jumps.
#pragma once

namespace unhand::dynamics {

/// Two neighbouring time events [s]. Whatever is evaluated for a step inside the window takes the branch that
/// holds there: at `begin` the limit from the right, at `end` the limit from the left.
struct Window {
  double begin{};  ///< s
  double end{};    ///< s, > begin
};

}  // namespace unhand::dynamics
