// One step of the linear equations that derivatives with respect to parameters obey along a known solution.
#pragma once

#include <array>

#include "dynamics/hybrid_system.hpp"
#include "dynamics/small_inverse.hpp"

namespace unhand::dynamics {

/// dy/dp of kDualSize parameters: one row a component.
template <int N>
using Sensitivity = std::array<std::array<double, kDualSize>, N>;

/// f, f_y and f_p at a point of the solution, where the time of the point may move with the parameters.
template <int N>
struct FlowDerivative {
  std::array<std::array<double, N>, N> y{};  ///< ∂f_i/∂y_j, [component][component]
  Sensitivity<N> p{};  ///< df_i/dp_k at fixed y along the moving time, and f_i d(∂t/∂p_k)/dt

  /// Two Dual evaluations: the derivatives that the system's parameters and the time carry alone, and with
  /// those of y. `stretch` is the rate at which the derivatives of the time grow, d(∂t/∂p)/dt.
  void evaluate(const HybridSystem<N>& system, const Phase& phase, const Dual& t, const State<double, N>& at,
                const std::array<double, kDualSize>& stretch) {
    static_assert(N <= kDualSize);
    State<Dual, N> yd, own, both;
    for (int i = 0; i < N; ++i) yd[i] = Dual(at[i]);
    system.flow(phase, t, yd, own);
    for (int i = 0; i < N; ++i) yd[i].v[i] = 1;
    system.flow(phase, t, yd, both);
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) y[i][j] = both[i].v[j] - own[i].v[j];
      for (int k = 0; k < kDualSize; ++k) p[i][k] = own[i].v[k] + own[i].a * stretch[k];
    }
  }
};

/// Radau IIA of order five ([HairerWanner1996] IV.5) for dS/dθ = ρ(θ) (f_y S + f_p): L-stable, and, the
/// equations being linear, one block elimination instead of iterations. The inverse Runge-Kutta matrix
/// couples the stages by multiples of the identity, so three N × N inverses take the place of a factorisation
/// of 3N unknowns.
template <int N>
class VariationalStep {
 public:
  static constexpr double kRoot6 = 2.449489742783178;  ///< √6
  static constexpr double kNode[3] = {
      (4 - kRoot6) / 10, (4 + kRoot6) / 10,
      1};  ///< where the flow's derivatives are needed, as fractions of the step

  /// From S0 over the step's length in θ; `at` and `speed` are the derivatives of the flow and dt/dθ at the
  /// nodes.
  void solve(const Sensitivity<N>& s0, double length, const std::array<FlowDerivative<N>, 3>& at,
             const std::array<double, 3>& speed) {
    start_ = s0;
    double d[3][N][N];  // Λ_ii − h ρ f_y
    Sensitivity<N> r[3];
    for (int k = 0; k < 3; ++k) {
      const double h = length * speed[k];
      for (int i = 0; i < N; ++i) {
        for (int j = 0; j < N; ++j) d[k][i][j] = -h * at[k].y[i][j];
        r[k][i] = at[k].p[i];
        for (int j = 0; j < N; ++j) add(r[k][i], at[k].y[i][j], s0[j]);
        for (double& x : r[k][i]) x *= h;
        d[k][i][i] += kA[k][k];
      }
    }
    inverse_[0].compute(d[0]);
    // Without the first stage.
    double upper[N][N], lower[N][N];  // the blocks 23 and 32
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) {
        const double e = inverse_[0](i, j);
        d[1][i][j] -= kA[1][0] * kA[0][1] * e;
        upper[i][j] = (i == j ? kA[1][2] : 0) - kA[1][0] * kA[0][2] * e;
        lower[i][j] = (i == j ? kA[2][1] : 0) - kA[2][0] * kA[0][1] * e;
        d[2][i][j] -= kA[2][0] * kA[0][2] * e;
      }
    inverse_[1].compute(d[1]);
    // Without the second.
    std::array<std::array<double, N>, N> joined{};
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j)
        for (int k = 0; k < N; ++k) joined[i][k] += inverse_[1](i, j) * upper[j][k];
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j)
        for (int k = 0; k < N; ++k) d[2][i][k] -= lower[i][j] * joined[j][k];
    inverse_[2].compute(d[2]);

    auto& [z1, z2, z3] = stage_;
    multiply(inverse_[0], r[0], z1);
    for (int i = 0; i < N; ++i) {
      add(r[1][i], -kA[1][0], z1[i]);
      add(r[2][i], -kA[2][0], z1[i]);
    }
    multiply(inverse_[1], r[1], z2);
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) add(r[2][i], -lower[i][j], z2[j]);
    multiply(inverse_[2], r[2], z3);
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) add(z2[i], -joined[i][j], z3[j]);
    for (int i = 0; i < N; ++i) {
      add(r[0][i], -kA[0][1], z2[i]);
      add(r[0][i], -kA[0][2], z3[i]);
    }
    multiply(inverse_[0], r[0], z1);
  }

  /// ∂y/∂p where the step ends.
  Sensitivity<N> end() const {
    Sensitivity<N> s = start_;
    for (int i = 0; i < N; ++i) add(s[i], 1, stage_[2][i]);
    return s;
  }

  /// At the fraction `theta` of the step: the collocation polynomial, a cubic.
  Sensitivity<N> at(double theta) const {
    constexpr double a = kNode[0], b = kNode[1];
    const double weight[3] = {theta * (theta - b) * (theta - 1) / (a * (a - b) * (a - 1)),
                              theta * (theta - a) * (theta - 1) / (b * (b - a) * (b - 1)),
                              theta * (theta - a) * (theta - b) / ((1 - a) * (1 - b))};
    Sensitivity<N> s = start_;
    for (int i = 0; i < N; ++i)
      for (int k = 0; k < 3; ++k) add(s[i], weight[k], stage_[k][i]);
    return s;
  }

 private:
  using Row = std::array<double, kDualSize>;
  // The inverse of the Runge-Kutta matrix.
  static constexpr double kA[3][3] = {{2 + kRoot6 / 2, (-36 + 29 * kRoot6) / 30, (6 - 4 * kRoot6) / 15},
                                      {(-36 - 29 * kRoot6) / 30, 2 - kRoot6 / 2, (6 + 4 * kRoot6) / 15},
                                      {-1 + 8 * kRoot6 / 3, -1 - 8 * kRoot6 / 3, 5}};

  static void add(Row& to, double factor, const Row& row) {
    for (int k = 0; k < kDualSize; ++k) to[k] += factor * row[k];
  }
  static void multiply(const SmallInverse<N>& inverse, const Sensitivity<N>& x, Sensitivity<N>& y) {
    for (int i = 0; i < N; ++i) {
      Row sum{};
      for (int j = 0; j < N; ++j) add(sum, inverse(i, j), x[j]);
      y[i] = sum;
    }
  }

  SmallInverse<N> inverse_[3];
  Sensitivity<N> start_{};
  std::array<Sensitivity<N>, 3> stage_{};
};

}  // namespace unhand::dynamics
