#include "fitting/grasp_scatter.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "experiment/seen_grasp.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

namespace {

/// What motion capture says of one throw's grasp: samples, their mean [m], sums of squares and of neighbours'
/// products about it [m²].
struct Seen {
  double n{}, mean{}, squares{}, products{};
};

std::optional<Seen> seen_across(const datasets::Throw& logged, const experiment::PreparedThrow& prepared) {
  std::vector<double> across;
  experiment::each_seen_in_hand(logged, prepared.hand, prepared.open_command,
                                [&](double, const dynamics::Vec2<double>& at) { across.push_back(at.z); });
  if (across.size() < 3) return {};
  Seen out;
  out.n = static_cast<double>(across.size());
  for (const double x : across) out.mean += x / out.n;
  for (std::size_t i = 0; i < across.size(); ++i) {
    out.squares += std::pow(across[i] - out.mean, 2);
    if (i > 0) out.products += (across[i] - out.mean) * (across[i - 1] - out.mean);
  }
  return out;
}

/// Of a sample about its throw's mean, times what correlated neighbours make of that of the mean [m²].
double variance_of(const std::vector<Seen>& throws) {
  constexpr double kMostCorrelated = 0.95;
  double squares = 0, products = 0, freedom = 0;
  for (const Seen& one : throws) squares += one.squares, products += one.products, freedom += one.n - 1;
  const double rho = squares > 0 ? std::clamp(products / squares, 0.0, kMostCorrelated) : 0;
  return squares / freedom * (1 + rho) / (1 - rho);
}

}  // namespace

std::string GraspScatter::in_words() const {
  return fmt::format(
      "repetitions differ by {:.2g} mm (1 sigma) in where the pads hold the object across its x axis: "
      "every throw is fitted a grasp_across of its own",
      1e3 * sigma);
}

GraspScatter grasp_scatter_across(const datasets::ThrowLog& log,
                                  const std::vector<experiment::PreparedThrow>& prepared) {
  std::map<std::string, std::vector<Seen>> objects;
  std::map<std::pair<std::string, std::string>, std::vector<Seen>> conditions;
  for (std::size_t i = 0; i < prepared.size(); ++i)
    if (const auto seen = seen_across(log.throws[i], prepared[i])) {
      objects[prepared[i].object].push_back(*seen);
      conditions[{prepared[i].object, prepared[i].condition}].push_back(*seen);
    }
  GraspScatter out;
  double chi2 = 0, weights = 0;
  int freedom = 0;
  for (const auto& [which, throws] : conditions) {
    const double variance = variance_of(objects.at(which.first));
    if (throws.size() < 2 || !(variance > 0)) continue;
    double n = 0, mean = 0;
    for (const Seen& one : throws) n += one.n, mean += one.n * one.mean;
    for (const Seen& one : throws) {
      chi2 += one.n / variance * std::pow(one.mean - mean / n, 2);
      weights += one.n / variance * (1 - one.n / n);
    }
    freedom += static_cast<int>(throws.size()) - 1;
    out.throws += static_cast<int>(throws.size());
  }
  if (freedom < 1) return out;
  out.p_value = chi2_tail(chi2, freedom);
  out.sigma = std::sqrt(std::max(0.0, (chi2 - freedom) / weights));
  return out;
}

}  // namespace unhand::fitting
