#include "fitting/discovery/lack_of_fit.hpp"

#include <algorithm>
#include <cstddef>
#include <map>

#include "fitting/distributions.hpp"

namespace unhand::fitting {

LackOfFit lack_of_fit(const std::vector<std::array<double, 2>>& error, const std::vector<int>& condition) {
  struct Condition {
    double n{};
    std::array<double, 2> sum{};
  };
  std::map<int, Condition> conditions;
  double squares = 0;
  for (std::size_t i = 0; i < error.size(); ++i) {
    Condition& c = conditions[condition[i]];
    c.n += 1;
    for (std::size_t k = 0; k < 2; ++k) c.sum[k] += error[i][k], squares += error[i][k] * error[i][k];
  }
  const auto n = static_cast<double>(error.size()), k = static_cast<double>(conditions.size());
  if (k < 1 || n - k < 2) return {};
  double of_means = 0;
  for (const auto& [id, c] : conditions) of_means += (c.sum[0] * c.sum[0] + c.sum[1] * c.sum[1]) / c.n;
  LackOfFit out;
  out.repetitions = std::max(0.0, squares - of_means) / (n - k);
  if (!(out.repetitions > 0)) return {};
  out.shared = std::max(0.0, squares / n - out.repetitions);
  out.p_value = f_tail(of_means / k / out.repetitions, k, n - k);
  return out;
}

}  // namespace unhand::fitting
