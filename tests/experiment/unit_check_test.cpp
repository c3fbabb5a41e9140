// Columns of a log in another unit are told.
#include "experiment/unit_check.hpp"

#include <fmt/core.h>
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <tuple>

#include "experiment/declared_check.hpp"
#include "experiment/random_stream.hpp"
#include "tests/support/data_folder.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::experiment {
namespace {

using datasets::Series;
using datasets::Throw;
using datasets::ThrowLog;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing_support::small_log;

constexpr double kDegree = 180 / std::numbers::pi, kGravity = 9.80665;

/// `why` matches what is said of the log.
void expect_refused(const ThrowLog& log, const testing::Matcher<std::string>& why,
                    const std::string& of = "") {
  EXPECT_THAT([&] { require_units(log, "log.h5"); }, testing::ThrowsMessage<datasets::LogError>(why)) << of;
}

/// Columns first to last − 1 times `factor`.
void scale(Series& series, double factor, std::size_t first = 0, std::size_t last = 1) {
  for (std::size_t i = 0; i < series.rows; ++i)
    for (std::size_t c = first; c < last; ++c) series(i, c) *= factor;
}

TEST(UnitCheck, TellsOfAnglesThatAreWholeTurnsOff) {
  constexpr double kTurn = 2 * std::numbers::pi;
  const auto doubt_of = [](const ThrowLog& log) {
    const auto doubts = unit_doubts(log);
    return doubts.size() == 1 ? doubts.front() : UnitDoubt{};
  };
  auto log = small_log();
  for (auto& one : log.throws) {  // wrapped half-way
    auto& pose = one.mocap->pose;
    const double cut = 0.5 * (pose(0, 2) + pose(pose.rows - 1, 2));
    for (std::size_t i = 0; i < pose.rows; ++i) pose(i, 2) -= pose(i, 2) > cut ? kTurn : 0;
  }
  auto told = doubt_of(log);
  EXPECT_EQ(told.path, "/throws/" + log.throws[0].id + "/mocap/pose") << told.reason;
  EXPECT_THAT(told.reason, AllOf(HasSubstr("a jump of 1 turn"), HasSubstr("unwrapped")));
  EXPECT_EQ(told.throws, 12);

  log = small_log();
  for (auto& one : log.throws) one.landing->pose(0, 1) -= kTurn;
  told = doubt_of(log);
  EXPECT_EQ(told.path, "/throws/" + log.throws[0].id + "/landing/pose") << told.reason;
  EXPECT_THAT(told.reason, AllOf(HasSubstr("turns from it"), HasSubstr("12 throws")));

  for (const double turns : {-1.0, 1.0, 2.0}) {  // in one throw
    log = small_log();
    log.throws[3].landing->pose(0, 1) += turns * kTurn;
    told = doubt_of(log);
    EXPECT_EQ(told.path, "/throws/" + log.throws[3].id + "/landing/pose") << told.reason;
    log = small_log();
    auto& pose = log.throws[3].hand->pose;
    for (std::size_t i = pose.rows / 2; i < pose.rows; ++i) pose(i, 2) += turns * kTurn;
    told = doubt_of(log);
    EXPECT_EQ(told.path, "/throws/" + log.throws[3].id + "/hand/pose") << told.reason;
    EXPECT_THAT(told.reason, HasSubstr("a jump of"));
  }

  log = small_log();
  log.throws[3].landing->pose(0, 1) += 0.53 * kTurn;
  EXPECT_THAT(doubt_of(log).reason, AllOf(HasSubstr("no whole turn"), Not(HasSubstr("unwrapped"))));
}

// Stamps of frames that come in bursts: between two the angle changes by its noise, within next to no time.
TEST(UnitCheck, UnevenStampsAreNoTurns) {
  auto log = small_log();
  for (auto& one : log.throws)
    for (std::size_t i = 1; i < one.mocap->time.rows; i += 2)
      one.mocap->time.data[i] = one.mocap->time(i - 1) + 1e-6;
  for (const auto& doubt : unit_doubts(log)) EXPECT_THAT(doubt.reason, Not(HasSubstr("turn"))) << doubt.path;
}

struct Mistake {
  const char* name;
  std::function<void(Throw&)> make;
  const char *path, *column, *unit;
};

// What a lab's export may do to all throws of a log alike.
const Mistake kMistakes[] = {
    {"motion capture in mm", [](Throw& t) { scale(t.mocap->pose, 1e3, 0, 2); }, "/throws/*/mocap/pose",
     "position", "mm for m"},
    {"motion capture in inches", [](Throw& t) { scale(t.mocap->pose, 1 / 0.0254, 0, 2); },
     "/throws/*/mocap/pose", "position", "inches for m"},
    {"motion capture in degrees", [](Throw& t) { scale(t.mocap->pose, kDegree, 2, 3); },
     "/throws/*/mocap/pose", "theta", "degrees for rad"},
    {"motion capture in mm and degrees",
     [](Throw& t) {
       scale(t.mocap->pose, 1e3, 0, 2);
       scale(t.mocap->pose, kDegree, 2, 3);
     },
     "/throws/*/mocap/pose", "theta", "degrees for rad"},
    {"motion capture's clock in ms", [](Throw& t) { scale(t.mocap->time, 1e3); }, "/throws/*/mocap/time",
     "time", "ms for s"},
    {"the hand's pose in mm", [](Throw& t) { scale(t.hand->pose, 1e3, 0, 2); }, "/throws/*/hand/pose",
     "position", "mm for m"},
    {"the hand's pose in degrees", [](Throw& t) { scale(t.hand->pose, kDegree, 2, 3); },
     "/throws/*/hand/pose", "theta", "degrees for rad"},
    {"the hand's twist in degrees", [](Throw& t) { scale(t.hand->twist, kDegree, 2, 3); },
     "/throws/*/hand/twist", "omega", "deg/s for rad/s"},
    {"the hand's twist in mm", [](Throw& t) { scale(t.hand->twist, 1e3, 0, 2); }, "/throws/*/hand/twist",
     "velocity", "mm/s for m/s"},
    {"the hand's acceleration in g", [](Throw& t) { scale(t.hand->acceleration, 1 / kGravity, 0, 2); },
     "/throws/*/hand/acceleration", "a", "g for m/s^2"},
    {"all of the hand in degrees",
     [](Throw& t) {
       for (auto* series : {&t.hand->pose, &t.hand->twist, &t.hand->acceleration})
         scale(*series, kDegree, 2, 3);
     },
     "/throws/*/hand/pose", "theta", "degrees for rad"},
    {"the hand's clock in ms", [](Throw& t) { scale(t.hand->time, 1e3); }, "/throws/*/hand/time", "time",
     "ms for s"},
    {"all clocks in ms",
     [](Throw& t) {
       for (auto* time : {&t.hand->time, &t.ft->time, &t.mocap->time, &t.landing->time}) scale(*time, 1e3);
     },
     "/throws/*/hand/time", "time", "ms for s"},
    {"the F/T clock in ms", [](Throw& t) { scale(t.ft->time, 1e3); }, "/throws/*/ft/time", "time",
     "ms for s"},
    {"the F/T clock said to be in ms", [](Throw& t) { scale(t.ft->time, 1e-3); }, "/throws/*/ft/time", "time",
     "s for ms"},
    {"wrenches in kgf and kgf m", [](Throw& t) { scale(t.ft->wrench, 1 / kGravity, 0, 3); },
     "/throws/*/ft/wrench", "force", "kgf for N"},
    {"forces in mN", [](Throw& t) { scale(t.ft->wrench, 1e3, 0, 2); }, "/throws/*/ft/wrench", "force",
     "mN for N"},
    {"forces in lbf", [](Throw& t) { scale(t.ft->wrench, 1 / 4.4482216, 0, 2); }, "/throws/*/ft/wrench",
     "force", "lbf for N"},
    {"torques in N mm", [](Throw& t) { scale(t.ft->wrench, 1e3, 2, 3); }, "/throws/*/ft/wrench", "tau",
     "N mm for N m"},
    {"torques in N cm", [](Throw& t) { scale(t.ft->wrench, 100, 2, 3); }, "/throws/*/ft/wrench", "tau",
     "N cm for N m"},
    {"normal force in kgf", [](Throw& t) { scale(t.ft->normal_force, 1 / kGravity); },
     "/throws/*/ft/normal_force", "f_N", "kgf"},
    {"normal force in mN", [](Throw& t) { scale(t.ft->normal_force, 1e3); }, "/throws/*/ft/normal_force",
     "f_N", "mN for N"},
    {"landings in mm", [](Throw& t) { scale(t.landing->pose, 1e3, 0, 1); }, "/throws/*/landing/pose", "x",
     "mm for m"},
    {"landings in degrees", [](Throw& t) { scale(t.landing->pose, kDegree, 1, 2); }, "/throws/*/landing/pose",
     "theta", "degrees for rad"},
    {"landings in ms", [](Throw& t) { scale(t.landing->time, 1e3); }, "/throws/*/landing/time", "time",
     "ms for s"},
};

TEST(UnitCheck, NamesTheColumnAndTheUnitOfEveryMistake) {
  for (const auto& mistake : kMistakes) {
    auto log = small_log();
    for (auto& one : log.throws) mistake.make(one);
    const auto doubts = unit_doubts(log);
    ASSERT_FALSE(doubts.empty()) << mistake.name;
    bool named = false;
    for (const auto& doubt : doubts)
      named = named || (doubt.path == mistake.path && doubt.column == mistake.column &&
                        doubt.reason.find(mistake.unit) != std::string::npos);
    EXPECT_TRUE(named) << mistake.name << ": " << doubts.front().path << ": " << doubts.front().reason;
    expect_refused(log, AllOf(HasSubstr("log.h5: /throws/*/"), HasSubstr(mistake.unit)), mistake.name);
  }
}

TEST(UnitCheck, MassesInGramsShowInTheForce) {
  auto log = small_log();
  for (auto& [name, object] : log.objects) object.mass *= 1e3;
  expect_refused(log, HasSubstr("mass in g"));
}

TEST(UnitCheck, LeversInMillimetresShowInTheDistanceOfTheObject) {
  auto log = small_log();
  for (auto& [name, object] : log.objects) *object.com_offset *= 1e3;
  expect_refused(log, AllOf(HasSubstr("/objects/*@com_offset"), HasSubstr("mm for m")));
}

TEST(UnitCheck, NoPlanetPullsWithTenThousand) {
  auto log = small_log();
  log.gravity *= 1e3;
  expect_refused(log, AllOf(HasSubstr("/@gravity"), HasSubstr("mm/s²")));
}

TEST(UnitCheck, AnAngleThatTheTrackerDoesNotSeeIsRefused) {
  auto log = small_log();
  for (auto& one : log.throws)
    for (std::size_t i = 0; i < one.mocap->pose.rows; ++i) one.mocap->pose(i, 2) = 0;
  expect_refused(log, AllOf(HasSubstr("/throws/" + log.throws[0].id + "/mocap/pose"),
                            HasSubstr("theta is 0 rad in every sample"), HasSubstr("grasp_angle")));
  // In flight alone nothing says that an object has to turn.
  for (auto& one : log.throws)
    for (std::size_t i = 0; i < one.mocap->time.rows; ++i)
      if (one.mocap->time(i) <= *log.gripper->opening_command_time + 0.1) {
        one.mocap->valid.resize(one.mocap->time.rows, 1);
        one.mocap->valid[i] = 0;
      }
  for (const auto& doubt : unit_doubts(log)) EXPECT_THAT(doubt.reason, Not(HasSubstr("in every sample")));
}

TEST(UnitCheck, AGraspAngleBeyondAWholeTurnIsInDegrees) {
  auto log = small_log();
  for (auto& one : log.throws) one.mocap.reset(), one.grasp_angle = -22;
  expect_refused(log, AllOf(HasSubstr("@grasp_angle"), HasSubstr("degrees for rad")));
}

TEST(UnitCheck, WithoutAnOpeningCommandTheForceTellsWhenItOpens) {
  auto log = small_log();
  log.gripper->opening_command_time.reset();
  EXPECT_THAT(unit_doubts(log), IsEmpty());
  for (auto& one : log.throws) scale(one.mocap->pose, kDegree, 2, 3);
  EXPECT_FALSE(unit_doubts(log).empty());
}

TEST(UnitCheck, AWrenchThatSaysNothingIsNoUnit) {
  auto log = small_log();
  for (auto& one : log.throws) scale(one.ft->wrench, 0, 0, 3);
  EXPECT_THAT(unit_doubts(log), IsEmpty());
}

TEST(UnitCheck, CampaignsInSiUnitsRaiseNoDoubt) {
  for (const auto& name : campaign_names()) {
    auto design = campaign_design(name);
    design.sensors.ft_rate = 250;
    design.sensors.mocap_rate = 120;
    for (std::uint64_t seed = 1; seed <= 2; ++seed)
      for (const auto& doubt : unit_doubts(generate_campaign(design, seed)))
        ADD_FAILURE() << name << ", seed " << seed << ": " << doubt.path << ": " << doubt.reason;
  }
}

TEST(UnitCheck, TheDataFolderRaisesNoDoubt) {
  const auto [folder, missing] = unhand::support::from_data_folder("");
  if (!missing.empty()) GTEST_SKIP() << missing;
  int logs = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".h5" || datasets::read_schema_name(entry.path()) != "throw-log")
      continue;
    ++logs;
    for (const auto& doubt : unit_doubts(datasets::read_throw_log(entry.path())))
      ADD_FAILURE() << entry.path() << ": " << doubt.path << ": " << doubt.reason;
  }
  if (logs == 0) GTEST_SKIP() << "the data folder has no throw-log";
}

