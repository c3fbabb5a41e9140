#include "planners/control/throw_study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>

#include "flight/projectile.hpp"
#include "planners/arm/panda.hpp"

namespace unhand::planners::control {
namespace {

using Joints = JointVector<double>;
constexpr double kStep = 1e-3;                          ///< of the controller [s]
constexpr int kSubsteps = 2;                            ///< of the robot's Runge-Kutta steps in it
constexpr double kHandLength = 0.15, kHandMass = 0.52;  ///< chosen: a soft hand of half a kilogram

/// The arm with its hand: what the controllers know.
Chain known_arm() {
  const double m = kHandMass, l = kHandLength, across = m * (l * l + 0.08 * 0.08) / 12;
  const Chain arm =
      with_payload(panda(), {m, {0, 0, l / 2}, symmetric(across, across, m * 0.08 * 0.08 / 6, 0, 0, 0)});
  return with_tool(arm, {Eigen::Matrix3d::Identity(), {0, 0, l}});
}

/// Joint angles at which the tip has a frame, near `q`, by damped least squares.
Joints pose_at(const Chain& arm, const Eigen::Vector3d& p, const Eigen::Matrix3d& R, Joints q) {
  for (int k = 0; k < 200; ++k) {
    const Transform<double> tip = forward_kinematics<double>(arm, q);
    Eigen::Matrix<double, 6, 1> error;
    const Eigen::AngleAxisd turn(R * tip.R.transpose());
    error << p - tip.p, turn.angle() * turn.axis();
    if (error.norm() < 1e-12) break;
    const Jacobian<double> J = jacobian<double>(arm, q);
    JointMatrix<double> JJt = J * J.transpose();
    JJt.diagonal().array() += 1e-8;
    q += J.transpose() * solve_positive<double>(JJt, error);
  }
  return q;
}

struct Robot {
  Chain truth;
  Joints friction_scale, q, qd;

  Joints acceleration(const Joints& at, const Joints& rate, const Joints& torque) const {
    return forward_dynamics<double>(
        truth, at, rate, torque - friction_scale.cwiseProduct(friction_torque<double>(truth, rate)));
  }
  void advance(const Joints& torque) {
    const double h = kStep / kSubsteps;
    for (int k = 0; k < kSubsteps; ++k) {
      const Joints a1 = acceleration(q, qd, torque), v1 = qd, v2 = qd + 0.5 * h * a1;
      const Joints a2 = acceleration(q + 0.5 * h * v1, v2, torque), v3 = qd + 0.5 * h * a2;
      const Joints a3 = acceleration(q + 0.5 * h * v2, v3, torque), v4 = qd + h * a3;
      const Joints a4 = acceleration(q + h * v3, v4, torque);
      q += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
      qd += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
  }
};

/// One repetition: throw, brake, return, hold.
struct Course {
  MinimumJerk up, brake, back;
  double hold;

  Course(const StudyOptions& o) : hold(o.hold_time) {
    const Eigen::Vector3d none(0, 0, 0), stop = o.release + 0.5 * o.velocity * o.brake_time;
    up = {o.start, none, o.release, o.velocity, o.throw_time};
    brake = {o.release, o.velocity, stop, none, o.brake_time};
    back = {stop, none, o.start, none, o.return_time};
  }
  double length() const { return up.duration + brake.duration + back.duration + hold; }
  TaskReference at(double t, const Eigen::Matrix3d& R) const {
    if (t < up.duration) return up.at(t, R);
    if (t < up.duration + brake.duration) return brake.at(t - up.duration, R);
    return back.at(t - up.duration - brake.duration, R);
  }
};

/// The course in the joints, step by step from standing still at `rest`: q̈_d = J⁺ (ξ̈_d + 2 κ ė_ξ + κ² e_ξ − J̇
/// q̇_d) + N (ρ² (rest − q_d) − 2 ρ q̇_d), κ against drift.
class JointCourse {
 public:
  JointCourse(const Chain& arm, const Joints& rest, double posture)
      : arm_(arm), rest_(rest), posture_(posture), now_{rest, Joints::Zero(7), Joints::Zero(7)} {}

