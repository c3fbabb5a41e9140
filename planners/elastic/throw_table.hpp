// Many throws at once: the basins of one task, and a table of solutions over targets that a choice online
// interpolates.
#pragma once

#include <vector>

#include "planners/elastic/replay.hpp"

namespace unhand::planners::elastic {

/// Solutions of one task from random starts whose objectives agree within 1 %.
struct Basin {
  ElasticThrow best;  ///< of its solutions
  int starts{};       ///< that ended here
};
/// The local minima that random starts lead to.
struct Basins {
  std::vector<Basin> found;  ///< best first
  int failed{};              ///< starts that ended nowhere
  double longest{};          ///< CPU time of the longest solve [s]
};
/// Solves from `starts` random starts.
Basins find_basins(const ClutchedArm& arm, const ThrowTask& task, const ThrowProgramOptions& options,
                   int starts);

/// Throws to targets at one height, by increasing distance.
struct ThrowTable {
  double height{};                   ///< z of all targets [m]
  std::vector<double> distances;     ///< of the targets, increasing [m]
  std::vector<ElasticThrow> throws;  ///< one per distance
};

/// Solves the task for each distance [m], increasing, at least four: the middle one from `starts` random
/// starts (the best basin is taken), the others from their neighbour's solution, so that the table is of one
/// family. Throws std::runtime_error naming the distance where there is none.
ThrowTable make_table(const ClutchedArm& arm, ThrowTask task, const std::vector<double>& distances,
                      const ThrowProgramOptions& options, int starts = 6);

/// The throw to a target between nodes: durations, motor torques, states and the release through the four
/// nearest nodes by Lagrange's cubic. Throws std::invalid_argument outside the table, and for one that has
/// not a throw for each distance.
ElasticThrow interpolate(const ThrowTable& table, double distance);

/// One target of a dense check: the interpolated throw run by the integrator.
struct TableCheck {
  double distance{};   ///< of the target [m]
  double miss{};       ///< landing − target [m]
  double limit_use{};  ///< largest share of any limit; <= 1: none is exceeded
  bool lands{};        ///< the run came to its end and the object comes down to the height
};
/// At `count` distances spread evenly over the table.
std::vector<TableCheck> check_table(const ClutchedArm& arm, const ThrowTable& table, int count,
                                    double gravity = 9.81);

}  // namespace unhand::planners::elastic