TEST(UnitCheck, WhatASensorMayHaveRaisesNoDoubt) {
  auto log = small_log();
  for (auto& one : log.throws) {
    scale(one.ft->wrench, 1.5, 0, 3);   // another gain
    scale(one.mocap->pose, 1.2, 0, 2);  // another length of the wand
    for (double& t : one.mocap->time.data) t += 0.02;
    for (std::size_t i = 0; i < one.ft->wrench.rows; ++i) one.ft->wrench(i, 0) = 0.125;  // dead
  }
  for (const auto& doubt : unit_doubts(log)) ADD_FAILURE() << doubt.path << ": " << doubt.reason;
}

TEST(UnitCheck, WhatAnEffectMakesOfTheFrictionIsNoUnit) {
  for (const auto& [effect, seed, size] : {std::tuple{"sensor.normal_force_bias.bias", 7, 4.0},
                                           {"sensor.ft_bias.tau", 7, 0.05},
                                           {"sensor.ft_bias.fx", 7, 7.0},
                                           {"contact.adhesion.f_adh", 7, 15.0},
                                           {"release.opening_delay.delay", 5, 0.03},
                                           {"release.opening_delay.delay", 7, -0.01}}) {
    auto design = random_campaign(static_cast<std::uint64_t>(seed));
    design.effects[effect] = size;
    for (const auto& doubt : unit_doubts(generate_campaign(design, static_cast<std::uint64_t>(seed))))
      ADD_FAILURE() << effect << " = " << size << ": " << doubt.path << ": " << doubt.reason;
  }
}

