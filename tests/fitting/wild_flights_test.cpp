// Free flights, or frames of them, that err as no other does: the loop sets them aside, and says so.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "fitting/measured/effect_search.hpp"
#include "fitting/measured/flight_discovery.hpp"
#include "fitting/measured/wild_groups.hpp"
#include "tests/fitting/flight_findings.hpp"
#include "tests/support/spatial_flights.hpp"

namespace unhand::fitting {
namespace {

using support::expect_value;
using support::found_in_flights;
using unhand::test::spatial_flights;
using unhand::test::SpatialDesign;

TEST(WildFlights, AFlightWithAGlitchDoesNotSpeakForTheOthers) {
  auto log = spatial_flights({.drag = 0.03}, {}, 9);
  auto& pose = log.throws[3].mocap->pose;
  for (std::size_t i = 20; i < 28; ++i) pose.data[7 * i + 2] += 0.02;  // the tracker took another marker
  const auto found = found_in_flights(log);
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
TEST(WildFlights, AWildFlightIsSetAsideAndNamed) {
  SpatialDesign design;
  design.flights = 25;
  const auto clean = spatial_flights({.drag = 0.005}, design, 61), null = spatial_flights({}, design, 62);
  const int held_out = found_in_flights(clean).test;
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
      const auto found = found_in_flights(log);
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
      const auto nothing = found_in_flights(log);
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
TEST(WildFlights, AGrossFlightNearTheOthersCostsNoSecondSearch) {
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
TEST(WildFlights, AFewFlightsThatErrMoreDoNotTakeBackWhatAllOthersShow) {
  auto log = spatial_flights({.length_scale = -0.008}, {}, 64);
  for (const std::size_t k : {3U, 12U, 21U, 34U, 37U}) pull_by(0.055, log.throws[k]);
  const auto found = found_in_flights(log);
  EXPECT_TRUE(found.skipped.empty());
  EXPECT_EQ(found.verdict, Verdict::effect_found);
  expect_value(found, "sensor.length_scale", "scale", 0.992);
}

// Half of the flights, or every seventh, are no strays.
TEST(WildFlights, ManyWildFlightsAreUnexplained) {
  SpatialDesign design;
  design.flights = 25;
  for (const std::size_t every : {2U, 7U})
    for (const double drag : {0.0, 0.03}) {
      auto log = spatial_flights({.drag = drag}, design, 63);
      for (std::size_t k = 0; k < log.throws.size(); k += every) jump(log.throws[k]);
      const auto found = found_in_flights(log);
      EXPECT_TRUE(found.skipped.empty()) << every;
      EXPECT_EQ(found.verdict, Verdict::unexplained) << every;
    }
}

// A few fast throws among slow ones show a drag by so much more that they seem wild without it.
TEST(WildFlights, FlightsThatShowMoreThanTheOthersAreNotWild) {
  SpatialDesign slow, fast;
  slow.flights = 36, slow.speed = 0.5;
  fast.flights = 2, fast.speed = 6;
  auto log = spatial_flights({.drag = 0.02}, slow, 64);
  for (auto& one : spatial_flights({.drag = 0.02}, fast, 65).throws) {
    one.id = "fast-" + one.id;
    log.throws.push_back(std::move(one));
  }
  const auto found = found_in_flights(log);
  EXPECT_TRUE(found.skipped.empty()) << found.skipped.front().first;
  expect_value(found, "flight.quadratic_drag", "k[body]", 0.02);
}

// The search itself weighs a wild held-out flight down, where none is set aside: it does not veto what the
// others show.
TEST(WildFlights, AWildHeldOutFlightDoesNotVetoWhatTheOthersShow) {
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

// A tracker that is elsewhere for single frames is neither an effect nor a misfit.
TEST(WildFlights, SingleGlitchedFramesAreNoMisfit) {
  auto log = spatial_flights({}, {}, 46);
  int glitches = 0;
  for (std::size_t k = 0; k < log.throws.size(); k += 3, ++glitches)
    log.throws[k].mocap->pose(10 + k % 20, k % 2) += k % 4 < 2 ? 0.02 : -0.01;
  log.throws[9].mocap->pose(0, 2) += 0.02, ++glitches;  // the first frame, too
  const auto found = found_in_flights(log);
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  EXPECT_TRUE(std::any_of(found.evidence.begin(), found.evidence.end(), [&](const Evidence& e) {
    return e.text.starts_with(std::to_string(glitches) + " frames");
  }));
}

// Where no sigma is declared the noise is read off the samples: a frame that is out by a thousand sigmas is
// no part of it, and hides nothing.
TEST(WildFlights, AGlitchedFrameIsNoPartOfAnUndeclaredNoise) {
  auto log = spatial_flights({.drag = 0.005}, {}, 47);
  const double sigma = log.throws.front().mocap->pose.sigma.front();
  for (auto& one : log.throws) one.mocap->pose.sigma.clear();
  log.throws[4].mocap->pose(12, 0) += 1000 * sigma;
  const auto found = found_in_flights(log);
  expect_value(found, "flight.quadratic_drag", "k[body]", 0.005);
  for (const auto& m : found.misfit) EXPECT_NEAR(m.after_train, 1, 0.3) << m.channel;
}

}  // namespace
}  // namespace unhand::fitting
