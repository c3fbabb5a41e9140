// What the report says beside an answer that the loop found in free flights: its other names, the sizes by
// those names, and what else speaks for it or against it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <utility>

#include "fitting/measured/rest_heights.hpp"
#include "flight/quaternion.hpp"
#include "tests/fitting/flight_findings.hpp"
#include "tests/support/spatial_flights.hpp"

namespace unhand::fitting {
namespace {

using support::expect_value;
using support::found_in_flights;
using support::under_any_name;
using unhand::test::spatial_flights;
using unhand::test::SpatialDesign;
using unhand::test::SpatialTruth;

/// A scale, a clock and gravity are one answer with three names.
void expect_three_names(const MeasuredDiscovery& found) {
  ASSERT_EQ(found.effects.size(), 1U);
  for (const char* id : {"sensor.length_scale", "sensor.time_scale", "flight.gravity"})
    EXPECT_NE(under_any_name(found, id), nullptr) << id;
  for (const auto& [id, correlation] : found.effects.front().equivalent) EXPECT_GE(correlation, 0.98) << id;
}

TEST(FlightEvidence, GravityIsAlsoAScaleAndAClock) {
  expect_three_names(found_in_flights(spatial_flights({.gravity_ratio = 0.015}, {}, 6)));
}

// The clock enters squared: read as gravity, its error counts twice.
TEST(FlightEvidence, AClockIsAlsoAScaleAndAGravityAsUncertainByEveryName) {
  const auto log = spatial_flights({.time_scale = -0.0075}, {}, 6);
  const auto found_as_scale = found_in_flights(log);
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
             clock = read_as_gravity(found_in_flights(log, {"sensor.length_scale", "flight.gravity"}),
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
TEST(FlightEvidence, TheSizeOfADragIsToldByEveryNameOfAClock) {
  SpatialDesign design;
  design.speed = 5;
  const SpatialTruth truth{.drag = 0.05, .time_scale = 0.01};
  const auto found = found_in_flights(spatial_flights(truth, design, 61));
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

TEST(FlightEvidence, ADeclaredDragThatIsTooLargeIsSaidToBe) {
  const auto told = [](double declared) {
    auto log = spatial_flights({.drag = 0.05}, {}, 66);
    log.objects.at("body").drag_k = declared;
    const auto found = found_in_flights(log);
    for (const auto& e : found.evidence)
      if (const auto at = e.text.find("ask for "); e.text.find("is that too large?") != std::string::npos)
        return std::stod(e.text.substr(at + 8));
    return 0.0;
  };
  EXPECT_EQ(told(0.05), 0);
  EXPECT_NEAR(told(0.08), 0.03, 0.003);
}

// The last two frames of every flight are after the bounce, as one that is cut by a clock may be.
TEST(FlightEvidence, FramesAfterTheEndOfTheFlightAreSaidToBeWhereItFails) {
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
    for (const auto& e : found_in_flights(log).evidence)
      if (e.text.starts_with("Without the ")) out += e.text;
    return out;
  };
  EXPECT_EQ(told(0, true), "");
  EXPECT_THAT(told(2, true), testing::StartsWith("Without the last 4 frames"));
  EXPECT_THAT(told(3, false), testing::StartsWith("Without the first 4 frames"));
}

// Boxes that come to rest at the height of their size say that the tracker's scale is right. The same holds
// for whatever else names the parameter: a card's covariance, what halves of the flights say.
TEST(FlightEvidence, AScaleThatBoxesAtRestRefuteIsGravityByEveryName) {
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
  const auto found = found_in_flights(log);
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

}  // namespace
}  // namespace unhand::fitting
