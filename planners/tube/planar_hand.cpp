#include "planners/tube/planar_hand.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dynamics/dense_solve.hpp"

namespace unhand::planners {

ThrowPlane::ThrowPlane(const Eigen::Vector3d& tip, const Eigen::Vector3d& target_) : target(target_) {
  const Eigen::Vector2d e = (target - tip).head<2>();
  if (!(e.norm() > 1e-6))
    throw std::invalid_argument("throw plane: the tip is right above or below the target");
  along = e.normalized();
}

namespace {

constexpr int N = PlanarHand::kPoints;

double point(int k) { return std::cos((k + 0.5) * std::numbers::pi / N); }

/// Coefficients of powers from values at the points.
const Eigen::MatrixXd& from_values() {
  static const Eigen::MatrixXd inverse = [] {
    Eigen::MatrixXd powers(N, N);
    for (int k = 0; k < N; ++k)
      for (int j = 0; j < N; ++j) powers(k, j) = std::pow(point(k), j);
    return dynamics::least_squares(powers, Eigen::MatrixXd::Identity(N, N));
  }();
  return inverse;
}

template <class S, class Coefficients>
release::HandState<S> evaluate(const Coefficients& c, double end, const S& t) {
  const double rate = 2 / end;
  const S s = rate * t - 1.0;
  std::array<S, 3> p, v, a;
  for (int i = 0; i < 3; ++i) {  // Horner, with both derivatives
    p[i] = S(c[N - 1][i]);
    v[i] = a[i] = S(0.0);
    for (int k = N - 2; k >= 0; --k) {
      a[i] = a[i] * s + 2.0 * v[i];
      v[i] = v[i] * s + p[i];
      p[i] = p[i] * s + c[k][i];
    }
    v[i] *= rate;
    a[i] *= rate * rate;
  }
  return {{p[0], p[1], p[2]}, {v[0], v[1], v[2]}, {a[0], a[1], a[2]}};
}

}  // namespace

PlanarHand::PlanarHand(const Chain& chain, const ThrowPlane& plane, const JointVector<double>& q,
                       const JointVector<Dual>& qd, const JointVector<Dual>& qdd, double end)
    : end_(end), coefficients_{}, values_{} {
  std::array<std::array<Dual, 3>, N> poses;
  const Eigen::Vector2d left(-plane.along.y(), plane.along.x());
  for (int k = 0; k < N; ++k) {
    const double t = 0.5 * end * (1 + point(k));
    JointVector<Dual> at(chain.size());
    for (int i = 0; i < chain.size(); ++i) at[i] = q[i] + t * qd[i] + (0.5 * t * t) * qdd[i];
    const Transform<Dual> tip = forward_kinematics(chain, at);
    const double off = left.x() * (tip.p[0].a - plane.target[0]) + left.y() * (tip.p[1].a - plane.target[1]),
                 tilt = left.x() * tip.R(0, 2).a + left.y() * tip.R(1, 2).a;
    if (std::abs(off) > 1e-3 || std::abs(tilt) > 1e-2)
      throw std::invalid_argument(
          fmt::format("the throw is not planar: at {:.3f} s the tip is {:.4f} m beside the plane to the "
                      "target, its axis turned out by {:.4f}",
                      t, off, tilt));
    poses[k] = plane.pose(tip);
    if (k > 0) {  // θ is not wrapped
      const double turns = std::round((poses[k][2].a - poses[k - 1][2].a) / (2 * std::numbers::pi));
      poses[k][2].a -= turns * 2 * std::numbers::pi;
    }
  }
  const auto& inverse = from_values();
  for (int j = 0; j < N; ++j)
    for (int i = 0; i < 3; ++i) {
      Dual sum(0.0);
      for (int k = 0; k < N; ++k) sum += inverse(j, k) * poses[k][i];
      coefficients_[j][i] = sum;
      values_[j][i] = sum.a;
    }
  // Farthest from the points, at the ends, it errs most.
  constexpr double kMost = 1e-3;  // m
  for (const double t : {0.0, end}) {
    JointVector<double> at(chain.size());
    for (int i = 0; i < chain.size(); ++i) at[i] = q[i] + t * qd[i].a + 0.5 * t * t * qdd[i].a;
    const auto pose = plane.pose(forward_kinematics(chain, at));
    const auto fitted = evaluate(values_, end_, t).pose;
    if (const double off = std::hypot(fitted.x - pose[0], fitted.z - pose[1]); !(off <= kMost))
      throw std::invalid_argument(
          fmt::format("planar hand: over {} s the motion turns too far for a polynomial of degree {} ({:.2g} "
                      "m off; accepted: {})",
                      end, N - 1, off, kMost));
  }
}

release::HandState<double> PlanarHand::at(const dynamics::Window&, double t) const {
  return evaluate(values_, end_, t);
}
release::HandState<Dual> PlanarHand::at(const dynamics::Window&, const Dual& t) const {
  return evaluate(coefficients_, end_, t);
}

}  // namespace unhand::planners