  /// The motion now, with the acceleration that the task asks for; then a step of the controller on.
  JointReference next(const TaskReference& r) {
    constexpr double kDrift = 50;  // κ [1/s]
    const TipMotion<double> tip = tip_motion<double>(arm_, now_.q, now_.qd, Joints::Zero(7));
    const Jacobian<double> J = jacobian<double>(arm_, now_.q);
    const Eigen::AngleAxisd turn(r.orientation * tip.frame.R.transpose());
    Eigen::Matrix<double, 6, 1> off, rate, wanted;
    off << r.position - tip.frame.p, turn.angle() * turn.axis();
    rate << r.velocity - tip.velocity, -tip.omega;
    wanted << r.acceleration - tip.acceleration, -tip.alpha;
    const JointMatrix<double> JJt = J * J.transpose();
    const auto reach = [&](const Eigen::Matrix<double, 6, 1>& x) {
      return Joints(J.transpose() * solve_positive<double>(JJt, x));
    };
    const Joints home = posture_ * (posture_ * (rest_ - now_.q) - 2 * now_.qd);
    now_.qdd = reach(wanted + 2 * kDrift * rate + kDrift * kDrift * off) + home - reach(J * home);
    const JointReference out = now_;
    now_.q += kStep * now_.qd + 0.5 * kStep * kStep * now_.qdd;
    now_.qd += kStep * now_.qdd;
    return out;
  }

