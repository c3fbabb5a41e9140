#include "dynamics/spline_fit.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace unhand::dynamics {
namespace {

// Where the intervals lie: interval i is [edges[i], edges[i + 1]) in time relative to the problem's begin,
// and its B-splines are numbers column[i] ... column[i] + degree of the knot vector.
struct Grid {
  std::vector<double> edges;
  std::vector<int> continuity;  // at edges 1 ... size - 2
  std::vector<double> knots;
  std::vector<int> column;
  int functions{};

  void lay_out(int degree) {
    const int intervals = static_cast<int>(edges.size()) - 1;
    knots.assign(degree + 1, edges.front());
    column.assign(intervals, 0);
    for (int i = 1; i < intervals; ++i) {
      const int multiplicity = degree - continuity[i];
      knots.insert(knots.end(), multiplicity, edges[i]);
      column[i] = column[i - 1] + multiplicity;
    }
    knots.insert(knots.end(), degree + 1, edges.back());
    functions = column.back() + degree + 1;
  }
};

// The B-splines of interval i and their derivatives up to `order` at x: the Cox-de Boor triangle,
// differentiated through the coefficients of divided differences (Piegl and Tiller, The NURBS Book, 2.3).
template <int Degree>
using Basis = std::array<std::array<double, Degree + 1>, Degree + 1>;  // [derivative][function]

template <int Degree>
void basis(const Grid& grid, int i, double x, int order, Basis<Degree>& out) {
  const double* const knot = grid.knots.data() + grid.column[i] + Degree;
  double triangle[Degree + 1][Degree + 1], left[Degree + 1], right[Degree + 1];
  triangle[0][0] = 1.0;
  for (int j = 1; j <= Degree; ++j) {
    left[j] = x - knot[1 - j];
    right[j] = knot[j] - x;
    double saved = 0.0;
    for (int r = 0; r < j; ++r) {
      triangle[j][r] = right[r + 1] + left[j - r];
      const double part = triangle[r][j - 1] / triangle[j][r];
      triangle[r][j] = saved + right[r + 1] * part;
      saved = left[j - r] * part;
    }
    triangle[j][j] = saved;
  }
  for (int j = 0; j <= Degree; ++j) out[0][j] = triangle[j][Degree];
  for (int r = 0; r <= Degree; ++r) {
    double a[2][Degree + 1] = {};
    a[0][0] = 1.0;
    int now = 0, next = 1;
    for (int k = 1; k <= order; ++k) {
      double d = 0.0;
      const int rk = r - k, pk = Degree - k;
      if (rk >= 0) {
        a[next][0] = a[now][0] / triangle[pk + 1][rk];
        d = a[next][0] * triangle[rk][pk];
      }
      const int first = rk >= -1 ? 1 : -rk, last = r - 1 <= pk ? k - 1 : Degree - r;
      for (int j = first; j <= last; ++j) {
        a[next][j] = (a[now][j] - a[now][j - 1]) / triangle[pk + 1][rk + j];
        d += a[next][j] * triangle[rk + j][pk];
      }
      if (r <= pk) {
        a[next][k] = -a[now][k - 1] / triangle[pk + 1][r];
        d += a[next][k] * triangle[r][pk];
      }
      out[k][r] = d;
      std::swap(now, next);
    }
  }
  double factor = Degree;
  for (int k = 1; k <= order; ++k) {
    for (double& d : out[k]) d *= factor;
    factor *= Degree - k;
  }
}

// One observed instant: its design row and measured values, not yet divided by sigma.
template <int Channels, int Degree>
struct Row {
  int series{}, interval{};
  std::array<double, Degree + 1> weights{};
  const double* value{};
};

template <int Channels, int Degree>
class Solver {
 public:
  using Problem = SplineProblem<Channels, Degree>;

  explicit Solver(const Problem& problem) : problem_(problem) {
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
  double largest() const { return largest_; }
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
    total_ = largest_ = 0.0;
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
        largest_ = std::max(largest_, std::abs(e));
      }
      ++series_rows_[row.series];
      interval_rows_[row.interval * series + row.series] += Channels;
    }
  }

  const Problem& problem_;
  bool common_scale_{};
  std::vector<Sample> samples_;
  std::vector<Row<Channels, Degree>> rows_;
  std::vector<double> factor_, block_, coefficients_;
  std::vector<std::array<double, Channels>> series_chi2_;
  std::vector<double> interval_chi2_, interval_lag_;
  std::vector<int> series_rows_, interval_rows_, interval_instants_;
  double total_{}, largest_{};
};

template <int Channels, int Degree>
void check(const SplineProblem<Channels, Degree>& p) {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("fit_spline: ") + what);
  };
  require(std::isfinite(p.begin) && std::isfinite(p.end) && p.end > p.begin, "end must be later than begin");
  double last = p.begin;
  for (const SplineBreak& b : p.breaks) {
    require(b.time > last && b.time < p.end, "breaks must increase strictly inside (begin, end)");
    require(b.continuity >= 0 && b.continuity < Degree, "continuity must be in [0, Degree - 1]");
    last = b.time;
  }
  require(!p.observations.empty(), "at least one observed series is needed");
  for (const auto& o : p.observations) {
    require(o.derivative >= 0 && o.derivative <= 2, "derivative must be 0, 1 or 2");
    require(o.value.size() == o.time.size() * Channels, "value must hold one row per time");
    for (double s : o.sigma) require(std::isfinite(s) && s > 0.0, "sigma must be finite and > 0");
    for (double x : o.time) require(std::isfinite(x), "times must be finite");
    for (double x : o.value) require(std::isfinite(x), "values must be finite");
  }
}

