#include "fitting/fit.hpp"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <cmath>

#include "experiment/parallel.hpp"
#include "fitting/misfit.hpp"
#include "fitting/normal_equations.hpp"
#include "fitting/throw_cost.hpp"

namespace unhand::fitting {

using experiment::Channel;

std::string_view to_string(Phase phase) {
  constexpr std::string_view kNames[kPhaseCount] = {"grasped", "release", "flight", "landing"};
  return kNames[static_cast<int>(phase)];
}

const char* to_string(FitOutcome outcome) {
  constexpr const char* kNames[] = {"converged", "iterations_spent", "no_start", "not_solved"};
  return kNames[static_cast<int>(outcome)];
}

Phase phase_of(const experiment::Observation& o, double opening, double release) {
  if (o.channel == Channel::landing_x || o.channel == Channel::landing_theta ||
      o.channel == Channel::landing_time)
    return Phase::landing;
  if (o.time < opening) return Phase::grasped;
  return o.time < release ? Phase::release : Phase::flight;
}

std::vector<double> FitResult::values() const {
  std::vector<double> out;
  for (const auto& u : campaign) out.push_back(u.value);
  return out;
}

double FitResult::correlation(std::size_t i, std::size_t j) const {
  const std::size_t n = campaign.size();
  const double scale = std::sqrt(covariance[i * n + i] * covariance[j * n + j]);
  return scale > 0 ? covariance[i * n + j] / scale : 0;
}

namespace {

double median(std::vector<double> x) {
  std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
  return x[x.size() / 2];
}

/// Which throws a fit uses: those of the train split (all if there is no other), as far as they can be
/// simulated at the start.
std::vector<std::size_t> usable(const CampaignProblem& problem, const FitOptions& options,
                                const std::vector<double>& start, Weighting& weighting,
                                std::vector<double>& chi2) {
  const auto& throws = problem.throws();
  std::vector<char> ok(throws.size(), 0);
  std::vector<double> squares(throws.size(), 0);
  std::vector<Linearisation> starts(throws.size());
  const std::vector<double> own(problem.own().size(), 0.0);
  experiment::parallel_for(throws.size(), options.threads, [&](std::size_t i) {
    if (options.share != Share::all &&
        (options.share == Share::train) != (throws[i].prepared.split == datasets::Split::train))
      return;
    if (throws[i].observed.all.empty()) return;
    try {
      starts[i] = problem.linearise(throws[i], start, own, false);
    } catch (const std::invalid_argument&) {
      return;  // a start outside the physics
    }
    ok[i] = starts[i].solved;
  });
  Misfit misfit;
  for (std::size_t i = 0; i < throws.size(); ++i)
    if (ok[i]) misfit.add(throws[i], starts[i].residual, starts[i].detach);
  misfit.weigh(weighting);
  for (std::size_t i = 0; i < throws.size(); ++i) {
    if (!ok[i]) continue;
    weigh(starts[i], throws[i], weighting);
    squares[i] = starts[i].residual.squaredNorm();
  }
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < throws.size(); ++i)
    if (ok[i]) {
      out.push_back(i);
      chi2.push_back(squares[i]);
    }
  return out;
}

void describe_open_directions(const Eigen::MatrixXd& information, const CampaignProblem& problem,
                              const std::vector<double>& scale, FitResult& out) {
  const auto n = static_cast<Eigen::Index>(scale.size());
  Eigen::MatrixXd scaled = information;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      scaled(i, j) *= scale[static_cast<std::size_t>(i)] * scale[static_cast<std::size_t>(j)];
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  constexpr double kOpen = 3;  // a direction known to no better than three changes that matter
  for (Eigen::Index k = 0; k < n; ++k) {
    const double sigma = eigen.eigenvalues()[k] > 0 ? 1 / std::sqrt(eigen.eigenvalues()[k]) : HUGE_VAL;
    if (sigma < kOpen) continue;
    OpenDirection open;
    open.sigma = sigma;
    Eigen::VectorXd v = eigen.eigenvectors().col(k);
    Eigen::Index largest = 0;
    v.cwiseAbs().maxCoeff(&largest);
    if (v[largest] < 0) v = -v;
    for (Eigen::Index i = 0; i < n; ++i) {
      open.direction.push_back(v[i]);
      if (std::abs(v[i]) < 0.2) continue;
      const Unknown& u = problem.campaign()[static_cast<std::size_t>(i)];
      open.meaning += fmt::format("{}{} {:+.3g} {}", open.meaning.empty() ? "" : " with ", u.name,
                                  v[i] * u.scale, u.unit);
    }
    out.open.push_back(std::move(open));
  }
}

}  // namespace

