#include "fitting/measured/residual_tests.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "dynamics/parallel.hpp"

namespace unhand::fitting {

using Eigen::Index;

std::vector<Autocorrelation> autocorrelation(const GroupedProblem& problem, const GroupedFit& fit) {
  const std::size_t channels = problem.channels().size();
  std::vector<double> products(channels), expected(channels), squares(channels), kept(channels),
      pairs(channels);
  const auto names = fit.names();
  const std::vector<double> values(fit.values.data(), fit.values.data() + fit.values.size());
  GroupedWeights plain = fit.weights;
  for (double& scale : plain.channel_scale) scale = 1e6;
  for (const std::size_t i : fit.solved_groups()) {
    const auto e = projected(problem, i, names, values, fit.groups[i].own, plain, 6);
    if (!e.solved) continue;
    const auto& rows = problem.groups()[i].rows;
    const Eigen::VectorXd& r = fit.groups[i].residual;
    std::map<int, std::size_t> last;
    for (std::size_t j = 0; j < rows.size(); ++j) {
      const int channel = rows[j].channel;
      if (channel < 0) continue;
      const auto c = static_cast<std::size_t>(channel);
      const auto at = static_cast<Index>(j);
      squares[c] += r[at] * r[at];
      kept[c] += 1 - e.own_basis.row(at).squaredNorm();
      if (const auto before = last.find(channel); before != last.end()) {
        const auto from = static_cast<Index>(before->second);
        products[c] += r[from] * r[at];
        expected[c] -= e.own_basis.row(from).dot(e.own_basis.row(at));
        pairs[c] += 1;
      }
      last[channel] = j;
    }
  }
  std::vector<Autocorrelation> out;
  for (std::size_t c = 0; c < channels; ++c) {
    if (!(pairs[c] > 1) || !(squares[c] > 0) || !(kept[c] > 0)) continue;
    const double variance = squares[c] / kept[c], excess = products[c] - variance * expected[c];
    out.push_back(
        {problem.channels()[c], excess / (variance * pairs[c]), excess / (variance * std::sqrt(pairs[c]))});
  }
  return out;
}

std::vector<ResidualProfile> residual_profile(const GroupedProblem& problem, const GroupedFit& fit,
                                              int bins) {
  struct Bin {
    double n{}, sum{}, squares{}, groups{}, group_squares{};
  };
  std::vector<Bin> all(problem.channels().size() * static_cast<std::size_t>(bins));
  for (const std::size_t i : fit.solved_groups()) {
    const auto& rows = problem.groups()[i].rows;
    double longest = 0;
    for (const auto& row : rows) longest = std::max(longest, row.time);
    std::map<std::size_t, double> own;
    for (std::size_t j = 0; j < rows.size(); ++j) {
      if (rows[j].channel < 0 || !(longest > 0)) continue;
      const auto bin = std::min(static_cast<std::size_t>(bins) - 1,
                                static_cast<std::size_t>(rows[j].time / longest * bins));
      const std::size_t at = static_cast<std::size_t>(rows[j].channel) * static_cast<std::size_t>(bins) + bin;
      const double r = fit.groups[i].residual[static_cast<Index>(j)];
      all[at].n += 1, all[at].sum += r, all[at].squares += r * r;
      own[at] += r;
    }
    for (const auto& [at, sum] : own) all[at].groups += 1, all[at].group_squares += sum * sum;
  }
  std::vector<ResidualProfile> out;
  for (std::size_t at = 0; at < all.size(); ++at) {
    const Bin& b = all[at];
    if (!(b.n > 0)) continue;
    const double variance =
        b.groups > 1 ? (b.group_squares - b.sum * b.sum / b.groups) * b.groups / (b.groups - 1) : 0;
    out.push_back({problem.channels()[at / static_cast<std::size_t>(bins)],
                   (static_cast<double>(at % static_cast<std::size_t>(bins)) + 0.5) / bins,
                   static_cast<int>(b.n), b.sum / b.n, std::sqrt(b.squares / b.n),
                   variance > 0 ? b.sum / std::sqrt(variance) : 0});
  }
  return out;
}

LeavesNoise leaves_noise(const GroupedProblem& problem, const GroupedFit& fit, double limit, int threads) {
  constexpr std::size_t kMostGroups = 100;  // evenly spaced ones say it as well
  constexpr std::array kShares{0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0};
  auto used = fit.solved_groups();
  if (used.size() > kMostGroups) {
    std::vector<std::size_t> some;
    for (std::size_t k = 0; k < kMostGroups; ++k) some.push_back(used[k * used.size() / kMostGroups]);
    used = some;
  }
  std::vector<double> durations;
  for (const std::size_t i : used) {
    double last = 0;
    for (const auto& row : problem.groups()[i].rows) last = std::max(last, row.time);
    durations.push_back(last);
  }
  LeavesNoise out;
  if (durations.empty()) return out;
  std::sort(durations.begin(), durations.end());
  const double longest = durations[durations.size() * 9 / 10];
  const std::size_t channels = problem.channels().size();
  for (const double share : kShares) {
    const double until = share * longest;
    std::vector<std::vector<double>> ratios(used.size());  // χ² per degree of freedom by channel, or NaN
    dynamics::parallel_for(used.size(), threads, [&](std::size_t k) {
      const auto& group = problem.groups()[used[k]];
      std::vector<double> n(channels), chi2(channels);
      double rows = 0;
      for (const auto& row : group.rows)
        if (row.channel >= 0 && row.time <= until) n[static_cast<std::size_t>(row.channel)] += 1, rows += 1;
      ratios[k].assign(channels, std::numeric_limits<double>::quiet_NaN());
      if (rows < 1.5 * static_cast<double>(group.start.size())) return;
      const auto part =
          fit_own_part(problem, used[k], fit, [&](const GroupRow& row) { return row.time <= until; });
      if (!part.solved) return;
      for (std::size_t j = 0; j < group.rows.size(); ++j)
        if (const auto& row = group.rows[j]; row.channel >= 0 && row.time <= until)
          chi2[static_cast<std::size_t>(row.channel)] += std::pow(part.residual[static_cast<Index>(j)], 2);
      for (std::size_t c = 0; c < channels; ++c)
        if (n[c] > 0)
          ratios[k][c] = chi2[c] / (n[c] * (1 - group.taken() / rows));  // shared evenly by the channels
    });
    for (std::size_t c = 0; c < channels; ++c) {
      double n = 0, sum = 0, squares = 0;
      for (const auto& r : ratios)
        if (std::isfinite(r[c])) n += 1, sum += r[c], squares += r[c] * r[c];
      if (n < 5) continue;
      const double mean = sum / n, error = std::sqrt(std::max(0.0, squares / n - mean * mean) / (n - 1));
      if (mean < limit || mean < 1 + 3 * error || mean <= out.chi2_per_dof) continue;
      out = {true, until, problem.channels()[c], mean, share == kShares.front()};
    }
    if (out.any) break;
  }
  return out;
}

}  // namespace unhand::fitting
