// The sliding-pivot model: Karnopp friction with decoupled force and torque limits.
#pragma once

#include "contact/contact_model.hpp"
#include "contact/friction_limits.hpp"

namespace unhand::contact {

/// What ends a slide once |f_p| <= f_max while the patch still slips. [LiuBillard2025] is silent about it.
enum class SlideEnd {
  latched_brake,  ///< a braking mode that is kept until the slip is zero
  memoryless,     ///< slide again as soon as |f_p| > f_max: |f_p| = f_max may attract (chatter) or repel;
                  ///< comparison only
};

/// [LiuBillard2025] section II, D4.6 2.2.2, with the corrections below. Limits f_max = n μ f_N, τ_max = c a n
/// μ f_N.
///
/// A mode is a pair of what the patch does and what the rotation does:
///   patch     stuck     the contact point is carried with the hand
///             slide     |f_p| > f_max: force f_max f_p/|f_p|, along the required force
///             brake     |f_p| <= f_max but still slipping: force −f_max v_r/|v_r|
///   rotation  locked    ω_r = 0, torque whatever keeps α_O = α_H, up to τ_max
///             + or −    the sign of ω_r: torque −τ_max sgn(ω_r)
/// (stuck, locked) is sticking, (stuck, ±) pivoting about the contact:
///   (I + m l²) α_O = m [z_r ax_H − x_r (az_H + g)] + τ,
/// which at onset is α_r = −sgn(τ_p)(|τ_p| − τ_max)/(m l² + I). f_p is the force that carries the contact
/// point with the rotation in force: α_O from this equation while spinning, α_H while locked.
///
/// Where slide+ and slide− both drive the spin back to zero (f_p jumps with the rotation), ω_r = 0 attracts
/// from both sides: a tenth mode slides between the two, with the mixture of their wrenches that keeps ω_r =
/// 0 (Filippov's solution).
///
/// Where a spin stops in slide, locked and spinning back may both be consistent, for the same reason: the law
/// is two-valued there, and locked is taken if its torque suffices. Where it just suffices the release is not
/// continuous in its parameters: an onset of spin appears or vanishes, and the twist at detach jumps by the
/// little that was spun until then.
///
/// Nor is it continuous where the hand's acceleration jumps while the patch slides: f_p may jump from one
/// side of the circle |f_p| = f_max to the other and the patch slides on, while any continuous change,
/// however fast, passes inside, and the brake latches. So a tracking lag that tends to zero need not tend to
/// none.
///
/// Departures from the print: Eq. 21, 22, 25 have sgn(|τ_p|), always +1, and the sign of the reaction, and
/// Eq. 22 lets a pivoting object feel no friction when |τ_p| < τ_max; Eq. 23's left side is the CoM's
/// absolute acceleration; in Eq. 24 the lost lever torque is divided by I, since the pivot's constraint is
/// gone.
///
/// The model is a surrogate and not passive: in slide it feeds energy exactly when f_p · v_r > 0.
class SlidingPivot final : public ContactModelFrom<SlidingPivot> {
 public:
  /// Throws std::invalid_argument as the validations of Patch and FrictionVariation do. The limits of every
  /// mode are those at |(v_r, L ω_r)|.
  explicit SlidingPivot(const Patch<Dual>& patch, SlideEnd slide_end = SlideEnd::latched_brake,
                        const FrictionVariation<Dual>& variation = {});
  explicit SlidingPivot(const Patch<double>& patch, SlideEnd slide_end = SlideEnd::latched_brake)
      : SlidingPivot(constant(patch), slide_end) {}

  std::string_view name() const override { return "sliding_pivot"; }
  int mode_count() const override { return 10; }
  std::string_view mode_name(int mode) const override;
  dynamics::FlowKind kind(int mode) const override;
  int guard_count(int mode) const override;
  dynamics::Guard guard(int mode, int index) const override;
  bool may_feed_energy(int mode) const override;
  bool is_homogeneous(int mode) const override;

  /// ContactModel's functions for either scalar, made virtual by ContactModelFrom.
  /// @{
  template <class S>
  Wrench<S> wrench_(int mode, const Scene<S>&, const Relative<S>&) const;
  template <class S>
  void rate_(int mode, const Scene<S>&, const Relative<S>&, State<S, 6>&) const;
  template <class S>
  void guards_(const Phase&, const SceneSource&, const S& t, const Relative<S>&, S* g) const;
  template <class S>
  Entry<S, 6> on_guard_(const Phase&, int guard, const SceneSource&, const S& t, const Relative<S>&) const;
  template <class S>
  Entry<S, 6> membership_(int mode, const Window&, const SceneSource&, const S& t, const Relative<S>&) const;
  /// @}

 private:
  struct Excluded;
  template <class S>
  struct Instant;
  int consistent_mode(const Scene<double>&, const Relative<double>&, int before, const Excluded&) const;
  template <class S>
  int enter(const Window&, const SceneSource&, int before, const Excluded&, Instant<S>&) const;
  template <class S>
  void come_to_rest(const Phase& brake, const SceneSource&, Instant<S>&) const;
  template <class S>
  bool translation_holds(const Window&, const SceneSource&, const Entry<S, 6>&) const;
  template <class S>
  Entry<S, 6> spin_onset(int mode, const Phase& from, const SceneSource&, const S& t,
                         const Relative<S>& rest) const;

  dynamics::OfBoth<FrictionLimits> limits_;
  SlideEnd slide_end_;
};

extern template class ContactModelFrom<SlidingPivot>;

}  // namespace unhand::contact
