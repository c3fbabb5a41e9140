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

/// The usual step [s] of pads that slip, at a relative tolerance of 1e-5; the error is of second order in it.
constexpr double kStep = 5e-4, kStepTolerance = 1e-5;
/// Shorter steps, down to the shortest [s], are taken where one of them and two of half its length are
/// further from each other than `kMostApart` [m/s] times the relative tolerance: where a hand turns fast, or
/// the tolerance is tight.
constexpr double kMostApart = 300, kShortest = 1e-6;
/// Steps that are `kMost` times as long at most are taken where one of them and two of half its length agree
/// to `kAgree` [m/s] times the relative tolerance: where the pads hold, and stretch with the load. The
/// difference is of second order, so a step of twice the length may follow if it is a quarter of that.
constexpr double kMost = 8, kAgree = 1, kDoubled = 0.25;

/// How long steps may be.
struct Pace {
  double slipping, longest;  ///< s
  double agree, most_apart;  ///< m/s

  explicit Pace(const dynamics::IntegratorOptions& options) {
    const double relative = options.tolerances.relative;
    const double step = std::clamp(kStep * std::sqrt(relative / kStepTolerance), kShortest, kStep);
    slipping = std::min(step, options.longest_step);
    longest = std::min(kMost * step, options.longest_step);
    agree = kAgree * relative;
    most_apart = kMostApart * relative;
  }
  /// The length [s] below which a step is not halved, and how far apart [m/s] its two answers may be.
  double least(double length) const { return length > slipping ? slipping : std::min(kShortest, slipping); }
  double allowed(double length) const { return length > slipping ? agree : most_apart; }
  /// The length [s] of the next step after one whose two answers were so far apart.
  double next(double usual, double length, double apart) const {
    if (apart <= kDoubled * agree) return std::max(usual, std::min(2 * length, longest));
    if (apart <= kDoubled * most_apart) return std::max(usual, std::min(2 * length, slipping));
    return usual;
  }
};

template <class S>
struct Moving {
  Relative<S> relative;
  contact::Stretch<S> stretch;
  Vec3<S> wrench;  ///< on the object about the patch, in the hand's frame [N, N, N m]
};

/// Slip and spin in world axes [m/s, m/s, rad/s], to begin a search at.
using SlipGuess = Vec3<double>;

