// The scalars of the library: double, and Dual, which carries a value and its derivatives with respect to up
// to kDualSize parameters. This is the one file that names ceres::Jet (header only; the Ceres solver is not
// linked).
#pragma once

#include <ceres/jet.h>

#include <type_traits>

namespace unhand::dynamics {

/// Derivatives a Dual carries at once. Eight is what fills the SIMD registers of baseline x86-64 without
/// spilling; problems with more parameters run in several sweeps.
inline constexpr int kDualSize = 8;

/// A value with its first derivatives with respect to N parameters: `.a` the value, `.v` the gradient.
template <int N>
using DualOf = ceres::Jet<double, N>;
/// The one that the library's physics is compiled for.
using Dual = DualOf<kDualSize>;

// Eigen's layout, its memory and the insides of its functions depend on the widest vectors of the compiler's
// target. Debian's Ceres is compiled for those of every processor, and what is linked with it must be, too.
static_assert(
    EIGEN_DEFAULT_ALIGN_BYTES == 16,
    "unhand and Ceres are compiled without AVX: compile what uses their headers without -march=native, "
    "-mavx and their like (docs/quickstart.md)");

/// The value without its derivatives: what decides between branches.
inline double value_of(double x) { return x; }
inline double value_of(const Dual& x) { return x.a; }

/// Whether a number and all of its derivatives are zero: a term that has it as a factor may be left out.
inline bool is_zero(double x) { return x == 0; }
inline bool is_zero(const Dual& x) { return x.a == 0 && x.v.isZero(); }

/// x as a T: the value alone when T is double, a constant when x is.
template <class T, class S>
T convert(const S& x) {
  if constexpr (std::is_same_v<T, S>)
    return x;
  else if constexpr (std::is_same_v<T, double>)
    return value_of(x);
  else
    return T(x);
}

/// One thing with and without derivatives: whoever is a template of its scalar takes the one of that scalar.
template <template <class> class T>
struct OfBoth {
  T<double> value;  ///< without derivatives
  T<Dual> dual;     ///< with them
  /// The one of the scalar S.
  template <class S>
  const T<S>& of() const {
    if constexpr (std::is_same_v<S, double>)
      return value;
    else
      return dual;
  }
};

/// Applies a scalar function whose value f and derivative df at value_of(x) are already known (the chain
/// rule).
inline double chain(double /*x*/, double f, double /*df*/) { return f; }
inline Dual chain(const Dual& x, double f, double df) { return Dual(f, df * x.v); }

/// A parameter seeded as the k-th independent variable.
inline Dual independent(double x, int k) { return Dual(x, k); }

}  // namespace unhand::dynamics
