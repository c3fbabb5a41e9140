// The loop on synthetic free flights in space whose missing effect is known.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <random>
#include <utility>

#include "datasets/import_cube_tosses.hpp"
#include "experiment/free_flight.hpp"
#include "fitting/measured/effect_search.hpp"
#include "fitting/measured/flight_discovery.hpp"
#include "fitting/measured/measured_discovery.hpp"
#include "fitting/measured/rest_heights.hpp"
#include "fitting/measured/wild_groups.hpp"
#include "flight/quaternion.hpp"
#include "tests/support/data_folder.hpp"
#include "tests/support/spatial_flights.hpp"

namespace unhand::fitting {
namespace {

using unhand::test::spatial_flights;
using unhand::test::SpatialDesign;
using unhand::test::SpatialTruth;

MeasuredDiscovery found_in(const datasets::ThrowLog& log, std::vector<std::string> forget = {}) {
  MeasuredOptions options;
  options.search.forget = std::move(forget);
  return discover_flights(log, options);
}

const AcceptedEffect* named(const MeasuredDiscovery& found, const std::string& id) {
  for (const auto& e : found.effects) {
    if (e.id == id) return &e;
    for (const auto& [other, correlation] : e.equivalent)
      if (other == id) return &e;
  }
  return nullptr;
}

/// The parameter of an effect that was found, within four of its own sigmas: one in 16,000 is farther off.
void expect_value(const MeasuredDiscovery& found, const std::string& id, const std::string& name,
                  double truth) {
  const AcceptedEffect* effect = named(found, id);
  ASSERT_NE(effect, nullptr) << id << " was not found";
  const auto p = std::find_if(effect->parameters.begin(), effect->parameters.end(),
                              [&](const Parameter& q) { return q.name == name; });
  ASSERT_NE(p, effect->parameters.end()) << effect->id << " has no " << name;
  EXPECT_NEAR(p->value, truth, 4 * p->sigma) << effect->id << '.' << name;
  const double neutral = name == "scale" || name.starts_with("ratio") ? 1 : 0;
  EXPECT_LT(p->sigma, 0.5 * std::max(std::abs(truth - neutral), 1e-3))
      << "it was found, so its interval excludes its absence";
}

TEST(FlightDiscovery, NothingIsFoundWhereNothingIsMissing) {
  const auto found = found_in(spatial_flights({}, {}, 1));
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
  const auto found = found_in(log);
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
  const auto found = found_in(spatial_flights(GetParam().truth, {}, 5));
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
    const auto found = found_in(spatial_flights(truth, design, seed));
    if (found.effects.empty()) continue;
    EXPECT_EQ(found.effects.size(), 1U);
    expect_value(found, "flight.spin_damping", "c[body]", 0.02);
    ++found_it;
  }
  EXPECT_GE(found_it, 6);
}

TEST(FlightDiscovery, ADragThatPushesAlongADiagonalIsSaidToBeNone) {
  // A harmonic of the drag without a drag to shape: what is listed has that form, air does not.
  SpatialDesign design;
  design.flights = 25;
  const auto speaks = [&](double drag) {
    SpatialTruth truth;
    truth.cubic_drag = 0.15;
    truth.drag = drag;
    const auto found = found_in(spatial_flights(truth, design, 5));
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
    const auto found = found_in(spatial_flights(truth, {}, seed));
    EXPECT_NE(named(found, name), nullptr) << seed;
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
    const auto found = found_in(spatial_flights(truth, design, seed));
    SCOPED_TRACE(seed);
    expect_value(found, "sensor.inertia", "ratio_y[body]", 1.06);
  }
}

/// A scale, a clock and gravity are one answer with three names.
void expect_three_names(const MeasuredDiscovery& found) {
  ASSERT_EQ(found.effects.size(), 1U);
  for (const char* id : {"sensor.length_scale", "sensor.time_scale", "flight.gravity"})
    EXPECT_NE(named(found, id), nullptr) << id;
  for (const auto& [id, correlation] : found.effects.front().equivalent) EXPECT_GE(correlation, 0.98) << id;
}

TEST(FlightDiscovery, GravityIsAlsoAScaleAndAClock) {
  expect_three_names(found_in(spatial_flights({.gravity_ratio = 0.015}, {}, 6)));
}

// The clock enters squared: read as gravity, its error counts twice.
TEST(FlightDiscovery, AClockIsAlsoAScaleAndAGravityAsUncertainByEveryName) {
  const auto log = spatial_flights({.time_scale = -0.0075}, {}, 6);
  const auto found_as_scale = found_in(log);
  expect_three_names(found_as_scale);
  const auto read_as_gravity = [](const MeasuredDiscovery& found, const std::string& id) {
    double value = 0, sigma = 0;
    for (const auto& e : found.evidence)
      if (e.about == id)
        std::sscanf(e.text.c_str(), "Read as gravity, the flights say %lf ± %lf", &value, &sigma);
    EXPECT_GT(sigma, 0) << id;
    return std::pair(value, sigma);
  };
  const auto scale = read_as_gravity(found_as_scale, "sensor.length_scale"),
             clock = read_as_gravity(found_in(log, {"sensor.length_scale", "flight.gravity"}),
                                     "sensor.time_scale");
  EXPECT_NEAR(scale.first, 9.81 * std::pow(1 - 0.0075, -2), 4 * scale.second);
  EXPECT_NEAR(clock.first, scale.first, 0.3 * scale.second);
  EXPECT_NEAR(clock.second, scale.second, 0.1 * scale.second);  // printed to 1e-4 m/s²
}

/// The size that evidence gives a parameter beside `on`: "... k[body] = 0.0500 ± 1.5e-05 1/m, not 0.0490".
double size_beside(const MeasuredDiscovery& found, const std::string& about, const std::string& on,
                   const std::string& parameter) {
  for (const auto& e : found.evidence)
    if (const auto at = e.text.find(parameter + " = ");
        e.about == about && e.against && e.text.starts_with(on + " ") && at != std::string::npos)
      return std::stod(e.text.substr(at + parameter.size() + 3));
  return std::nan("");
}

// A drag is one per metre: with a clock that is off under the name of a scale, it is off by as much.
TEST(FlightDiscovery, TheSizeOfADragIsToldByEveryNameOfAClock) {
  SpatialDesign design;
  design.speed = 5;
  const SpatialTruth truth{.drag = 0.05, .time_scale = 0.01};
  const auto found = found_in(spatial_flights(truth, design, 61));
  const auto accepted = [&](const std::string& id) {
    return std::find_if(found.effects.begin(), found.effects.end(),
                        [&](const auto& e) { return e.id == id; });
  };
  ASSERT_NE(accepted("sensor.length_scale"), found.effects.end()) << "the name that is listed first";
  ASSERT_NE(accepted("flight.quadratic_drag"), found.effects.end());
  for (const char* on : {"sensor.time_scale", "flight.gravity"})
    EXPECT_NEAR(size_beside(found, "flight.quadratic_drag", on, "k[body]"), 0.05, 2e-4) << on;
  const auto& k = accepted("flight.quadratic_drag")->parameters.front();
  EXPECT_GT(std::abs(k.value - 0.05), 4 * k.sigma) << "else there is nothing to tell";
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
    return found_in(log);
  };
  EXPECT_EQ(with(0).verdict, Verdict::no_missing_effect);
  const auto found = with(0.6);
  for (const auto& m : found.misfit) EXPECT_LT(m.after_test, MeasuredOptions{}.unexplained) << m.channel;
  ASSERT_EQ(found.verdict, Verdict::unexplained);
  EXPECT_EQ(found.unexplained->channel, "position_y");
}

