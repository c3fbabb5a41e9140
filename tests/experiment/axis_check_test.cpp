// Axes of a log that point the other way are told from the motion.
#include "experiment/axis_check.hpp"
#include "experiment/wrench_check.hpp"

#include <gmock/gmock.h>

#include <numbers>
#include <utility>
#include <vector>

#include "experiment/random_stream.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::experiment {
namespace {

using datasets::Series;
using datasets::Throw;
using datasets::ThrowLog;
using testing::HasSubstr;
using testing::IsEmpty;
using testing_support::small_log;

void scale_column(Series& series, double factor, std::size_t column) {
  for (std::size_t i = 0; i < series.rows; ++i) series(i, column) *= factor;
}

struct TestedColumn {
  const char *path, *name;
  Series& (*series)(Throw&);
  std::size_t column;
};

Series& pose(Throw& one) { return one.hand->pose; }
Series& twist(Throw& one) { return one.hand->twist; }
Series& acceleration(Throw& one) { return one.hand->acceleration; }
Series& mocap(Throw& one) { return one.mocap->pose; }
Series& landing(Throw& one) { return one.landing->pose; }
Series& wrench(Throw& one) { return one.ft->wrench; }

const TestedColumn kTestedLengths[] = {
    {"hand/pose", "x", pose, 0},
    {"hand/pose", "z", pose, 1},
    {"hand/twist", "vx", twist, 0},
    {"hand/twist", "vz", twist, 1},
    {"hand/acceleration", "ax", acceleration, 0},
    {"hand/acceleration", "az", acceleration, 1},
    {"mocap/pose", "x", mocap, 0},
    {"mocap/pose", "z", mocap, 1},
    {"landing/pose", "x", landing, 0},
};

// Units of length by which a column is too large, or too small where a file declares them and holds metres.
TEST(AxisCheck, EveryAxisAloneIsToldInEveryUnit) {
  for (const auto& column : kTestedLengths)
    for (const auto& [factor, unit] : {std::pair{1e3, "mm"},
                                       {1e-3, "declared as mm"},
                                       {100.0, "cm"},
                                       {0.01, "declared as cm"},
                                       {0.0254, "declared as inches"}}) {
      auto log = small_log();
      for (auto& one : log.throws) scale_column(column.series(one), factor, column.column);
      const auto doubts = unit_doubts(log);
      ASSERT_EQ(doubts.size(), 1U) << column.path << " " << column.name << " times " << factor;
      EXPECT_EQ(doubts[0].path, std::string("/throws/*/") + column.path) << factor << doubts[0].reason;
      EXPECT_EQ(doubts[0].column, column.name) << factor << doubts[0].reason;
      EXPECT_THAT(doubts[0].reason, HasSubstr(unit));
    }
}

TEST(AxisCheck, RadiansDeclaredAsDegreesAreTold) {
  const TestedColumn angles[] = {{"hand/pose", "theta", pose, 2},
                                 {"hand/twist", "omega", twist, 2},
                                 {"mocap/pose", "theta", mocap, 2},
                                 {"landing/pose", "theta", landing, 1}};
  for (const auto& [path, name, series, column] : angles) {
    auto log = small_log();
    for (auto& one : log.throws) scale_column(series(one), std::numbers::pi / 180, column);
    const auto doubts = unit_doubts(log);
    ASSERT_FALSE(doubts.empty()) << path;
    EXPECT_EQ(doubts[0].path, std::string("/throws/*/") + path) << doubts[0].reason;
    EXPECT_EQ(doubts[0].column, name);
  }
}

// Those that have the channel and are right do not show it.
TEST(AxisCheck, CountsTheThrowsThatShowIt) {
  const int all = static_cast<int>(small_log().throws.size()), wrong = all - all / 4;
  auto log = small_log();
  for (int i = 0; i < wrong; ++i) scale_column(log.throws[static_cast<std::size_t>(i)].mocap->pose, 1e3, 0);
  auto doubts = contradicted_axes(log);
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_EQ(doubts[0].throws, wrong);
  EXPECT_THAT(doubts[0].reason, HasSubstr(std::to_string(wrong) + " of " + std::to_string(all) + " show it"));
  log = small_log();
  for (int i = 0; i < wrong; ++i) scale_column(log.throws[static_cast<std::size_t>(i)].ft->wrench, -1, 0);
  doubts = reversed_wrenches(log);
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_EQ(doubts[0].throws, wrong);
  EXPECT_THAT(doubts[0].reason, HasSubstr("of which " + std::to_string(wrong) + " show it"));
}

TEST(AxisCheck, PadsDoNotPull) {
  EXPECT_THAT(reversed_forces(small_log()), IsEmpty());
  auto log = small_log();
  scale_column(log.throws[1].ft->normal_force, -1, 0);
  auto doubts = reversed_forces(log);
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_EQ(doubts[0].path, "/throws/" + log.throws[1].id + "/ft/normal_force");
  for (std::size_t i = 0; i < log.throws.size(); ++i)
    if (i != 1) scale_column(log.throws[i].ft->normal_force, -1, 0);
  doubts = unit_doubts(log);
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_EQ(doubts[0].path, "/throws/*/ft/normal_force");
  EXPECT_EQ(doubts[0].throws, static_cast<int>(log.throws.size()));
  // A dead sensor says nothing.
  for (auto& one : log.throws) scale_column(one.ft->normal_force, 0, 0);
  EXPECT_THAT(reversed_forces(log), IsEmpty());
}

TEST(AxisCheck, OneThrowWithASmallHandIsToldByItsOwnPath) {
  for (const bool whole : {false, true}) {
    auto log = small_log();
    auto& one = log.throws[3];
    for (std::size_t c = 0; c < 2; ++c) {
      scale_column(one.hand->pose, 1e-3, c);
      if (whole) scale_column(one.hand->twist, 1e-3, c), scale_column(one.hand->acceleration, 1e-3, c);
    }
    const auto doubts = unit_doubts(log);
    ASSERT_FALSE(doubts.empty()) << whole;
    for (const auto& doubt : doubts)
      EXPECT_EQ(doubt.path, "/throws/" + one.id + "/hand/pose") << doubt.reason;
  }
}

// Sums of nothing say nothing: neither the noise of an axis that rests, nor a dead column.
TEST(AxisCheck, AnAxisThatRestsHasNoSay) {
  auto log = small_log();
  for (auto& one : log.throws) {
    for (auto* series : {&one.hand->twist, &one.hand->acceleration}) scale_column(*series, 0, 0);
    for (std::size_t i = 0; i < one.hand->pose.rows; ++i)
      one.hand->pose(i, 0) = 0.5 + 1e-4 * static_cast<double>(i * 7919 % 13);
    one.mocap.reset(), one.landing.reset();
  }
  EXPECT_THAT(contradicted_axes(log), IsEmpty());
}

TEST(AxisCheck, AnAxisThatPointsTheOtherWayIsTold) {
  auto log = small_log();
  for (auto& one : log.throws)
    for (auto* series : {&one.hand->pose, &one.hand->twist, &one.hand->acceleration})
      scale_column(*series, -1, 1);
  const auto doubts = unit_doubts(log);
  ASSERT_FALSE(doubts.empty());
  EXPECT_THAT(doubts[0].reason, HasSubstr("points the other way"));
}

TEST(AxisCheck, AWrenchWithTheOtherSignIsToldByItsColumns) {
  for (const auto& columns : {std::vector<std::size_t>{0, 1, 2}, {0}, {1}, {2}}) {
    auto log = small_log();
    for (auto& one : log.throws)
      for (const auto c : columns) scale_column(one.ft->wrench, -1, c);
    const auto doubts = unit_doubts(log);
    ASSERT_EQ(doubts.size(), columns.size());
    for (std::size_t i = 0; i < columns.size(); ++i) {
      constexpr const char* kNames[] = {"fx", "fz", "tau"};
      EXPECT_EQ(doubts[i].path, "/throws/*/ft/wrench");
      EXPECT_EQ(doubts[i].column, kNames[columns[i]]);
      EXPECT_THAT(doubts[i].reason, HasSubstr("is the sign reversed"));
    }
    EXPECT_THROW(require_units(log, "log.h5"), datasets::LogError);
  }
}

void swap_forces(ThrowLog& log) {
  for (auto& one : log.throws)
    for (std::size_t i = 0; i < one.ft->wrench.rows; ++i)
      std::swap(one.ft->wrench(i, 0), one.ft->wrench(i, 1));
}

TEST(AxisCheck, SwappedForcesAreTold) {
  auto log = small_log();
  swap_forces(log);
  const auto doubts = unit_doubts(log);
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_THAT(doubts[0].reason, HasSubstr("axes swapped"));
}

// Noise that is as large as a force's change within a throw leaves no correlation there; what throws differ
// by tells.
TEST(AxisCheck, SwappedForcesAreToldThroughNoise) {
  constexpr double kNoise = 0.2;  // N
  auto log = small_log();
  for (std::size_t k = 0; k < log.throws.size(); ++k) {
    RandomStream noise(1, k, Purpose::force_torque);
    auto& wrench = log.throws[k].ft->wrench;
    for (std::size_t i = 0; i < wrench.rows; ++i)
      for (std::size_t c = 0; c < 2; ++c) wrench(i, c) += noise.normal(0, kNoise);
  }
  EXPECT_THAT(unit_doubts(log), IsEmpty());
  swap_forces(log);
  const auto doubts = unit_doubts(log);
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_THAT(doubts[0].reason, HasSubstr("axes swapped"));
}

// Where what objects need along x and z goes opposite ways, swapped forces look reversed, too; and reversed
// ones swapped.
TEST(AxisCheck, SwappedAndReversedForcesAreToldApart) {
  const auto healthy = generate_campaign(campaign_design("random", 2), 2);
  EXPECT_THAT(unit_doubts(healthy), IsEmpty());
  auto log = healthy;
  swap_forces(log);
  auto doubts = unit_doubts(log);
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_THAT(doubts[0].reason, HasSubstr("axes swapped"));
  log = healthy;
  for (auto& one : log.throws)
    for (std::size_t c = 0; c < 3; ++c) scale_column(one.ft->wrench, -1, c);
  doubts = unit_doubts(log);
  ASSERT_FALSE(doubts.empty());
  for (const auto& doubt : doubts) EXPECT_THAT(doubt.reason, HasSubstr("is the sign reversed"));
}

// Among these biases is one that makes the means of fx and fz each other's.
TEST(AxisCheck, ABiasIsNoSwap) {
  for (double bias = -6; bias <= 6; bias += 0.25) {  // N
    auto log = small_log();
    for (auto& one : log.throws)
      for (std::size_t i = 0; i < one.ft->wrench.rows; ++i)
        wrench(one)(i, 0) += bias, wrench(one)(i, 1) -= bias;
    EXPECT_THAT(reversed_wrenches(log), IsEmpty()) << bias;
  }
}

// A bias takes no sign away; where the lever is not seen, a torque may be another lever's.
TEST(AxisCheck, BiasesAndUnseenLeversAreNoSign) {
  auto log = small_log();
  for (auto& one : log.throws)
    for (std::size_t i = 0; i < one.ft->wrench.rows; ++i) wrench(one)(i, 0) -= 20, wrench(one)(i, 1) -= 20;
  EXPECT_THAT(reversed_wrenches(log), IsEmpty());
  log = small_log();
  for (auto& [name, object] : log.objects) *object.com_offset *= -1;
  for (auto& one : log.throws) one.mocap.reset(), one.grasp_angle = 0;
  EXPECT_THAT(reversed_wrenches(log), IsEmpty());
}

}  // namespace
}  // namespace unhand::experiment
