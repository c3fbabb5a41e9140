#include "fitting/evaluate.hpp"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "experiment/parallel.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

using dynamics::Dual;
using dynamics::value_of;
using dynamics::Values;
using experiment::Channel;
using experiment::kDegrees;

namespace {

using Matrix = Eigen::MatrixXd;
using Index = Eigen::Index;

std::vector<double> values_of(const CampaignThrow& thrown, const std::vector<double>& campaign,
                              const std::vector<double>& own) {
  std::vector<double> out;
  for (const int column : thrown.columns) {
    const auto c = static_cast<std::size_t>(column);
    out.push_back(c < campaign.size() ? campaign[c] : own[c - campaign.size()]);
  }
  return out;
}

constexpr Index kOutcomes = 7;  // in the order of OutcomeSigma
template <class S>
std::array<S, kOutcomes> outcomes_of(const experiment::ThrowPrediction<S>& p) {
  return {p.detach.time,    p.detach.twist.vx,    p.detach.twist.vz,    p.detach.twist.omega,
          p.landing.pose.x, p.landing.pose.theta, p.landing.flight_time};
}

/// ∂(outcomes)/∂(campaign, own), or nothing where a simulation with dual numbers has no answer.
std::optional<Matrix> slopes(const CampaignProblem& problem, const CampaignThrow& thrown,
                             const std::vector<double>& values, Index width) {
  const auto n = static_cast<int>(values.size());
  Matrix out = Matrix::Zero(kOutcomes, width);
  constexpr int kSize = dynamics::kDualSize;
  for (int first = 0; first < n; first += kSize) {
    const int last = std::min(first + kSize, n);
    std::vector<Dual> duals;
    for (int k = 0; k < n; ++k) {
      const double v = values[static_cast<std::size_t>(k)];
      duals.push_back(k >= first && k < last ? dynamics::independent(v, k - first) : Dual(v));
    }
    const auto p = experiment::predict_channels(thrown.prepared, {}, problem.model(),
                                                Values<Dual>(thrown.names, std::span<const Dual>(duals)));
    if (!p.landed()) return {};
    const auto y = outcomes_of(p);
    for (int k = first; k < last; ++k)
      for (Index i = 0; i < kOutcomes; ++i)
        out(i, thrown.columns[static_cast<std::size_t>(k)]) = y[static_cast<std::size_t>(i)].v[k - first];
  }
  if (!out.allFinite()) return {};
  return out;
}

/// What the samples before the opening leave open of a throw's own unknowns: H⁻¹, and how their estimate
/// follows the campaign's unknowns.
struct Before {
  Matrix covariance, response;
};
Before before_release(const CampaignProblem& problem, const CampaignThrow& thrown, const FitResult& fit,
                      const std::vector<double>& own) {
  const auto width = static_cast<Index>(fit.campaign.size()), n = static_cast<Index>(own.size());
  Matrix H = Matrix::Zero(n, n), coupling = Matrix::Zero(n, width);
  for (Index k = 0; k < n; ++k) {
    const double spread = fit.own_spread[static_cast<std::size_t>(k)];
    H(k, k) = 1 / (spread * spread);
  }
  CampaignThrow held = thrown;
  std::erase_if(held.observed.all, [&](const experiment::Observation& o) {
    return phase_of(o, thrown.opening, HUGE_VAL) != Phase::grasped;
  });
  if (!held.observed.all.empty()) {
    auto l = problem.linearise(held, fit.values(), own, true);
    if (l.solved) {
      weigh(l, held, Weighting{});
      H += l.own.transpose() * l.own;
      coupling = l.own.transpose() * l.campaign;
    }
  }
  const Eigen::LDLT<Matrix> solver(H);
  return {solver.solve(Matrix::Identity(n, n)), -solver.solve(coupling)};
}

std::optional<OutcomeSigma> sigma_of(const CampaignProblem& problem, const CampaignThrow& thrown,
                                     const FitResult& fit, const std::vector<double>& own) {
  const auto width = static_cast<Index>(fit.campaign.size()), n = static_cast<Index>(own.size());
  const auto J = slopes(problem, thrown, values_of(thrown, fit.values(), own), width + n);
  if (!J) return {};
  const Before before = before_release(problem, thrown, fit, own);
  const Matrix T = J->leftCols(width) + J->rightCols(n) * before.response;
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Matrix variance = J->rightCols(n) * before.covariance * J->rightCols(n).transpose();
  if (!fit.covariance.empty())
    variance += T * Eigen::Map<const RowMajor>(fit.covariance.data(), width, width) * T.transpose();
  const Eigen::VectorXd s = variance.diagonal().cwiseMax(0.0).cwiseSqrt();
  if (!s.allFinite()) return {};
  return OutcomeSigma{s[0], s[1], s[2], s[3], s[4], s[5], s[6]};
}

double slope(const std::vector<double>& t, const std::vector<double>& y) {
  const auto n = static_cast<double>(t.size());
  double tm = 0, ym = 0, tt = 0, ty = 0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    tm += t[i] / n;
    ym += y[i] / n;
  }
  for (std::size_t i = 0; i < t.size(); ++i) {
    tt += (t[i] - tm) * (t[i] - tm);
    ty += (t[i] - tm) * (y[i] - ym);
  }
  return ty / tt;
}

