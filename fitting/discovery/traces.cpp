#include "fitting/discovery/traces.hpp"

#include <algorithm>
#include <cmath>

#include "fitting/discovery/residuals.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

/// Which of three channels that follow `first` an observation is of; others are outside 0 to 2.
int component_of(const experiment::Observation& o, Channel first) {
  return static_cast<int>(o.channel) - static_cast<int>(first);
}

/// The residual (observed minus predicted, SI units) of three channels that follow each other, in one phase.
ResidualTrace trace_of(const CampaignThrow& thrown, const Eigen::VectorXd& residual, double release,
                       Channel first, Phase phase) {
  ResidualTrace out;
  const StateSeries states = states_of(thrown, residual, MotionOf::measurement);
  const auto [origin, scale] = phase_clock(thrown, release, phase);
  for (std::size_t j = 0; j < thrown.observed.all.size(); ++j) {
    const auto& o = thrown.observed.all[j];
    const int component = component_of(o, first);
    if (component < 0 || component > 2 || phase_of(o, thrown.opening, release) != phase) continue;
    const double time = (o.time - origin) / scale;
    if (out.time.empty() || time != out.time.back()) {
      out.time.push_back(time);
      out.state.push_back(states.at(thrown, o.time));
      for (auto& r : out.residual) r.push_back(NAN);
      for (auto& s : out.sigma) s.push_back(1);
    }
    const auto c = static_cast<std::size_t>(component);
    out.residual[c].back() = -residual[static_cast<Eigen::Index>(j)] * o.sigma;
    out.sigma[c].back() = o.sigma;
  }
  return out;
}

}  // namespace

PhaseClock phase_clock(const CampaignThrow& thrown, double release, Phase phase) {
  if (phase == Phase::flight) return {release, 1};
  return {thrown.opening, std::max(1e-6, release - thrown.opening)};
}

std::map<int, std::string> PhaseTraces::names() const {
  std::map<int, std::string> out;
  for (const auto& [object, group] : objects) out.emplace(group, object);
  return out;
}

PhaseTraces traces_of(const CampaignProblem& problem, const FitResult& fit, Phase phase, int threads) {
  const Channel first = phase == Phase::flight ? Channel::mocap_x : Channel::wrench_fx;
  PhaseTraces out;
  out.how.response = phase == Phase::flight ? Response::twice_integrated : Response::direct;
  for (const auto& thrown : problem.throws())
    out.objects.try_emplace(thrown.prepared.object, static_cast<int>(out.objects.size()));
  const auto residuals = residuals_of(problem, fit, threads);
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (residuals[i].size() == 0) continue;
    const CampaignThrow& thrown = problem.throws()[i];
    ResidualTrace trace =
        trace_of(thrown, residuals[i], thrown.release_or(fit.throws[i].detach), first, phase);
    if (trace.time.size() < 4) continue;
    trace.group = out.objects.at(thrown.prepared.object);
    out.all.push_back(std::move(trace));
  }
  return out;
}

}  // namespace unhand::fitting
