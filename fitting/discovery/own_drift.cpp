#include "fitting/discovery/own_drift.hpp"

#include <cmath>
#include <map>
#include <vector>

#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/order_trend.hpp"

namespace unhand::fitting {
namespace {

OrderTrend trend_of(const CampaignProblem& problem, const FitResult& half, std::size_t unknown) {
  std::map<std::string, int> conditions;
  std::vector<Placed> values;
  for (std::size_t i = 0; i < half.throws.size(); ++i) {
    if (!half.throws[i].used || half.throws[i].weight < 1) continue;  // outliers have a trend of their own
    const int condition =
        conditions.try_emplace(problem.throws()[i].prepared.experiment(), static_cast<int>(conditions.size()))
            .first->second;
    values.push_back({condition, static_cast<double>(i), half.throws[i].own[unknown]});
  }
  return order_trend(values);
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
    const OrderTrend train = trend_of(problem, fit, k), test = trend_of(problem, held_out, k);
    const double change = train.slope * (throws - 1);
    const bool seen = train.p_value < level / static_cast<double>(problem.own().size()) &&
                      train.correlation * train.correlation > kMost && std::abs(change) > u.scale;
    if (!seen || !(test.p_value < kConfirmedAt) || !(test.slope * train.slope > 0)) continue;
    if (!out || train.ratio > out->ratio) out = {u.name, u.unit, change, train.correlation, train.ratio};
  }
  return out;
}

}  // namespace unhand::fitting
