#include "fitting/fit_rounds.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/median.hpp"
#include "experiment/parallel.hpp"
#include "fitting/misfit.hpp"

namespace unhand::fitting {

FitRounds::FitRounds(const CampaignProblem& problem, const FitOptions& options,
                     const std::vector<double>& start)
    : problem_(problem), options_(options), shared_{problem, options, {}, {}, {}, {}, {}} {
  shared_.weighting.sample_limit = options.sample_limit;
  for (const auto& u : problem.campaign()) shared_.scale.push_back(u.scale);
  for (const auto& u : problem.own()) {
    shared_.own_scale.push_back(u.scale);
    shared_.own_sigma.push_back(*u.prior_sigma);
  }
  if (!options.own_spread.empty()) shared_.own_sigma = options.own_spread;
  for (std::size_t k = 0; k < start.size(); ++k) x_.push_back(start[k] / shared_.scale[k]);
  choose_throws(start);
  own_.assign(used_.size() * problem.own().size(), 0.0);
  modes_.resize(used_.size());
}

void FitRounds::choose_throws(const std::vector<double>& start) {
  const auto& throws = problem_.throws();
  std::vector<Linearisation> starts(throws.size());
  const std::vector<double> own(problem_.own().size(), 0.0);
  experiment::parallel_for(throws.size(), options_.threads, [&](std::size_t i) {
    const bool shared =
        options_.share == Share::all ||
        (options_.share == Share::train) == (throws[i].prepared.split == datasets::Split::train);
    if (!shared || throws[i].observed.all.empty()) return;
    try {
      starts[i] = problem_.linearise(throws[i], start, own, false);
    } catch (const std::invalid_argument&) {
      // a start outside the physics
    }
  });
  Misfit misfit;
  for (std::size_t i = 0; i < throws.size(); ++i)
    if (starts[i].solved) {
      used_.push_back(i);
      misfit.add(throws[i], starts[i].residual, starts[i].detach);
    }
  misfit.weigh(shared_.weighting);
  for (const std::size_t i : used_) {
    weigh(starts[i], throws[i].observed, throws[i], shared_.weighting);
    chi2_.push_back(starts[i].residual.squaredNorm());
  }
}

bool FitRounds::is_fixed(const Unknown& unknown) const {
  return options_.all_fixed ||
         std::find(options_.fixed.begin(), options_.fixed.end(), unknown.name) != options_.fixed.end();
}

void FitRounds::add_throws(ceres::Problem& problem, const AllThrows& all,
                           ceres::ParameterBlockOrdering& ordering) {
  for (std::size_t i = 0; i < used_.size(); ++i) {
    double* own = own_at(i);
    problem.AddResidualBlock(new ThrowCost(shared_, all, i, problem_.throws()[used_[i]].observed.all.size()),
                             new ceres::HuberLoss(std::sqrt(shared_.weighting.throw_limit)), x_.data(), own);
    ordering.AddElementToGroup(own, 0);
    for (std::size_t k = 0; k < shared_.own_scale.size(); ++k) {
      const Unknown& u = problem_.own()[k];
      problem.SetParameterLowerBound(own, static_cast<int>(k), u.low / shared_.own_scale[k]);
      problem.SetParameterUpperBound(own, static_cast<int>(k), u.high / shared_.own_scale[k]);
    }
  }
  ordering.AddElementToGroup(x_.data(), 1);
}

void FitRounds::add_campaign(ceres::Problem& problem) {
  const auto width = static_cast<int>(x_.size());
  std::vector<int> constant;
  for (int k = 0; k < width; ++k) {
    const Unknown& u = problem_.campaign()[static_cast<std::size_t>(k)];
    const double scale = shared_.scale[static_cast<std::size_t>(k)];
    problem.SetParameterLowerBound(x_.data(), k, u.low / scale);
    problem.SetParameterUpperBound(x_.data(), k, u.high / scale);
    if (u.prior_sigma)
      problem.AddResidualBlock(new PriorCost(width, k, u.start / scale, *u.prior_sigma / scale), nullptr,
                               x_.data());
    if (is_fixed(u)) constant.push_back(k);
  }
  if (static_cast<int>(constant.size()) == width)
    problem.SetParameterBlockConstant(x_.data());
  else if (!constant.empty())
    problem.SetManifold(x_.data(), new ceres::SubsetManifold(width, constant));
}

bool FitRounds::solve(bool last) {
  shared_.weighting.throw_limit = options_.throw_limit * dynamics::median(chi2_);
  ceres::Solver::Options solver;
  // With the campaign's unknowns fixed, nothing couples the throws.
  solver.linear_solver_type = options_.all_fixed ? ceres::SPARSE_NORMAL_CHOLESKY : ceres::DENSE_SCHUR;
  solver.max_num_iterations = options_.iterations;
  solver.parameter_tolerance = 1e-9;
  solver.gradient_tolerance = 1e-12;
  solver.min_trust_region_radius = 1e-2;  // in scales: below, what is left is the integrator's own rounding
  solver.num_threads = 1;                 // see AllThrows
  solver.logging_type = ceres::SILENT;
  // What a round learns needs no more than a coarse solution.
  solver.function_tolerance = last ? options_.accuracy : 1e-3;

  AllThrows all(shared_, used_, x_, own_);
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = &all;
  ceres::Problem problem(problem_options);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  add_throws(problem, all, *ordering);
  add_campaign(problem);
  if (!options_.all_fixed) solver.linear_solver_ordering = ordering;
  ceres::Solve(solver, &problem, &summary_);
  iterations_ += static_cast<int>(summary_.iterations.size());
  if (!summary_.IsSolutionUsable()) return false;

  std::vector<std::vector<double>> own;
  for (std::size_t i = 0; i < used_.size(); ++i) own.push_back(this->own(i));
  equations_ = normal_equations(problem_, used_, campaign(), own, shared_.own_sigma, shared_.weighting,
                                options_.threads);
  mode_changes_ = 0;
  for (std::size_t i = 0; i < used_.size(); ++i) {
    chi2_[i] = equations_.throws[i].chi2;
    mode_changes_ += !modes_[i].empty() && modes_[i] != equations_.throws[i].modes;
    modes_[i] = equations_.throws[i].modes;
  }
  return true;
}

void FitRounds::learn() {
  Misfit misfit;
  for (std::size_t i = 0; i < used_.size(); ++i)
    misfit.add(problem_.throws()[used_[i]], equations_.throws[i].residual, equations_.throws[i].detach);
  misfit.weigh(shared_.weighting);
  constexpr std::size_t kFewest = 6;  // throws that have a spread
  if (!options_.own_spread.empty() || used_.size() < kFewest) return;
  for (std::size_t k = 0; k < shared_.own_sigma.size(); ++k) {
    double square = 0, weight = 0;
    for (std::size_t i = 0; i < used_.size(); ++i) {
      const ThrowEquations& part = equations_.throws[i];
      const double value = own(i)[k];
      square += part.weight * (value * value + part.own_variance[static_cast<Eigen::Index>(k)]);
      weight += part.weight;
    }
    const double prior = *problem_.own()[k].prior_sigma;
    shared_.own_sigma[k] = std::clamp(std::sqrt(square / std::max(weight, 1e-300)), 1e-3 * prior, 3 * prior);
  }
}

}  // namespace unhand::fitting
