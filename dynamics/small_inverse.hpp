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
    // [A | I] side by side. At pivot k only the N + 1 columns from k on matter: what is left of A, and what
    // has come into I. They are handled in whole registers, never mixing narrow stores with wide loads, which
    // stalls.
    alignas(16) double work[N][kColumns]{};
    int from[N];
    for (int i = 0; i < N; ++i) {
      from[i] = i;
      for (int j = 0; j < N; ++j) work[i][j] = a[i][j];
      work[i][N + i] = 1;
    }
    for (int k = 0; k < N; ++k) {
      int pivot = k;
      for (int i = k + 1; i < N; ++i)
        if (std::abs(work[i][k]) > std::abs(work[pivot][k])) pivot = i;
      if (pivot != k) {  // the exchange of the rest of I is kept in `from`
        std::swap(from[k], from[pivot]);
        for (int j = 0; j < N + k; ++j) std::swap(work[k][j], work[pivot][j]);
      }
      const int first = k / 2 * 2;
      const double scale = 1 / work[k][k];
      alignas(16) double row[kWindow];
      for (int j = 0; j < kWindow; ++j) row[j] = work[k][first + j] * scale;
      for (int j = 0; j < kWindow; ++j) work[k][first + j] = row[j];
      for (int i = 0; i < N; ++i) {
        const double factor = work[i][k];
        if (i == k || factor == 0) continue;  // Jacobians are sparse
        for (int j = 0; j < kWindow; ++j) work[i][first + j] -= factor * row[j];
      }
    }
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) column_[from[j]][i] = work[i][N + j];
  }

  /// An entry of A⁻¹.
  double operator()(int row, int column) const { return column_[column][row]; }

  /// y = A⁻¹ x
  void multiply(const Vector& x, Vector& y) const {
    alignas(16) double sum[kPadded]{};
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < kPadded; ++i) sum[i] += x[j] * column_[j][i];
    for (int i = 0; i < kPadded; ++i) y[i] = sum[i];
  }

 private:
  static constexpr int kWindow = (N + 3) / 2 * 2;  ///< N + 1 columns from an even one on, in whole registers
  static constexpr int kColumns = N / 2 * 2 + kWindow;

  alignas(16) double column_[N][kPadded]{};
};

}  // namespace unhand::dynamics
