// The opening of a gripper in a measured series of its normal force, f_k [N] at t_k [s]: a ramp found by
// least squares.
//
//   f(t) = grip + slope (t − start)                              until the start
//   f(t) = tail + (grip − tail) u^shape exp(Σ_j bend_j (1 − u)^j),  u = (release − t)/(release − start)
//   f(t) = tail                                                  from the release on
//
//   least Σ_k w_k ((f(t_k) − f_k)/σ)² + Σ_j (bend_j/4)²          by Levenberg and Marquardt's method
//
// Without bends it is the profile of ProfileNormalForce. As many bends are taken as the series tells: the
// first if its fall of χ² exceeds ln n + 7 (n samples of independent noise), each further one for 3. The form
// is this library's own: no gripper is known to open by it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "contact/normal_force.hpp"

namespace unhand::contact {

/// A measured normal force [N] at `time` [s], with its noise, 1 σ [N].
struct ForceSeries {
  std::span<const double> time, value;
  double sigma{};
  std::size_t size() const { return time.size(); }
};

/// The force of an opening gripper [N] by time [s], f above; j = 1, 2, ... Without bends a power; with them
/// whatever ends as one.
struct Ramp {
  static constexpr int kBends = 6;
  double grip{}, slope{}, tail{}, start{}, release{}, shape{1.0};
  std::array<double, kBends> bend{};

  double u(double t) const { return std::clamp((release - t) / (release - start), 0.0, 1.0); }
  /// Σ bend_j s^j [-].
  double bent(double s) const {
    double sum = 0.0;
    for (int j = kBends; j-- > 0;) sum = (sum + bend[j]) * s;
    return sum;
  }
  double at(double t) const {
    if (t <= start) return grip + slope * (t - start);
    const double v = u(t);
    return tail + (grip - tail) * std::pow(v, shape) * std::exp(bent(1.0 - v));
  }
};

/// Weights of the samples [from, to), by sample [-], for their residuals e [σ]: (3.5/e)² of isolated
/// outliers, beyond ±3.5 with at most one neighbour that is so on the same side; else 1. A ramp of another
/// form leaves long stretches on one side, and they keep their weight.
std::vector<double> outlier_weights(const std::vector<double>& e, std::size_t from, std::size_t to);

/// Σ w ((ramp − sample)/σ)² of the samples [from, to).
double chi2(const ForceSeries&, const Ramp&, std::size_t from, std::size_t to,
            const std::vector<double>& weight);

/// The mean time between two samples [s].
double tick_of(const ForceSeries&);

/// The first sample at or after t [s].
std::size_t index_of(const ForceSeries&, double t);

/// The last descent of the series from a plateau to the tail: a first guess, and where its plateau begins.
/// Sought in running medians of five samples, which spikes do not move.
struct Descent {
  Ramp ramp;
  std::size_t plateau{};
  double height{};
};
std::optional<Descent> last_descent(const ForceSeries&, double tail, double peak);

/// By how much more than the tail a sample has to be to be none of it [N].
double above_tail(const ForceSeries&, double tail, double peak);

/// Where the series rises once more, by less than a quarter of `peak`, after it has been at `tail` for three
/// samples or more: the first sample of the first such rise after the last descent from higher up. The number
/// of samples where there is none. Sought in running medians of three.
std::size_t later_rise(const ForceSeries&, double tail, double peak);

/// The opening as measured: start, release and shape of its ramp, and which of its parts are what the model
/// says. The release's variance [s²] is that of least squares with outliers weighted, times the number of
/// samples over which their noise stays (1 + 2 Σ ρ_k of the residuals), half as much again where the samples
/// say how many bends the ramp has, and the mean over the forms with more bends, each by its evidence. Where
/// the ramp is none of these, times the χ² per sample of the fit to its end, with the square of what a
/// narrower neighbourhood moves it by, and never below that of an unknown place between two samples.
struct Opening {
  Ramp ramp;
  double release_variance{};         ///< > 0 [s²]
  bool straight_grip{}, modelled{};  ///< to within the noise
};
Opening find_opening(const ForceSeries&, const Descent& guess);

}  // namespace unhand::contact
