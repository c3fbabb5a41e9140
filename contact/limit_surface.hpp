// Limit-surface friction as a hybrid system: a true stick mode, and slip whose wrench lies on the surface.
#pragma once

#include <concepts>
#include <string>
#include <utility>

#include "contact/contact_model.hpp"
#include "contact/convex_quartic.hpp"
#include "contact/giving_points.hpp"
#include "contact/isotropic_quartic.hpp"
#include "contact/limit_surface_shapes.hpp"
#include "contact/local_friction.hpp"
#include "contact/pad_compliance.hpp"
#include "contact/pressed_disc.hpp"

namespace unhand::contact {

/// A shape that says where in a disc the pressure is: s of p ∝ (1 − (r/a)²)^s, and c of L = c a [-]. Its
/// points may give (GivingPoints) and slip at their own speeds (LocalFriction).
template <class T>
concept PressedShape = requires(const T& shape) {
  { shape.exponent() } -> std::convertible_to<Dual>;
  { shape.torque_factor() } -> std::convertible_to<Dual>;
};

/// The set-valued law: slipping, the friction wrench is the one in the limit set that dissipates most,
///   f = argmin over the set of f · s,   s = (v_r, ω_r)
/// (for the ellipsoid f = −D s / sqrt(sᵀ D s) with D = diag(f_max², f_max², τ_max²));
/// sticking, any f in the set. The slip acceleration is W f + b, W = G M⁻¹ Gᵀ. [LiuBillard2025] section II-B,
/// [GoyalRuinaPapadopoulos1991] for the surface.
///
/// For a convex law and f_N(t) > 0 the forward solution is unique, so chatter is an artefact of integration.
/// Here are two modes:
///   stick  y' = 0, left when the sticking wrench f_p reaches the surface;
///   slip   stiff (the wrench turns with the direction of a tiny slip), left when the slip comes to rest.
/// At onset the slip leaves along a = W (f* − f_p), f* the projection of f_p onto the limit set in the metric
/// of W: the minimum of the strictly convex ½ (a − b)ᵀ W⁻¹ (a − b) + σ(a), σ the surface's support function.
///
/// Pads that give (contact.pad_compliance): on the discs every point gives and slips by itself
/// (giving_points.hpp), which the release integrates without modes. Shapes that say nothing of where the
/// pressure is have one spring for the whole patch (PadCompliance), which holds the object until it first
/// slips:
///   elastic  the spring's wrench, left when it reaches the surface, with the velocities of the moment
/// and rigidly after, at any later rest: what it would store then is not followed, a small energy since the
/// pads are opening. The elastic work is booked with the friction's. Without compliance there is no such
/// mode.
///
/// Friction that depends on the speed of the slip: on the discs at every point by itself (LocalFriction);
/// other shapes grow and shrink with the norm of (v_r, L ω_r).
///
/// All of this is done in the normalised coordinates of limit_surface_shapes.hpp, so a Shape is all that
/// differs; "disc" above is any PressedShape.
template <class Shape>
class LimitSurface final : public ContactModelFrom<LimitSurface<Shape>>, public GivesAtPoints {
 public:
  /// Keeps a copy of the name. Throws std::invalid_argument as the validations of Patch and FrictionVariation
  /// do.
  LimitSurface(std::string_view name, const Patch<Dual>& patch, Shape shape,
               const FrictionVariation<Dual>& variation = {});
  LimitSurface(std::string_view name, const Patch<double>& patch, Shape shape)
      : LimitSurface(name, constant(patch), std::move(shape)) {}
  /// For shapes without parameters.
  template <class S>
  requires std::default_initializable<Shape> LimitSurface(std::string_view name, const Patch<S>& patch)
      : LimitSurface(name, patch, Shape{}) {}

  std::string_view name() const override { return name_; }
  int mode_count() const override { return pads_.dual ? 3 : 2; }
  std::string_view mode_name(int mode) const override {
    return mode == kSlip ? "slip" : is_elastic(mode) ? "elastic" : "stick";
  }
  dynamics::FlowKind kind(int mode) const override {
    using dynamics::FlowKind;
    return mode == kSlip ? FlowKind::stiff : is_elastic(mode) ? FlowKind::mixed : FlowKind::frozen;
  }
  int guard_count(int) const override { return 1; }
  dynamics::Guard guard(int mode, int) const override;
  bool is_homogeneous(int mode) const override { return mode == kSlip; }
  bool needs_hold() const override { return pads_.value.has_value(); }
  double spin_length() const override { return limits_.value.patch().length(); }
  bool gives_at_points() const override { return kDisc && pads_.value.has_value(); }
  /// The friction limits that the points share.
  const FrictionLimits<double>& point_limits(double) const override { return limits_.value; }
  const FrictionLimits<Dual>& point_limits(const Dual&) const override { return limits_.dual; }

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
  static constexpr int kHeld = 0, kSlip = 1, kStickAgain = 2;
  /// Whether the shape says where the pressure is.
  static constexpr bool kDisc = PressedShape<Shape>;
  bool is_elastic(int mode) const { return mode == kHeld && pads_.dual; }
  /// The mode of an object that came to rest on the pads.
  int stick() const { return pads_.dual ? kStickAgain : kHeld; }

  template <class S>
  S growth(const Scene<S>&, const Relative<S>&, const State<S, 6>& rate) const;
  template <class S>
  S margin_of(const Wrench<S>& demand, const Scene<S>&) const;
  template <class S>
  Entry<S, 6> come_to_rest(const Window&, const SceneSource&, const S& t, const Relative<S>&) const;
  template <class S>
  Entry<S, 6> slip_or_rest(const Window&, const SceneSource&, const S& t, const Relative<S>&) const;
  template <class S>
  Entry<S, 6> onset(const Window&, const SceneSource&, const S& t, const Relative<S>&,
                    bool at_the_surface) const;

  std::string name_;
  Shape shape_;
  dynamics::OfBoth<FrictionLimits> limits_;
  std::optional<LocalFriction> local_;         ///< of a disc, where friction depends on the speed
  dynamics::OfBoth<OptionalCompliance> pads_;  ///< none that are rigid
};

extern template class ContactModelFrom<LimitSurface<Ellipsoid>>;
extern template class ContactModelFrom<LimitSurface<UniformDisc>>;
extern template class ContactModelFrom<LimitSurface<PressedDisc>>;
extern template class ContactModelFrom<LimitSurface<ConvexQuartic>>;
extern template class ContactModelFrom<LimitSurface<IsotropicQuartic>>;
extern template class LimitSurface<Ellipsoid>;
extern template class LimitSurface<UniformDisc>;
extern template class LimitSurface<PressedDisc>;
extern template class LimitSurface<ConvexQuartic>;
extern template class LimitSurface<IsotropicQuartic>;

}  // namespace unhand::contact