template <class S>
SlipGuess slip_of(const Relative<S>& y) {
  return {value_of(y.slip.x), value_of(y.slip.z), value_of(y.spin)};
}

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

  /// One implicit step of length h to `scene`, the world at its end, with a first guess of the slip there.
  bool step(const S& h, const Scene<S>& scene, const Moving<S>& from, const SlipGuess& guess, Moving<S>& to) {
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
    const Vec2<double> near = dynamics::rotate(-value_of(theta), Vec2<double>{guess[0], guess[1]});
    Vec3<S> slip{S(near.x), S(near.z), S(guess[2])};
    const typename contact::GivingPoints<S>::Step step{
        h,
        limits_.coulomb(scene.normal_force),
        limits_.length(scene.normal_force),
        {{{m, S(0), zx}, {S(0), m, zz}, {zx, zz, I + m * dot(lever, lever)}}},
        {free.x, free.z, y.spin + h * rate[5]},
        {before.x, before.z, y.spin}};
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

/// How far two slips are from each other [m/s], the spin's part at the object's radius of gyration.
template <class S>
double distance(const Relative<S>& a, const Relative<S>& b, const dynamics::RigidBody<S>& body) {
  const double x = value_of(a.slip.x) - value_of(b.slip.x), z = value_of(a.slip.z) - value_of(b.slip.z),
               spin = value_of(a.spin) - value_of(b.spin);
  return std::sqrt(x * x + z * z + value_of(body.inertia) / value_of(body.mass) * spin * spin);
}

template <class S>
bool is_finite(const Relative<S>& y) {
  const auto state = y.state();
  return std::all_of(state.begin(), state.end(), [](const S& x) { return std::isfinite(value_of(x)); });
}

/// A release on its way.
template <class S>
class GivingRelease {
 public:
  GivingRelease(const ReleaseProblem<S>& problem, const contact::GivesAtPoints& pads,
                const contact::SceneSource& scenes, const GivingStart<S>& start,
                const dynamics::IntegratorOptions& options)
      : body_(problem.body),
        scenes_(scenes),
        options_(options),
        pace_(options),
        usual_(pace_.slipping),
        stepper_(pads.point_limits(S(0))),
        t_(problem.start),
        window_{problem.start, problem.start},
        at_(stepper_.unloaded(start)),
        coarse_(at_),
        half_(at_),
        fine_(at_) {}

  /// Loads the pads for a stretch that begins now.
  Outcome load(double end) {
    window_.end = end;
    return stepper_.load(scenes_.scene(window_, t_), at_) ? Outcome::finished : Outcome::not_converged;
  }
  /// Up to `stop`, with nothing but smooth functions of time before it.
  Outcome advance(const S& stop) {
    const S from = t_;
    window_ = {value_of(from), value_of(stop)};
    if (!(window_.end > window_.begin)) return Outcome::finished;
    State<S, 6> rate = rate_of(at_, scenes_.scene(window_, t_));
    while (value_of(t_) < window_.end) {
      if (result_.statistics.steps >= options_.step_budget) return Outcome::step_budget_spent;
      const double begin = value_of(t_), left = window_.end - begin;
      const double steps = std::max(1.0, std::ceil(left / usual_ * (1 - 1e-12))), length = left / steps;
      const double done = (begin + length - window_.begin) / (window_.end - window_.begin);
      const S next = steps == 1 ? stop : S(from + (stop - from) * done);
      const Scene<S> there = scenes_.scene(window_, next);
      const bool solved = attempt(next, there, rate);
      const double apart = distance(coarse_.relative, fine_.relative, body_);
      const double tried = std::min(length, usual_), least = pace_.least(tried);
      if (tried > least && !(solved && apart <= pace_.allowed(tried))) {
        usual_ = std::max(least, 0.5 * length);
        ++result_.statistics.rejected_steps;
        continue;
      }
      if (!solved)
        return is_finite(coarse_.relative) && is_finite(fine_.relative) ? Outcome::not_converged
                                                                        : Outcome::not_finite;
      usual_ = pace_.next(usual_, length, apart);
      if (!accept(next, there, rate)) return Outcome::not_finite;
    }
    return Outcome::finished;
  }

  /// What there is of it, which ended so.
  ReleaseResult<S> result(Outcome outcome) {
    const Scene<S> scene = scenes_.scene(window_, t_);
    result_.outcome = ReleaseOutcome::not_solved;
    result_.integration = outcome;
    result_.relative = at_.relative;
    result_.detach = {t_, object_pose(scene, at_.relative), object_twist(scene, at_.relative)};
    return std::move(result_);
  }

 private:
  /// To `next` in one step and in two of half its length, `rate` the state's now; whether all were solved.
  bool attempt(const S& next, const Scene<S>& there, const State<S, 6>& rate) {
    const S h = next - t_, middle = t_ + 0.5 * h;
    const SlipGuess now = slip_of(at_.relative);
    SlipGuess ahead = now;
    for (int i = 0; i < 3; ++i) ahead[i] += value_of(h) * value_of(rate[3 + i]);
    if (!stepper_.step(h, there, at_, ahead, coarse_)) return false;
    const SlipGuess end = slip_of(coarse_.relative);
    SlipGuess between;
    for (int i = 0; i < 3; ++i) between[i] = 0.5 * (now[i] + end[i]);
    return stepper_.step(S(0.5 * h), scenes_.scene(window_, middle), at_, between, half_) &&
           stepper_.step(S(0.5 * h), there, half_, end, fine_);
  }
  /// Moves on to what both say; false where that is not finite. `rate` becomes that of the new state.
  bool accept(const S& next, const Scene<S>& there, State<S, 6>& rate) {
    const State<S, 6> before = at_.relative.state(), rate_before = rate;
    stepper_.extrapolate(coarse_, fine_, at_);
    if (!is_finite(at_.relative)) return false;
    rate = rate_of(at_, there);
    if (options_.record)
      record(result_.trajectory, t_, next, window_, before, rate_before, at_.relative.state(), rate);
    t_ = next;
    ++result_.statistics.steps;
    return true;
  }

  const dynamics::RigidBody<S> body_;
  const contact::SceneSource& scenes_;
  const dynamics::IntegratorOptions options_;
  const Pace pace_;
  double usual_;  // the length of steps [s], as the last ones have shown
  Stepper<S> stepper_;
  S t_;
  dynamics::Window window_;
  Moving<S> at_, coarse_, half_, fine_;
  ReleaseResult<S> result_;
};

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

  GivingRelease<S> release(problem, pads, scenes, start, options.integrator);
  Outcome outcome = release.load(value_of(stops.front()));
  for (std::size_t k = 0; k < stops.size() && outcome == Outcome::finished; ++k)
    outcome = release.advance(stops[k]);
  const bool parts = start.separation <= problem.hand.end();
  if (outcome == Outcome::finished && !parts) outcome = Outcome::horizon;
  ReleaseResult<S> result = release.result(outcome);
  if (outcome == Outcome::horizon) result.outcome = ReleaseOutcome::never_separated;
  if (outcome == Outcome::finished) {
    result.outcome = ReleaseOutcome::detached;
    result.events.push_back(
        {dynamics::EventKind::time, 0, 0, start.free_mode, result.detach.time, result.relative.state()});
  }
  return result;
}

template <class S>
Wrench<S> wrench_of_motion(const dynamics::TrajectoryPiece<S, 6>& piece, const S& fraction,
                           const Scene<S>& scene, const Relative<S>& y) {
  const State<S, 6> slope = piece.rate_at_fraction(fraction);
  const S h = piece.t1 - piece.t0;
  const std::array<S, 3> rate{slope[3] / h, slope[4] / h, slope[5] / h};
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
                                         const Scene<double>&, const Relative<double>&);
template Wrench<Dual> wrench_of_motion(const dynamics::TrajectoryPiece<Dual, 6>&, const Dual&,
                                       const Scene<Dual>&, const Relative<Dual>&);

}  // namespace unhand::release
