// Least squares of a spline on a fixed grid of intervals, by banded Householder QR.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "dynamics/bspline.hpp"
#include "dynamics/spline_fit.hpp"

namespace unhand::dynamics {

/// One observed instant: its design row and measured values, not yet divided by sigma.
template <int Channels, int Degree>
struct SplineRow {
  int series{}, interval{};
  std::array<double, Degree + 1> weights{};
  const double* value{};
};

/// Coefficients and residuals of the least-squares spline of a problem.
template <int Channels, int Degree>
class SplineSolver {
 public:
  using Problem = SplineProblem<Channels, Degree>;

  explicit SplineSolver(const Problem& problem) : problem_(problem) {
    for (std::size_t s = 0; s < problem.observations.size(); ++s) {
      const auto& o = problem.observations[s];
      for (std::size_t n = 0; n < o.time.size(); ++n)
        if (o.time[n] >= problem.begin && o.time[n] <= problem.end)
          samples_.push_back({o.time[n] - problem.begin, static_cast<int>(s), &o.value[n * Channels]});
    }
    std::stable_sort(samples_.begin(), samples_.end(),
                     [](const Sample& a, const Sample& b) { return a.time < b.time; });
    common_scale_ = true;
    for (const auto& o : problem.observations)
      for (int c = 0; c < Channels; ++c)
        common_scale_ = common_scale_ && std::abs(o.sigma[c] * problem.observations[0].sigma[0] -
                                                  o.sigma[0] * problem.observations[0].sigma[c]) <=
                                             1e-12 * o.sigma[0] * problem.observations[0].sigma[c];
  }

  // Least squares on the grid; afterwards coefficients, chi2 and everything per interval are set.
  void solve(const Grid& grid) {
    make_rows(grid);
    coefficients_.assign(static_cast<std::size_t>(grid.functions) * Channels, 0.0);
    if (common_scale_) {
      factorise(grid, 0, Channels);
    } else {
      for (int c = 0; c < Channels; ++c) factorise(grid, c, 1);
    }
    measure(grid);
  }

  double total() const { return total_; }
  // Per interval, and within it per series.
  const std::vector<double>& interval_chi2() const { return interval_chi2_; }
  const std::vector<double>& interval_lag() const { return interval_lag_; }  // sum of products of neighbours
  const std::vector<int>& interval_rows() const { return interval_rows_; }
  const std::vector<int>& interval_instants() const { return interval_instants_; }
  std::size_t values() const { return rows_.size() * Channels; }

  std::vector<std::array<double, Channels>> series_chi2() const {
    auto out = series_chi2_;
    for (std::size_t s = 0; s < out.size(); ++s)
      for (double& x : out[s]) x = series_rows_[s] > 0 ? x / series_rows_[s] : 0.0;
    return out;
  }

  PiecewisePolynomial<Channels, Degree> polynomial(const Grid& grid) const {
    std::vector<double> breaks;
    for (double e : grid.edges) breaks.push_back(problem_.begin + e);
    breaks.back() = problem_.end;
    for (const SplineBreak& b : problem_.breaks)  // exactly as given, whatever rounding did to them
      *std::min_element(breaks.begin(), breaks.end(), [&](double x, double y) {
        return std::abs(x - b.time) < std::abs(y - b.time);
      }) = b.time;
    std::vector<typename PiecewisePolynomial<Channels, Degree>::Coefficients> pieces(grid.column.size());
    Basis<Degree> b;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      basis<Degree>(grid, static_cast<int>(i), grid.edges[i], Degree, b);
      double factorial = 1.0;
      for (int k = 0; k <= Degree; ++k) {
        if (k > 0) factorial *= k;
        for (int c = 0; c < Channels; ++c) {
          double sum = 0.0;
          for (int j = 0; j <= Degree; ++j)
            sum += b[k][j] * coefficients_[(grid.column[i] + j) * Channels + c];
          pieces[i][k][c] = sum / factorial;
        }
      }
    }
    return {std::move(breaks), std::move(pieces)};
  }

 private:
  struct Sample {
    double time;
    int series;
    const double* value;
  };

  void make_rows(const Grid& grid) {
    rows_.clear();
    rows_.reserve(samples_.size());
    const int intervals = static_cast<int>(grid.column.size());
    interval_instants_.assign(intervals, 0);
    Basis<Degree> b;
    int i = 0, last_interval = -1;
    double last_time = -1.0;
    for (const Sample& s : samples_) {
      while (i + 1 < intervals && grid.edges[i + 1] <= s.time) ++i;
      if (i != last_interval || s.time != last_time) {
        basis<Degree>(grid, i, s.time, 2, b);
        ++interval_instants_[i];
        last_interval = i;
        last_time = s.time;
      }
      rows_.push_back({s.series, i, b[problem_.observations[s.series].derivative], s.value});
    }
  }

