// B-splines on a grid of intervals.
#pragma once

#include <array>
#include <vector>

namespace unhand::dynamics {

/// Where the intervals lie: interval i is [edges[i], edges[i + 1]) in time relative to the problem's begin,
/// and its B-splines are numbers column[i] ... column[i] + degree of the knot vector.
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

/// Values of the functions that are not zero in an interval: [derivative][function].
template <int Degree>
using Basis = std::array<std::array<double, Degree + 1>, Degree + 1>;

/// The B-splines of interval i and their derivatives up to `order` at x: the Cox-de Boor triangle,
/// differentiated through the coefficients of divided differences (Piegl and Tiller, The NURBS Book, 2.3).
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

}  // namespace unhand::dynamics
