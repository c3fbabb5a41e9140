// A recorded piece: the polynomial through its nodes, its rate, and the derivatives of both.
#include "dynamics/trajectory.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace unhand::dynamics {
namespace {

/// c₀ + c₁ θ + … + c₇ θ⁷ by Horner's rule.
constexpr std::array<double, 8> kPower{0.3, -1.2, 0.7, 2.1, -0.4, 1.9, -3.0, 0.8};
template <class S>
S seventh_degree(const S& theta) {
  S y(0.0);
  for (int k = 7; k >= 0; --k) y = y * theta + kPower[static_cast<std::size_t>(k)];
  return y;
}

// A polynomial of the nodes' degree is itself, inside, at the nodes and beyond; and so is its slope.
TEST(TrajectoryPiece, IsThePolynomialThroughItsNodes) {
  TrajectoryPiece<double, 1> piece;
  for (int k = 0; k < piece.kNodes; ++k)
    piece.nodes[static_cast<std::size_t>(k)] = {seventh_degree(k / (piece.kNodes - 1.0))};
  for (const double theta : {-0.1, 0.0, 1.0 / 7, 0.3, 0.5, 0.999, 1.0, 1.2}) {
    const Dual known = seventh_degree(independent(theta, 0));
    EXPECT_NEAR(piece.at_fraction(theta)[0], known.a, 1e-12) << theta;
    EXPECT_NEAR(piece.rate_at_fraction(theta)[0], known.v[0], 1e-11) << theta;
  }
}

// Nodes e^(p s) that depend on a parameter p at an instant that depends on another one, q: y = e^(p q) but
// for the polynomial's own error, and its rate p e^(p q).
TEST(TrajectoryPiece, HasTheDerivativesOfNodesAndInstant) {
  const double p = 0.2, q = 0.37;
  TrajectoryPiece<Dual, 2> piece;
  for (int k = 0; k < piece.kNodes; ++k) {
    const Dual y = exp(independent(p, 0) * (k / (piece.kNodes - 1.0)));
    piece.nodes[static_cast<std::size_t>(k)] = {y, 2.0 * y};
  }
  const Dual at = independent(q, 1);
  const double y = std::exp(p * q);
  for (const int i : {0, 1}) {
    const Dual value = piece.at_fraction(at)[static_cast<std::size_t>(i)] / (1.0 + i),
               rate = piece.rate_at_fraction(at)[static_cast<std::size_t>(i)] / (1.0 + i);
    EXPECT_NEAR(value.a, y, 1e-12);
    EXPECT_NEAR(value.v[0], q * y, 1e-10);
    EXPECT_NEAR(value.v[1], p * y, 1e-10);
    EXPECT_NEAR(rate.a, p * y, 1e-10);
    EXPECT_NEAR(rate.v[0], (1 + p * q) * y, 1e-8);
    EXPECT_NEAR(rate.v[1], p * p * y, 1e-8);
  }
}

}  // namespace
}  // namespace unhand::dynamics
