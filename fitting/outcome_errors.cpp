#include "fitting/outcome_errors.hpp"

#include <cmath>
#include <vector>

#include "experiment/parallel.hpp"
#include "fitting/evaluate.hpp"

namespace unhand::fitting {

using experiment::Channel;

OutcomeErrors outcome_errors(const CampaignProblem& problem, const FitResult& fit, Share share, int threads) {
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < problem.throws().size(); ++i)
    if (share == Share::all ||
        (share == Share::train) == (problem.throws()[i].prepared.split == datasets::Split::train))
      which.push_back(i);
  const auto predicted = predict_some(problem, fit, which, {false, threads});

  // The position in flight, all samples of all throws together.
  std::vector<double> squares(which.size(), 0), samples(which.size(), 0);
  const auto campaign = fit.values();
  experiment::parallel_for(which.size(), threads, [&](std::size_t k) {
    const CampaignThrow& thrown = problem.throws()[which[k]];
    const auto channels = problem.predict(thrown, campaign, predicted[k].own).channels;
    for (std::size_t j = 0; j < channels.size(); ++j) {
      const auto& o = thrown.observed.all[j];
      const double detach = thrown.release_or(predicted[k].comparison.prediction.detach.time);
      if (phase_of(o, thrown.opening, detach) != Phase::flight) continue;
      if (o.channel != Channel::mocap_x && o.channel != Channel::mocap_z) continue;
      squares[k] += (channels[j] - o.value) * (channels[j] - o.value);
      if (o.channel == Channel::mocap_x) samples[k] += 1;
    }
  });

  OutcomeErrors out;
  double square = 0, n = 0, counts[experiment::kQuantityCount] = {}, sums[experiment::kQuantityCount] = {};
  for (std::size_t k = 0; k < which.size(); ++k) {
    square += squares[k];
    n += samples[k];
    bool any = false;
    for (int q = 0; q < experiment::kQuantityCount; ++q)
      if (const auto& error = predicted[k].comparison.error[q]) {
        counts[q] += 1;
        sums[q] += std::abs(*error);
        any = true;
      }
    out.n += any ? 1 : 0;
  }
  const auto mean = [&](int q) { return counts[q] > 0 ? sums[q] / counts[q] : 0.0; };
  out.detach_vx_mae = mean(0);
  out.detach_omega_mae = mean(1);
  out.landing_x_mae = mean(2);
  out.landing_theta_mae = mean(3);
  out.trajectory_rms = n > 0 ? std::sqrt(square / n) : 0;
  return out;
}

}  // namespace unhand::fitting
