#include "release/giving_release.hpp"

#include <algorithm>
#include <cmath>

namespace unhand::release {

using contact::Relative;
using contact::Scene;
using contact::Vec3;
using dynamics::Outcome;
using dynamics::State;
using dynamics::value_of;
using dynamics::Vec2;
using dynamics::Wrench;

namespace {

/// The step [s] at a relative tolerance of 1e-5; the error is of second order in it.
constexpr double kStep = 5e-4, kStepTolerance = 1e-5, kShortest = 2.5e-5;

double step_for(const dynamics::IntegratorOptions& options) {
  const double step = kStep * std::sqrt(options.tolerances.relative / kStepTolerance);
  return std::min(std::clamp(step, kShortest, kStep), options.longest_step);
}

template <class S>
struct Moving {
  Relative<S> relative;
  contact::Stretch<S> stretch;
  Vec3<S> wrench;  ///< on the object about the patch, in the hand's frame [N, N, N m]
};

template <class S>
class Stepper {
 public:
  Stepper(const contact::FrictionLimits<S>& limits) : limits_(limits), points_(limits) {}

  Moving<S> unloaded(const GivingStart<S>& from) const {
    return {from.relative, points_.zero(), {from.hold.wrench.fx, from.hold.wrench.fz, from.hold.wrench.tau}};
  }
  /// Stretches the points as far as they carry the wrench; whether that was found.
  bool load(const Scene<S>& scene, Moving<S>& at) {
    return points_.hold(at.wrench, limits_.coulomb(scene.normal_force), limits_.length(scene.normal_force),
                        at.stretch);
  }

  /// One implicit step of length h to `scene`, the world at its end.
  bool step(const S& h, const Scene<S>& scene, const Moving<S>& from, Moving<S>& to) {
    const Relative<S>& y = from.relative;
    // Where the object will be, as the old slip says: explicit here keeps the step convex.
    const Relative<S> ahead = moved(y, h, scene, y.slip, y.spin);
    const State<S, 6> rate = contact::relative_rate(scene, ahead, Wrench<S>{});
    const S& theta = scene.hand.theta;
    const Vec2<S> free = dynamics::rotate(S(-theta), Vec2<S>{y.slip.x + h * rate[3], y.slip.z + h * rate[4]});
    const Vec2<S> lever = dynamics::rotate(ahead.angle, ahead.arm);
    const auto& [m, I] = scene.body;
    const S zx = -m * lever.z, zz = m * lever.x;
    const Vec2<S> before = dynamics::rotate(S(-theta), y.slip);
    Vec3<S> slip{before.x, before.z, y.spin};
    const typename contact::GivingPoints<S>::Step step{
        h,
        limits_.coulomb(scene.normal_force),
        limits_.length(scene.normal_force),
        {{{m, S(0), zx}, {S(0), m, zz}, {zx, zz, I + m * dot(lever, lever)}}},
        {free.x, free.z, y.spin + h * rate[5]},
        slip};
    const bool solved = points_.step(step, from.stretch, to.stretch, slip, to.wrench);
    to.relative = moved(y, h, scene, dynamics::rotate(theta, Vec2<S>{slip[0], slip[1]}), slip[2]);
    return solved;
  }

  /// 2 fine − coarse
  void extrapolate(const Moving<S>& coarse, const Moving<S>& fine, Moving<S>& to) const {
    const State<S, 6> a = coarse.relative.state(), b = fine.relative.state();
    State<S, 6> y;
    for (int i = 0; i < 6; ++i) y[i] = 2.0 * b[i] - a[i];
    to.relative = Relative<S>::from(y);
    for (int i = 0; i < 3; ++i) to.wrench[i] = 2.0 * fine.wrench[i] - coarse.wrench[i];
    contact::GivingPoints<S>::extrapolate(coarse.stretch, fine.stretch, to.stretch);
  }

