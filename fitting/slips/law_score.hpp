// A law of limit surfaces beside the base: what it gains on held-out slips, and what it leaves. Internal to
// fitting.
#pragma once

#include <algorithm>
#include <cmath>

#include "fitting/slips/surface_discovery.hpp"

namespace unhand::fitting {

/// A mean over observations that know nothing of each other.
struct Paired {
  double n{}, sum{}, squares{};
  void add(double x) { n += 1, sum += x, squares += x * x; }
  void add(const Paired& other) { n += other.n, sum += other.sum, squares += other.squares; }
  double mean() const { return n > 0 ? sum / n : 0; }
  double error() const {
    return n > 1 ? std::sqrt(std::max(0.0, squares - n * mean() * mean()) / (n - 1) / n) : 0;
  }
  double t() const { return error() > 0 ? mean() / error() : 0; }
  /// One-sided: the mean is above zero.
  double p() const;
  /// As Bayes' criterion would be of one parameter more. Of a gain that is held out, so that richer laws have
  /// no head start.
  double delta_bic() const { return std::log(std::max(2.0, n)) - t() * std::abs(t()); }
};

/// A law beside the base, over the surfaces on which both were scored.
struct LawScore {
  SurfaceModel model{};
  Paired gain;  ///< by slip: how much less the law errs [deg]
  Paired left;  ///< correlation of residuals where wrenches of different slips are alike, over pairs of slips
  int better{}, compared{};
  // Means over the surfaces: held-out errors, the law's own in sample and in level, what the null control
  // gains.
  double error{}, base_error{}, train{}, level{}, null_gain{};

  /// Adds a surface; what it says by itself.
  SurfaceEvidence add(const SlipSamples& slips, const SurfaceScore& base, const SurfaceScore& score);
  /// Sums over surfaces become means.
  void average() {
    for (double* sum : {&error, &base_error, &train, &level, &null_gain}) *sum /= std::max(1, compared);
  }
  NamedErrors errors(double direction) const {
    return {{"direction_mae_deg", direction}, {"level_mae", level}};
  }
};

}  // namespace unhand::fitting
