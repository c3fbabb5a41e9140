#include "planners/tube/planar_joints.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "planners/arm/kinematics.hpp"
#include "planners/tube/require.hpp"

namespace unhand::planners {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kAligned = 1e-4;  ///< of two directions [rad]: files tell quarter turns to a few digits
constexpr double kBeside = 1e-6;   ///< of the target from a plane that does not turn [m]

/// The angle plus whole turns that is within the joint's range and nearest to `near`, if there is one [rad].
std::optional<double> within_range(double angle, const JointLimits& limits, double near) {
  std::optional<double> best;
  const double nearest = std::round((near - angle) / (2 * kPi));
  for (const double turns : {nearest - 1, nearest, nearest + 1}) {
    const double one = angle + 2 * kPi * turns;
    if (one < limits.lower || one > limits.upper) continue;
    if (!best || std::abs(one - near) < std::abs(*best - near)) best = one;
  }
  return best;
}

/// Joints that move in the plane whose normal is the axis of the first of them.
struct Plane {
  const Chain& chain;
  JointVector<double> q;    ///< where the joints that do not move are held [rad]
  std::vector<int> moving;  ///< from the base outwards
  Vector3d normal;

  /// Of a joint; after the joints' that of the tip.
  Vector3d axis(int j) const {
    const auto frames = frames_of(chain, q);
    return (j < chain.size() ? frames.links[j] : frames.tip).R.col(2);
  }
  /// Whether the axis is along the normal as it is (1), turned round (-1), or across it (0).
  bool stands(int j, double cosine) const {
    const double is = normal.dot(axis(j));
    return cosine == 0 ? std::abs(is) < kAligned : cosine * is > std::cos(kAligned);
  }
  /// Brings the axis there by one of the joints between the last that moves and it, if one can: the cosine is
  /// A + B cos q + C sin q of that joint's angle.
  bool turn(int j, double cosine) {
    for (int i = j - 1; i > moving.back(); --i) {
      const double from = q[i];
      const auto cosine_at = [&](double angle) {
        q[i] = angle;
        return normal.dot(axis(j));
      };
      const double at_0 = cosine_at(0), at_pi = cosine_at(kPi), A = 0.5 * (at_0 + at_pi),
                   B = 0.5 * (at_0 - at_pi), C = cosine_at(kPi / 2) - A,
                   share = (cosine - A) / std::hypot(B, C);
      std::optional<double> best;
      if (std::abs(share) < 1 + kAligned * kAligned)
        for (const double side : {1.0, -1.0}) {
          const double angle = std::atan2(C, B) + side * std::acos(std::clamp(share, -1.0, 1.0));
          const auto one = within_range(angle, chain.joints[i].limits, from);
          if (one && (!best || std::abs(*one - from) < std::abs(*best - from))) best = one;
        }
      q[i] = best.value_or(from);
      if (best) return true;
    }
    return false;
  }
};

/// At most `most` joints move, from `first` on; `turn`: whether others may be held elsewhere than at home.
/// Nothing where the tip's axis does not stay in a vertical plane, or fewer than two move.
std::optional<Plane> plane_of(const Chain& chain, const JointVector<double>& home, int first, int most,
                              bool turn) {
  Plane out{chain, home, {first}, {}};
  out.normal = out.axis(first);
  if (std::abs(out.normal.z()) > kAligned) return {};
  const auto brought = [&](int j, double cosine) {
    return out.stands(j, cosine) || (turn && out.turn(j, cosine));
  };
  for (int j = first + 1; j < chain.size() && static_cast<int>(out.moving.size()) < most; ++j)
    if (brought(j, 1) || brought(j, -1)) out.moving.push_back(j);
  if (out.moving.size() < 2 || !brought(chain.size(), 0)) return {};
  return out;
}

/// The plane in which most joints move, with the others as at home if there is one.
std::optional<Plane> widest_plane(const Chain& chain, const JointVector<double>& home, int turning) {
  for (const bool turn : {false, true}) {
    std::optional<Plane> best;
    for (int first = turning; first < chain.size(); ++first)
      for (int most = chain.size() - first; most >= 2; --most) {
        auto one = plane_of(chain, home, first, most, turn);
        if (one && (!best || one->moving.size() > best->moving.size())) best.emplace(std::move(*one));
      }
    if (best) return best;
  }
  return {};
}

/// Angles of an upright first joint that turn the plane to the target, that on the arm's side first, whether
/// within its range or not [rad]; none where the target is nearer to the joint's axis than the plane.
std::vector<double> turns_to(const Plane& plane, const Vector3d& target) {
  const Transform<double>& base = plane.chain.joints.front().origin;
  const Vector2d n = plane.normal.head<2>(), forward(n.y(), -n.x()), to = (target - base.p).head<2>(),
                 tip = (forward_kinematics(plane.chain, plane.q).p - base.p).head<2>();
  const double beside = n.dot(tip), distance = to.norm();
  if (!(std::abs(beside) < distance)) return {};
  const double straight = std::atan2(to.y(), to.x()) - std::atan2(forward.y(), forward.x()),
               aside = std::asin(beside / distance), axis = base.R(2, 2) > 0 ? 1 : -1;
  std::vector<double> out{axis * (straight - aside), axis * (straight + aside - kPi)};
  if (forward.dot(tip) < 0) std::swap(out[0], out[1]);
  return out;
}

}  // namespace

std::optional<std::vector<NominalOptions::Fixed>> planar_joints(const Chain& chain,
                                                                const JointVector<double>& home,
                                                                const Vector3d& target, std::string* reason) {
  validate(chain);
  require_joints(chain, "planar joints", "home", home);
  for (const double one : target)
    require(std::isfinite(one), "planar joints", "target", one, "(-inf, inf) m");
  const auto none = [&](const std::string& why) {
    if (reason != nullptr) *reason = why;
    return std::nullopt;
  };
  const Joint& first = chain.joints.front();
  const bool turns = std::abs(first.origin.R(2, 2)) > std::cos(kAligned);
  JointVector<double> q = home;
  if (turns) q[0] = 0;
  const auto plane = widest_plane(chain, q, turns ? 1 : 0);
  if (!plane)
    return none(
        "no two of its joints have level, parallel axes across which the tip's axis can be held by the "
        "others");
  std::vector<NominalOptions::Fixed> out;
  if (turns) {
    const auto angles = turns_to(*plane, target);
    if (angles.empty())
      return none(fmt::format(
          "the target is nearer to the axis of {} than the plane in which the others move", first.name));
    std::optional<double> angle;
    for (const double one : angles)
      if (!angle) angle = within_range(one, first.limits, home[0]);
    if (!angle) return none(fmt::format("{} cannot turn to the target within its range", first.name));
    out.push_back({0, *angle});
  } else if (const double beside = plane->normal.dot(target - forward_kinematics(chain, plane->q).p);
             std::abs(beside) > kBeside) {
    return none(
        fmt::format("no upright first joint turns it to the target, which is {:.3g} m beside its plane",
                    std::abs(beside)));
  }
  for (int i = turns ? 1 : 0; i < chain.size(); ++i)
    if (std::find(plane->moving.begin(), plane->moving.end(), i) == plane->moving.end())
      out.push_back({i, plane->q[i]});
  return out;
}

}  // namespace unhand::planners
