// The normal force of one pad while the gripper opens: a profile, or a measured series smoothed with its
// noise known.
#pragma once

#include <limits>
#include <span>
#include <vector>

#include "dynamics/piecewise_polynomial.hpp"
#include "dynamics/scalar.hpp"
#include "dynamics/window.hpp"

namespace unhand::contact {

using dynamics::Dual;
using dynamics::Window;

/// How far the last kink of a force may be from its release [s]: two sums of the same times differ by
/// rounding.
inline constexpr double kSameInstant = 1e-9;

/// f_N(t) of one pad [N], >= 0, and the instants at which it kinks. Its functions are const and may be called
/// by several threads at once.
class NormalForce {
 public:
  virtual ~NormalForce() = default;
  /// f_N [N] at t [s]; the branch at a kink is the window's. Steppers look beyond its ends, too: the branch
  /// goes on there (below zero counts as zero past the end).
  virtual double at(const Window&, double t) const = 0;
  virtual Dual at(const Window&, const Dual& t) const = 0;
  /// Appends the instants [s], increasing, at which f_N or its slope jumps; the last is the release, if there
  /// is one. As Dual they carry the derivatives with respect to the parameters of the force; those of the
  /// release are those of the detach.
  virtual void kinks(std::vector<double>& out) const = 0;
  virtual void kinks(std::vector<Dual>& out) const = 0;
  /// The instants alone [s].
  std::vector<double> kinks() const {
    std::vector<double> out;
    kinks(out);
    return out;
  }
  /// The instant at which the pads count as parted [s]; +infinity when they never part. f_N is zero from
  /// there on, which simulations check, and may be before. The last kink must be within kSameInstant of it,
  /// or the detach has no derivatives.
  virtual double release_time() const = 0;
};

/// Parameters of the opening profile; S is double, or Dual to differentiate with respect to them.
template <class S>
struct OpeningProfile {
  double open_command{};  ///< t_open, when the gripper is told to open [s]
  S grip_force{};         ///< f₀ > 0 [N]
  S dead_time{0.0};       ///< δ >= 0, from the command to the first change of the force [s]
  S opening_time{0.05};   ///< T > 0, from the first change to zero [s]
  S shape{1.0};           ///< p > 0; 1 is a linear ramp [-]
};

/// The normal force of an OpeningProfile:
///
///   s = (t − t_open − δ)/T;  f_N = f₀ for s <= 0,  f₀ (1 − s)^p for 0 < s < 1,  0 for s >= 1.
///
/// The branch is that of the window: inside a window that ends at a kink the limit from the left holds. For p
/// < 1 the slope is unbounded at s → 1: the value is exact up to the end, derivatives are taken no nearer to
/// it than 1 − s = 1e-9.
class ProfileNormalForce final : public NormalForce {
 public:
  /// Throws std::invalid_argument, naming parameter, value and range.
  explicit ProfileNormalForce(const OpeningProfile<Dual>& profile);
  explicit ProfileNormalForce(const OpeningProfile<double>& profile);

  double at(const Window& window, double t) const override;
  Dual at(const Window& window, const Dual& t) const override;
  /// The instants alone [s].
  using NormalForce::kinks;
  void kinks(std::vector<double>& out) const override;
  void kinks(std::vector<Dual>& out) const override;
  double release_time() const override;
  /// The profile, with its derivatives.
  const OpeningProfile<Dual>& profile() const { return profile_; }

 private:
  OpeningProfile<Dual> profile_;
  OpeningProfile<double> values_;
};

/// A smoothed measured series: polynomial pieces, >= 0 everywhere, exactly 0 from the release on.
class SampledNormalForce final : public NormalForce {
 public:
  using Polynomial = dynamics::PiecewisePolynomial<1, 5>;  ///< N over s

  /// `kinks` [s], increasing: the breaks of `force` [N] at which the force or its slope jumps. `release` [s]
  /// is the last of them, or +infinity. Values below zero are cut off at zero. Throws std::invalid_argument
  /// for kinks that do not increase, another last kink, and coefficients that are not finite.
  SampledNormalForce(Polynomial force, std::vector<double> kinks, double release);

  double at(const Window& window, double t) const override {
    const double f = force_.value(window, t)[0];
    return f < 0.0 ? 0.0 : f;
  }
  Dual at(const Window& window, const Dual& t) const override {
    const Dual f = force_.value(window, t)[0];
    return f.a < 0.0 ? Dual(0.0) : f;
  }
  /// The instants alone [s].
  using NormalForce::kinks;
  void kinks(std::vector<double>& out) const override;
  void kinks(std::vector<Dual>& out) const override;
  double release_time() const override { return release_; }

