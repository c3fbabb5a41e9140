// Derivatives against central differences.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <type_traits>

#include "dynamics/scalar.hpp"

namespace unhand::support {

/// The smallest errors of central differences of the components of f at x against `derivative`, over steps of
/// `longest` to 1e-7 by powers of ten: as a function of the step an error falls with its square until
/// rounding takes over, so a true derivative shows at the bottom.
template <std::size_t N>
std::array<double, N> best_differences(const std::function<std::array<double, N>(double)>& f, double x,
                                       const std::array<double, N>& derivative, double longest = 1e-1) {
  std::array<double, N> best;
  best.fill(INFINITY);
  for (double step = longest; step > 0.5e-7; step *= 0.1) {
    const std::array<double, N> up = f(x + step), down = f(x - step);
    for (std::size_t i = 0; i < N; ++i)
      best[i] = std::min(best[i], std::abs((up[i] - down[i]) / (2 * step) - derivative[i]));
  }
  return best;
}

/// The same of one number.
inline double best_difference(const std::function<double(double)>& f, double x, double derivative,
                              double longest = 1e-1) {
  return best_differences<1>([&](double at) { return std::array{f(at)}; }, x, {derivative}, longest)[0];
}

/// x, its components from `first` on as the independent variables, as many as a Dual has.
template <std::size_t N>
std::array<dynamics::Dual, N> seeded(const std::array<double, N>& x, std::size_t first = 0) {
  std::array<dynamics::Dual, N> out;
  for (std::size_t k = 0; k < N; ++k) {
    const bool free = k >= first && k < first + dynamics::kDualSize;
    out[k] = free ? dynamics::independent(x[k], static_cast<int>(k - first)) : dynamics::Dual(x[k]);
  }
  return out;
}

/// The same by component k of x, against the derivatives of `exact` = f(seeded(x, first)). f takes doubles or
/// dual numbers.
template <class F, std::size_t N, std::size_t M>
std::array<double, N> best_differences_by(std::size_t k, const F& f, std::array<double, M> x,
                                          const std::array<dynamics::Dual, N>& exact, double longest = 1e-1,
                                          std::size_t first = 0) {
  std::array<double, N> derivative;
  for (std::size_t i = 0; i < N; ++i) derivative[i] = exact[i].v[static_cast<int>(k - first)];
  const auto along = [&](double value) {
    x[k] = value;
    if constexpr (std::is_invocable_v<F, std::array<double, M>>) {
      return f(x);
    } else {
      std::array<dynamics::Dual, M> constant;
      for (std::size_t j = 0; j < M; ++j) constant[j] = dynamics::Dual(x[j]);
      const std::array<dynamics::Dual, N> y = f(constant);
      std::array<double, N> out;
      for (std::size_t i = 0; i < N; ++i) out[i] = y[i].a;
      return out;
    }
  };
  return best_differences<N>(along, x[k], derivative, longest);
}

}  // namespace unhand::support
