// Figures of one release: what the pads do while they open, and where the object goes.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/figure.hpp"
#include "contact/patch.hpp"
#include "flight/fly.hpp"
#include "release/simulate_release.hpp"

namespace unhand::apps {

/// One instant of a recorded release. The wrench is about the patch, on the object, in the world.
struct TraceRow {
  double time{};          ///< [s]
  double normal_force{};  ///< of one pad [N]
  double force{};         ///< |f|/f_max [-]
  double torque{};        ///< τ/τ_max [-]
  double slip{};          ///< |v_r| [m/s]
  double spin{};          ///< ω_r [rad/s]
  double pivot{};         ///< θ_O − θ_H since the start [rad]
};

/// A mode from one instant to the next.
struct ModeSpan {
  std::string mode;
  double begin{}, end{};  ///< [s]
};

/// A release as figures need it.
struct ReleaseTrace {
  std::string model, thrown;           ///< and the throw's id, for titles
  std::vector<TraceRow> rows;          ///< evenly spaced, from the start to the detach
  std::vector<ModeSpan> modes;         ///< without those shorter than a nanosecond
  std::optional<double> open_command;  ///< when the gripper is told to open: zero of the figures' time [s]
  std::vector<std::pair<double, double>> pressed;  ///< the normal force of a pad as measured: s, N
};

/// Of a result that was recorded (IntegratorOptions::record) and detached. `patch` gives the limits f_max and
/// τ_max. Throws std::invalid_argument for any other result.
ReleaseTrace trace_of(const release::ReleaseProblem<double>& problem,
                      const release::ReleaseResult<double>& result, const contact::Patch<double>& patch,
                      int samples = 800);

/// Normal force of the first trace with what was measured of it, and the modes of each as a ribbon below it.
Figure mode_figure(const std::vector<ReleaseTrace>& traces);

/// The wrench in the plane of |f|/f_max and |τ|/τ_max, with the ellipse, the exact disc and the separate
/// limits of the sliding pivot: sticking inside, slipping on the law's own curve.
Figure wrench_figure(const std::vector<ReleaseTrace>& traces);

/// The object turning in the hand: its angle and its spin against the hand over time.
Figure pivot_figure(const std::vector<ReleaseTrace>& traces);

/// Slip speed of the patch against relative spin, with L = c a as the measure between them: how each
/// release comes to its end.
Figure phase_figure(const std::vector<ReleaseTrace>& traces, double length);

/// A flight and what a tracker saw of it: paths in the plane, and the residual over time.
struct FlightOverlay {
  std::string model, thrown;                                ///< and the throw's id
  std::vector<double> time;                                 ///< since the predicted detach [s]
  std::vector<dynamics::Pose<double>> predicted, measured;  ///< m, m, rad
};
Figure flight_figure(const FlightOverlay& overlay);

}  // namespace unhand::apps
