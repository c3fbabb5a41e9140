// A limit surface integrated naively, to show what that costs.
#pragma once

#include "contact/patch.hpp"
#include "release/simulate_release.hpp"

namespace unhand::release {

/// What commands, cards and comparisons call it; no contact model of the registry.
inline constexpr const char* kNaiveModel = "limit_surface_naive";

/// The sign law at a fixed step: f = −D v_r/sqrt(v_rᵀ D v_r + f_max² v_s²) at every v_r, by the explicit
/// Euler method.
struct NaiveOptions {
  double step{1e-3};      ///< s
  double smoothing{0.0};  ///< v_s >= 0, viscous smoothing of the sign law [m/s]; 0 is the sign law itself
};

/// How a naive release ended.
struct NaiveResult {
  ReleaseOutcome outcome{};    ///< `detached`, `never_separated`; `not_solved`: the detach is not finite
  DetachState<double> detach;  ///< the answer, if detached
  int steps{};                 ///< Euler steps taken
  int reversals{};             ///< steps after which the slip points against the one before: the chatter
};

/// The ellipsoidal limit surface as [LiuBillard2025] describes it in use, for comparison only: without a
/// stick mode the wrench of a held object flips from side to side at every step, and the energy that this
/// costs is the error. The contact model of `problem` is not used; `patch` gives the limits. Throws
/// std::invalid_argument for what simulate_release refuses, a step outside [1e-7, 0.1] s, one of which the
/// release takes more than 1e8, and a smoothing that is negative or not finite.
NaiveResult simulate_release_naive(const ReleaseProblem<double>& problem, const contact::Patch<double>& patch,
                                   const NaiveOptions& options = {});

}  // namespace unhand::release
