#include "fitting/discovery/own_drift.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/order_trend.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {
namespace {

std::vector<Placed> placed(const CampaignProblem& problem, const FitResult& half, std::size_t unknown) {
  std::map<std::string, int> conditions;
  std::vector<Placed> values;
  for (std::size_t i = 0; i < half.throws.size(); ++i) {
    if (!half.throws[i].used || half.throws[i].weight < 1) continue;  // outliers have a trend of their own
    const int condition =
        conditions.try_emplace(problem.throws()[i].prepared.experiment(), static_cast<int>(conditions.size()))
            .first->second;
    values.push_back({condition, static_cast<double>(i), half.throws[i].own[unknown]});
  }
  return values;
}

/// About the means of their conditions; without those of a condition that has no other.
std::vector<Placed> about_conditions(const std::vector<Placed>& values) {
  std::map<int, std::pair<double, double>> conditions;  // throws; sum
  for (const auto& [condition, x, y] : values)
    conditions[condition].first += 1, conditions[condition].second += y;
  std::vector<Placed> out;
  for (const auto& [condition, x, y] : values)
    if (const auto& [n, sum] = conditions.at(condition); n > 1) out.push_back({condition, x, y - sum / n});
  return out;
}

/// Of pairs: Σ ab/√(Σ a² Σ b²), and the one-sided p-value of as much without any.
struct Alike {
  double correlation{}, p_value{1};
};
Alike alike(const std::vector<std::pair<double, double>>& pairs) {
  double ab = 0, aa = 0, bb = 0;
  for (const auto& [a, b] : pairs) ab += a * b, aa += a * a, bb += b * b;
  Alike out;
  if (pairs.size() < 4 || !(aa > 0) || !(bb > 0)) return out;
  out.correlation = ab / std::sqrt(aa * bb);
  if (out.correlation > 0)
    out.p_value = 0.5 * normal_two_sided(out.correlation * std::sqrt(static_cast<double>(pairs.size())));
  return out;
}

/// Each with the next in the log.
Alike neighbours(const std::vector<Placed>& values) {
  std::vector<std::pair<double, double>> pairs;
  for (std::size_t i = 1; i < values.size(); ++i) pairs.push_back({values[i - 1].value, values[i].value});
  return alike(pairs);
}

/// Each of `these` with the mean of those `among` others that come before and after it.
Alike between_neighbours(const std::vector<Placed>& these, const std::vector<Placed>& among) {
  std::vector<std::pair<double, double>> pairs;
  for (const Placed& one : these) {
    const auto after = std::find_if(among.begin(), among.end(),
                                    [&](const Placed& other) { return other.place > one.place; });
    if (after == among.begin() || after == among.end()) continue;
    pairs.push_back({one.value, 0.5 * (std::prev(after)->value + after->value)});
  }
  return alike(pairs);
}

/// 1 σ of the part that neighbours share.
double slow_sigma(const std::vector<Placed>& values, double correlation) {
  double squares = 0;
  for (const Placed& one : values) squares += one.value * one.value;
  return std::sqrt(correlation * squares / static_cast<double>(values.size()));
}

}  // namespace

std::optional<OwnDrift> own_drift(const CampaignProblem& problem, const FitResult& fit,
                                  const FitResult& held_out, double level) {
  constexpr double kMost = 0.5;
  std::optional<OwnDrift> out;
  const auto throws = static_cast<double>(problem.throws().size());
  for (std::size_t k = 0; k < problem.own().size(); ++k) {
    const Unknown& u = problem.own()[k];
    if (u.kind == Unknown::Kind::smoothing) continue;
    const auto of_train = placed(problem, fit, k), of_test = placed(problem, held_out, k);
    const OrderTrend train = order_trend(of_train), test = order_trend(of_test);
    const double change = train.slope * (throws - 1);
    const double at =
        level / static_cast<double>(2 * problem.own().size());  // of a line, and of what is slow
    const bool seen =
        train.p_value < at && train.correlation * train.correlation > kMost && std::abs(change) > u.scale;
    if (seen && test.p_value < kConfirmedAt && test.slope * train.slope > 0) {
      if (!out || out->slow || train.ratio > out->ratio)
        out = {u.name, u.unit, change, train.correlation, train.ratio, false};
      continue;
    }
    if (out && !out->slow) continue;
    const auto about = about_conditions(of_train);
    const Alike near = neighbours(about);
    if (!(near.p_value < at) || !(near.correlation > kMost)) continue;
    const double sigma = slow_sigma(about, near.correlation),
                 ratio = 1 / (1 - std::min(near.correlation, 0.99));
    if (!(2 * sigma > u.scale) ||
        !(between_neighbours(about_conditions(of_test), about).p_value < kConfirmedAt))
      continue;
    if (!out || ratio > out->ratio) out = {u.name, u.unit, sigma, near.correlation, ratio, true};
  }
  return out;
}

}  // namespace unhand::fitting