 private:
  static Relative<S> moved(const Relative<S>& y, const S& h, const Scene<S>& scene, const Vec2<S>& slip,
                           const S& spin) {
    const S angle = y.angle + h * spin;
    return {y.arm + h * dynamics::rotate(S(-scene.hand.theta - angle), slip), angle, slip, spin};
  }

  const contact::FrictionLimits<S>& limits_;
  contact::GivingPoints<S> points_;
};

template <class S>
State<S, 6> rate_of(const Moving<S>& at, const Scene<S>& scene) {
  const Vec2<S> force = dynamics::rotate(scene.hand.theta, Vec2<S>{at.wrench[0], at.wrench[1]});
  return contact::relative_rate(scene, at.relative, Wrench<S>{force.x, force.z, at.wrench[2]});
}

/// The cubic through both ends with their rates.
template <class S>
void record(dynamics::Trajectory<S, 6>& trajectory, const S& t0, const S& t1, const dynamics::Window& window,
            const State<S, 6>& y0, const State<S, 6>& rate0, const State<S, 6>& y1,
            const State<S, 6>& rate1) {
  dynamics::TrajectoryPiece<S, 6> piece{t0, t1, {0, window}, {}};
  const S h = t1 - t0;
  for (int k = 0; k < piece.kNodes; ++k) {
    const double u = static_cast<double>(k) / (piece.kNodes - 1), v = 1 - u;
    for (int i = 0; i < 6; ++i)
      piece.nodes[static_cast<std::size_t>(k)][i] = v * v * (1 + 2 * u) * y0[i] +
                                                    u * u * (1 + 2 * v) * y1[i] +
                                                    u * v * h * (v * rate0[i] - u * rate1[i]);
  }
  trajectory.pieces.push_back(std::move(piece));
}

template <class S>
bool is_finite(const Relative<S>& y) {
  const auto state = y.state();
  return std::all_of(state.begin(), state.end(), [](const S& x) { return std::isfinite(value_of(x)); });
}

}  // namespace

template <class S>
ReleaseResult<S> simulate_giving_release(const ReleaseProblem<S>& problem, const contact::GivesAtPoints& pads,
                                         const contact::SceneSource& scenes, const GivingStart<S>& start,
                                         const ReleaseOptions& options) {
  dynamics::validate(options.integrator);
  const double end = std::min(start.separation, problem.hand.end());
  std::vector<S> stops;
  for (const S& t : start.time_events)
    if (value_of(t) > problem.start && value_of(t) <= end) stops.push_back(t);
  if (stops.empty() || value_of(stops.back()) < end) stops.push_back(S(end));

  ReleaseResult<S> result;
  result.outcome = ReleaseOutcome::not_solved;
  Stepper<S> stepper(pads.point_limits(S(0)));
  S t(problem.start);
  dynamics::Window window{problem.start, value_of(stops.front())};
  Moving<S> at = stepper.unloaded(start);
  const double longest = step_for(options.integrator);
  const auto ended = [&](Outcome outcome) {
    result.integration = outcome;
    result.relative = at.relative;
    const Scene<S> scene = scenes.scene(window, t);
    result.detach = {t, object_pose(scene, at.relative), object_twist(scene, at.relative)};
  };
  if (!stepper.load(scenes.scene(window, t), at)) {
    ended(Outcome::not_converged);
    return result;
  }
  Moving<S> coarse = at, half = at, fine = at;
  for (const S& stop : stops) {
    const S from = t;
    window = {value_of(from), value_of(stop)};
    if (!(window.end > window.begin)) continue;
    const double needed = std::ceil((window.end - window.begin) / longest);
    if (!(needed <= static_cast<double>(options.integrator.step_budget - result.statistics.steps))) {
      ended(Outcome::step_budget_spent);
      return result;
    }
    const long steps = std::max(1L, static_cast<long>(needed));
    State<S, 6> rate = rate_of(at, scenes.scene(window, t));
    for (long k = 1; k <= steps; ++k) {
      const S next =
          k == steps ? stop : S(from + (stop - from) * (static_cast<double>(k) / static_cast<double>(steps)));
      const S h = next - t, middle = t + 0.5 * h;
      const Scene<S> there = scenes.scene(window, next);
      if (!stepper.step(h, there, at, coarse) ||
          !stepper.step(S(0.5 * h), scenes.scene(window, middle), at, half) ||
          !stepper.step(S(0.5 * h), there, half, fine)) {
        ended(is_finite(coarse.relative) && is_finite(fine.relative) ? Outcome::not_converged
                                                                     : Outcome::not_finite);
        return result;
      }
      const Relative<S> before = at.relative;
      stepper.extrapolate(coarse, fine, at);
      if (!is_finite(at.relative)) {
        ended(Outcome::not_finite);
        return result;
      }
      const State<S, 6> rate_there = rate_of(at, there);
      if (options.integrator.record)
        record(result.trajectory, t, next, window, before.state(), rate, at.relative.state(), rate_there);
      rate = rate_there;
      t = next;
      ++result.statistics.steps;
    }
  }
  const bool parts = start.separation <= problem.hand.end();
  ended(parts ? Outcome::finished : Outcome::horizon);
  result.outcome = parts ? ReleaseOutcome::detached : ReleaseOutcome::never_separated;
  if (parts)
    result.events.push_back({dynamics::EventKind::time, 0, 0, start.free_mode, t, at.relative.state()});
  return result;
}

template <class S>
Wrench<S> wrench_of_motion(const dynamics::TrajectoryPiece<S, 6>& piece, const S& fraction,
                           const Scene<S>& scene) {
  const Relative<S> y = Relative<S>::from(piece.at_fraction(fraction));
  // The slip's rate: the pieces are cubics, whose slope four differences on any spacing give exactly.
  const double d = 0.25;
  const auto far = [&](double by) { return piece.at_fraction(S(fraction + by)); };
  const State<S, 6> b2 = far(-2 * d), b1 = far(-d), a1 = far(d), a2 = far(2 * d);
  const S h = piece.t1 - piece.t0;
  std::array<S, 3> rate;
  for (int i = 0; i < 3; ++i)
    rate[static_cast<std::size_t>(i)] =
        (8.0 * (a1[i + 3] - b1[i + 3]) - (a2[i + 3] - b2[i + 3])) / (12 * d * h);
  // v_r' = (a_C − a_H) − ω_O J v_r
  const S omega = scene.hand_twist.omega + y.spin;
  const dynamics::Acceleration<S> point{rate[0] + scene.hand_acceleration.ax - omega * y.slip.z,
                                        rate[1] + scene.hand_acceleration.az + omega * y.slip.x,
                                        rate[2] + scene.hand_acceleration.alpha};
  const Vec2<S> r = contact::lever(scene, y);
  return dynamics::required_wrench(scene.body, dynamics::acceleration_at_com(point, omega, r), r,
                                   scene.gravity);
}

template ReleaseResult<double> simulate_giving_release(const ReleaseProblem<double>&,
                                                       const contact::GivesAtPoints&,
                                                       const contact::SceneSource&,
                                                       const GivingStart<double>&, const ReleaseOptions&);
template ReleaseResult<Dual> simulate_giving_release(const ReleaseProblem<Dual>&,
                                                     const contact::GivesAtPoints&,
                                                     const contact::SceneSource&, const GivingStart<Dual>&,
                                                     const ReleaseOptions&);
template Wrench<double> wrench_of_motion(const dynamics::TrajectoryPiece<double, 6>&, const double&,
                                         const Scene<double>&);
template Wrench<Dual> wrench_of_motion(const dynamics::TrajectoryPiece<Dual, 6>&, const Dual&,
                                       const Scene<Dual>&);

}  // namespace unhand::release
