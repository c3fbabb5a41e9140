// A recorded trajectory: the dense output of every step, as quartics.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "dynamics/hybrid_system.hpp"

namespace unhand::dynamics {

/// One step: the state at five equally spaced instants of [t0, t1], which fixes the dense output of every
/// stepper.
template <class S, int N>
struct TrajectoryPiece {
  S t0{}, t1{};
  Phase phase;
  std::array<State<S, N>, 5> nodes{};

  /// The state at the fraction θ of the piece.
  State<S, N> at_fraction(const S& theta) const {
    const S u = 4.0 * theta;
    // Lagrange's polynomials on the nodes 0..4.
    const S u1 = u - 1.0, u2 = u - 2.0, u3 = u - 3.0, u4 = u - 4.0;
    const std::array<S, 5> weight{u1 * u2 * u3 * u4 / 24.0, -u * u2 * u3 * u4 / 6.0, u * u1 * u3 * u4 / 4.0,
                                  -u * u1 * u2 * u4 / 6.0, u * u1 * u2 * u3 / 24.0};
    State<S, N> y{};
    for (int k = 0; k < 5; ++k)
      for (int i = 0; i < N; ++i) y[i] += weight[k] * nodes[k][i];
    return y;
  }
};

template <class S, int N>
class Trajectory {
 public:
  bool empty() const { return pieces.empty(); }

  /// The piece that holds t; at an event the later one. t outside the trajectory throws std::out_of_range.
  const TrajectoryPiece<S, N>& piece_at(double t) const {
    if (pieces.empty() || t < value_of(pieces.front().t0) || t > value_of(pieces.back().t1))
      throw std::out_of_range("trajectory: the time asked for lies outside it");
    auto next = std::upper_bound(pieces.begin(), pieces.end(), t,
                                 [](double x, const TrajectoryPiece<S, N>& p) { return x < value_of(p.t0); });
    return *std::prev(next);
  }

  /// State at t [s].
  State<S, N> at(const S& t) const {
    const TrajectoryPiece<S, N>& piece = piece_at(value_of(t));
    const S length = piece.t1 - piece.t0;
    if (!(value_of(length) > 0)) return piece.nodes[4];
    return piece.at_fraction((t - piece.t0) / length);
  }

  std::vector<TrajectoryPiece<S, N>> pieces;
};

}  // namespace unhand::dynamics
