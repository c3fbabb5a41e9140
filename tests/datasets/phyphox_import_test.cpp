// Falls from a telephone's recordings.
#include "datasets/import_phyphox.hpp"

#include <sstream>
#include <stdexcept>

#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

const std::string header =
    "\"Time (s)\",\"Acceleration x (m/s^2)\",\"Acceleration y (m/s^2)\",\"Acceleration z (m/s^2)\"\n";

/// A phone that is held, falls and hits the floor, as often as there are falls: 200 Hz, a bias in x, a ripple
/// for noise. Times of the falls in seconds.
struct Script {
  std::vector<std::pair<double, double>> falls;
  double end = 4;
  double bounce = 0;  // s of small specific force that starts 50 ms after each impact

  double up(double t) const {
    for (const auto& [from, to] : falls) {
      if (t >= from && t < to) return 0.2 * (t - from);  // drag begins
      if (t >= to && t < to + 0.05) return 150;
      if (t >= to + 0.05 && t < to + 0.05 + bounce) return 1;
    }
    return 9.8;
  }
  std::string rows(char separator = ',') const {
    std::ostringstream out;
    for (int k = 0; 0.005 * k < end; ++k) {
      const double t = 0.005 * k, ripple = 0.01 * std::sin(2.1 * k * k);
      out << t << separator << -1 + ripple << separator << 0.4 - ripple << separator << up(t) + ripple
          << '\n';
    }
    return out.str();
  }
};

PhyphoxRecording read(const std::string& text, const PhyphoxOptions& options = {}) {
  const Scratch scratch;
  put_bytes(scratch / "phone.csv", text);
  return read_phyphox(scratch / "phone.csv", options);
}

TEST(Phyphox, OneFallWithItsBounce) {
  const auto recording = read(header + Script{{{1, 1.6}}, 4, 0.3}.rows());
  EXPECT_EQ(recording.samples, 800U);
  ASSERT_EQ(recording.falls.size(), 1U);
  const Throw& fall = recording.falls[0];
  EXPECT_FALSE(fall.mocap || fall.hand);
  EXPECT_EQ(fall.imu->time.rows, 800U);  // nothing is cut away
  EXPECT_NEAR(fall.free_flight->first, 1.03, 0.0051);
  EXPECT_NEAR(fall.free_flight->second, 1.565, 0.0051);
  // ripple of amplitude 0.01: rms 0.007, within the scatter of some hundred samples
  for (const double sigma : fall.imu->specific_force.sigma) EXPECT_NEAR(sigma, 0.007, 0.002);
  ASSERT_EQ(recording.dropped.size(), 1U);
  EXPECT_THAT(recording.dropped[0].reason, testing::HasSubstr("a bounce: 150 m/s^2"));
}

TEST(Phyphox, SeveralFallsAreSeveralThrows) {
  const Script script{{{1, 1.6}, {2.5, 3.2}}, 4.5};
  const auto recording = read(header + script.rows());
  ASSERT_EQ(recording.falls.size(), 2U);
  const ImuLog &a = *recording.falls[0].imu, &b = *recording.falls[1].imu;
  EXPECT_EQ(a.time.rows + b.time.rows, recording.samples);
  EXPECT_LT(a.time.data.back(), b.time.data.front());
  EXPECT_LT(recording.falls[0].free_flight->second, a.time.data.back());
  EXPECT_GT(recording.falls[1].free_flight->first, b.time.data.front());
}

TEST(Phyphox, AFolderStandsForTheExportsBelowIt) {
  const Scratch scratch;
  namespace fs = std::filesystem;
  const fs::path folder = scratch / "raw";
  for (const char* one : {"fall_2", "fall_1"}) {
    fs::create_directories(folder / one / "meta");
    put_bytes((folder / one / "Raw Data.csv").string(), header + Script{{{1, 1.6}}}.rows());
    put_bytes((folder / one / "meta" / "device.csv").string(), "property,value\n");
  }
  const fs::path single = scratch / "fall_9.txt", empty = folder / "fall_1" / "meta";
  EXPECT_THAT(
      phyphox_files(std::vector{single, folder}),
      testing::ElementsAre(single, folder / "fall_1" / "Raw Data.csv", folder / "fall_2" / "Raw Data.csv"));
  expect_error<ImportError>([&] { phyphox_files(std::vector{empty}); }, empty.string(), "",
                            "a folder without phyphox's 'Raw Data.csv'");
}

