// A limit surface of one's own with a parameter of its own, known by name to everything that takes names:
//   gauge(w) = (|f|^p + |tau|^p)^(1/p),
// the ellipsoid for p = 2. How far are the pads of a log from it?
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "contact/limit_surface_from.hpp"
#include "contact/registry.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "fitting/fit.hpp"

using namespace unhand;
using contact::Vec3;
using dynamics::Dual;
using dynamics::value_of;

namespace {

/// Normalised slip u = (v_x, v_z, L omega_r) and wrench w = (f_x, f_z, tau/L)/f_max, as all shapes.
class SuperEllipsoid {
 public:
  static constexpr bool isotropic = true;
  explicit SuperEllipsoid(const Dual& p) : p_(p) {}

  /// Minus the gradient of the support function (|v|^q + |L omega|^q)^(1/q), 1/p + 1/q = 1.
  template <class S>
  Vec3<S> resist(const Vec3<S>& u) const {
    const S q = p<S>() / (p<S>() - 1.0);
    return minus_gradient(u, q);
  }
  template <class S>
  S gauge(const Vec3<S>& w) const {
    const auto [f, tau, size] = parts(w);
    return value_of(size) > 0 ? S(size * root_of_sum(S(f / size), S(tau / size), p<S>())) : S(0);
  }
  Vec3<double> slip_direction(const Vec3<double>& w) const {
    auto u = minus_gradient(w, p<double>());
    const double length = std::hypot(u[0], u[1], u[2]);
    for (double& one : u) one /= length > 0 ? length : 1;
    return u;
  }

 private:
  template <class S>
  S p() const {
    return dynamics::convert<S>(p_);
  }
  /// |f|, |tau| and the larger of them, which is taken out before anything is raised to a power.
  template <class S>
  struct Parts {
    S f{}, tau{}, size{};
  };
  template <class S>
  static Parts<S> parts(const Vec3<S>& w) {
    using std::abs;
    using std::sqrt;
    const double scale = std::max(std::abs(value_of(w[0])), std::abs(value_of(w[1])));
    const S x = scale > 0 ? S(w[0] / scale) : S(0), z = scale > 0 ? S(w[1] / scale) : S(0);
    const S f = scale > 0 ? S(scale * sqrt(x * x + z * z)) : S(0), tau = abs(w[2]);
    return {f, tau, value_of(f) > value_of(tau) ? f : tau};
  }
  template <class S>
  static S power(const S& base, const S& exponent) {
    using std::pow;
    return value_of(base) > 0 ? S(pow(base, exponent)) : S(0);
  }
  template <class S>
  static S root_of_sum(const S& a, const S& b, const S& n) {
    using std::pow;
    return pow(S(power(a, n) + power(b, n)), S(1.0 / n));
  }
  template <class S>
  static Vec3<S> minus_gradient(const Vec3<S>& u, const S& n) {
    const auto [v, spin, size] = parts(u);
    if (!(value_of(size) > 0)) return {S(0), S(0), S(0)};
    const S a = v / size, b = spin / size, whole = root_of_sum(a, b, n);
    const S along = power(S(a / whole), S(n - 1.0)), turn = power(S(b / whole), S(n - 1.0));
    const S per = value_of(v) > 0 ? S(along / v) : S(0);
    return {-per * u[0], -per * u[1], value_of(u[2]) > 0 ? S(-turn) : turn};
  }
  Dual p_;
};

}  // namespace

template class unhand::contact::ContactModelFrom<contact::LimitSurface<SuperEllipsoid>>;
template class unhand::contact::LimitSurface<SuperEllipsoid>;

int main() {
  static constexpr const char* kName = "limit_surface_super";
  contact::register_contact_model(
      {kName,
       [](const contact::ContactParameters<Dual>& p) -> std::unique_ptr<contact::ContactModel> {
         return std::make_unique<contact::LimitSurface<SuperEllipsoid>>(
             kName, p.patch, SuperEllipsoid(p.law_values.at("exponent")), p.variation);
       },
       {{.name = "exponent",
         .unit = "-",
         .start = 1.95,
         .low = 1.1,  // accepted
         .high = 2,
         .search_low = 1.2,  // where fits look
         .search_high = 2,
         .typical = 0.05,
         .remedy = "throws whose pads slide and turn at once"}}});

  // Synthetic throws of pads that are exact discs, in place of a log of yours.
  auto design = experiment::campaign_design("quick12");
  design.contact_model = "limit_surface_disc";
  const auto log = experiment::generate_campaign(design, 1);
  double chi2[2];
  int k = 0;
  for (const char* model : {"limit_surface", kName}) {
    fitting::CampaignOptions options;
    options.model = model;
    const fitting::CampaignProblem problem(log, "(in memory)", options);
    const auto fit = fitting::fit(problem);
    if (fit.outcome != fitting::FitOutcome::converged) return 1;
    std::printf("%s: chi2 %.0f\n", model, chi2[k++] = fit.chi2);
    for (const auto& u : fit.campaign)
      std::printf("  %-8s %.5g +- %.2g %s\n", u.unknown.name.c_str(), u.value, u.sigma,
                  u.unknown.unit.c_str());
  }
  // A disc resists less than the ellipsoid where it slides and turns at once.
  return chi2[1] < chi2[0] ? 0 : 1;
}
