#include "planners/elastic/throw_program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <stdexcept>

namespace unhand::planners::elastic {
namespace {

constexpr double kNone = 1e20;
constexpr int kFixed = -1;  ///< no variable: the quantity is constant in this phase
/// Weight of the mean square of the scaled accelerations beside −speed²: it picks one of many motions
/// that hardly differ in speed, at the price of some 1e-3 of the speed.
constexpr double kSmoothing = 2e-3;

/// Indices of what is unknown at a point.
struct PointVariables {
  std::array<int, 4> at{}, rate{}, acceleration{};    // of q₁, q₂, q₃, θ
  std::array<int, 3> torque{kFixed, kFixed, kFixed};  // of the motors; at nodes
};

struct PhasePlan {
  ClutchMode mode{};
  int intervals{};
  int step{};  ///< variable: the length of an interval
  std::vector<PointVariables> points;
};

/// Builds the program of one task, and reads its solution.
class ThrowProgram {
 public:
  ThrowProgram(const ClutchedArm& arm, const ThrowTask& task, const ThrowProgramOptions& options)
      : arm_(arm), task_(task), options_(options), keep_(1 - task.margin), random_(options.seed) {
    choose_start();
    if (task.drive == Drive::clutched) {
      add_phase(ClutchMode::brk, options.intervals);
      add_phase(ClutchMode::sea, options.intervals);
    } else {
      add_phase(mode_of(task.drive), 2 * options.intervals);
    }
    if (task.let_go) fix(phases_.front().step, *task.let_go / options.intervals);
    smooth();
    fix_start();
    constrain_release();
    limit_duration();
  }

  ElasticThrow solve() {
    ElasticThrow out;
    out.program = elastic::solve(program_, options_.program);
    if (!out.program.x.empty()) read(out);
    return out;
  }

 private:
  static ClutchMode mode_of(Drive drive) {
    switch (drive) {
      case Drive::rigid:
        return ClutchMode::rigid;
      case Drive::passive:
        return ClutchMode::still;
      case Drive::locked:
        return ClutchMode::locked;
      default:
        return ClutchMode::sea;
    }
  }

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  /// Straight lines in the joints between two random poses; the spring loaded on the way.
  void choose_start() {
    for (int i = 0; i < kLinks; ++i) {
      const JointLimits& l = arm_.chain.joints[i].limits;
      const double middle = 0.5 * (l.lower + l.upper), half = 0.5 * keep_ * (l.upper - l.lower);
      from_[i] = task_.start ? (*task_.start)[i] : middle + uniform(-0.8, 0.8) * half;
      to_[i] = middle + uniform(-0.8, 0.8) * half;
    }
    load_ = uniform(-0.8, 0.8) * arm_.last.deflection;
    guess_duration_ = uniform(0.3, 0.9) * task_.longest;
  }

  /// A guess for a quantity at the time s in [0, 1] of the motion, and its rate.
  void guess(double s, const PhasePlan& phase, std::array<double, 4>& at, std::array<double, 4>& rate) {
    const bool braked = phase.mode == ClutchMode::brk;
    const double bell = 3 * s * s - 2 * s * s * s, slope = 6 * s * (1 - s) / guess_duration_;
    for (int i = 0; i < kLinks; ++i) {
      at[i] = from_[i] + (to_[i] - from_[i]) * bell;
      rate[i] = (to_[i] - from_[i]) * slope;
    }
    if (task_.drive == Drive::clutched) {
      const double late = std::max(0.0, 2 * s - 1), early = std::min(1.0, 2 * s);
      at[2] = from_[2] + (braked ? 0 : (to_[2] - from_[2]) * late);
      rate[2] = braked ? 0 : (to_[2] - from_[2]) * 2 / guess_duration_;
      at[3] = at[2] + load_ * (braked ? early : 1 - late);
      rate[3] = 0;
    } else {
      at[3] = at[2];
      rate[3] = rate[2];
    }
  }

