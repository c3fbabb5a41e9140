// Footprints as one sees them: over the time of the throw, beside the residual.
#pragma once

#include <string>
#include <vector>

#include "fitting/discovery/residuals.hpp"

namespace unhand::fitting {

/// What a candidate does to the samples, at the size that takes most off χ² (to first order), where all that
/// is fitted anyway has made up for what it can.
struct FootprintTrace {
  std::string id;                 ///< of the effect, or "contact.law:MODEL"
  std::vector<ResidualBin> bins;  ///< as residual_over_time has them
};

/// At a fit of `problem` with `options`, every sample weighing as it did there, of those of `ids` that the
/// problem does not have and that some channel shows; in their order.
std::vector<FootprintTrace> footprint_traces(const CampaignProblem& problem, const FitResult& fit,
                                             const std::vector<std::string>& ids, const FitOptions& options);

}  // namespace unhand::fitting
