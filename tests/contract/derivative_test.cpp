// The derivative of a landing with respect to what the throw is made of: through stick, slip, their switches,
// detach and flight, against central differences.
#include <cmath>
#include <limits>

#include "flight/projectile.hpp"
#include "tests/contract/every_model.hpp"
#include "tests/support/best_difference.hpp"

namespace unhand {
namespace {

using dynamics::Dual;

constexpr int kParameters = 8;
constexpr const char* kNames[kParameters] = {"mass",        "inertia", "com_offset",   "angle",
                                             "mu or delay", "radius",  "opening_time", "grip_force"};

struct Answer {
  std::array<double, 4> landing{};  ///< t, x, θ at landing; ω at detach
  std::array<std::array<double, kParameters>, 4> slope{};
  std::vector<int> modes;
};

class Derivative : public EveryModel {
 protected:
  static std::array<double, kParameters> parameters_of(const support::RandomThrow& t, double delay) {
    const auto& q = t.force.profile();
    return {
        t.body.mass,    t.body.inertia,   t.grasp.com_offset, t.grasp.angle, carried() ? delay : t.patch.mu,
        t.patch.radius, q.opening_time.a, q.grip_force.a};
  }

  /// One method for both scalars: the double runs then follow the same steps but for the parameter's change.
  static dynamics::Method one_method() {
    return surface() ? dynamics::Method::radau : dynamics::Method::automatic;
  }

  template <class S>
  static Answer land(const support::RandomThrow& thrown, const std::array<S, kParameters>& x,
                     double tolerance, dynamics::Method method = one_method()) {
    const auto& q = thrown.force.profile();
    const contact::OpeningProfile<S> opening{q.open_command, x[7], S(q.dead_time.a), x[6], S(q.shape.a)};
    const contact::ProfileNormalForce force(opening);
    contact::ContactParameters<S> p;
    p.patch = {carried() ? S(thrown.patch.mu) : x[4], x[5], S(thrown.patch.torque_factor), thrown.patch.pads};
    p.open_command = q.open_command;
    p.delay = carried() ? x[4] : S(0.0);
    const auto model = contact::make_contact_model(GetParam(), p);
    const release::ReleaseProblem<S> problem{thrown.hand,  force, *model, {x[0], x[1]}, {S(0.0), S(-9.81)},
                                             {x[2], x[3]}, 0.0,   {},     S(0.0)};
    release::ReleaseOptions options;
    options.integrator.tolerances = {tolerance, 1e-2 * tolerance};
    options.integrator.method = method;
    const auto result = simulate_release(problem, options);
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached) << describe(thrown);
    Answer answer;
    answer.modes.push_back(result.slips_at_start);
    for (const auto& event : result.events) answer.modes.push_back(event.mode_after);
    const auto landing =
        flight::project<S>(result.detach.pose, result.detach.twist, {S(0.0), S(-9.81)}, S(-0.5));
    if (!landing) {
      ADD_FAILURE() << "never lands, " << describe(thrown);
      return answer;
    }
    const std::array<S, 4> y{S(result.detach.time + landing->flight_time), landing->pose.x,
                             landing->pose.theta, result.detach.twist.omega};
    for (int i = 0; i < 4; ++i) {
      answer.landing[i] = dynamics::value_of(y[i]);
      if constexpr (!std::is_same_v<S, double>)
        for (int k = 0; k < kParameters; ++k) answer.slope[i][k] = y[i].v[k];
    }
    return answer;
  }