 private:
  const Chain& arm_;
  Joints rest_;
  double posture_;
  JointReference now_;
};

/// What each joint feels of the tip's stiffness, J_iᵀ k_ξ J_i [N m/rad].
Joints felt_stiffness(const ControllerChoice& c, const Jacobian<double>& J) {
  return (c.stiffness * J.topRows<3>().colwise().squaredNorm() +
          c.rotational * J.bottomRows<3>().colwise().squaredNorm())
      .transpose();
}

TaskGains gains_of(const ControllerChoice& c, const Chain& arm, const Joints& rest) {
  TaskGains g;
  g.stiffness = c.stiffness;
  g.rotational = c.rotational;
  g.rest = rest;
  // At least critically damped joint by joint, 2 √(K M) of the stiffness that a joint feels at the start, and
  // 2 N m s/rad of its own (0.5 for the wrist).
  const Jacobian<double> J = jacobian<double>(arm, rest);
  const JointMatrix<double> M = mass_matrix<double>(arm, rest);
  g.damping.resize(arm.size());
  const Joints K = felt_stiffness(c, J);
  for (int i = 0; i < arm.size(); ++i) g.damping[i] = 2 * std::sqrt(K[i] * M(i, i)) + (i < 4 ? 2.0 : 0.5);
  return g;
}

void check(const ControllerChoice& c, const Payload& payload, const StudyOptions& o) {
  const auto refuse = [](const char* name, double value, const char* accepted) {
    throw std::invalid_argument(fmt::format("throw study: {} = {}; accepted: {}", name, value, accepted));
  };
  if (!(c.stiffness > 0)) refuse("stiffness", c.stiffness, "> 0 N/m");
  if (!(c.rotational > 0)) refuse("rotational", c.rotational, "> 0 N m/rad");
  if (!(payload.mass > 0 && payload.mass < 3)) refuse("mass", payload.mass, "(0, 3) kg");
  if (!(payload.width > 0 && payload.width < 0.5)) refuse("width", payload.width, "(0, 0.5) m");
  if (o.repetitions < 0 || o.repetitions > 1000) refuse("repetitions", o.repetitions, "0 to 1000");
  if (!(o.throw_time > 0.05 && o.brake_time > 0.05 && o.return_time > 0.05 && o.hold_time >= 0))
    refuse("throw_time", o.throw_time, "all times > 0.05 s");
}

/// Where it lands from a state of the tip; empty: never.
std::optional<Eigen::Vector2d> land(const Eigen::Vector3d& p, const Eigen::Vector3d& v, double height) {
  const auto at = flight::project<double>({p.x(), p.z(), 0}, {v.x(), v.z(), 0}, {0, kGravity.z()}, height);
  if (!at) return {};
  return Eigen::Vector2d(at->pose.x, p.y() + at->flight_time * v.y());
}

}  // namespace

Adaptation StudyOptions::default_adaptation() {
  Adaptation a;
  a.gain << 3, 0.3, 0.3, 0.3, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01;
  a.prediction = 0.3;
  a.filter = 50;
  return a;
}

std::vector<Payload> reported_payloads() {
  return {{"box", 0.221, 0.07}, {"ball", 0.427, 0.066}, {"tube", 0.445, 0.08}};
}

std::vector<ControllerChoice> reported_controllers() {
  return {{"adaptive, 30 N/m", 30, 10, true},
          {"plain, 30 N/m", 30, 10, false},
          {"plain, 300 N/m", 300, 40, false}};
}

ControllerChoice joint_controller() { return {"adaptive, in the joints", 30, 10, true, true}; }

StudyThrow run_throw(const ControllerChoice& choice, const Payload& payload, const StudyOptions& o,
                     std::uint64_t seed, bool record) {
  check(choice, payload, o);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const Chain known = known_arm();
  const double w = payload.width, I = payload.mass * w * w / 6;
  const Inertia body{payload.mass,
                     o.grasp_offset * Eigen::Vector3d(normal(random), normal(random), normal(random)),
                     symmetric(I, I, I, 0, 0, 0)};
  Robot robot{with_payload(known, body), Joints(7), Joints(7), Joints::Zero(7)};
  for (int i = 0; i < 7; ++i) robot.friction_scale[i] = std::max(0.0, 1 + o.friction_error * normal(random));
  const LinkParameters unknown =
      parameters_of(robot.truth.joints.back().link) - parameters_of(known.joints.back().link);

  constexpr double pi = std::numbers::pi;
  const Eigen::Matrix3d orientation = Eigen::Vector3d(1, -1, -1).asDiagonal();  // the hand points down
  const Joints rest =
      pose_at(known, o.start, orientation, Joints{{0, -pi / 4, 0, -3 * pi / 4, 0, pi / 2, pi / 4}});
  robot.q = rest;
  const TaskGains gains = gains_of(choice, known, rest);
  const JointGains joint_gains{felt_stiffness(choice, jacobian<double>(known, rest)), gains.damping};
  JointCourse joint_course(known, rest, gains.posture);
  JointReference joint_reference;
  Adaptation adaptation = o.adaptation;
  if (!choice.adaptive) adaptation.gain.setZero();
  AdaptiveController controller(known, adaptation);
  const Course course(o);
  const double release_at = o.throw_time + o.release_jitter * normal(random);
  const int length = static_cast<int>(std::lround(course.length() / kStep)),
            settle = static_cast<int>(std::lround(1.0 / kStep));

  StudyThrow out;
  Joints limit = limits_of(known, &JointLimits::torque);
  const auto step = [&](const TaskReference& reference) {
    Joints q = robot.q, qd = robot.qd;
    for (int i = 0; i < 7; ++i)
      q[i] += o.angle_noise * normal(random), qd[i] += o.rate_noise * normal(random);
    ControlStep control;
    if (choice.in_joints) {
      joint_reference = joint_course.next(reference);
      control = controller.joint_law(joint_reference, joint_gains, q, qd);
      control.error.head<3>() = reference.position - forward_kinematics<double>(known, q).p;
    } else {
      control = controller.task_law(reference, gains, q, qd);
    }
    const Joints applied = control.torque.cwiseMin(limit).cwiseMax(-limit);
    out.torque_use = std::max(out.torque_use, control.torque.cwiseQuotient(limit).cwiseAbs().maxCoeff());
    controller.adapt(control, applied, q, qd, kStep);
    Joints noisy = applied;
    for (int i = 0; i < 7; ++i) noisy[i] += o.torque_noise * normal(random);
    robot.advance(noisy);
    return control;
  };
  // The object is picked up at the start and held there until the arm has settled.
  for (int k = 0; k < settle; ++k) step(course.up.at(0, orientation));
  double t = 0;
  for (int repetition = 0; repetition <= o.repetitions; ++repetition) {
    const bool last = repetition == o.repetitions;
    const int steps = last ? static_cast<int>(release_at / kStep) : length;
    double squares = 0;
    int counted = 0;
    for (int k = 0; k < steps; ++k, t += kStep) {
      const TaskReference reference = course.at(k * kStep, orientation);
      const ControlStep control = step(reference);
      if (k * kStep < o.throw_time) squares += control.error.head<3>().squaredNorm(), ++counted;
      if (record && k % 10 == 0) {
        const TipMotion<double> tip = tip_motion<double>(known, robot.q, robot.qd, Joints::Zero(7));
        const LinkParameters off = unknown - controller.estimate;
        const double V = choice.in_joints ? lyapunov(robot.truth, joint_gains, adaptation, control, robot.q,
                                                     joint_reference.q - robot.q, off)
                                          : lyapunov(robot.truth, gains, adaptation, control, robot.q, off);
        out.history.push_back({t, control.error.head<3>().norm(), (reference.velocity - tip.velocity).norm(),
                               V, controller.estimate[0]});
      }
    }
    out.rms_error.push_back(std::sqrt(squares / std::max(1, counted)));
  }
  out.estimate = controller.estimate;
  // The object's centre at the release, the rest of the last control step on a straight line.
  const Chain to_object = with_tool(known, {Eigen::Matrix3d::Identity(), body.com});
  const TipMotion<double> object = tip_motion<double>(to_object, robot.q, robot.qd, Joints::Zero(7));
  const double left = release_at - std::floor(release_at / kStep) * kStep;
  const Eigen::Vector3d p = object.frame.p + left * object.velocity;
  const TaskReference wanted = course.at(o.throw_time, orientation);
  const TaskReference due = course.at(release_at - left, orientation);  // of the last control step
  const TipMotion<double> tip = tip_motion<double>(known, robot.q, robot.qd, Joints::Zero(7));
  out.release_position_error = (tip.frame.p - due.position).norm();
  out.release_velocity_error = (tip.velocity - due.velocity).norm();
  const Eigen::Vector2d nowhere(0, 0);
  const auto target = land(wanted.position, wanted.velocity, o.landing_height);
  const auto landed = land(p, object.velocity, o.landing_height);
  out.lands = landed.has_value();
  out.miss = landed.value_or(nowhere) - target.value_or(nowhere);
  out.hit = out.lands && std::abs(out.miss.x()) <= o.box.x() / 2 && std::abs(out.miss.y()) <= o.box.y() / 2;
  return out;
}

Dispersion dispersion_of(const std::vector<StudyThrow>& throws) {
  Dispersion out;
  Eigen::Vector2d squares(0, 0);
  int landed = 0;
  for (const StudyThrow& one : throws) {
    ++out.throws;
    out.hits += one.hit;
    out.lost += !one.lands;
    out.largest_torque_use = std::max(out.largest_torque_use, one.torque_use);
    if (!one.lands) continue;
    ++landed;
    out.mean += one.miss;
    squares += one.miss.cwiseProduct(one.miss);
  }
  if (landed == 0) return out;
  out.mean /= landed;
  squares /= landed;
  const double n = landed;
  const Eigen::Vector2d variance = n / std::max(1.0, n - 1) * (squares - out.mean.cwiseProduct(out.mean));
  out.std = variance.cwiseMax(0).cwiseSqrt();
  out.rms = std::sqrt(squares.sum());
  return out;
}

}  // namespace unhand::planners::control