/// Mocap of the flight and the landing: what errors are read from.
experiment::Observations outcome_channels(const CampaignThrow& thrown, double from) {
  experiment::Observations out;
  for (const auto& o : thrown.observed.all)
    if (o.channel == Channel::landing_x || o.channel == Channel::landing_theta ||
        ((o.channel == Channel::mocap_x || o.channel == Channel::mocap_theta) && o.time >= from))
      out.all.push_back(o);
  return out;
}

void judge(const experiment::PreparedThrow& prepared, const experiment::Observations& observed,
           const experiment::ThrowPrediction<double>& p, experiment::ThrowComparison& out) {
  std::vector<double> time[2], residual[2];
  for (std::size_t i = 0; i < p.channels.size(); ++i) {
    const auto& o = observed.all[i];
    const double error = p.channels[i] - o.value;
    if (o.channel == Channel::landing_x)
      out.error[2] = error;
    else if (o.channel == Channel::landing_theta)
      out.error[3] = error * kDegrees;
    else {
      const int k = o.channel == Channel::mocap_theta;
      time[k].push_back(o.time);
      residual[k].push_back(error);
    }
  }
  const bool seen = time[0].size() >= 4;
  const auto& twist = prepared.measured.detach_twist;
  if (seen) {
    out.error[0] = slope(time[0], residual[0]);
    out.error[1] = slope(time[1], residual[1]) * kDegrees;
  } else if (p.release == release::ReleaseOutcome::detached && twist) {
    const double wait = prepared.measured.detach_time ? *prepared.measured.detach_time - p.detach.time : 0.0;
    out.error[0] = p.detach.twist.vx + wait * prepared.gravity.x - twist->vx;
    out.error[1] = (p.detach.twist.omega - twist->omega) * kDegrees;
  }
}

PredictedThrow predict_one(const CampaignProblem& problem, const CampaignThrow& thrown, const FitResult& fit,
                           bool uncertainty) {
  using Clock = std::chrono::steady_clock;
  PredictedThrow out;
  const auto& prepared = thrown.prepared;
  out.comparison = {prepared.id, prepared.object, prepared.condition, prepared.split, {}, {}};
  out.own = own_before_release(problem, thrown, fit);
  const auto values = values_of(thrown, fit.values(), out.own);
  const Values<double> named(thrown.names, values);
  const auto begin = Clock::now();
  const auto bare = experiment::predict_channels(prepared, {}, problem.model(), named);
  out.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  auto& prediction = out.comparison.prediction;
  prediction.release = bare.release;
  prediction.flight = bare.flight;
  prediction.detach = bare.detach;
  prediction.landing = bare.landing;
  prediction.events = static_cast<int>(bare.modes.size());
  const double from = std::max(thrown.release_or(bare.detach.time), bare.detach.time);
  const auto observed = bare.landed() ? outcome_channels(thrown, from) : experiment::Observations{};
  judge(
      prepared, observed,
      observed.all.empty() ? bare : experiment::predict_channels(prepared, observed, problem.model(), named),
      out.comparison);
  if (uncertainty && bare.landed()) out.sigma = sigma_of(problem, thrown, fit, out.own);
  return out;
}

}  // namespace

