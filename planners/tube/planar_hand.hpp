// The hand that a release sees, made from an arm's joints.
#pragma once

#include <array>

#include "planners/arm/kinematics.hpp"
#include "planners/tube/tube_cvx.hpp"
#include "release/hand_motion.hpp"

namespace unhand::planners {

/// The vertical plane through a tip and its target, as the release's world: x forward of the target, z the
/// height in the base's frame [m].
struct ThrowPlane {
  Eigen::Vector2d along{1, 0};                       ///< in the base's x and y
  Eigen::Vector3d target = Eigen::Vector3d::Zero();  ///< in the base's frame [m]

  /// Throws std::invalid_argument where the tip is right above the target.
  ThrowPlane(const Eigen::Vector3d& tip, const Eigen::Vector3d& target_);
  /// (x, z, θ) of a tip; θ is the angle of its z axis, from x to z [rad].
  template <class S>
  std::array<S, 3> pose(const Transform<S>& tip) const {
    using std::atan2;
    const S x = along.x() * (tip.p[0] - target[0]) + along.y() * (tip.p[1] - target[1]);
    return {x, tip.p[2], atan2(tip.R(2, 2), S(along.x() * tip.R(0, 2) + along.y() * tip.R(1, 2)))};
  }
};

/// The tip of a chain under q(t) = q₀ + q̇₀ t + ½ q̈ t², t from 0 to `end`, as polynomials of degree 8 through
/// its poses at Chebyshev points: twist and acceleration are their exact derivatives, and the poses in
/// between are those of the arm to 1e-9 m for throws of 0.2 s. Coefficients may carry derivatives by q̇₀ and
/// q̈.
class PlanarHand final : public release::HandMotion {
 public:
  static constexpr int kPoints = 9;  ///< Chebyshev points: the degree is one less

  /// Throws std::invalid_argument where the tip leaves the plane by more than 1 mm, or its z axis by more
  /// than 0.01.
  PlanarHand(const Chain& chain, const ThrowPlane& plane, const JointVector<double>& q,
             const JointVector<Dual>& qd, const JointVector<Dual>& qdd, double end);

  release::HandState<double> at(const dynamics::Window&, double t) const override;
  release::HandState<Dual> at(const dynamics::Window&, const Dual& t) const override;
  std::vector<double> jumps() const override { return {}; }
  double begin() const override { return 0; }
  double end() const override { return end_; }

 private:
  double end_;
  std::array<std::array<Dual, 3>, kPoints> coefficients_;  ///< of powers of s = 2 t/end − 1, by channel
  std::array<std::array<double, 3>, kPoints> values_;
};

}  // namespace unhand::planners