TEST(FlightDiscovery, ADeclaredDragThatIsTooLargeIsSaidToBe) {
  const auto told = [](double declared) {
    auto log = spatial_flights({.drag = 0.05}, {}, 66);
    log.objects.at("body").drag_k = declared;
    const auto found = found_in(log);
    for (const auto& e : found.evidence)
      if (const auto at = e.text.find("ask for "); e.text.find("is that too large?") != std::string::npos)
        return std::stod(e.text.substr(at + 8));
    return 0.0;
  };
  EXPECT_EQ(told(0.05), 0);
  EXPECT_NEAR(told(0.08), 0.03, 0.003);
}

// The last two frames of every flight are after the bounce, as one that is cut by a clock may be.
TEST(FlightDiscovery, FramesAfterTheEndOfTheFlightAreSaidToBeWhereItFails) {
  const auto told = [](int frames, bool at_the_end) {
    SpatialDesign design;
    design.flights = 15, design.samples = 25;
    auto log = spatial_flights({.drag = 0.03}, design, 65);
    for (auto& one : log.throws)
      for (int k = 0; k < frames; ++k) {
        const std::size_t n = one.mocap->time.rows,
                          i = at_the_end ? n - 1 - static_cast<std::size_t>(k) : static_cast<std::size_t>(k);
        one.mocap->pose.data[7 * i + 2] += 0.03 * (frames - k);  // 4 m/s
      }
    std::string out;
    for (const auto& e : found_in(log).evidence)
      if (e.text.starts_with("Without the ")) out += e.text;
    return out;
  };
  EXPECT_EQ(told(0, true), "");
  EXPECT_THAT(told(2, true), testing::StartsWith("Without the last 4 frames"));
  EXPECT_THAT(told(2, false), testing::StartsWith("Without the first 4 frames"));
}