TEST(UnitCheck, OneThrowInAnotherUnitIsToldByItsOwnPath) {
  const auto design = [] {
    auto out = testing_support::small_design("limit_surface_disc");
    out.repetitions = 3;
    return out;
  }();
  const auto clean = generate_campaign(design, 5);
  for (const auto& mistake : kMistakes)
    for (std::size_t which = 0; which < clean.throws.size(); which += 7) {
      auto log = clean;
      mistake.make(log.throws[which]);
      if (std::string(mistake.unit) == "lbf for N") continue;  // 4.4 may be the sensor's
      const std::string path = "/throws/" + log.throws[which].id + std::string(mistake.path).substr(9);
      expect_refused(log,
                     AllOf(HasSubstr(path + ": "), HasSubstr(mistake.unit), HasSubstr("accepted"),
                           testing::Not(HasSubstr("/throws/*/"))),
                     mistake.name);
    }
}

TEST(UnitCheck, OneGraspAngleInDegreesIsToldOfItsThrow) {
  auto log = small_log();
  log.throws[3].grasp_angle = -22;
  const auto doubts = unit_doubts(log);
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_EQ(doubts.front().path, "/throws/" + log.throws[3].id + "@grasp_angle");
}

TEST(UnitCheck, AWildThrowIsNotInAnotherUnit) {
  auto log = small_log();
  auto& wild = log.throws[3];
  scale(wild.ft->wrench, 3, 0, 3);
  scale(wild.ft->normal_force, 0.3);
  scale(wild.mocap->pose, 1.5, 2, 3);
  wild.mocap->pose(20, 0) *= 1e3;  // a glitch
  wild.landing->pose(0, 0) += 0.5;
  for (const auto& doubt : unit_doubts(log)) ADD_FAILURE() << doubt.path << ": " << doubt.reason;
}

