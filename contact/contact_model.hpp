// What every contact model answers: which modes it has, which wrench acts in each, which guards leave a mode,
// and what happens there.
#pragma once

#include <cmath>
#include <string_view>
#include <vector>

#include "contact/normal_force.hpp"
#include "dynamics/hybrid_system.hpp"
#include "dynamics/rigid_body.hpp"

namespace unhand::contact {

using dynamics::Acceleration;
using dynamics::Dual;
using dynamics::Entry;
using dynamics::Phase;
using dynamics::Pose;
using dynamics::RigidBody;
using dynamics::State;
using dynamics::Twist;
using dynamics::Vec2;
using dynamics::Window;
using dynamics::Wrench;

/// How the hand holds the object at the start of a release: where, and with which wrench. It has been held
/// for long by then, so the wrench is the one that carries the object with the hand (sticking_wrench).
template <class S>
struct Hold {
  Vec2<S> arm;       ///< R(θ_O)ᵀ (p_WO − p_WH) [m]
  S angle{};         ///< θ_O − θ_H [rad]
  Wrench<S> wrench;  ///< about the patch, on the object, in the hand's frame [N, N, N m]
};

/// What a contact law sees of the world at an instant.
template <class S>
struct Scene {
  RigidBody<S> body;                  ///< kg, kg m²
  Vec2<S> gravity;                    ///< m/s²
  Pose<S> hand;                       ///< m, m, rad
  Twist<S> hand_twist;                ///< m/s, m/s, rad/s
  Acceleration<S> hand_acceleration;  ///< m/s², m/s², rad/s²
  S normal_force{};                   ///< of one pad [N], >= 0
  const Hold<S>* hold{};              ///< for pads that give; whoever makes the scene keeps it
};

/// The values, without derivatives and hold: what decides between modes.
inline Scene<double> values(const Scene<double>& s) { return s; }
inline Scene<double> values(const Scene<Dual>& s) {
  return {{s.body.mass.a, s.body.inertia.a},
          {s.gravity.x.a, s.gravity.z.a},
          {s.hand.x.a, s.hand.z.a, s.hand.theta.a},
          {s.hand_twist.vx.a, s.hand_twist.vz.a, s.hand_twist.omega.a},
          {s.hand_acceleration.ax.a, s.hand_acceleration.az.a, s.hand_acceleration.alpha.a},
          s.normal_force.a};
}

/// Where scenes come from; laws look a little ahead at the onset of slip.
class SceneSource {
 public:
  virtual ~SceneSource() = default;
  /// The world at t [s], on the branch of the window.
  virtual Scene<double> scene(const Window&, double t) const = 0;
  virtual Scene<Dual> scene(const Window&, const Dual& t) const = 0;
};

/// The object against the hand, which is the state that is integrated.
///
/// The arm (CoM from the patch, in the object's frame) changes only while the patch slips, the angle only
/// while it spins; so sticking is y' = 0 exactly and pivoting leaves the arm alone exactly: neither can
/// creep. d/dt arm = R(θ_O)ᵀ v_r;  d/dt v_r = (a_C − a_H) − ω_O J v_r, the last term because the material
/// point under the patch changes. tests/crosscheck integrates (q_O, v_O) instead and must agree.
template <class S>
struct Relative {
  Vec2<S> arm;   ///< R(θ_O)ᵀ (p_WO − p_WH) [m]
  S angle{};     ///< θ_O − θ_H [rad]
  Vec2<S> slip;  ///< v_r: material point of the object at the patch against the hand, in the world [m/s]
  S spin{};      ///< ω_r = ω_O − ω_H [rad/s]

