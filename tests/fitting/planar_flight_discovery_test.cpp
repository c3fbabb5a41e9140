// The loop on synthetic free flights in a plane, flown by another formula, whose missing effect is known.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "fitting/measured/measured_discovery.hpp"

namespace unhand::fitting {
namespace {

constexpr double kPlanarGravity = 9.81;

/// What is true of the synthetic flights and not declared.
struct PlanarTruth {
  double drag = 0, lift = 0, tilt = 0, scale = 1, clock = 1, wind = 0, declared_drag = 0;
  double com_x = 0, com_z = 0;                                     // true − tracked, body axes [m]
  std::function<std::array<double, 2>(double, double)> push = {};  // unlisted acceleration of (x, z) [m/s²]
};

using PlanarState = std::array<double, 4>;  // x, z, vx, vz

PlanarState planar_rate(const PlanarTruth& truth, const PlanarState& s, double omega) {
  const double ux = s[2] - truth.wind, uz = s[3], k = (truth.drag + truth.declared_drag) * std::hypot(ux, uz);
  const auto push = truth.push ? truth.push(s[0], s[1]) : std::array<double, 2>{};
  return {s[2], s[3], kPlanarGravity * std::sin(truth.tilt) - k * ux - truth.lift * omega * uz + push[0],
          -kPlanarGravity * std::cos(truth.tilt) - k * uz + truth.lift * omega * ux + push[1]};
}

/// Thirty tosses of 0.5 s, tracked at 100 Hz to 0.2 mm and 2 mrad; by the classical Runge-Kutta formula,
/// which the library does not use.
datasets::ThrowLog planar_flights(const PlanarTruth& truth, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  datasets::ThrowLog log;
  log.dimension = 2, log.gravity = kPlanarGravity;
  log.objects["bar"].mass = 0.2;
  if (truth.declared_drag > 0) log.objects["bar"].drag_k = truth.declared_drag;
  for (int i = 0; i < 30; ++i) {
    auto& one = log.throws.emplace_back();
    one.id = std::to_string(100 + i), one.object = "bar", one.condition = "toss", one.repetition = i;
    one.split = i % 3 == 2 ? datasets::Split::test : datasets::Split::train;
    auto& mocap = one.mocap.emplace();
    PlanarState s{0.1 * uniform(random), 1, 2 + 1.5 * uniform(random), 3 + uniform(random)};
    const double theta = uniform(random), omega = 8 * uniform(random), step = 1e-3;
    for (int j = 0; j <= 500; ++j) {
      const double t = step * j, turned = theta + omega * t;
      if (j % 10 == 0) {
        const double c = std::cos(turned), n = std::sin(turned);
        mocap.time.data.push_back(truth.clock * t);
        mocap.pose.data.insert(
            mocap.pose.data.end(),
            {truth.scale * (s[0] - c * truth.com_x + n * truth.com_z) + 2e-4 * normal(random),
             truth.scale * (s[1] - n * truth.com_x - c * truth.com_z) + 2e-4 * normal(random),
             turned + 2e-3 * normal(random)});
      }
      const auto ahead = [&](const PlanarState& d, double h) {
        PlanarState out = s;
        for (std::size_t a = 0; a < 4; ++a) out[a] += h * d[a];
        return out;
      };
      const PlanarState k1 = planar_rate(truth, s, omega),
                        k2 = planar_rate(truth, ahead(k1, step / 2), omega),
                        k3 = planar_rate(truth, ahead(k2, step / 2), omega),
                        k4 = planar_rate(truth, ahead(k3, step), omega);
      for (std::size_t a = 0; a < 4; ++a) s[a] += step / 6 * (k1[a] + 2 * k2[a] + 2 * k3[a] + k4[a]);
    }
    mocap.time.rows = mocap.pose.rows = mocap.time.data.size();
    mocap.pose.cols = 3, mocap.pose.sigma = {2e-4, 2e-4, 2e-3};
  }
  return log;
}

MeasuredDiscovery found_in_plane(const PlanarTruth& truth, unsigned seed) {
  return discover_flights(planar_flights(truth, seed), {});
}

TEST(PlanarFlightDiscovery, NothingIsFoundWhereNothingIsMissing) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const auto found = found_in_plane({}, seed);
    EXPECT_EQ(found.verdict, Verdict::no_missing_effect) << seed;
    ASSERT_EQ(found.misfit.size(), 3U);
    for (const auto& m : found.misfit) EXPECT_NEAR(m.before_test, 0.97, 0.2) << m.channel;
  }
}

