#include "contact/sliding_pivot.hpp"

#include <array>

#include "contact/contact_model_from.hpp"
#include "contact/slip_stop.hpp"

namespace unhand::contact {

using dynamics::value_of;

namespace {

enum Translation { kStuck, kSlide, kBrake };
enum Rotation { kLocked, kPositive, kNegative };

constexpr int mode_of(Translation translation, Rotation rotation) { return 3 * translation + rotation; }
// Sliding with ω_r = 0 attracting from both sides: between slide+ and slide−.
constexpr int kSlideBetween = 9;
constexpr Translation translation_of(int mode) {
  return mode == kSlideBetween ? kSlide : static_cast<Translation>(mode / 3);
}
constexpr Rotation rotation_of(int mode) { return static_cast<Rotation>(mode % 3); }  // kSlideBetween: locked
constexpr double sign_of(Rotation rotation) { return rotation == kPositive ? 1.0 : -1.0; }

// Guards by index; what an index means depends on the mode.
constexpr int kRotationGuard = 0, kTranslationGuard = 1, kSlideAgain = 2, kTorqueSuffices = 2;

/// The law in one mode: the force that would carry the contact point, what acts, and what follows for the
/// rotation.
template <class S>
struct Law {
  Vec2<S> carrying_force;  ///< f_p [N]
  Wrench<S> wrench;        ///< about the patch, on the object [N, N, N m]
  S spin_acceleration{};   ///< α_O − α_H [rad/s²]; 0 while locked
};

template <class S>
Law<S> law_between(const FrictionLimits<S>& limits, const Scene<S>& scene, const Relative<S>& y,
                   const Vec2<S>& r);

/// `r` is the lever of y in the scene.
template <class S>
Law<S> law(int mode, const FrictionLimits<S>& limits, const Scene<S>& scene, const Relative<S>& y,
           const Vec2<S>& r) {
  if (mode == kSlideBetween) return law_between(limits, scene, y, r);
  const Translation translation = translation_of(mode);
  const Rotation rotation = rotation_of(mode);
  const auto& [m, I] = scene.body;
  const S omega = scene.hand_twist.omega + y.spin;
  const S limit = limits.slipping(scene.normal_force, y.slip, y.spin);
  const S alpha_hand = scene.hand_acceleration.alpha;
  const Vec2<S> apparent = scene.hand_acceleration.linear() - scene.gravity;  // a_H + g e_z

  Law<S> out;
  S torque{}, alpha = alpha_hand;
  if (rotation != kLocked) {
    torque = -sign_of(rotation) * (limits.length(scene.normal_force) * limit);
    alpha = (m * (r.z * apparent.x - r.x * apparent.z) + torque) / (I + m * dot(r, r));
  }
  out.carrying_force = {m * (apparent.x - alpha * r.z - omega * omega * r.x),
                        m * (apparent.z + alpha * r.x - omega * omega * r.z)};

  Vec2<S> force = out.carrying_force;
  if (translation == kSlide && value_of(limit) > 0)
    force = (limit / norm(out.carrying_force)) * out.carrying_force;
  if (translation == kSlide && !(value_of(limit) > 0))
    force = {S(0), S(0)};  // and nothing may be asked of them
  if (translation == kBrake) force = (-limit / norm(y.slip)) * y.slip;

  const S lever_torque = r.z * force.x - r.x * force.z;
  if (rotation == kLocked) {
    torque = I * alpha_hand - lever_torque;
  } else {
    out.spin_acceleration = (translation == kStuck ? alpha : (torque + lever_torque) / I) - alpha_hand;
  }
  out.wrench = {force.x, force.z, torque};
  return out;
}

/// Filippov's solution where slide+ decelerates and slide− accelerates the spin: the mixture λ, 1 − λ of
/// their wrenches that leaves ω_r = 0. Force and torque stay within their limits, being between two that do.
template <class S>
Law<S> law_between(const FrictionLimits<S>& limits, const Scene<S>& scene, const Relative<S>& y,
                   const Vec2<S>& r) {
  const Law<S> plus = law(mode_of(kSlide, kPositive), limits, scene, y, r);
  const Law<S> minus = law(mode_of(kSlide, kNegative), limits, scene, y, r);
  const S spread = minus.spin_acceleration - plus.spin_acceleration;  // vanishes with the normal force
  const S share = value_of(spread) > 0 ? S(minus.spin_acceleration / spread) : S(0.5), rest = 1.0 - share;
  return {share * plus.carrying_force + rest * minus.carrying_force,
          {share * plus.wrench.fx + rest * minus.wrench.fx, share * plus.wrench.fz + rest * minus.wrench.fz,
           share * plus.wrench.tau + rest * minus.wrench.tau},
          S(0)};
}

/// How the object's point at the patch answers a push: W = 1/m + q qᵀ/I, q = (r_z, −r_x); 1/m while the
/// rotation is locked.
template <class S>
struct Mobility {
  S mass, turning, share;  ///< m [kg]; 1/I [1/(kg m²)] and m/(I + m l²) [1/m²], or zeros
  Vec2<S> q;               ///< m
  Mobility(const RigidBody<S>& body, Rotation rotation, const Vec2<S>& r)
      : mass(body.mass), turning(0), share(0), q{r.z, -r.x} {
    if (rotation == kLocked) return;
    turning = 1.0 / body.inertia;
    share = mass / (body.inertia + mass * dot(r, r));
  }
  Vec2<S> times(const Vec2<S>& x) const { return (1.0 / mass) * x + (turning * dot(q, x)) * q; }  // W x
  Vec2<S> solve(const Vec2<S>& x) const { return mass * (x - (share * dot(q, x)) * q); }          // W⁻¹ x
};

/// v̇/v [1/s] of a braked slip, judged by its energy ½ v·W⁻¹v: its part across the lever, which turns a light
/// object instead of carrying it, may end long before the slip does. See LimitSurface's.
template <class S>
S brake_growth(const Mobility<S>& mobility, const Vec2<S>& slip, const State<S, 6>& rate) {
  const Vec2<S> momentum = mobility.solve(slip);
  return dot(momentum, Vec2<S>{rate[3], rate[4]}) / dot(momentum, slip);
}

/// The rotation that follows when friction is short of the torque that it takes: the object lags behind the
/// hand.
constexpr Rotation lagging(double demanded_torque) { return demanded_torque > 0 ? kNegative : kPositive; }

/// Time after the onset of spin [s] at which its sign is beyond rounding: at the onset ω_r and its rate are
/// both zero.
constexpr double kSpinOnset = 1e-6;
constexpr double kTurned = 0.1;  // of the time in which a brake turns or stops its slip

}  // namespace

SlidingPivot::SlidingPivot(const Patch<Dual>& patch, SlideEnd slide_end,
                           const FrictionVariation<Dual>& variation)
    : limits_{{values(patch), values(variation)}, {patch, variation}}, slide_end_(slide_end) {
  validate(limits_.value.patch());
  validate(variation);
}

std::string_view SlidingPivot::mode_name(int mode) const {
  static constexpr std::array<std::string_view, 10> kNames{
      "stick", "pivot+", "pivot-", "slide", "slide+", "slide-", "brake", "brake+", "brake-", "slide between"};
  return kNames[static_cast<std::size_t>(mode)];
}

dynamics::FlowKind SlidingPivot::kind(int mode) const {
  if (mode == mode_of(kStuck, kLocked)) return dynamics::FlowKind::frozen;
  // A brake that f_max barely outweighs lasts long while its direction relaxes at once, the faster the longer
  // the lever.
  return translation_of(mode) == kBrake ? dynamics::FlowKind::mixed : dynamics::FlowKind::smooth;
}

bool SlidingPivot::is_homogeneous(int mode) const { return translation_of(mode) == kBrake; }

bool SlidingPivot::may_feed_energy(int mode) const { return translation_of(mode) == kSlide; }

int SlidingPivot::guard_count(int mode) const {
  if (mode == kSlideBetween) return 3;
  return translation_of(mode) == kBrake && slide_end_ == SlideEnd::memoryless ? 3 : 2;
}

dynamics::Guard SlidingPivot::guard(int mode, int index) const {
  using dynamics::Crossing;
  if (mode == kSlideBetween && index == kRotationGuard) return {"spin sets in", Crossing::rising};
  if (mode == kSlideBetween && index == kTorqueSuffices) return {"torque suffices", Crossing::falling};
  if (index == kRotationGuard)
    return rotation_of(mode) == kLocked ? dynamics::Guard{"torque limit", Crossing::rising}
                                        : dynamics::Guard{"spin stops", Crossing::falling};
  if (index == kSlideAgain) return {"force limit", Crossing::rising};
  switch (translation_of(mode)) {
    case kStuck:
      return {"force limit", Crossing::rising};
    case kSlide:
      return {"force suffices", Crossing::falling};
    default:
      return {"slip stops", Crossing::falling};
  }
}

template <class S>
void SlidingPivot::guards_(const Phase& phase, const SceneSource& source, const S& t, const Relative<S>& y,
                           S* g) const {
  const int mode = phase.mode;
  const Scene<S> scene = source.scene(phase.window, t);
  const FrictionLimits<S>& limits = limits_.of<S>();
  const Stance<S> stands = stance(scene, y);
  const Law<S> now = law(mode, limits, scene, y, stands.r);
  const S force_limit = limits.slipping(scene.normal_force, y.slip, y.spin),
          torque_limit = limits.length(scene.normal_force) * force_limit;
  if (rotation_of(mode) != kLocked) {
    g[kRotationGuard] = sign_of(rotation_of(mode)) * y.spin;
  } else {
    g[kRotationGuard] = margin(S(now.wrench.tau * now.wrench.tau), S(torque_limit * torque_limit));
  }
  if (mode == kSlideBetween) {
    const S plus = law(mode_of(kSlide, kPositive), limits, scene, y, stands.r).spin_acceleration;
    const S minus = law(mode_of(kSlide, kNegative), limits, scene, y, stands.r).spin_acceleration;
    const S drive = plus > -minus ? plus : S(-minus);
    const S torque = scene.body.inertia * drive;
    g[kRotationGuard] = torque / (torque_limit + std::abs(value_of(torque)) + 1e-300);
    const S demand = law(mode_of(kSlide, kLocked), limits, scene, y, stands.r).wrench.tau;
    g[kTorqueSuffices] = margin(S(demand * demand), S(torque_limit * torque_limit));
  }
  const S force = margin(dot(now.carrying_force, now.carrying_force), S(force_limit * force_limit));
  if (translation_of(mode) == kBrake) {
    const State<S, 6> rate = relative_rate(scene, y, stands, now.wrench);
    const S speed = norm(y.slip);
    const Mobility<S> mobility(scene.body, rotation_of(mode), stands.r);
    g[kTranslationGuard] = stop_guard(speed, S(speed * brake_growth(mobility, y.slip, rate)));
    if (slide_end_ == SlideEnd::memoryless) g[kSlideAgain] = force;
  } else {
    // What slides on pads without friction slides on, also where nothing is demanded of them.
    g[kTranslationGuard] = translation_of(mode) == kSlide && !(value_of(force_limit) > 0) ? S(1) : force;
  }
}

template <class S>
Wrench<S> SlidingPivot::wrench_(int mode, const Scene<S>& scene, const Relative<S>& y) const {
  return law(mode, limits_.of<S>(), scene, y, lever(scene, y)).wrench;
}

template <class S>
void SlidingPivot::rate_(int mode, const Scene<S>& scene, const Relative<S>& y, State<S, 6>& dy) const {
  const Stance<S> stands = stance(scene, y);
  const Law<S> now = law(mode, limits_.of<S>(), scene, y, stands.r);
  if (translation_of(mode) == kStuck) {
    dy = {S(0), S(0), y.spin, S(0), S(0), now.spin_acceleration};
  } else {
    dy = relative_rate(scene, y, stands, now.wrench);
    dy[5] = now.spin_acceleration;  // exactly zero while locked
  }
}

/// Which branches a transition has just left, and so must not choose again. `torque_suffices`: a guard has
/// found that the torque of the locked slide just suffices, which the demand at its root says only to
/// rounding.
struct SlidingPivot::Excluded {
  bool locked{}, stuck{}, slide{}, brake{}, between{}, torque_suffices{};
};

/// A time and the state at it.
template <class S>
struct SlidingPivot::Instant {
  S t;
  Relative<S> y;
};

/// The first consistent mode at an instant: locked if the torque it takes is within the limit, else the spin
/// that its own acceleration produces. In slide, where f_p jumps with the rotation, neither may be: then ω_r
/// = 0 attracts from both sides.
int SlidingPivot::consistent_mode(const Scene<double>& scene, const Relative<double>& y, int before,
                                  const Excluded& excluded) const {
  const FrictionLimits<double>& limits = limits_.value;
  const double force_limit = limits.slipping(scene.normal_force, y.slip, y.spin),
               torque_limit = limits.length(scene.normal_force) * force_limit;
  const bool slipping = y.slip.x != 0 || y.slip.z != 0;
  const Vec2<double> r = lever(scene, y);

  auto translation_with = [&](Rotation rotation) {
    if (slipping && !(force_limit > 0)) return kSlide;  // nothing brakes
    if (slipping && before == kBrake && slide_end_ == SlideEnd::latched_brake) return kBrake;
    const double demand = norm(law(mode_of(kStuck, rotation), limits, scene, y, r).carrying_force);
    if (slipping) return excluded.brake || (demand > force_limit && !excluded.slide) ? kSlide : kBrake;
    return excluded.stuck || (demand > force_limit && !excluded.slide) ? kSlide : kStuck;
  };

  if (y.spin != 0) {
    const Rotation rotation = y.spin > 0 ? kPositive : kNegative;
    return mode_of(translation_with(rotation), rotation);
  }
  const int locked = mode_of(translation_with(kLocked), kLocked);
  const double demand = law(locked, limits, scene, y, r).wrench.tau;
  const bool suffices =
      std::abs(demand) <= torque_limit || (excluded.torque_suffices && translation_of(locked) == kSlide);
  if (!excluded.locked && suffices) return locked;
  const Rotation first = lagging(demand), second = first == kNegative ? kPositive : kNegative;
  const int modes[2] = {mode_of(translation_with(first), first), mode_of(translation_with(second), second)};
  double drive[2];  // how the spin of that sign would grow
  for (int k = 0; k < 2; ++k)
    drive[k] = sign_of(k == 0 ? first : second) * law(modes[k], limits, scene, y, r).spin_acceleration;
  if (excluded.between) return modes[drive[0] >= drive[1] ? 0 : 1];
  if (drive[0] > 0) return modes[0];
  if (drive[1] > 0) return modes[1];
  const bool slides[2] = {translation_of(modes[0]) == kSlide, translation_of(modes[1]) == kSlide};
  if (slides[0] && slides[1] && drive[0] < 0 && drive[1] < 0) return kSlideBetween;
  if (slipping &&
      slides[0] != slides[1]) {  // one spin would brake: the braking force does not jump with the rotation
    const int braked = mode_of(kBrake, kLocked);
    const double torque = law(braked, limits, scene, y, r).wrench.tau;
    return std::abs(torque) <= torque_limit ? braked : mode_of(kBrake, lagging(torque));
  }
  return modes[0];
}

template <class S>
Entry<S, 6> SlidingPivot::on_guard_(const Phase& from, int guard, const SceneSource& source, const S& t,
                                    const Relative<S>& at) const {
  const Translation translation = translation_of(from.mode);
  Instant<S> now{t, at};
  Excluded excluded;
  if (from.mode == kSlideBetween && guard != kTranslationGuard) {
    excluded.locked = excluded.between = guard == kRotationGuard;
    excluded.torque_suffices = guard == kTorqueSuffices;
  } else if (guard == kRotationGuard) {
    if (rotation_of(from.mode) == kLocked)
      excluded.locked = true;
    else
      now.y.spin = S(0);
  } else if (guard == kSlideAgain) {
    excluded.brake = true;
  } else if (translation == kStuck) {
    excluded.stuck = true;
  } else if (translation == kSlide) {
    excluded.slide = true;
  } else {
    come_to_rest(from, source, now);
  }
  const auto begin = [&](int mode) -> Entry<S, 6> {
    if (rotation_of(mode) == kLocked || value_of(now.y.spin) != 0) return {mode, now.t, now.y.state(), S(0)};
    return spin_onset(mode, from, source, now.t, now.y);
  };
  const int mode = enter(from.window, source, translation, excluded, now);
  const Entry<S, 6> begun = begin(mode);
  if (translation_holds(from.window, source, begun)) return begun;
  // The patch, too, starts or ceases to slide within the first instants of the spin: both at once.
  excluded = {};
  (translation_of(mode) == kStuck ? excluded.stuck : excluded.slide) = true;
  const Entry<S, 6> both = begin(enter(from.window, source, translation, excluded, now));
  if (both.mode != from.mode) return both;
  excluded.locked = true;  // the guard did not fire for nothing
  return begin(enter(from.window, source, translation, excluded, now));
}

/// Whether what the patch does at the begin of a phase has not ended during its lead: a guard that begins on
/// its unsafe side would wait for ever.
template <class S>
bool SlidingPivot::translation_holds(const Window& window, const SceneSource& source,
                                     const Entry<S, 6>& entry) const {
  const Translation translation = translation_of(entry.mode);
  if (!(value_of(entry.lead) > 0) || translation == kBrake) return true;
  double G[3];
  guards_({entry.mode, window}, source, value_of(entry.t), values(Relative<S>::from(entry.y)), G);
  return (translation == kSlide) == (G[kTranslationGuard] > 0);
}

/// The mode that follows. A brake whose slip is within kStopTime of rest when it begins is at rest.
template <class S>
int SlidingPivot::enter(const Window& window, const SceneSource& source, int before, const Excluded& excluded,
                        Instant<S>& now) const {
  const int mode = consistent_mode(values(source.scene(window, now.t)), values(now.y), before, excluded);
  if (translation_of(mode) != kBrake) return mode;
  double G[3];
  guards_({mode, window}, source, value_of(now.t), values(now.y), G);
  if (G[kTranslationGuard] > 0) return mode;
  come_to_rest({mode, window}, source, now);
  return consistent_mode(values(source.scene(window, now.t)), values(now.y), kBrake, {});
}

/// A brake's slip v to zero, by the impulse of its friction. With the friction F = −f n, n = v/|v|, the slip
/// changes by v' = W F + b, where W is the mobility of the patch's point (1/m while the rotation is locked)
/// and f, W and b hardly change any more. Where W is isotropic,
///
///   d/dt (f |v| + v·W⁻¹b) = −(f² n·W n − b·W⁻¹b)
///
/// is constant, whatever way the slip turns on its way to rest. Else it changes by as much as
/// 2 f Φ (e·W n)/(e·W e) along with it, to first order in the turn Φ/|v|, Φ = e·v', e = J n, that is left: it
/// dies within |v|/(f e·W e). The impulse P = −W⁻¹(v + b T) of the time T that is left brings the slip to
/// zero, and turns the object. An error of T then moves the state along the flow that follows, which takes it
/// back.
template <class S>
void SlidingPivot::come_to_rest(const Phase& brake, const SceneSource& source, Instant<S>& now) const {
  auto& [t, y] = now;
  const Scene<S> scene = source.scene(brake.window, t);
  State<S, 6> dy;
  rate_(brake.mode, scene, y, dy);
  const Mobility<S> mobility(scene.body, rotation_of(brake.mode), lever(scene, y));
  const S f = limits_.of<S>().slipping(scene.normal_force, y.slip, y.spin), speed = norm(y.slip);
  const Vec2<S> n = (1.0 / speed) * y.slip, mobile = mobility.times(n);
  const Vec2<S> b = Vec2<S>{dy[3], dy[4]} + f * mobile;
  const Vec2<S> e{-n.z, n.x};
  const S turn = 2.0 * f * (dy[4] * e.z + dy[3] * e.x) * dot(e, mobile) / dot(e, mobility.times(e));
  const S decay = f * f * dot(n, mobile) - dot(b, mobility.solve(b)) + turn;
  S left = -1.0 / brake_growth(mobility, y.slip, dy);  // along a straight line
  if (value_of(decay) > 0) {
    const S by_impulse = (f * speed + dot(y.slip, mobility.solve(b))) / decay;
    if (value_of(by_impulse) > 0) left = by_impulse;
  }
  const Vec2<S> impulse = S(-1.0) * mobility.solve(y.slip + left * b);
  y.arm = y.arm + (0.5 * left) * Vec2<S>{dy[0], dy[1]};
  y.angle += left * y.spin;
  if (rotation_of(brake.mode) != kLocked)
    y.spin += left * dy[5] + mobility.turning * dot(mobility.q, impulse + (left * f) * n);
  y.slip = {S(0), S(0)};
  t += left;
}

/// The first instants of a spin, by the midpoint rule. Where it turns out to have the other sign, as where
/// nothing is demanded yet of pads without friction, the other mode is taken if that keeps it; a demand that
/// only touches its limit leaves no spin.
/// Beside a brake they are no longer than a share of the time in which its force turns: else the spin would
/// have the sign of a force that has long turned, and a torque in excess would leave no spin, again and
/// again.
template <class S>
Entry<S, 6> SlidingPivot::spin_onset(int mode, const Phase& from, const SceneSource& source, const S& t,
                                     const Relative<S>& rest) const {
  const double longest = std::min(kSpinOnset, 0.25 * (from.window.end - value_of(t)));
  const State<S, 6> y0 = rest.state();
  if (!(longest > 0)) return {mode, t, y0, S(0)};
  const Translation translation = translation_of(mode);
  const Rotation first = rotation_of(mode);
  for (const Rotation rotation : {first, first == kPositive ? kNegative : kPositive}) {
    const int spinning = mode_of(translation, rotation);
    double delta = longest;
    State<S, 6> dy, y = y0;
    rate_(spinning, source.scene(from.window, t), rest, dy);
    if (translation == kBrake) {  // its force turns with the slip, the faster the smaller that is
      const double slip = value_of(norm(rest.slip)), rate = std::hypot(value_of(dy[3]), value_of(dy[4]));
      delta = std::min(delta, kTurned * slip / rate);
    }
    for (int i = 0; i < 6; ++i) y[i] = y0[i] + 0.5 * delta * dy[i];
    rate_(spinning, source.scene(from.window, S(t + 0.5 * delta)), Relative<S>::from(y), dy);
    for (int i = 0; i < 6; ++i) y[i] = y0[i] + delta * dy[i];
    if (sign_of(rotation) * value_of(y[5]) > 0) return {spinning, S(t + delta), y, S(delta), y0};
  }
  return {mode_of(translation, kLocked), t, y0, S(0)};
}

template <class S>
Entry<S, 6> SlidingPivot::membership_(int mode, const Window& window, const SceneSource& source, const S& t,
                                      const Relative<S>& y) const {
  Instant<S> now{t, y};
  const int next = enter(window, source, mode < 0 ? kStuck : translation_of(mode), {}, now);
  return {next, now.t, now.y.state(), S(now.t - t), y.state()};  // what a stop at once takes has passed
}

template class ContactModelFrom<SlidingPivot>;

}  // namespace unhand::contact
