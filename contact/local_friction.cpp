#include "contact/local_friction.hpp"

#include <Eigen/Dense>
#include <boost/math/quadrature/gauss.hpp>
#include <cmath>
#include <numbers>

namespace unhand::contact {

using dynamics::Dual;
using dynamics::value_of;

namespace {

constexpr int kNodes = 32, kInnerNodes = 20;
constexpr double kReach = 6.4;  // Stribeck speeds beyond which exp(−v²/v_s²) is rounding
constexpr double kFar = 1e4;    // d beyond which the disc slides as a whole, to 1e-8

/// Gauss and Legendre's rule on [0, 1], N even.
template <int N>
struct GaussRule {
  std::array<double, N> x{}, weight{};
  GaussRule() {
    using Half = boost::math::quadrature::gauss<double, N>;  // of [−1, 1], the positive points
    for (std::size_t i = 0; i < N / 2; ++i) {
      x[2 * i] = 0.5 * (1 - Half::abscissa()[i]), x[2 * i + 1] = 0.5 * (1 + Half::abscissa()[i]);
      weight[2 * i] = weight[2 * i + 1] = 0.5 * Half::weights()[i];
    }
  }
};

/// The rule in t behind x = t⁴ (35 − 84 t + 70 t² − 20 t³), so that square roots at the ends are smooth.
const GaussRule<kNodes>& gathered() {
  static const GaussRule<kNodes> rule = [] {
    GaussRule<kNodes> out;
    for (std::size_t i = 0; i < kNodes; ++i) {
      const double t = out.x[i], back = 1 - t;
      out.x[i] = t * t * t * t * (35 - t * (84 - t * (70 - 20 * t)));
      out.weight[i] *= 140 * t * t * t * back * back * back;
    }
    return out;
  }();
  return rule;
}

/// What h depends on: σ = μ_s/μ_k − 1, v_s, 1/v₀.
constexpr int kParameters = 3;

/// h at one speed, its slope and its derivatives by the parameters.
struct Excess {
  double h, slope;
  std::array<double, kParameters> by;
};

/// h without the linear part, which is known in closed form; or all of it where that would make the friction
/// negative somewhere (`whole`).
class ExcessLaw {
 public:
  template <class S>
  ExcessLaw(const SpeedDependence<S>& s, bool whole)
      : sigma_(value_of(s.static_excess)),
        speed_(value_of(s.stribeck_speed)),
        viscous_(value_of(s.viscous)),
        whole_(whole) {}

  Excess operator()(double v) const {
    const double w = v / speed_, e = std::exp(-w * w), growth = 1 + viscous_ * v;
    if (!(growth > 0)) return {-1, 0, {}};
    const double fall = -2 * w / speed_ * e;
    Excess out{sigma_ * e * growth,
               sigma_ * (fall * growth + e * viscous_),
               {e * growth, sigma_ * growth * 2 * w * w / speed_ * e, sigma_ * e * v}};
    if (whole_) out.h += viscous_ * v, out.slope += viscous_, out.by[2] += v;
    return out;
  }
  /// v beyond which there is nothing [m/s]
  double reach() const { return whole_ ? HUGE_VAL : kReach * speed_; }

