// A table of samples in SI base units, one row per sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace unhand::datasets {

/// rows × cols numbers, row after row. An empty series (no rows) is one that was not recorded.
/// sigma: the declared 1-σ noise of each column, in the column's unit; empty where none was declared.
struct Series {
  std::size_t rows = 0, cols = 1;  ///< samples; numbers in each
  std::vector<double> data;        ///< row after row, SI units
  std::vector<double> sigma;       ///< 1 σ by column; empty: not declared

  /// True if it was not recorded.
  bool empty() const { return rows == 0; }
  /// Row i < rows, column j < cols; others are not checked.
  double operator()(std::size_t i, std::size_t j = 0) const { return data[i * cols + j]; }
  double& operator()(std::size_t i, std::size_t j = 0) { return data[i * cols + j]; }
  /// The declared 1 σ of column j; 0 where none was declared.
  double sigma_of(std::size_t j = 0) const { return j < sigma.size() ? sigma[j] : 0; }
  /// Equal where all numbers are; a NaN, as lost samples may be, is equal to a NaN.
  bool operator==(const Series& other) const {
    const auto same = [](const std::vector<double>& a, const std::vector<double>& b) {
      return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                        [](double x, double y) { return x == y || (std::isnan(x) && std::isnan(y)); });
    };
    return rows == other.rows && cols == other.cols && same(data, other.data) && same(sigma, other.sigma);
  }
};

/// Whether all samples of a column are the same, as those of a dead sensor are.
inline bool is_constant(const Series& series, std::size_t column = 0) {
  for (std::size_t i = 1; i < series.rows; ++i)
    if (series(i, column) != series(0, column)) return false;
  return true;
}

/// One flag per sample, 0 or 1.
using Flags = std::vector<std::uint8_t>;

}  // namespace unhand::datasets
