#include "fitting/fit_rounds.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "dynamics/median.hpp"
#include "dynamics/parallel.hpp"
#include "fitting/misfit.hpp"
#include "fitting/throw_cost.hpp"

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
}

void FitRounds::choose_throws(const std::vector<double>& start) {
  const auto& throws = problem_.throws();
  std::vector<Linearisation> starts(throws.size());
  const std::vector<double> own(problem_.own().size(), 0.0);
  dynamics::parallel_for(throws.size(), options_.threads, [&](std::size_t i) {
    if (!takes(options_.share, throws[i].prepared.split) || throws[i].observed.all.empty() ||
        !(options_.throws.empty() || options_.throws[i]))
      return;
    starts[i] = problem_.linearise(throws[i], start, own, DerivativesBy::nothing);
  });
  for (const Linearisation& one : starts) why_not_.push_back(one.why_not);
  if (!options_.throws.empty())
    for (std::size_t i = 0; i < throws.size() && !refused_; ++i)
      if (!why_not_[i].empty()) refused_ = i;
  if (refused_) return;
  Misfit misfit;
  for (std::size_t i = 0; i < throws.size(); ++i)
    if (starts[i].solved) {
      used_.push_back(i);
      misfit.add(throws[i], starts[i].residual, starts[i].detach);
    }
  misfit.weigh(shared_.weighting, Weigh::variances);
  for (const std::size_t i : used_) {
    weigh(starts[i], throws[i].observed, throws[i], shared_.weighting);
    chi2_.push_back(starts[i].residual.squaredNorm());
    modes_.push_back(starts[i].modes);
  }
}

bool FitRounds::is_fixed(const Unknown& unknown) const {
  return options_.all_fixed ||
         std::find(options_.fixed.begin(), options_.fixed.end(), unknown.name) != options_.fixed.end();
}

Eigen::MatrixXd FitRounds::information() const {
  Eigen::MatrixXd out = equations_.information;
  for (std::size_t i = 0; i < x_.size(); ++i) {
    if (!is_fixed(problem_.campaign()[i])) continue;
    const auto k = static_cast<Eigen::Index>(i);
    out.row(k).setZero();
    out.col(k).setZero();
    out(k, k) = 1 / (shared_.scale[i] * shared_.scale[i]);
  }
  return out;
}

FitRounds::Solution FitRounds::minimise(double tolerance, std::optional<std::size_t> held) {
  AllThrows all(shared_, simulated_, used_, x_, own_);
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = &all;
  ceres::Problem problem(problem_options);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t i = 0; i < used_.size(); ++i) {
    double* own = own_at(i);
    problem.AddResidualBlock(new ThrowCost(shared_, all, i, problem_.throws()[used_[i]].observed.all.size()),
                             new ceres::HuberLoss(std::sqrt(shared_.weighting.throw_limit)), x_.data(), own);
    ordering->AddElementToGroup(own, 0);
    for (std::size_t k = 0; k < shared_.own_scale.size(); ++k) {
      const Unknown& u = problem_.own()[k];
      problem.SetParameterLowerBound(own, static_cast<int>(k), u.low / shared_.own_scale[k]);
      problem.SetParameterUpperBound(own, static_cast<int>(k), u.high / shared_.own_scale[k]);
    }
  }
  ordering->AddElementToGroup(x_.data(), 1);

  const auto width = static_cast<int>(x_.size());
  std::vector<int> constant;
  for (int k = 0; k < width; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Unknown& u = problem_.campaign()[i];
    const double scale = shared_.scale[i];
    problem.SetParameterLowerBound(x_.data(), k, u.low / scale);
    problem.SetParameterUpperBound(x_.data(), k, u.high / scale);
    if (u.prior_sigma)
      problem.AddResidualBlock(new PriorCost(all, width, k, u.start / scale, *u.prior_sigma / scale), nullptr,
                               x_.data());
    if (is_fixed(u) || held == i) constant.push_back(k);
  }
  const bool all_constant = static_cast<int>(constant.size()) == width;
  if (all_constant)
    problem.SetParameterBlockConstant(x_.data());
  else if (!constant.empty())
    problem.SetManifold(x_.data(), new ceres::SubsetManifold(width, constant));

  ceres::Solver::Options solver;
  // With the campaign's unknowns fixed, nothing couples the throws.
  solver.linear_solver_type = all_constant ? ceres::SPARSE_NORMAL_CHOLESKY : ceres::DENSE_SCHUR;
  if (!all_constant) solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = options_.iterations;
  solver.function_tolerance = tolerance;
  solver.parameter_tolerance = 1e-9;
  solver.gradient_tolerance = 1e-12;
  solver.min_trust_region_radius = 1e-2;  // in scales: below, what is left is the integrator's own rounding
  solver.num_threads = 1;                 // see AllThrows
  // Bounds would have Ceres search every step's length, with a gradient of all throws at each: a step that
  // does not help is halved and asked for again by the trust region at a plain simulation's price.
  solver.max_num_line_search_step_size_iterations = 0;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  return {summary.IsSolutionUsable(), summary.termination_type == ceres::CONVERGENCE, summary.final_cost,
          static_cast<int>(summary.iterations.size()), summary.message};
}

