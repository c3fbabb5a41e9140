#include "planners/flip/arm_throw.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dynamics/quintic.hpp"

namespace unhand::planners::flip {
namespace {

constexpr int kKnot = 4;           ///< control steps between the hand's knots
constexpr double kInPlane = 0.01;  ///< rad: turned by so much, a throw is 5e-5 of its way shorter

struct HandKnot {
  std::array<double, 3> p, v, a;  ///< x, z, θ and their derivatives
};

/// The degree-five polynomial with these ends, in powers of t from the first.
release::PolynomialHand::Polynomial::Coefficients between(const HandKnot& a, const HandKnot& b, double h) {
  release::PolynomialHand::Polynomial::Coefficients c{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto quintic =
        dynamics::quintic_between<double>({a.p[i], a.v[i], a.a[i]}, {b.p[i], b.v[i], b.a[i]}, h);
    for (std::size_t power = 0; power < 6; ++power) c[power][i] = quintic[power];
  }
  return c;
}

}  // namespace

ArmBody declared_body(const FlipRobot& robot, const Bar& bar) {
  const int n = robot.chain.size();
  return {carrying(robot.chain, bar), robot.chain, carrying(robot.chain, bar), Joints::Ones(n),
          Joints::Ones(n)};
}

Joints throwing_pose(const FlipMotion& motion, const FlipCommand& u) {
  int throwing = 0;
  for (Eigen::Index i = 0; i < motion.rate.size(); ++i) throwing += motion.rate[i] != 0;
  Joints out = motion.pose;
  for (Eigen::Index i = 0; i < out.size(); ++i)
    if (motion.rate[i] != 0) out[i] += u.pitch / throwing;
  return out;
}

FlipReference reference_at(const FlipMotion& motion, const FlipCommand& u, double t) {
  const double x = std::clamp(t / motion.duration, 0.0, 1.0), way = x * x * x - 0.5 * x * x * x * x;
  return {throwing_pose(motion, u) - (0.5 - way) * motion.duration * u.speed * motion.rate,
          u.speed * x * x * (3 - 2 * x) * motion.rate};
}

void check_reference(const FlipRobot& robot, const FlipCommand& u) {
  const FlipReference start = reference_at(robot.motion, u, 0),
                      end = reference_at(robot.motion, u, robot.motion.duration);
  const auto refuse_of = [&](const std::string& name, const char* what, double value, double low,
                             double high) {
    throw std::invalid_argument(
        fmt::format("flip command pitch {:.3f}, speed {:.3f}: {} of {} is {:.3f}; accepted: {:.3f} to {:.3f}",
                    u.pitch, u.speed, what, name, value, low, high));
  };
  for (const FlipReference& at : {start, end}) {
    const ChainFrames<double> frames = frames_of<double>(robot.chain, at.q);
    for (int i = 0; i < robot.chain.size(); ++i) {
      if (robot.motion.rate[i] == 0) continue;
      const auto k = static_cast<std::size_t>(i);
      const Eigen::Vector3d axis = frames.links[k].R.col(2);
      if (const double off = std::atan2(std::hypot(axis.x(), axis.z()), std::abs(axis.y())); off > kInPlane)
        refuse_of(robot.chain.joints[k].name, "angle [rad] from y to the axis", off, 0, kInPlane);
    }
    if (const double off = std::asin(std::min(1.0, std::abs(frames.tip.R(1, 2)))); off > kInPlane)
      refuse_of("the hand", "angle [rad] to the plane of x and z", off, 0, kInPlane);
  }
  for (int i = 0; i < robot.chain.size(); ++i) {
    const Joint& joint = robot.chain.joints[static_cast<std::size_t>(i)];
    const JointLimits& l = joint.limits;
    const auto refuse = [&](const char* what, double value, double low, double high) {
      refuse_of(joint.name, what, value, low, high);
    };
    for (const double q : {start.q[i], end.q[i]})  // monotonous in between
      if (q < l.lower || q > l.upper) refuse("position [rad]", q, l.lower, l.upper);
    const double rate = std::abs(end.qd[i]), most = 1.5 * rate / robot.motion.duration;
    if (rate > l.velocity) refuse("velocity [rad/s]", rate, 0, l.velocity);
    if (most > l.acceleration) refuse("acceleration [rad/s²]", most, 0, l.acceleration);
  }
}

ThrowingArm::ThrowingArm(const FlipRobot& robot, const ArmBody& body, const FlipCommand& u,
                         std::uint64_t noise_seed, const ArmOptions& options)
    : robot_(robot),
      body_(body),
      command_(u),
      options_(options),
      torque_limit_(limits_of(robot.chain, &JointLimits::torque)),
      target_(throwing_pose(robot.motion, u)) {
  if (options.substeps < 1 || options.substeps > 64)
    throw std::invalid_argument(
        fmt::format("throwing arm: substeps = {}; accepted: 1 to 64", options.substeps));
  if (!(options.noise >= 0 && std::isfinite(options.noise)))
    throw std::invalid_argument(
        fmt::format("throwing arm: noise = {}; accepted: 0 to any finite factor", options.noise));
  const int n = robot.chain.size();
  const FlipReference start = reference_at(robot.motion, u, 0);
  State s{start.q, start.qd, Joints::Zero(n), {}, std::mt19937_64(noise_seed), {}, {}};
  s.torque = gravity_torque<double>(body_.known, s.q);
  const int ticks = static_cast<int>(std::lround(robot.motion.duration / kControlStep));
  const int kept = (ticks - 1) / kKnot * kKnot + 1;  // so that the brake's start is a knot
  const Joints none = Joints::Zero(n);
  for (int k = 0; k < ticks; ++k) {
    if (k >= ticks - kept) before_.push_back({s.q, s.qd});
    step(s, body.loaded, reference_at(robot.motion, u, k * kControlStep), robot.control.stiffness,
         robot.control.damping, none);
  }
  at_brake_ = std::move(s);
}

void ThrowingArm::step(State& s, const Chain& chain, const FlipReference& reference, const Joints& stiffness,
                       const Joints& damping, const Joints& external) const {
  const int n = chain.size();
  Joints q = s.q, qd = s.qd;
  if (options_.noise > 0)
    for (int i = 0; i < n; ++i) {
      q[i] += options_.noise * robot_.sensors.angle * s.normal(s.random);
      qd[i] += options_.noise * robot_.sensors.rate * s.normal(s.random);
    }
  const Joints wanted = stiffness.cwiseProduct(reference.q - q) + damping.cwiseProduct(reference.qd - qd) +
                        bias_torque<double>(body_.known, q, qd);
  const double most = robot_.control.torque_rate * kControlStep;
  bool cut = false, slow = false;
  Joints applied(n);
  for (int i = 0; i < n; ++i) {
    const double limited = std::clamp(wanted[i], -torque_limit_[i], torque_limit_[i]);
    const double next = std::clamp(limited, s.torque[i] - most, s.torque[i] + most);
    cut = cut || limited != wanted[i];
    slow = slow || next != limited;
    s.use.torque = std::max(s.use.torque, std::abs(next) / torque_limit_[i]);
    s.torque[i] = next;
    applied[i] = body_.torque_gain[i] * next + external[i];
    if (options_.noise > 0)
      applied[i] += options_.noise * robot_.throws.torque_noise * torque_limit_[i] * s.normal(s.random);
  }
  s.use.cut_torque += cut;
  s.use.cut_rate += slow;
  const double h = kControlStep / options_.substeps;
  for (int k = 0; k < options_.substeps; ++k) {
    const Joints rate = s.qd + 0.5 * h * s.qdd;
    s.qdd = forward_dynamics<double>(
        chain, s.q + 0.5 * h * s.qd + 0.125 * h * h * s.qdd, rate,
        applied - body_.friction_scale.cwiseProduct(friction_torque<double>(chain, rate)));
    s.q += h * s.qd + 0.5 * h * h * s.qdd;
    s.qd += h * s.qdd;
  }
  for (int i = 0; i < n; ++i) {
    const JointLimits& l = chain.joints[static_cast<std::size_t>(i)].limits;
    s.use.velocity = std::max(s.use.velocity, std::abs(s.qd[i]) / l.velocity);
    s.use.position = std::max(s.use.position, std::abs(2 * s.q[i] - l.lower - l.upper) / (l.upper - l.lower));
  }
}

ArmThrow ThrowingArm::brake() const { return finish(body_.loaded, {}); }
ArmThrow ThrowingArm::brake(std::span<const dynamics::Wrench<double>> on_bar) const {
  return finish(body_.bare, on_bar);
}

ArmThrow ThrowingArm::finish(const Chain& chain, std::span<const dynamics::Wrench<double>> on_bar) const {
  const int n = chain.size();
  State s = at_brake_;
  std::vector<Tick> ticks = before_;
  const FlipReference hold{target_, Joints::Zero(n)};
  const Joints damping = robot_.control.brake_damping + command_.damping * robot_.control.brake_share;
  const int count = kKnot * static_cast<int>(std::ceil(robot_.motion.window / (kKnot * kControlStep) - 1e-9));
  for (int k = 0; k <= count; ++k) {
    ticks.push_back({s.q, s.qd});
    Joints external = Joints::Zero(n);
    if (static_cast<std::size_t>(k) < on_bar.size()) {
      const auto& w = on_bar[static_cast<std::size_t>(k)];
      // θ turns from +x to +z, about −y.
      const Eigen::Matrix<double, 6, 1> on_hand{-w.fx, 0.0, -w.fz, 0.0, w.tau, 0.0};
      external = jacobian<double>(chain, s.q).transpose() * on_hand;
    }
    step(s, chain, hold, robot_.control.brake_stiffness, damping, external);
  }
  ticks.push_back({s.q, s.qd});

  double last = 0;
  std::vector<double> breaks;
  std::vector<HandKnot> knots;
  for (std::size_t k = 1; k + 1 < ticks.size(); k += kKnot) {
    const Joints qdd = (ticks[k + 1].qd - ticks[k - 1].qd) / (2 * kControlStep);
    const TipMotion<double> tip = tip_motion<double>(body_.bare, ticks[k].q, ticks[k].qd, qdd);
    double theta = std::atan2(tip.frame.R(2, 2), tip.frame.R(0, 2));
    if (!knots.empty()) theta += 2 * std::numbers::pi * std::round((last - theta) / (2 * std::numbers::pi));
    last = theta;
    knots.push_back({{tip.frame.p.x(), tip.frame.p.z(), theta},
                     {tip.velocity.x(), tip.velocity.z(), -tip.omega.y()},
                     {tip.acceleration.x(), tip.acceleration.z(), -tip.alpha.y()}});
    breaks.push_back((static_cast<double>(k) - static_cast<double>(before_.size())) * kControlStep);
  }
  std::vector<release::PolynomialHand::Polynomial::Coefficients> pieces;
  for (std::size_t k = 0; k + 1 < knots.size(); ++k)
    pieces.push_back(between(knots[k], knots[k + 1], breaks[k + 1] - breaks[k]));
  return {release::PolynomialHand(release::PolynomialHand::Polynomial(breaks, pieces)), s.use};
}

}  // namespace unhand::planners::flip
