#include "experiment/least_squares.hpp"

#include <cmath>

#include "dynamics/dense_solve.hpp"

namespace unhand::experiment {

using Eigen::MatrixXd;
using Eigen::VectorXd;

bool gauss_newton(const std::function<void(const VectorXd&, VectorXd&, MatrixXd&)>& evaluate,
                  const std::function<void(const VectorXd&)>& accept, int unknowns, double sigma) {
  constexpr int kSteps = 40, kHalvings = 12;
  constexpr double kSolved = 1e-9;  // [m] or [rad]: what the integrator leaves of a state
  VectorXd r, moved_r;
  MatrixXd J, moved_J;
  evaluate(VectorXd::Zero(unknowns), r, J);
  for (int step = 0; step < kSteps; ++step) {
    const dynamics::LeastSquares linear = dynamics::least_squares_with_covariance(J, -r);
    if (linear.covariance.size() == 0) return false;
    const VectorXd d = linear.solution;
    const double cost = r.squaredNorm(), predicted = (J * d).squaredNorm();
    if (!std::isfinite(predicted)) return false;
    const double floor = static_cast<double>(r.size()) * (kSolved / sigma) * (kSolved / sigma);
    if (predicted <= 1e-12 * cost + 1e-2 * floor) {  // a millionth of the scatter
      accept(d);
    } else {
      double k = 1;
      int halving = 0;
      for (; halving < kHalvings; ++halving, k *= 0.5) {
        evaluate(k * d, moved_r, moved_J);
        if (moved_r.squaredNorm() < cost) break;
      }
      if (halving < kHalvings) {
        accept(k * d);
        r = moved_r;
        J = moved_J;
        continue;
      }
      if (predicted > 1e-8 * cost + 1e2 * floor) return false;  // not a minimum that rounding hides
    }
    return true;
  }
  return false;
}

}  // namespace unhand::experiment
