// Departures of the friction limits, contact effect by contact effect: neutral is the base law to the bit,
// derivatives are central differences through whole releases, and closed forms where there are any.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "tests/support/effect_releases.hpp"
#include "tests/support/refusal.hpp"

namespace unhand {
namespace {

using contact::FrictionVariation;
using dynamics::Dual;
using support::detach;
using support::kDetach;

const std::vector<std::string> kLaws{"limit_surface", "limit_surface_disc", "limit_surface_quartic",
                                     "sliding_pivot"};

class ContactEffect : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, ContactEffect, testing::ValuesIn(kLaws),
                         [](const auto& law) { return law.param; });

TEST_P(ContactEffect, NeutralIsTheBaseLawToTheBit) {
  FrictionVariation<double> neutral;  // shape parameters of absent effects do not matter
  neutral.stribeck_speed = 0.1;
  neutral.reference_force = 17;
  neutral.loss_time = 0.03;
  neutral.parting_time = 0.02;
  std::mt19937_64 random(71);
  for (int i = 0; i < 10; ++i) {
    const auto thrown = support::random_throw(random, i % 2);
    const auto base = detach(GetParam(), thrown, FrictionVariation<double>{}, 1e-8);
    const auto same = detach(GetParam(), thrown, neutral, 1e-8);
    for (int j = 0; j < kDetach; ++j) EXPECT_EQ(base.state[j], same.state[j]) << thrown.patch.mu;
    EXPECT_EQ(base.modes, same.modes);
  }
}

/// One parameter of an effect, and where its derivative is checked.
struct Place {
  const char* name;
  double at;        ///< its value
  double neutral;   ///< where the effect is absent: its influence is what the error is measured by
  bool at_neutral;  ///< the derivative exists at neutral too
  template <class S>
  static void set(const char* name, const S& value, FrictionVariation<S>& v) {
    const std::string_view n(name);
    if (n == "static_ratio") v.static_ratio = value;
    if (n == "stribeck_speed") v.static_ratio = S(1.3), v.stribeck_speed = value;
    if (n == "viscous") v.viscous = value;
    if (n == "softness") v.softness = value;
    if (n == "compliance") v.compliance = value, v.loss_time = S(0.003);
    if (n == "pressure_exponent") v.pressure_exponent = value;
    if (n == "loss_time") v.compliance = S(1e-5), v.loss_time = value;
  }
};
constexpr Place kPlaces[] = {{"static_ratio", 1.3, 1, true},      {"static_ratio", 0.8, 1, false},
                             {"stribeck_speed", 0.05, 0, false},  {"viscous", 2, 0, true},
                             {"softness", 0.4, 0, true},          {"softness", -0.3, 0, false},
                             {"compliance", 2e-5, 0, false},      {"loss_time", 0.004, 0, false},
                             {"pressure_exponent", 0.5, 0, true}, {"pressure_exponent", -0.3, 0, false}};
/// Every parameter of every effect that changes friction itself (adhesion wraps the force) has its place.
TEST(ContactEffects, EveryParameterHasAPlaceWhereItsDerivativeIsChecked) {
  const FrictionVariation<double> neutral;
  FrictionVariation<double> variation;
  for (const Place& place : kPlaces) Place::set(place.name, 0.123, variation);
  const auto before = effect_values(neutral);
  const auto after = effect_values(variation);
  std::size_t k = 0;
  for (const auto& [effect, apply, apply_dual] : contact::friction_effects())
    for (const auto& parameter : effect.parameters) {
      if (effect.id != "contact.adhesion") {
        EXPECT_NE(*after[k], *before[k]) << effect.full_name(parameter);
      }
      ++k;
    }
}

/// Whether the effect has a footprint in this law.
bool matters(std::string_view name, std::string_view law) {
  if (name == "compliance" || name == "loss_time") return law != "sliding_pivot";
  return name != "pressure_exponent" || law == "limit_surface_disc";
}

TEST_P(ContactEffect, DerivativeIsTheCentralDifference) {
  constexpr double kTolerance = 1e-11;
  for (const Place& place : kPlaces) {
    if (!matters(place.name, GetParam())) continue;
    std::vector<double> values{place.at};
    if (place.at_neutral) values.push_back(place.neutral);
    for (const double value : values) {
      std::mt19937_64 random(72);
      int compared = 0;
      for (int i = 0; i < 2; ++i) {
        const auto thrown = support::random_throw(random, 0.5 * (i % 2));
        const auto with = [&](auto x) {
          FrictionVariation<decltype(x)> v;
          v.reference_force = 20;
          Place::set(place.name, x, v);
          return v;
        };
        const auto exact = detach(GetParam(), thrown, with(dynamics::independent(value, 0)), kTolerance);
        const auto plain = detach(GetParam(), thrown, with(value), kTolerance);
        std::array<double, kDetach> best;
        best.fill(std::numeric_limits<double>::infinity());
        for (const double h : {1e-3, 1e-4, 1e-5}) {
          const double step = h * (value != 0 ? std::abs(value) : 0.1);
          const auto above = detach(GetParam(), thrown, with(value + step), kTolerance);
          const auto below = detach(GetParam(), thrown, with(value - step), kTolerance);
          if (above.modes != exact.modes || below.modes != exact.modes) continue;  // a switch more or less
          for (int j = 0; j < kDetach; ++j)
            best[j] = std::min(
                best[j], std::abs((above.state[j] - below.state[j]) / (2 * step) - exact.state[j].v[0]));
        }
        for (int j = 0; j < kDetach; ++j)
          EXPECT_NEAR(exact.state[j].a, plain.state[j], 1e-7 * std::max(1.0, std::abs(plain.state[j])))
              << place.name << ' ' << value;
        if (std::isinf(best[0])) continue;
        ++compared;
        // h² and the noise of the runs, 1e-11/h, cross near 1e-6 of what the parameter does
        for (int j = 0; j < kDetach; ++j)
          EXPECT_LT(best[j],
                    1e-5 * std::max(std::abs(exact.state[j].v[0]), value != 0 ? 0.1 / std::abs(value) : 0.1))
              << place.name << " = " << value << ", state " << j << ", slope " << exact.state[j].v[0]
              << " throw " << i;
      }
      EXPECT_GE(compared, 1) << place.name << ' ' << value;
    }
  }
}

TEST_P(ContactEffect, OfTheLimitsAreSeenInTheMotion) {
  std::mt19937_64 random(73);
  // Pads that give show only where the grip holds at first: in some throw.
  std::map<std::string_view, double> most;
  for (int i = 0; i < 5; ++i) {
    const auto thrown = support::random_throw(random, 0);
    const auto base = detach(GetParam(), thrown, FrictionVariation<double>{}, 1e-9);
    for (const Place& place : kPlaces) {
      FrictionVariation<double> v;
      v.reference_force = 20;
      Place::set(place.name, place.at, v);
      const auto changed = detach(GetParam(), thrown, v, 1e-9);
      most[place.name] = std::max(most[place.name], std::abs(changed.state[5] - base.state[5]));
      if (!matters(place.name, GetParam())) {
        EXPECT_EQ(changed.state, base.state) << place.name;
      }
    }
  }
  for (const Place& place : kPlaces)
    if (matters(place.name, GetParam())) {
      EXPECT_GT(most[place.name], 1e-4) << place.name;
    }
}

/// The object against the hand t [s] after the hand, which was at rest, starts to accelerate, on pads of 1e-5
/// m/N that never open, without gravity.
contact::Relative<double> on_compliant_pads(const dynamics::Acceleration<double>& hand, double com_offset,
                                            double loss_time, double t) {
  contact::ContactParameters<double> p;
  p.patch = {0.8, 0.01};
  p.variation.compliance = 1e-5;
  p.variation.loss_time = loss_time;
  const auto model = contact::make_contact_model("limit_surface", p);
  constexpr double kRest = 0.01;
  const auto moving =
      release::PolynomialHand::segments(0, {0, 0, 0}, {}, {{kRest, {0, 0, 0}}, {kRest + 1, hand}});
  const support::ConstantForce force(1e4);
  const release::ReleaseProblem<double> problem{moving, force, *model, {0.2, 5e-4}, {0, 0}, {com_offset, 0.3},
                                                0,      {},    0};
  const auto result =
      simulate_release(problem, {.integrator = {.tolerances = {1e-10, 1e-12}, .record = true}});
  EXPECT_FALSE(result.slips_at_start);
  for (const auto& event : result.events)
    EXPECT_EQ(event.mode_after, event.mode_before) << "holds throughout";
  EXPECT_EQ(model->mode_name(result.trajectory.piece_at(kRest + t).phase.mode), "elastic");
  return contact::Relative<double>::from(result.trajectory.at(kRest + t));
}
/// q of q'' = −w² (q + T q') − a, from rest at zero.
double oscillation(double w, double loss_time, double a, double t) {
  const double decay = 0.5 * w * w * loss_time, damped = std::sqrt(w * w - decay * decay);
  return -a / (w * w) *
         (1 - std::exp(-decay * t) * (std::cos(damped * t) + decay / damped * std::sin(damped * t)));
}

TEST(PadComplianceTruth, AnObjectHeldAtItsCentreOscillatesAsTheFormulaSays) {
  for (const double loss : {0.0, 2e-4, 5e-4})
    for (const double t : {1e-3, 7e-3, 0.03}) {
      // amplitude a/w² = 2e-5 m, steps of 1e-12
      const auto pushed = on_compliant_pads({10, 0, 0}, 0, loss, t);
      const auto r = dynamics::rotate(0.3, pushed.arm);
      EXPECT_NEAR(r.x, oscillation(std::sqrt(1e5 / 0.2), loss, 10, t), 1e-10);
      EXPECT_NEAR(r.z, 0, 1e-12);
      const auto lifted = on_compliant_pads({0, 10, 0}, 0, loss, t);
      const auto up = dynamics::rotate(0.3, lifted.arm);
      EXPECT_NEAR(up.z, oscillation(std::sqrt(1e5 / 0.2), loss, 10, t), 1e-10);
      EXPECT_NEAR(up.x, 0, 1e-12);
      const auto turned = on_compliant_pads({0, 0, 50}, 0, loss, t);
      EXPECT_NEAR(turned.angle - 0.3, oscillation(std::sqrt(1e5 * 5e-5 / 5e-4), loss, 50, t), 1e-8);
    }
}

/// However hand and object are turned, and whichever law says how far the pads give.
TEST(PadComplianceTruth, AnObjectThatHasBeenHeldForLongStaysWhereItIs) {
  contact::ContactParameters<double> p;
  p.patch = {0.8, 0.01};
  p.variation.compliance = 1e-5;
  p.variation.loss_time = 1e-3;
  for (const char* law : {"limit_surface", "limit_surface_disc", "limit_surface_quartic"})
    for (const double turned : {0.0, 0.8, -2.3})
      for (const double across : {0.0, 0.02}) {
        const auto model = contact::make_contact_model(law, p);
        const auto hand =
            release::PolynomialHand::segments(0, {0.2, 0.1, turned}, {0.4, -0.3, 0}, {{0.2, {3, -2, 0}}});
        const support::ConstantForce force(1e4);
        const release::ReleaseProblem<double> problem{
            hand, force, *model, {0.2, 5e-4}, {0, -9.81}, {0.1, 0.3, across}, 0, {}, 0};
        const auto result =
            simulate_release(problem, {.integrator = {.tolerances = {1e-10, 1e-12}, .record = true}});
        const auto y = contact::Relative<double>::from(result.trajectory.at(0.15));
        EXPECT_NEAR(y.angle, 0.3, 1e-12)
            << law << ": in steady acceleration nothing moves: the pads carry the load already";
        EXPECT_NEAR(y.arm.x, 0.1, 1e-12) << law << ' ' << turned;
        EXPECT_NEAR(y.arm.z, across, 1e-12) << law << ' ' << turned;
        const auto sample = sample_release(problem, result, 0.15);
        EXPECT_NEAR(sample.wrench.fx, 0.2 * 3, 1e-9) << law << ' ' << turned;
        EXPECT_NEAR(sample.wrench.fz, 0.2 * (9.81 - 2), 1e-9) << law << ' ' << turned;
      }
}

TEST(PadComplianceTruth, AnObjectHeldOffItsCentreSwingsAboutThePads) {
  const double l = 0.16, w = std::sqrt(1e5 * 5e-5 / (5e-4 + 0.2 * l * l));
  for (const double loss : {0.0, 2e-3})
    for (const double periods : {0.3, 0.8, 1.4}) {
      const double t = periods * 2 * M_PI / w;
      // the patch gives too, which adds (ρ/l)² = 0.2 % to the compliance
      EXPECT_NEAR(on_compliant_pads({0, 0, 2}, l, loss, t).angle - 0.3, oscillation(w, loss, 2, t),
                  0.02 * 2 / (w * w));
    }
}

TEST(PadComplianceTruth, HoldsNothingBackOnceItSlips) {
  // The stiffer the pads, the nearer to the rigid law.
  std::mt19937_64 random(74);
  for (int i = 0; i < 3; ++i) {
    const auto thrown = support::random_throw(random, 0);
    const auto rigid = detach("limit_surface", thrown, FrictionVariation<double>{}, 1e-9);
    double error[2];
    for (int k = 0; k < 2; ++k) {
      FrictionVariation<double> v;
      v.compliance = k == 0 ? 1e-6 : 1e-8;
      v.loss_time = 2e-3;
      const auto soft = detach("limit_surface", thrown, v, 1e-9);
      error[k] = std::abs(soft.state[5] - rigid.state[5]);
    }
    EXPECT_LT(error[1], 0.1 * error[0] + 1e-6) << error[0] << ' ' << error[1];
  }
}

TEST(AdhesiveForce, AddsToTheForceAndDiesWithinThePartingTime) {
  const contact::ProfileNormalForce base(contact::OpeningProfile<double>{0.02, 20, 0.005, 0.04, 1.3});
  const double release = 0.065, parting = 0.008;
  const contact::AdhesiveForce sticky(base, dynamics::independent(1.5, 0), dynamics::independent(parting, 1));
  const contact::Window held{0, release}, dying{release, release + parting}, gone{release + parting, 1};
  EXPECT_DOUBLE_EQ(sticky.release_time(), release + parting);
  EXPECT_DOUBLE_EQ(sticky.at(held, 0.01), 21.5);
  EXPECT_DOUBLE_EQ(sticky.at(held, 0.05), base.at(held, 0.05) + 1.5);
  EXPECT_NEAR(sticky.at(held, release), sticky.at(dying, release), 1e-12) << "continuous as the pads part";
  EXPECT_NEAR(sticky.at(dying, release + 0.25 * parting), 1.5 * 0.75, 1e-12);
  EXPECT_NEAR(sticky.at(dying, release + parting), 0, 1e-12);
  EXPECT_EQ(sticky.at(gone, release + 2 * parting), 0);
  const auto kinks = sticky.NormalForce::kinks();
  EXPECT_EQ(kinks.size(), base.NormalForce::kinks().size() + 1);
  EXPECT_DOUBLE_EQ(kinks.back(), release + parting);
  Dual at_release;
  contact::force_release(sticky, at_release);
  EXPECT_EQ(at_release.a, sticky.release_time());
  EXPECT_EQ(at_release.v[1], 1) << "moves with the parting time";
  const Dual f = sticky.at(dying, Dual(release + 0.25 * parting));
  EXPECT_NEAR(f.v[0], 0.75, 1e-12);
  EXPECT_NEAR(f.v[1], 1.5 * 0.25 / parting, 1e-9);
  EXPECT_THROW(contact::AdhesiveForce(base, Dual(-1), Dual(parting)), std::invalid_argument);
  EXPECT_THROW(contact::AdhesiveForce(base, Dual(1), Dual(0)), std::invalid_argument);
}

/// A force whose last kink is told by another sum than its release, `off` [s] apart.
class RoundedForce final : public contact::NormalForce {
 public:
  RoundedForce(const Dual& dead_time, double off)
      : base_(contact::OpeningProfile<Dual>{0.02, Dual(20.0), dead_time, Dual(0.04), Dual(1.3)}), off_(off) {}
  double at(const contact::Window& w, double t) const override { return base_.at(w, t); }
  Dual at(const contact::Window& w, const Dual& t) const override { return base_.at(w, t); }
  void kinks(std::vector<double>& out) const override { base_.kinks(out), out.back() += off_; }
  void kinks(std::vector<Dual>& out) const override { base_.kinks(out), out.back().a += off_; }
  double release_time() const override { return base_.release_time(); }

