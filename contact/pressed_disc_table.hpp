// Friction of a disc pressed as (1 − (r/a)²)^s, as Chebyshev series: the making of PressedDisc.
#pragma once

#include <array>

namespace unhand::contact {

/// At m = ε² (inner, ε ≤ 1) or 1/ε² (outer): {Φ, Φ′, Τ} or {Φ, Φ′, Ψ}, where
///   F = ε Φ(ε²),  T = Τ(ε²)  for ε ≤ 1;   F = Φ(1/ε²),  T = Ψ(1/ε²)/ε  for ε ≥ 1.
using PressedProfile = std::array<double, 3>;

/// By quadrature, to 1e-12: slow. −1 < s.
PressedProfile pressed_profile_exact(bool inner, double m, double s);

/// Coefficients in (1 − m)^(1/4) at one exponent.
struct PressedSeries {
  static constexpr int kOrder = 32;                 ///< coefficients of a series
  std::array<PressedProfile, kOrder> inner, outer;  ///< of the functions at m = ε² and at m = 1/ε²
};
/// The series at one exponent s and their derivatives by s.
struct PressedSeriesAt {
  PressedSeries value, by_exponent;  ///< the series; d/ds of them
};

/// From the table over s, −0.4 <= s <= 3.
PressedSeriesAt pressed_series(double s);

/// The sum of a series at 0 <= m <= 1.
PressedProfile evaluate(const std::array<PressedProfile, PressedSeries::kOrder>& series, double m);

}  // namespace unhand::contact
