#include "fitting/discovery/footprint_traces.hpp"

#include <Eigen/Core>

#include "dynamics/parallel.hpp"
#include "fitting/discovery/footprint_columns.hpp"

namespace unhand::fitting {

std::vector<FootprintTrace> footprint_traces(const CampaignProblem& problem, const FitResult& fit,
                                             const std::vector<std::string>& ids, const FitOptions& options) {
  FootprintColumns columns(problem, fit);
  columns.weigh_as_fitted(options.sample_limit);
  std::vector<std::string> effects;
  for (const auto& id : ids)
    if (!is_law(id)) effects.push_back(id);
  columns.add_effects(effects);
  for (const auto& id : ids)
    if (is_law(id)) columns.add_law(id.substr(kLaw.size()));
  const Footprints f = footprints(columns, problem, fit, options.threads);
  const auto all = scores(f);

  std::vector<FootprintTrace> out;
  Eigen::MatrixXd coefficients(columns.width(), 0);
  for (const auto& id : ids) {
    const Score* best = nullptr;  // of the values of its shape parameters
    for (const Score& score : all)
      if (f.candidates[score.candidate].id == id && score.gain > (best ? best->gain : 0)) best = &score;
    if (!best) continue;
    out.push_back({id, {}});
    coefficients.conservativeResize(Eigen::NoChange, coefficients.cols() + 1);
    coefficients.rightCols(1) = left_of(f, *best);
  }
  const auto& throws = problem.throws();
  std::vector<Eigen::MatrixXd> samples(throws.size());
  dynamics::parallel_for(throws.size(), options.threads, [&](std::size_t i) {
    if (fit.throws[i].used && !out.empty())
      samples[i] = columns.combined(throws[i], fit.throws[i].own, coefficients);
  });
  for (std::size_t k = 0; k < out.size(); ++k) {
    std::vector<Eigen::VectorXd> one(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i)
      if (samples[i].size() > 0) one[i] = samples[i].col(static_cast<Eigen::Index>(k));
    out[k].bins = residual_over_time(problem, fit, one);
  }
  return out;
}

}  // namespace unhand::fitting