TEST(UnitCheck, AFrameElsewhereIsInNoUnitAndNoTurnOff) {
  for (const double by : {4.0, 2 * std::numbers::pi}) {  // rad
    auto log = small_log();
    log.throws[2].mocap->pose(20, 2) += by;
    EXPECT_THAT(unit_doubts(log), IsEmpty()) << by;
  }
}

TEST(UnitCheck, ARecordingMayBeginLongBeforeTheThrow) {
  auto log = small_log();
  for (auto& one : log.throws) {
    auto& mocap = *one.mocap;
    constexpr std::size_t kBefore = 30000;  // frames
    const double step = mocap.time(1) - mocap.time(0);
    Series time{kBefore + mocap.time.rows, 1, {}, mocap.time.sigma},
        pose{kBefore + mocap.time.rows, 3, {}, mocap.pose.sigma};
    for (std::size_t k = kBefore; k > 0; --k) {
      time.data.push_back(mocap.time(0) - static_cast<double>(k) * step);
      for (std::size_t c = 0; c < 3; ++c) pose.data.push_back(mocap.pose(0, c));
    }
    time.data.insert(time.data.end(), mocap.time.data.begin(), mocap.time.data.end());
    pose.data.insert(pose.data.end(), mocap.pose.data.begin(), mocap.pose.data.end());
    if (!mocap.valid.empty()) mocap.valid.insert(mocap.valid.begin(), kBefore, 1);
    mocap.time = time, mocap.pose = pose;
    const double hand = one.hand->time(one.hand->time.rows - 1) - one.hand->time(0);
    ASSERT_GT((time(time.rows - 1) - time(0)) / hand, 1000 / 4.0) << "as ms for s would make it";
  }
  EXPECT_THAT(unit_doubts(log), IsEmpty());
}

