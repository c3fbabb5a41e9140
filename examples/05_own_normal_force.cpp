// A mechanism of your own: two pads of which one opens after the other. Derivatives come with it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <vector>

#include "contact/registry.hpp"
#include "flight/fly.hpp"
#include "release/simulate_release.hpp"

using namespace unhand;
using dynamics::Dual;

/// The mean of two pads, f(t) = (g(t) + g(t - lag))/2 [N].
class UnevenOpening final : public contact::NormalForce {
 public:
  UnevenOpening(const contact::OpeningProfile<double>& p, const Dual& lag)
      : first_(p),
        later_(contact::OpeningProfile<Dual>{p.open_command, Dual(p.grip_force), p.dead_time + lag,
                                             Dual(p.opening_time), Dual(p.shape)}) {}

  double at(const contact::Window& w, double t) const override { return at_(w, t); }
  Dual at(const contact::Window& w, const Dual& t) const override { return at_(w, t); }
  void kinks(std::vector<double>& out) const override { kinks_(out); }
  void kinks(std::vector<Dual>& out) const override { kinks_(out); }
  double release_time() const override { return later_.release_time(); }

 private:
  template <class S>
  S at_(const contact::Window& w, const S& t) const {
    return 0.5 * (first_.at(w, t) + later_.at(w, t));
  }
  template <class S>
  void kinks_(std::vector<S>& out) const {  // in order; the last is the release
    first_.kinks(out);
    later_.kinks(out);
    std::sort(out.begin(), out.end(),
              [](const S& a, const S& b) { return dynamics::value_of(a) < dynamics::value_of(b); });
  }
  contact::ProfileNormalForce first_, later_;
};

/// x [m] at the landing, of the lag [s]. Throws where there is none.
template <class S>
S landing_x(const S& lag) {
  const auto hand = release::PolynomialHand::segments(0.0, {0.5, 0.9, 0.8}, {1.8, 1.8, 2.0},
                                                      {{0.03, {3.0, 3.0, 0.0}}, {0.20, {-8.0, -8.0, 0.0}}});
  const UnevenOpening force({0.02, 60.0, 0.010, 0.070, 2.0}, Dual(lag));
  contact::ContactParameters<double> pads;
  pads.patch = {0.5, 0.0106};
  const auto law = contact::make_contact_model("limit_surface_disc", pads);
  const auto gravity = dynamics::level_gravity(S(9.81));
  const auto let_go =
      release::simulate_release<S>({hand, force, *law, {S(0.246), S(2.4e-3)}, gravity, {S(0.10), S(-0.7)}});
  if (let_go.outcome != release::ReleaseOutcome::detached)
    throw std::runtime_error(release::in_words(let_go.outcome));
  const auto flown = flight::fly<S>({let_go.detach.pose, let_go.detach.twist, gravity});
  if (flown.outcome != flight::FlightOutcome::landed)
    throw std::runtime_error(flight::in_words(flown.outcome));
  return flown.landing.pose.x;
}

int main() {
  const double lag = 0.005, h = 1e-5;
  const Dual x = landing_x(dynamics::independent(lag, 0));
  const double difference = (landing_x(lag + h) - landing_x(lag - h)) / (2 * h);
  std::printf("a lag of %.0f ms: x = %.4f m, dx/dlag = %.4f m/s (central difference %.4f)\n", 1e3 * lag, x.a,
              x.v[0], difference);
  return std::abs(x.v[0] - difference) < 1e-2 * std::abs(difference) ? 0 : 1;
}