FitResult fit(const CampaignProblem& problem, const FitOptions& options) {
  const auto begin = Clock::now();
  FitResult out;
  const auto& unknowns = problem.campaign();
  const auto width = static_cast<int>(unknowns.size());
  const auto n_own = problem.own().size();
  std::vector<double> start = options.start.empty() ? problem.start() : options.start;
  for (std::size_t k = 0; k < start.size(); ++k)
    start[k] = std::clamp(start[k], unknowns[k].low, unknowns[k].high);
  Shared shared{problem, options, {}, {}, {}, {}, {}};
  shared.weighting.sample_limit = options.sample_limit;
  for (const auto& u : unknowns) shared.scale.push_back(u.scale);
  for (const auto& u : problem.own()) {
    shared.own_scale.push_back(u.scale);
    shared.own_sigma.push_back(*u.prior_sigma);
  }
  const bool learns = options.own_spread.empty();
  if (!learns) shared.own_sigma = options.own_spread;
  const auto is_fixed = [&](const Unknown& u) {
    return options.all_fixed ||
           std::find(options.fixed.begin(), options.fixed.end(), u.name) != options.fixed.end();
  };
  std::vector<double> chi2;
  const auto used = usable(problem, options, start, shared.weighting, chi2);
  out.throws.resize(problem.throws().size());
  for (std::size_t i = 0; i < out.throws.size(); ++i) {
    out.throws[i].id = problem.throws()[i].prepared.id;
    out.throws[i].own.assign(n_own, 0.0);
  }
  for (const auto& u : unknowns) out.campaign.push_back({u, u.start, 0, 0, false});
  if (used.empty()) {
    out.outcome = FitOutcome::no_start;
    out.message = "no throw of the fit's share could be simulated with the parameters that it starts from";
    return out;
  }

  std::vector<double> x(start.size());
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = start[k] / shared.scale[k];
  std::vector<std::vector<double>> own(used.size(), std::vector<double>(n_own, 0.0));
  // One array: Ceres orders blocks by their addresses, which must be the throws' order in every run.
  std::vector<double> own_blocks(used.size() * n_own, 0.0);
  const auto own_of = [&](std::size_t i) { return own_blocks.data() + i * n_own; };
  std::vector<std::vector<int>> modes_before(used.size());

  ceres::Solver::Options solver;
  // With the campaign's unknowns fixed, nothing couples the throws.
  solver.linear_solver_type = options.all_fixed ? ceres::SPARSE_NORMAL_CHOLESKY : ceres::DENSE_SCHUR;
  solver.max_num_iterations = options.iterations;
  solver.parameter_tolerance = 1e-9;
  solver.gradient_tolerance = 1e-12;
  solver.min_trust_region_radius = 1e-2;  // in scales: below, what is left is the integrator's own rounding
  solver.num_threads = 1;                 // see AllThrows
  solver.logging_type = ceres::SILENT;

  NormalEquations equations;
  ceres::Solver::Summary summary;
  for (int round = 0; round < options.rounds; ++round) {
    const double limit = shared.weighting.throw_limit = options.throw_limit * median(chi2);
    AllThrows all(shared, used, x, own_blocks);
    ceres::Problem::Options problem_options;
    problem_options.evaluation_callback = &all;
    ceres::Problem ceres_problem(problem_options);
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (std::size_t i = 0; i < used.size(); ++i) {
      ceres_problem.AddResidualBlock(
          new ThrowCost(shared, all, i, problem.throws()[used[i]].observed.all.size()),
          new ceres::HuberLoss(std::sqrt(limit)), x.data(), own_of(i));
      ordering->AddElementToGroup(own_of(i), 0);
      for (std::size_t k = 0; k < n_own; ++k) {
        ceres_problem.SetParameterLowerBound(own_of(i), static_cast<int>(k),
                                             problem.own()[k].low / shared.own_scale[k]);
        ceres_problem.SetParameterUpperBound(own_of(i), static_cast<int>(k),
                                             problem.own()[k].high / shared.own_scale[k]);
      }
    }
    ordering->AddElementToGroup(x.data(), 1);
    if (!options.all_fixed) solver.linear_solver_ordering = ordering;
    // What a round learns needs no more than a coarse solution.
    solver.function_tolerance = round + 1 < options.rounds ? 1e-3 : options.accuracy;
    std::vector<int> constant;
    for (int k = 0; k < width; ++k) {
      const auto i = static_cast<std::size_t>(k);
      ceres_problem.SetParameterLowerBound(x.data(), k, unknowns[i].low / shared.scale[i]);
      ceres_problem.SetParameterUpperBound(x.data(), k, unknowns[i].high / shared.scale[i]);
      if (unknowns[i].prior_sigma)
        ceres_problem.AddResidualBlock(new PriorCost(width, k, unknowns[i].start / shared.scale[i],
                                                     *unknowns[i].prior_sigma / shared.scale[i]),
                                       nullptr, x.data());
      if (is_fixed(unknowns[i])) constant.push_back(k);
    }
    if (options.all_fixed || static_cast<int>(constant.size()) == width)
      ceres_problem.SetParameterBlockConstant(x.data());
    else if (!constant.empty())
      ceres_problem.SetManifold(x.data(), new ceres::SubsetManifold(width, constant));
    ceres::Solve(solver, &ceres_problem, &summary);
    out.iterations += static_cast<int>(summary.iterations.size());
    if (!summary.IsSolutionUsable()) {
      out.outcome = FitOutcome::not_solved;
      out.message = summary.message;
      return out;
    }

    for (std::size_t i = 0; i < used.size(); ++i) own[i].assign(own_of(i), own_of(i) + n_own);
    equations = normal_equations(problem, used, shared.unscaled(x.data()), own, shared.own_scale,
                                 shared.own_sigma, shared.weighting, options.threads);
    for (std::size_t i = 0; i < used.size(); ++i) {
      chi2[i] = equations.throws[i].chi2;
      if (!modes_before[i].empty() && modes_before[i] != equations.throws[i].modes &&
          round + 1 == options.rounds)
        ++out.mode_changes;
      modes_before[i] = equations.throws[i].modes;
    }
    Misfit misfit;
    for (std::size_t i = 0; i < used.size(); ++i)
      misfit.add(problem.throws()[used[i]], equations.throws[i].residual, equations.throws[i].detach);
    if (round + 1 < options.rounds) misfit.weigh(shared.weighting);
    // Empirical Bayes: the spread of the throws' own unknowns is what they show, plus what each is uncertain
    // by.
    if (learns && round + 1 < options.rounds && used.size() >= 6)
      for (std::size_t k = 0; k < n_own; ++k) {
        double square = 0, weight = 0;
        for (std::size_t i = 0; i < used.size(); ++i) {
          const double v = own[i][k] * shared.own_scale[k];
          const ThrowEquations& part = equations.throws[i];
          square += part.weight * (v * v + part.own_variance[static_cast<Eigen::Index>(k)]);
          weight += part.weight;
        }
        square /= std::max(weight, 1e-300);
        const double prior = *problem.own()[k].prior_sigma;
        shared.own_sigma[k] = std::clamp(std::sqrt(square), 1e-3 * prior, 3 * prior);
      }
  }

  out.outcome =
      summary.termination_type == ceres::CONVERGENCE ? FitOutcome::converged : FitOutcome::iterations_spent;
  out.message = summary.message;
  out.own_spread = shared.own_sigma;
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(width, width);
  for (int k = 0; k < width; ++k) {
    const auto& u = unknowns[static_cast<std::size_t>(k)];
    if (u.prior_sigma) prior(k, k) = 1 / (*u.prior_sigma * *u.prior_sigma);
    if (is_fixed(u)) prior(k, k) = 1e30 / (u.scale * u.scale);
  }
  const Eigen::MatrixXd covariance = scatter_covariance(equations, prior);
  const Eigen::MatrixXd data = guarded_inverse(equations.information, shared.scale);
  for (int k = 0; k < width; ++k) {
    auto& fitted = out.campaign[static_cast<std::size_t>(k)];
    fitted.value = x[static_cast<std::size_t>(k)] * fitted.unknown.scale;
    fitted.sigma = std::sqrt(covariance(k, k));
    fitted.data_sigma = std::sqrt(data(k, k));
    const double margin = 1e-6 * (fitted.unknown.high - fitted.unknown.low);
    fitted.at_bound =
        fitted.value < fitted.unknown.low + margin || fitted.value > fitted.unknown.high - margin;
    for (int j = 0; j < width; ++j) out.covariance.push_back(covariance(k, j));
  }
  describe_open_directions(equations.information, problem, shared.scale, out);

  Misfit total;
  for (std::size_t i = 0; i < used.size(); ++i) {
    const auto& part = equations.throws[i];
    ThrowFit& throw_fit = out.throws[used[i]];
    throw_fit.used = throw_fit.solved = true;
    throw_fit.weight = part.weight;
    throw_fit.chi2 = part.chi2;
    throw_fit.own = shared.own_unscaled(own[i].data());
    throw_fit.modes = part.modes;
    out.samples += static_cast<long>(problem.throws()[used[i]].observed.all.size());
    total.add(problem.throws()[used[i]], part.residual, part.detach);
  }
  for (int phase = 0; phase < kPhaseCount; ++phase)
    for (int channel = 0; channel < kChannelCount; ++channel) {
      const auto& parts = total.parts[static_cast<std::size_t>(phase * kChannelCount + channel)];
      if (parts.empty()) continue;
      const Misfit::Part part = Misfit::total(parts);
      const ChannelMisfit m{static_cast<Channel>(channel), static_cast<Phase>(phase),
                            static_cast<int>(part.n), part.sum,
                            shared.weighting.of(static_cast<Phase>(phase), static_cast<Channel>(channel))};
      out.chi2 += m.chi2;
      out.misfit.push_back(m);
    }
  out.degrees_of_freedom = out.samples - width - static_cast<long>(used.size() * n_own);
  out.seconds = seconds_since(begin);
  out.jacobian_seconds = 1e-9 * static_cast<double>(shared.jacobian_nanoseconds.load());
  return out;
}

