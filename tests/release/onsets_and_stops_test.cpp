// Slips next to rest, pads that can give nothing, steppers that look beyond a phase, and what a brake that
// comes to rest leaves of derivatives.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "contact/registry.hpp"
#include "release/simulate_release.hpp"
#include "tests/support/random_throw.hpp"

namespace unhand {
namespace {

using dynamics::Dual;

constexpr const char* kFollowers[] = {"limit_surface", "limit_surface_disc", "limit_surface_quartic",
                                      "sliding_pivot"};

std::unique_ptr<contact::ContactModel> law_of(const char* name, double mu) {
  contact::ContactParameters<double> pads;
  pads.patch = {mu, 0.0106};
  return contact::make_contact_model(name, pads);
}

/// A straight ramp whose branches the window chooses alone: past the end of its window it goes on below zero.
class BareRamp final : public contact::NormalForce {
 public:
  double at(const contact::Window& w, double t) const override { return at_(w, t); }
  Dual at(const contact::Window& w, const Dual& t) const override { return at_(w, t); }
  void kinks(std::vector<double>& out) const override { out.insert(out.end(), {kBegin, kEnd}); }
  void kinks(std::vector<Dual>& out) const override { out.insert(out.end(), {Dual(kBegin), Dual(kEnd)}); }
  double release_time() const override { return kEnd; }

 private:
  static constexpr double kBegin = 0.03, kEnd = 0.10, kGrip = 60;
  template <class S>
  static S at_(const contact::Window& w, const S& t) {
    if (w.end <= kBegin) return S(kGrip);
    if (w.begin >= kEnd) return S(0);
    return kGrip * (kEnd - t) / (kEnd - kBegin);
  }
};

TEST(OnsetsAndStops, ASteppersLookBeyondThePhaseIsNoFault) {
  const auto hand =
      release::PolynomialHand::segments(0.0, {0.5, 0.9, 0.8}, {1.8, 1.8, 2.0}, {{0.20, {3.0, 3.0, 0.0}}});
  const BareRamp bare;
  const contact::ProfileNormalForce profile(contact::OpeningProfile<double>{0.03, 60.0, 0.0, 0.070, 1.0});
  for (const char* name : kFollowers)
    for (const double mu : {0.2, 0.5, 1.0}) {
      const auto law = law_of(name, mu);
      const auto released = [&](const contact::NormalForce& force) {
        return release::simulate_release<double>(
            {hand, force, *law, {0.246, 2.4e-3}, dynamics::level_gravity(9.81), {0.10, -0.7}});
      };
      const auto ours = released(bare), same = released(profile);
      ASSERT_EQ(ours.outcome, release::ReleaseOutcome::detached) << name << " " << mu;
      EXPECT_NEAR(ours.detach.twist.vx, same.detach.twist.vx, 1e-6) << name << " " << mu;
      EXPECT_NEAR(ours.detach.twist.omega, same.detach.twist.omega, 1e-5) << name << " " << mu;
    }
}

// Whatever the size of a slip at the start, the release goes over into that of an object at rest.
TEST(OnsetsAndStops, ASlipNextToRestComesToRest) {
  const auto hand = release::PolynomialHand::segments(0.0, {0.5, 0.9, 0.8}, {1.8, 1.8, 2.0},
                                                      {{0.03, {3.0, 3.0, 0.0}}, {0.20, {-8.0, -8.0, 0.0}}});
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0.02, 60.0, 0.010, 0.070, 2.0});
  for (const char* name : kFollowers) {
    const auto law = law_of(name, 0.5);
    const auto released = [&](double slip) {
      return release::simulate_release<double>({hand,
                                                force,
                                                *law,
                                                {0.246, 2.4e-3},
                                                dynamics::level_gravity(9.81),
                                                {0.10, -0.7},
                                                0.0,
                                                {slip, 0.0}});
    };
    const auto at_rest = released(0);
    for (const double slip : {1e-12, 1e-9, 1e-8, 1e-7, 2.2e-7, 3e-7, 1e-6}) {
      const auto result = released(slip);
      ASSERT_EQ(result.outcome, release::ReleaseOutcome::detached) << name << " " << slip;
      EXPECT_NEAR(result.detach.twist.vx, at_rest.detach.twist.vx, 1e-6) << name << " " << slip;
      EXPECT_NEAR(result.detach.twist.omega, at_rest.detach.twist.omega, 1e-5) << name << " " << slip;
    }
  }
}

