// The inverse of a small dense matrix, for solving with it many times.
#pragma once

#include <cmath>
#include <cstring>
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
  double operator()(int row, int column) const { return column_[column][row / 2][row % 2]; }

  /// y = A⁻¹ x
  void multiply(const Vector& x, Vector& y) const {
    Pair sum[kPairs];
    for (int p = 0; p < kPairs; ++p) sum[p] = x[0] * column_[0][p];
    for (int j = 1; j < N; ++j)
      for (int p = 0; p < kPairs; ++p) sum[p] += x[j] * column_[j][p];
    std::memcpy(y, sum, sizeof y);
  }

 private:
  // Registers of two, read and written as a whole: the compiler on its own takes sums of this length apart,
  // and a register that is read after half of it was written waits for the store.
  using Pair [[gnu::vector_size(16)]] = double;
  static constexpr int kPairs = kPadded / 2;
  enum Pivots { kDiagonal, kByRows };

  void fill(const double (&a)[N][N]) {
    for (int j = 0; j < N; ++j)
      for (int p = 0; p < kPairs; ++p)
        column_[j][p] = Pair{a[2 * p][j], 2 * p + 1 < N ? a[2 * p + 1][j] : 0.0};
  }
  double entry(int i, int k) const { return column_[i][k / 2][k % 2]; }
  void swap_entries(int i, int k, int l) {
    const double kept = entry(i, k);
    column_[i][k / 2][k % 2] = entry(i, l);
    column_[i][l / 2][l % 2] = kept;
  }

  /// False if a pivot on the diagonal is too small.
  bool eliminate(Pivots pivots) {
    int from[N];
    for (int k = 0; k < N; ++k) {
      int most = k;
      double largest = std::abs(entry(k, k));
      for (int i = k + 1; i < N; ++i)
        if (std::abs(entry(i, k)) > largest) {
          largest = std::abs(entry(i, k));
          most = i;
        }
      if (pivots == kDiagonal) {
        if (!(std::abs(entry(k, k)) >= 0.01 * largest)) return false;
      } else {
        from[k] = most;
        if (most != k) std::swap(column_[k], column_[most]);
      }
      const Pair unit{k % 2 == 0 ? 1.0 : 0.0, k % 2 == 1 ? 1.0 : 0.0}, others = 1 - unit;
      const double pivot = 1 / entry(k, k);
      column_[k][k / 2] = column_[k][k / 2] * others + unit;
      for (int p = 0; p < kPairs; ++p) column_[k][p] *= pivot;
      for (int i = 0; i < N; ++i) {
        const double factor = entry(i, k);
        if (i == k || factor == 0) continue;  // Jacobians are sparse
        column_[i][k / 2] *= others;
        for (int p = 0; p < kPairs; ++p) column_[i][p] -= factor * column_[k][p];
      }
    }
    if (pivots == kByRows)  // rows exchanged before are columns exchanged after
      for (int k = N; k-- > 0;)
        if (from[k] != k)
          for (int i = 0; i < N; ++i) swap_entries(i, k, from[k]);
    return true;
  }

  Pair column_[N][kPairs];  // of A⁻¹
};

}  // namespace unhand::dynamics