  // Householder QR of the design for channels [first, first + count), whose sigma differ by a common factor
  // only. Rows come interval by interval; each block is folded into the Degree + 1 rows of R that it can
  // reach.
  void factorise(const Grid& grid, int first, int count) {
    constexpr int kBand = Degree + 1;
    const int width = kBand + count;
    factor_.assign(static_cast<std::size_t>(grid.functions) * width, 0.0);
    std::size_t next = 0;
    const int intervals = static_cast<int>(grid.column.size());
    for (int i = 0; i < intervals; ++i) {
      std::size_t stop = next;
      while (stop < rows_.size() && rows_[stop].interval == i) ++stop;
      const int height = kBand + static_cast<int>(stop - next);
      block_.assign(static_cast<std::size_t>(width) * height, 0.0);  // column-major
      for (int r = 0; r < kBand; ++r) {  // the row of R for column k holds columns k ... k + Degree
        const double* row = &factor_[static_cast<std::size_t>(grid.column[i] + r) * width];
        for (int j = r; j < kBand; ++j) block_[j * height + r] = row[j - r];
        for (int c = 0; c < count; ++c) block_[(kBand + c) * height + r] = row[kBand + c];
      }
      for (int r = kBand; r < height; ++r) {
        const auto& row = rows_[next + r - kBand];
        const auto& sigma = problem_.observations[row.series].sigma;
        const double weight = 1.0 / sigma[first];
        for (int j = 0; j < kBand; ++j) block_[j * height + r] = row.weights[j] * weight;
        for (int c = 0; c < count; ++c) block_[(kBand + c) * height + r] = row.value[first + c] * weight;
      }
      reduce(height, kBand, width);
      for (int r = 0; r < kBand; ++r) {
        double* row = &factor_[static_cast<std::size_t>(grid.column[i] + r) * width];
        for (int j = 0; j < kBand; ++j) row[j] = r + j < kBand ? block_[(r + j) * height + r] : 0.0;
        for (int c = 0; c < count; ++c) row[kBand + c] = block_[(kBand + c) * height + r];
      }
      next = stop;
    }
    double largest = 0.0;
    for (int k = 0; k < grid.functions; ++k)
      largest = std::max(largest, std::abs(factor_[static_cast<std::size_t>(k) * width]));
    for (int k = grid.functions - 1; k >= 0; --k) {
      const double* row = &factor_[static_cast<std::size_t>(k) * width];
      if (k == grid.functions - 1 &&
          problem_.end_value) {  // the last B-spline is the only one alive at the end
        for (int c = 0; c < count; ++c)
          coefficients_[k * Channels + first + c] = (*problem_.end_value)[first + c];
        continue;
      }
      if (!(std::abs(row[0]) > 1e-13 * largest))
        throw std::invalid_argument(
            "fit_spline: the observations do not determine the spline (too few samples "
            "between breaks near t = " +
            std::to_string(problem_.begin + grid.knots[k + Degree / 2 + 1]) + " s)");
      for (int c = 0; c < count; ++c) {
        double sum = row[kBand + c];
        for (int j = 1; j < kBand && k + j < grid.functions; ++j)
          sum -= row[j] * coefficients_[(k + j) * Channels + first + c];
        coefficients_[k * Channels + first + c] = sum / row[0];
      }
    }
  }

  void reduce(int height, int columns, int width) {
    for (int k = 0; k < columns; ++k) {
      double* const pivot = &block_[static_cast<std::size_t>(k) * height];
      double below = 0.0;
      for (int r = k + 1; r < height; ++r) below += pivot[r] * pivot[r];
      if (below == 0.0) continue;
      const double norm = std::copysign(std::sqrt(pivot[k] * pivot[k] + below), pivot[k]);
      const double head = pivot[k] + norm;
      const double scale = 2.0 / (head * head + below);
      for (int j = k + 1; j < width; ++j) {
        double* const column = &block_[static_cast<std::size_t>(j) * height];
        double product = head * column[k];
        for (int r = k + 1; r < height; ++r) product += pivot[r] * column[r];
        product *= scale;
        column[k] -= product * head;
        for (int r = k + 1; r < height; ++r) column[r] -= product * pivot[r];
      }
      pivot[k] = -norm;
    }
  }

  void measure(const Grid& grid) {
    series_chi2_.assign(problem_.observations.size(), {});
    series_rows_.assign(problem_.observations.size(), 0);
    const std::size_t series = problem_.observations.size();
    interval_chi2_.assign(grid.column.size() * series, 0.0);
    interval_lag_.assign(grid.column.size() * series, 0.0);
    interval_rows_.assign(grid.column.size() * series, 0);
    std::vector<std::array<double, Channels>> last(series);
    total_ = 0.0;
    for (const auto& row : rows_) {
      const auto& sigma = problem_.observations[row.series].sigma;
      const double* c0 = &coefficients_[static_cast<std::size_t>(grid.column[row.interval]) * Channels];
      for (int c = 0; c < Channels; ++c) {
        double model = 0.0;
        for (int j = 0; j <= Degree; ++j) model += row.weights[j] * c0[j * Channels + c];
        const double e = (model - row.value[c]) / sigma[c];
        series_chi2_[row.series][c] += e * e;
        interval_chi2_[row.interval * series + row.series] += e * e;
        if (interval_rows_[row.interval * series + row.series] > 0)
          interval_lag_[row.interval * series + row.series] += e * last[row.series][c];
        last[row.series][c] = e;
        total_ += e * e;
      }
      ++series_rows_[row.series];
      interval_rows_[row.interval * series + row.series] += Channels;
    }
  }

  const Problem& problem_;
  bool common_scale_{};
  std::vector<Sample> samples_;
  std::vector<SplineRow<Channels, Degree>> rows_;
  std::vector<double> factor_, block_, coefficients_;
  std::vector<std::array<double, Channels>> series_chi2_;
  std::vector<double> interval_chi2_, interval_lag_;
  std::vector<int> series_rows_, interval_rows_, interval_instants_;
  double total_{};
};

}  // namespace unhand::dynamics
