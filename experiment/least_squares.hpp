// Small least-squares fits: a line in closed form, and Gauss-Newton on a manifold.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <span>

namespace unhand::experiment {

/// p + v t fitted to y: closed form, about the mean time. Weights are equal, sigma only scales the
/// covariance.
struct FittedLine {
  double p{}, v{};
  Eigen::Matrix2d covariance;
};
inline FittedLine fit_line(std::span<const double> t, std::span<const double> y, double sigma) {
  const auto n = static_cast<double>(t.size());
  double t_mean = 0, y_mean = 0, tt = 0, ty = 0;
  for (std::size_t i = 0; i < t.size(); ++i) t_mean += t[i] / n, y_mean += y[i] / n;
  for (std::size_t i = 0; i < t.size(); ++i) {
    tt += (t[i] - t_mean) * (t[i] - t_mean);
    ty += (t[i] - t_mean) * (y[i] - y_mean);
  }
  FittedLine line;
  line.v = ty / tt;
  line.p = y_mean - line.v * t_mean;
  line.covariance << 1 / n + t_mean * t_mean / tt, -t_mean / tt, -t_mean / tt, 1 / tt;
  line.covariance *= sigma * sigma;
  return line;
}

/// Minimises |r(x)|² by Gauss-Newton with halved steps. evaluate(x, r, J) gives the weighted residual and its
/// Jacobian with respect to d in move(x, d) at d = 0; `sigma` is the weights' scale, by which r is good to
/// kSolved/sigma. False if it does not converge. `covariance` becomes (JᵀJ)⁻¹.
template <class State, class Evaluate, class Move>
bool gauss_newton(State& x, const Evaluate& evaluate, const Move& move, double sigma,
                  Eigen::MatrixXd& covariance) {
  constexpr int kSteps = 40, kHalvings = 12;
  constexpr double kSolved = 1e-9;  // [m] or [rad]: what the integrator leaves of a state
  Eigen::VectorXd r;
  Eigen::MatrixXd J;
  evaluate(x, r, J);
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(J);
    if (qr.rank() < J.cols()) return false;
    const Eigen::VectorXd d = qr.solve(-r);
    const double cost = r.squaredNorm(), predicted = (J * d).squaredNorm();
    if (!std::isfinite(predicted)) return false;
    const double floor = static_cast<double>(r.size()) * (kSolved / sigma) * (kSolved / sigma);
    if (predicted <= 1e-12 * cost + 1e-2 * floor) {  // a millionth of the scatter
      x = move(x, d);
    } else {
      double k = 1;
      Eigen::VectorXd moved_r;
      Eigen::MatrixXd moved_J;
      State moved = x;
      int halving = 0;
      for (; halving < kHalvings; ++halving, k *= 0.5) {
        moved = move(x, Eigen::VectorXd(k * d));
        evaluate(moved, moved_r, moved_J);
        if (moved_r.squaredNorm() < cost) break;
      }
      if (halving < kHalvings) {
        x = moved;
        r = moved_r;
        J = moved_J;
        continue;
      }
      if (predicted > 1e-8 * cost + 1e2 * floor) return false;  // not a minimum that rounding hides
    }
    covariance = (J.transpose() * J).inverse();
    return true;
  }
  return false;
}

}  // namespace unhand::experiment
