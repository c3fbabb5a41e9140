// Throws of a clutched arm as multi-phase optimal control, [DarkoD46] Eq. 38.
//
// The sequence of clutch modes is given, the phases' durations are free (0.03 s at least). Direct collocation
// after Hermite and Simpson [HargravesParis1987] on accelerations: q, q̇ and q̈ of the links and of the motor
// are the unknowns at nodes and middles, so that defects are bilinear in them and the step, and the equations
// of motion are one constraint per point.
#pragma once

#include <optional>
#include <vector>

#include "planners/elastic/clutched_arm.hpp"
#include "planners/elastic/nonlinear_program.hpp"
#include "planners/elastic/throw_terms.hpp"

namespace unhand::planners::elastic {

/// How the last joint is driven.
enum class Drive {
  clutched,  ///< BRK, then SEA: the spring is loaded while the other joints move, then let go
  series,    ///< SEA throughout, from rest
  rigid,     ///< motor and link locked
  passive,   ///< a spring with a fixed equilibrium angle, chosen once: the elastic wrist of [DarkoD46] 3.2
  locked,    ///< the last joint held at an angle, chosen once: a rigid wrist
};
/// The drive's name, as it is written above.
const char* to_string(Drive);

/// What throw is asked for.
struct ThrowTask {
  Drive drive{Drive::clutched};  ///< how the last joint is driven
  std::optional<Target> target;  ///< none: the tip's speed is maximised; else the smoothest throw to it is
                                 ///< sought, of the least mean square over time of the accelerations of
                                 ///< links and motor
  std::optional<Links<double>> start;  ///< pose at the start [rad]; none: free. The arm starts at rest, its
                                       ///< spring unloaded (clutched) or in equilibrium (series)
  double longest{1.0};                 ///< [s], of the whole motion, 0.1 to 10
  std::optional<double> let_go{};  ///< when the clutched drive lets its spring go [s], in (0, longest); none:
                                   ///< free
  double margin{0.04};  ///< share of every limit that the collocation points keep free, in [0, 0.5): between
                        ///< them the solution may overshoot a little
  double elevation{0.7853981633974483};  ///< of the tip's velocity at the release when no target says it
                                         ///< [rad], in (−π/2, π/2)
  double gravity{9.81};                  ///< of the flight [m/s²]
};

struct ElasticThrow;

/// How the program is made and solved.
struct ThrowProgramOptions {
  int intervals{16};  ///< per phase of the clutched drive; one phase of twice as many for the others. >= 2
  unsigned seed{1};   ///< of the random start
  const ElasticThrow* near{};  ///< start from this solution of a neighbouring task instead
  ProgramOptions program;      ///< tolerance and budgets
};

/// One collocation point.
struct ThrowPoint {
  double t{};                                  ///< s
  Coordinates<double> at, rate, acceleration;  ///< ξ, ξ̇, ξ̈ [rad, rad/s, rad/s²]
  MotorTorques<double> torque;                 ///< N m
};

/// One phase: 2 n + 1 points, nodes and middles in turn.
struct ThrowPhase {
  ClutchMode mode{};               ///< clutches that are engaged
  std::vector<ThrowPoint> points;  ///< in order of time
};

/// A planned throw.
struct ElasticThrow {
  ProgramSummary program;          ///< how the solver ended
  std::vector<ThrowPhase> phases;  ///< in order of time
  TipState<double> release;        ///< the tip at the end

  /// Whether the solver found a local minimum.
  bool solved() const { return program.outcome == ProgramOutcome::solved; }
  /// Of the tip at the release [m/s].
  double speed() const { return std::hypot(release.vx, release.vz); }
  /// From rest to the release [s]; 0 without phases.
  double duration() const { return phases.empty() ? 0 : phases.back().points.back().t; }
};

/// Throws std::invalid_argument naming the option if the task makes no sense.
ElasticThrow plan_throw(const ClutchedArm& arm, const ThrowTask& task,
                        const ThrowProgramOptions& options = {});

}  // namespace unhand::planners::elastic
