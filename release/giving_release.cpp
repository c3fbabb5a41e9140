#include "release/giving_release.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

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
constexpr double kStep = 8e-4, kStepTolerance = 1e-5;
/// A step is judged by how its slip q bends: h²/4 |q''|, by which an Euler step and two of half its length
/// are apart. Shorter ones, down to the shortest [s], are taken where that is more than `kMostBend` [m/s]
/// times the relative tolerance: where a hand turns fast, or the tolerance is tight.
constexpr double kMostBend = 300, kShortest = 1e-6;
/// Steps that are `kMost` times as long at most are taken where it is no more than `kAgree` [m/s] times the
/// relative tolerance: where the pads hold, and stretch with the load. It is of second order, so a step of
/// twice the length may follow if it is a quarter of that.
constexpr double kMost = 5, kAgree = 1, kDoubled = 0.25;

/// How long steps may be.
struct Pace {
  double slipping, longest;  ///< s
  double agree, most_bend;   ///< m/s

  explicit Pace(const dynamics::IntegratorOptions& options) {
    const double relative = options.tolerances.relative;
    const double step = std::clamp(kStep * std::sqrt(relative / kStepTolerance), kShortest, kStep);
    slipping = std::min(step, options.longest_step);
    longest = std::min(kMost * step, options.longest_step);
    agree = kAgree * relative;
    most_bend = kMostBend * relative;
  }
  /// The length [s] below which a step is not halved, and how far it may bend [m/s].
  double least(double length) const { return length > slipping ? slipping : std::min(kShortest, slipping); }
  double allowed(double length) const { return length > slipping ? agree : most_bend; }
  /// The length [s] of the next step after one that bends so far.
  double next(double usual, double length, double bend) const {
    if (bend <= kDoubled * agree) return std::max(usual, std::min(2 * length, longest));
    if (bend <= kDoubled * most_bend) return std::max(usual, std::min(2 * length, slipping));
    return usual;
  }
};

template <class S>
struct Moving {
  Relative<S> relative;
  contact::Stretch<S> stretch;
  Vec3<S> wrench;  ///< on the object about the patch, in the hand's frame [N, N, N m]
};

/// a x + b y
template <class S>
Relative<S> mixed(double a, const Relative<S>& x, double b, const Relative<S>& y) {
  const State<S, 6> p = x.state(), q = y.state();
  State<S, 6> out;
  for (int i = 0; i < 6; ++i) out[i] = a * p[i] + b * q[i];
  return Relative<S>::from(out);
}

/// Steps of length h by the L-stable SDIRK method of second order [HairerWanner1996, IV.6], γ = 1 − 1/√2:
///
///   y1 = y0 + γ h f(y1)                                  at t0 + γ h
///   y2 = y0 + (1−γ) h f(y1) + γ h f(y2) = y0 + (1−γ)/γ (y1 − y0) + γ h f(y2)
template <class S>
class Stepper {
 public:
  static constexpr double kGamma = 1 - 0.5 * std::numbers::sqrt2;

  explicit Stepper(const contact::FrictionLimits<S>& limits)
      : limits_(limits), points_(limits), base_(points_.zero()) {}

  Moving<S> unloaded(const GivingStart<S>& from) const {
    return {from.relative, points_.zero(), {from.hold.wrench.fx, from.hold.wrench.fz, from.hold.wrench.tau}};
  }
  /// Stretches the points as far as they carry the wrench; whether that was found.
  bool load(const Scene<S>& scene, Moving<S>& at) {
    return points_.hold(at.wrench, limits_.coulomb(scene.normal_force), limits_.length(scene.normal_force),
                        at.stretch);
  }

  /// From `from` to y1, γ h = `gain`, the world there `scene`. `known` has the slip that is expected there.
  bool first(const S& gain, const Scene<S>& scene, const Moving<S>& from, const Relative<S>& known,
             Moving<S>& to) {
    return stage(gain, scene, from.relative, from.stretch, known, to);
  }
  /// To y2, where y1 is `first`.
  bool second(const S& gain, const Scene<S>& scene, const Moving<S>& from, const Moving<S>& first,
              const Relative<S>& known, Moving<S>& to) {
    constexpr double kAgain = (1 - kGamma) / kGamma;
    contact::GivingPoints<S>::mix(1 - kAgain, from.stretch, kAgain, first.stretch, base_);
    return stage(gain, scene, mixed(1 - kAgain, from.relative, kAgain, first.relative), base_, known, to);
  }

