#include "fitting/discovery/missing_force.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "dynamics/dense_solve.hpp"
#include "fitting/discovery/trace_rows.hpp"
#include "fitting/hat.hpp"

namespace unhand::fitting {

using dynamics::definite_inverse, dynamics::definite_solve, dynamics::gram, dynamics::inner_products;

std::array<double, 3> MissingCurve::at(double time) const {
  std::array<double, 3> out{};
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t j = 0; j < knots.size(); ++j) out[c] += value[c][j] * hat(knots, j, time);
  return out;
}

std::vector<MissingCurve> missing_curves(const std::vector<ResidualTrace>& traces,
                                         const MissingOptions& options) {
  std::set<int> groups;
  for (const auto& t : traces) groups.insert(t.group);
  std::vector<MissingCurve> out;
  const auto n = static_cast<std::size_t>(std::max(2, options.knots));
  for (const int group : groups) {
    MissingCurve curve;
    curve.group = group;
    double begin = HUGE_VAL, end = -HUGE_VAL;
    for (const auto& t : traces)
      if (t.group == group && t.time.size() >= 3)
        begin = std::min(begin, t.time.front()), end = std::max(end, t.time.back());
    if (!(end > begin)) continue;
    for (std::size_t j = 0; j < n; ++j)
      curve.knots.push_back(begin + (end - begin) * static_cast<double>(j) / static_cast<double>(n - 1));
    const auto width = static_cast<Eigen::Index>(n);
    for (int component = 0; component < 3; ++component) {
      Eigen::MatrixXd H = Eigen::MatrixXd::Zero(width, width);
      Eigen::VectorXd g = Eigen::VectorXd::Zero(width);
      double squares = 0;
      for (const auto& trace : traces) {
        if (trace.group != group) continue;
        const TraceRows rows(trace, component, options);
        if (!rows.enough()) continue;
        Eigen::MatrixXd columns(rows.seen().size(), width);
        for (std::size_t j = 0; j < n; ++j) {
          std::vector<double> basis;
          for (const double t : trace.time) basis.push_back(hat(curve.knots, j, t));
          columns.col(static_cast<Eigen::Index>(j)) = rows.response(basis);
        }
        H += gram(columns);
        g += inner_products(columns, rows.seen());
        squares += rows.seen().squaredNorm();
      }
      auto& value = curve.value[static_cast<std::size_t>(component)];
      auto& sigma = curve.sigma[static_cast<std::size_t>(component)];
      value.assign(n, 0.0), sigma.assign(n, 0.0);
      curve.chi2_before += squares, curve.chi2_after += squares;
      if (!(H.diagonal().maxCoeff() > 0)) continue;
      // Second differences cost a thousandth of what the best determined knot is worth.
      const Eigen::MatrixXd information = H;
      Eigen::MatrixXd D = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(width - 2, 0), width);
      for (Eigen::Index k = 0; k + 2 < width; ++k) D(k, k) = 1, D(k, k + 1) = -2, D(k, k + 2) = 1;
      H += 1e-3 * H.diagonal().maxCoeff() * gram(D);
      H.diagonal().array() += 1e-9 * H.diagonal().maxCoeff();
      const Eigen::VectorXd a = definite_solve(H, g);
      const Eigen::MatrixXd covariance = definite_inverse(H);
      curve.chi2_after += a.dot(information * a) - 2 * a.dot(g);
      for (std::size_t j = 0; j < n; ++j) {
        value[j] = a[static_cast<Eigen::Index>(j)];
        sigma[j] =
            std::sqrt(std::max(0.0, covariance(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(j))));
      }
    }
    out.push_back(std::move(curve));
  }
  return out;
}

}  // namespace unhand::fitting