  /// Whether runs at parameter k moved by h have the modes of `fit`; if so, its slopes are held against their
  /// difference. A slope is at least a hundredth of what a change by `scale` would need.
  static bool is_the_difference(const support::RandomThrow& thrown, const Answer& fit,
                                const std::array<double, kParameters>& at, int k, double h, double scale,
                                double bound) {
    constexpr double kTight = 1e-11;
    auto above = at, below = at;
    above[k] += h;
    below[k] -= h;
    const Answer a = land<double>(thrown, above, kTight), b = land<double>(thrown, below, kTight);
    if (a.modes != fit.modes || b.modes != fit.modes) return false;
    for (int j = 0; j < 4; ++j) {
      const double difference = (a.landing[j] - b.landing[j]) / (2 * h);
      const double size =
          std::max(std::abs(difference), 0.01 * std::max(1.0, std::abs(a.landing[j])) / scale);
      EXPECT_NEAR(fit.slope[j][k], difference, bound * size)
          << "answer " << j << " by " << kNames[k] << " shape " << thrown.force.profile().shape.a << ' '
          << describe(thrown);
    }
    return true;
  }
};
UNHAND_EVERY_MODEL(Derivative);

TEST_P(Derivative, OfTheLandingIsTheCentralDifference) {
  constexpr int kThrows = 6;
  constexpr double kTolerance = 1e-11;
  std::mt19937_64 random(61);
  int compared = 0, switches = 0;
  for (int i = 0; i < kThrows; ++i) {
    const auto thrown = support::random_throw(random, 0.5 * (i % 3));
    const auto at = parameters_of(thrown, 0.031);
    const Answer exact = land<Dual>(thrown, support::seeded(at), kTolerance);
    switches += static_cast<int>(exact.modes.size());
    for (int k = 0; k < kParameters; ++k) {
      const double scale = std::max(std::abs(at[k]), 1e-2);
      std::array<double, 4> best;
      best.fill(std::numeric_limits<double>::infinity());
      for (const double relative : {1e-4, 1e-5}) {
        const double h = relative * scale;
        auto above = at, below = at;
        above[k] += h;
        below[k] -= h;
        const Answer a = land<double>(thrown, above, kTolerance), b = land<double>(thrown, below, kTolerance);
        if (a.modes != exact.modes || b.modes != exact.modes)
          continue;  // a switch more or less: not differentiable there
        for (int j = 0; j < 4; ++j) {
          const double difference = (a.landing[j] - b.landing[j]) / (2 * h);
          // relative to the slope, or to the effect that a change of the parameter by all of itself would
          // have
          const double size = std::max(std::abs(exact.slope[j][k]),
                                       0.1 * std::max(1.0, std::abs(exact.landing[j])) / scale * 1e-1);
          best[j] = std::min(best[j], std::abs(difference - exact.slope[j][k]) / size);
        }
      }
      if (std::isinf(best[0])) continue;
      ++compared;
      // truncation h² and the noise of the runs, 1e-11/h, cross near 1e-6 of the effect where a throw has
      // many switches
      for (int j = 0; j < 4; ++j)
        EXPECT_LT(best[j], 3e-6) << "answer " << j << " by " << kNames[k] << " slope " << exact.slope[j][k]
                                 << ' ' << describe(thrown);
    }
  }
  EXPECT_GE(compared, kThrows * kParameters - 4) << "switches that come and go may cost a few";
  if (!carried()) {
    EXPECT_GT(switches, 2 * kThrows);
  }
}

TEST_P(Derivative, OfTheOpeningIsRightAtTheTolerancesOfFits) {
  // A force that ends as (t₁ − t)^p: at a fixed time its derivative by t₁ has a pole there if p < 1.
  constexpr double kFit = 1e-6, kStep = 1e-4;
  std::mt19937_64 random(63);
  int compared = 0;
  for (const double shape : {0.5, 0.7, 1.2, 2.0})
    for (int i = 0; i < 4; ++i) {
      auto thrown = support::random_throw(random, 0);
      auto profile = thrown.force.profile();
      profile.shape = Dual(shape);
      thrown.force = contact::ProfileNormalForce(profile);
      const auto at = parameters_of(thrown, 0.031);
      const Answer fit = land<Dual>(thrown, support::seeded(at), kFit, dynamics::Method::automatic);
      for (const int k : {4, 6, 7}) {
        compared += is_the_difference(thrown, fit, at, k, kStep * std::abs(at[k]), std::abs(at[k]), 3e-4);
      }
    }
  EXPECT_GE(compared, 40);
}

TEST_P(Derivative, OfAnObjectHeldAtItsCentreOfMass) {
  // In a hand that turns evenly nothing asks for a torque. The values are pure slide, in a few long steps,
  // and what a small lever would add is stiff: no error of the derivatives shortens the steps, and at
  // tolerances of fits they err by up to 0.2 %.
  constexpr double kFit = 1e-6, kOfSymmetry = 5e-3;
  std::mt19937_64 random(64);
  int compared = 0;
  for (int i = 0; i < 4; ++i) {
    auto thrown = support::random_throw(random, 0);
    thrown.grasp.com_offset = 0;
    thrown.hand = support::SwayingHand(
        {{{0.5, 1.8, -8.0 - i, 0, 1, 0}, {0.9, 1.8, -3.0, 0, 1, 0}, {0.1, 2.0, 0, 0, 1, 0}}},
        thrown.hand.end());
    const auto at = parameters_of(thrown, 0.031);
    const Answer fit = land<Dual>(thrown, support::seeded(at), kFit, dynamics::Method::automatic);
    for (int k = 0; k < kParameters; ++k) {
      const double scale = std::max(std::abs(at[k]), 1e-2);
      compared += is_the_difference(thrown, fit, at, k, 1e-4 * scale, scale, kOfSymmetry);
    }
  }
  EXPECT_GE(compared, 4 * kParameters - 4);
}

TEST_P(Derivative, TheValuesAreThoseOfTheDoubleRun) {
  std::mt19937_64 random(62);
  for (int i = 0; i < 10; ++i) {
    const auto thrown = support::random_throw(random, i % 2);
    const auto at = parameters_of(thrown, 0.031);
    const Answer a = land<Dual>(thrown, support::seeded(at), 1e-9), b = land<double>(thrown, at, 1e-9);
    EXPECT_EQ(a.modes, b.modes) << describe(thrown);
    for (int j = 0; j < 4; ++j)
      EXPECT_NEAR(a.landing[j], b.landing[j], 1e-7 * std::max(1.0, std::abs(b.landing[j])))
          << describe(thrown);
  }
}

}  // namespace
}  // namespace unhand
