#include "dynamics/guard_roots.hpp"

#include <utility>

namespace unhand::dynamics {
namespace {

constexpr double kNode[4] = {0, 1.0 / 3, 2.0 / 3, 1};  // where guards are sampled in a stretch
constexpr double kGrazing =
    1e-6;  // of a guard's range over a stretch: a peak this close to zero only touches
constexpr double kTogether = 4e-9;  // of a stretch: roots this close on the dense output are one instant
constexpr double kLocated = 1e-9;   // of a stretch: how far a guard's value may say that its root still is
constexpr double kStraight = 1e-6;  // of a step: so near a root the rest is a straight line, bent by 1e-12

double range_of(const double (&G)[4][kMaxGuards], int i) {
  return std::max({G[0][i], G[1][i], G[2][i], G[3][i]}) - std::min({G[0][i], G[1][i], G[2][i], G[3][i]});
}

template <class S, int N>
void retake(Stepper<S, N>& stepper, double h, std::type_identity_t<State<double, N>>& y) {
  if (h > 0)
    stepper.retake_values(h, y);
  else
    y = values<S, N>(stepper.y0());
}

}  // namespace

template <class S, int N>
bool GuardRoots<S, N>::find_first(Stepper<S, N>& stepper, bool first_step, Bracket& first) {
  const double t0 = value_of(stepper.t0()), length = value_of(stepper.t1()) - t0;
  const double stretches = watch_.monotone ? 1 : std::max(1.0, std::ceil(length / interval_ * (1 - 1e-9)));
  whole_ = stepper.fraction(length);
  span_ = whole_ / stretches;
  begin_ = t0;
  if (first_step) past_.count = 0;
  for (int k = 0; k < stretches && first.guard < 0; ++k) {
    from_ = k * span_;
    first_stretch_ = first_step && k == 0;
    if (!search(stepper, first)) return false;
  }
  if (first.guard < 0) return true;
  const StepPoint<N> at = point(stepper, first.root);
  first.root = at.t - t0;
  first.slope = at.speed > 0 ? first.slope / (span_ * at.speed) : 0;
  return true;
}

/// Whether no guard can have fired by what the ends of the stretch say.
template <class S, int N>
bool GuardRoots<S, N>::is_quiet(const Samples& G, double t0, double t1) const {
  for (int i = 0; i < watch_.count; ++i)
    if (!watch_.armed[i] || watch_.hidden[i] || !(G[3][i] < 0)) return false;
  if (watch_.monotone) return true;
  if (past_.count < 2 || 3 * (t1 - t0) > interval_) return false;
  const auto& [ta, tb] = past_.t;
  for (int i = 0; i < watch_.count; ++i) {
    // Newton's form of the cubic: what it can rise above the chord, with room for as much again.
    const double chord = (G[3][i] - G[0][i]) / (t1 - t0), before = (G[0][i] - past_.G[0][i]) / (t0 - ta),
                 earlier = (past_.G[0][i] - past_.G[1][i]) / (ta - tb);
    const double bend = (chord - before) / (t1 - ta), bend_before = (before - earlier) / (t0 - tb);
    const double rise = 0.25 * (t1 - t0) * (t1 - t0) *
                        (std::abs(bend) + std::abs((bend - bend_before) / (t1 - tb)) * (t1 - ta));
    if (!(std::max(G[0][i], G[3][i]) + 2 * rise < 0)) return false;
  }
  return true;
}

template <class S, int N>
bool GuardRoots<S, N>::search(Stepper<S, N>& stepper, Bracket& first) {
  double G[4][kMaxGuards];
  std::copy_n(watch_.start.begin(), watch_.count, G[0]);
  if (!sample(stepper, 1, G[3])) return false;
  const double begin = std::exchange(begin_, sampled_at_);
  const bool quiet = is_quiet(G, begin, sampled_at_);
  std::copy_n(G[3], watch_.count, watch_.start.begin());
  past_.t[1] = std::exchange(past_.t[0], begin);
  std::copy_n(past_.G[0], watch_.count, past_.G[1]);
  std::copy_n(G[0], watch_.count, past_.G[0]);
  past_.count = std::min(past_.count + 1, 2);
  if (quiet) return true;
  for (int node = 1; node <= 2; ++node)
    if (!sample(stepper, kNode[node], G[node])) return false;

  double earliest = 2;
  const auto armed_before = watch_.armed;
  for (int i = 0; i < watch_.count; ++i) {
    Bracket bracket{i, 0, 0};
    bool found = false;
    double hidden_before = 0;  // the node by which a hidden excursion had ended
    double safe_from = watch_.armed[i] && !watch_.hidden[i] ? 0.0 : 1.0;
    for (int node = 1; node <= 3 && !found; ++node) {
      if (G[node][i] < 0) {
        safe_from = std::min(safe_from, kNode[node]);
        watch_.armed[i] = true;
        watch_.hidden[i] = false;
      } else if (watch_.armed[i] && !(watch_.hidden[i] && G[node][i] == 0)) {
        if (!watch_.hidden[i] && touches(stepper, G, i, node)) continue;
        bracket = {i, kNode[node - 1], kNode[node], std::min(G[node - 1][i], 0.0), G[node][i]};
        if (watch_.hidden[i]) {
          hidden_before = bracket.unsafe;
          if (!shrink_to_first_excursion(stepper, bracket)) continue;
        }
        found = true;
        watch_.hidden[i] = false;
      }
    }
    if (watch_.armed[i] && !watch_.hidden[i])
      found = find_hidden_peak(stepper, G, safe_from, found, bracket) || found;
    if (!found) continue;
    if (bracket.safe < bracket.unsafe) locate(stepper, bracket);
    if (hidden_before > 0 && !(slope_at(stepper, bracket.root, i) > 0)) {
      bracket.unsafe = hidden_before;
      if (!begin_of_rise(stepper, bracket)) continue;
    }
    if (bracket.root < earliest * (1 - kTogether)) {
      earliest = bracket.root;
      first = bracket;
    }
  }
  if (first.guard >= 0)  // what the guards did after the root did not happen
    for (int i = 0; i < watch_.count; ++i) {
      watch_.armed[i] = armed_before[i];
      for (int node = 1; node <= 3 && kNode[node] <= earliest; ++node)
        watch_.armed[i] = watch_.armed[i] || G[node][i] < 0;
    }
  return true;
}

/// Whether the guard is at zero at this node only because it turns back there; then the search for peaks
/// judges it.
template <class S, int N>
bool GuardRoots<S, N>::touches(const Stepper<S, N>& stepper, const Samples& G, int guard, int node) const {
  const double range = range_of(G, guard);
  if (G[node][guard] > kGrazing * range || !(G[node - 1][guard] < 0)) return false;
  if (node < 3) return G[node + 1][guard] < 0;
  const double bend = G[3][guard] - 2 * G[2][guard] + G[1][guard];
  return bend < 0 && slope_at(stepper, 1, guard) * (point(stepper, 1).t - point(stepper, 0).t) < 2e-3 * range;
}

/// The point at a fraction of the stretch.
template <class S, int N>
StepPoint<N> GuardRoots<S, N>::point(const Stepper<S, N>& stepper, double theta) const {
  return stepper.point(from_ + theta * span_);
}

template <class S, int N>
bool GuardRoots<S, N>::sample(const Stepper<S, N>& stepper, double theta, double* G) {
  if (from_ + theta * span_ >= whole_ * (1 - 1e-15)) {
    sampled_at_ = value_of(stepper.t1());
    return watch_.evaluate(sampled_at_, values<S, N>(stepper.y1()), G);
  }
  const StepPoint<N> at = point(stepper, theta);
  sampled_at_ = at.t;
  return watch_.evaluate(at.t, at.y, G);
}
template <class S, int N>
double GuardRoots<S, N>::sample_one(const Stepper<S, N>& stepper, double theta, int guard) {
  double G[kMaxGuards];
  sample(stepper, theta, G);
  return G[guard];
}

/// The guard began at zero and is unsafe at a node: its excursion to the safe side, if any, ended in
/// between. False if it has not set out yet: what an event leaves of a guard takes an instant to pass.
template <class S, int N>
bool GuardRoots<S, N>::shrink_to_first_excursion(const Stepper<S, N>& stepper, Bracket& bracket) {
  double theta = bracket.unsafe;
  for (int k = 0; k < 200; ++k) {
    const double trial = 0.5 * theta, value = sample_one(stepper, trial, bracket.guard);
    if (value < 0) {
      bracket.safe = trial;
      bracket.at_safe = value;
      bracket.unsafe = theta;
      return true;
    }
    theta = trial;
    bracket.at_unsafe = value;
  }
  return begin_of_rise(stepper, bracket);
}

/// There was no excursion, or one too small for the dense output: the root is where the guard rises from
/// then on.
template <class S, int N>
bool GuardRoots<S, N>::begin_of_rise(const Stepper<S, N>& stepper, Bracket& bracket) const {
  if (!(slope_at(stepper, bracket.unsafe, bracket.guard) > 0)) return false;
  for (int k = 0; k < 200 && slope_at(stepper, 0.5 * bracket.unsafe, bracket.guard) > 0; ++k)
    bracket.unsafe *= 0.5;
  bracket.safe = bracket.root = bracket.unsafe;
  bracket.slope = 0;
  return true;
}

template <class S, int N>
double GuardRoots<S, N>::slope_at(const Stepper<S, N>& stepper, double theta, int guard) const {
  const StepPoint<N> at = point(stepper, theta);
  Entry<S, N> entry{watch_.phase.mode, S(at.t), {}, S(0)};
  for (int i = 0; i < N; ++i) entry.y[i] = S(at.y[i]);
  return watch_.slopes(entry)[guard];
}

/// Between safe nodes the cubic through the four may still pass zero twice. `true`, with the bracket, if
/// the guard really does after `safe_from` and, where a crossing is `known`, before that one.
template <class S, int N>
bool GuardRoots<S, N>::find_hidden_peak(const Stepper<S, N>& stepper, const Samples& G, double safe_from,
                                        bool known, Bracket& bracket) {
  const int i = bracket.guard;
  const double range = range_of(G, i);
  if (!(range > 0)) return false;
  const double a = G[0][i] / range, b = G[1][i] / range, c = G[2][i] / range, d = G[3][i] / range;
  if (std::max({a, b, c, d}) + 0.3 < 0) return false;
  // Newton's form on u = 3θ: a + u Δ1 + u(u−1)/2 Δ2 + u(u−1)(u−2)/6 Δ3; its derivative is a quadratic in u.
  const double d1 = b - a, d2 = c - 2 * b + a, d3 = d - 3 * c + 3 * b - a;
  const double q2 = 0.5 * d3, q1 = d2 - d3, q0 = d1 - 0.5 * d2 + d3 / 3;
  double roots[2];
  int count = 0;
  if (std::abs(q2) > 1e-14 * (std::abs(q1) + std::abs(q0))) {
    const double disc = q1 * q1 - 4 * q2 * q0;
    if (disc < 0) return false;
    const double r = -0.5 * (q1 + std::copysign(std::sqrt(disc), q1));
    roots[count++] = r / q2;
    if (r != 0) roots[count++] = q0 / r;
  } else if (q1 != 0) {
    roots[count++] = -q0 / q1;
  }
  // A peak at the joint of two stretches belongs to the first of them.
  const double from = std::max(safe_from, first_stretch_ ? 0.0 : 1e-3), to = known ? bracket.safe : 1.001;
  for (int k = 0; k < count; ++k) {  // a cubic has one maximum
    if (!(roots[k] > 3 * from && roots[k] < 3 * to) || q1 + 2 * q2 * roots[k] >= 0) continue;
    double peak = std::min(roots[k] / 3, 1.0), width = 1.0 / 12;
    double best = sample_one(stepper, peak, i) / range;
    for (int refine = 0; refine < 12 && best <= kGrazing;
         ++refine, width *= 0.5)  // climb to the true maximum
      for (const double trial : {peak - width, peak + width}) {
        if (trial <= from || trial >= std::min(to, 1.0)) continue;
        const double value = sample_one(stepper, trial, i) / range;
        if (value > best) {
          best = value;
          peak = trial;
          break;
        }
      }
    if (best > kGrazing) {
      bracket = {i, from, peak, 0, best * range};
      for (int node = 1; node < 3; ++node)
        if (kNode[node] < peak && kNode[node] > from && G[node][i] < 0) {
          bracket.safe = kNode[node];
          bracket.at_safe = G[node][i];
        }
      if (bracket.safe == from) bracket.at_safe = std::min(sample_one(stepper, from, i), 0.0);
      return true;
    }
    if (best > -kGrazing) ++grazings_;
  }
  return false;
}

/// The root on the dense output, by inverse quadratic interpolation where three points are in line with it
/// and bisection where they are not ([Chandrupatla1997]).
template <class S, int N>
void GuardRoots<S, N>::locate(const Stepper<S, N>& stepper, Bracket& bracket) {
  // a: the newest point, b: the last one on the other side of the root, c: the one before.
  double a = bracket.unsafe, b = bracket.safe, c = b, Ga = bracket.at_unsafe, Gb = bracket.at_safe, Gc = Gb;
  bracket.slope = (Ga - Gb) / (a - b);
  double share = Gb < 0 ? Ga / (Ga - Gb) : 0.5;  // of the way from a to b
  for (int k = 0; k < 100 && Ga != 0; ++k) {
    const double m = a + share * (b - a), Gm = sample_one(stepper, m, bracket.guard), moved = m - a;
    if ((Gm - Ga) / moved > 0) bracket.slope = (Gm - Ga) / moved;
    if ((Gm < 0) == (Ga < 0)) {
      c = a;
      Gc = Ga;
    } else {
      c = std::exchange(b, a);
      Gc = std::exchange(Gb, Ga);
    }
    a = m;
    Ga = Gm;
    const double unsafe = std::max(a, b), width = std::abs(b - a), least = 0.5 * kLocated * unsafe;
    // A guard may begin as near to zero as a root ends: only a short move tells that this is the root.
    const bool at_root = std::abs(Ga) <= least * bracket.slope && std::abs(moved) < 1e-3 * unsafe;
    if (at_root || width <= 2 * least) break;
    const double xi = (a - b) / (c - b), phi = (Ga - Gb) / (Gc - Gb);
    share = phi * phi < xi && (1 - phi) * (1 - phi) < 1 - xi
                ? Ga / (Gb - Ga) * Gc / (Gb - Gc) + (c - a) / (b - a) * Ga / (Gc - Ga) * Gb / (Gc - Gb)
                : 0.5;
    share = std::clamp(share, least / width, 1 - least / width);
  }
  bracket.root = a;
}

template <class S, int N>
Entry<S, N> GuardRoots<S, N>::polish(Stepper<S, N>& stepper, const Bracket& bracket) {
  const double t0 = value_of(stepper.t0()), length = value_of(stepper.t1()) - t0;
  const bool frozen = system_.kind(watch_.phase.mode) == FlowKind::frozen;
  // A true step to `taken`, and from there `on` along a straight line.
  double taken = bracket.root, on = 0, slope = bracket.slope, h_last = 0, G_last = 0;
  State<double, N> base, rate{};
  const auto step_there = [&] {
    taken += std::exchange(on, 0);
    retake(stepper, taken, base);
    if (!frozen) system_.flow(watch_.phase, t0 + taken, base, rate);
  };
  for (int k = 0; k < 16; ++k) {
    if (k == 0 || std::abs(on) > kStraight * length) step_there();
    State<double, N> y;
    for (int i = 0; i < N; ++i) y[i] = base[i] + on * rate[i];
    double G[kMaxGuards];
    watch_.evaluate(t0 + taken + on, y, G);
    const double now = G[bracket.guard], h = taken + on;
    if (k > 0 && (now - G_last) / (h - h_last) > 0) slope = (now - G_last) / (h - h_last);
    if (!(slope > 0) || !std::isfinite(now)) break;
    const double next = std::clamp(h + std::clamp(-now / slope, -0.1 * length, 0.1 * length), 0.0, length);
    if (std::abs(next - h) <= 1e-14 + 4e-16 * std::abs(t0)) break;
    h_last = h;
    G_last = now;
    on = next - taken;
  }
  if (std::abs(on) > kStraight * length) step_there();  // a guard of rounding's size has no better root
  Entry<S, N> root{watch_.phase.mode, S(stepper.t0() + taken), {}, S(0)};
  if constexpr (std::is_same_v<S, double>) {
    for (int i = 0; i < N; ++i) root.y[i] = base[i] + on * rate[i];
  } else {
    root.y = stepper.y0();
    if (taken > 0) stepper.retake(taken, root.y);
    State<S, N> slopes{};
    if (!frozen) system_.flow(watch_.phase, root.t, root.y, slopes);
    for (int i = 0; i < N; ++i) root.y[i] += on * slopes[i];
  }
  root.t += on;
  if constexpr (!std::is_same_v<S, double>) add_root_derivative(bracket.guard, root);
  return root;
}

template <class S, int N>
void GuardRoots<S, N>::add_root_derivative(int guard, Entry<S, N>& root) const {
  S g[kMaxGuards];
  system_.guards(watch_.phase, root.t, root.y, g);
  const double rate = watch_.sign[guard] * watch_.slopes(root)[guard];
  if (rate == 0) return;  // grazing: the event time has no derivative
  S shift = -g[guard] / rate;
  if constexpr (!std::is_same_v<S, double>) shift.a = 0;  // the value is at the root already
  State<double, N> dy{};
  if (system_.kind(watch_.phase.mode) != FlowKind::frozen)
    system_.flow(watch_.phase, value_of(root.t), values<S, N>(root.y), dy);
  root.t += shift;
  for (int i = 0; i < N; ++i) root.y[i] += dy[i] * shift;
}

template class GuardRoots<double, 2>;
template class GuardRoots<double, 6>;
template class GuardRoots<double, 7>;
template class GuardRoots<double, 10>;
template class GuardRoots<Dual, 2>;
template class GuardRoots<Dual, 6>;
template class GuardRoots<Dual, 7>;

}  // namespace unhand::dynamics
