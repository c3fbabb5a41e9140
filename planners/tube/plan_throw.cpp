#include "planners/tube/plan_throw.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "planners/arm/kinematics.hpp"
#include "planners/tube/require.hpp"

namespace unhand::planners {

const char* to_string(PlanOutcome outcome) {
  switch (outcome) {
    case PlanOutcome::planned:
      return "planned";
    case PlanOutcome::no_throw:
      return "no_throw";
    case PlanOutcome::no_tube:
      return "no_tube";
    case PlanOutcome::no_rest:
      return "no_rest";
    case PlanOutcome::no_motion:
      return "no_motion";
  }
  return "unknown";
}

namespace {

JointLimits share_of(JointLimits limits, double acceleration_share) {
  limits.velocity *= 0.95;
  limits.acceleration *= acceleration_share;
  limits.jerk *= acceleration_share;
  return limits;
}

/// Ramps of all joints from rest to (v, a) in the time of the slowest.
std::optional<std::vector<std::vector<JerkPiece>>> ramps(const Chain& chain, const JointVector<double>& v,
                                                         const JointVector<double>& a,
                                                         double acceleration_share) {
  // What the window asks for may use the whole limit, to the rounding of who made use of it.
  constexpr double kWhole = 1 + 1e-12;
  const auto limits = [&](int i) {
    JointLimits l = share_of(chain.joints[i].limits, acceleration_share);
    l.acceleration =
        std::max(l.acceleration, std::min(std::abs(a[i]), kWhole * chain.joints[i].limits.acceleration));
    return l;
  };
  double longest = 0;
  for (int i = 0; i < chain.size(); ++i) longest = std::max(longest, shortest_ramp(v[i], a[i], limits(i)));
  std::vector<std::vector<JerkPiece>> out;
  for (int i = 0; i < chain.size(); ++i) {
    auto one = std::isfinite(longest) ? velocity_ramp(v[i], a[i], longest, limits(i)) : std::nullopt;
    if (!one) return {};
    out.push_back(std::move(*one));
  }
  return out;
}

}  // namespace

std::optional<JointTrajectory> throw_motion(const Chain& chain, const JointVector<double>& home,
                                            const ThrowState& state, const JointVector<double>& qdd,
                                            double window, double acceleration_share) {
  constexpr const char* kOf = "throw motion";
  require_joints(chain, kOf, "home", home);
  require_joints(chain, kOf, "q", state.q);
  require_joints(chain, kOf, "qd", state.qd);
  require_joints(chain, kOf, "qdd", qdd);
  require(window >= 0 && std::isfinite(window), kOf, "window", window, "[0, inf) s");
  require(acceleration_share > 0 && acceleration_share <= 1, kOf, "acceleration_share", acceleration_share,
          "(0, 1]");
  const int n = chain.size();
  const JointVector<double> last = state.qd + window * qdd;
  const auto swing = ramps(chain, state.qd, qdd, acceleration_share);
  // Braking is speeding up seen backwards: there the acceleration at the joint is −q̈.
  const auto brake = ramps(chain, last, -qdd, acceleration_share);
  if (!swing || !brake) return {};
  JointVector<double> start(n);
  for (int i = 0; i < n; ++i) {
    JerkProfile from({0, 0, 0, 0});
    from.append((*swing)[i]);
    start[i] = state.q[i] - from.end().q;
  }
  // The line from home: its own limits are the tightest of the joints'.
  double velocity = JointLimits::kNone, acceleration = JointLimits::kNone, jerk = JointLimits::kNone;
  for (int i = 0; i < n; ++i) {
    const double length = std::abs(start[i] - home[i]);
    if (!(length > 1e-12)) continue;
    const JointLimits l = share_of(chain.joints[i].limits, acceleration_share);
    velocity = std::min(velocity, l.velocity / length);
    acceleration = std::min(acceleration, l.acceleration / length);
    jerk = std::min(jerk, l.jerk / length);
  }
  std::vector<JerkPiece> line;
  if (std::isfinite(velocity)) line = rest_to_rest(velocity, acceleration, jerk);
  JointTrajectory out;
  for (int i = 0; i < n; ++i) {
    JerkProfile profile({home[i], 0, 0, 0});
    std::vector<JerkPiece> approach = line;
    for (JerkPiece& piece : approach) piece.jerk *= start[i] - home[i];
    profile.append(approach);
    profile.append((*swing)[i]);
    if (i == 0) out.begin = -profile.duration();
    profile.append({{window, 0.0}});
    profile.append({(*brake)[i].rbegin(), (*brake)[i].rend()});
    out.joints.push_back(std::move(profile));
  }
  return out;
}

JointVector<double> middle_of(const Chain& chain) {
  JointVector<double> out(chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const JointLimits& l = chain.joints[i].limits;
    out[i] = std::isfinite(l.upper - l.lower) ? 0.5 * (l.lower + l.upper) : 0.0;
  }
  return out;
}

JointVector<double> rest_pose(const Chain& chain) {
  return chain.home.size() > 0 ? chain.home : middle_of(chain);
}

double largest_miss(const std::vector<LandingAt>& landings) {
  double worst = 0;
  for (const LandingAt& one : landings)
    worst = one.lands ? std::max(worst, std::hypot(one.x, one.y)) : JointLimits::kNone;
  return worst;
}

namespace {

/// The motion to a throw, with as much acceleration as the torques allow.
bool add_motion(const Chain& chain, const JointVector<double>& home, const PlanOptions& options,
                ThrowPlan& plan, std::string& reason) {
  for (const double share : {1.0, 0.75, 0.55, 0.4}) {
    auto moved = throw_motion(chain, home, plan.nominal.state, plan.qdd, options.search.window, share * 0.9);
    if (!moved) {
      reason = "no ramp leads to the tube acceleration within the limits";
      return false;
    }
    plan.limits = check_limits(chain, *moved, 10 * kCheckStep);  // a coarse look is enough to refuse
    if (plan.limits.within()) plan.limits = check_limits(chain, *moved);
    plan.motion = std::move(*moved);
    const bool possible = plan.limits.within() && plan.limits.lowest > 0;
    reason = possible               ? (options.refuse ? options.refuse(plan) : "")
             : plan.limits.within() ? fmt::format("the arm would come down to {:.2f} m", plan.limits.lowest)
                                    : plan.limits.worst(chain);
    if (reason.empty()) return true;
    if (plan.limits.position.fraction > 1) return false;  // slower goes no less far
  }
  return false;
}

/// Braking begins with the acceleration of the window, and adds to its velocity: takes what that is beyond a
/// joint's limit off what the window's end may have of it, once for each joint and where it is little.
bool leave_room(const LimitUse& velocity, const Chain& chain, Chain& allowed) {
  constexpr double kLittle = 1.05;
  if (!(velocity.fraction > 1 && velocity.fraction <= kLittle)) return false;
  const auto joint = static_cast<std::size_t>(velocity.joint);
  double& limit = allowed.joints[joint].limits.velocity;
  if (limit < chain.joints[joint].limits.velocity) return false;
  limit /= velocity.fraction;
  return true;
}

/// A nominal throw made into a plan, or why not.
struct Trial {
  PlanOutcome outcome{};
  std::string reason;
  ThrowPlan plan;
};
/// `allowed`: the chain with what the window's end may have of its limits.
Trial try_throw(const Chain& chain, const Chain& allowed, const NominalThrow& nominal, const TargetBox& box,
                const JointVector<double>& home, const PlanOptions& options) {
  TubeProblem problem{allowed, nominal.state, box.middle, options.search.window, options.search.medium};
  for (const auto& fixed : options.search.fixed) problem.held.push_back(fixed.joint);
  Trial out{PlanOutcome::no_tube, {}, {}};
  ThrowPlan& plan = out.plan;
  plan.nominal = nominal;
  plan.tube = solve_tube(problem);
  out.reason = plan.tube.reason;
  if (plan.tube.outcome != TubeOutcome::solved) return out;
  plan.qdd = options.refine ? refine_tube(problem, plan.tube.qdd) : plan.tube.qdd;
  const auto landings = [&](const JointVector<double>& qdd) {
    return landings_over_window(problem, qdd, kLandingSamples);
  };
  plan.at_rest = landings(JointVector<double>::Zero(chain.size()));
  plan.tube_landings = landings(plan.tube.qdd);
  plan.landings = landings(plan.qdd);
  if (!std::all_of(plan.landings.begin(), plan.landings.end(),
                   [&](const LandingAt& at) { return at.lands && box.holds(at.x, at.y); })) {
    out.reason =
        fmt::format("the window's landings miss the middle by up to {:.3f} m", largest_miss(plan.landings));
    return out;
  }
  out.outcome =
      add_motion(chain, home, options, plan, out.reason) ? PlanOutcome::planned : PlanOutcome::no_motion;
  return out;
}

/// Why the arm cannot rest there; empty: it can.
std::string why_no_rest(const Chain& chain, const JointVector<double>& home) {
  std::string pose;
  for (int i = 0; i < chain.size(); ++i) {
    const auto& [name, origin, link, limits, friction] = chain.joints[i];
    if (!(home[i] >= limits.lower && home[i] <= limits.upper))
      return fmt::format("at rest {} is at {:.4g} rad; accepted: [{:.4g}, {:.4g}] rad", name, home[i],
                         limits.lower, limits.upper);
    pose += fmt::format("{}{:.3g}", i > 0 ? ", " : "", home[i] * 180 / std::numbers::pi);
  }
  const double lowest = lowest_height(chain, frames_of(chain, home));
  if (lowest > 0) return "";
  return fmt::format(
      "at rest at ({}) deg the arm's lowest joint or what it throws is at {:.3f} m; accepted: above its "
      "base, > 0 m",
      pose, lowest);
}

/// Why the search found nothing: by what it finds without one demand or another.
std::string why_no_throw(const Chain& chain, const TargetBox& box, NominalOptions search) {
  search.refined = 0;
  auto anywhere = search;
  anywhere.clear_column = false;
  if (!find_throws(chain, box, anywhere).empty())
    return fmt::format(
        "every throw to the box flies through the arm's own column, within {:g} m of the base's axis and "
        "below its joints there",
        kColumn);
  auto any_landing = anywhere;
  constexpr double kAny = 100;  // m/s
  any_landing.landing.z_rate_low = -kAny, any_landing.landing.r_rate_high = kAny;
  if (!find_throws(chain, box, any_landing).empty())
    return fmt::format(
        "every throw to the box comes down outside of the velocities that its tube allows ({:g} to {:g} m/s "
        "upward, {:g} to {:g} m/s forward)",
        search.landing.z_rate_low, search.landing.z_rate_high, search.landing.r_rate_low,
        search.landing.r_rate_high);
  return fmt::format("none of {} configurations reaches the box within the joints' limits", search.samples);
}

}  // namespace

PlanResult plan_throw(const Chain& chain, const TargetBox& box, const PlanOptions& options) {
  PlanResult out;
  JointVector<double> home = options.home;
  if (home.size() == 0) home = rest_pose(chain);
  require_joints(chain, "plan", "home", home);
  if (auto why = why_no_rest(chain, home); !why.empty()) {
    out.outcome = PlanOutcome::no_rest;
    out.reason = std::move(why);
    return out;
  }
  const auto throws = find_throws(chain, box, options.search);
  out.throws = static_cast<int>(throws.size());
  out.outcome = PlanOutcome::no_throw;
  if (throws.empty()) out.reason = why_no_throw(chain, box, options.search);
  std::vector<std::pair<const NominalThrow*, Chain>> nearly;  // with what the window's end may have of limits
  /// Whether there is a plan. Where limits are too narrow by little, what would leave room goes to `nearly`.
  const auto planned = [&](const NominalThrow& nominal, Chain allowed) {
    Trial trial = try_throw(chain, allowed, nominal, box, home, options);
    if (trial.outcome == PlanOutcome::planned) {
      out.outcome = PlanOutcome::planned;
      out.reason.clear();
      out.plan = std::move(trial.plan);
      return true;
    }
    const bool no_motion = trial.outcome == PlanOutcome::no_motion;
    // The first that nearly was a plan says why, else the first.
    if (no_motion ? out.outcome != PlanOutcome::no_motion : out.outcome == PlanOutcome::no_throw) {
      out.outcome = trial.outcome;
      out.reason = std::move(trial.reason);
    }
    if (no_motion && leave_room(trial.plan.limits.velocity, chain, allowed))
      nearly.emplace_back(&nominal, std::move(allowed));
    return false;
  };
  for (const NominalThrow& nominal : throws) {
    ++out.tried;
    if (planned(nominal, chain)) return out;
  }
  while (!nearly.empty()) {
    const auto again = std::exchange(nearly, {});
    for (const auto& [nominal, allowed] : again)
      if (planned(*nominal, allowed)) return out;
  }
  return out;
}

}  // namespace unhand::planners