// One that tumbles while its repetitions hardly turn, as motion capture sees it do.
TEST(UnitCheck, AThrowThatTurnsAsNoOtherDoesIsNotInDegrees) {
  auto log = small_log();
  for (auto& one : log.throws) {
    one.condition = "alike";
    const bool tumbles = one.id == log.throws[3].id;
    const double landed = one.landing->time(0), opened = *log.gripper->opening_command_time,
                 rate = ((tumbles ? 2.0 : 0.03) - one.landing->pose(0, 1)) / (landed - opened);
    for (std::size_t i = 0; i < one.mocap->time.rows; ++i)
      one.mocap->pose(i, 2) += rate * std::max(0.0, one.mocap->time(i) - opened);
    one.landing->pose(0, 1) += rate * (landed - opened);
  }
  EXPECT_THAT(unit_doubts(log), IsEmpty());
}

TEST(UnitCheck, AGraspAngleMayBeWholeTurnsFromTheOthers) {
  auto log = small_log();
  for (auto& one : log.throws) one.mocap.reset(), one.grasp_angle = -0.2;
  for (const std::size_t k : {2u, 5u}) {
    const double turns = 2 * std::numbers::pi * (k == 2 ? -1 : 2);
    *log.throws[k].grasp_angle += turns, log.throws[k].landing->pose(0, 1) += turns;
  }
  for (const auto& doubt : unit_doubts(log)) EXPECT_THAT(doubt.path, Not(HasSubstr("grasp_angle")));
}

/// Tosses that nothing holds: 0.4 s, 4 m/s up.
ThrowLog tosses(int dimension) {
  ThrowLog log;
  log.dimension = dimension;
  log.objects["cube"].mass = 0.1;
  const std::size_t cols = dimension == 2 ? 3 : 7, z = dimension == 2 ? 1 : 2;
  for (int i = 0; i < 5; ++i) {
    Throw one;
    one.id = std::to_string(i), one.object = "cube", one.condition = "toss", one.repetition = i;
    auto& mocap = one.mocap.emplace();
    mocap.time = {41, 1, std::vector<double>(41), {}};
    mocap.pose = {41, cols, std::vector<double>(41 * cols, 0.0), {}};
    for (std::size_t s = 0; s < 41; ++s) {
      const double t = 0.01 * static_cast<double>(s);
      mocap.time(s) = t;
      mocap.pose(s, 0) = (1 + i) * t;
      mocap.pose(s, z) = 1 + 4 * t - 0.5 * log.gravity * t * t;
      if (dimension == 3) mocap.pose(s, 3) = 1;
    }
    log.throws.push_back(one);
  }
  return log;
}

