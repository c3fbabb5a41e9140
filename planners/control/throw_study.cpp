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
constexpr int kSettle = 1000;                           ///< steps of the controller
constexpr int kSubsteps = 2;                            ///< of the robot's Runge-Kutta steps in it
constexpr double kHandLength = 0.15, kHandMass = 0.52;  ///< chosen: a soft hand of half a kilogram

/// The arm with its hand: what the controllers know.
Chain known_arm() {
  const double m = kHandMass, l = kHandLength, across = m * (l * l + 0.08 * 0.08) / 12;
  const Chain arm =
      with_payload(panda(), {m, {0, 0, l / 2}, symmetric(across, across, m * 0.08 * 0.08 / 6, 0, 0, 0)});
  return with_tool(arm, {Eigen::Matrix3d::Identity(), {0, 0, l}});
}

/// Joint angles at which the tip has a frame, near `q`, by damped least squares. Throws std::invalid_argument
/// where it does not get there.
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
  if (const double off = (forward_kinematics<double>(arm, q).p - p).norm(); !(off < 1e-6))
    throw std::invalid_argument(
        fmt::format("throw study: the tip does not reach ({:.3g}, {:.3g}, {:.3g}) m: it stays {:.2g} m away",
                    p.x(), p.y(), p.z(), off));
  for (int i = 0; i < arm.size(); ++i) {
    const Joint& joint = arm.joints[static_cast<std::size_t>(i)];
    if (!(q[i] >= joint.limits.lower && q[i] <= joint.limits.upper))
      throw std::invalid_argument(
          fmt::format("throw study: at ({:.3g}, {:.3g}, {:.3g}) m {} is at {:.3g} rad, beyond its limits",
                      p.x(), p.y(), p.z(), joint.name, q[i]));
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
  if (!(c.stiffness > 0 && std::isfinite(c.stiffness))) refuse("stiffness", c.stiffness, "(0, inf) N/m");
  if (!(c.rotational > 0 && std::isfinite(c.rotational)))
    refuse("rotational", c.rotational, "(0, inf) N m/rad");
  if (!(payload.mass > 0 && payload.mass < 3)) refuse("mass", payload.mass, "(0, 3) kg");
  if (!(payload.width > 0 && payload.width < 0.5)) refuse("width", payload.width, "(0, 0.5) m");
  for (const auto& [name, value] : {std::pair{"angle_noise", o.angle_noise},
                                    {"rate_noise", o.rate_noise},
                                    {"torque_noise", o.torque_noise},
                                    {"friction_error", o.friction_error},
                                    {"grasp_offset", o.grasp_offset},
                                    {"release_jitter", o.release_jitter},
                                    {"box", std::min(o.box.x(), o.box.y())}})
    if (!(value >= 0 && std::isfinite(value))) refuse(name, value, "[0, inf)");
  for (const double x : {o.start.sum(), o.release.sum(), o.velocity.sum(), o.landing_height, o.box.sum()})
    if (!std::isfinite(x)) refuse("start, release, velocity, landing_height and box", x, "finite");
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

/// An arm with an object in its hand and a controller that does not know it.
class Run {
 public:
  Run(const ControllerChoice& choice, const Payload& payload, const StudyOptions& options, std::uint64_t seed)
      : options_(options), in_joints_(choice.in_joints), random_(seed) {
    const double w = payload.width, I = payload.mass * w * w / 6;
    object_ = {payload.mass, options.grasp_offset * Eigen::Vector3d(normal(), normal(), normal()),
               symmetric(I, I, I, 0, 0, 0)};
    robot_.truth = with_payload(known_, object_);
    for (int i = 0; i < 7; ++i)
      robot_.friction_scale[i] = std::max(0.0, 1 + options.friction_error * normal());
    constexpr double pi = std::numbers::pi;
    const double aside = std::atan2(options.start.y(), options.start.x());  // and the hand turned back
    const Joints rest = pose_at(known_, options.start, orientation_,
                                Joints{{aside, -pi / 4, 0, -3 * pi / 4, 0, pi / 2, pi / 4 + aside}});
    robot_.q = rest;
    gains_ = gains_of(choice, known_, rest);
    joint_gains_ = {felt_stiffness(choice, jacobian<double>(known_, rest)), gains_.damping};
    joint_course_.emplace(known_, rest, gains_.posture);
    adaptation_ = options.adaptation;
    if (!choice.adaptive) adaptation_.gain.setZero();
    controller_.emplace(known_, adaptation_);
    release_time_ = options.throw_time + options.release_jitter * normal();
  }

  /// Of the controller: in a repetition, and before the release in the throw.
  /// @{
  int steps_of_course() const { return static_cast<int>(std::lround(course_.length() / kStep)); }
  int steps_to_release() const { return static_cast<int>(release_time_ / kStep); }
  /// @}

  /// The object is picked up at the start and held there until the arm has settled.
  void settle() {
    for (int k = 0; k < kSettle; ++k) step(course_.up.at(0, orientation_));
  }

  /// The course's first steps.
  void swing(int steps, bool record) {
    double squares = 0;
    int counted = 0;
    for (int k = 0; k < steps; ++k, now_ += kStep) {
      const double t = k * kStep;
      const TaskReference reference = course_.at(t, orientation_);
      const ControlStep control = step(reference);
      if (t < options_.throw_time) squares += control.error.head<3>().squaredNorm(), ++counted;
      if (record && k % 10 == 0) remember(reference, control);
    }
    out_.rms_error.push_back(std::sqrt(squares / std::max(1, counted)));
  }

  /// The object's landing, from its centre at the release: the rest of the last control step is a straight
  /// line.
  void let_go() {
    out_.estimate = controller_->estimate;
    const Chain to_object = with_tool(known_, {Eigen::Matrix3d::Identity(), object_.com});
    const TipMotion<double> object = tip_motion<double>(to_object, robot_.q, robot_.qd, Joints::Zero(7));
    const double left = release_time_ - std::floor(release_time_ / kStep) * kStep;
    const Eigen::Vector3d p = object.frame.p + left * object.velocity;
    const TaskReference wanted = course_.at(options_.throw_time, orientation_);
    const TaskReference due = course_.at(release_time_ - left, orientation_);  // of the last control step
    const TipMotion<double> tip = tip_of_robot();
    out_.release_position_error = (tip.frame.p - due.position).norm();
    out_.release_velocity_error = (tip.velocity - due.velocity).norm();
    const Eigen::Vector2d nowhere(0, 0), half = options_.box / 2;
    const auto target = land(wanted.position, wanted.velocity, options_.landing_height);
    const auto landed = land(p, object.velocity, options_.landing_height);
    out_.lands = landed.has_value();
    out_.miss = landed.value_or(nowhere) - target.value_or(nowhere);
    out_.hit = out_.lands && (out_.miss.cwiseAbs().array() <= half.array()).all();
    robot_.truth = known_;
  }

  /// The empty hand stops.
  StudyThrow brake() {
    const int end = static_cast<int>(std::lround((options_.throw_time + options_.brake_time) / kStep));
    for (int k = steps_to_release(); k < end; ++k) step(course_.at(k * kStep, orientation_));
    return std::move(out_);
  }

 private:
  double normal() { return normal_(random_); }
  TipMotion<double> tip_of_robot() const {
    return tip_motion<double>(known_, robot_.q, robot_.qd, Joints::Zero(7));
  }

  /// One of the controller's steps: what it measures, asks for and learns, and where that takes the robot.
  ControlStep step(const TaskReference& reference) {
    Joints q = robot_.q, qd = robot_.qd;
    for (int i = 0; i < 7; ++i)
      q[i] += options_.angle_noise * normal(), qd[i] += options_.rate_noise * normal();
    ControlStep control;
    if (in_joints_) {
      joint_reference_ = joint_course_->next(reference);
      control = controller_->joint_law(joint_reference_, joint_gains_, q, qd);
      control.error.head<3>() = reference.position - forward_kinematics<double>(known_, q).p;
    } else {
      control = controller_->task_law(reference, gains_, q, qd);
    }
    Joints applied = control.torque.cwiseMin(limit_).cwiseMax(-limit_);
    controller_->adapt(control, applied, q, qd, kStep);
    for (int i = 0; i < 7; ++i) applied[i] += options_.torque_noise * limit_[i] * normal();
    const Joints rate = robot_.qd;
    robot_.advance(applied);
    monitor(control.torque, (robot_.qd - rate) / kStep);
    return control;
  }

  /// What the step took of the joints' limits.
  void monitor(const Joints& torque, const Joints& acceleration) {
    const auto share = [&](const Joints& x, double JointLimits::*which) {
      return x.cwiseQuotient(limits_of(known_, which)).cwiseAbs().maxCoeff();
    };
    const Joints lower = limits_of(known_, &JointLimits::lower),
                 upper = limits_of(known_, &JointLimits::upper);
    out_.use.include({(2 * robot_.q - lower - upper).cwiseQuotient(upper - lower).cwiseAbs().maxCoeff(),
                      share(robot_.qd, &JointLimits::velocity),
                      share(acceleration, &JointLimits::acceleration),
                      share((acceleration - acceleration_) / kStep, &JointLimits::jerk),
                      share(torque, &JointLimits::torque)});
    acceleration_ = acceleration;
  }

  void remember(const TaskReference& reference, const ControlStep& control) {
    const LinkParameters off = parameters_of(robot_.truth.joints.back().link) -
                               parameters_of(known_.joints.back().link) - controller_->estimate;
    const double V = in_joints_ ? lyapunov(robot_.truth, joint_gains_, adaptation_, control, robot_.q,
                                           joint_reference_.q - robot_.q, off)
                                : lyapunov(robot_.truth, gains_, adaptation_, control, robot_.q, off);
    out_.history.push_back({now_, control.error.head<3>().norm(),
                            (reference.velocity - tip_of_robot().velocity).norm(), V,
                            controller_->estimate[0]});
  }

  const StudyOptions& options_;
  bool in_joints_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  const Chain known_ = known_arm();
  const Eigen::Matrix3d orientation_ = Eigen::Vector3d(1, -1, -1).asDiagonal();  ///< the hand points down
  const Joints limit_ = limits_of(known_, &JointLimits::torque);
  const Course course_{options_};
  Inertia object_;
  Robot robot_{known_, Joints(7), Joints(7), Joints::Zero(7)};
  TaskGains gains_;
  JointGains joint_gains_;
  std::optional<JointCourse> joint_course_;
  JointReference joint_reference_;
  Joints acceleration_ = Joints::Zero(7);  ///< of the last step
  Adaptation adaptation_;
  std::optional<AdaptiveController> controller_;
  double release_time_{}, now_{};
  StudyThrow out_;
};

}  // namespace

void JointUse::include(const JointUse& other) {
  for (double JointUse::*one : {&JointUse::position, &JointUse::velocity, &JointUse::acceleration,
                                &JointUse::jerk, &JointUse::torque})
    this->*one = std::max(this->*one, other.*one);
}

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

StudyThrow run_throw(const ControllerChoice& choice, const Payload& payload, const StudyOptions& options,
                     std::uint64_t seed, bool record) {
  check(choice, payload, options);
  Run run(choice, payload, options, seed);
  run.settle();
  for (int k = 0; k < options.repetitions; ++k) run.swing(run.steps_of_course(), record);
  run.swing(run.steps_to_release(), record);
  run.let_go();
  return run.brake();
}

Dispersion dispersion_of(const std::vector<StudyThrow>& throws) {
  Dispersion out;
  Eigen::Vector2d squares(0, 0);
  int landed = 0;
  for (const StudyThrow& one : throws) {
    ++out.throws;
    out.hits += one.hit;
    out.lost += !one.lands;
    out.use.include(one.use);
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
