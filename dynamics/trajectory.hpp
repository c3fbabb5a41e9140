// A recorded trajectory: the dense output of every step, as polynomials.
#pragma once

#include <algorithm>
#include <array>
#include <stdexcept>
#include <vector>

#include "dynamics/hybrid_system.hpp"

namespace unhand::dynamics {

/// Lagrange's polynomials on K equally spaced nodes of [0, 1]: of each its value and its first two
/// derivatives at θ.
template <int K>
std::array<std::array<double, 3>, K> lagrange_weights(double theta) {
  using Taylor = std::array<double, 3>;
  constexpr double n = K - 1.0;
  const auto times = [&](Taylor& p, int j) {  // p (n θ − j)
    const double factor = n * theta - j;
    p = {p[0] * factor, p[1] * factor + n * p[0], p[2] * factor + 2 * n * p[1]};
  };
  std::array<Taylor, K> out;  // Π_{j≠k} (n θ − j)/(k − j)
  Taylor below{1, 0, 0}, above = below;
  double scale = 1;  // (K − 1)!, then that of node k
  for (int k = 0; k < K; ++k) {
    out[k] = below;
    times(below, k);
    if (k > 0) scale *= k;
  }
  for (int k = K - 1; k >= 0; --k) {
    const Taylor b = out[k];
    const double by = 1 / ((K - 1 - k) % 2 == 0 ? scale : -scale);
    out[k] = {by * b[0] * above[0], by * (b[1] * above[0] + b[0] * above[1]),
              by * (b[2] * above[0] + 2 * b[1] * above[1] + b[0] * above[2])};
    times(above, k);
    if (k > 0) scale *= static_cast<double>(K - k) / k;
  }
  return out;
}

/// One step: the state at equally spaced instants of [t0, t1], as many as fix the dense output of every
/// stepper in time.
template <class S, int N>
struct TrajectoryPiece {
  static constexpr int kNodes = 8;          ///< equally spaced, both ends included
  S t0{}, t1{};                             ///< s: where the step begins and ends
  Phase phase;                              ///< mode and window
  std::array<State<S, N>, kNodes> nodes{};  ///< states, the first at t0 and the last at t1

  /// The state at the fraction θ of the piece: Lagrange's polynomial on the nodes.
  State<S, N> at_fraction(const S& theta) const { return derivative<0>(theta); }
  /// Its derivative by θ.
  State<S, N> rate_at_fraction(const S& theta) const { return derivative<1>(theta); }

 private:
  template <int Order>
  State<S, N> derivative(const S& theta) const {
    const auto weights = lagrange_weights<kNodes>(value_of(theta));
    State<S, N> y{};
    for (int i = 0; i < N; ++i) {
      double slope = 0;
      for (int k = 0; k < kNodes; ++k) {
        y[i] += weights[k][Order] * nodes[k][i];
        slope += weights[k][Order + 1] * value_of(nodes[k][i]);
      }
      y[i] += chain(theta, 0, slope);
    }
    return y;
  }
};

/// The states of an integration over time, step by step, through every event.
template <class S, int N>
class Trajectory {
 public:
  /// True if nothing was recorded.
  bool empty() const { return pieces.empty(); }

  /// The piece that holds t; at an event the later one. t outside the trajectory, or none, throws
  /// std::out_of_range.
  const TrajectoryPiece<S, N>& piece_at(double t) const {
    if (pieces.empty() || !(t >= value_of(pieces.front().t0) && t <= value_of(pieces.back().t1)))
      throw std::out_of_range("trajectory: the time asked for lies outside it");
    auto next = std::upper_bound(pieces.begin(), pieces.end(), t,
                                 [](double x, const TrajectoryPiece<S, N>& p) { return x < value_of(p.t0); });
    return *std::prev(next);
  }

  /// State at t [s]. Throws as piece_at does.
  State<S, N> at(const S& t) const {
    const TrajectoryPiece<S, N>& piece = piece_at(value_of(t));
    const S length = piece.t1 - piece.t0;
    if (!(value_of(length) > 0)) return piece.nodes.back();
    return piece.at_fraction((t - piece.t0) / length);
  }

  std::vector<TrajectoryPiece<S, N>> pieces;  ///< in order of time; neighbours share an end, and an event's
                                              ///< two states are on both sides of it
};

}  // namespace unhand::dynamics
