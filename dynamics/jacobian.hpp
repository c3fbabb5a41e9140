// The exact Jacobian of a flow, by dual numbers.
#pragma once

#include <Eigen/Core>

#include "dynamics/hybrid_system.hpp"

namespace unhand::dynamics {

/// ∂f/∂y into `J` and ∂f/∂t into `ft` at (t, y), values of f into `f`; one Dual evaluation, and one more to
/// take away what the system's parameters carry if they are `seeded` with derivatives of their own. N <=
/// kDualSize − 1.
template <int N>
void flow_jacobian(const HybridSystem<N>& system, const Phase& phase, double t, const State<double, N>& y,
                   State<double, N>& f, Eigen::Matrix<double, N, N>& J, State<double, N>& ft,
                   bool seeded = false) {
  static_assert(N + 1 <= kDualSize);
  State<Dual, N> yd, fd, own;
  if (seeded) {
    for (int i = 0; i < N; ++i) yd[i] = Dual(y[i]);
    system.flow(phase, Dual(t), yd, own);
  }
  for (int i = 0; i < N; ++i) yd[i] = independent(y[i], i);
  system.flow(phase, independent(t, N), yd, fd);
  for (int i = 0; i < N; ++i) {
    f[i] = fd[i].a;
    ft[i] = fd[i].v[N] - own[i].v[N];
    for (int j = 0; j < N; ++j) J(i, j) = fd[i].v[j] - own[i].v[j];
  }
}

}  // namespace unhand::dynamics