  /// From the integrator's state (arm, angle, slip, spin).
  static Relative from(const State<S, 6>& y) { return {{y[0], y[1]}, y[2], {y[3], y[4]}, y[5]}; }
  /// As the integrator's state, in the same order.
  State<S, 6> state() const { return {arm.x, arm.z, angle, slip.x, slip.z, spin}; }
};

/// The relative state without derivatives.
inline Relative<double> values(const Relative<double>& y) { return y; }
inline Relative<double> values(const Relative<Dual>& y) {
  return {{y.arm.x.a, y.arm.z.a}, y.angle.a, {y.slip.x.a, y.slip.z.a}, y.spin.a};
}

/// How the object stands in the world: the cosine and sine of θ_O, and r = p_WO − p_WH [m].
template <class S>
struct Stance {
  S c, s;     ///< cos θ_O, sin θ_O
  Vec2<S> r;  ///< from the hand to the CoM, in the world [m]
};
/// The stance of the object at a relative state.
template <class S>
Stance<S> stance(const Scene<S>& scene, const Relative<S>& y) {
  using std::cos;
  using std::sin;
  const S angle = scene.hand.theta + y.angle, c = cos(angle), s = sin(angle);
  return {c, s, {c * y.arm.x - s * y.arm.z, s * y.arm.x + c * y.arm.z}};
}
/// r = p_WO − p_WH, in the world [m].
template <class S>
Vec2<S> lever(const Scene<S>& scene, const Relative<S>& y) {
  return stance(scene, y).r;
}

/// Pose and twist of the object's CoM, in the world.
template <class S>
Pose<S> object_pose(const Scene<S>& scene, const Relative<S>& y) {
  const Vec2<S> r = lever(scene, y);
  return {scene.hand.x + r.x, scene.hand.z + r.z, scene.hand.theta + y.angle};
}
/// Twist of the CoM, in the world.
template <class S>
Twist<S> object_twist(const Scene<S>& scene, const Relative<S>& y) {
  const Twist<S> patch{scene.hand_twist.vx + y.slip.x, scene.hand_twist.vz + y.slip.z,
                       scene.hand_twist.omega + y.spin};
  return dynamics::twist_at_com(patch, lever(scene, y));
}

/// d/dt of the relative state under the wrench `patch` (about the patch, on the object, in the world).
template <class S>
State<S, 6> relative_rate(const Scene<S>& scene, const Relative<S>& y, const Stance<S>& stands,
                          const Wrench<S>& patch) {
  const auto& [c, s, r] = stands;
  const S omega = scene.hand_twist.omega + y.spin;
  const Acceleration<S> com = dynamics::acceleration_under(scene.body, patch, r, scene.gravity);
  const Acceleration<S> point = dynamics::acceleration_at_patch(com, omega, r);
  return {c * y.slip.x + s * y.slip.z,
          c * y.slip.z - s * y.slip.x,
          y.spin,
          point.ax - scene.hand_acceleration.ax + omega * y.slip.z,
          point.az - scene.hand_acceleration.az - omega * y.slip.x,
          com.alpha - scene.hand_acceleration.alpha};
}
/// The same, the stance being worked out.
template <class S>
State<S, 6> relative_rate(const Scene<S>& scene, const Relative<S>& y, const Wrench<S>& patch) {
  return relative_rate(scene, y, stance(scene, y), patch);
}

/// f_p: the wrench about the patch that makes the material point there and the object's rotation follow the
/// hand (no slip acceleration). [LiuBillard2025] Eq. 19, 20 with the signs of dynamics/frames.hpp. The third
/// row of Eq. 20, with Eq. 19 put in, is τ_p = (I + m l²) α_H − m [z_r ax_H − x_r (az_H + g)]: the
/// centripetal terms cancel.
template <class S>
Wrench<S> sticking_wrench(const Scene<S>& scene, const Relative<S>& y) {
  const Vec2<S> r = lever(scene, y);
  const S omega = scene.hand_twist.omega + y.spin;
  const Acceleration<S> com = dynamics::acceleration_at_com(scene.hand_acceleration, omega, r);
  return dynamics::required_wrench(scene.body, com, r, scene.gravity);
}

/// An abstract contact model; docs/adding-a-contact-model.md is the recipe.
/// Mode 0 is where a held object starts when its grip holds. Its functions are const and may be called by
/// several threads at once: a law keeps nothing between two calls, or keeps it behind a lock of its own.
class ContactModel {
 public:
  virtual ~ContactModel() = default;

  /// The name by which cards and the command line choose it; valid as long as the law is, which owns it.
  virtual std::string_view name() const = 0;

  // Which modes?
  /// Modes, numbered from 0; at least one. The object is free when separation() says so, which is no mode of
  /// the law: a release throws std::logic_error, naming law and mode, where on_guard() or membership() lead
  /// to a mode that is not in [0, mode_count()).
  virtual int mode_count() const = 0;
  /// What event logs call a mode; valid as long as the law is.
  virtual std::string_view mode_name(int mode) const = 0;
  /// What the mode's flow asks of a stepper: `frozen` where the relative state does not change, `stiff` where
  /// the wrench turns with the direction of a tiny slip, `smooth` where it changes as slowly as the slip
  /// itself; `mixed`, where that is open, finds out. Never `finished`.
  virtual dynamics::FlowKind kind(int mode) const = 0;

  // Which wrench on the object, about the patch, in the world [N, N, N m]?
  /// The wrench on the object about the patch, in the world [N, N, N m].
  virtual Wrench<double> wrench(int mode, const Scene<double>&, const Relative<double>&) const = 0;
  virtual Wrench<Dual> wrench(int mode, const Scene<Dual>&, const Relative<Dual>&) const = 0;
  /// d/dt of the relative state in the mode.
  virtual void rate(int mode, const Scene<double>&, const Relative<double>&, State<double, 6>&) const = 0;
  virtual void rate(int mode, const Scene<Dual>&, const Relative<Dual>&, State<Dual, 6>&) const = 0;

