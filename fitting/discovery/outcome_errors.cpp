#include "fitting/discovery/outcome_errors.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "dynamics/parallel.hpp"
#include "fitting/evaluate.hpp"

namespace unhand::fitting {

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::position:
      return "position in flight";
    case Outcome::orientation:
      return "orientation in flight";
    case Outcome::landing_x:
      return "landing x";
    case Outcome::landing_theta:
      return "landing theta";
  }
  return "";
}

const char* unit_of(Outcome outcome) {
  return outcome == Outcome::orientation || outcome == Outcome::landing_theta ? "rad" : "m";
}

std::string PredictionGain::in_words() const {
  return fmt::format("{:.3g} to {:.3g} mm, {:.3g} to {:.3g} deg rms", 1e3 * position.before,
                     1e3 * position.after, angle.before * experiment::kDegrees,
                     angle.after * experiment::kDegrees);
}

using experiment::Channel;

namespace {

constexpr int kLandingX = 2, kLandingTheta = 3;  // of kQuantities

/// What is tracked in flight of a predicted throw.
void follow_flight(const CampaignProblem& problem, const CampaignThrow& thrown,
                   const std::vector<double>& campaign, const PredictedThrow& predicted,
                   PredictedOutcome& out) {
  const auto channels = problem.predict(thrown, campaign, predicted.own).channels;
  const double detach = thrown.release_or(predicted.comparison.prediction.detach.time);
  std::array<double, 3> sum{}, n{};
  double axes[2] = {};  // variances of x and z
  const auto variance = [&out](Outcome outcome) -> double& {
    return out.variance[static_cast<std::size_t>(outcome)];
  };
  for (std::size_t j = 0; j < channels.size(); ++j) {
    const auto& o = thrown.observed.all[j];
    if (o.channel == Channel::landing_x) variance(Outcome::landing_x) = o.sigma * o.sigma;
    if (o.channel == Channel::landing_theta) variance(Outcome::landing_theta) = o.sigma * o.sigma;
    if (phase_of(o, thrown.opening, detach) != Phase::flight) continue;
    const std::size_t k = o.channel == Channel::mocap_x       ? 0
                          : o.channel == Channel::mocap_z     ? 1
                          : o.channel == Channel::mocap_theta ? 2
                                                              : 3;
    if (k == 3) continue;
    const double error = channels[j] - o.value;
    sum[k] += error, n[k] += 1;
    if (k < 2)
      out.squares += error * error;
    else
      out.angle_squares += error * error;
    (k < 2 ? axes[k] : variance(Outcome::orientation)) = o.sigma * o.sigma;
  }
  variance(Outcome::position) = axes[0] + axes[1];
  out.samples = n[0], out.angles = n[2];
  if (n[0] > 0 && n[1] > 0 && n[2] > 0) out.flight = {sum[0] / n[0], sum[1] / n[1], sum[2] / n[2]};
}

/// The errors of every outcome that at least one throw has, compared by condition.
std::vector<OutcomeLack> lacks(const std::vector<PredictedOutcome>& throws) {
  using Error = std::optional<std::array<double, 2>>;
  std::vector<OutcomeLack> out;
  const auto add = [&](Outcome outcome, const auto& error_of) {
    std::vector<std::array<double, 2>> error;
    std::vector<int> condition;
    double variance = 0;
    for (const PredictedOutcome& thrown : throws)
      if (const Error e = error_of(thrown)) {
        error.push_back(*e), condition.push_back(thrown.condition);
        variance += thrown.variance[static_cast<std::size_t>(outcome)];
      }
    if (error.empty()) return;
    const auto n = static_cast<double>(error.size());
    out.push_back({outcome, lack_of_fit(error, condition), std::sqrt(variance / n)});
  };
  const auto landing = [](int quantity, double unit) {
    return [=](const PredictedOutcome& t) {
      const auto& e = t.error[static_cast<std::size_t>(quantity)];
      return e ? Error{{*e * unit, 0}} : Error{};
    };
  };
  add(Outcome::position, [](const PredictedOutcome& t) {
    return t.flight ? Error{{(*t.flight)[0], (*t.flight)[1]}} : Error{};
  });
  add(Outcome::orientation, [](const PredictedOutcome& t) {
    return t.flight ? Error{{(*t.flight)[2], 0}} : Error{};
  });
  add(Outcome::landing_x, landing(kLandingX, 1));
  add(Outcome::landing_theta, landing(kLandingTheta, 1 / experiment::kDegrees));
  return out;
}

}  // namespace

