// A piecewise polynomial of time with its first two derivatives: what a smoothed logged series is evaluated
// as inside an integrator. Whole pieces are smooth; two pieces meet as smoothly as whoever made them says.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynamics/scalar.hpp"
#include "dynamics/window.hpp"

namespace unhand::dynamics {

/// Values [u], first [u/s] and second derivatives [u/s²] of all channels at one instant; u is the channel's
/// unit.
template <class S, int Channels>
struct Jet2 {
  std::array<S, Channels> value{}, first{}, second{};  ///< u, u/s, u/s²
};

/// Piece i on [b_i, b_{i+1}] is p_i(t) = Σ_k c_{i,k} (t − b_i)^k, k = 0 … Degree; before the first break and
/// after the last, the outermost pieces go on.
template <int Channels, int Degree>
class PiecewisePolynomial {
  static_assert(Channels >= 1 && Degree >= 0 && Degree <= 5);

 public:
  using Coefficients = std::array<std::array<double, Channels>, Degree + 1>;  ///< [power][channel], u/s^power

  /// A break nearer than this to a limit of the window [s] counts as that limit, so that an integrator may
  /// merge time events that differ by rounding.
  static constexpr double kSnap = 1e-9;

  /// Zero everywhere.
  PiecewisePolynomial() : PiecewisePolynomial({0.0, 1.0}, {Coefficients{}}) {}

  /// `breaks` [s] strictly increasing, one more than `pieces`; otherwise throws std::invalid_argument.
  PiecewisePolynomial(std::vector<double> breaks, std::vector<Coefficients> pieces)
      : breaks_(std::move(breaks)), pieces_(std::move(pieces)) {
    if (pieces_.empty() || breaks_.size() != pieces_.size() + 1)
      throw std::invalid_argument(
          "PiecewisePolynomial: breaks must be one more than pieces, and pieces at least one");
    for (std::size_t i = 0; i < breaks_.size(); ++i)
      if (!std::isfinite(breaks_[i]) || (i > 0 && !(breaks_[i] > breaks_[i - 1])))
        throw std::invalid_argument("PiecewisePolynomial: breaks must be finite and strictly increasing");
    per_second_ = static_cast<double>(pieces_.size()) / (breaks_.back() - breaks_.front());
  }

  /// Where pieces begin and end [s], strictly increasing, one more than pieces.
  const std::vector<double>& breaks() const { return breaks_; }
  /// The coefficients of every piece.
  const std::vector<Coefficients>& pieces() const { return pieces_; }
  /// The first break [s].
  double begin() const { return breaks_.front(); }
  /// The last break [s].
  double end() const { return breaks_.back(); }

  /// Index of the piece that holds at t inside the window: where t is a break, the right one at window.begin
  /// and in the interior, the left one at window.end.
  std::size_t piece(const Window& window, double t) const {
    const double snap = std::min(kSnap, 0.25 * (window.end - window.begin));
    std::size_t i = locate(std::max(t, window.begin + snap));
    while (i > 0 && breaks_[i] >= window.end - snap) --i;
    return i;
  }

  /// The values alone at t [s].
  template <class S>
  std::array<S, Channels> value(const Window& window, const S& t) const {
    const std::size_t i = piece(window, value_of(t));
    const Coefficients& c = pieces_[i];
    const double h = value_of(t) - breaks_[i];
    std::array<S, Channels> out;
    for (int n = 0; n < Channels; ++n) {
      double p = c[Degree][n], d = 0.0;
      for (int k = Degree - 1; k >= 0; --k) {
        if constexpr (!std::is_same_v<S, double>) d = d * h + p;
        p = p * h + c[k][n];
      }
      out[n] = chain(t, p, d);
    }
    return out;
  }

  /// Values and the first two derivatives at t [s]. With S = Dual, t carries the derivatives: d/dx p(t(x)) =
  /// p'(t) dt/dx.
  template <class S>
  Jet2<S, Channels> at(const Window& window, const S& t) const {
    const std::size_t i = piece(window, value_of(t));
    const Coefficients& c = pieces_[i];
    const double h = value_of(t) - breaks_[i];
    Jet2<S, Channels> out;
    for (int n = 0; n < Channels; ++n) {
      double p = c[Degree][n], d = 0.0, half = 0.0, sixth = 0.0;  // p, p', p''/2, p'''/6 by Horner
      for (int k = Degree - 1; k >= 0; --k) {
        if constexpr (!std::is_same_v<S, double>) sixth = sixth * h + half;
        half = half * h + d;
        d = d * h + p;
        p = p * h + c[k][n];
      }
      out.value[n] = chain(t, p, d);
      out.first[n] = chain(t, d, 2.0 * half);
      out.second[n] = chain(t, 2.0 * half, 6.0 * sixth);
    }
    return out;
  }

 private:
  std::size_t locate(double t) const {
    const double guess = (t - breaks_.front()) * per_second_;
    const double last = static_cast<double>(pieces_.size() - 1);
    // std::min and std::max in this order send a NaN to 0
    std::size_t i = static_cast<std::size_t>(std::max(0.0, std::min(last, guess)));
    while (i + 1 < pieces_.size() && breaks_[i + 1] <= t) ++i;
    while (i > 0 && breaks_[i] > t) --i;
    return i;
  }

  std::vector<double> breaks_;
  std::vector<Coefficients> pieces_;
  double per_second_{};  // pieces per second, for the first guess
};

}  // namespace unhand::dynamics
