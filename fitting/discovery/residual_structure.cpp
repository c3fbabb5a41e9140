#include "fitting/discovery/residual_structure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "fitting/distributions.hpp"

namespace unhand::fitting {

namespace {

/// One-way analysis of variance: witnesses in groups.
Dependence analyse(std::string on, const std::vector<double>& value, const std::vector<int>& group) {
  struct Group {
    double n{}, sum{};
  };
  std::map<int, Group> groups;
  double total = 0, squares = 0;
  const auto n = static_cast<double>(value.size());
  for (std::size_t i = 0; i < value.size(); ++i) {
    groups[group[i]].n += 1, groups[group[i]].sum += value[i];
    total += value[i], squares += value[i] * value[i];
  }
  Dependence out{std::move(on), 0, 1};
  const auto k = static_cast<double>(groups.size());
  if (k < 2 || n - k < 2 || !(squares > 0)) return out;
  double between = -total * total / n;
  for (const auto& [id, g] : groups) between += g.sum * g.sum / g.n;
  const double within = std::max(squares - total * total / n - between, 1e-12 * squares);
  const double noise = within / (n - k);
  out.p_value = f_tail(between / (k - 1) / noise, k - 1, n - k);
  out.share = std::max(0.0, between - (k - 1) * noise) / squares;
  return out;
}

/// The number of the group of equal count that each value falls in.
std::vector<int> quantile_groups(const std::vector<double>& value, int groups) {
  std::vector<std::size_t> order(value.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return value[a] < value[b]; });
  std::vector<int> out(value.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    out[order[i]] = static_cast<int>(i * static_cast<std::size_t>(groups) / order.size());
  return out;
}

Dependence over_groups(const std::string& on, const std::vector<double>& residual,
                       const std::vector<double>& variable, int groups) {
  std::vector<double> r, x;
  for (std::size_t i = 0; i < residual.size(); ++i)
    if (std::isfinite(variable[i])) r.push_back(residual[i]), x.push_back(variable[i]);
  if (r.size() < 4) return {on, 0, 1};
  const auto [low, high] = std::minmax_element(x.begin(), x.end());
  if (!(*high - *low > 1e-9 * std::max(std::abs(*high), std::abs(*low)))) return {on, 0, 1};
  const int most = static_cast<int>(r.size()) / 4;
  return analyse(on, r, quantile_groups(x, std::clamp(groups, 2, std::max(2, most))));
}

Dependence over_conditions(const ResidualSamples& samples) {
  struct Series {
    double n{}, sum{};
    int condition{};
  };
  std::map<int, Series> series;
  for (std::size_t i = 0; i < samples.value.size(); ++i) {
    Series& s = series[samples.series[i]];
    s.n += 1, s.sum += samples.value[i], s.condition = samples.condition[i];
  }
  std::vector<double> mean;
  std::vector<int> condition;
  for (const auto& [id, s] : series) mean.push_back(s.sum / s.n), condition.push_back(s.condition);
  Dependence out = analyse("condition", mean, condition);
  // As a share of the residual's mean square, not of its means'.
  double squares = 0, of_means = 0;
  for (const double r : samples.value) squares += r * r;
  for (const auto& [id, s] : series) of_means += s.sum * s.sum / s.n;
  if (squares > 0) out.share *= of_means / squares;
  return out;
}

}  // namespace

double ResidualStructure::p_value() const {
  double least = std::min(chi2_p_value, autocorrelation_p);
  for (const Dependence& d : depends) least = std::min(least, d.p_value);
  return std::min(1.0, least * static_cast<double>(2 + depends.size()));
}

std::string ResidualStructure::in_words() const {
  const StructureOptions limits;
  std::string out = fmt::format("{:.3g} times the variance of the noise", chi2_per_sample);
  if (autocorrelation_p < limits.level)
    out += fmt::format(", neighbours correlate by {:.2f}", autocorrelation);
  std::string with;
  for (const Dependence& d : depends)
    if (d.p_value < limits.level && d.share > limits.share)
      with += fmt::format("{}{} ({:.0f} %)", with.empty() ? "" : ", ", d.on, 100 * d.share);
  if (!with.empty()) out += "; goes with " + with;
  return out;
}

ResidualStructure find_structure(const ResidualSamples& samples, const StructureOptions& options) {
  ResidualStructure out;
  out.n = static_cast<int>(samples.value.size());
  if (out.n == 0) return out;
  double squares = 0, products = 0, pairs = 0, of_former = 0, of_latter = 0;
  for (std::size_t i = 0; i < samples.value.size(); ++i) {
    squares += samples.value[i] * samples.value[i];
    if (i == 0 || samples.series[i] != samples.series[i - 1]) continue;
    products += samples.value[i] * samples.value[i - 1];
    of_former += samples.value[i - 1] * samples.value[i - 1];
    of_latter += samples.value[i] * samples.value[i];
    pairs += 1;
  }
  out.chi2_per_sample = squares / out.n;
  out.chi2_p_value = chi2_tail(squares, out.n);
  if (of_former > 0 && of_latter > 0) {
    out.autocorrelation = products / std::sqrt(of_former * of_latter);
    out.autocorrelation_p = normal_two_sided(out.autocorrelation * std::sqrt(pairs));
  }
  out.depends.push_back(over_conditions(samples));
  out.depends.push_back(over_groups("time", samples.value, samples.time, options.groups));
  for (const auto& state : samples.states)
    out.depends.push_back(over_groups(state.name, samples.value, state.value, options.groups));
  std::stable_sort(out.depends.begin(), out.depends.end(), [](const Dependence& a, const Dependence& b) {
    return a.p_value != b.p_value ? a.p_value < b.p_value : a.share > b.share;
  });
  return out;
}

}  // namespace unhand::fitting