/// What is true of a parameter that an effect has.
struct PlanarSize {
  std::string effect, parameter;
  double value;
};

struct PlanarCase {
  const char* name;
  PlanarTruth truth;
  std::vector<PlanarSize> sizes;  // of the effect, or of each name that it may go by
};

/// A tracker's scale, its clock and gravity are one: poses scaled by s fall s times as fast, and a clock that
/// counts c seconds in one sees gravity as c⁻² of what it is.
std::vector<PlanarSize> names_of_scale(double scale) {
  return {{"sensor.length_scale", "scale", scale},
          {"flight.gravity", "ratio", scale},
          {"sensor.time_scale", "scale", 1 / std::sqrt(scale)}};
}

class PlanarFlights : public testing::TestWithParam<PlanarCase> {};
INSTANTIATE_TEST_SUITE_P(
    , PlanarFlights,
    testing::Values(PlanarCase{"Drag", {.drag = 0.06}, {{"flight.quadratic_drag", "k[bar]", 0.06}}},
                    PlanarCase{"Lift", {.lift = 0.01}, {{"flight.magnus_lift", "k_m", 0.01}}},
                    PlanarCase{"Tilt", {.tilt = 0.02}, {{"flight.gravity_tilt", "toward_x", 0.02}}},
                    PlanarCase{"Wind", {.wind = 1.5, .declared_drag = 0.1}, {{"flight.wind", "w_x", 1.5}}},
                    PlanarCase{"Scale", {.scale = 1.01}, names_of_scale(1.01)},
                    PlanarCase{"Clock", {.clock = 1.01}, names_of_scale(std::pow(1.01, -2))},
                    PlanarCase{
                        "Com",
                        {.com_x = 4e-3, .com_z = 1e-3},
                        {{"sensor.com_offset", "x[bar]", 4e-3}, {"sensor.com_offset", "z[bar]", 1e-3}}}),
    [](const auto& made) { return std::string(made.param.name); });

TEST_P(PlanarFlights, TheMissingEffectIsFoundWithItsSize) {
  const auto& made = GetParam();
  const auto found = found_in_plane(made.truth, 5);
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  ASSERT_EQ(found.effects.size(), 1U) << found.effects.back().id;
  const AcceptedEffect& effect = found.effects.front();
  int sized = 0;
  for (const PlanarSize& size : made.sizes) {
    if (effect.id != size.effect) {  // another name of what was found
      EXPECT_TRUE(std::any_of(effect.equivalent.begin(), effect.equivalent.end(),
                              [&](const auto& other) { return other.first == size.effect; }))
          << effect.id << " is not " << size.effect;
      continue;
    }
    const auto p = std::find_if(effect.parameters.begin(), effect.parameters.end(),
                                [&](const Parameter& q) { return q.name.starts_with(size.parameter); });
    ASSERT_NE(p, effect.parameters.end()) << size.parameter;
    const double neutral = size.parameter == "scale" || size.parameter == "ratio" ? 1 : 0;
    EXPECT_NEAR(p->value, size.value, 4 * p->sigma) << p->name;
    EXPECT_LT(p->sigma, 0.25 * std::abs(size.value - neutral)) << p->name;
    ++sized;
  }
  EXPECT_GT(sized, 0) << effect.id;
  for (const auto& m : found.misfit) EXPECT_LT(m.after_test, 1.3) << m.channel;
  for (const auto& r : found.ranking) {  // beside the base model, or beside the effect that was found
    EXPECT_LE(r.step, 2) << r.id;
    if (r.id == effect.id) {
      EXPECT_EQ(r.step, 1);
    }
  }
  EXPECT_LT(found.after_test.front().second, found.before_test.front().second);
}

TEST(PlanarFlightDiscovery, AForceThatNobodyListedIsUnexplained) {
  PlanarTruth truth;
  truth.push = [](double x, double) { return std::array<double, 2>{0, 2 * std::sin(12 * x)}; };
  const auto found = found_in_plane(truth, 6);
  ASSERT_TRUE(found.unexplained);
  EXPECT_EQ(found.unexplained->channel, "position_z");
}

}  // namespace
}  // namespace unhand::fitting
