// Friction of a uniformly loaded disc that slides and spins at once: net force and torque in closed form.
#pragma once

namespace unhand::contact {

/// The disc's friction at one slip ratio ε.
struct DiscFriction {
  double force;   ///< F/(μN) [-], opposes the sliding
  double torque;  ///< T/(μNR) [-], opposes the spin
  double dforce;  ///< dF/dε [-]; the torque's slope follows from ε F′ + T′ = 0
};

/// Uniform pressure on a disc of radius R [m], load N [N], friction μ [-], centre sliding at v [m/s] and
/// spinning at ω [rad/s]; ε = v/(|ω|R) [-]. With E, K the complete elliptic integrals of modulus ε
/// [Farkas2003]:
///
///   ε ≤ 1:  F/(μN)  = 4/(3π) [(1+ε²)E − (1−ε²)K]/ε,   T/(μNR) = 4/(9π) [(4−2ε²)E − (1−ε²)K]
///   ε ≥ 1:  the same patch with modulus 1/ε:  F(ε) = ε F(1/ε), and T from ε F′ + T′ = 0.
///
/// The identity ε F′ + T′ = 0 is maximal dissipation: among all (F, T) of the disc, the one at ε dissipates
/// most power ε F + T. F″ has a logarithmic singularity at ε = 1; F, T and F′ are continuous there (F =
/// 8/(3π), T = 8/(9π), F′ = 4/(3π)). Any ε is accepted (F is odd, T and F′ even); ±∞ is pure sliding. Error
/// below 1e-14.
DiscFriction disc_friction(double epsilon);

/// What is left of F and T once their limits at pure spin and pure slide are divided out: functions of m [-],
/// analytic but for m = 1, where m is ε² inside (ε ≤ 1) or δ² = 1/ε² outside.
///
///   F = ε Φ(ε²),  T = Τ(ε²)  for ε ≤ 1;   F = Φ(δ²),  T = δ Ψ(δ²)  for ε ≥ 1
struct DiscProfile {
  double slide;   ///< Φ; 1 at m = 0
  double dslide;  ///< dΦ/dm; −1/8 at m = 0
  double spin;    ///< Τ; 2/3 at m = 0
  double arm;     ///< Ψ; 1/4 at m = 0
};

/// The profile at 0 ≤ m ≤ 1. No elliptic integral is evaluated: Φ, Τ and Ψ are positive combinations of the
/// associate integrals B = ∫cos²φ/Δ, D = ∫sin²φ/Δ, Δ² = 1 − m sin²φ over [0, π/2], and of C = (D−B)/m,
///
///   Φ = 4/(3π) (2B + (1−m)D),  Φ′ = 2/(3π) (C − D),  Τ = 4/(9π) ((3−m)B + (3−2m)(1−m)D),  Ψ = 4/(9π) (C + 3B
///   − D),
///
/// which are polynomials in m up to m = 1/2 and polynomials plus polynomials × ln(1−m) above.
DiscProfile disc_profile(double m);

}  // namespace unhand::contact
