#include "fitting/discovery/outcome_errors.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "experiment/parallel.hpp"
#include "fitting/evaluate.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

/// Throws as predicted, and for each the squares of the position's errors in flight.
struct Predicted {
  std::vector<PredictedThrow> throws;
  std::vector<double> squares, samples;  ///< Σ (Δx² + Δz²) [m²], and how many
};

Predicted predicted(const CampaignProblem& problem, const FitResult& fit, Share share, int threads) {
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < problem.throws().size(); ++i)
    if (share == Share::all ||
        (share == Share::train) == (problem.throws()[i].prepared.split == datasets::Split::train))
      which.push_back(i);
  Predicted out{predict_some(problem, fit, which, {false, threads}), std::vector<double>(which.size(), 0),
                std::vector<double>(which.size(), 0)};
  const auto campaign = fit.values();
  experiment::parallel_for(which.size(), threads, [&](std::size_t k) {
    const CampaignThrow& thrown = problem.throws()[which[k]];
    const auto channels = problem.predict(thrown, campaign, out.throws[k].own).channels;
    for (std::size_t j = 0; j < channels.size(); ++j) {
      const auto& o = thrown.observed.all[j];
      const double detach = thrown.release_or(out.throws[k].comparison.prediction.detach.time);
      if (phase_of(o, thrown.opening, detach) != Phase::flight) continue;
      if (o.channel != Channel::mocap_x && o.channel != Channel::mocap_z) continue;
      out.squares[k] += (channels[j] - o.value) * (channels[j] - o.value);
      if (o.channel == Channel::mocap_x) out.samples[k] += 1;
    }
  });
  return out;
}

constexpr int kLandingX = 2;  // of kQuantities

}  // namespace

OutcomeErrors outcome_errors(const CampaignProblem& problem, const FitResult& fit, Share share, int threads) {
  const Predicted of = predicted(problem, fit, share, threads);
  OutcomeErrors out;
  double square = 0, n = 0, counts[experiment::kQuantityCount] = {}, sums[experiment::kQuantityCount] = {};
  for (std::size_t k = 0; k < of.throws.size(); ++k) {
    square += of.squares[k];
    n += of.samples[k];
    bool any = false;
    for (int q = 0; q < experiment::kQuantityCount; ++q)
      if (const auto& error = of.throws[k].comparison.error[q]) {
        counts[q] += 1;
        sums[q] += std::abs(*error);
        any = true;
      }
    out.n += any ? 1 : 0;
  }
  const auto mean = [&](int q) { return counts[q] > 0 ? sums[q] / counts[q] : 0.0; };
  out.detach_vx_mae = mean(0);
  out.detach_omega_mae = mean(1);
  out.landing_x_mae = mean(kLandingX);
  out.landing_theta_mae = mean(3);
  out.trajectory_rms = n > 0 ? std::sqrt(square / n) : 0;
  return out;
}

PredictionGain prediction_gain(const CampaignProblem& problem, const FitResult& fit,
                               const CampaignProblem& other, const FitResult& other_fit, Share share,
                               int threads) {
  const Predicted a = predicted(problem, fit, share, threads),
                  b = predicted(other, other_fit, share, threads);
  const bool tracked = std::any_of(a.samples.begin(), a.samples.end(), [](double n) { return n > 0; });
  const auto square_of = [&](const Predicted& of, std::size_t k) -> std::optional<double> {
    if (tracked) return of.samples[k] > 0 ? std::optional(of.squares[k] / of.samples[k]) : std::nullopt;
    const auto& error = of.throws[k].comparison.error[kLandingX];
    return error ? std::optional(*error * *error) : std::nullopt;
  };
  double n = 0, before = 0, after = 0;
  for (std::size_t k = 0; k < a.throws.size(); ++k) {
    const auto was = square_of(a, k), is = square_of(b, k);
    if (was && is) n += 1, before += *was, after += *is;
  }
  if (!(n > 0)) return {};
  return {std::sqrt(before / n), std::sqrt(after / n)};
}

}  // namespace unhand::fitting
