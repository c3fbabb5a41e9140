#include "planners/arm/chain.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <stdexcept>

namespace unhand::planners {

Transform<double> modified_dh(double a, double alpha, double d) {
  const auto exact = [](double x) { return std::abs(x) < 1e-15 ? 0.0 : x; };
  const double c = exact(std::cos(alpha)), s = exact(std::sin(alpha));
  Transform<double> out;
  out.R << 1, 0, 0, 0, c, -s, 0, s, c;
  out.p << a, -s * d, c * d;
  return out;
}

Eigen::Matrix3d symmetric(double xx, double yy, double zz, double xy, double xz, double yz) {
  Eigen::Matrix3d out;
  out << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return out;
}

Inertia seen_from(const Transform<double>& at, const Inertia& body) {
  return {body.mass, at.R * body.com + at.p, at.R * body.about_com * at.R.transpose()};
}

Inertia together(const Inertia& a, const Inertia& b) {
  const double mass = a.mass + b.mass;
  if (!(mass > 0)) return {};
  const Eigen::Vector3d com = (a.mass * a.com + b.mass * b.com) / mass;
  const auto about = [&](const Inertia& body) -> Eigen::Matrix3d {  // parallel axes
    const Eigen::Vector3d r = body.com - com;
    return body.about_com + body.mass * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  };
  return {mass, com, about(a) + about(b)};
}

bool is_feasible(const Inertia& body) {
  if (!(body.mass > 0) || !body.com.allFinite() || !body.about_com.allFinite()) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(body.about_com, Eigen::EigenvaluesOnly);
  const Eigen::Vector3d principal = solver.eigenvalues();  // increasing
  const double rounding = 1e-12 * principal[2];
  return principal[0] >= -rounding && principal[0] + principal[1] >= principal[2] - rounding;
}

namespace {

bool is_rotation(const Eigen::Matrix3d& R) {
  return R.allFinite() && (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-9 &&
         R.determinant() > 0;
}

}  // namespace

void validate(const Chain& chain) {
  const auto fail = [&](const std::string& what) {
    throw std::invalid_argument(fmt::format("chain '{}': {}", chain.name, what));
  };
  if (chain.joints.empty() || chain.size() > kMaxJoints)
    fail(fmt::format("has {} joints; accepted: 1 to {}", chain.joints.size(), kMaxJoints));
  if (!is_rotation(chain.tip.R) || !chain.tip.p.allFinite()) fail("its tip is no frame");
  for (const Joint& joint : chain.joints) {
    const auto wrong = [&](const std::string& what) {
      fail(fmt::format("joint '{}': {}", joint.name, what));
    };
    if (!is_rotation(joint.origin.R) || !joint.origin.p.allFinite()) wrong("its origin is no frame");
    const bool massless = joint.link.mass == 0 && joint.link.about_com.isZero(0);
    if (!massless && !is_feasible(joint.link))
      wrong(fmt::format("no body of {} kg can have its inertia", joint.link.mass));
    const JointLimits& l = joint.limits;
    if (!(l.lower < l.upper)) wrong(fmt::format("limits [{}, {}] rad are empty", l.lower, l.upper));
    for (const auto& [name, value] : {std::pair{"velocity", l.velocity},
                                      {"acceleration", l.acceleration},
                                      {"jerk", l.jerk},
                                      {"torque", l.torque}})
      if (!(value > 0)) wrong(fmt::format("{} limit {} is not > 0", name, value));
    for (const double phi : {joint.friction.phi1, joint.friction.phi2, joint.friction.phi3})
      if (!std::isfinite(phi)) wrong("its friction is not finite");
  }
  if (chain.home.size() == 0) return;
  if (chain.home.size() != chain.size())
    fail(fmt::format("its home has {} values for {} joints", chain.home.size(), chain.size()));
  for (int i = 0; i < chain.size(); ++i) {
    const auto& [name, origin, link, limits, friction] = chain.joints[i];
    if (!(chain.home[i] >= limits.lower && chain.home[i] <= limits.upper))
      fail(fmt::format("home of joint '{}': {} is not in [{}, {}] rad", name, chain.home[i], limits.lower,
                       limits.upper));
  }
}

Chain with_tool(Chain chain, const Transform<double>& tool) {
  chain.tip = chain.tip * tool;
  validate(chain);
  return chain;
}

Chain with_payload(Chain chain, const Inertia& body) {
  if (!is_feasible(body))
    throw std::invalid_argument(fmt::format("payload: no body of {} kg can have its inertia", body.mass));
  validate(chain);
  Inertia& last = chain.joints.back().link;
  last = together(last, seen_from(chain.tip, body));
  return chain;
}

Chain with_gripper(const Chain& chain, double length, double mass) {
  for (const auto& [name, value] : {std::pair{"length", length}, {"mass", mass}})
    if (!(value >= 0 && std::isfinite(value)))
      throw std::invalid_argument(fmt::format("gripper: {} = {} is not in [0, inf)", name, value));
  constexpr double kWidth = 0.1;  // m
  const double across = mass * (length * length + kWidth * kWidth) / 12;
  const Transform<double> pads{Eigen::Matrix3d::Identity(), {0, 0, length}};
  if (mass == 0) return with_tool(chain, pads);
  const Inertia block{mass, {0, 0, length / 2}, symmetric(across, across, mass * 0.02 / 12, 0, 0, 0)};
  return with_tool(with_payload(chain, block), pads);
}

JointVector<double> limits_of(const Chain& chain, double JointLimits::*which) {
  JointVector<double> out(chain.size());
  for (int i = 0; i < chain.size(); ++i) out[i] = chain.joints[i].limits.*which;
  return out;
}

}  // namespace unhand::planners
