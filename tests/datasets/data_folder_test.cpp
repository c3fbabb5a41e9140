// The data folder (UNHAND_DATA), when there is one: its logs are read, and come back the same.
#include "tests/support/data_folder.hpp"
#include "datasets/assemble.hpp"
#include "datasets/import_cube_tosses.hpp"
#include "datasets/import_phyphox.hpp"
#include "datasets/summary.hpp"
#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

namespace fs = std::filesystem;

void expect_round_trip(const std::string& file) {
  const ThrowLog log = read_throw_log(file), back = reread(log);
  ASSERT_EQ(back.throws.size(), log.throws.size());
  EXPECT_EQ(back.objects, log.objects);
  for (std::size_t k = 0; k < log.throws.size(); ++k) {
    EXPECT_EQ(back.throws[k].hand, log.throws[k].hand) << log.throws[k].id;
    EXPECT_EQ(back.throws[k].ft, log.throws[k].ft) << log.throws[k].id;
    EXPECT_TRUE(same_bits(back.throws[k].mocap->pose, log.throws[k].mocap->pose)) << log.throws[k].id;
    EXPECT_EQ(back.throws[k].landing, log.throws[k].landing) << log.throws[k].id;
  }
}

TEST(DataFolder, Batch180) {
  const auto [file, missing] = support::from_data_folder("batch180.h5");
  if (!missing.empty()) GTEST_SKIP() << missing;
  expect_round_trip(file);
  const LogSummary s = summarise(read_throw_log(file));
  EXPECT_EQ(s.throws, 180U);
  EXPECT_EQ(s.conditions.size(), 2U * 3U * 6U);  // offsets, pitches, accelerations
  for (const auto& [condition, repetitions] : s.conditions) EXPECT_EQ(repetitions, 5U) << condition;
}

TEST(DataFolder, PracticeLogs) {
  const auto [folder, missing] = support::from_data_folder("practice");
  if (!missing.empty()) GTEST_SKIP() << missing;
  int logs = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".h5") continue;
    expect_round_trip(entry.path().string());
    ++logs;
  }
  EXPECT_GT(logs, 0);
}

TEST(DataFolder, CubeTosses) {
  const auto [file, missing] = support::from_data_folder("measured/cube_tosses/cube_tosses.csv");
  if (!missing.empty()) GTEST_SKIP() << missing;
  ImportReport report;
  const ThrowLog log = import_cube_tosses(file, {}, &report);
  EXPECT_EQ(report.tosses, 570);
  EXPECT_EQ(report.kept + int(report.dropped.size()), report.tosses);
  EXPECT_GT(report.kept, 500);
  EXPECT_NEAR(double(report.train) / report.test, 4, 0.2);
  EXPECT_EQ(reread(log), log);
  EXPECT_NEAR(summarise(log).groups.at(0).lowest_rate, 148, 0.5);
}

// The declared noise is what the data show: third differences of a smooth flight keep only the independent
// part, of variance 20 σ² (1 + 9 + 9 + 1). Within a factor of two, since slow errors are in the one and not
// in the other.
TEST(DataFolder, CubeTossNoiseIsAsDeclared) {
  const auto [file, missing] = support::from_data_folder("measured/cube_tosses/cube_tosses.csv");
  if (!missing.empty()) GTEST_SKIP() << missing;
  double sum = 0;
  std::size_t n = 0;
  const ThrowLog log = import_cube_tosses(file);
  for (const Throw& toss : log.throws) {
    const Series& p = toss.mocap->pose;
    for (std::size_t i = 3; i < p.rows && toss.mocap->time(i) <= toss.free_flight->second; ++i, ++n) {
      const double d = p(i, 0) - 3 * p(i - 1, 0) + 3 * p(i - 2, 0) - p(i - 3, 0);
      sum += d * d / 20;
    }
  }
  const double sigma = std::sqrt(sum / double(n)), declared = log.throws[0].mocap->pose.sigma[0];
  EXPECT_GT(sigma, declared / 2);
  EXPECT_LT(sigma, declared * 2);
}

// 22 drops, 15 throws upwards and 3 drops on edge: one free fall in each recording, and none in the phone at
// rest.
TEST(DataFolder, FallingSmartphone) {
  const auto [folder, missing] = support::from_data_folder("measured/falling_smartphone");
  if (!missing.empty()) GTEST_SKIP() << missing;
  int recordings = 0;
  const auto expect_one_fall = [&](const fs::path& file, double shortest, double longest) {
    const PhyphoxRecording recording = read_phyphox(file);
    ASSERT_EQ(recording.falls.size(), 1U) << file;
    const auto [begin, end] = *recording.falls[0].free_flight;
    EXPECT_GT(end - begin, shortest) << file;
    EXPECT_LT(end - begin, longest) << file;
    for (const double sigma : recording.falls[0].imu->specific_force.sigma) {
      EXPECT_GT(sigma, 0.005) << file;  // the phone's resolution is 0.005 m/s²
      EXPECT_LT(sigma, 0.03) << file;
    }
    ++recordings;
  };
  for (const auto& entry : fs::directory_iterator(folder / "raw")) {
    const bool drop = name_of(entry.path() / "Raw Data.csv").condition == "fall";
    expect_one_fall(entry.path() / "Raw Data.csv", drop ? 0.55 : 0.75, drop ? 0.65 : 1.0);
  }
  for (const char* name : {"fall_vertical_1.txt", "fall_vertical_2.txt", "fall_vertical_3.txt"})
    expect_one_fall(folder / name, 0.55, 0.65);
  EXPECT_EQ(recordings, 22 + 15 + 3);
  const PhyphoxRecording still = read_phyphox(folder / "accel_static.txt");
  EXPECT_TRUE(still.falls.empty() && still.dropped.empty());
}

}  // namespace
}  // namespace unhand::datasets::test
