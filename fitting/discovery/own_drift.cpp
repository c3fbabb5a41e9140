#include "fitting/discovery/own_drift.hpp"

#include <cmath>
#include <map>
#include <vector>

#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {
namespace {

/// A straight line over the place in the log, each condition with a mean of its own.
struct Trend {
  double slope{}, correlation{}, p_value{1}, ratio{1};
};

Trend trend_of(const CampaignProblem& problem, const FitResult& half, std::size_t unknown) {
  struct Sums {
    double n{}, x{}, y{}, xx{}, xy{}, yy{};
  };
  std::map<std::string, Sums> conditions;
  for (std::size_t i = 0; i < half.throws.size(); ++i) {
    if (!half.throws[i].used || half.throws[i].weight < 1) continue;  // outliers have a trend of their own
    const auto x = static_cast<double>(i);
    const double y = half.throws[i].own[unknown];
    Sums& s = conditions[problem.throws()[i].prepared.experiment()];
    s.n += 1, s.x += x, s.y += y, s.xx += x * x, s.xy += x * y, s.yy += y * y;
  }
  double n = -1, xx = 0, xy = 0, yy = 0;
  for (const auto& [name, s] : conditions) {
    n += s.n - 1;
    xx += s.xx - s.x * s.x / s.n, xy += s.xy - s.x * s.y / s.n, yy += s.yy - s.y * s.y / s.n;
  }
  Trend out;
  if (n < 1 || !(xx > 0) || !(yy > 0)) return out;
  out.slope = xy / xx;
  out.correlation = xy / std::sqrt(xx * yy);
  const double share = std::min(out.correlation * out.correlation, 1 - 1e-12);
  out.p_value = f_tail(share * n / (1 - share), 1, n);
  out.ratio = 1 / (1 - share);
  return out;
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
    const Trend train = trend_of(problem, fit, k), test = trend_of(problem, held_out, k);
    const double change = train.slope * (throws - 1);
    const bool seen = train.p_value < level / static_cast<double>(problem.own().size()) &&
                      train.correlation * train.correlation > kMost && std::abs(change) > u.scale;
    if (!seen || !(test.p_value < kConfirmedAt) || !(test.slope * train.slope > 0)) continue;
    if (!out || train.ratio > out->ratio) out = {u.name, u.unit, change, train.correlation, train.ratio};
  }
  return out;
}

}  // namespace unhand::fitting