  PointVariables add_point(const PhasePlan& phase, double s, const PointVariables* shared,
                           const ThrowPoint* near) {
    std::array<double, 4> at{}, rate{}, acceleration{};
    guess(s, phase, at, rate);
    if (near) {
      for (int i = 0; i < 4; ++i) {
        const int k = i < 3 ? 2 + i : 0;
        at[i] = near->at[k], rate[i] = near->rate[k], acceleration[i] = near->acceleration[k] / kAcceleration;
      }
    }
    PointVariables p;
    for (int i = 0; i < 4; ++i) {
      const bool passive = phase.mode == ClutchMode::still || phase.mode == ClutchMode::locked,
                 held = (phase.mode == ClutchMode::brk || phase.mode == ClutchMode::locked) && i == 2,
                 fixed_motor = passive && i == 3, locked = phase.mode == ClutchMode::rigid && i == 3;
      double low = -kNone, high = kNone, speed = arm_.last.motor_speed;
      if (i < kLinks) {
        const JointLimits& l = arm_.chain.joints[i].limits;
        const double middle = 0.5 * (l.lower + l.upper), half = 0.5 * keep_ * (l.upper - l.lower);
        low = middle - half, high = middle + half, speed = l.velocity;
        if (phase.mode == ClutchMode::rigid && i == 2) speed = std::min(speed, arm_.last.motor_speed);
      }
      speed *= keep_;
      if (locked) {
        p.at[i] = p.rate[i] = p.acceleration[i] = kFixed;
      } else if (fixed_motor) {
        if (phase.mode == ClutchMode::locked) equilibrium_ = p.at[2];  // its spring is out of the game
        p.at[i] = equilibrium_ =
            equilibrium_ == kFixed ? program_.add_variable(low, high, at[i]) : equilibrium_;
        p.rate[i] = p.acceleration[i] = kFixed;
      } else if (held) {
        p.at[i] = held_ = held_ == kFixed ? program_.add_variable(low, high, at[i]) : held_;
        p.rate[i] = p.acceleration[i] = kFixed;
      } else {
        p.at[i] = shared ? shared->at[i] : program_.add_variable(low, high, at[i]);
        p.rate[i] = shared && shared->rate[i] != kFixed ? shared->rate[i]
                                                        : program_.add_variable(-speed, speed, rate[i]);
        if (shared && shared->rate[i] == kFixed)  // the held link is let go: it starts from rest
          program_.lower[p.rate[i]] = program_.upper[p.rate[i]] = program_.start[p.rate[i]] = 0;
        const double most =
            i < kLinks ? keep_ * arm_.chain.joints[i].limits.acceleration / kAcceleration : kNone;
        p.acceleration[i] =
            program_.add_variable(-std::min(most, kNone), std::min(most, kNone), acceleration[i]);
      }
    }
    return p;
  }

  void add_phase(ClutchMode mode, int intervals) {
    const std::size_t index = phases_.size();
    phases_.push_back({mode, intervals, 0, {}});
    PhasePlan& phase = phases_.back();
    const double share = task_.drive == Drive::clutched ? 0.5 : 1;
    const ThrowPhase* near = options_.near ? &options_.near->phases[index] : nullptr;
    const double length = near ? (near->points.back().t - near->points.front().t) / intervals
                               : share * guess_duration_ / intervals;
    phase.step = program_.add_variable(0.03 / intervals, task_.longest / intervals, length);
    const int n = 2 * intervals;
    for (int k = 0; k <= n; ++k) {
      const PointVariables* shared = k == 0 && index > 0 ? &phases_[index - 1].points.back() : nullptr;
      const double s = share * (static_cast<double>(k) / n + static_cast<double>(index));
      phase.points.push_back(add_point(phase, s, shared, near ? &near->points[k] : nullptr));
    }
    for (int k = 0; k <= n; k += 2) add_torques(phase.points[k], near ? &near->points[k] : nullptr);
    for (int k = 0; k <= n; ++k)
      if (k % 2)
        constrain_point(phase, phase.points[k], {phase.points[k - 1].torque, phase.points[k + 1].torque});
      else
        constrain_point(phase, phase.points[k], {phase.points[k].torque});
    for (int k = 0; k < n; k += 2)
      for (int i = 0; i < 4; ++i) {
        const PointVariables &a = phase.points[k], &m = phase.points[k + 1], &b = phase.points[k + 2];
        if (a.acceleration[i] == kFixed) continue;
        program_.constrain(
            hermite_simpson({a.at[i], m.at[i], b.at[i], a.rate[i], m.rate[i], b.rate[i], phase.step}, 1),
            {0, 0}, {0, 0});
        program_.constrain(hermite_simpson({a.rate[i], m.rate[i], b.rate[i], a.acceleration[i],
                                            m.acceleration[i], b.acceleration[i], phase.step},
                                           kAcceleration),
                           {0, 0}, {0, 0});
      }
  }

