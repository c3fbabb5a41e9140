#include "fitting/outcome_errors.hpp"

#include <cmath>
#include <vector>

#include "experiment/parallel.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

constexpr double kDegrees = 57.29577951308232;

/// Slope over time, and the sum of squares.
struct Line {
  double n{}, t{}, y{}, tt{}, ty{}, yy{};
  void add(double time, double value) {
    n += 1, t += time, y += value, tt += time * time, ty += time * value, yy += value * value;
  }
  double slope() const {
    const double spread = tt - t * t / n;
    return n > 2 && spread > 0 ? (ty - t * y / n) / spread : NAN;
  }
};

struct Errors {
  double landing_x{NAN}, landing_theta{NAN}, vx{NAN}, omega{NAN}, squares{}, samples{};
};

}  // namespace

OutcomeErrors outcome_errors(const CampaignProblem& problem, const FitResult& fit, Share share, int threads) {
  const auto& throws = problem.throws();
  std::vector<Errors> errors(throws.size());
  const auto campaign = fit.values();
  experiment::parallel_for(throws.size(), threads, [&](std::size_t i) {
    const CampaignThrow& thrown = throws[i];
    if (share != Share::all && (share == Share::train) != (thrown.prepared.split == datasets::Split::train))
      return;
    const auto predicted = problem.predict(thrown, campaign, own_before_release(problem, thrown, fit));
    if (predicted.channels.size() != thrown.observed.all.size() || !predicted.landed()) return;
    Line x, theta;
    Errors& out = errors[i];
    const double release = thrown.release_or(predicted.detach.time);
    for (std::size_t j = 0; j < thrown.observed.all.size(); ++j) {
      const auto& o = thrown.observed.all[j];
      const double error = predicted.channels[j] - o.value;
      if (o.channel == Channel::landing_x) out.landing_x = error;
      if (o.channel == Channel::landing_theta) out.landing_theta = error * kDegrees;
      if (phase_of(o, thrown.opening, release) != Phase::flight) continue;
      if (o.channel == Channel::mocap_x) x.add(o.time - release, error);
      if (o.channel == Channel::mocap_theta) theta.add(o.time - release, error);
      if (o.channel == Channel::mocap_x || o.channel == Channel::mocap_z) out.squares += error * error;
      if (o.channel == Channel::mocap_x) out.samples += 1;
    }
    if (x.n > 2) out.vx = x.slope();
    if (theta.n > 2) out.omega = theta.slope() * kDegrees;
  });
  OutcomeErrors out;
  double n[4] = {}, sums[4] = {}, squares = 0, samples = 0;
  for (const auto& e : errors) {
    const double values[4] = {e.landing_x, e.landing_theta, e.vx, e.omega};
    bool any = false;
    for (int k = 0; k < 4; ++k)
      if (std::isfinite(values[k])) {
        n[k] += 1;
        sums[k] += std::abs(values[k]);
        any = true;
      }
    out.n += any ? 1 : 0;
    squares += e.squares;
    samples += e.samples;
  }
  const auto mean = [&](int k) { return n[k] > 0 ? sums[k] / n[k] : 0.0; };
  out.landing_x_mae = mean(0);
  out.landing_theta_mae = mean(1);
  out.detach_vx_mae = mean(2);
  out.detach_omega_mae = mean(3);
  out.trajectory_rms = samples > 0 ? std::sqrt(squares / samples) : 0;
  return out;
}

}  // namespace unhand::fitting
