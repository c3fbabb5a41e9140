#include "experiment/planar_arm.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "dynamics/quintic.hpp"

namespace unhand::experiment {

using dynamics::Vec2;

namespace {

using Joints = std::array<double, 3>;

Joints relative(const Joints& links) { return {links[0], links[1] - links[0], links[2] - links[1]}; }

/// Absolute angles of the links for a pose of the hand: the law of cosines for the first two.
Joints link_angles(const PlanarArm& arm, const dynamics::Pose<double>& hand) {
  const auto& [l1, l2, l3] = arm.lengths;
  const Vec2<double> d = hand.position() - arm.base - dynamics::rotate(hand.theta, Vec2<double>{l3, 0});
  const double cosine = (dot(d, d) - l1 * l1 - l2 * l2) / (2 * l1 * l2);
  constexpr double kLimit = 0.999;  // |sin| of the elbow >= 0.045: velocities grow no more than about 22-fold
  if (!(std::abs(cosine) < kLimit))
    throw std::invalid_argument(
        fmt::format("arm: the hand pose ({:.4g} m, {:.4g} m, {:.4g} rad) is out of reach: the wrist would be "
                    "{:.4g} m from the shoulder, links {:.4g} and {:.4g} m",
                    hand.x, hand.z, hand.theta, norm(d), l1, l2));
  const double elbow = -std::acos(cosine);  // elbow up
  const double first = std::atan2(d.z, d.x) - std::atan2(l2 * std::sin(elbow), l1 + l2 * std::cos(elbow));
  return {first, first + elbow, hand.theta};
}

/// Angular velocities of the links for a twist of the hand: v = Σ l_i φ_i' e_z(φ_i), of which φ_3' is known.
Joints link_rates(const PlanarArm& arm, const Joints& links, const dynamics::Twist<double>& hand) {
  std::array<Vec2<double>, 3> n;
  for (int i = 0; i < 3; ++i) n[i] = perp(dynamics::rotate(links[i], Vec2<double>{arm.lengths[i], 0}));
  const Vec2<double> v = hand.linear() - hand.omega * n[2];
  const double determinant = n[0].x * n[1].z - n[0].z * n[1].x;
  return {(v.x * n[1].z - v.z * n[1].x) / determinant, (n[0].x * v.z - n[0].z * v.x) / determinant,
          hand.omega};
}

/// A stretch q + q' s of joint motion whose s(t) starts with the value, rate [1/s] and acceleration [1/s²]
/// given.
PlanarArmHand::JointPath::Coefficients stretch(const Joints& q, const Joints& rate, double s, double ds,
                                               double dds) {
  PlanarArmHand::JointPath::Coefficients c{};
  for (int i = 0; i < 3; ++i) {
    c[0][i] = q[i] + rate[i] * s;
    c[1][i] = rate[i] * ds;
    c[2][i] = 0.5 * rate[i] * dds;
  }
  return c;
}

}  // namespace

PlanarArmHand::PlanarArmHand(const PlanarArm& arm, JointPath joints) : arm_(arm), joints_(std::move(joints)) {
  for (const double l : arm.lengths)
    if (!(l > 0 && std::isfinite(l)))
      throw std::invalid_argument(fmt::format("arm: link length {} m is not > 0", l));
  jumps_.assign(joints_.breaks().begin() + 1, joints_.breaks().end() - 1);
}

PlanarArmHand throw_motion(const PlanarArm& arm, const ThrowMotion& motion) {
  const auto& [begin, change, follow, end, pose, twist, before, after] = motion;
  if (!(begin < change && change < follow && follow < end))
    throw std::invalid_argument(
        fmt::format("arm: begin {} s, switch_time {} s, follow_through {} s and end {} s must increase",
                    begin, change, follow, end));
  const double speed = norm(twist.linear());
  if (!(speed > 0 && std::isfinite(speed)))
    throw std::invalid_argument(
        fmt::format("arm: the hand's speed at the switch, {} m/s, is not > 0", speed));
  const Joints links = link_angles(arm, pose), q = relative(links),
               rate = relative(link_rates(arm, links, twist));
  // τ = t − change; s = τ + ½ (a/|v|) τ² on either side of the switch.
  const double t0 = begin - change, t1 = follow - change, a0 = before / speed, a1 = after / speed;
  const double last_rate = 1 + a1 * t1;
  return {arm, PlanarArmHand::JointPath(
                   {begin, change, follow, end},
                   {stretch(q, rate, t0 * (1 + 0.5 * a0 * t0), 1 + a0 * t0, a0), stretch(q, rate, 0, 1, a1),
                    stretch(q, rate, t1 * (1 + 0.5 * a1 * t1), last_rate, -last_rate / (end - follow))})};
}

release::PolynomialHand polynomial_hand(const release::HandMotion& hand, double longest) {
  if (!(longest > 0)) throw std::invalid_argument("polynomial_hand: longest must be > 0 s");
  std::vector<double> ends = hand.jumps(), breaks{hand.begin()};
  ends.push_back(hand.end());
  std::vector<release::PolynomialHand::Polynomial::Coefficients> pieces;
  const auto state = [&](const Window& window, double t) {  // of each coordinate
    const auto s = hand.at(window, t);
    return std::array<std::array<double, 3>, 3>{{{s.pose.x, s.twist.vx, s.acceleration.ax},
                                                 {s.pose.z, s.twist.vz, s.acceleration.az},
                                                 {s.pose.theta, s.twist.omega, s.acceleration.alpha}}};
  };
  for (const double end : ends) {
    const Window stretch{breaks.back(), end};
    const int n = std::max(1, static_cast<int>(std::ceil((end - stretch.begin) / longest)));
    for (int i = 1; i <= n; ++i) {
      const double t0 = breaks.back(), t1 = i == n ? end : stretch.begin + (end - stretch.begin) * i / n;
      const auto first = state(stretch, t0), last = state(stretch, t1);
      auto& c = pieces.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) {
        const auto quintic = dynamics::quintic_between(first[k], last[k], t1 - t0);
        for (std::size_t power = 0; power < 6; ++power) c[power][k] = quintic[power];
      }
      breaks.push_back(t1);
    }
  }
  return release::PolynomialHand({std::move(breaks), std::move(pieces)}, hand.jumps());
}

}  // namespace unhand::experiment
