// The limit surface of a disc whose pressure falls, or rises, towards its rim.
#pragma once

#include <memory>

#include "contact/limit_surface_shapes.hpp"

namespace unhand::contact {

/// Pressure ∝ (1 − (r/a)²)^s on a disc of radius a [m], −0.4 <= s <= 3 [-]: s = 0 uniform, 1/2 Hertz. Each
/// ring of the disc resists as a thin ring does, so with ε = v/(|ω| a) [-], x = (r/a)² and E, K of modulus k,
///
///   F/(μN)  = (s+1) ∫₀¹ (1−x)^s f(ε/√x) dx,   T/(μNa) = (s+1) ∫₀¹ (1−x)^s √x t(ε/√x) dx,
///   f(η) = (2/π) [E − (1−k²)K]/η,  t(η) = (2/π) E        for η ≤ 1, k = η
///   f(η) = (2/π) E,   t(η) = (2/π) η [E − (1−k²)K]       for η ≥ 1, k = 1/η
///
/// and, as for every disc, ε F′ + T′ = 0. In the normalised coordinates of limit_surface_shapes.hpp L = c a
/// with c = T(0) = (s+1) B(3/2, s+1), so the exponent changes the surface's shape alone.
///
/// Φ = F/ε, Φ′, T (ε ≤ 1) and F, F′, T ε (ε ≥ 1) are Chebyshev series in s and in (1 − m)^(1/4), m = ε² or
/// 1/ε²: the fourth root takes up the rim's singularity (1−m)^(2+s). They are made once, from tanh-sinh
/// quadrature, on first use (about 10 ms). Error of resist, gauge and of their derivatives below 1e-7, with
/// respect to s below 1e-6; at s = 0 the values are those of UniformDisc's closed forms.
class PressedDisc {
 public:
  static constexpr bool isotropic = true;              ///< round in the plane of sliding: needs no frame
  static constexpr const char* name = "pressed disc";  ///< as messages call it

  /// Derivatives of the exponent enter those of resist and gauge. Throws std::invalid_argument unless −0.4 <=
  /// s <= 3.
  explicit PressedDisc(const dynamics::Dual& exponent);

  /// s [-]
  const dynamics::Dual& exponent() const { return exponent_; }
  /// c(s) [-], with the exponent's derivatives
  dynamics::Dual torque_factor() const;

  /// As limit_surface_shapes.hpp says. Instantiated for double and Dual, the direction for double alone.
  template <class S>
  Vec3<S> resist(const Vec3<S>& u) const;
  /// 1 on the surface, homogeneous of degree 1.
  template <class S>
  S gauge(const Vec3<S>& w) const;
  /// Unit slip that a wrench w on the surface opposes.
  Vec3<double> slip_direction(const Vec3<double>& w) const;
  /// Of resist with respect to u.
  Mat3 resist_jacobian(const Vec3<double>& u) const;

 private:
  struct Series;
  struct Ray;
  Vec3<double> resist_(const Vec3<double>& u, Mat3* jacobian, Vec3<double>* by_exponent) const;
  Ray ray(double p, double q) const;

  dynamics::Dual exponent_;
  std::shared_ptr<const Series> series_;
};

}  // namespace unhand::contact