// Four train flights say nothing of three parameters together, but enough of the one that is off.
TEST(FlightDiscovery, FiveFlightsShowACentreOfMassThatIsOff) {
  SpatialDesign design;
  design.flights = 5;
  const auto found = found_in(spatial_flights({.com = {0, 0, 0.01}}, design, 64));
  ASSERT_NE(named(found, "sensor.com_offset"), nullptr);
  for (const auto& p : named(found, "sensor.com_offset")->parameters)
    if (p.name == "z[body]") {
      EXPECT_NEAR(p.value, 0.01, 1e-3);
    }
}

// Gravity, the scale or the clock may be far off: the declared gravity here is another planet's.
TEST(FlightDiscovery, AGravityThatIsFarOffIsFoundWithItsSize) {
  auto log = spatial_flights({.drag = 0.03}, {}, 51);
  log.gravity = 7.5;
  const auto found = found_in(log);
  ASSERT_NE(named(found, "flight.gravity"), nullptr);
  EXPECT_EQ(named(found, "flight.gravity"), named(found, "sensor.length_scale"));
  expect_value(found, "sensor.length_scale", "scale", 9.81 / 7.5);
  // Poses that a scale enlarges hide a drag that is larger by as much.
  const bool enlarged = named(found, "flight.gravity")->id == "sensor.length_scale";
  expect_value(found, "flight.quadratic_drag", "k[body]", 0.03 * (enlarged ? 9.81 / 7.5 : 1));
  EXPECT_EQ(found.effects.size(), 2U);
}

// A vertical that leans by more than the catalogue has: no name that comes near is an answer.
TEST(FlightDiscovery, WhatEndsAtTheEndOfItsRangeIsNotNamed) {
  const auto found = found_in(spatial_flights({.tilt_x = 0.9}, {}, 52));
  EXPECT_EQ(named(found, "flight.gravity_tilt"), nullptr);
  EXPECT_EQ(found.verdict, Verdict::unexplained)
      << (found.effects.empty() ? "" : found.effects.front().id.c_str());
  EXPECT_TRUE(found.unexplained.has_value());
}

TEST(FlightDiscovery, WhatTheCatalogueForgotIsNotCalledByAnotherName) {
  const auto found = found_in(spatial_flights({.lift = 0.03}, {}, 7), {"flight.magnus_lift"});
  EXPECT_EQ(named(found, "flight.magnus_lift"), nullptr);
  ASSERT_TRUE(found.unexplained.has_value()) << to_string(found.verdict);
  EXPECT_EQ(found.unexplained->phase, "flight");
  EXPECT_THAT(found.unexplained->channel, testing::HasSubstr("position"));
}