TEST(UnitCheck, GravityMeasuresTheLengthsOfAFreeFlight) {
  for (const int dimension : {2, 3}) {
    const auto clean = tosses(dimension);
    EXPECT_THAT(unit_doubts(clean), IsEmpty()) << dimension;
    const auto columns = static_cast<std::size_t>(dimension);
    auto one = clean;
    scale(one.throws[2].mocap->pose, 100, 0, columns);
    ASSERT_FALSE(unit_doubts(one).empty()) << dimension;
    EXPECT_EQ(unit_doubts(one).front().path, "/throws/2/mocap/pose");
    EXPECT_THAT(unit_doubts(one).front().reason, HasSubstr("cm for m"));
    auto all = clean;
    for (auto& toss : all.throws) scale(toss.mocap->pose, 1e3, 0, columns);
    ASSERT_FALSE(unit_doubts(all).empty()) << dimension;
    EXPECT_EQ(unit_doubts(all).front().path, "/throws/*/mocap/pose");
    all = clean;
    for (auto& toss : all.throws)
      for (double& t : toss.mocap->time.data) t *= 1e3;
    ASSERT_FALSE(unit_doubts(all).empty()) << dimension;
    EXPECT_THAT(unit_doubts(all).front().reason, HasSubstr("mocap/time in ms for s?"));
  }
}

// Files in which another axis points up, or z down, and others whose vertical is a little off.
TEST(UnitCheck, FreeFlightsTellWhichAxisIsTheVertical) {
  for (const int dimension : {2, 3}) {
    const auto columns = static_cast<std::size_t>(dimension), z = columns - 1;
    for (std::size_t up = 0; up < columns; ++up)
      for (const double sign : {1.0, -1.0}) {
        auto log = tosses(dimension);
        for (auto& toss : log.throws)
          for (std::size_t s = 0; s < toss.mocap->time.rows; ++s) {
            auto& pose = toss.mocap->pose;
            std::swap(pose(s, up), pose(s, z));
            pose(s, up) *= sign;
          }
        const auto doubts = unit_doubts(log);
        if (up == z && sign > 0) {
          EXPECT_THAT(doubts, IsEmpty());
          continue;
        }
        ASSERT_EQ(doubts.size(), 1U) << dimension << up << sign;
        EXPECT_EQ(doubts[0].path, "/throws/*/mocap/pose");
        EXPECT_EQ(doubts[0].column, up == z ? "z" : up == 0 ? "x" : "y");
        EXPECT_NEAR(doubts[0].ratio, sign, 1e-9);
        EXPECT_THAT(doubts[0].reason, HasSubstr(sign > 0 ? "fall along -" : "fall along +"));
      }
    auto tilted = tosses(dimension);
    for (auto& toss : tilted.throws)
      for (std::size_t s = 0; s < toss.mocap->time.rows; ++s) {
        auto& pose = toss.mocap->pose;
        pose(s, 0) += 0.2 * (pose(s, z) - 1 - 4 * toss.mocap->time(s));
      }
    EXPECT_THAT(unit_doubts(tilted), IsEmpty()) << dimension;
  }
}

/// Phones at rest for half a second, then falling for as long: what an accelerometer reads, times `unit`.
ThrowLog drops(double unit, bool gravity_taken_out) {
  ThrowLog log;
  log.dimension = 3;
  log.objects["phone"].mass = 0.2;
  RandomStream random(7, 0, Purpose::mocap);
  for (int i = 0; i < 5; ++i) {
    Throw one;
    one.id = std::to_string(i), one.object = "phone", one.condition = "drop", one.repetition = i;
    one.free_flight = {0.5, 1.0};
    auto& imu = one.imu.emplace();
    imu.time = {101, 1, std::vector<double>(101), {}};
    imu.specific_force = {101, 3, std::vector<double>(303), {}};
    for (std::size_t s = 0; s < 101; ++s) {
      const double t = imu.time(s) = 0.01 * static_cast<double>(s);
      const double up = (t < 0.5 ? log.gravity : 0.05 * (t - 0.5)) - (gravity_taken_out ? log.gravity : 0);
      for (std::size_t a = 0; a < 3; ++a)
        imu.specific_force(s, a) = unit * ((a == 2 ? up : 0) + 0.03 * random.normal());
    }
    log.throws.push_back(one);
  }
  return log;
}

