// Throws put together from the files of their channels.
#include "datasets/assemble.hpp"

#include <cmath>
#include <random>
#include <stdexcept>

#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

TEST(Assemble, NamesOfFiles) {
  const auto expect = [](const std::string& file, const std::string& id, const std::string& condition,
                         int n) {
    const ThrowName name = name_of(file);
    EXPECT_EQ(name.id, id) << file;
    EXPECT_EQ(name.condition, condition) << file;
    EXPECT_EQ(name.repetition, n) << file;
  };
  expect("a/slow_03.csv", "slow_03", "slow", 3);
  expect("slow pitch-23 - 7.csv", "slow pitch-23 - 7", "slow pitch-23", 7);
  expect("slow.csv", "slow", "slow", 0);
  expect("017.csv", "017", "throw", 17);
  expect("raw/fall_4/Raw Data.csv", "fall_4", "fall", 4);
  expect("Raw Data.csv", "Raw Data", "Raw Data", 0);
}

ThrowLog log_of(const std::vector<std::string>& files) {
  ThrowLog log = spatial_log();
  const Throw sample = log.throws.at(0);
  log.throws.clear();
  for (const std::string& file : files) {
    const ThrowName name = name_of(file);
    Throw one = sample;
    one.id = name.id;
    one.condition = name.condition;
    one.repetition = name.repetition;
    add_throw(log, one, file);
  }
  return log;
}

std::vector<std::string> held_out(const ThrowLog& log) {
  std::vector<std::string> ids;
  for (const Throw& one : log.throws)
    if (one.split == Split::test) ids.push_back(one.id);
  return ids;
}

TEST(Assemble, SplitGoesByCondition) {
  ThrowLog log = log_of({"b_10.csv", "a_1.csv", "a_2.csv", "b_9.csv", "a_3.csv", "b_2.csv", "c_1.csv"});
  split_throws(log, {3, {}});
  EXPECT_THAT(held_out(log), testing::ElementsAre("b_10", "a_3"));  // in the order of numbers, not of letters
  split_throws(log, {0, {"c"}});
  EXPECT_THAT(held_out(log), testing::ElementsAre("c_1"));
  EXPECT_THROW(split_throws(log, {1, {}}), std::invalid_argument);
  EXPECT_THROW(split_throws(log, {5, {"d"}}), std::invalid_argument);
}

TEST(Assemble, NamesAreTakenOnce) {
  ThrowLog log = log_of({"a_1.csv"});
  Throw again;
  again.id = "a_1";
  expect_error<ImportError>([&] { add_throw(log, again, "other/a_1.csv"); }, "other/a_1.csv", "",
                            "there is already a throw 'a_1'");
}

TEST(Assemble, ChannelsFillAThrow) {
  ThrowLog log = planar_log();
  Throw channels;
  channels.ft = log.throws[1].ft;
  channels.free_flight = {0.05, 0.06};
  log.throws[0].ft.reset();
  fill_throw(log, "001", channels, false, "log.h5");
  EXPECT_EQ(log.throws[0].ft, log.throws[1].ft);
  EXPECT_EQ(log.throws[0].free_flight->second, 0.06);
  EXPECT_EQ(log.throws[0].mocap->time.rows, 30U);  // as it was
  expect_error([&] { fill_throw(log, "001", channels, false, "log.h5"); }, "log.h5", "/throws/001/ft",
               "is there already");
  fill_throw(log, "001", channels, true, "log.h5");
  expect_error([&] { fill_throw(log, "003x", channels, true, "log.h5"); }, "log.h5", "/throws",
               "there is no throw '003x'");
}

/// A parabola with its top at 0.2 s, 1 m high; 100 Hz.
MocapLog parabola(int dimension) {
  MocapLog mocap;
  const std::size_t cols = 3;
  mocap.time = clock_of(80, 100);
  mocap.pose = {80, cols, {}, {1e-4, 2e-4, 3e-4}};
  for (std::size_t i = 0; i < 80; ++i) {
    const double t = mocap.time(i), z = 1 - 4.9 * (t - 0.2) * (t - 0.2);
    for (const double value : {2 * t, dimension == 3 ? 0.5 : z, dimension == 3 ? z : 6 * t})
      mocap.pose.data.push_back(value);
  }
  return mocap;
}

TEST(Assemble, LandingFromTheTrack) {
  const double passes = 0.2 + std::sqrt(0.5 / 4.9);
  const double chord = 4.9 * 0.005 * 0.005 / (9.8 * (passes - 0.2));  // of a parabola against its chord
  const auto planar = landing_of(parabola(2), 2, 0.5);
  ASSERT_TRUE(planar);
  EXPECT_NEAR(planar->time(0), passes, chord);
  EXPECT_NEAR(planar->pose(0, 0), 2 * passes, 2 * chord);
  EXPECT_NEAR(planar->pose(0, 1), 6 * passes, 6 * chord);
  const auto spatial = landing_of(parabola(3), 3, 0.5);
  ASSERT_TRUE(spatial);
  EXPECT_NEAR(spatial->pose(0, 2), 0.5, 1e-12);
  EXPECT_FALSE(landing_of(parabola(2), 2, -5));
  EXPECT_FALSE(landing_of(parabola(2), 2, 1.5));
}

// The sigma that a landing is given is what noise of the track moves it by, wherever between two frames it
// is.
TEST(Assemble, LandingsScatterAsTheyDeclare) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  for (const double height : {0.5, 0.52}) {
    constexpr int kDraws = 3000;
    const MocapLog clean = parabola(2);
    const auto declared = landing_of(clean, 2, height);
    double squares[2]{};
    for (int draw = 0; draw < kDraws; ++draw) {
      MocapLog noisy = clean;
      for (std::size_t i = 0; i < noisy.pose.rows; ++i)
        for (std::size_t c = 0; c < 3; ++c) noisy.pose(i, c) += noisy.pose.sigma[c] * normal(random);
      const auto landed = landing_of(noisy, 2, height);
      for (std::size_t c = 0; c < 2; ++c)
        squares[c] += std::pow(landed->pose(0, c) - declared->pose(0, c), 2);
    }
    for (std::size_t c = 0; c < 2; ++c)  // of so many draws, σ is known to 1.3 %
      EXPECT_NEAR(std::sqrt(squares[c] / kDraws) / declared->pose.sigma[c], 1, 0.06) << height << " " << c;
  }
}

TEST(Assemble, NoLandingWhereTheTrackIsLost) {
  MocapLog mocap = parabola(2);
  mocap.valid = Flags(80, 1);
  for (std::size_t i = 50; i < 54; ++i) mocap.valid[i] = 0;  // it passes 0.5 m at 0.519 s
  EXPECT_FALSE(landing_of(mocap, 2, 0.5));
  EXPECT_TRUE(landing_of(mocap, 2, 0.3));
}

}  // namespace
}  // namespace unhand::datasets::test
