#include "release/effects.hpp"

namespace unhand::release {

using dynamics::convert;

namespace {

Window shifted(const Window& window, double by) { return {window.begin - by, window.end - by}; }

/// The k-th derivative of channel n of a polynomial, h [s] after its begin.
template <class Coefficients>
double derivative(const Coefficients& c, int n, int k, double h) {
  double out = 0;
  for (int m = static_cast<int>(c.size()) - 1; m >= k; --m) {
    double falling = 1;  // m (m − 1) … (m − k + 1)
    for (int q = 0; q < k; ++q) falling *= m - q;
    out = out * h + falling * c[static_cast<std::size_t>(m)][static_cast<std::size_t>(n)];
  }
  return out;
}

}  // namespace

std::span<const dynamics::EffectOn<Lateness>> lateness_effects() {
  static const dynamics::EffectOn<Lateness> table[] = {
      {{.id = "release.opening_delay",
        .mechanism = "the normal force acts later than its log says",
        .parameters = {{"delay", "s", 0, -0.05, 0.05, 5e-4}},
        .needs = {.normal_force = true}},
       [](const auto& p, auto& late) { late.opening_delay = p["delay"]; }},
      {{.id = "release.hand_tracking_lag",
        .mechanism =
            "the logged hand motion is the commanded one, which the true one follows with a first-order lag",
        .parameters = {{"tau", "s", 0, 0, 0.1, 1e-3}},
        .one_sided = true},
       [](const auto& p, auto& late) { late.tracking_lag = p["tau"]; }},
  };
  return table;
}

DelayedForce::DelayedForce(const contact::NormalForce& base, const Dual& delay) : base_(base), delay_(delay) {
  dynamics::require_in_range(lateness_effects(), "release.opening_delay.delay", delay.a);
}
double DelayedForce::at(const Window& window, double t) const {
  return base_.at(shifted(window, delay_.a), t - delay_.a);
}
Dual DelayedForce::at(const Window& window, const Dual& t) const {
  return base_.at(shifted(window, delay_.a), t - delay_);
}
void DelayedForce::kinks(std::vector<double>& out) const {
  const std::size_t first = out.size();
  base_.kinks(out);
  for (std::size_t i = first; i < out.size(); ++i) out[i] += delay_.a;
}
void DelayedForce::kinks(std::vector<Dual>& out) const {
  const std::size_t first = out.size();
  base_.kinks(out);
  for (std::size_t i = first; i < out.size(); ++i) out[i] += delay_;
}

LaggedHand::LaggedHand(const PolynomialHand& logged, const Dual& lag) : logged_(logged), lag_(lag) {
  dynamics::require_in_range(lateness_effects(), "release.hand_tracking_lag.tau", lag.a);
  const auto& path = logged.path();
  const auto& breaks = path.breaks();
  for (std::size_t i = 0; i < path.pieces().size(); ++i) {
    const auto& c = path.pieces()[i];
    Piece piece{};
    for (int j = 5; j >= 0; --j)
      for (int n = 0; n < 3; ++n) {
        // (−τ)^k (j + k)!/j! c_{j+k}, summed by Horner's rule from the highest k.
        Dual sum(0.0);
        for (int k = 5 - j; k >= 0; --k) sum = c[j + k][n] - sum * lag * static_cast<double>(j + k + 1);
        piece.settled[j][n] = sum;
      }
    if (i > 0 && lag.a > 0) {
      const Piece& before = pieces_.back();
      const double h = breaks[i] - breaks[i - 1];
      const Dual decay = exp(-h / lag);
      const auto& ends = path.pieces()[i - 1];
      for (int n = 0; n < 3; ++n) {
        // What settled jumps by here: Σ (−τ)^k of the jump of the k-th derivative, of which pose and twist
        // (k = 0, 1) have none. Their rounding, over τ² in the acceleration, would be felt.
        Dual jump(0.0);
        for (int k = 5; k >= 2; --k) jump = (derivative(ends, n, k, h) - derivative(c, n, k, 0)) - jump * lag;
        piece.transient[n] = jump * lag * lag + before.transient[n] * decay;
      }
    }
    pieces_.push_back(piece);
  }
}

template <class S>
HandState<S> LaggedHand::at_(const Window& window, const S& t) const {
  using std::exp;
  const std::size_t i = logged_.path().piece(window, dynamics::value_of(t));
  const Piece& piece = pieces_[i];
  const S h = t - logged_.path().breaks()[i];
  std::array<S, 3> value, first, second;
  const bool settling = lag_.a > 0 && i > 0;  // before the log it has settled, and exp(-h/τ) overflows
  const S rate = settling ? S(1.0 / convert<S>(lag_)) : S(0), decay = settling ? S(exp(-h * rate)) : S(0);
  for (int n = 0; n < 3; ++n) {
    S p = convert<S>(piece.settled[5][n]), d(0), half(0);
    for (int j = 4; j >= 0; --j) {
      half = half * h + d;
      d = d * h + p;
      p = p * h + convert<S>(piece.settled[j][n]);
    }
    const S transient = convert<S>(piece.transient[n]) * decay;
    value[n] = p + transient;
    first[n] = d - rate * transient;
    second[n] = 2.0 * half + rate * rate * transient;
  }
  return {{value[0], value[1], value[2]}, {first[0], first[1], first[2]}, {second[0], second[1], second[2]}};
}
template HandState<double> LaggedHand::at_(const Window&, const double&) const;
template HandState<Dual> LaggedHand::at_(const Window&, const Dual&) const;

}  // namespace unhand::release