std::vector<PredictedOutcome> predicted_outcomes(const CampaignProblem& problem, const FitResult& fit,
                                                 Share share, int threads) {
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < problem.throws().size(); ++i)
    if (takes(share, problem.throws()[i].prepared.split)) which.push_back(i);
  const auto predicted = predict_some(problem, fit, which, {false, threads});
  const auto campaign = fit.values();
  std::map<std::string, int> conditions;
  std::vector<PredictedOutcome> out(which.size());
  for (std::size_t k = 0; k < which.size(); ++k)
    out[k].condition = conditions
                           .try_emplace(problem.throws()[which[k]].prepared.experiment(),
                                        static_cast<int>(conditions.size()))
                           .first->second;
  dynamics::parallel_for(which.size(), threads, [&](std::size_t k) {
    std::copy(std::begin(predicted[k].comparison.error), std::end(predicted[k].comparison.error),
              out[k].error.begin());
    follow_flight(problem, problem.throws()[which[k]], campaign, predicted[k], out[k]);
  });
  return out;
}

OutcomeErrors outcome_errors(const std::vector<PredictedOutcome>& throws) {
  OutcomeErrors out;
  double square = 0, n = 0, counts[experiment::kQuantityCount] = {}, sums[experiment::kQuantityCount] = {};
  for (const PredictedOutcome& thrown : throws) {
    square += thrown.squares;
    n += thrown.samples;
    bool any = false;
    for (std::size_t q = 0; q < thrown.error.size(); ++q)
      if (const auto& error = thrown.error[q]) {
        counts[q] += 1;
        sums[q] += std::abs(*error);
        any = true;
      }
    out.n += any ? 1 : 0;
  }
  const auto mean = [&](int q) { return counts[q] > 0 ? std::optional(sums[q] / counts[q]) : std::nullopt; };
  out.detach_vx_mae = mean(0);
  out.detach_omega_mae = mean(1);
  out.landing_x_mae = mean(kLandingX);
  out.landing_theta_mae = mean(kLandingTheta);
  if (n > 0) out.trajectory_rms = std::sqrt(square / n);
  out.lacks = lacks(throws);
  return out;
}

PredictionGain prediction_gain(const std::vector<PredictedOutcome>& before,
                               const std::vector<PredictedOutcome>& after) {
  // Of what was tracked in flight, or, where no throw's was, of the landing.
  const auto rms = [&](double PredictedOutcome::*samples, double PredictedOutcome::*squares, int landing,
                       double unit) -> RmsOfBoth {
    const bool tracked =
        std::any_of(before.begin(), before.end(), [&](const PredictedOutcome& t) { return t.*samples > 0; });
    const auto square_of = [&](const PredictedOutcome& t) -> std::optional<double> {
      if (tracked) return t.*samples > 0 ? std::optional(t.*squares / (t.*samples)) : std::nullopt;
      const auto& error = t.error[static_cast<std::size_t>(landing)];
      return error ? std::optional(*error * unit * *error * unit) : std::nullopt;
    };
    double n = 0, sum_before = 0, sum_after = 0;
    for (std::size_t k = 0; k < before.size(); ++k) {
      const auto was = square_of(before[k]), is = square_of(after[k]);
      if (was && is) n += 1, sum_before += *was, sum_after += *is;
    }
    if (!(n > 0)) return {};
    return {std::sqrt(sum_before / n), std::sqrt(sum_after / n)};
  };
  return {rms(&PredictedOutcome::samples, &PredictedOutcome::squares, kLandingX, 1),
          rms(&PredictedOutcome::angles, &PredictedOutcome::angle_squares, kLandingTheta,
              1 / experiment::kDegrees)};
}

}  // namespace unhand::fitting
