// Robust throwing, studied: prints the tables of docs/robust-throwing.md.
//
//   throw_study boxes       the boxes of [DarkoD46] Table 6: tube acceleration against none
//   throw_study targets N   N random targets: what is planned, how fast, and whether within the limits
//   throw_study grasps      off-centre grasps: the kinematic model, the contact model, the insensitive motion
#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynamics/median.hpp"
#include "planners/arm/kinematics.hpp"
#include "planners/arm/panda.hpp"
#include "planners/tube/held_motion.hpp"
#include "planners/tube/insensitive_throw.hpp"
#include "planners/tube/plan_throw.hpp"
#include "planners/tube/planar_hand.hpp"
#include "planners/tube/planar_joints.hpp"

namespace {

using namespace unhand::planners;
using Joints = JointVector<double>;

/// Of this thread [s]: other processes on the machine do not count.
double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The Panda with a gripper of 0.9 kg whose pads are 0.15 m from the flange (chosen, as for `unhand plan
/// throw`).
Chain pads() {
  const Chain loaded =
      with_payload(panda(), {0.9, {0, 0, 0.075}, symmetric(2.4e-3, 2.4e-3, 1.5e-3, 0, 0, 0)});
  return with_tool(loaded, {Eigen::Matrix3d::Identity(), {0, 0, 0.15}});
}
/// `in_plane_of`: a target in whose vertical plane the throw stays.
PlanOptions options(const std::optional<Eigen::Vector3d>& in_plane_of = {}) {
  PlanOptions out;
  out.home = panda_ready();
  if (in_plane_of) out.search.fixed = *planar_joints(pads(), out.home, *in_plane_of);
  return out;
}

// ---------------------------------------------------------------- boxes

/// Release delays of a class of objects [s]: chosen. The paper gives their order (ball before box before
/// deformable ball, the box's the widest) and the window, no numbers.
struct ObjectClass {
  const char* name;
  double mean, sigma;
} constexpr classes[]{{"hard", 0.025, 0.010}, {"box", 0.050, 0.020}, {"soft", 0.075, 0.012}};

/// Share of throws in the box, as reported on hardware [DarkoD46] Table 6 [%].
struct Reported {
  double tube_small, zero_small, tube_large, zero_large;
};
struct Configuration {
  const char* name;
  Eigen::Vector3d box;
  bool planar;
  int which;  ///< 0: the best throw; 1: the best one far from it in joint space
  Reported reported;
};
const Configuration configurations[]{{"planar", {1.3, 0, -0.2}, true, 0, {97.3, 57.9, 100.0, 91.3}},
                                     {"(a)", {1.1, 0, 0}, false, 0, {91.2, 9.0, 97.4, 79.3}},
                                     {"(b)", {1.1, 0, 0}, false, 1, {40.7, 1, 88.5, 4.1}},
                                     {"(c)", {1.3, 0, -0.3}, false, 0, {81.4, 25.5, 95.6, 90.4}},
                                     {"(d)", {0, -0.7, 0.7}, false, 0, {63.7, 27.6, 96.0, 96.5}}};

PlanOptions options_of(const Configuration& c) { return c.planar ? options(c.box) : options(); }

struct Score {
  double small{}, large{};  ///< share in the boxes of 15 x 15 and 37 x 33 cm [%]
  double std{};             ///< of the landing in the plane [m]
};

/// Landings for delays of all classes alike, with the scatter that other causes add on each axis [m].
/// `aimed`: of a throw that a release at the classes' mean delay brings to the middle, to first order: who
/// plans without the tube does not aim at an opening without delay.
Score score(const TubeProblem& problem, const Joints& qdd, double scatter, std::uint64_t seed,
            bool aimed = false) {
  const auto table = landings_over_window(problem, qdd, 401);
  double mean = 0;
  for (const ObjectClass& one : classes) mean += one.mean / std::size(classes);
  LandingAt aim{};
  if (const auto& at = table[static_cast<std::size_t>(std::lround(mean / problem.window * 400))];
      aimed && at.lands)
    aim = at;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const TargetBox small{problem.target, 0.15, 0.15}, large{problem.target, 0.37, 0.33};
  Score out;
  constexpr int each = 2000;
  double n = 0, sx = 0, sy = 0, sxx = 0, syy = 0;
  for (const ObjectClass& one : classes)
    for (int i = 0; i < each; ++i) {
      double delay = -1;
      while (!(delay >= 0 && delay <= problem.window)) delay = one.mean + one.sigma * normal(random);
      const auto& at = table[static_cast<std::size_t>(std::lround(delay / problem.window * 400))];
      const double x = at.x - aim.x + scatter * normal(random), y = at.y - aim.y + scatter * normal(random);
      n += 1;
      if (!at.lands) continue;
      out.small += small.holds(x, y), out.large += large.holds(x, y);
      sx += x, sy += y, sxx += x * x, syy += y * y;
    }
  out.small *= 100 / n, out.large *= 100 / n;
  out.std = std::sqrt(std::max(0.0, sxx / n - sx * sx / n / n) + std::max(0.0, syy / n - sy * sy / n / n));
  return out;
}

double distance(const NominalThrow& a, const NominalThrow& b) { return (a.state.q - b.state.q).norm(); }

/// All throws that the search offers for the configurations, not the best alone.
void all_throws(const Chain& arm) {
  double zero = 0, tube = 0, refined = 0;
  int count = 0, infeasible = 0;
  std::string least;  // by delay, of the throws without acceleration
  for (const auto& c : configurations) {
    if (c.which == 1) continue;
    const TargetBox box{c.box, 0.15, 0.15};
    double best = HUGE_VAL;
    const auto offered = find_throws(arm, box, options_of(c).search);
    for (const auto& one : offered)
      best = std::min(best, score({arm, one.state, c.box, 0.1}, Joints::Zero(7), 0, 1).std);
    least += fmt::format("{}{} {:.2f} cm", least.empty() ? "" : ", ", c.name, 100 * best);
    for (const auto& one : offered) {
      const TubeProblem problem{arm, one.state, c.box, 0.1};
      const auto solved = solve_tube(problem);
      if (solved.outcome != TubeOutcome::solved) {
        ++infeasible;
        continue;
      }
      ++count;
      zero += score(problem, Joints::Zero(7), 0, 1).std;
      tube += score(problem, solved.qdd, 0, 1).std;
      refined += score(problem, refine_tube(problem, solved.qdd), 0, 1).std;
    }
  }
  fmt::print(
      "all {} throws offered ({} more have no tube acceleration): refined {:.2f} cm ({:.0f} % less), "
      "Tube-CVX {:.2f} cm ({:.0f} % less), none {:.2f} cm\n",
      count, infeasible, 100 * refined / count, 100 * (1 - refined / zero), 100 * tube / count,
      100 * (1 - tube / zero), 100 * zero / count);
  fmt::print("of the throws offered, the one without acceleration that depends least on the delay: {}\n",
             least);
}

/// Takes another of the throws: the best one far from it in joint space.
void take_another(const Chain& arm, const TargetBox& box, const NominalOptions& search, ThrowPlan& plan) {
  for (const auto& other : find_throws(arm, box, search)) {
    if (distance(plan.nominal, other) < 1.5) continue;
    const TubeProblem problem{arm, other.state, box.middle, search.window};
    const auto tube = solve_tube(problem);
    if (tube.outcome != TubeOutcome::solved) continue;
    plan.nominal = other;
    plan.tube = tube;
    plan.qdd = refine_tube(problem, tube.qdd);
    return;
  }
}

void boxes() {
  const Chain arm = pads();
  fmt::print(
      "| configuration | hits 15 cm: refined | Tube-CVX | none | reported tube | reported none | hits 37 x "
      "33 cm: Tube-CVX | none "
      "| reported tube | reported none | std [cm]: refined | Tube-CVX | none |\n| --- |{}\n",
      " ---: |" + [] {
        std::string out;
        for (int i = 0; i < 11; ++i) out += " ---: |";
        return out;
      }());
  double sums[3]{};
  for (const auto& c : configurations) {
    const PlanOptions how = options_of(c);
    const TargetBox box{c.box, 0.15, 0.15};
    NominalOptions search = how.search;
    auto result = plan_throw(arm, box, how);
    if (c.which == 1 && result.plan) take_another(arm, box, search, *result.plan);
    if (!result.plan) {
      fmt::print("| {} | {} |\n", c.name, result.reason);
      continue;
    }
    const TubeProblem problem{arm, result.plan->nominal.state, c.box, search.window};
    const Joints none = Joints::Zero(7);
    constexpr double scatter = 0.02;
    const Score refined = score(problem, result.plan->qdd, scatter, 1),
                tube = score(problem, result.plan->tube.qdd, scatter, 1),
                zero = score(problem, none, scatter, 1, true);
    const double stds[]{score(problem, result.plan->qdd, 0, 1).std,
                        score(problem, result.plan->tube.qdd, 0, 1).std, score(problem, none, 0, 1).std};
    for (int i = 0; i < 3; ++i) sums[i] += stds[i] / 5;
    fmt::print(
        "| {} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.1f} | {:.2f} | "
        "{:.2f} | {:.2f} |\n",
        c.name, refined.small, tube.small, zero.small, c.reported.tube_small, c.reported.zero_small,
        tube.large, zero.large, c.reported.tube_large, c.reported.zero_large, 100 * stds[0], 100 * stds[1],
        100 * stds[2]);
  }
  fmt::print(
      "\nmean std of landing by delay alone: refined {:.2f} cm ({:.0f} % less), Tube-CVX {:.2f} cm ({:.0f} % "
      "less), none {:.2f} cm\n",
      100 * sums[0], 100 * (1 - sums[0] / sums[2]), 100 * sums[1], 100 * (1 - sums[1] / sums[2]),
      100 * sums[2]);
  all_throws(arm);
}

// ---------------------------------------------------------------- targets

/// Numbers of which median and worst are told.
struct Times {
  std::vector<double> values;
  double median() const { return values.empty() ? 0 : unhand::dynamics::median(values); }
  double worst() const { return values.empty() ? 0 : *std::max_element(values.begin(), values.end()); }
};

void targets(int count) {
  const Chain arm = pads();
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> reach(0.9, 1.5), azimuth(-1.0, 1.0), height(-0.4, 0.3);
  Times tube, plan, refine;
  int planned = 0, outside = 0, outcomes[5]{};
  LimitCheck most;
  Times tube_miss, miss;
  for (int i = 0; i < count; ++i) {
    const double r = reach(random), a = azimuth(random);
    const TargetBox box{{r * std::cos(a), r * std::sin(a), height(random)}, 0.15, 0.15};
    const double begin = cpu_seconds();
    const auto result = plan_throw(arm, box, options());
    plan.values.push_back(cpu_seconds() - begin);
    ++outcomes[static_cast<int>(result.outcome)];
    if (!result.plan) continue;
    ++planned;
    const TubeProblem problem{arm, result.plan->nominal.state, box.middle, 0.1};
    const double before = cpu_seconds();
    const auto again = solve_tube(problem);
    const double between = cpu_seconds();
    refine_tube(problem, again.qdd);
    tube.values.push_back(between - before);
    refine.values.push_back(cpu_seconds() - between);
    const auto limits =
        check_limits(arm, result.plan->motion, 2.5e-4);  // four times as dense as the plan looked
    outside += !limits.within();
    tube_miss.values.push_back(largest_miss(result.plan->tube_landings));
    miss.values.push_back(largest_miss(result.plan->landings));
    for (auto use : {&LimitCheck::position, &LimitCheck::velocity, &LimitCheck::acceleration,
                     &LimitCheck::jerk, &LimitCheck::torque})
      if ((limits.*use).fraction > (most.*use).fraction) most.*use = limits.*use;
  }
  fmt::print(
      "{} targets: {} planned, {} no throw, {} no tube, {} no motion; {} plans outside the limits when "
      "checked at 0.25 ms\n",
      count, planned, outcomes[1], outcomes[2], outcomes[3], outside);
  fmt::print(
      "CPU time: Tube-CVX median {:.3f} ms, worst {:.3f} ms; refinement {:.3f}, {:.3f} ms; whole plan "
      "{:.1f}, {:.1f} ms\n",
      1e3 * tube.median(), 1e3 * tube.worst(), 1e3 * refine.median(), 1e3 * refine.worst(),
      1e3 * plan.median(), 1e3 * plan.worst());
  fmt::print(
      "largest miss over the window, median and worst: Tube-CVX {:.4f}, {:.3f} m; planned {:.4f}, {:.3f} m\n",
      tube_miss.median(), tube_miss.worst(), miss.median(), miss.worst());
  fmt::print(
      "limits used, at most: position {:.1f} %, velocity {:.1f} %, acceleration {:.1f} %, jerk {:.1f} %, "
      "torque {:.1f} %\n",
      100 * most.position.fraction, 100 * most.velocity.fraction, 100 * most.acceleration.fraction,
      100 * most.jerk.fraction, 100 * most.torque.fraction);
}

// ---------------------------------------------------------------- grasps

/// The power that a rigid hold takes from the carried object's rotation, in the middle of the window [W]: τ_p
/// ω, with the torque that the pads must give, τ_p = (I + m l²) α − m (z_r a_x − x_r (a_z + g)), about their
/// middle.
double holding_power(const ReleaseThrow& thrown, double window) {
  const ThrowPlane plane(forward_kinematics(thrown.chain, thrown.start.q).p, thrown.target);
  const PlanarHand motion(thrown.chain, plane, thrown.start.q, thrown.start.qd.cast<Dual>(),
                          thrown.qdd.cast<Dual>(), window);
  const auto hand = motion.at({0, window}, 0.5 * window);
  const double l = thrown.object.com_offset.value, x = l * std::cos(hand.pose.theta),
               z = l * std::sin(hand.pose.theta);
  const double torque = (thrown.object.inertia + thrown.object.mass * l * l) * hand.acceleration.alpha -
                        thrown.object.mass * (z * hand.acceleration.ax - x * (hand.acceleration.az + 9.81));
  return torque * hand.twist.omega;
}

struct Further {
  int count{};
  double sum{}, low{1}, high{-1};
  void add(double x) { ++count, sum += x, low = std::min(low, x), high = std::max(high, x); }
  std::string text() const {
    return count == 0 ? "-"
                      : fmt::format("{}: {:+.1f} ({:+.1f} to {:+.1f})", count, 100 * sum / count, 100 * low,
                                    100 * high);
  }
};

/// Throws with a motion within the limits, those over whose motion the grip holds the object, and the
/// landings of these.
struct Judged {
  int possible{}, held{}, hits{}, draws{};
  double square{};  ///< sum of the mean square misses [m²]
  std::string text() const {
    const std::string share = fmt::format("{} of {}", held, possible);
    return held == 0 ? share + " | - | -"
                     : fmt::format("{} | {:.2f} | {:.1f} %", share, 100 * std::sqrt(square / held),
                                   100.0 * hits / draws);
  }
};

/// Counts a throw if, of a few motions to it within the limits, there is one over which the grip holds.
void judge(const ReleaseThrow& thrown, Judged& out) {
  constexpr int draws = 200;
  const Joints home = panda_ready();
  bool possible = false;
  for (const double share : {0.9, 0.65, 0.45, 0.3}) {
    const auto motion = throw_motion(thrown.chain, home, thrown.start, thrown.qdd, thrown.hold, share);
    if (!motion) continue;
    const auto limits = check_limits(thrown.chain, *motion);
    if (!limits.within() || !(limits.lowest > 0)) continue;
    out.possible += !std::exchange(possible, true);
    const HeldMotion before(thrown, *motion);
    if (!before.holds(nominal_draw(thrown))) continue;
    const Landings drawn = draw_landings(thrown, draws, 1, &before);
    ++out.held;
    out.draws += draws;
    if (drawn.miss.size() > 1) out.square += drawn.mean * drawn.mean + drawn.std * drawn.std;
    out.hits += static_cast<int>(
        std::count_if(drawn.miss.begin(), drawn.miss.end(), [](double x) { return std::abs(x) <= 0.075; }));
    return;
  }
}

void grasps() {
  const Chain arm = pads();
  const Eigen::Vector3d target(1.3, 0, -0.2);
  const TargetBox box{target, 0.15, 0.15};
  fmt::print(
      "| offset [m] | grip [N] | turning held back: contact model - rigid [cm] | turning driven | before: "
      "held "
      "| rms [cm] | in 15 cm | after: held | rms [cm] | in 15 cm |\n"
      "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n");
  for (const double offset : {0.0, 0.14})
    for (const double grip : {80.0, 40.0, 20.0, 10.0}) {
      const Chain com = with_tool(arm, {Eigen::Matrix3d::Identity(), {0, 0, offset}});
      NominalOptions search = options(target).search;
      search.window = 0.12;
      search.refined = 0;
      search.candidates = 400;
      Further braked, others;
      Judged before, after;
      int seen = 0;
      for (const auto& one : find_throws(com, box, search)) {
        const TubeProblem problem{com, one.state, target, search.window};
        const auto tube = solve_tube(problem);
        if (tube.outcome != TubeOutcome::solved) continue;
        ReleaseThrow thrown{arm, one.state, tube.qdd, target};
        thrown.card.model = "sliding_pivot";
        thrown.card.grip_force = grip;
        thrown.object.com_offset = {offset, 0.004};
        const auto real = release_landing(thrown, nominal_draw(thrown));
        if (!real) continue;
        const auto rigid = rigid_landing(thrown, offset, real->detach_time);
        if (!rigid) continue;
        (holding_power(thrown, search.window) < 0 ? braked : others).add(real->miss - rigid->miss);
        if (++seen % 2 != 1) continue;
        judge(thrown, before);
        const auto better = make_insensitive(thrown, {1, 3, 5});
        thrown.start = better.start;
        thrown.qdd = better.qdd;
        judge(thrown, after);
      }
      fmt::print("| {:.2f} | {:.0f} | {} | {} | {} | {} |\n", offset, grip, braked.text(), others.text(),
                 before.text(), after.text());
    }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view what = argc > 1 ? argv[1] : "";
  if (what == "boxes")
    boxes();
  else if (what == "targets")
    targets(argc > 2 ? std::atoi(argv[2]) : 1000);
  else if (what == "grasps")
    grasps();
  else
    return fmt::print(stderr, "usage: throw_study boxes | targets [N] | grasps\n"), 2;
}
