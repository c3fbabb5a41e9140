// Departures of the friction limits, contact effect by contact effect: neutral is the base law to the bit,
// derivatives are central differences through whole releases, and closed forms where there are any.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/effect_releases.hpp"

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
  }
};
constexpr Place kPlaces[] = {{"static_ratio", 1.3, 1, true},     {"static_ratio", 0.8, 1, false},
                             {"stribeck_speed", 0.05, 0, false}, {"viscous", 2, 0, true},
                             {"softness", 0.4, 0, true},         {"softness", -0.3, 0, false}};

TEST_P(ContactEffect, DerivativeIsTheCentralDifference) {
  constexpr double kTolerance = 1e-11;
  for (const Place& place : kPlaces) {
    std::vector<double> values{place.at};
    if (place.at_neutral) values.push_back(place.neutral);
    for (const double value : values) {
      std::mt19937_64 random(72);
      int compared = 0;
      for (int i = 0; i < 4; ++i) {
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
        for (const double h : {1e-2, 1e-3, 1e-4, 1e-5}) {
          const double step = h * std::max(0.1, std::abs(value));
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
          EXPECT_LT(best[j], 1e-5 * std::max(std::abs(exact.state[j].v[0]), 0.1))
              << place.name << " = " << value << ", state " << j << ", slope " << exact.state[j].v[0]
              << " throw " << i;
      }
      EXPECT_GE(compared, 3) << place.name << ' ' << value;
    }
  }
}

TEST_P(ContactEffect, OfTheLimitsAreSeenInTheMotion) {
  std::mt19937_64 random(73);
  const auto thrown = support::random_throw(random, 0);
  const auto base = detach(GetParam(), thrown, FrictionVariation<double>{}, 1e-9);
  for (const Place& place : kPlaces) {
    FrictionVariation<double> v;
    v.reference_force = 20;
    Place::set(place.name, place.at, v);
    const auto changed = detach(GetParam(), thrown, v, 1e-9);
    EXPECT_GT(std::abs(changed.state[5] - base.state[5]), 1e-4) << place.name;
  }
}

TEST(ContactEffectParameters, OutOfRangeAreNamed) {
  contact::ContactParameters<double> p;
  p.patch = {0.5, 0.01};
  const auto message = [&](auto change) {
    auto q = p;
    change(q.variation);
    try {
      contact::make_contact_model("limit_surface", q);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(message([](auto& v) { v.static_ratio = 9; }).find("contact.stribeck.mu_s/mu_k = 9"),
            std::string::npos);
  EXPECT_NE(message([](auto& v) { v.stribeck_speed = 0; }).find("v_s"), std::string::npos);
  EXPECT_NE(message([](auto& v) { v.viscous = -2; }).find("1/v_0"), std::string::npos);
  EXPECT_NE(message([](auto& v) { v.softness = 3; }).find("gamma"), std::string::npos);
  EXPECT_NE(message([](auto& v) { v.softness = 0.3; }).find("f_0 = 0"), std::string::npos);
  EXPECT_NE(message([](auto& v) { v.compliance = -1; }).find("compliance"), std::string::npos);
}

}  // namespace
}  // namespace unhand