bool FitRounds::solve(bool last) {
  shared_.weighting.throw_limit = options_.throw_limit * dynamics::median(chi2_);
  // What a round learns needs no more than a coarse solution.
  solution_ = minimise(last ? options_.accuracy : 1e-3, {});
  iterations_ += solution_.iterations;
  if (!solution_.usable) return false;
  std::vector<std::vector<double>> own;
  for (std::size_t i = 0; i < used_.size(); ++i) own.push_back(this->own(i));
  equations_ = normal_equations(problem_, used_, simulated_.at(x_, own_, true), own, shared_.own_sigma,
                                shared_.weighting, options_.threads);
  mode_changes_ = 0;
  for (std::size_t i = 0; i < used_.size(); ++i) {
    chi2_[i] = equations_.throws[i].chi2;
    mode_changes_ += modes_[i] != equations_.throws[i].modes;
    modes_[i] = equations_.throws[i].modes;
  }
  return true;
}

double FitRounds::cost_with(std::size_t k, double value, Point& from) {
  from.campaign[k] = value / shared_.scale[k];
  std::swap(x_, from.campaign);
  std::swap(own_, from.own);
  const Solution held = minimise(options_.accuracy, k);
  std::swap(x_, from.campaign);
  std::swap(own_, from.own);
  return held.usable ? held.cost : HUGE_VAL;
}

void FitRounds::learn() {
  Misfit misfit;
  for (std::size_t i = 0; i < used_.size(); ++i)
    misfit.add(problem_.throws()[used_[i]], equations_.throws[i].residual, equations_.throws[i].detach);
  // Far from the solution even the right law errs steadily, and would never come near as one witness.
  constexpr int kNear = 2;  // rounds
  misfit.weigh(shared_.weighting, ++learned_ < kNear ? Weigh::variances : options_.weigh);
  constexpr std::size_t kFewest = 6;  // throws that have a spread
  if (!options_.own_spread.empty() || used_.size() < kFewest) return;
  for (std::size_t k = 0; k < shared_.own_sigma.size(); ++k) {
    const Unknown& u = problem_.own()[k];
    if (u.kind == Unknown::Kind::smoothing) continue;
    shared_.own_sigma[k] = std::clamp(std::sqrt(variance_of(k)), 1e-3 * *u.prior_sigma, 3 * *u.prior_sigma);
  }
}

double FitRounds::variance_of(std::size_t k) const {
  struct Sum {
    double weight{}, value{}, square{}, share{}, squared_share{}, n{};
  };
  const double variance = shared_.own_sigma[k] * shared_.own_sigma[k];
  std::map<std::string, Sum> conditions;
  for (std::size_t i = 0; i < used_.size(); ++i) {
    const ThrowEquations& part = equations_.throws[i];
    const double value = own(i)[k];
    const double share = std::max(0.0, 1 - part.own_variance[static_cast<Eigen::Index>(k)] / variance);
    for (const auto& key : {problem_.throws()[used_[i]].prepared.experiment(), std::string()}) {
      Sum& sum = conditions[key];  // "": all together
      sum.weight += part.weight;
      sum.value += part.weight * value;
      sum.square += part.weight * value * value;
      sum.share += part.weight * share;
      sum.squared_share += part.weight * share * share;
      sum.n += 1;
    }
  }
  const auto likelier = [&](const Sum& sum) {
    if (!(sum.weight > 0)) return variance;  // no throw was solved
    const double score = sum.square - sum.share * variance;
    constexpr double kInformed = 2;  // shares' squares below which the scores scatter more than they say
    if (sum.squared_share < kInformed) return variance + score / sum.weight;
    constexpr double kApart = 4;
    const double fixed_point = sum.square / sum.share;
    return std::clamp(variance + score / sum.squared_share, fixed_point / kApart, fixed_point * kApart);
  };
  const Sum all = conditions[""];
  const double about_zero = likelier(all);
  if (problem_.own()[k].kind == Unknown::Kind::placement) return about_zero;
  conditions.erase("");
  Sum about_means;
  for (const auto& [name, sum] : conditions) {
    if (sum.n < 2 || !(sum.weight > 0)) continue;
    const double rest = 1 - 1 / sum.n;
    about_means.weight += rest * sum.weight;
    about_means.square += std::max(0.0, sum.square - sum.value * sum.value / sum.weight);
    about_means.share += rest * sum.share;
    about_means.squared_share += rest * sum.squared_share;
    about_means.n += sum.n - 1;
  }
  constexpr double kEnough = 10;  // degrees of freedom: a spread is then known to a quarter
  return about_means.n >= kEnough ? likelier(about_means) : about_zero;
}

}  // namespace unhand::fitting
