// Finer meshes until the integrator confirms a planned throw.
#pragma once

#include "planners/elastic/replay.hpp"

namespace unhand::planners::elastic {

/// When a plan counts as confirmed, and how far to go for it.
struct Refinement {
  double speed_error{5e-3};  ///< of the tip at the release, plan against run, share of the run's [-]
  double miss{5e-3};         ///< largest of the run at the task's target, if it has one [m]
  double limit_use{1.0};     ///< largest share of any limit that the run may use [-]
  int finest{64};            ///< intervals per phase, as in ThrowProgramOptions: no mesh finer than this
};

/// A plan and what the integrator makes of it.
struct ConfirmedThrow {
  ElasticThrow plan;       ///< on the mesh reached
  Replay run;              ///< its dense run
  int intervals{};         ///< of that mesh
  bool confirmed{};        ///< run and plan agree, and no limit is exceeded
  double longest_solve{};  ///< CPU time of the longest solve on the way, the first not counted [s]
};

/// Whether the run of a plan came to its end without the spring's stop, at the plan's speed, on the task's
/// target, and within the limits.
bool confirms(const ThrowTask& task, const ElasticThrow& plan, const Replay& run,
              const Refinement& refinement = {});

/// The same motion on twice the intervals: states by Hermite's cubics between the points, torques and
/// accelerations on straight lines.
ElasticThrow on_finer_mesh(const ElasticThrow& plan);

/// Halves the intervals of a solved plan, each time solving again from there, until the run confirms it or
/// the finest mesh is reached; a mesh on which the solver fails ends it, too. `options.near` is not used.
ConfirmedThrow confirm(const ClutchedArm& arm, const ThrowTask& task, ElasticThrow plan,
                       ThrowProgramOptions options, const Refinement& refinement = {});

}  // namespace unhand::planners::elastic