  /// Towards a small mean square of the accelerations, over time and both phases: of means phase by phase,
  /// one phase would vanish.
  void smooth() {
    for (std::size_t index = 0; index < phases_.size(); ++index) {
      const PhasePlan& phase = phases_[index];
      const int n = 2 * phase.intervals;
      for (int k = 0; k <= n; ++k)
        for (const int a : phase.points[k].acceleration) {
          if (a == kFixed) continue;
          const double simpson = (k == 0 || k == n ? 1.0
                                  : k % 2          ? 4.0
                                                   : 2.0) /
                                 (3.0 * n),
                       weight = (task_.target ? 1.0 : kSmoothing) * simpson;
          program_.minimise(phases_.size() == 1
                                ? weighted_square({a}, weight)
                                : square_in_share({a, phase.step, phases_[1 - index].step}, weight));
        }
    }
  }

  /// A held motor gives nothing: its torque stays zero.
  void add_torques(PointVariables& p, const ThrowPoint* near) {
    const double limit[3]{arm_.chain.joints[0].limits.torque, arm_.chain.joints[1].limits.torque,
                          arm_.last.motor_torque};
    for (int i = 0; i < 3; ++i)
      p.torque[i] = program_.add_variable(-keep_ * limit[i], keep_ * limit[i], near ? near->torque[i] : 0);
  }

  /// The equations of motion at a point, under the mean of the torques at the nodes given.
  void constrain_point(const PhasePlan& phase, const PointVariables& p,
                       const std::vector<std::array<int, 3>>& nodes) {
    const auto [q1, q2, q3, th] = p.at;
    const auto [v1, v2, v3, w] = p.rate;
    const auto [a1, a2, a3, al] = p.acceleration;
    const auto with_torques = [&](std::vector<int> v, int motors) {
      for (const auto& node : nodes) v.insert(v.end(), node.begin(), node.begin() + motors);
      return v;
    };
    switch (phase.mode) {
      case ClutchMode::rigid:
        program_.constrain(rigid_torques(with_torques({q1, q2, q3, v1, v2, v3, a1, a2, a3}, 3), arm_),
                           {0, 0, 0}, {0, 0, 0});
        return;
      case ClutchMode::still:
        program_.constrain(passive_torques(with_torques({q1, q2, q3, v1, v2, v3, a1, a2, a3, th}, 2), arm_),
                           {0, 0, 0}, {0, 0, 0});
        program_.constrain(linear({th, q3}, {1, -1}), {-keep_ * arm_.last.deflection},
                           {keep_ * arm_.last.deflection});
        return;
      case ClutchMode::locked:
        program_.constrain(locked_torques(with_torques({q1, q2, q3, v1, v2, a1, a2}, 2), arm_), {0, 0},
                           {0, 0});
        return;
      case ClutchMode::brk: {
        const double brake = keep_ * arm_.last.brake_torque;
        program_.constrain(braked_torques(with_torques({q1, q2, q3, v1, v2, a1, a2, th, w}, 2), arm_),
                           {0, 0, -brake}, {0, 0, brake});
        break;
      }
      default:
        program_.constrain(series_torques(with_torques({q1, q2, q3, v1, v2, v3, a1, a2, a3, th, w}, 2), arm_),
                           {0, 0, 0}, {0, 0, 0});
    }
    // The motor behind the spring: B_θ θ̈ + K (θ − q₃) + D (θ̇ − q̇₃) = τ_m
    const ClutchedJoint& j = arm_.last;
    std::vector<int> v{al, th, q3, w};
    std::vector<double> factors{j.motor_inertia * kAcceleration, j.stiffness, -j.stiffness, j.damping};
    if (v3 != kFixed) v.push_back(v3), factors.push_back(-j.damping);
    for (const auto& node : nodes)
      v.push_back(node[2]), factors.push_back(-1.0 / static_cast<double>(nodes.size()));
    program_.constrain(linear(v, factors), {0}, {0});
    const double stretch = keep_ * j.deflection;
    program_.constrain(linear({th, q3}, {1, -1}), {-stretch}, {stretch});
  }