 private:
  contact::ProfileNormalForce base_;
  double off_;
};

TEST(ForceRelease, IsTheLastKinkWhateverRoundingSays) {
  for (const double off : {0.0, 1e-17, -1e-17, 9e-10, -9e-10, 2e-9}) {
    const RoundedForce force(dynamics::independent(0.005, 0), off);
    Dual t;
    contact::force_release(force, t);
    EXPECT_NEAR(t.a, force.release_time(), contact::kSameInstant);
    EXPECT_EQ(t.v[0], std::abs(off) <= contact::kSameInstant ? 1 : 0) << off;
  }
}

TEST(ContactEffectParameters, OutOfRangeAreNamed) {
  contact::ContactParameters<double> p;
  p.patch = {0.5, 0.01};
  const auto message = [&](auto change) {
    auto q = p;
    change(q.variation);
    return support::refusal([&] { contact::make_contact_model("limit_surface", q); });
  };
  EXPECT_NE(message([](auto& v) { v.static_ratio = 9; }).find("contact.stribeck.mu_s/mu_k = 9"),
            std::string::npos);
  EXPECT_NE(message([](auto& v) { v.stribeck_speed = 0; }).find("v_s"), std::string::npos);
  EXPECT_NE(message([](auto& v) { v.viscous = -2; }).find("1/v_0"), std::string::npos);
  EXPECT_NE(message([](auto& v) { v.softness = 3; }).find("gamma"), std::string::npos);
  EXPECT_NE(message([](auto& v) { v.softness = 0.3; }).find("f_0 = 0"), std::string::npos);
  EXPECT_NE(message([](auto& v) { v.compliance = -1; }).find("compliance"), std::string::npos);
  EXPECT_NE(message([](auto& v) {
              v.compliance = 1e-15;
            }).find("contact.pad_compliance.compliance = 1e-15 is not 0 or in [1e-10, 0.001] m/N"),
            std::string::npos);
}

/// What validate() accepts is what the table says, parameter by parameter.
TEST(ContactEffectParameters, HaveTheRangesOfTheTable) {
  std::size_t i = 0;
  for (const auto& [effect, apply, apply_dual] : contact::friction_effects())
    for (const auto& p : effect.parameters) {
      const auto accepts = [&](double value) {
        FrictionVariation<Dual> v;
        v.reference_force = 20;
        *contact::effect_values(v)[i] = Dual(value);
        EXPECT_EQ(*contact::effect_values(v)[i], Dual(value));
        const std::string answer = support::refusal([&] { contact::validate(v); });
        EXPECT_THAT(answer, testing::AnyOf("accepted", testing::StartsWith(effect.full_name(p) + " = ")));
        return answer == "accepted";
      };
      const double low = p.least.value_or(p.low), beyond = 0.01 * (p.high - low);
      EXPECT_TRUE(accepts(low) && accepts(p.neutral) && accepts(p.high)) << effect.full_name(p);
      EXPECT_FALSE(accepts(low - beyond) || accepts(p.high + beyond)) << effect.full_name(p);
      if (p.smallest) {
        EXPECT_TRUE(accepts(*p.smallest)) << effect.full_name(p);
        EXPECT_FALSE(accepts(p.neutral + 0.99 * (*p.smallest - p.neutral))) << effect.full_name(p);
      }
      // the same parameter as the effect sets
      FrictionVariation<double> set;
      const std::vector<std::string> name{effect.full_name(p)};
      const std::vector<double> value{p.high};
      const dynamics::Values<double> values(name, value);
      apply({effect, values}, set);
      EXPECT_EQ(*contact::effect_values(set)[i], p.high) << effect.full_name(p);
      ++i;
    }
  FrictionVariation<double> v;
  EXPECT_EQ(i, contact::effect_values(v).size());
}

}  // namespace
}  // namespace unhand