  // Which guards leave a mode?
  /// Guards that leave a mode, at most dynamics::kMaxGuards = 8: more are a std::logic_error that names law,
  /// mode and number.
  virtual int guard_count(int mode) const = 0;
  /// A guard's name and direction; 0 <= index < guard_count(mode).
  virtual dynamics::Guard guard(int mode, int index) const = 0;
  /// The values of the mode's guards at t [s], of order one.
  virtual void guards(const Phase&, const SceneSource&, double t, const Relative<double>&,
                      double* g) const = 0;
  virtual void guards(const Phase&, const SceneSource&, const Dual& t, const Relative<Dual>&,
                      Dual* g) const = 0;

  // What happens at a guard, and which mode holds at an instant (after a time event, or at the start: mode <
  // 0)?
  /// Where the mode that follows begins when `guard` of the phase fires at t [s].
  virtual Entry<double, 6> on_guard(const Phase&, int guard, const SceneSource&, double t,
                                    const Relative<double>&) const = 0;
  virtual Entry<Dual, 6> on_guard(const Phase&, int guard, const SceneSource&, const Dual& t,
                                  const Relative<Dual>&) const = 0;
  /// The mode that holds at t [s], after a time event in `mode`, or at the start (mode < 0).
  virtual Entry<double, 6> membership(int mode, const Window&, const SceneSource&, double t,
                                      const Relative<double>&) const = 0;
  virtual Entry<Dual, 6> membership(int mode, const Window&, const SceneSource&, const Dual& t,
                                    const Relative<Dual>&) const = 0;

  /// When the object is free [s]; +infinity for never. Models that follow the pads answer with the force's
  /// release.
  virtual void separation(const NormalForce&, double& t) const = 0;
  virtual void separation(const NormalForce&, Dual& t) const = 0;

  /// True for modes whose law depends on the direction of u = (v_r, L ω_r) alone: their flow is regular when
  /// paced by |u| (dynamics/paced_stepper.hpp), and errors of the slip are judged relative to |u|.
  virtual bool is_homogeneous(int mode) const = 0;

  /// L above [m]; 0 where the spin does not turn the friction force.
  virtual double spin_length() const { return 0; }

  /// True for pads that give: their scenes must say how the object is held.
  virtual bool needs_hold() const { return false; }

  /// True if the law can feed energy through its linear slip in this mode (a surrogate, not a material law).
  virtual bool may_feed_energy(int /*mode*/) const { return false; }
};

/// The release of the force that the pads follow [s]: the last kink within kSameInstant of its
/// release_time(), whose derivatives it has; else that time alone.
template <class S>
void force_release(const NormalForce& force, S& t) {
  std::vector<S> kinks;
  force.kinks(kinks);
  const double release = force.release_time();
  t = S(release);
  for (const S& kink : kinks)
    if (std::abs(dynamics::value_of(kink) - release) <= kSameInstant) t = kink;
}

/// Writes both overloads from the templates wrench_, rate_, guards_, on_guard_, membership_ of Derived. The
/// definitions are in contact_model_from.hpp, which only the model's own source includes: it ends with
/// `template class ContactModelFrom<Model>;`.
template <class Derived>
class ContactModelFrom : public ContactModel {
 public:
  /// As ContactModel says, from the templates of Derived.
  Wrench<double> wrench(int, const Scene<double>&, const Relative<double>&) const final;
  Wrench<Dual> wrench(int, const Scene<Dual>&, const Relative<Dual>&) const final;
  /// From rate_.
  void rate(int, const Scene<double>&, const Relative<double>&, State<double, 6>&) const final;
  void rate(int, const Scene<Dual>&, const Relative<Dual>&, State<Dual, 6>&) const final;
  /// From guards_.
  void guards(const Phase&, const SceneSource&, double, const Relative<double>&, double*) const final;
  void guards(const Phase&, const SceneSource&, const Dual&, const Relative<Dual>&, Dual*) const final;
  /// From on_guard_.
  Entry<double, 6> on_guard(const Phase&, int, const SceneSource&, double,
                            const Relative<double>&) const final;
  Entry<Dual, 6> on_guard(const Phase&, int, const SceneSource&, const Dual&,
                          const Relative<Dual>&) const final;
  /// From membership_.
  Entry<double, 6> membership(int, const Window&, const SceneSource&, double,
                              const Relative<double>&) const final;
  Entry<Dual, 6> membership(int, const Window&, const SceneSource&, const Dual&,
                            const Relative<Dual>&) const final;
  /// The release of the normal force, unless overridden.
  void separation(const NormalForce& force, double& t) const override { force_release(force, t); }
  void separation(const NormalForce& force, Dual& t) const override { force_release(force, t); }
};

/// Signed margin of a demand against a limit, both >= 0: (d² − l²)/(d² + l²), in [−1, 1], zero where they are
/// equal. Takes the squares, so that it is smooth where the demand vanishes. Where pads can give nothing and
/// nothing is demanded of them, as at the end of a release without torque, it suffices: −1.
template <class S>
S margin(const S& demand_squared, const S& limit_squared) {
  const S limit = limit_squared + 1e-300;
  return (demand_squared - limit) / (demand_squared + limit);
}

}  // namespace unhand::contact
