#include "fitting/evaluate.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <stdexcept>

#include "dynamics/parallel.hpp"
#include "dynamics/straight_line.hpp"
#include "experiment/outcome_slopes.hpp"
#include "fitting/before_release.hpp"
#include "fitting/clock.hpp"

namespace unhand::fitting {

using experiment::Channel;
using experiment::kDegrees;

namespace {

using Matrix = Eigen::MatrixXd;
using Index = Eigen::Index;

/// ∂(outcomes)/∂(campaign, own), or nothing where a simulation with dual numbers has no answer.
std::optional<Matrix> slopes(const CampaignProblem& problem, const CampaignThrow& thrown,
                             const std::vector<double>& campaign, const std::vector<double>& own) {
  Matrix out = Matrix::Zero(experiment::kOutcomeCount, static_cast<Index>(campaign.size() + own.size()));
  bool landed = true;
  const auto read = [&](const auto& p, std::span<const int> by) {
    landed = p.landed();
    if (!landed) return false;
    const auto y = experiment::outcomes_of(p);
    for (std::size_t k = 0; k < by.size(); ++k)
      for (std::size_t i = 0; i < y.size(); ++i)
        out(static_cast<Index>(i), by[k]) = y[i].v[static_cast<Index>(k)];
    return true;
  };
  problem.differentiate(thrown.prepared, {}, campaign, own, DerivativesBy::all, read);
  if (!landed || !out.allFinite()) return {};
  return out;
}

std::optional<OutcomeSigma> sigma_of(const CampaignProblem& problem, const CampaignThrow& thrown,
                                     const FitResult& fit, const BeforeRelease& before) {
  const auto width = static_cast<Index>(fit.campaign.size()), n = static_cast<Index>(before.own.size());
  const auto J = slopes(problem, thrown, fit.values(), before.own);
  if (!J) return {};
  const Matrix T = J->leftCols(width) + J->rightCols(n) * before.response;
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Matrix variance = J->rightCols(n) * before.covariance * J->rightCols(n).transpose();
  if (!fit.covariance.empty())
    variance += T * Eigen::Map<const RowMajor>(fit.covariance.data(), width, width) * T.transpose();
  const Eigen::VectorXd s = variance.diagonal().cwiseMax(0.0).cwiseSqrt();
  if (!s.allFinite()) return {};
  return OutcomeSigma{s[0], s[1], s[2], s[3], s[4], s[5], s[6]};
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
  if (seen) {
    out.error[0] = dynamics::fit_line(time[0], residual[0]).slope;
    out.error[1] = dynamics::fit_line(time[1], residual[1]).slope * kDegrees;
  } else {
    experiment::judge_detach(prepared, out);
  }
}

PredictedThrow predict_one(const CampaignProblem& problem, const CampaignThrow& thrown, const FitResult& fit,
                           bool uncertainty) {
  PredictedThrow out;
  const auto& prepared = thrown.prepared;
  out.comparison = {prepared.id, prepared.object, prepared.condition, prepared.split, {}, {}};
  const BeforeRelease before =
      before_release(problem, thrown, fit, uncertainty ? DerivativesBy::all : DerivativesBy::own);
  out.own = before.own;
  const auto campaign = fit.values();
  const auto begin = Clock::now();
  const auto bare = problem.predict(prepared, {}, campaign, out.own);
  out.seconds = seconds_since(begin);
  auto& prediction = out.comparison.prediction;
  prediction.release = bare.release;
  prediction.flight = bare.flight;
  prediction.detach = bare.detach;
  prediction.landing = bare.landing;
  prediction.events = static_cast<int>(bare.modes.size());
  prediction.slips_at_start = bare.slips_at_start;
  const double from = std::max(thrown.release_or(bare.detach.time), bare.detach.time);
  const auto observed = bare.landed() ? outcome_channels(thrown, from) : experiment::Observations{};
  judge(prepared, observed,
        observed.all.empty() ? bare : problem.predict(prepared, observed, campaign, out.own), out.comparison);
  if (uncertainty && bare.landed()) out.sigma = sigma_of(problem, thrown, fit, before);
  return out;
}

}  // namespace

std::vector<PredictedThrow> predict_some(const CampaignProblem& problem, const FitResult& fit,
                                         const std::vector<std::size_t>& which,
                                         const EvaluateOptions& options) {
  require_fit_of(problem, fit);
  for (const std::size_t i : which)
    if (i >= problem.throws().size())
      throw std::invalid_argument(
          fmt::format("predict_some: place {} is not in [0, {})", i, problem.throws().size()));
  FitResult known = fit;
  for (std::size_t k = known.own_spread.size(); k < problem.own().size(); ++k)
    known.own_spread.push_back(problem.own()[k].prior_sigma.value_or(problem.own()[k].scale));
  std::vector<PredictedThrow> out(which.size());
  dynamics::parallel_for(which.size(), options.threads, [&](std::size_t i) {
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
  const auto conditions = datasets::conditions_of(train);
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
      const auto c = std::find(conditions.begin(), conditions.end(),
                               std::pair(part.throws[i].object, part.throws[i].condition)) -
                     conditions.begin();
      if (c % out.folds != fold) continue;
      part.throws[i].split = datasets::Split::test;
      left_out.push_back(i);
    }
    const CampaignProblem problem(part, file, campaign);
    const FitResult result = fit(problem, options);
    if (!result.is_answer()) {
      out.failed.push_back(fmt::format("fold {} of {}: {}", fold + 1, out.folds, result.message));
      continue;
    }
    for (auto& one : predict_some(problem, result, left_out, {false, options.threads}))
      out.throws.push_back(std::move(one));
  }
  return out;
}

}  // namespace unhand::fitting