TEST(FlightDiscovery, AForceThatNobodyListedIsUnexplained) {
  const auto found = found_in(spatial_flights({.side_force = 0.5}, {}, 8));
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
    alarms += found_in(spatial_flights({}, design, seed)).effects.empty() ? 0 : 1;
  EXPECT_LE(alarms, 3);
}

TEST(FlightDiscovery, AFlightWithAGlitchDoesNotSpeakForTheOthers) {
  auto log = spatial_flights({.drag = 0.03}, {}, 9);
  auto& pose = log.throws[3].mocap->pose;
  for (std::size_t i = 20; i < 28; ++i) pose.data[7 * i + 2] += 0.02;  // the tracker took another marker
  const auto found = found_in(log);
  expect_value(found, "flight.quadratic_drag", "k[body]", 0.03);
}

/// The tracker took another marker from the middle of a flight on.
void jump(datasets::Throw& one) {
  auto& pose = one.mocap->pose;
  for (std::size_t i = pose.rows / 2; i < pose.rows; ++i) {
    pose.data[7 * i] += 0.05;
    pose.data[7 * i + 1] -= 0.03;
    pose.data[7 * i + 2] += 0.04;
  }
}

/// Something pulled at a flight all along, by `share` of (3, 0, 2) m/s².
void pull_by(double share, datasets::Throw& one) {
  auto& pose = one.mocap->pose;
  const double begin = one.mocap->time(0);
  for (std::size_t i = 0; i < pose.rows; ++i) {
    pose.data[7 * i] += share * 1.5 * std::pow(one.mocap->time(i) - begin, 2);
    pose.data[7 * i + 2] += share * std::pow(one.mocap->time(i) - begin, 2);
  }
}
void pull(datasets::Throw& one) { pull_by(1, one); }

bool is_set_aside(const MeasuredDiscovery& found, const std::string& id) {
  return std::any_of(found.skipped.begin(), found.skipped.end(),
                     [&](const auto& one) { return one.first == id && one.second.starts_with("set aside"); });
}

// A throw that errs as no other does hides neither an effect nor that there is none, fitted or held out.
TEST(FlightDiscovery, AWildFlightIsSetAsideAndNamed) {
  SpatialDesign design;
  design.flights = 25;
  const auto clean = spatial_flights({.drag = 0.005}, design, 61), null = spatial_flights({}, design, 62);
  const int held_out = found_in(clean).test;
  const auto of_split = [&](datasets::Split split) {
    for (std::size_t k = 4; k < clean.throws.size(); ++k)
      if (clean.throws[k].split == split) return k;
    return clean.throws.size();
  };
  for (const auto split : {datasets::Split::train, datasets::Split::test})
    for (const auto& spoil : {jump, pull}) {
      const std::size_t k = of_split(split);
      auto log = clean;
      spoil(log.throws[k]);
      const auto found = found_in(log);
      EXPECT_TRUE(is_set_aside(found, log.throws[k].id));
      EXPECT_EQ(found.train + found.test, 24);
      EXPECT_EQ(found.test, held_out) << "another one is held out in its place";
      EXPECT_EQ(found.effects.size(), 1U);
      expect_value(found, "flight.quadratic_drag", "k[body]", 0.005);
      EXPECT_FALSE(found.unexplained.has_value());
      EXPECT_TRUE(std::any_of(found.evidence.begin(), found.evidence.end(), [&](const Evidence& e) {
        return e.text.find("set aside") != std::string::npos &&
               e.text.find(log.throws[k].id) != std::string::npos;
      }));
      log = null;
      spoil(log.throws[k]);
      const auto nothing = found_in(log);
      EXPECT_EQ(nothing.verdict, Verdict::no_missing_effect);
      EXPECT_TRUE(is_set_aside(nothing, log.throws[k].id));
    }
}