TEST(Phyphox, WhatIsNoFall) {
  EXPECT_TRUE(read(header + Script{}.rows()).falls.empty());
  const auto reason = [](const Script& script, const PhyphoxOptions& options = {}) {
    const auto recording = read(header + script.rows(), options);
    return recording.falls.empty() && !recording.dropped.empty() ? recording.dropped[0].reason : "a fall";
  };
  EXPECT_THAT(reason({{{1, 1.35}}}), testing::HasSubstr("lasts 0.345 s, less than 0.4 s"));
  EXPECT_THAT(reason({{{0, 0.6}}}), testing::HasSubstr("starts in it"));
  EXPECT_THAT(reason({{{3.4, 4.5}}}), testing::HasSubstr("ends in it"));
  PhyphoxOptions shorter;
  shorter.min_duration = 0.3;
  EXPECT_EQ(reason({{{1, 1.35}}}, shorter), "a fall");
  // Samples that are missing are no fall one can trust.
  std::string text = header, line;
  std::istringstream rows(Script{{{1, 1.6}}}.rows());
  while (std::getline(rows, line))
    if (std::stod(line) < 1.2 || std::stod(line) > 1.3) text += line + "\n";
  const auto recording = read(text);
  EXPECT_TRUE(recording.falls.empty());
  EXPECT_THAT(recording.dropped.at(0).reason, testing::HasSubstr("samples are missing from 1.195 s on"));
}

TEST(Phyphox, WaysToWriteIt) {
  const Script script{{{1, 1.6}}};
  const auto commas = read(header + script.rows());
  std::string semicolons = header + script.rows();
  std::replace(semicolons.begin(), semicolons.end(), ',', ';');
  std::replace(semicolons.begin(), semicolons.end(), '.', ',');
  EXPECT_EQ(read(semicolons).falls, commas.falls);
  EXPECT_EQ(read(script.rows('\t')).falls, commas.falls);  // without a header
}

// An experiment of the user's own exports a file per sensor, and names the axes alone: of the file "Linear
// Accelerometer.csv" as well.
TEST(Phyphox, OtherNamesOfTheSameColumns) {
  const std::string rows = Script{{{1, 1.6}}}.rows();
  const auto usual = read(header + rows);
  std::string square = header;
  for (std::size_t at; (at = square.find("s^2")) != std::string::npos;) square.replace(at, 3, "s²");
  EXPECT_EQ(read(square + rows).falls, usual.falls);
  const std::string by_axis = "\"Time (s)\",\"X (m/s^2)\",\"Y (m/s^2)\",\"Z (m/s^2)\"\n";
  EXPECT_EQ(read(by_axis + rows).falls, usual.falls);
  const Scratch scratch;
  const auto linear = scratch / "Linear Accelerometer.csv";
  put_bytes(linear, by_axis + rows);
  expect_error<ImportError>([&] { read_phyphox(linear); }, linear, "line 1, column X (m/s^2)",
                            "has gravity taken out by the phone");
}

TEST(Phyphox, AngularRateWhereThereIsOne) {
  std::string text =
      "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2),Absolute acceleration "
      "(m/s^2),"
      "Gyroscope x (rad/s),Gyroscope y (rad/s),Gyroscope z (rad/s)\n";
  std::istringstream rows(Script{{{1, 1.6}}}.rows());
  for (std::string line; std::getline(rows, line);) text += line + ",1,0.1,-0.2,0.3\n";
  const auto recording = read(text);
  ASSERT_EQ(recording.falls.size(), 1U);
  EXPECT_EQ(recording.falls[0].imu->angular_rate(5, 1), -0.2);
  EXPECT_EQ(recording.falls[0].imu->angular_rate.rows, recording.samples);
}

// A throw with nothing but an accelerometer is a throw.
TEST(Phyphox, ThrowsGoIntoALog) {
  ThrowLog log;
  log.dimension = 3;
  log.title = "falls";
  log.source = "made up for a test";
  log.objects["phone"].mass = 0.2;
  Throw fall = read(header + Script{{{1, 1.6}}}.rows()).falls.at(0);
  fall.id = "fall_1";
  fall.object = "phone";
  fall.condition = "fall";
  log.throws.push_back(fall);
  EXPECT_EQ(reread(log), log);
}

