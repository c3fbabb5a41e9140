// The nodes of Radau's five-stage quadrature, and what integrates and differentiates polynomials on them.
#pragma once

#include <array>

namespace unhand::dynamics {

/// Nodes of Radau IIA with five stages, order nine ([HairerWanner1996] IV.5), on a step from 0 to 1. Tables
/// are by [row][node].
struct RadauNodes {
  static constexpr int kCount = 5;  ///< nodes in (0, 1]
  static constexpr std::array<double, kCount> kNode{0.057104196114517682193, 0.27684301363812382768,
                                                    0.58359043236891682006, 0.86024013565621944785,
                                                    1};  ///< as fractions of the step
  /// A table with a row for each node or power.
  using Table = std::array<std::array<double, kCount>, kCount>;
  /// A table, or a row of weights, with the step's start before the nodes.
  template <int Rows>
  using WithStart = std::array<std::array<double, kCount + 1>, Rows>;

  /// Node j − 1, the step's start for j = 0.
  static constexpr double from_start(int j) { return j == 0 ? 0.0 : kNode[j - 1]; }

  /// Row d: the coefficients of θ^d of the polynomials that are 1 at one node and 0 at the others.
  static constexpr Table powers() {
    Table out{};
    for (int j = 0; j < kCount; ++j) {
      std::array<double, kCount> c{1};
      int degree = 0;
      for (int k = 0; k < kCount; ++k) {
        if (k == j) continue;
        const double scale = 1 / (kNode[j] - kNode[k]);
        for (int d = ++degree; d >= 0; --d)
          c[d] = scale * ((d > 0 ? c[d - 1] : 0) - (d < degree ? kNode[k] * c[d] : 0));
      }
      for (int d = 0; d < kCount; ++d) out[d][j] = c[d];
    }
    return out;
  }
  /// Row d: the coefficients of θ^(d + 1) of their integrals from 0.
  static constexpr Table primitives() {
    Table out = powers();
    for (int d = 0; d < kCount; ++d)
      for (double& x : out[d]) x /= d + 1;
    return out;
  }
  /// Row i: their integrals from 0 to node i, the method's Runge-Kutta matrix.
  static constexpr Table integrals() {
    Table out{};
    const Table primitive = primitives();
    for (int i = 0; i < kCount; ++i) {
      double power = 1;
      for (int d = 0; d < kCount; ++d) {
        power *= kNode[i];
        for (int j = 0; j < kCount; ++j) out[i][j] += primitive[d][j] * power;
      }
    }
    return out;
  }
  /// 1/Π_{k≠j} (c_j − c_k), the start being one of the nodes: Lagrange's polynomials but for their zeros.
  static constexpr std::array<double, kCount + 1> barycentric() {
    std::array<double, kCount + 1> out{};
    for (int j = 0; j <= kCount; ++j) {
      double product = 1;
      for (int k = 0; k <= kCount; ++k)
        if (k != j) product *= from_start(j) - from_start(k);
      out[j] = 1 / product;
    }
    return out;
  }
  /// Row i: slopes at node i of the polynomials on the start and the nodes.
  static constexpr WithStart<kCount> slopes() {
    WithStart<kCount> out{};
    const auto weight = barycentric();
    for (int i = 0; i < kCount; ++i) {
      double sum = 0;
      for (int j = 0; j <= kCount; ++j) {
        if (j == i + 1) continue;
        out[i][j] = weight[j] / weight[i + 1] / (kNode[i] - from_start(j));
        sum += out[i][j];
      }
      out[i][i + 1] = -sum;
    }
    return out;
  }
};

}  // namespace unhand::dynamics
