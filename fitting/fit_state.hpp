// What the parts of a fit share. Internal to fitting.
#pragma once

#include <atomic>
#include <vector>

#include "fitting/clock.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

/// What all costs share: unknowns in units of their scales.
struct Shared {
  const CampaignProblem& problem;
  const FitOptions& options;
  std::vector<double> scale, own_scale, own_sigma;  ///< own_sigma: 1 σ of the throws' own unknowns
  Weighting weighting;
  std::atomic<long> jacobian_nanoseconds{0};

  std::vector<double> unscaled(const double* x) const {
    std::vector<double> out(scale.size());
    for (std::size_t k = 0; k < out.size(); ++k) out[k] = x[k] * scale[k];
    return out;
  }
  std::vector<double> own_unscaled(const double* x) const {
    std::vector<double> out(own_scale.size());
    for (std::size_t k = 0; k < out.size(); ++k) out[k] = x[k] * own_scale[k];
    return out;
  }
};

}  // namespace unhand::fitting
