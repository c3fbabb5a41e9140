// The inverse of a small dense matrix, for solving with it many times.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <utility>

namespace unhand::dynamics {

/// A⁻¹ by Gauss-Jordan elimination in place, its columns padded to whole SIMD registers. Pivots are taken
/// from the diagonal while they are no smaller than a hundredth of what lies below them, else by rows. Below
/// some ten unknowns, multiplying by the inverse takes a third of the time of two triangular solves, whose
/// every row waits for the one before; the error is of the same order, ε cond(A).
template <int N>
class SmallInverse {
 public:
  static constexpr int kPadded = (N + 1) / 2 * 2;  ///< N rounded up to whole registers of two
  using Vector = double[kPadded];                  ///< entries beyond N are ignored on input, zero on output

  /// Inverts a[row][column]. A singular matrix gives entries that are not finite.
  void compute(const double (&a)[N][N]) {
    // The transpose is inverted, so that its rows are the columns of A⁻¹.
    fill(a);
    if (eliminate(kDiagonal)) return;
    fill(a);
    eliminate(kByRows);
  }

  /// An entry of A⁻¹.
  double operator()(int row, int column) const { return column_[column][row]; }

  /// y = A⁻¹ x
  void multiply(const Vector& x, Vector& y) const {
    Packed sum = x[0] * column_[0];
    for (int j = 1; j < N; ++j) sum += x[j] * column_[j];
    Eigen::Map<Packed>{y} = sum;
  }

 private:
  // Eigen's vectors, since the compiler on its own takes sums of this length apart again.
  using Packed = Eigen::Matrix<double, kPadded, 1>;
  enum Pivots { kDiagonal, kByRows };

  void fill(const double (&a)[N][N]) {
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < kPadded; ++i) column_[j][i] = i < N ? a[i][j] : 0;
  }

  /// False if a pivot on the diagonal is too small.
  bool eliminate(Pivots pivots) {
    int from[N];
    for (int k = 0; k < N; ++k) {
      int most = k;
      double largest = std::abs(column_[k][k]);
      for (int i = k + 1; i < N; ++i)
        if (std::abs(column_[i][k]) > largest) {
          largest = std::abs(column_[i][k]);
          most = i;
        }
      if (pivots == kDiagonal) {
        if (!(std::abs(column_[k][k]) >= 0.01 * largest)) return false;
      } else {
        from[k] = most;
        if (most != k) column_[k].swap(column_[most]);
      }
      const double pivot = 1 / column_[k][k];
      column_[k][k] = 1;
      column_[k] *= pivot;
      for (int i = 0; i < N; ++i) {
        const double factor = column_[i][k];
        if (i == k || factor == 0) continue;  // Jacobians are sparse
        column_[i][k] = 0;
        column_[i] -= factor * column_[k];
      }
    }
    if (pivots == kByRows)  // rows exchanged before are columns exchanged after
      for (int k = N; k-- > 0;)
        if (from[k] != k)
          for (int i = 0; i < N; ++i) std::swap(column_[i][k], column_[i][from[k]]);
    return true;
  }

  Packed column_[N];  // of A⁻¹
};

}  // namespace unhand::dynamics