 private:
  /// y = base + gain f(y). `known` has the slip that says where the object will be and how friction that
  /// depends on speed acts: explicit in both, the problem is convex.
  bool stage(const S& gain, const Scene<S>& scene, const Relative<S>& base,
             const contact::Stretch<S>& stretch, const Relative<S>& known, Moving<S>& to) {
    const Relative<S> ahead = moved(base, gain, scene, known.slip, known.spin);
    const State<S, 6> rate = contact::relative_rate(scene, ahead, Wrench<S>{});
    const Vec2<S> free = in_hand(scene, {base.slip.x + gain * rate[3], base.slip.z + gain * rate[4]});
    const Vec2<S> lever = dynamics::rotate(ahead.angle, ahead.arm);
    const auto& [m, I] = scene.body;
    const S zx = -m * lever.z, zz = m * lever.x;
    const Vec2<S> expected = in_hand(scene, known.slip);
    Vec3<S> slip{expected.x, expected.z, known.spin};
    const typename contact::GivingPoints<S>::Step problem{
        gain,
        limits_.coulomb(scene.normal_force),
        limits_.length(scene.normal_force),
        {{{m, S(0), zx}, {S(0), m, zz}, {zx, zz, I + m * dot(lever, lever)}}},
        {free.x, free.z, base.spin + gain * rate[5]},
        slip};
    const bool solved = points_.step(problem, stretch, to.stretch, slip, to.wrench);
    to.relative =
        moved(base, gain, scene, dynamics::rotate(scene.hand.theta, Vec2<S>{slip[0], slip[1]}), slip[2]);
    return solved;
  }

  static Vec2<S> in_hand(const Scene<S>& scene, const Vec2<S>& v) {
    return dynamics::rotate(S(-scene.hand.theta), v);
  }
  static Relative<S> moved(const Relative<S>& base, const S& gain, const Scene<S>& scene, const Vec2<S>& slip,
                           const S& spin) {
    const S angle = base.angle + gain * spin;
    return {base.arm + gain * dynamics::rotate(S(-scene.hand.theta - angle), slip), angle, slip, spin};
  }

  const contact::FrictionLimits<S>& limits_;
  contact::GivingPoints<S> points_;
  contact::Stretch<S> base_;
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

/// How large the slip is [m/s], the spin's part at the object's radius of gyration.
template <class S>
double size(const Relative<S>& y, const dynamics::RigidBody<S>& body) {
  const double x = value_of(y.slip.x), z = value_of(y.slip.z), spin = value_of(y.spin);
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
        stage_(at_),
        next_(at_),
        before_(at_.relative) {}

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
    length_ = 0;
    if (options_.record) rate_ = rate_of(at_, scenes_.scene(window_, t_));
    while (value_of(t_) < window_.end) {
      if (result_.statistics.steps >= options_.step_budget) return Outcome::step_budget_spent;
      const double begin = value_of(t_), left = window_.end - begin;
      const double steps = std::max(1.0, std::ceil(left / usual_ * (1 - 1e-12))), length = left / steps;
      const double done = (begin + length - window_.begin) / (window_.end - window_.begin);
      const S next = steps == 1 ? stop : S(from + (stop - from) * done);
      const Scene<S> there = scenes_.scene(window_, next);
      const Attempt made = attempt(next, there);
      const double tried = std::min(length, usual_), least = pace_.least(tried);
      if (tried > least && !(made.solved && made.bend <= pace_.allowed(tried))) {
        usual_ = std::max(least, 0.5 * length);
        ++result_.statistics.rejected_steps;
        continue;
      }
      if (!(is_finite(stage_.relative) && is_finite(next_.relative))) return Outcome::not_finite;
      if (!made.solved) return Outcome::not_converged;
      usual_ = pace_.next(usual_, length, made.bend);
      accept(next, there);
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
  /// A step to next_: whether it was solved, and how far it bends [m/s].
  struct Attempt {
    bool solved;
    double bend;
  };
  Attempt attempt(const S& next, const Scene<S>& there) {
    constexpr double kGamma = Stepper<S>::kGamma;
    const S h = next - t_, gain = kGamma * h;
    const double ahead = length_ > 0 ? kGamma / (1 - kGamma) * value_of(h) / length_ : 0;
    const Relative<S> known = mixed(1 + ahead, at_.relative, -ahead, before_);
    const bool first = stepper_.first(gain, scenes_.scene(window_, t_ + gain), at_, known, stage_);
    const Relative<S> straight_on = mixed(1 - 1 / kGamma, at_.relative, 1 / kGamma, stage_.relative);
    const bool solved = first && stepper_.second(gain, there, at_, stage_, straight_on, next_);
    const Relative<S> bent = mixed(1, next_.relative, -1, straight_on);
    return {solved, size(bent, body_) / (4 * kGamma * (1 - kGamma))};
  }
  void accept(const S& next, const Scene<S>& there) {
    length_ = value_of(next) - value_of(t_);
    before_ = stage_.relative;
    std::swap(at_, next_);
    if (options_.record) {
      const State<S, 6> rate = rate_of(at_, there);
      record(result_.trajectory, t_, next, window_, next_.relative.state(), rate_, at_.relative.state(),
             rate);
      rate_ = rate;
    }
    t_ = next;
    ++result_.statistics.steps;
  }

  const dynamics::RigidBody<S> body_;
  const contact::SceneSource& scenes_;
  const dynamics::IntegratorOptions options_;
  const Pace pace_;
  double usual_;  // the length of steps [s], as the last ones have shown
  Stepper<S> stepper_;
  S t_;
  dynamics::Window window_;
  Moving<S> at_, stage_, next_;
  Relative<S> before_;  // at the stage of the last step
  double length_{};     // of that [s]; 0 for none
  State<S, 6> rate_;    // of at_
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
