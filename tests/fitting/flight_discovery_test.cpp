// The loop on synthetic free flights in space whose missing effect is known.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <random>
#include <utility>

#include "datasets/import_cube_tosses.hpp"
#include "experiment/free_flight.hpp"
#include "fitting/measured/effect_search.hpp"
#include "fitting/measured/flight_discovery.hpp"
#include "fitting/measured/measured_discovery.hpp"
#include "tests/fitting/flight_findings.hpp"
#include "tests/support/data_folder.hpp"
#include "tests/support/spatial_flights.hpp"

namespace unhand::fitting {
namespace {

using support::expect_value;
using support::found_in_flights;
using support::under_any_name;
using unhand::test::spatial_flights;
using unhand::test::SpatialDesign;
using unhand::test::SpatialTruth;

TEST(FlightDiscovery, NothingIsFoundWhereNothingIsMissing) {
  const auto found = found_in_flights(spatial_flights({}, {}, 1));
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  EXPECT_TRUE(found.effects.empty()) << found.effects.front().id;
  EXPECT_FALSE(found.first.any);
  // The start takes 6 of 120 numbers; 8 flights of 40 samples scatter by √(2/320) = 0.08: four of them.
  for (const auto& m : found.misfit) EXPECT_NEAR(m.before_test, 0.95, 0.32) << m.channel;
  for (const auto& a : found.autocorrelation_before) EXPECT_LT(std::abs(a.z), 4) << a.channel;
}

TEST(FlightDiscovery, ErrorsBeforeAreThoseOfTheComparison) {
  // An odd number of samples, at times that are rounded as files round them: the middle one is of the first
  // half however it was rounded.
  SpatialDesign design;
  design.samples = 11;
  design.rate = 120;
  SpatialTruth truth;
  truth.drag = 0.03;
  auto log = spatial_flights(truth, design, 3);
  for (auto& one : log.throws)
    for (double& t : one.mocap->time.data) t = 1e-5 * std::round(1e5 * t);
  const auto found = found_in_flights(log);
  const auto expected = experiment::compare_free_flights(log, 1);
  const auto value = [&](const NamedErrors& errors, const char* name) {
    for (const auto& [key, x] : errors)
      if (key == name) return x;
    ADD_FAILURE() << name;
    return 0.0;
  };
  const std::pair<const NamedErrors*, const experiment::FreeFlightStatistics*> halves[] = {
      {&found.before_train, &expected.train}, {&found.before_test, &expected.test}};
  for (const auto& [errors, same] : halves) {
    EXPECT_NEAR(value(*errors, "trajectory_rms_m"), same->trajectory_rms_m, 1e-9);
    EXPECT_NEAR(value(*errors, "end_position_mae_m"), same->end_position_error_m.mean, 1e-9);
    EXPECT_NEAR(value(*errors, "end_position_median_m"), same->end_position_error_m.median, 1e-9);
    EXPECT_NEAR(value(*errors, "end_orientation_mae_deg"), same->end_orientation_error_deg.mean, 1e-6);
  }
}

struct FlightCase {
  const char* name;
  SpatialTruth truth;
  std::vector<std::tuple<std::string, std::string, double>> expected;
};

class EveryFlightEffect : public testing::TestWithParam<FlightCase> {};

TEST_P(EveryFlightEffect, IsFoundWithItsSize) {
  const auto found = found_in_flights(spatial_flights(GetParam().truth, {}, 5));
  EXPECT_EQ(found.verdict, Verdict::effect_found);
  for (const auto& [id, name, value] : GetParam().expected) expect_value(found, id, name, value);
  EXPECT_LE(found.effects.size(), GetParam().expected.size()) << "no more than is there";
  EXPECT_FALSE(found.unexplained.has_value()) << found.unexplained->description;
  EXPECT_TRUE(found.first.any);
  ASSERT_FALSE(found.effects.empty());
  if (found.effects.size() > 1) return;
  // Alone, an effect's footprint and the noise make up the residual in every channel, all the way.
  ASSERT_FALSE(found.footprints.empty());
  EXPECT_EQ(found.footprints.front().id, found.effects.front().id);
  const auto& would = found.footprints.front().profile;
  ASSERT_EQ(would.size(), found.profile_before.size());
  double off = 0, noise_alone = 0;
  for (std::size_t k = 0; k < would.size(); ++k) {
    const double left = found.profile_before[k].rms;
    off += std::abs(std::log(std::hypot(1.0, would[k].rms) / left)) / static_cast<double>(would.size());
    noise_alone += std::abs(std::log(left)) / static_cast<double>(would.size());
  }
  EXPECT_LT(off, 0.1);
  EXPECT_GT(noise_alone, 2 * off);
}

std::vector<FlightCase> cases() {
  std::vector<FlightCase> out;
  const auto with = [&](const char* name, auto set, auto expected) {
    FlightCase c{name, {}, expected};
    set(c.truth);
    out.push_back(c);
  };
  using Expected = std::vector<std::tuple<std::string, std::string, double>>;
  with(
      "Drag", [](SpatialTruth& t) { t.drag = 0.03; }, Expected{{"flight.quadratic_drag", "k[body]", 0.03}});
  with(
      "Lift", [](SpatialTruth& t) { t.lift = 0.01; }, Expected{{"flight.magnus_lift", "k_m[body]", 0.01}});
  with(
      "Tilt",
      [](SpatialTruth& t) {
        t.tilt_x = 0.02;
        t.tilt_y = -0.01;
      },
      Expected{{"flight.gravity_tilt", "toward_x", 0.02}, {"flight.gravity_tilt", "toward_y", -0.01}});
  with(
      "Scale", [](SpatialTruth& t) { t.length_scale = -0.02; },
      Expected{{"sensor.length_scale", "scale", 1 - 0.02}});
  with(
      "Com",
      [](SpatialTruth& t) {
        t.com = {0, 0.002, 0.005};
      },
      Expected{{"sensor.com_offset", "z[body]", 0.005}, {"sensor.com_offset", "y[body]", 0.002}});
  with(
      "SpinDamping", [](SpatialTruth& t) { t.spin_damping = 0.2; },
      Expected{{"flight.spin_damping", "c[body]", 0.2}});
  with(
      "CubicDrag", [](SpatialTruth& t) { t.cubic_drag = 0.15; },
      Expected{{"flight.cubic_drag", "kappa[body]", 0.15}});
  with(
      "DragByAxis",
      [](SpatialTruth& t) {
        t.drag = 0.06, t.axis_drag = {0.05, -0.02, -0.03};  // along no axis does the air push
      },
      Expected{{"flight.quadratic_drag", "k[body]", 0.06},
               {"flight.drag_by_axis", "a_x[body]", 0.05},
               {"flight.drag_by_axis", "a_y[body]", -0.02}});
  with(
      "Inertia",
      [](SpatialTruth& t) {
        t.inertia = {1, 1.1, 0.95};
      },
      Expected{{"sensor.inertia", "ratio_y[body]", 1.1}, {"sensor.inertia", "ratio_z[body]", 0.95}});
  with(
      "ScaleAndComAndDrag",
      [](SpatialTruth& t) {
        t.length_scale = -0.018, t.com = {0, 0, 0.005}, t.drag = 0.04;
      },
      Expected{{"sensor.length_scale", "scale", 1 - 0.018},
               {"sensor.com_offset", "z[body]", 0.005},
               {"flight.quadratic_drag", "k[body]", 0.04}});
  return out;
}
INSTANTIATE_TEST_SUITE_P(Flights, EveryFlightEffect, testing::ValuesIn(cases()),
                         [](const auto& one) { return std::string(one.param.name); });

TEST(FlightDiscovery, FiveHeldOutFlightsOfNoiseDoNotHideWhatTheyShow) {
  // Ten sigma of a spin damping in twenty flights; five of them show it with four or five.
  SpatialTruth truth;
  truth.spin_damping = 0.02;
  SpatialDesign design;
  design.flights = 25;
  int found_it = 0;
  for (unsigned seed = 701; seed < 709; ++seed) {
    const auto found = found_in_flights(spatial_flights(truth, design, seed));
    if (found.effects.empty()) continue;
    EXPECT_EQ(found.effects.size(), 1U);
    expect_value(found, "flight.spin_damping", "c[body]", 0.02);
    ++found_it;
  }
  EXPECT_GE(found_it, 6);
}

// Five held-out flights confirm neither alone: each is the other's noise, of ten times the tracker's.
TEST(FlightDiscovery, TwoEffectsThatHideEachOtherAreBothFound) {
  SpatialDesign design;
  design.flights = 25;
  for (const auto& [truth, seed] :
       {std::pair(SpatialTruth{.lift = 0.0217, .com = {0, 0, 0.00377}}, 5002U),
        std::pair(SpatialTruth{.linear_drag = 0.037, .com = {0, 0, 0.0019}}, 5071U)}) {
    const auto found = found_in_flights(spatial_flights(truth, design, seed));
    EXPECT_EQ(found.effects.size(), 2U);
    EXPECT_FALSE(found.unexplained.has_value());
    expect_value(found, "sensor.com_offset", "z[body]", truth.com.z());
    if (truth.lift > 0)
      expect_value(found, "flight.magnus_lift", "k_m[body]", truth.lift);
    else
      expect_value(found, "flight.linear_drag", "c[body]", truth.linear_drag);
  }
}

TEST(FlightDiscovery, ADragThatPushesAlongADiagonalIsSaidToBeNone) {
  // A harmonic of the drag without a drag to shape: what is listed has that form, air does not.
  SpatialDesign design;
  design.flights = 25;
  const auto speaks = [&](double drag) {
    SpatialTruth truth;
    truth.cubic_drag = 0.15;
    truth.drag = drag;
    const auto found = found_in_flights(spatial_flights(truth, design, 5));
    expect_value(found, "flight.cubic_drag", "kappa[body]", 0.15);
    return std::any_of(found.evidence.begin(), found.evidence.end(),
                       [](const Evidence& e) { return e.about == "flight.cubic_drag" && e.against; });
  };
  EXPECT_TRUE(speaks(0));
  EXPECT_FALSE(speaks(0.1));
}

// A drag by v³ goes by the name of one by v², the nearest that is listed: its form is said not to be
// confirmed.
TEST(FlightDiscovery, ADragOfAnotherFormIsNotConfirmed) {
  const auto says = [](const SpatialTruth& truth, unsigned seed, const char* form, const char* name) {
    const auto found = found_in_flights(spatial_flights(truth, {}, seed));
    EXPECT_NE(under_any_name(found, name), nullptr) << seed;
    return std::any_of(found.evidence.begin(), found.evidence.end(), [&](const Evidence& e) {
      return e.against && e.text.starts_with("Its form is not confirmed") &&
             e.text.find(form) != std::string::npos;
    });
  };
  int wrong = 0;
  for (unsigned seed = 71; seed < 75; ++seed) {
    EXPECT_TRUE(says({.third_power = 0.01}, seed, "grows faster than v²", "flight.quadratic_drag")) << seed;
    wrong += says({.drag = 0.03}, seed, "", "flight.quadratic_drag") +
             says({.linear_drag = 0.1}, seed, "", "flight.linear_drag");
  }
  EXPECT_LE(wrong, 2);  // designed: 2 % of eight; more than two have a chance of 4e-4
}

// Five held-out flights, which spin about different axes: an inertia that is off by 6 % takes most of the
// misfit of each away, and from one ten times what it takes from another.
TEST(FlightDiscovery, FlightsThatShowAnEffectUnequallyDoNotHideIt) {
  SpatialTruth truth;
  truth.inertia = {1, 1.06, 1};
  SpatialDesign design;
  design.flights = 25;
  for (const unsigned seed : {2U, 3U}) {
    const auto found = found_in_flights(spatial_flights(truth, design, seed));
    SCOPED_TRACE(seed);
    expect_value(found, "sensor.inertia", "ratio_y[body]", 1.06);
  }
}

// Half a sigma of a slow error lies in the declared noise: χ² does not show it, neighbours do.
TEST(FlightDiscovery, ASlowErrorBelowTheDeclaredNoiseIsUnexplained) {
  SpatialDesign design;
  design.flights = 200;
  const auto with = [&](double size) {
    auto log = spatial_flights({}, design, 62);
    std::mt19937_64 random(63);
    std::normal_distribution<double> normal;
    for (auto& one : log.throws) {
      double slow = 0;
      for (std::size_t i = 0; i < one.mocap->time.rows; ++i) {
        slow = 0.8 * slow + 0.6 * normal(random);
        one.mocap->pose.data[7 * i + 1] += size * design.sigma * slow;
      }
    }
    return found_in_flights(log);
  };
  EXPECT_EQ(with(0).verdict, Verdict::no_missing_effect);
  const auto found = with(0.6);
  for (const auto& m : found.misfit) EXPECT_LT(m.after_test, MeasuredOptions{}.unexplained) << m.channel;
  ASSERT_EQ(found.verdict, Verdict::unexplained);
  EXPECT_EQ(found.unexplained->channel, "position_y");
}

// Four train flights say nothing of three parameters together, but enough of the one that is off.
TEST(FlightDiscovery, FiveFlightsShowACentreOfMassThatIsOff) {
  SpatialDesign design;
  design.flights = 5;
  const auto found = found_in_flights(spatial_flights({.com = {0, 0, 0.01}}, design, 64));
  ASSERT_NE(under_any_name(found, "sensor.com_offset"), nullptr);
  for (const auto& p : under_any_name(found, "sensor.com_offset")->parameters)
    if (p.name == "z[body]") {
      EXPECT_NEAR(p.value, 0.01, 1e-3);
    }
}

// Gravity, the scale or the clock may be far off: the declared gravity here is another planet's.
TEST(FlightDiscovery, AGravityThatIsFarOffIsFoundWithItsSize) {
  auto log = spatial_flights({.drag = 0.03}, {}, 51);
  log.gravity = 7.5;
  const auto found = found_in_flights(log);
  ASSERT_NE(under_any_name(found, "flight.gravity"), nullptr);
  EXPECT_EQ(under_any_name(found, "flight.gravity"), under_any_name(found, "sensor.length_scale"));
  expect_value(found, "sensor.length_scale", "scale", 9.81 / 7.5);
  // Poses that a scale enlarges hide a drag that is larger by as much.
  const bool enlarged = under_any_name(found, "flight.gravity")->id == "sensor.length_scale";
  expect_value(found, "flight.quadratic_drag", "k[body]", 0.03 * (enlarged ? 9.81 / 7.5 : 1));
  EXPECT_EQ(found.effects.size(), 2U);
}

// A vertical that leans by more than the catalogue has: no name that comes near is an answer.
TEST(FlightDiscovery, WhatEndsAtTheEndOfItsRangeIsNotNamed) {
  const auto found = found_in_flights(spatial_flights({.tilt_x = 0.9}, {}, 52));
  EXPECT_EQ(under_any_name(found, "flight.gravity_tilt"), nullptr);
  EXPECT_EQ(found.verdict, Verdict::unexplained)
      << (found.effects.empty() ? "" : found.effects.front().id.c_str());
  EXPECT_TRUE(found.unexplained.has_value());
}

TEST(FlightDiscovery, WhatTheCatalogueForgotIsNotCalledByAnotherName) {
  const auto found = found_in_flights(spatial_flights({.lift = 0.03}, {}, 7), {"flight.magnus_lift"});
  EXPECT_EQ(under_any_name(found, "flight.magnus_lift"), nullptr);
  ASSERT_TRUE(found.unexplained.has_value()) << to_string(found.verdict);
  EXPECT_EQ(found.unexplained->phase, "flight");
  EXPECT_THAT(found.unexplained->channel, testing::HasSubstr("position"));
}

TEST(FlightDiscovery, AForceThatNobodyListedIsUnexplained) {
  const auto found = found_in_flights(spatial_flights({.side_force = 0.5}, {}, 8));
  ASSERT_TRUE(found.unexplained.has_value());
  EXPECT_THAT(found.unexplained->description, testing::HasSubstr("neighbouring residuals correlate"));
}

TEST(FlightDiscovery, FalseAlarmsAreAsRareAsDesigned) {
  // Designed at 2 %: of 20 nulls more than three have a chance of 6e-4.
  SpatialDesign design;
  design.flights = 25;
  design.samples = 25;
  int alarms = 0;
  for (unsigned seed = 100; seed < 120; ++seed)
    alarms += found_in_flights(spatial_flights({}, design, seed)).effects.empty() ? 0 : 1;
  EXPECT_LE(alarms, 3);
}

TEST(FlightProblem, DerivativesAreThoseOfTheResidual) {
  SpatialDesign design;
  design.flights = 1;
  const auto log = spatial_flights({.com = {0.001, 0.002, 0.003}}, design, 10);
  const FlightProblem problem(log, 1);
  std::vector<std::string> names;
  std::vector<double> values;
  for (const auto& effect : problem.effects())
    for (const auto& p : shared_parameters(effect, {"body"}))
      names.push_back(p.name), values.push_back(p.neutral + 0.3 * p.typical);
  const auto& start = problem.groups()[0].start;
  const Eigen::VectorXd own =
      Eigen::Map<const Eigen::VectorXd>(start.data(), static_cast<Eigen::Index>(start.size()));
  const auto e = problem.equations(0, names, values, own, Derivatives::all);
  ASSERT_TRUE(e.solved);
  for (std::size_t k = 0; k < names.size(); ++k) {
    double best = 1;
    for (const double h : {1e-3, 1e-4, 1e-5}) {
      auto low = values, high = values;
      low[k] -= h, high[k] += h;
      const Eigen::VectorXd difference = (problem.equations(0, names, high, own, Derivatives::none).residual -
                                          problem.equations(0, names, low, own, Derivatives::none).residual) /
                                         (2 * h);
      const auto column = e.shared.col(static_cast<Eigen::Index>(k));
      best = std::min(best, (difference - column).norm() / std::max(1.0, column.norm()));
    }
    // The integrator is good to 1e-8 m, that is 1e-4 σ, which the difference divides by a step of 1e-3 or
    // less.
    EXPECT_LT(best, 1e-4) << names[k];
  }
}

// Air that moves acts through a drag, whether it was declared or has been found.
TEST(FlightDiscovery, AWindIsFoundThroughADragThatWasFound) {
  SpatialTruth truth;
  truth.drag = 0.1, truth.wind = {1.5, -0.5, 0};
  const auto found = found_in_flights(spatial_flights(truth, {}, 43));
  expect_value(found, "flight.quadratic_drag", "k[body]", 0.1);
  expect_value(found, "flight.wind", "w_x", 1.5);
  expect_value(found, "flight.wind", "w_y", -0.5);
  EXPECT_EQ(found.effects.size(), 2U);
  EXPECT_FALSE(found.unexplained.has_value()) << found.unexplained->description;
}

// Of slow bodies the air's own speed is most of what the drag sees: the drag alone explains so little that no
// held-out flight shows it, a vertical that leans explains more, and both of them together all.
TEST(FlightDiscovery, ADragIsFoundTogetherWithItsWind) {
  SpatialDesign slow;
  slow.speed = 1;
  SpatialTruth truth;
  truth.drag = 0.1, truth.wind = {2, 0, 0};
  for (const unsigned seed : {47U, 48U}) {
    const auto found = found_in_flights(spatial_flights(truth, slow, seed));
    expect_value(found, "flight.quadratic_drag", "k[body]", 0.1);
    expect_value(found, "flight.wind", "w_x", 2);
    EXPECT_EQ(found.effects.size(), 2U);
    EXPECT_FALSE(found.unexplained.has_value()) << found.unexplained->description;
  }
}

/// Counts the flights of which footprints are asked of a wind and of no other candidate.
class AskedOfWind final : public GroupedProblem {
 public:
  explicit AskedOfWind(const FlightProblem& of) : asked(of.groups().size()), of_(of) {
    groups_ = of.groups(), channels_ = of.channels(), covariates_ = of.covariates();
  }
  std::vector<dynamics::Effect> effects() const override { return of_.effects(); }
  GroupEquations equations(std::size_t group, std::span<const std::string> names,
                           std::span<const double> values, const Eigen::VectorXd& own,
                           Derivatives derivatives) const override {
    bool wind = false, spin = false;  // a step asks of the spin's damping, too
    for (const auto& name : names)
      wind |= name.starts_with("flight.wind."), spin |= name.starts_with("flight.spin_damping.");
    if (wind && !spin && derivatives == Derivatives::all) asked[group] = true;
    return of_.equations(group, names, values, own, derivatives);
  }
  mutable std::vector<std::atomic<bool>> asked;

