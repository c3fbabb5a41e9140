#include "experiment/outcome_slopes.hpp"

#include <algorithm>

namespace unhand::experiment {

using dynamics::Dual;

std::optional<Eigen::MatrixXd> outcome_slopes(const PreparedThrow& prepared, const ThrowModel& model,
                                              const std::vector<std::string>& names,
                                              std::span<const double> values) {
  const auto n = static_cast<int>(values.size());
  Eigen::MatrixXd out(kOutcomeCount, n);
  constexpr int kSize = dynamics::kDualSize;
  for (int first = 0; first < n; first += kSize) {
    const int last = std::min(first + kSize, n);
    std::vector<Dual> duals;
    for (int k = 0; k < n; ++k) {
      const double v = values[static_cast<std::size_t>(k)];
      duals.push_back(k >= first && k < last ? dynamics::independent(v, k - first) : Dual(v));
    }
    const auto p =
        predict_channels(prepared, {}, model, dynamics::Values<Dual>(names, std::span<const Dual>(duals)));
    if (!p.landed()) return {};
    const auto y = outcomes_of(p);
    for (int k = first; k < last; ++k)
      for (int i = 0; i < kOutcomeCount; ++i) out(i, k) = y[static_cast<std::size_t>(i)].v[k - first];
  }
  if (!out.allFinite()) return {};
  return out;
}

}  // namespace unhand::experiment
