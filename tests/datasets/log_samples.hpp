// Small logs for the tests of datasets.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>

#include "datasets/throw_log.hpp"
#include "tests/support/scratch.hpp"

namespace unhand::datasets::test {

using support::Scratch;

inline std::string bytes_of(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void put_bytes(const std::string& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

/// The log as it comes back from a file.
inline ThrowLog reread(const ThrowLog& log) {
  const Scratch scratch;
  write_throw_log(scratch / "log.h5", log);
  return read_throw_log(scratch / "log.h5");
}

/// The same bits, NaN included.
inline bool same_bits(const Series& a, const Series& b) {
  const auto same = [](const std::vector<double>& u, const std::vector<double>& v) {
    return u.size() == v.size() &&
           (u.empty() || std::memcmp(u.data(), v.data(), u.size() * sizeof(double)) == 0);
  };
  return a.rows == b.rows && a.cols == b.cols && same(a.data, b.data) && same(a.sigma, b.sigma);
}

/// Awkward numbers: no short decimal, many magnitudes.
inline Series wavy(std::size_t rows, std::size_t cols, double scale, std::vector<double> sigma = {}) {
  Series s{rows, cols, std::vector<double>(rows * cols), std::move(sigma)};
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t j = 0; j < cols; ++j)
      s(i, j) = scale * std::sin(1.0 + 0.7 * double(i) + 1.3 * double(j));
  }
  return s;
}

inline Series clock_of(std::size_t rows, double rate) {
  Series s{rows, 1, std::vector<double>(rows), {}};
  for (std::size_t i = 0; i < rows; ++i) s(i) = double(i) / rate;
  return s;
}

inline Throw sample_throw(const std::string& id) {
  Throw toss;
  toss.id = id;
  toss.object = "bar";
  toss.condition = "bar/pitch-23";
  toss.repetition = 3;
  toss.split = id == "002" ? Split::test : Split::train;
  toss.detach_time = 0.1 / 3;
  toss.grasp_angle = -0.2;
  toss.hand_jump_times = {0.01, 0.02};
  toss.free_flight = {0.04, 0.1};
  toss.hand =
      HandLog{clock_of(40, 1000), wavy(40, 3, 0.4, {1e-6, 1e-6, 2e-6}), wavy(40, 3, 2), wavy(40, 3, 1e5)};
  toss.ft = FtLog{clock_of(50, 1000), wavy(50, 3, 3, {0.02, 0.02, 2e-4}), wavy(50, 1, 30, {0.05})};
  toss.mocap = MocapLog{clock_of(30, 240), wavy(30, 3, 0.4, {2e-4, 2e-4, 3e-3}), Flags(30, 1)};
  toss.mocap->valid[7] = 0;
  for (std::size_t j = 0; j < 3; ++j) toss.mocap->pose(7, j) = std::numeric_limits<double>::quiet_NaN();
  toss.landing = LandingLog{{1, 1, {0.41}, {1e-3}}, {1, 2, {0.9, 4.5}, {1e-3, 9e-3}}};
  toss.imu = ImuLog{clock_of(20, 200), wavy(20, 3, 9), wavy(20, 3, 6)};
  return toss;
}

/// Every field set.
inline ThrowLog planar_log() {
  ThrowLog log;
  log.title = "two throws, with an umlaut: Würfe";
  log.source = "made up for a test";
  log.licence = "CC0";
  log.landing_height = -0.1;
  Object bar;
  bar.mass = 0.246;
  bar.inertia = {{0.00115349}};
  bar.com_offset = 0.1;
  bar.dims = {{0.34, 0.03, 0.02}};
  bar.surface = "anodised aluminium";
  bar.sku = "bar-100";
  bar.drag_k = 0.01;
  log.objects = {{"bar", bar}, {"plain", Object{}}};
  log.objects["plain"].mass = 1;
  log.gripper = Gripper{2, 0.0106, 0.05};
  log.throws = {sample_throw("001"), sample_throw("002")};
  return log;
}

inline ThrowLog spatial_log() {
  ThrowLog log;
  log.dimension = 3;
  log.title = "spatial";
  log.source = "made up for a test";
  log.objects["cube"].mass = 0.37;
  log.objects["cube"].inertia = {{1e-3, 2e-3, 3e-3}};
  for (const std::size_t cols : {7, 3}) {
    Throw toss;
    toss.id = cols == 7 ? "full" : "points";
    toss.object = "cube";
    toss.condition = "toss";
    toss.mocap = MocapLog{clock_of(12, 148), wavy(12, cols, 0.3), {}};
    for (std::size_t i = 0; cols == 7 && i < 12; ++i) {
      toss.mocap->pose(i, 3) = 0.6;
      toss.mocap->pose(i, 4) = 0;
      toss.mocap->pose(i, 5) = 0.8;
      toss.mocap->pose(i, 6) = 0;
    }
    toss.landing = LandingLog{{1, 1, {0.5}, {}}, {1, 3, {0.1, 0.2, 0.3}, {}}};
    log.throws.push_back(toss);
  }
  return log;
}

/// Runs `read` and expects a LogError that says `file`, `path` and `reason`, on one line.
template <class Error = LogError, class Read>
void expect_error(Read&& read, const std::string& file, const std::string& path, const std::string& reason) {
  try {
    read();
    ADD_FAILURE() << "accepted; expected " << path << ": " << reason;
  } catch (const Error& error) {
    const std::string what = error.what();
    EXPECT_EQ(error.file, file) << what;
    EXPECT_EQ(error.path, path) << what;
    EXPECT_THAT(error.reason, testing::HasSubstr(reason));
    EXPECT_THAT(what, testing::StartsWith(file + ":"));
    EXPECT_THAT(what, testing::HasSubstr(path));
    EXPECT_THAT(what, testing::EndsWith(error.reason));
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
  }
}

}  // namespace unhand::datasets::test