 private:
  Polynomial force_;
  std::vector<double> kinks_;
  double release_;
};

/// What a measured force may be.
struct NormalForceOptions {
  /// The largest plateau after the opening that still counts as the sensor's zero, as a fraction of the grip
  /// force (or five σ, if that is more). A larger one means that the pad still presses, and there is no
  /// release.
  double max_tail_bias = 0.05;
};

/// What the smoothing found.
struct NormalForceSummary {
  double sigma{};         ///< noise used: the declared one, or that of the scatter if it is larger [N]
  double chi2_per_dof{};  ///< of the smoothed force, and of the tail's level, against the whole series
  bool power_law{};       ///< the ramp is (1 − s)^p to within the noise
  double grip_force{};    ///< at the start of the opening [N]
  double opening_start{
      std::numeric_limits<double>::quiet_NaN()};                ///< first change of the force [s]; NaN: none
  double ramp_start{std::numeric_limits<double>::quiet_NaN()};  ///< the same, or the first sample where the
                                                                ///< force falls from there on [s]
  double shape{
      std::numeric_limits<double>::quiet_NaN()};  ///< exponent p (of the ramp's end) [-]; NaN: no ramp
  double release_time{std::numeric_limits<double>::infinity()};  ///< [s]
  /// 1 σ of it, > 0 and at most half the ramp [s]; NaN: no release, or none that was seen (a series that is
  /// zero from its first sample)
  double release_sigma{std::numeric_limits<double>::quiet_NaN()};
  double tail_mean{};   ///< mean of the series after the release [N]: the sensor's bias, if it has one;
                        ///< without a later rise
  double later_rise{};  ///< where the force rises again after its release: by how much at most [N]; else 0
  double tail_mean_sigma{
      std::numeric_limits<double>::infinity()};  ///< 1 σ of it [N]; infinite without samples there
};

/// The share of the sensor's bias (tail_mean) that the smoothing takes off at time t [s]: 0 while the grip
/// holds, 1 from the release on, in proportion to time between.
double bias_share(const NormalForceSummary& summary, double t);

/// A smoothed normal force and how it was found.
struct NormalForceFit {
  SampledNormalForce force;    ///< from the first sample on; constant before it
  NormalForceSummary summary;  ///< release, level, and how well the curve explains the series
};

/// Smooths a measured normal force [N] at `time` [s]; `sigma` is its declared noise [N] (0 or NaN: none). The
/// noise used is the larger of it and of the scatter of the series' fourth differences (what is slower does
/// not show there, so that a larger declaration is kept).
///
/// The last opening of the series is taken as a straight grip, a ramp A (1 − s)^p that starts with a kink,
/// and a level tail. Start, end, p and levels are found together by least squares, so the release is known to
/// well below a sample. A ramp that is no power (a cosine's half, say, whose end is flatter than the power
/// that fits the whole of it) would put the release early or late. So powers with bends are asked, too,
///
///   A (1 − s)^p exp(b₁ s + b₂ s² + ...),
///
/// which end as a power, whatever they are before; the samples say how many bends there are (the first must
/// convince by BIC), and forms with more of them count for σ of the release by what evidence leaves them.
/// Where the residual is noise, that curve is the smoothed force (in pieces of degree five); otherwise start
/// and end are found again from their neighbourhoods, and a smoothing spline with a kink at the start follows
/// the samples. Then the release is uncertain by what the width of its neighbourhood makes of it, too, and
/// always by where it is between two samples; by one whole step where the ramp has fewer than four. Outliers
/// that stand alone, or in pairs, count as little as they go beyond 3.5 σ. The last bit before the release
/// (below the noise, or 1 % of the grip) falls monotonically to zero. What the few samples of a slow or noisy
/// sensor cannot tell from a power is taken for one, and σ does not know of it. Of a ramp that ends steeply
/// (p < 1) σ is too small, the more so the fewer samples the ramp has.
///
/// A force that rises again by less than a quarter of its grip, once it has been at its tail's level for
/// three samples: a sensor that rings, or pads that touch once more. The release is before it, `later_rise`
/// tells it, and `chi2_per_dof` shows it. Pads that press again by more grip once more, and the release is
/// after that.
///
/// A curve that leaves the samples by a fifth of the largest (through spikes, or rubbish) is replaced by
/// straight lines between them.
///
/// **A sensor bias** shows as a tail that is not zero. The release is where the ramp meets the tail's
/// plateau, whatever its level; `tail_mean` reports that level. The grip is not shifted by it; over the ramp
/// it is faded out linearly, so that the force ends at zero where the pads part.
///
/// The release is +infinity, and a spline follows all samples, where the series ends before its plateau
/// (three samples) or the plateau is no zero (`max_tail_bias`). Before the first sample the force is
/// constant.
///
/// Throws std::invalid_argument for fewer than four samples, sizes that differ, times that do not increase,
/// or a value that is not finite.
NormalForceFit smooth_normal_force(std::span<const double> time, std::span<const double> value, double sigma,
                                   const NormalForceOptions& options = {});

}  // namespace unhand::contact