// Halves the marked intervals that have samples enough; false if there was none.
bool halve(Grid& grid, const std::vector<bool>& marked, const std::vector<int>& instants, int least,
           int degree) {
  Grid finer;
  bool any = false;
  for (std::size_t i = 0; i + 1 < grid.edges.size(); ++i) {
    finer.edges.push_back(grid.edges[i]);
    finer.continuity.push_back(grid.continuity[i]);
    if (marked[i] && instants[i] >= 2 * least) {
      finer.edges.push_back(0.5 * (grid.edges[i] + grid.edges[i + 1]));
      finer.continuity.push_back(degree - 1);
      any = true;
    }
  }
  finer.edges.push_back(grid.edges.back());
  finer.continuity.push_back(0);
  if (any) {
    finer.lay_out(degree);
    grid = std::move(finer);
  }
  return any;
}

}  // namespace

template <int Channels, int Degree>
SplineFit<Channels, Degree> fit_spline(const SplineProblem<Channels, Degree>& problem,
                                       const SplineOptions& options) {
  check(problem);
  Grid grid;
  double from = 0.0;
  int continuity = 0;
  for (std::size_t i = 0; i <= problem.breaks.size(); ++i) {
    const double to = (i < problem.breaks.size() ? problem.breaks[i].time : problem.end) - problem.begin;
    const int parts = std::max(1, options.initial_intervals);
    for (int k = 0; k < parts; ++k) {
      grid.edges.push_back(from + (to - from) * k / parts);
      grid.continuity.push_back(k == 0 ? continuity : Degree - 1);
    }
    if (i < problem.breaks.size()) continuity = problem.breaks[i].continuity;
    from = to;
  }
  grid.edges.push_back(from);
  grid.continuity.push_back(0);
  grid.lay_out(Degree);

  Solver<Channels, Degree> solver(problem);
  solver.solve(grid);
  const auto dof = [&] { return static_cast<double>(solver.values()) - grid.functions * Channels; };
  const auto limit = [&](double n, double z) { return options.chi2_target * n + z * std::sqrt(2.0 * n); };
  constexpr double kSignificant = 3.0, kCertain = 4.5;
  const std::size_t series = problem.observations.size();
  double bad_total = 0.0;                // the chi2 that halving is meant to lower
  const auto find_bad = [&](double z) {  // intervals whose residual is not noise, at z standard deviations
    std::vector<bool> bad(grid.column.size());
    bad_total = 0.0;
    for (std::size_t i = 0; i < bad.size(); ++i)
      for (std::size_t k = i * series; k < (i + 1) * series; ++k)
        // A misfit is smooth: it shows in the product of neighbours before it does in the size.
        if (solver.interval_chi2()[k] > limit(solver.interval_rows()[k], z) ||
            solver.interval_lag()[k] > z * std::sqrt(static_cast<double>(solver.interval_rows()[k]))) {
          bad[i] = true;
          bad_total += solver.interval_chi2()[k];
        }
    if (solver.total() > limit(std::max(1.0, dof()), z) && bad_total == 0.0) {
      bad.assign(bad.size(), true);
      bad_total = solver.total();
    }
    return bad;
  };
  std::vector<bool> bad = find_bad(kSignificant);
  const auto is_noise = [&] { return std::find(bad.begin(), bad.end(), true) == bad.end(); };
  if (options.refine) {
    Grid best = grid;
    double best_total = solver.total();
    for (int idle = 0; !is_noise() && idle < 2;) {
      const double misfit = bad_total;
      if (!halve(grid, bad, solver.interval_instants(), std::max(1, options.min_samples_per_interval),
                 Degree))
        break;
      solver.solve(grid);
      const double added = (grid.functions - best.functions) * Channels;
      if (best_total - solver.total() > std::max(4.0 * added, 0.02 * misfit)) {
        best = grid;
        best_total = solver.total();
        idle = 0;
      } else {
        ++idle;  // a symmetric misfit may need two halvings to give way
      }
      bad = find_bad(kSignificant);
    }
    if (best.functions != grid.functions) {
      grid = best;
      solver.solve(grid);
    }
  }
  bad = find_bad(kCertain);  // an interval that only looked bad, and did not improve, is no misfit
  SplineFit<Channels, Degree> fit{solver.polynomial(grid), {}};
  fit.summary.chi2 = solver.series_chi2();
  fit.summary.chi2_per_dof = dof() > 0.0 ? solver.total() / dof() : 0.0;
  fit.summary.max_whitened_residual = solver.largest();
  fit.summary.knots = static_cast<int>(grid.column.size()) - 1;
  fit.summary.noise_reached = is_noise();
  return fit;
}

template SplineFit<1, 3> fit_spline(const SplineProblem<1, 3>&, const SplineOptions&);
template SplineFit<1, 5> fit_spline(const SplineProblem<1, 5>&, const SplineOptions&);
template SplineFit<3, 5> fit_spline(const SplineProblem<3, 5>&, const SplineOptions&);

}  // namespace unhand::dynamics
