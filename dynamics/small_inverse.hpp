// The inverse of a small dense matrix, for solving with it many times.
#pragma once

#include <cmath>
#include <utility>

namespace unhand::dynamics {

/// A⁻¹ by Gauss-Jordan elimination with row pivoting, its columns padded to whole SIMD registers. Below some
/// ten unknowns, multiplying by the inverse takes a third of the time of two triangular solves, whose every
/// row waits for the one before; the error is of the same order, ε cond(A).
template <int N>
class SmallInverse {
 public:
  static constexpr int kPadded = (N + 1) / 2 * 2;
  using Vector = double[kPadded];  ///< entries beyond N are ignored on input, zero on output

  /// Inverts a[row][column]. A singular matrix gives entries that are not finite.
  void compute(const double (&a)[N][N]) {
    alignas(16) double work[N][kPadded]{};
    int from[N];
    for (int i = 0; i < N; ++i) {
      from[i] = i;
      for (int j = 0; j < N; ++j) work[i][j] = a[i][j];
    }
    for (int k = 0; k < N; ++k) {
      int pivot = k;
      for (int i = k + 1; i < N; ++i)
        if (std::abs(work[i][k]) > std::abs(work[pivot][k])) pivot = i;
      if (pivot != k) {
        std::swap(from[k], from[pivot]);
        for (int j = 0; j < kPadded; ++j) std::swap(work[k][j], work[pivot][j]);
      }
      const double scale = 1 / work[k][k];
      work[k][k] = 1;
      for (int j = 0; j < kPadded; ++j) work[k][j] *= scale;
      for (int i = 0; i < N; ++i) {
        if (i == k) continue;
        const double factor = work[i][k];
        if (factor == 0) continue;  // Jacobians are sparse
        work[i][k] = 0;
        for (int j = 0; j < kPadded; ++j) work[i][j] -= factor * work[k][j];
      }
    }
    // Row exchanges of A are column exchanges of its inverse.
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) column_[from[j]][i] = work[i][j];
  }

  /// y = A⁻¹ x
  void multiply(const Vector& x, Vector& y) const {
    alignas(16) double sum[kPadded]{};
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < kPadded; ++i) sum[i] += x[j] * column_[j][i];
    for (int i = 0; i < kPadded; ++i) y[i] = sum[i];
  }

 private:
  alignas(16) double column_[N][kPadded]{};
};

}  // namespace unhand::dynamics