TEST(UnitCheck, GravityMeasuresAnAccelerometerAtRest) {
  EXPECT_THAT(unit_doubts(drops(1, false)), IsEmpty());
  for (const auto& [factor, words] :
       {std::pair{1 / 9.81, "g for m/s^2"}, {1e3, "mm/s^2"}, {101.9, "mg for"}}) {
    const auto doubts = unit_doubts(drops(factor, false));
    ASSERT_EQ(doubts.size(), 1U) << factor;
    EXPECT_EQ(doubts[0].path, "/throws/*/imu/specific_force");
    EXPECT_NEAR(doubts[0].ratio / factor, 1, 0.02);
    EXPECT_THAT(doubts[0].reason, HasSubstr(words));
  }
  const auto doubts = unit_doubts(drops(1, true));
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_THAT(doubts[0].reason, HasSubstr("gravity taken out"));
  auto moving = drops(1, false);  // never at rest: nothing is said of it
  for (auto& one : moving.throws)
    for (std::size_t s = 0; s < 50; ++s)
      one.imu->specific_force(s, 2) = 5 * std::sin(0.9 * static_cast<double>(s));
  EXPECT_THAT(unit_doubts(moving), IsEmpty());
}

TEST(UnitCheck, ALandingHeightWhereNothingLandsIsRefused) {
  for (const double height : {50.0, 800.0, -50.0, -800.0}) {
    auto log = small_log();
    log.landing_height = height;
    for (const bool timed : {true, false}) {
      if (!timed)
        for (auto& one : log.throws) one.landing.reset();
      if (!timed && height < 0) continue;  // may be a deep fall
      expect_refused(log, AllOf(HasSubstr("log.h5: /@landing_height: "), HasSubstr("accepted")),
                     fmt::format("{} m, with landings: {}", height, timed));
    }
  }
}

TEST(UnitCheck, AnotherGravityIsSuspectedBesideTheLandingHeight) {
  auto log = small_log();
  log.gravity = 1.62;
  ASSERT_EQ(unit_doubts(log).size(), 1u);
  EXPECT_THAT(unit_doubts(log).front().reason, HasSubstr("another gravity than the declared 1.62 m/s^2?"));
}

/// The only doubt of a log.
UnitDoubt only_doubt(const ThrowLog& log) {
  const auto doubts = unit_doubts(log);
  return doubts.size() == 1 ? doubts.front() : UnitDoubt{"none or many", {}, 0, 0, {}};
}

TEST(UnitCheck, NoBodyOfItsMassAndSizeHasSuchAnInertia) {
  for (const double factor : {1e4, 1e-4}) {
    auto log = small_log();
    auto& [name, object] = *log.objects.begin();
    object.inertia->front() *= factor;
    const auto told = only_doubt(log);
    EXPECT_EQ(told.path, "/objects/" + name + "@inertia") << told.reason;
    EXPECT_THAT(told.reason, HasSubstr("radius of gyration"));
  }
  // All mass in two opposite corners of the box is the most that there is.
  auto log = small_log();
  auto& object = log.objects.begin()->second;
  object.dims = {0.3, 0.02, 0.04};
  const double most = object.mass * (0.09 + 4e-4 + 1.6e-3) / 4;
  object.inertia->front() = 0.99 * most;
  for (const auto& doubt : unit_doubts(log)) EXPECT_EQ(doubt.path.find("@inertia"), std::string::npos);
  object.inertia->front() = 1.2 * most;
  EXPECT_THAT(only_doubt(log).reason, HasSubstr("within its dims"));
}

