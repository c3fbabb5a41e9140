// The polynomial of degree five between two states.
#pragma once

#include <array>

namespace unhand::dynamics {

/// c_0 … c_5 of p(t) = Σ c_k t^k [u/s^k] whose value [u], first [u/s] and second derivative [u/s²] are those
/// of `first` at t = 0 and those of `last` at t = h > 0 [s]. V is a number or an Eigen vector.
template <class V>
std::array<V, 6> quintic_between(const std::array<V, 3>& first, const std::array<V, 3>& last, double h) {
  const auto& [p0, v0, a0] = first;
  const auto& [p1, v1, a1] = last;
  const V p = p1 - p0 - h * (v0 + 0.5 * h * a0), v = h * (v1 - v0 - h * a0), a = h * h * (a1 - a0);
  return {p0,
          v0,
          V(0.5 * a0),
          V((10 * p - 4 * v + 0.5 * a) / (h * h * h)),
          V((-15 * p + 7 * v - a) / (h * h * h * h)),
          V((6 * p - 3 * v + 0.5 * a) / (h * h * h * h * h))};
}

}  // namespace unhand::dynamics