// Columns in another unit than the header says would be a log of falls that never were.
TEST(Phyphox, RefusesOtherUnits) {
  const Scratch scratch;
  const std::string file = scratch / "phone.csv";
  const auto expect = [&](double time, double force, const std::string& place, const std::string& reason) {
    std::ostringstream out;
    out << header;
    for (int k = 0; k < 800; ++k) {
      const double t = 0.005 * k, up = t < 1 || t > 1.65 ? 9.8 : t > 1.6 ? 150 : 0.2;
      out << time * t << ",0.1,-0.2," << force * up << '\n';
    }
    put_bytes(file, out.str());
    expect_error<ImportError>([&] { read_phyphox(file); }, file, place, reason);
  };
  expect(1000, 1, "column Time (s)",
         "samples are 5 s apart (median), accepted are 0.0001 to 0.1 s: is it in ms");
  expect(1e-3, 1, "column Time (s)", "samples are 5e-06 s apart");
  expect(1, 1 / 9.81, "columns Acceleration (m/s^2)", "a phone that is held reads about 9.8: is it in g?");
  expect(1, 3.281, "columns Acceleration (m/s^2)", "outside of falls it reads 32.2 m/s^2");
}

// Readings that stand still on their grid have its rounding as their noise: no noise at all would outvote all
// others.
TEST(Phyphox, TheNoiseIsNotBelowThatOfRounding) {
  std::ostringstream out;
  out << header;
  for (int k = 0; k < 400; ++k) {
    const double t = 0.005 * k, up = t < 1 || t > 1.65 ? 9.75 + 0.15 * (k % 3) : 0.3;
    out << t << ",0.45," << 0.15 * (k % 2) << ',' << up << '\n';
  }
  const auto recording = read(out.str());
  ASSERT_EQ(recording.falls.size(), 1U);
  const auto& sigma = recording.falls[0].imu->specific_force.sigma;
  ASSERT_EQ(sigma.size(), 3U);
  EXPECT_LT(sigma[0], 1e-12);  // one value all the time: no grid is known
  EXPECT_GE(sigma[1], 0.0433);
  EXPECT_NEAR(sigma[2], 0.15 / std::sqrt(12.0), 1e-6);
}

// A phone that is thrown hard reads far from gravity outside of its fall.
TEST(Phyphox, AHardThrowIsNoOtherUnit) {
  std::ostringstream out;
  out << header;
  for (int k = 0; k < 400; ++k) {
    const double t = 0.005 * k, up = t < 1 ? 20 + 3 * std::sin(9 * t) : t > 1.65 ? 25 : 0.2;
    out << t << ",0.1,-0.2," << up << '\n';
  }
  const auto recording = read(out.str());
  EXPECT_EQ(recording.falls.size(), 1U);
  EXPECT_GT(recording.rest.value(), 18);  // as thrown: told, not refused
}

TEST(Phyphox, SaysWhichLineAndColumn) {
  const Scratch scratch;
  const std::string file = scratch / "phone.csv";
  const auto expect = [&](const std::string& text, const std::string& place, const std::string& reason) {
    put_bytes(file, text);
    expect_error<ImportError>([&] { read_phyphox(file); }, file, place, reason);
  };
  expect("", "line 1", "is empty");
  expect(header, "line 1", "holds no rows");
  expect(header + "0,0,0,9.8\n0,0,0,9.8\n", "line 3, column Time (s)",
         "not strictly increasing: 0 s after 0 s");
  expect(header + "0,0,0,inf\n", "line 2, column Acceleration z (m/s^2)", "not finite");
  expect(header + "0,0,0", "line 2", "is it cut off?");
  expect("Time (s),Acceleration x (m/s^2),Acceleration z (m/s^2)\n", "line 1",
         "there is no column 'Acceleration y (m/s^2)'");
  expect("Time (s),Linear Acceleration x (m/s^2)\n0,0\n", "line 1, column Linear Acceleration x (m/s^2)",
         "has gravity taken out by the phone");
  expect("0,1\n", "line 1", "2 numbers and no header");
  expect("0\t1\t2\t2\t3\n1\t1\t2\t2\t4\n", "line 2, column 5",
         "4 is not the absolute value of columns 2 to 4, 3");
  PhyphoxOptions options;
  options.guard = 0.3;
  EXPECT_THROW(read_phyphox(file, options), std::invalid_argument);
}

}  // namespace
}  // namespace unhand::datasets::test