  void fix(int variable, double value) {
    if (variable == kFixed) return;
    program_.lower[variable] = program_.upper[variable] = program_.start[variable] = value;
  }

  void fix_start() {
    const PhasePlan& phase = phases_.front();
    const PointVariables& p = phase.points.front();
    for (int i = 0; i < 4; ++i) fix(p.rate[i], 0);
    if (task_.start)
      for (int i = 0; i < kLinks; ++i) fix(p.at[i], (*task_.start)[i]);
    if (phase.mode == ClutchMode::brk) program_.constrain(linear({p.at[3], p.at[2]}, {1, -1}), {0}, {0});
    if (phase.mode == ClutchMode::sea ||
        phase.mode == ClutchMode::still)  // in equilibrium: a spring loaded beforehand would be a present
      for (int i = 0; i < 4; ++i) fix(p.acceleration[i], 0);
  }

  void constrain_release() {
    const PhasePlan& phase = phases_.back();
    const PointVariables& p = phase.points.back();
    Links<double> q, qd;
    std::array<int, kLinks> rate{};
    for (int i = 0; i < kLinks; ++i) {
      rate[i] =
          p.rate[i] == kFixed ? program_.add_variable(0, 0, 0) : p.rate[i];  // a link that is held rests
      q[i] = program_.start[p.at[i]], qd[i] = program_.start[rate[i]];
    }
    const TipState<double> tip = tip_of<double>(arm_, q, qd);
    const int x = program_.add_variable(-kNone, kNone, tip.x),
              z = program_.add_variable(-kNone, kNone, tip.z), vx = program_.add_variable(0, kNone, tip.vx),
              vz = program_.add_variable(-kNone, kNone, tip.vz);
    program_.constrain(tip_state({p.at[0], p.at[1], p.at[2], rate[0], rate[1], rate[2], x, z, vx, vz}, arm_),
                       {0, 0, 0, 0}, {0, 0, 0, 0});
    if (task_.target) {
      const int flight = program_.add_variable(0.05, 3.0, 0.6);
      program_.constrain(miss({x, z, vx, vz, flight}, *task_.target, task_.gravity), {0, 0}, {0, 0});
    } else {
      program_.constrain(linear({vx, vz}, {-std::sin(task_.elevation), std::cos(task_.elevation)}), {0}, {0});
      program_.minimise(minus_squared_speed({vx, vz}));
    }
  }

  void limit_duration() {
    if (phases_.size() == 2)
      program_.constrain(
          linear({phases_[0].step, phases_[1].step}, std::vector<double>(2, options_.intervals)), {0.0},
          {task_.longest});
  }