 private:
  double sigma_, speed_, viscous_;
  bool whole_;
};

/// F and T of an evenly pressed disc at (V, Ω), with their slopes F_V, F_Ω = T_V, T_Ω, and those by the
/// parameters.
struct DiscExcess {
  double force{}, torque{}, force_v{}, cross{}, torque_w{};
  std::array<double, kParameters> force_by{}, torque_by{};
};

DiscExcess sliding_whole(const ExcessLaw& law, double V, double W) {
  const Excess at = law(V);
  DiscExcess out;
  out.force = at.h, out.force_v = at.slope, out.force_by = at.by;
  out.torque_w = (at.h / V + at.slope) / 4;
  out.torque = out.torque_w * W;
  for (std::size_t k = 0; k < kParameters; ++k) out.torque_by[k] = at.by[k] / V / 4 * W;
  return out;
}

/// Whole circles around the centre of rotation, out to ρ = 1 − d.
void add_whole_circles(const ExcessLaw& law, double d, double W, DiscExcess& out) {
  static const GaussRule<kInnerNodes> rule;
  const double rim = 1 - d, length = std::min(rim, law.reach() / W);
  double moment = 0;
  for (std::size_t i = 0; i < kInnerNodes; ++i) {
    const double rho = length * rule.x[i], share = 2 * length * rule.weight[i] * rho * rho;
    const Excess at = law(W * rho);
    moment += share * at.h;
    for (std::size_t k = 0; k < kParameters; ++k) out.torque_by[k] += share * at.by[k];
  }
  const double h = law(W * rim).h, slope = rim * h / W;
  out.torque += moment;
  out.force_v += slope;
  out.cross -= d * slope;
  out.torque_w += d * d * slope + (2 * rim * rim * rim * h - 3 * moment) / W;
}

/// Arcs, from ρ = |1 − d| on.
void add_arcs(const ExcessLaw& law, double d, double W, DiscExcess& out) {
  const double begin = std::abs(d - 1), reach = law.reach() / W;
  const double end = std::min(d + 1, std::hypot(begin, reach));
  const auto& rule = gathered();
  const double from = d < 1 ? -d : d - 2;  // ρ − 1 at the begin
  for (std::size_t i = 0; i < kNodes; ++i) {
    const double beyond = from + (end - begin) * rule.x[i], rho = 1 + beyond;
    if (!(rho > 0)) continue;
    const double cosine = (d * d + beyond * (2 + beyond)) / (2 * d * rho);
    const double heron = ((rho + d) * (rho + d) - 1) * (1 - (rho - d) * (rho - d));
    const double sine = heron > 0 ? std::sqrt(heron) / (2 * d * rho) : 0;
    const double psi = std::atan2(sine, cosine), across = psi - sine * cosine, along = psi + sine * cosine;
    const Excess at = law(W * rho);
    const double w = (end - begin) * rule.weight[i] / std::numbers::pi;
    const double force = 2 * w * rho * sine, torque = 2 * w * rho * (rho * psi - d * sine);
    out.force += force * at.h;
    out.torque += torque * at.h;
    for (std::size_t k = 0; k < kParameters; ++k) {
      out.force_by[k] += force * at.by[k];
      out.torque_by[k] += torque * at.by[k];
    }
    const double turned = w * at.h / W * across, grown = w * at.slope * rho;
    out.force_v += turned + grown * along;
    out.cross += -d * turned + grown * (2 * rho * sine - d * along);
    out.torque_w += d * d * turned + grown * (2 * psi * rho * rho - 4 * rho * d * sine + d * d * along);
  }
}

DiscExcess even_disc(const ExcessLaw& law, double V, double W) {
  if (V >= kFar * W) return sliding_whole(law, V, W);
  DiscExcess out;
  const double d = V / W;
  if (W * std::abs(1 - d) >= law.reach() && d > 1) return out;
  if (d < 1) add_whole_circles(law, d, W, out);
  if (d > 1e-12) add_arcs(law, d, W, out);
  return out;
}

}  // namespace

/// The weights are those whose sums of R^2k are ∫ R^2k, (k+1)!/((s+2) … (s+k+1)).
LocalFriction::LocalFriction(const Dual& exponent, const Dual& torque_factor)
    : torque_factor_(torque_factor), square_radius_(1.0 / (exponent + 2.0)) {
  Eigen::Matrix<double, kDiscs, kDiscs> powers;
  Eigen::Matrix<double, kDiscs, 1> moments, slopes;
  Dual moment(1.0), by(exponent.a, 0);
  for (int k = 0; k < kDiscs; ++k) {
    if (k > 0) moment *= (k + 1.0) / (by + (k + 1.0));
    moments[k] = moment.a;
    slopes[k] = moment.v[0];
  }
  for (int j = 0; j < kDiscs; ++j) {
    // Chebyshev's extrema on [0, 1] but for the one at 0
    const double square = 0.5 * (1 - std::cos(std::numbers::pi * (j + 1) / kDiscs));
    radius_[static_cast<std::size_t>(j)] = std::sqrt(square);
    for (int k = 0; k < kDiscs; ++k) powers(k, j) = std::pow(square, k);
  }
  const auto factor = powers.fullPivLu();
  const Eigen::Matrix<double, kDiscs, 1> weight = factor.solve(moments), slope = factor.solve(slopes);
  for (int j = 0; j < kDiscs; ++j)
    weight_[static_cast<std::size_t>(j)] = Dual(weight[j], slope[j] * exponent.v);
  if (dynamics::is_zero(exponent)) {
    first_ = kDiscs - 1;
    weight_.back() = Dual(1.0);
  }
}

template <class S>
Vec3<S> LocalFriction::wrench(const SpeedDependence<S>& speed, const Vec3<S>& u) const {
  using std::sqrt;
  const S c = dynamics::convert<S>(torque_factor_);
  const S slide2 = u[0] * u[0] + u[1] * u[1];
  const S V = value_of(slide2) > 0 ? S(sqrt(slide2)) : S(0);
  const double side = value_of(u[2]) < 0 ? -1 : 1;
  const S W = side * u[2] / c;
  const bool negative = value_of(speed.viscous) * (value_of(V) + value_of(W)) < -1;
  S slide(0), torque(0);  // F/V, T
  if (speed.linear && !negative) {
    slide = speed.viscous;
    torque = speed.viscous * dynamics::convert<S>(square_radius_) * W;
  }
  if (speed.stribeck || negative) {
    const ExcessLaw law(speed, negative);
    for (std::size_t j = static_cast<std::size_t>(first_); j < kDiscs; ++j) {
      const double R = radius_[j], v = value_of(V), w = R * value_of(W);
      const DiscExcess disc = even_disc(law, v, w);
      const S weight = dynamics::convert<S>(weight_[j]);
      S force(disc.force), turn(disc.torque);
      if constexpr (!std::is_same_v<S, double>) {
        const auto by = [&](const std::array<double, kParameters>& slope) {
          return slope[0] * speed.static_excess.v + slope[1] * speed.stribeck_speed.v +
                 slope[2] * speed.viscous.v;
        };
        force.v = disc.force_v * V.v + disc.cross * R * W.v + by(disc.force_by);
        turn.v = disc.cross * V.v + disc.torque_w * R * W.v + by(disc.torque_by);
      }
      slide += weight * (v > 0 ? S(force / V) : S(disc.force_v));
      torque += weight * R * turn;
    }
  }
  return {-slide * u[0], -slide * u[1], -side / c * torque};
}

template Vec3<double> LocalFriction::wrench(const SpeedDependence<double>&, const Vec3<double>&) const;
template Vec3<Dual> LocalFriction::wrench(const SpeedDependence<Dual>&, const Vec3<Dual>&) const;

}  // namespace unhand::contact
