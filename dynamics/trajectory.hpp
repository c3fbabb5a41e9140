// A recorded trajectory: the dense output of every step, as polynomials.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "dynamics/hybrid_system.hpp"

namespace unhand::dynamics {

/// One step: the state at equally spaced instants of [t0, t1], as many as fix the dense output of every
/// stepper in time.
template <class S, int N>
struct TrajectoryPiece {
  static constexpr int kNodes = 8;          ///< equally spaced, both ends included
  S t0{}, t1{};                             ///< s: where the step begins and ends
  Phase phase;                              ///< mode and window
  std::array<State<S, N>, kNodes> nodes{};  ///< states, the first at t0 and the last at t1

  /// The state at the fraction θ of the piece: Lagrange's polynomial on the nodes.
  State<S, N> at_fraction(const S& theta) const {
    const S u = (kNodes - 1.0) * theta;
    std::array<S, kNodes> weight;  // Π_{j≠k} (u − j)/(k − j)
    S below(1.0);
    double scale = 1;  // (kNodes − 1)!
    for (int k = 0; k < kNodes; ++k) {
      weight[k] = below;
      below *= u - static_cast<double>(k);
      if (k > 0) scale *= k;
    }
    S above(1.0);
    State<S, N> y{};
    for (int k = kNodes - 1; k >= 0; --k) {
      const S share = weight[k] * above / ((kNodes - 1 - k) % 2 == 0 ? scale : -scale);
      for (int i = 0; i < N; ++i) y[i] += share * nodes[k][i];
      above *= u - static_cast<double>(k);
      if (k > 0) scale *= static_cast<double>(kNodes - k) / k;
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
