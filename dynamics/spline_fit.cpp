#include "dynamics/spline_fit.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "dynamics/spline_solver.hpp"

namespace unhand::dynamics {
namespace {

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

constexpr double kNoise = 1.1;  // χ² per degree of freedom, beside its own statistical scatter
constexpr int kFewest = 3;      // samples in an interval
constexpr double kSignificant = 3.0, kCertain = 4.5;  // standard deviations

// Halves the marked intervals that have samples enough; false if there was none.
bool halve(Grid& grid, const std::vector<bool>& marked, const std::vector<int>& instants, int degree) {
  Grid finer;
  bool any = false;
  for (std::size_t i = 0; i + 1 < grid.edges.size(); ++i) {
    finer.edges.push_back(grid.edges[i]);
    finer.continuity.push_back(grid.continuity[i]);
    if (marked[i] && instants[i] >= 2 * kFewest) {
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
SplineFit<Channels, Degree> fit_spline(const SplineProblem<Channels, Degree>& problem) {
  check(problem);
  Grid grid;
  double from = 0.0;
  int continuity = 0;
  for (std::size_t i = 0; i <= problem.breaks.size(); ++i) {
    const double to = (i < problem.breaks.size() ? problem.breaks[i].time : problem.end) - problem.begin;
    grid.edges.push_back(from);
    grid.continuity.push_back(continuity);
    if (i < problem.breaks.size()) continuity = problem.breaks[i].continuity;
    from = to;
  }
  grid.edges.push_back(from);
  grid.continuity.push_back(0);
  grid.lay_out(Degree);

  SplineSolver<Channels, Degree> solver(problem);
  solver.solve(grid);
  const auto dof = [&] { return static_cast<double>(solver.values()) - grid.functions * Channels; };
  const auto limit = [&](double n, double z) { return kNoise * n + z * std::sqrt(2.0 * n); };
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
  Grid best = grid;
  double best_total = solver.total();
  for (int idle = 0; !is_noise() && idle < 2;) {
    const double misfit = bad_total;
    if (!halve(grid, bad, solver.interval_instants(), Degree)) break;
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
  bad = find_bad(kCertain);  // an interval that only looked bad, and did not improve, is no misfit
  SplineFit<Channels, Degree> fit{solver.polynomial(grid), {}};
  fit.summary.chi2 = solver.series_chi2();
  fit.summary.chi2_per_dof = dof() > 0.0 ? solver.total() / dof() : 0.0;
  fit.summary.knots = static_cast<int>(grid.column.size()) - 1;
  fit.summary.noise_reached = is_noise();
  return fit;
}

template SplineFit<1, 5> fit_spline(const SplineProblem<1, 5>&);
template SplineFit<3, 5> fit_spline(const SplineProblem<3, 5>&);

}  // namespace unhand::dynamics