/// Flights, and how often their equations are asked for.
class CountedFlights final : public GroupedProblem {
 public:
  explicit CountedFlights(const datasets::ThrowLog& log) : flights_(log, 1) {
    groups_ = flights_.groups();
    channels_ = flights_.channels();
    covariates_ = flights_.covariates();
  }
  std::vector<dynamics::Effect> effects() const override { return flights_.effects(); }
  GroupEquations equations(std::size_t group, std::span<const std::string> names,
                           std::span<const double> values, const Eigen::VectorXd& own,
                           Derivatives derivatives) const override {
    ++asked;
    return flights_.equations(group, names, values, own, derivatives);
  }
  mutable int asked{};

 private:
  FlightProblem flights_;
};

// A flight that errs grossly, but little more than another does, takes part from the start: it is not set
// aside and taken back after a whole search, which then runs again.
TEST(FlightDiscovery, AGrossFlightNearTheOthersCostsNoSecondSearch) {
  SpatialDesign design;
  design.flights = 25;
  auto log = spatial_flights({.drag = 0.03, .lift = 0.02, .tilt_x = 0.01, .com = {0, 0, 0.003}}, design, 61);
  pull_by(0.1, log.throws[5]);
  pull_by(0.06, log.throws[9]);
  MeasuredOptions options;
  options.search.fit.threads = 1;
  CountedFlights flights(log);
  const auto wild = wild_groups(flights, flights.effects(), options.search.fit);
  ASSERT_EQ(wild.size(), 1U);
  EXPECT_EQ(wild[0].group, 5U);
  EXPECT_LT(wild[0].apart, options.search.fit.group_limit);
  flights.asked = 0;
  search_effects(flights, options.search);
  const int one_search = std::exchange(flights.asked, 0);
  MeasuredDiscovery found;
  run_search(flights, options, found);
  EXPECT_TRUE(found.skipped.empty());
  // A quarter more, for judging it and for the report; a second search would be one and a quarter more.
  EXPECT_LT(flights.asked, 1.7 * one_search);
}

// Not so far off that they are set aside, but what is left of them is most of what is left.
TEST(FlightDiscovery, AFewFlightsThatErrMoreDoNotTakeBackWhatAllOthersShow) {
  auto log = spatial_flights({.length_scale = -0.008}, {}, 64);
  for (const std::size_t k : {3U, 12U, 21U, 34U, 37U}) pull_by(0.055, log.throws[k]);
  const auto found = found_in(log);
  EXPECT_TRUE(found.skipped.empty());
  EXPECT_EQ(found.verdict, Verdict::effect_found);
  expect_value(found, "sensor.length_scale", "scale", 0.992);
}

// Half of the flights, or every seventh, are no strays.
TEST(FlightDiscovery, ManyWildFlightsAreUnexplained) {
  SpatialDesign design;
  design.flights = 25;
  for (const std::size_t every : {2U, 7U})
    for (const double drag : {0.0, 0.03}) {
      auto log = spatial_flights({.drag = drag}, design, 63);
      for (std::size_t k = 0; k < log.throws.size(); k += every) jump(log.throws[k]);
      const auto found = found_in(log);
      EXPECT_TRUE(found.skipped.empty()) << every;
      EXPECT_EQ(found.verdict, Verdict::unexplained) << every;
    }
}

// A few fast throws among slow ones show a drag by so much more that they seem wild without it.
TEST(FlightDiscovery, FlightsThatShowMoreThanTheOthersAreNotWild) {
  SpatialDesign slow, fast;
  slow.flights = 36, slow.speed = 0.5;
  fast.flights = 2, fast.speed = 6;
  auto log = spatial_flights({.drag = 0.02}, slow, 64);
  for (auto& one : spatial_flights({.drag = 0.02}, fast, 65).throws) {
    one.id = "fast-" + one.id;
    log.throws.push_back(std::move(one));
  }
  const auto found = found_in(log);
  EXPECT_TRUE(found.skipped.empty()) << found.skipped.front().first;
  expect_value(found, "flight.quadratic_drag", "k[body]", 0.02);
}

