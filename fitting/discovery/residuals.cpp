#include "fitting/discovery/residuals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "dynamics/parallel.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

double normal_force(const CampaignThrow& thrown, double t) {
  if (!thrown.prepared.normal_force) return NAN;
  const double inf = std::numeric_limits<double>::infinity();
  return thrown.prepared.normal_force->at(dynamics::Window{-inf, inf}, t);
}

}  // namespace

std::vector<Eigen::VectorXd> residuals_of(const CampaignProblem& problem, const FitResult& fit, int threads) {
  const auto& throws = problem.throws();
  std::vector<Eigen::VectorXd> out(throws.size());
  dynamics::parallel_for(throws.size(), threads, [&](std::size_t i) {
    if (!fit.throws[i].used) return;
    auto l = problem.linearise(throws[i], fit.values(), fit.throws[i].own, DerivativesBy::nothing);
    if (l.solved) out[i] = std::move(l.residual);
  });
  return out;
}

std::vector<ResidualBin> residual_over_time(const CampaignProblem& problem, const FitResult& fit,
                                            const std::vector<Eigen::VectorXd>& residuals) {
  std::map<std::pair<int, int>, ResidualBin> bins;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const CampaignThrow& thrown = problem.throws()[i];
    const double release = thrown.release_or(fit.throws[i].detach);
    for (Eigen::Index j = 0; j < residuals[i].size(); ++j) {
      const auto& o = thrown.observed.all[static_cast<std::size_t>(j)];
      if (phase_of(o, thrown.opening, release) == Phase::landing) continue;
      const double since = o.time - release;
      const int bin = since < 0.05 ? static_cast<int>(std::floor(since / 0.005))
                                   : 10 + static_cast<int>((since - 0.05) / 0.02);
      auto& b = bins[{static_cast<int>(o.channel), bin}];
      b.channel = o.channel;
      b.time = bin < 10 ? 0.005 * (bin + 0.5) : 0.05 + 0.02 * (bin - 10 + 0.5);
      const double r = residuals[i][j];
      b.n += 1, b.mean += r, b.rms += r * r;
    }
  }
  std::vector<ResidualBin> out;
  for (auto& [key, b] : bins) {
    b.mean /= b.n;
    b.rms = std::sqrt(b.rms / b.n);
    out.push_back(b);
  }
  return out;
}

namespace {

/// The value at `k` of the line through the eleven samples around it.
double smoothed(const std::vector<double>& time, const std::vector<std::array<double, 3>>& value,
                std::size_t component, std::size_t k) {
  constexpr std::size_t kHalf = 5;
  const std::size_t begin = k > kHalf ? k - kHalf : 0, end = std::min(time.size(), k + kHalf + 1);
  double n = 0, t = 0, x = 0, tt = 0, tx = 0;
  for (std::size_t i = begin; i < end; ++i) {
    const double dt = time[i] - time[k], v = value[i][component];
    n += 1, t += dt, x += v, tt += dt * dt, tx += dt * v;
  }
  const double spread = n * tt - t * t;
  return spread > 0 ? (tt * x - t * tx) / spread : x / n;
}

}  // namespace

StateSeries states_of(const CampaignThrow& thrown, const Eigen::VectorXd& residual, MotionOf motion) {
  StateSeries out;
  const auto& all = thrown.observed.all;
  std::vector<std::array<double, 3>> error;
  for (std::size_t i = 0; i + 2 < all.size(); ++i) {
    if (all[i].channel != Channel::mocap_x) continue;
    out.time.push_back(all[i].time);
    auto& e = error.emplace_back();
    auto& predicted = out.pose.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) {
      e[c] = residual[static_cast<Eigen::Index>(i + c)] * all[i + c].sigma;
      predicted[c] = all[i + c].value + e[c];
    }
  }
  if (motion == MotionOf::measurement)
    for (std::size_t k = 0; k < out.time.size(); ++k)
      for (std::size_t c = 0; c < 3; ++c) out.pose[k][c] -= smoothed(out.time, error, c, k);
  const std::size_t n = out.time.size();
  if (n < 2) return {};
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t a = k == 0 ? 0 : k - 1, b = std::min(k + 1, n - 1);
    const double h = out.time[b] - out.time[a];
    out.state.push_back({(out.pose[b][0] - out.pose[a][0]) / h, (out.pose[b][1] - out.pose[a][1]) / h,
                         (out.pose[b][2] - out.pose[a][2]) / h, out.pose[k][2],
                         normal_force(thrown, out.time[k])});
  }
  return out;
}

ResidualTrace::State StateSeries::at(const CampaignThrow& thrown, double t) const {
  if (time.empty()) return {NAN, NAN, NAN, NAN, normal_force(thrown, t)};
  const auto after = std::lower_bound(time.begin(), time.end(), t);
  const std::size_t b =
      std::min<std::size_t>(static_cast<std::size_t>(after - time.begin()), time.size() - 1);
  const std::size_t a = b == 0 ? 0 : b - 1;
  const double s = b == a ? 0 : std::clamp((t - time[a]) / (time[b] - time[a]), 0.0, 1.0);
  const auto mix = [&](double x, double y) { return x + s * (y - x); };
  return {mix(state[a].vx, state[b].vx), mix(state[a].vz, state[b].vz), mix(state[a].omega, state[b].omega),
          mix(state[a].theta, state[b].theta), normal_force(thrown, t)};
}

std::vector<ChannelStructure> structures(const CampaignProblem& problem, const FitResult& fit,
                                         const std::vector<Eigen::VectorXd>& residuals) {
  std::map<std::pair<Phase, Channel>, ResidualSamples> groups;
  std::map<std::string, int> conditions;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (residuals[i].size() == 0) continue;
    const CampaignThrow& thrown = problem.throws()[i];
    const double release = thrown.release_or(fit.throws[i].detach);
    const StateSeries states = states_of(thrown, residuals[i], MotionOf::model);
    const int condition =
        conditions.try_emplace(thrown.prepared.experiment(), static_cast<int>(conditions.size()))
            .first->second;
    for (std::size_t j = 0; j < thrown.observed.all.size(); ++j) {
      const auto& o = thrown.observed.all[j];
      ResidualSamples& of = groups[{phase_of(o, thrown.opening, release), o.channel}];
      if (of.states.empty()) of.states = {{"speed", {}}, {"spin", {}}, {"normal force", {}}};
      const auto state = states.at(thrown, o.time);
      of.value.push_back(residuals[i][static_cast<Eigen::Index>(j)]);
      of.time.push_back(o.time - release);
      of.series.push_back(static_cast<int>(i));
      of.condition.push_back(condition);
      of.states[0].value.push_back(std::hypot(state.vx, state.vz));
      of.states[1].value.push_back(state.omega);
      of.states[2].value.push_back(o.time < release ? state.normal_force : NAN);
    }
  }
  std::vector<ChannelStructure> out;
  for (const auto& [key, samples] : groups) out.push_back({key.second, key.first, find_structure(samples)});
  return out;
}

}  // namespace unhand::fitting