// Of all bodies of a mass that fit into a length, a thin rod of the densest element turns most easily, about
// itself: I = m r²/2 with m = ρ π r² l.
TEST(UnitCheck, ARodOfOsmiumHasTheLeastInertia) {
  const double mass = 0.2, length = 0.5, square = mass / (22600 * std::numbers::pi * length);
  const auto range = gyration_range(mass, length);
  EXPECT_NEAR(range.least, 0.5 * square, 1e-12 * square);
  EXPECT_NEAR(range.most, 0.25 * length * length, 1e-15) << "two halves at the ends";
}

TEST(UnitCheck, ALeverInMillimetresShowsOnEitherSideOfThePads) {
  auto log = small_log();
  for (auto& [name, object] : log.objects) *object.com_offset *= -1000;  // and the x axis points backwards
  for (auto& one : log.throws) {
    for (std::size_t i = 0; i < one.mocap->pose.rows; ++i) one.mocap->pose(i, 2) += std::numbers::pi;
    one.landing->pose(0, 1) += std::numbers::pi;
  }
  expect_refused(log, AllOf(HasSubstr("@com_offset"), HasSubstr("mm for m")));
}

TEST(UnitCheck, NoPadIsLargerThanWhatItHolds) {
  for (const double factor : {1000.0, 100.0, 39.4}) {  // mm, cm, inch
    auto log = small_log();
    log.gripper->pad_radius = factor * 0.0106;
    EXPECT_EQ(only_doubt(log).path, "/gripper@pad_radius") << factor;
  }
  auto log = small_log();
  for (auto& [name, object] : log.objects) object.dims = {0.3, 0.02, 0.04};
  log.gripper->pad_radius = 0.19;
  for (const auto& doubt : unit_doubts(log)) EXPECT_NE(doubt.path, "/gripper@pad_radius");
  for (auto& [name, object] : log.objects) object.dims = {0.16, 0.02, 0.04};
  EXPECT_EQ(only_doubt(log).path, "/gripper@pad_radius");
}

TEST(UnitCheck, ALeverAlongAnotherAxisIsSeenByMotionCapture) {
  const auto turned = [](double by) {
    auto log = small_log();
    for (auto& one : log.throws) {
      for (std::size_t i = 0; i < one.mocap->pose.rows; ++i) one.mocap->pose(i, 2) += by;
      one.landing->pose(0, 1) += by;
    }
    return log;
  };
  for (const double by : {90.0, -90.0, 180.0}) {
    const auto doubts = unit_doubts(turned(by / kDegree));
    ASSERT_FALSE(doubts.empty()) << by;
    for (const auto& doubt : doubts) EXPECT_THAT(doubt.path, HasSubstr("@com_offset")) << doubt.reason;
  }
  EXPECT_THAT(unit_doubts(turned(10 / kDegree)), IsEmpty());
}

// Motion capture and landings count from another instant than the robot: the height is not to blame.
TEST(UnitCheck, LandingsTimedByAnotherClockDoNotDoubtTheLandingHeight) {
  auto log = small_log();
  for (auto& one : log.throws) {
    for (std::size_t i = 0; i < one.mocap->time.rows; ++i) one.mocap->time(i) += 5;
    one.landing->time(0) += 5;
  }
  const auto told = only_doubt(log);
  EXPECT_THAT(told.path, AllOf(HasSubstr("/throws/"), HasSubstr("mocap/time")));
  EXPECT_THAT(told.reason, AllOf(HasSubstr("do not overlap"), HasSubstr("tracker's clock")));
}

TEST(UnitCheck, FlightsContradictAWrongLandingHeight) {
  for (const double height : {0.3, -0.3}) {
    auto log = small_log();
    log.landing_height = height;
    const auto told = only_doubt(log);
    EXPECT_EQ(told.path, "/@landing_height");
    EXPECT_THAT(told.reason, AllOf(HasSubstr("motion capture sees"), HasSubstr("accepted are")));
    const std::string said = "land at ";
    ASSERT_THAT(told.reason, HasSubstr(said));
    EXPECT_NEAR(std::stod(told.reason.substr(told.reason.find(said) + said.size())),
                small_log().landing_height, 0.004);
    for (auto& one : log.throws) one.mocap.reset();  // then nothing does
    EXPECT_THAT(unit_doubts(log), IsEmpty());
  }
}

}  // namespace
}  // namespace unhand::experiment
