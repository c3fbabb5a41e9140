#include "fitting/discovery/residual_structure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "fitting/discovery/order_trend.hpp"
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

/// Whether conditions, rather than recordings, are the witnesses of what all of them share: repetitions of a
/// condition err alike where the model fails there. Too few cannot say how much they scatter.
bool are_witnesses(const std::map<int, int>& recordings_of) {
  constexpr std::size_t kFewest = 4;
  return recordings_of.size() >= kFewest &&
         std::any_of(recordings_of.begin(), recordings_of.end(), [](const auto& c) { return c.second > 1; });
}

/// The witness that each sample belongs to.
std::vector<int> witnesses(const ResidualSamples& samples) {
  std::map<int, int> condition_of, recordings_of;
  for (std::size_t i = 0; i < samples.value.size(); ++i)
    condition_of.try_emplace(samples.series[i], samples.condition[i]);
  for (const auto& [series, condition] : condition_of) ++recordings_of[condition];
  return are_witnesses(recordings_of) ? samples.condition : samples.series;
}

/// The samples of a witness in a group count once, their mean: neighbours may err alike.
Dependence over_groups(const std::string& on, const ResidualSamples& samples,
                       const std::vector<double>& variable, const std::vector<int>& of, int groups) {
  std::vector<double> r, x;
  std::vector<int> witness;
  for (std::size_t i = 0; i < samples.value.size(); ++i)
    if (std::isfinite(variable[i]))
      r.push_back(samples.value[i]), x.push_back(variable[i]), witness.push_back(of[i]);
  if (r.size() < 4) return {on, 0, 1};
  const auto [low, high] = std::minmax_element(x.begin(), x.end());
  if (!(*high - *low > 1e-9 * std::max(std::abs(*high), std::abs(*low)))) return {on, 0, 1};
  const int most = static_cast<int>(r.size()) / 4;
  const auto group = quantile_groups(x, std::clamp(groups, 2, std::max(2, most)));
  struct Cell {
    double n{}, sum{};
  };
  std::map<std::pair<int, int>, Cell> cells;  // by witness and group
  double squares = 0;
  for (std::size_t i = 0; i < r.size(); ++i) {
    Cell& cell = cells[{witness[i], group[i]}];
    cell.n += 1, cell.sum += r[i], squares += r[i] * r[i];
  }
  std::vector<double> mean;
  std::vector<int> in;
  double of_means = 0;
  for (const auto& [where, cell] : cells) {
    mean.push_back(cell.sum / cell.n), in.push_back(where.second);
    of_means += cell.sum * cell.sum / cell.n;
  }
  Dependence out = analyse(on, mean, in);
  if (squares > 0) out.share *= of_means / squares;
  return out;
}

/// A recording's samples: as a witness, its mean.
struct SeriesMean {
  double n{}, sum{};
  int condition{};
  double mean() const { return sum / n; }
};

std::map<int, SeriesMean> means_of(const ResidualSamples& samples, const std::vector<int>& of) {
  std::map<int, SeriesMean> out;
  for (std::size_t i = 0; i < samples.value.size(); ++i) {
    SeriesMean& s = out[of[i]];
    s.n += 1, s.sum += samples.value[i], s.condition = samples.condition[i];
  }
  return out;
}

Dependence over_conditions(const std::map<int, SeriesMean>& series, double squares) {
  std::vector<double> mean;
  std::vector<int> condition;
  double of_means = 0;
  for (const auto& [id, s] : series) {
    mean.push_back(s.mean()), condition.push_back(s.condition);
    of_means += s.sum * s.mean();
  }
  Dependence out = analyse("condition", mean, condition);
  if (squares > 0) out.share *= of_means / squares;  // of the residual's mean square, not of its means'
  return out;
}

/// Over the number of the recording, which is its place in the log.
Dependence over_order(const std::map<int, SeriesMean>& series, double squares) {
  std::vector<Placed> means;
  double samples = 0;
  for (const auto& [id, s] : series) {
    means.push_back({s.condition, static_cast<double>(id), s.mean()});
    samples += s.n / static_cast<double>(series.size());
  }
  const OrderTrend trend = order_trend(means);
  return {"order in the log", squares > 0 ? trend.explained * samples / squares : 0, trend.p_value};
}

SharedOffset shared_offset(const std::map<int, SeriesMean>& series, double samples, double squares) {
  const auto k = static_cast<double>(series.size());
  double sum = 0, means = 0, scatter = 0;
  for (const auto& [id, s] : series) sum += s.sum, means += s.mean() / k;
  for (const auto& [id, s] : series) scatter += (s.mean() - means) * (s.mean() - means);
  SharedOffset out{sum / samples, 0, 1};
  if (k < 2 || !(squares > 0)) return out;
  const double of_mean = std::max(scatter / (k - 1) / k, 1e-12 * means * means);  // its variance
  if (!(of_mean > 0)) return out;
  out.p_value = f_tail(means * means / of_mean, 1, k - 1);
  out.share = std::max(0.0, out.mean * out.mean - of_mean) * samples / squares;
  return out;
}

}  // namespace

double ResidualStructure::p_value() const {
  double least = std::min({chi2_p_value, autocorrelation_p, offset.p_value});
  for (const Dependence& d : depends) least = std::min(least, d.p_value);
  return std::min(1.0, least * static_cast<double>(3 + depends.size()));
}

std::string ResidualStructure::in_words() const {
  const StructureOptions limits;
  std::string out = fmt::format("{:.3g} times the variance of the noise", chi2_per_sample);
  if (autocorrelation_p < limits.level)
    out += fmt::format(", neighbours correlate by {:.2f}", autocorrelation);
  if (offset.p_value < limits.level && offset.share > limits.share)
    out += fmt::format("; {:.0f} % of it is an offset of {:+.3g} sigma, predicted minus measured",
                       100 * offset.share, offset.mean);
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
  const auto series = means_of(samples, samples.series);
  const auto of = witnesses(samples);
  out.offset = shared_offset(means_of(samples, of), out.n, squares);
  out.depends.push_back(over_conditions(series, squares));
  out.depends.push_back(over_order(series, squares));
  out.depends.push_back(over_groups("time", samples, samples.time, of, options.groups));
  for (const auto& state : samples.states)
    out.depends.push_back(over_groups(state.name, samples, state.value, of, options.groups));
  std::stable_sort(out.depends.begin(), out.depends.end(), [](const Dependence& a, const Dependence& b) {
    return a.p_value != b.p_value ? a.p_value < b.p_value : a.share > b.share;
  });
  return out;
}

}  // namespace unhand::fitting