// Without friction the object flies from the start, also where the hand falls freely and asks for nothing.
TEST(OnsetsAndStops, PadsWithoutFrictionLeaveAFreeFlight) {
  const contact::ProfileNormalForce force(contact::OpeningProfile<double>{0.02, 60.0, 0.010, 0.070, 2.0});
  constexpr double kAngle = 0.1;  // of the lever, from the hand's x axis
  for (const char* name : kFollowers)
    for (const double off : {0.0, 0.1})
      for (const double omega : {0.0, 2.0})
        for (const double first : {-9.81, 1.0}) {
          const auto hand =
              release::PolynomialHand::segments(0.0, {0.5, 0.9, 0.8}, {1.8, 1.8, omega},
                                                {{0.013, {0.0, first, 5.0}}, {0.25, {0.0, -9.81, 5.0}}});
          const auto law = law_of(name, 0.0);
          const auto result = release::simulate_release<double>(
              {hand, force, *law, {0.246, 2.4e-3}, dynamics::level_gravity(9.81), {off, kAngle - 0.8}});
          ASSERT_EQ(result.outcome, release::ReleaseOutcome::detached) << name << off << omega << first;
          EXPECT_NEAR(result.detach.twist.omega, omega, 1e-7) << name << off << omega << first;
          EXPECT_NEAR(result.detach.twist.vz,
                      1.8 + omega * off * std::cos(kAngle) - 9.81 * result.detach.time, 1e-6)
              << name << off << omega << first;
        }
}

/// μ, m, I, com_offset.
constexpr int kMoved = 4;

template <class S>
release::ReleaseResult<S> shaken(const support::RandomThrow& t, const std::array<S, kMoved>& x,
                                 double tolerance) {
  contact::ContactParameters<S> pads;
  pads.patch = {x[0], S(t.patch.radius), S(t.patch.torque_factor), t.patch.pads};
  const auto law = contact::make_contact_model("sliding_pivot", pads);
  release::ReleaseOptions options;
  options.integrator.tolerances = {tolerance, 0.01 * tolerance};
  return release::simulate_release<S>(
      {t.hand, t.force, *law, {x[1], x[2]}, {S(0), S(-9.81)}, {x[3], S(t.grasp.angle)}}, options);
}

// A brake's direction has not settled where its slip ends; the derivative of that instant alone says nothing
// of the twist that is left.
TEST(OnsetsAndStops, DerivativesPassABrakeThatComesToRest) {
  std::mt19937_64 random(11);
  int compared = 0;
  for (int k = 0; k < 150; ++k) {
    const auto thrown = support::random_throw(random, 1.0);
    const std::array<double, kMoved> at{thrown.patch.mu, thrown.body.mass, thrown.body.inertia,
                                        thrown.grasp.com_offset};
    std::array<Dual, kMoved> x;
    for (int i = 0; i < kMoved; ++i) x[i] = dynamics::independent(at[i], i);
    const auto derived = shaken(thrown, x, 1e-8);
    const auto modes = [](const auto& result) {
      std::vector<int> out;
      for (const auto& event : result.events) out.push_back(event.mode_after);
      return out;
    };
    const auto brakes = [](int mode) { return mode >= 6 && mode <= 8; };
    std::vector<std::size_t> stops;
    for (std::size_t e = 0; e < derived.events.size(); ++e)
      if (brakes(derived.events[e].mode_before) && !brakes(derived.events[e].mode_after)) stops.push_back(e);
    if (stops.empty()) continue;
    for (int i = 0; i < kMoved; ++i) {
      const auto moved = [&](double by) {
        auto y = at;
        y[i] *= 1 + by;
        return shaken(thrown, y, 1e-11);
      };
      constexpr double kStep = 1e-5;
      const auto up = moved(kStep), down = moved(-kStep), further = moved(2 * kStep),
                 lower = moved(-2 * kStep);
      if (modes(up) != modes(derived) || modes(down) != modes(derived) || modes(further) != modes(derived) ||
          modes(lower) != modes(derived))
        continue;
      const double span = 2 * kStep * at[i];
      const double near = (up.detach.twist.omega - down.detach.twist.omega) / span,
                   far = (further.detach.twist.omega - lower.detach.twist.omega) / (2 * span);
      const double error = std::abs(derived.detach.twist.omega.v[i] - (4 * near - far) / 3) * at[i];
      EXPECT_LT(error, 0.01 * std::abs(near * at[i]) + 10 * std::abs(near - far) * at[i] + 1e-4)
          << "throw " << k << ", parameter " << i;
      ++compared;
      // Of the stop's instant, too: six times the worst, and the differences' own errors.
      for (const std::size_t e : stops) {
        const double soon = (up.events[e].t - down.events[e].t) / span,
                     late = (further.events[e].t - lower.events[e].t) / (2 * span);
        EXPECT_LT(std::abs(derived.events[e].t.v[i] - (4 * soon - late) / 3) * at[i],
                  2e-3 * std::abs(soon * at[i]) + 10 * std::abs(soon - late) * at[i] + 1e-7)
            << "throw " << k << ", parameter " << i << ", event " << e;
      }
    }
  }
  EXPECT_GE(compared, 20);
}

}  // namespace
}  // namespace unhand