std::vector<PredictedThrow> predict_some(const CampaignProblem& problem, const FitResult& fit,
                                         const std::vector<std::size_t>& which,
                                         const EvaluateOptions& options) {
  FitResult known = fit;
  for (std::size_t k = known.own_spread.size(); k < problem.own().size(); ++k)
    known.own_spread.push_back(problem.own()[k].prior_sigma.value_or(problem.own()[k].scale));
  std::vector<PredictedThrow> out(which.size());
  experiment::parallel_for(which.size(), options.threads, [&](std::size_t i) {
    out[i] = predict_one(problem, problem.throws()[which[i]], known, options.uncertainty);
  });
  return out;
}

std::vector<PredictedThrow> predict_throws(const CampaignProblem& problem, const FitResult& fit,
                                           const EvaluateOptions& options) {
  std::vector<std::size_t> all(problem.throws().size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  return predict_some(problem, fit, all, options);
}

experiment::ModelComparison comparison_of(const CampaignProblem& problem, const FitResult& fit,
                                          const std::vector<PredictedThrow>& throws) {
  experiment::ModelComparison out;
  out.model = problem.options().model;
  for (const auto& u : fit.campaign) out.named.push_back({u.unknown.name, u.unknown.unit, u.value, u.sigma});
  for (const auto& one : throws) {
    out.throws.push_back(one.comparison);
    if (!one.comparison.prediction.landed()) ++out.failed;
    out.microseconds_per_throw += 1e6 * one.seconds / static_cast<double>(throws.size());
  }
  return out;
}

experiment::ErrorStatistics CrossValidation::statistics(int quantity) const {
  std::vector<double> errors;
  for (const auto& one : throws)
    if (one.comparison.error[quantity]) errors.push_back(*one.comparison.error[quantity]);
  return experiment::statistics_of(errors);
}

CrossValidation cross_validate(const datasets::ThrowLog& log, const std::string& file,
                               const CampaignOptions& campaign, const FitOptions& options, int folds) {
  datasets::ThrowLog train = log;
  std::erase_if(train.throws, [](const datasets::Throw& one) { return one.split != datasets::Split::train; });
  std::vector<std::string> conditions;
  for (const auto& one : train.throws)
    if (std::find(conditions.begin(), conditions.end(), one.condition) == conditions.end())
      conditions.push_back(one.condition);
  if (folds < 2 || conditions.size() < 2)
    throw std::invalid_argument(fmt::format(
        "{}: {} folds of {} conditions among the train throws: cross-validation needs two of each", file,
        folds, conditions.size()));
  CrossValidation out;
  out.folds = std::min(folds, static_cast<int>(conditions.size()));
  for (int fold = 0; fold < out.folds; ++fold) {
    datasets::ThrowLog part = train;
    std::vector<std::size_t> left_out;
    for (std::size_t i = 0; i < part.throws.size(); ++i) {
      const auto c =
          std::find(conditions.begin(), conditions.end(), part.throws[i].condition) - conditions.begin();
      if (c % out.folds != fold) continue;
      part.throws[i].split = datasets::Split::test;
      left_out.push_back(i);
    }
    const CampaignProblem problem(part, file, campaign);
    const FitResult result = fit(problem, options);
    if (result.outcome == FitOutcome::no_start || result.outcome == FitOutcome::not_solved) {
      out.failed.push_back(fmt::format("fold {} of {}: {}", fold + 1, out.folds, result.message));
      continue;
    }
    for (auto& one : predict_some(problem, result, left_out, {false, options.threads}))
      out.throws.push_back(std::move(one));
  }
  return out;
}

}  // namespace unhand::fitting