std::vector<double> own_before_release(const CampaignProblem& problem, const CampaignThrow& thrown,
                                       const FitResult& fit) {
  const auto n = problem.own().size();
  std::vector<double> own(n, 0.0);
  const auto campaign = fit.values();
  CampaignThrow held = thrown;
  held.observed.all.clear();
  for (const auto& o : thrown.observed.all)
    if (phase_of(o, thrown.opening, HUGE_VAL) == Phase::grasped) held.observed.all.push_back(o);
  if (held.observed.all.empty() || fit.own_spread.empty()) return own;
  for (int step = 0; step < 3; ++step) {
    auto l = problem.linearise(held, campaign, own, true);
    if (!l.solved) return std::vector<double>(n, 0.0);
    weigh(l, held, Weighting{});
    Eigen::MatrixXd H = l.own.transpose() * l.own;
    Eigen::VectorXd g = l.own.transpose() * l.residual;
    for (std::size_t k = 0; k < n; ++k) {
      const double weight = 1 / (fit.own_spread[k] * fit.own_spread[k]);
      H(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k)) += weight;
      g[static_cast<Eigen::Index>(k)] += weight * own[k];
    }
    const Eigen::VectorXd d = H.ldlt().solve(-g);
    if (!d.allFinite()) break;
    double change = 0;
    for (std::size_t k = 0; k < n; ++k) {
      own[k] =
          std::clamp(own[k] + d[static_cast<Eigen::Index>(k)], problem.own()[k].low, problem.own()[k].high);
      change = std::max(change, std::abs(d[static_cast<Eigen::Index>(k)]) / problem.own()[k].scale);
    }
    if (change < 1e-3) break;
  }
  return own;
}

}  // namespace unhand::fitting
