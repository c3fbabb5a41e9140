// How the hand moves: pose, twist and acceleration of the frame midway between the pads, as functions of time
// that are derivatives of each other.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "dynamics/frames.hpp"
#include "dynamics/piecewise_polynomial.hpp"
#include "dynamics/scalar.hpp"
#include "dynamics/window.hpp"

namespace unhand::release {

using dynamics::Dual;
using dynamics::Window;

/// The hand at an instant, in the world.
template <class S>
struct HandState {
  dynamics::Pose<S> pose;                  ///< m, m, rad
  dynamics::Twist<S> twist;                ///< m/s, m/s, rad/s
  dynamics::Acceleration<S> acceleration;  ///< m/s², m/s², rad/s²
};

/// Pose, twist and acceleration of the hand over time. Its functions are const and may be called by several
/// threads at once.
class HandMotion {
 public:
  virtual ~HandMotion() = default;
  /// The hand at t [s]; where the acceleration jumps, the window says which side. Steppers look beyond its
  /// ends, too: that side goes on there.
  virtual HandState<double> at(const Window&, double t) const = 0;
  virtual HandState<Dual> at(const Window&, const Dual& t) const = 0;
  /// Instants [s], increasing, strictly inside (begin, end), at which the acceleration jumps.
  virtual std::vector<double> jumps() const = 0;
  /// First instant [s] at which the motion is known.
  virtual double begin() const = 0;
  /// Last instant [s] at which the motion is known.
  virtual double end() const = 0;
};

/// A stretch of motion with a linear acceleration profile, a(t) = acceleration + jerk (t − t_start), until
/// t_end [s].
struct HandSegment {
  double t_end{};                               ///< s
  dynamics::Acceleration<double> acceleration;  ///< at the start of the stretch; m/s², m/s², rad/s²
  dynamics::Acceleration<double> jerk{};        ///< m/s³, m/s³, rad/s³
};

/// A hand that follows piecewise polynomials of degree five (channels x, z, θ in the world): twist and
/// acceleration are their exact derivatives, pose and twist are continuous to rounding, and the acceleration
/// jumps at `jumps()` only.
class PolynomialHand final : public HandMotion {
 public:
  using Polynomial = dynamics::PiecewisePolynomial<3, 5>;  ///< m, m, rad over s

  /// `jumps` [s]: the breaks at which the acceleration is not continuous. Each must be an interior break of
  /// `path`; otherwise std::invalid_argument, as for a path that is not finite or whose pose or twist jumps
  /// at a break (by more than 1e-9 m, rad or per s, and 1e-7 of the terms that make it).
  explicit PolynomialHand(Polynomial path, std::vector<double> jumps = {});

  /// Joins stretches of linear acceleration, starting at t_start [s] from the given pose and twist. Every
  /// inner end of a stretch counts as a jump. Throws std::invalid_argument unless there is a stretch, the
  /// ends increase and all is finite, the motion that they make too.
  static PolynomialHand segments(double t_start, const dynamics::Pose<double>& pose,
                                 const dynamics::Twist<double>& twist,
                                 const std::vector<HandSegment>& stretches);

  HandState<double> at(const Window& window, double t) const override { return at_(window, t); }
  HandState<Dual> at(const Window& window, const Dual& t) const override { return at_(window, t); }
  std::vector<double> jumps() const override { return jumps_; }
  double begin() const override { return path_.begin(); }
  double end() const override { return path_.end(); }
  /// The polynomials of (x, z, θ).
  const Polynomial& path() const { return path_; }

 private:
  template <class S>
  HandState<S> at_(const Window& window, const S& t) const {
    const auto j = path_.at(window, t);
    return {{j.value[0], j.value[1], j.value[2]},
            {j.first[0], j.first[1], j.first[2]},
            {j.second[0], j.second[1], j.second[2]}};
  }

  Polynomial path_;
  std::vector<double> jumps_;
};

/// The hand as a robot controller logs it, N samples; rows [x, z, θ], [vx, vz, ω], [ax, az, α] in the world.
struct HandSeries {
  std::span<const double> time;          ///< s, strictly increasing
  std::span<const double> pose;          ///< N × 3, m, m, rad
  std::span<const double> twist;         ///< N × 3, m/s, m/s, rad/s
  std::span<const double> acceleration;  ///< N × 3, m/s², m/s², rad/s²
  /// Declared noise, 1 σ, per column in the units of the column; 0, NaN or infinite where none is declared.
  std::array<double, 3> pose_sigma{}, twist_sigma{}, acceleration_sigma{};  ///< m, m, rad; per s; per s²
};

/// How well the smoothed motion explains each logged series, in units of the σ used for it.
struct HandFitSummary {
  /// Mean square of the whitened residual, per column: 1 is noise as declared, less is a pessimistic σ, more
  /// means that the series is not what its siblings say (a pose that is not the integral of the twist, say),
  /// or that the knots were not allowed to be dense enough. Never an error.
  std::array<double, 3> pose_chi2{}, twist_chi2{}, acceleration_chi2{};     ///< columns x, z, θ [-]
  std::array<double, 3> pose_sigma{}, twist_sigma{}, acceleration_sigma{};  ///< the σ used
  double chi2_per_dof{};                                                    ///< of everything together
  bool twist_differenced{};         ///< it is the pose's difference quotient, and took no part: chi2 is 0
  bool acceleration_differenced{};  ///< likewise of the twist
  bool noise_reached{};             ///< no stretch has a misfit beyond doubt (4.5 standard deviations)
};

/// A smooth hand motion and how it was found.
struct HandFit {
  PolynomialHand motion;   ///< begins and ends with the log; its acceleration may jump at jumps()
  HandFitSummary summary;  ///< how well it explains each series
};

/// The smooth motion that explains a log: a spline of degree five, four times continuously differentiable
/// between the jumps of the acceleration and once at them, least squares to **all three** series at once,
/// each weighted by its declared σ. Which of them decides follows from the σ: with σ_x of the pose, σ_v and
/// σ_a over a stretch of length τ the acceleration comes from the acceleration series while σ_a < σ_v/τ and
/// σ_a < σ_x/τ², and so on: in a throw (τ of some tens of milliseconds) usually pose from pose, acceleration
/// from acceleration, and the twist from both its neighbours.
///
/// A noisy series that is the difference quotient of the one before it (central, forward or backward, to a
/// millionth) is left out: it has that one's noise again, which three series that agree would pass for
/// motion.
///
/// A σ that is not declared is estimated from the series' own high-frequency scatter; where a column shows
/// none (an analytic log), it is 1e-6 m, m/s, m/s² (or rad).
///
/// `jumps` [s]: where the acceleration is known to jump (a declaration; values outside the log are ignored).
/// If it is empty, they are detected, at most eight: between two samples, the one-sided extrapolations of the
/// acceleration from left and right must differ by more than 8 σ of that difference and by more than
/// curvature explains. A jump between samples k − 1 and k is put at t_k, as the log holds the later value
/// there, unless the twists tell that it was earlier: a jump by Δa at t_k − s leaves them ahead by Δa s.
///
/// Throws std::invalid_argument for fewer than four samples, shapes that do not match, times that do not
/// increase, or a value that is not finite.
HandFit fit_hand_motion(const HandSeries& series, std::span<const double> jumps = {});

}  // namespace unhand::release