// The search itself weighs a wild held-out flight down, where none is set aside: it does not veto what the
// others show.
TEST(FlightDiscovery, AWildHeldOutFlightDoesNotVetoWhatTheOthersShow) {
  auto log = spatial_flights({.drag = 0.03}, {}, 66);
  const auto wild = std::find_if(log.throws.begin(), log.throws.end(), [](const datasets::Throw& one) {
    return one.split == datasets::Split::test;
  });
  jump(*wild);
  const FlightProblem problem(log, 1);
  const auto found = search_effects(problem, {});
  ASSERT_EQ(found.effects.size(), 1U);
  EXPECT_EQ(found.effects.front().id, "flight.quadratic_drag");
  EXPECT_NEAR(found.effects.front().parameters.front().value, 0.03, 0.001);
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

// Boxes that come to rest at the height of their size say that the tracker's scale is right. The same holds
// for whatever else names the parameter: a card's covariance, what halves of the flights say.
TEST(FlightDiscovery, AScaleThatBoxesAtRestRefuteIsGravityByEveryName) {
  auto log = spatial_flights({.gravity_ratio = 0.02}, {}, 41);
  constexpr double side = 0.06;
  log.objects.at("body").dims = {side, side, side};
  std::size_t n = 0;
  for (auto& one : log.throws) {  // on each of the faces in turn
    constexpr double h = 0.70710678118654752;
    constexpr double faces[6][4] = {{1, 0, 0, 0},  {0, 1, 0, 0}, {h, h, 0, 0},
                                    {h, -h, 0, 0}, {h, 0, h, 0}, {h, 0, -h, 0}};
    const auto& q = faces[n++ % 6];
    auto& mocap = *one.mocap;
    for (int i = 0; i < 8; ++i) {
      mocap.time.data.push_back(mocap.time.data.back() + 0.01);
      const double noise = (i % 2 == 0 ? 1e-5 : -1e-5) + 1e-6 * static_cast<double>(n % 5);
      mocap.pose.data.insert(mocap.pose.data.end(), {1, 1, side / 2 + noise, q[0], q[1], q[2], q[3]});
    }
    mocap.time.rows = mocap.pose.rows = mocap.time.data.size();
  }
  const auto found = found_in(log);
  expect_value(found, "flight.gravity", "ratio", 1.02);
  ASSERT_FALSE(found.effects.empty());
  EXPECT_EQ(found.effects.front().id, "flight.gravity");
  EXPECT_EQ(found.parameters, std::vector<std::string>{"flight.gravity.ratio"});
  EXPECT_FALSE(found.stability.empty());
  for (const Stability& s : found.stability) EXPECT_EQ(s.parameter, "flight.gravity.ratio");
}

// Boxes stop on their faces, whichever way they are turned about the vertical; read from the world to the
// body, few of them do.
TEST(RestHeights, AttitudesOfAnotherConventionLeaveBoxesOnNoFace) {
  auto log = spatial_flights({}, {}, 42);
  log.objects.at("body").dims = {0.06, 0.06, 0.06};
  std::mt19937_64 random(43);
  std::uniform_real_distribution<double> half_turn(-3, 3);
  const double quarter = 1.5707963267948966;
  int n = 0;
  for (auto& one : log.throws) {
    const flight::Vec3<double> axes[] = {{0, 0, 0},        {2 * quarter, 0, 0}, {quarter, 0, 0},
                                         {-quarter, 0, 0}, {0, quarter, 0},     {0, -quarter, 0}};
    const auto q = flight::exp(flight::Vec3<double>{0, 0, half_turn(random)}) * flight::exp(axes[n++ % 6]);
    for (int i = 0; i < 8; ++i) {
      one.mocap->time.data.push_back(one.mocap->time.data.back() + 0.01);
      one.mocap->pose.data.insert(one.mocap->pose.data.end(), {1, 1, 0.03, q.w, q.x, q.y, q.z});
    }
    one.mocap->time.rows = one.mocap->pose.rows = one.mocap->time.data.size();
  }
  EXPECT_EQ(rests_on_faces(log).still, static_cast<int>(log.throws.size()));
  EXPECT_EQ(rests_on_faces(log).on_face, static_cast<int>(log.throws.size()));
  EXPECT_FALSE(rests_on_faces(log).is_doubtful());
  for (auto& one : log.throws)
    for (std::size_t i = 0; i < one.mocap->pose.rows; ++i)
      for (std::size_t j = 4; j < 7; ++j) one.mocap->pose.data[7 * i + j] *= -1;
  EXPECT_TRUE(rests_on_faces(log).is_doubtful()) << rests_on_faces(log).on_face;
}

// Air that moves acts through a drag, whether it was declared or has been found.
TEST(FlightDiscovery, AWindIsFoundThroughADragThatWasFound) {
  SpatialTruth truth;
  truth.drag = 0.1, truth.wind = {1.5, -0.5, 0};
  const auto found = found_in(spatial_flights(truth, {}, 43));
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
    const auto found = found_in(spatial_flights(truth, slow, seed));
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
  const auto found = found_in(spatial_flights(truth, design, 49));
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
  expect_value(found_in(spatial_flights({.drag = 0.1}, few, 44)), "flight.quadratic_drag", "k[body]", 0.1);
  EXPECT_EQ(found_in(spatial_flights({}, few, 45)).verdict, Verdict::no_missing_effect);
}

// A tracker that is elsewhere for single frames is neither an effect nor a misfit.
TEST(FlightDiscovery, SingleGlitchedFramesAreNoMisfit) {
  auto log = spatial_flights({}, {}, 46);
  int glitches = 0;
  for (std::size_t k = 0; k < log.throws.size(); k += 3, ++glitches)
    log.throws[k].mocap->pose(10 + k % 20, k % 2) += k % 4 < 2 ? 0.02 : -0.01;
  log.throws[9].mocap->pose(0, 2) += 0.02, ++glitches;  // the first frame, too
  const auto found = found_in(log);
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  EXPECT_TRUE(std::any_of(found.evidence.begin(), found.evidence.end(), [&](const Evidence& e) {
    return e.text.starts_with(std::to_string(glitches) + " frames");
  }));
}

// Where no sigma is declared the noise is read off the samples: a frame that is out by a thousand sigmas is
// no part of it, and hides nothing.
TEST(FlightDiscovery, AGlitchedFrameIsNoPartOfAnUndeclaredNoise) {
  auto log = spatial_flights({.drag = 0.005}, {}, 47);
  const double sigma = log.throws.front().mocap->pose.sigma.front();
  for (auto& one : log.throws) one.mocap->pose.sigma.clear();
  log.throws[4].mocap->pose(12, 0) += 1000 * sigma;
  const auto found = found_in(log);
  expect_value(found, "flight.quadratic_drag", "k[body]", 0.005);
  for (const auto& m : found.misfit) EXPECT_NEAR(m.after_train, 1, 0.3) << m.channel;
}

TEST(FlightDiscovery, MeasuredCubeTosses) {
  const auto [csv, missing] = unhand::support::from_data_folder("measured/cube_tosses/cube_tosses.csv");
  if (!missing.empty()) GTEST_SKIP() << missing;
  auto log = datasets::import_cube_tosses(csv);
  // A third of the tosses says the same in a third of the time.
  std::vector<datasets::Throw> some;
  for (std::size_t k = 0; k < log.throws.size(); k += 3) some.push_back(log.throws[k]);
  log.throws = some;
  const auto found = found_in(log);
  ASSERT_NE(named(found, "sensor.length_scale"), nullptr);
  EXPECT_NE(named(found, "flight.gravity"), nullptr) << "flights alone cannot tell them apart";
  ASSERT_NE(named(found, "sensor.com_offset"), nullptr);
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
