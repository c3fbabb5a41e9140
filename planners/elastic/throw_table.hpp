// Many throws at once: the basins of one task, and a table of solutions over targets that a choice online
// interpolates.
#pragma once

#include <optional>
#include <stdexcept>
#include <vector>

#include "planners/elastic/throw_refinement.hpp"

namespace unhand::planners::elastic {

/// Solutions of one task from random starts whose objective is within 1 % of the best one's: −v² [m²/s²] of
/// the tip, or with a target the mean square of the accelerations. The best ones of two basins differ by
/// more.
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

/// A basin after its best throw was confirmed.
struct ConfirmedBasin {
  ConfirmedThrow best;  ///< a confirmed one, if there is any
  int starts{};         ///< that ended here
};
/// Those of one task.
struct ConfirmedBasins {
  std::vector<ConfirmedBasin> found;  ///< best objective first
  double longest{};  ///< CPU time of the longest solve, those of find_basins counted, too [s]
};
/// Confirms the best throw of each basin, `options` being those of find_basins, and joins basins again: finer
/// meshes move their objectives.
ConfirmedBasins confirm_basins(const ClutchedArm& arm, const ThrowTask& task, const Basins& basins,
                               const ThrowProgramOptions& options, const Refinement& refinement = {});

/// Throws to targets at one height, by increasing distance.
struct ThrowTable {
  double height{};                   ///< z of all targets [m]
  std::vector<double> distances;     ///< of the targets, increasing [m]
  std::vector<ElasticThrow> throws;  ///< one per distance
};

/// A target of a table to which no throw was found.
struct OutOfReach : std::runtime_error {
  /// Says so.
  OutOfReach(double x, double z);
  double distance{};  ///< of the target [m]
};

/// Solves the task for each distance [m], increasing, at least four: the middle one from `starts` random
/// starts (the best basin is taken), the others from their neighbour's solution and, with clutches, the
/// instant at which the middle one lets its spring go, so that the table is of one family: how smooth a throw
/// is hardly depends on that instant, which would jump from node to node. Throws OutOfReach for the first
/// distance where there is none.
ThrowTable make_table(const ClutchedArm& arm, ThrowTask task, const std::vector<double>& distances,
                      const ThrowProgramOptions& options, int starts = 6);

/// A node of a table and what the integrator makes of it.
struct TableNode {
  Replay run;                  ///< its dense run
  std::optional<double> miss;  ///< landing of the run − target [m]; none: it never comes down to the height
  bool confirmed{};            ///< see `confirms`
};
/// A table whose nodes were run.
struct ConfirmedTable {
  ThrowTable table;              ///< all throws on one mesh, as `interpolate` needs them
  std::vector<TableNode> nodes;  ///< one per distance
  int intervals{};               ///< of that mesh, as in ThrowProgramOptions
};
/// Runs every node, and while one is not confirmed solves all again on half the intervals, each from its own
/// solution, down to the finest mesh or one on which the solver fails. `task` and `options` as for
/// make_table.
ConfirmedTable confirm_table(const ClutchedArm& arm, ThrowTask task, ThrowTable table,
                             ThrowProgramOptions options, const Refinement& refinement = {});

/// Distances of targets at one height to which throws were found.
struct Reach {
  double nearest{}, farthest{};  ///< [m]
};
/// Looks for the nearest and the farthest target at the height of the task's, between 0.05 and 20 m: from
/// random starts for a first one, then outward, each from its neighbour's solution, in steps of 0.4 m and in
/// the end of 5 cm, with at most 150 iterations each. Other solutions may reach further. Empty: there is
/// none.
std::optional<Reach> find_reach(const ClutchedArm& arm, ThrowTask task, ThrowProgramOptions options,
                                int starts = 6);

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
