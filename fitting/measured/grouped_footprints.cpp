#include "fitting/measured/grouped_footprints.hpp"

#include <algorithm>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"
#include "fitting/measured/grouped_weights.hpp"
#include "fitting/scatter_covariance.hpp"

namespace unhand::fitting {

using dynamics::gram, dynamics::least_squares, dynamics::product, dynamics::pseudo_inverse;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Candidates with the values at which their footprints are taken; those of one call of equations().
struct Call {
  std::vector<std::string> names;
  std::vector<double> values;
  std::vector<std::size_t> columns;  ///< of the Gram matrix, one per name
};

}  // namespace

GroupedFootprints grouped_footprints(const GroupedProblem& problem, const GroupedFit& fit,
                                     const std::vector<dynamics::Effect>& effects,
                                     const GroupedFitOptions& options) {
  GroupedFootprints out;
  Footprints& f = out.total;
  f.fitted = fit.shared.size();
  std::size_t width = f.fitted;
  std::vector<Call> calls(1);
  calls[0].names = fit.names();
  calls[0].values.assign(fit.values.data(), fit.values.data() + fit.values.size());
  for (std::size_t k = 0; k < f.fitted; ++k) calls[0].columns.push_back(k);
  const auto objects = objects_of(problem);
  for (const auto& effect : effects) {
    const auto parameters = shared_parameters(effect, objects);
    std::vector<double> grid{0};
    const SharedParameter* shape = nullptr;
    for (const auto& p : parameters)
      if (p.shape) shape = &p;
    if (shape)
      for (const auto& p : effect.parameters)
        if (p.is_shape()) grid = p.grid;
    for (const double at : grid) {
      Candidate candidate{effect.id, {}, {}, {}, {}};
      Call own = calls[0];
      own.names.resize(f.fitted), own.values.resize(f.fitted), own.columns.resize(f.fitted);
      Call& call = shape ? own : calls[0];
      if (shape) {
        candidate.shape[shape->name] = at;
        call.names.push_back(shape->name), call.values.push_back(at), call.columns.push_back(SIZE_MAX);
      }
      for (const auto& p : parameters) {
        if (p.shape) continue;
        candidate.parameters.push_back(p.name);
        candidate.columns.push_back(width);
        candidate.sides.push_back(side_of(p.neutral, p.low, p.high));
        call.names.push_back(p.name), call.values.push_back(p.neutral), call.columns.push_back(width++);
      }
      f.candidates.push_back(std::move(candidate));
      if (shape) calls.push_back(std::move(own));
    }
  }
  const auto w = static_cast<Index>(width) + 1;
  const auto used = fit.solved_groups();
  out.parts.resize(used.size());
  dynamics::parallel_for(used.size(), options.threads, [&](std::size_t n) {
    const std::size_t i = used[n];
    MatrixXd columns = MatrixXd::Zero(static_cast<Index>(problem.groups()[i].rows.size()), w);
    bool solved = true;
    for (std::size_t c = 0; c < calls.size(); ++c) {
      const auto e = projected(problem, i, calls[c].names, calls[c].values, fit.groups[i].own, fit.weights,
                               options.sample_limit);
      solved = e.solved;
      if (!solved) break;
      if (c == 0) columns.col(w - 1) = e.columns.col(e.columns.cols() - 1);
      for (std::size_t k = c == 0 ? 0 : f.fitted; k < calls[c].columns.size(); ++k)
        if (calls[c].columns[k] != SIZE_MAX)
          columns.col(static_cast<Index>(calls[c].columns[k])) = e.columns.col(static_cast<Index>(k));
    }
    out.parts[n] = solved ? MatrixXd(fit.weights.group[i] * gram(columns)) : MatrixXd::Zero(w, w);
  });
  f.gram = MatrixXd::Zero(w, w);
  for (const auto& part : out.parts) f.gram += part;
  f.samples = static_cast<double>(fit.samples);
  return out;
}

std::vector<FootprintProfile> footprint_profiles(const GroupedProblem& problem, const GroupedFit& fit,
                                                 const std::vector<dynamics::Effect>& effects,
                                                 const GroupedFitOptions& options) {
  const Footprints f = grouped_footprints(problem, fit, effects, options).total;
  const auto all = scores(f);
  const auto objects = objects_of(problem);
  std::vector<FootprintProfile> out;
  for (const auto& effect : effects) {
    const Score* best = nullptr;  // of the values of its shape parameter
    for (const Score& score : all)
      if (f.candidates[score.candidate].id == effect.id && score.gain > (best ? best->gain : 0))
        best = &score;
    if (!best) continue;
    const Candidate& candidate = f.candidates[best->candidate];
    const VectorXd left = left_of(f, *best);
    Call call{fit.names(), {fit.values.data(), fit.values.data() + fit.values.size()}, {}};
    std::vector<double> change(left.data(), left.data() + f.fitted);
    std::size_t column = 0;
    for (const auto& p : shared_parameters(effect, objects)) {
      call.names.push_back(p.name);
      call.values.push_back(p.shape ? candidate.shape.at(p.name) : p.neutral);
      change.push_back(p.shape ? 0 : left[static_cast<Index>(candidate.columns[column++])]);
    }
    const Eigen::Map<const VectorXd> by(change.data(), static_cast<Index>(change.size()));
    GroupedFit shown = fit;
    dynamics::parallel_for(fit.groups.size(), options.threads, [&](std::size_t i) {
      GroupFit& group = shown.groups[i];
      if (!group.used || !group.solved) return;
      const auto e = problem.equations(i, call.names, call.values, group.own, Derivatives::all);
      group.solved = e.solved;
      if (!e.solved) return;
      auto weighed = e;
      weigh_rows(weighed, problem.groups()[i], fit.weights, options.sample_limit);
      const VectorXd own = least_squares(weighed.own, -product(weighed.shared, by));
      group.residual = product(e.shared, by) + product(e.own, own);
    });
    out.push_back({effect.id, residual_profile(problem, shown)});
  }
  return out;
}

LinearStep linear_step(const std::vector<MatrixXd>& parts, const std::vector<std::size_t>& which,
                       const std::vector<Index>& columns) {
  const auto p = static_cast<Index>(columns.size()), r = parts.front().rows() - 1;
  MatrixXd A = MatrixXd::Zero(p, p);
  VectorXd b = VectorXd::Zero(p);
  for (const std::size_t n : which) {
    A += parts[n](columns, columns);
    b += parts[n](columns, std::vector<Index>{r});
  }
  const MatrixXd inverse = pseudo_inverse(A);
  LinearStep out;
  out.value = -inverse * b;
  std::vector<Cluster> clusters;
  for (const std::size_t n : which) {
    const MatrixXd own = parts[n](columns, columns);
    clusters.push_back({own, VectorXd(parts[n](columns, std::vector<Index>{r})) + own * out.value});
  }
  auto scatter = borrowing_scatter(clusters, A, MatrixXd::Zero(p, p));
  out.sigma = scatter.covariance.diagonal().cwiseSqrt();
  for (Index k = 0; k < p; ++k)
    if (!(inverse(k, k) > 0)) out.sigma[k] = HUGE_VAL;  // no group sees it
  out.covariance = std::move(scatter.covariance);
  out.freedom = std::move(scatter.degrees_of_freedom);
  return out;
}

}  // namespace unhand::fitting