  void read(ElasticThrow& out) const {
    const std::vector<double>& x = out.program.x;
    const auto value = [&](int k) { return k == kFixed ? 0.0 : x[k]; };
    double begin = 0;
    for (const PhasePlan& phase : phases_) {
      ThrowPhase& to = out.phases.emplace_back();
      to.mode = phase.mode;
      for (std::size_t k = 0; k < phase.points.size(); ++k) {
        const PointVariables& p = phase.points[k];
        ThrowPoint& point = to.points.emplace_back();
        point.t = begin + 0.5 * static_cast<double>(k) * x[phase.step];
        const int motor = phase.mode == ClutchMode::rigid ? 2 : 3;
        const int from[kCoordinates]{motor, 2, 0, 1, 2};
        for (int i = 0; i < kCoordinates; ++i) {
          point.at[i] = value(p.at[from[i]]);
          point.rate[i] = value(p.rate[from[i]]);
          point.acceleration[i] = kAcceleration * value(p.acceleration[from[i]]);
        }
        for (int i = 0; i < 3; ++i)
          point.torque[i] = k % 2
                                ? 0.5 * (x[phase.points[k - 1].torque[i]] + x[phase.points[k + 1].torque[i]])
                                : x[p.torque[i]];
      }
      begin = to.points.back().t;
    }
    const ThrowPoint& last = out.phases.back().points.back();
    out.release = tip_of<double>(arm_, last.at.tail<3>(), last.rate.tail<3>());
  }

  const ClutchedArm& arm_;
  const ThrowTask& task_;
  const ThrowProgramOptions& options_;
  double keep_;
  std::mt19937_64 random_;
  Links<double> from_, to_;
  double load_{}, guess_duration_{};
  int held_{kFixed}, equilibrium_{kFixed};  ///< the angle of a held link, and of a held motor
  NonlinearProgram program_;
  std::vector<PhasePlan> phases_;
};

void check(const ClutchedArm& arm, const ThrowTask& task, const ThrowProgramOptions& options) {
  validate(arm);
  const auto refuse = [](const char* name, double value, const char* accepted) {
    throw std::invalid_argument(fmt::format("plan_throw: {} = {}; accepted: {}", name, value, accepted));
  };
  if (!(task.longest >= 0.1 && task.longest <= 10)) refuse("longest", task.longest, "0.1 to 10 s");
  if (task.let_go && !(task.drive == Drive::clutched && *task.let_go > 0 && *task.let_go < task.longest))
    refuse("let_go", *task.let_go, "(0, longest) s, of the clutched drive");
  if (!(task.margin >= 0 && task.margin < 0.5)) refuse("margin", task.margin, "[0, 0.5)");
  if (!(std::abs(task.elevation) < 1.57)) refuse("elevation", task.elevation, "(-pi/2, pi/2) rad");
  if (!(task.gravity > 0 && std::isfinite(task.gravity))) refuse("gravity", task.gravity, "(0, inf) m/s²");
  for (int i = 0; task.start && i < kLinks; ++i) {
    const JointLimits& l = arm.chain.joints[i].limits;
    if (const double q = (*task.start)[i]; !(q >= l.lower && q <= l.upper))
      refuse(("start of " + arm.chain.joints[i].name).c_str(), q,
             fmt::format("{} to {} rad", l.lower, l.upper).c_str());
  }
  if (options.intervals < 2 || options.intervals > 500) refuse("intervals", options.intervals, "2 to 500");
  if (task.target && !(std::isfinite(task.target->x) && std::isfinite(task.target->z)))
    refuse("target", task.target->x, "finite");
  if (!options.near) return;
  const std::size_t phases = task.drive == Drive::clutched ? 2 : 1,
                    points = 2u * options.intervals * (task.drive == Drive::clutched ? 1 : 2) + 1;
  if (options.near->phases.size() != phases)
    throw std::invalid_argument(
        fmt::format("plan_throw: the neighbouring solution has {} phases; accepted: {}",
                    options.near->phases.size(), phases));
  for (const ThrowPhase& phase : options.near->phases)
    if (phase.points.size() != points)
      throw std::invalid_argument("plan_throw: the neighbouring solution has other intervals");
}

}  // namespace

const char* to_string(Drive drive) {
  switch (drive) {
    case Drive::passive:
      return "spring";
    case Drive::locked:
      return "locked";
    case Drive::clutched:
      return "BRK -> SEA";
    case Drive::series:
      return "SEA";
    case Drive::rigid:
      break;
  }
  return "rigid";
}

ElasticThrow plan_throw(const ClutchedArm& arm, const ThrowTask& task, const ThrowProgramOptions& options) {
  check(arm, task, options);
  return ThrowProgram(arm, task, options).solve();
}

}  // namespace unhand::planners::elastic