 private:
  const FlightProblem& of_;
};

// Whether a candidate makes room for a wind is told by few flights: most candidates do not, and nobody wants
// to wait until all flights have said so.
TEST(FlightDiscovery, FewFlightsAreAskedWhatACandidateMakesRoomFor) {
  SpatialTruth truth;
  truth.length_scale = 0.01, truth.com = {0.003, 0, 0}, truth.inertia = {1, 1.1, 1}, truth.side_force = 0.1;
  const FlightProblem flights(spatial_flights(truth, {}, 50), 1);
  const AskedOfWind problem(flights);
  ASSERT_TRUE(search_effects(problem, {}).solved);
  const auto asked = std::count(problem.asked.begin(), problem.asked.end(), true);
  EXPECT_GT(asked, 0);
  EXPECT_LT(asked, static_cast<long>(flights.groups().size()) / 2);
}

// A centre of mass off the tracked point turns with the body, and no wind does.
TEST(FlightDiscovery, AWindIsNoOtherNameOfWhatTurnsWithTheBody) {
  SpatialTruth truth;
  truth.linear_drag = 0.2, truth.length_scale = 0.01, truth.com = {0.001, 0, 0.002};
  SpatialDesign design;
  design.flights = 25;
  const auto found = found_in_flights(spatial_flights(truth, design, 49));
  bool com = false;
  for (const auto& effect : found.effects) {
    if (effect.id != "sensor.com_offset") continue;
    com = true;
    for (const auto& [other, r] : effect.equivalent) EXPECT_NE(other, "flight.wind") << r;
  }
  EXPECT_TRUE(com);
}

// Two held-out flights cannot say how much they scatter; those that were fitted can.
TEST(FlightDiscovery, TwoHeldOutFlightsAreEnoughForALargeEffect) {
  SpatialDesign few;
  few.flights = 10;
  expect_value(found_in_flights(spatial_flights({.drag = 0.1}, few, 44)), "flight.quadratic_drag", "k[body]",
               0.1);
  EXPECT_EQ(found_in_flights(spatial_flights({}, few, 45)).verdict, Verdict::no_missing_effect);
}

TEST(FlightDiscovery, MeasuredCubeTosses) {
  const auto [csv, missing] = unhand::support::from_data_folder("measured/cube_tosses/cube_tosses.csv");
  if (!missing.empty()) GTEST_SKIP() << missing;
  auto log = datasets::import_cube_tosses(csv);
  // A third of the tosses says the same in a third of the time.
  std::vector<datasets::Throw> some;
  for (std::size_t k = 0; k < log.throws.size(); k += 3) some.push_back(log.throws[k]);
  log.throws = some;
  const auto found = found_in_flights(log);
  ASSERT_NE(under_any_name(found, "sensor.length_scale"), nullptr);
  EXPECT_NE(under_any_name(found, "flight.gravity"), nullptr) << "flights alone cannot tell them apart";
  ASSERT_NE(under_any_name(found, "sensor.com_offset"), nullptr);
  // The box at rest says the same of the scale as the flights, and it is no part of them.
  EXPECT_TRUE(std::any_of(found.evidence.begin(), found.evidence.end(), [](const Evidence& e) {
    return e.about == "sensor.length_scale" &&
           e.text.find("not gravity and not the clock") != std::string::npos;
  }));
  const auto value = [](const NamedErrors& errors, const std::string& name) {
    for (const auto& [key, x] : errors)
      if (key == name) return x;
    return 0.0;
  };
  EXPECT_LT(value(found.after_test, "end_position_mae_m"),
            0.75 * value(found.before_test, "end_position_mae_m"));
}

}  // namespace
}  // namespace unhand::fitting
