// The import of measured planar pushes: frames, torques about the centre, and what is refused.
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>

#include "datasets/import_planar_pushes.hpp"
#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

namespace fs = std::filesystem;

/// A push along +y of the world by a finger under the long leg, at `along` [mm] from the corner, whose yaw is
/// `tool`; the block is turned by `yaw` and moves straight by `moves` [mm]. Force 3 N on the block along the
/// push, from the touch on; `offset` is what the sensor reads without load.
struct Push {
  double along = 50, moves = 10, yaw = 0, tool = 1.5707963267948966, force = 3;
  std::array<double, 2> offset{0.02, -0.08};
  double rest = 2;  // [s] before the touch; speed 2.5 mm/s

  std::string text() const {
    std::ostringstream out;
    out.precision(15);
    const double c = std::cos(yaw), s = std::sin(yaw), time = rest + moves / 2.5;
    const std::array<double, 2> push{-s, c};  // the block's own y
    const auto pose = [&](double x, double y, double angle) {
      out << x << ' ' << y << " 8.5 " << std::cos(angle / 2) << " 0 0 " << std::sin(angle / 2) << '\n';
    };
    pose(100, 200, yaw);
    pose(100 + moves * push[0], 200 + moves * push[1], yaw);
    // The sensor: f_block = −R(tool) M (f_s − b), and M is its own inverse.
    const double u = std::cos(tool), v = std::sin(tool);
    const double fx = -force * (u * push[0] + v * push[1]), fy = -force * (-v * push[0] + u * push[1]);
    const double sx = (fx + fy) / std::numbers::sqrt2, sy = (fx - fy) / std::numbers::sqrt2;
    const int n = static_cast<int>(time * 100) + 1, m = static_cast<int>(time * 30) + 2;
    out << n << '\n';
    for (int i = 0; i < n; ++i) {
      const bool load = 0.01 * i > rest;
      out << 1000 + 0.01 * i << ' ' << offset[0] + (load ? sx : 0) << ' ' << offset[1] + (load ? sy : 0)
          << '\n';
    }
    out << m << '\n';
    for (int i = 0; i < m; ++i) {
      const double t = i / 30.0, way = 2.5 * (std::min(t, time) - rest);
      out << 1000 + t << ' ';
      pose(100 + along * c + way * push[0], 200 + along * s + way * push[1], tool);
    }
    return out.str();
  }
};

std::string log_of(const std::vector<Push>& pushes) {
  std::string out = std::to_string(pushes.size()) + "\n";
  for (const Push& push : pushes) out += push.text();
  return out;
}

SlipLog import_text(const Scratch& scratch, const std::string& text, PlanarPushReport* report = nullptr) {
  fs::create_directories(scratch / "felt");
  put_bytes(scratch / "felt/a.txt", text);
  return import_planar_pushes(std::vector<fs::path>{scratch / "felt"}, {}, report);
}

TEST(PlanarPushes, StraightPushInEveryFrame) {
  for (const double yaw : {0.0, 1.0, -2.5})
    for (const double tool : {1.57, -0.4, 3.1}) {
      const Scratch scratch;
      Push push;
      push.yaw = yaw;
      push.tool = tool;
      const SlipLog log = import_text(scratch, log_of({push}));
      const Surface& surface = log.surfaces.at("felt");
      EXPECT_EQ(surface.mass, 1.518);
      EXPECT_EQ(surface.characteristic_length, 0.05);
      ASSERT_EQ(surface.slips.size(), 1U);
      const Slip& slip = surface.slips[0];
      EXPECT_EQ(slip.id, "push-00");
      ASSERT_GE(slip.time.rows, 38U);  // 4 s of motion in steps of 0.1 s, less the first and last
      for (std::size_t i = 1; i + 1 < slip.time.rows; ++i) {
        EXPECT_NEAR(slip.wrench(i, 0), 0, 1e-9);
        EXPECT_NEAR(slip.wrench(i, 1), 3, 1e-9);
        EXPECT_NEAR(slip.wrench(i, 2), 0, 1e-9);  // below the centre
        EXPECT_NEAR(slip.twist(i, 0), 0, 1e-9);
        EXPECT_NEAR(slip.twist(i, 1), 2.5e-3, 1e-7);
        EXPECT_NEAR(slip.twist(i, 2), 0, 1e-9);
      }
      EXPECT_GE(slip.time(0), 1.9);  // nothing before the touch
    }
}

TEST(PlanarPushes, TorqueIsAboutTheCentre) {
  const Scratch scratch;
  Push push;
  push.along = 90;
  const SlipLog log = import_text(scratch, log_of({push}));
  const Slip& slip = log.surfaces.at("felt").slips[0];
  EXPECT_NEAR(slip.wrench(5, 2), 0.04 * 3, 1e-9);  // 40 mm right of the centre, force up
}

// Closed forms: a right-angled triangle's radius is √((a² + b²)/18), a rectangle's √((a² + b²)/12), wherever
// the frame is.
TEST(PlanarPushes, ABlockIsHomogeneousUnlessItIsPublished) {
  const PushedBlock published;
  const PushedBlock triangle = homogeneous_block(published.outline, 2.0);
  EXPECT_EQ(triangle.mass, 2.0);
  EXPECT_NEAR(triangle.characteristic_length, std::sqrt(2 * 0.15 * 0.15 / 18), 1e-15);
  EXPECT_NEAR(triangle.characteristic_length, published.characteristic_length, 1e-15);
  for (int k = 0; k < 2; ++k) EXPECT_NEAR(triangle.centre[k], published.centre[k], 1e-15);
  for (const double x : {0.0, -0.3}) {
    const PushedBlock box = homogeneous_block({{x, 0.1}, {x + 0.08, 0.1}, {x + 0.08, 0.16}, {x, 0.16}}, 1.0);
    EXPECT_NEAR(box.centre[0], x + 0.04, 1e-15);
    EXPECT_NEAR(box.centre[1], 0.13, 1e-15);
    EXPECT_NEAR(box.characteristic_length, std::sqrt((0.08 * 0.08 + 0.06 * 0.06) / 12), 1e-15);
  }
}

TEST(PlanarPushes, TorqueIsAboutTheCentreOfAnotherBlock) {
  const Scratch scratch;
  Push push;
  push.along = 70;
  PlanarPushOptions options;
  options.block = homogeneous_block({{0, 0}, {0.08, 0}, {0.08, 0.06}, {0, 0.06}}, 0.8);
  put_bytes(scratch / "a.txt", log_of({push}));
  const SlipLog log = import_planar_pushes(std::vector<fs::path>{scratch / "a.txt"}, options);
  const Surface& surface = log.surfaces.begin()->second;
  EXPECT_EQ(surface.mass, 0.8);
  EXPECT_NEAR(surface.slips.at(0).wrench(5, 2), 0.03 * 3, 1e-9);
  EXPECT_EQ(surface.description.find("MLab"), std::string::npos);
}

TEST(PlanarPushes, OutlinesThatAreNoneAreRefused) {
  using Outline = std::vector<std::array<double, 2>>;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Outline star;  // round twice
  for (int k = 0; k < 5; ++k)
    star.push_back({std::cos(4 * std::numbers::pi * k / 5), std::sin(4 * std::numbers::pi * k / 5)});
  for (const Outline& outline : {Outline{{0, 0}, {1, 0}}, Outline{{0, 0}, {0, 1}, {1, 0}}, star,
                                 Outline{{0, 0}, {1, 0}, {0.2, 0.2}, {0, 1}},
                                 Outline{{0, 0}, {1, nan}, {0, 1}}, Outline{{0, 0}, {0, 0}, {1, 0}, {0, 1}}})
    EXPECT_THROW(homogeneous_block(outline, 1), std::invalid_argument);
  EXPECT_THROW(homogeneous_block({{0, 0}, {1, 0}, {0, 1}}, 0), std::invalid_argument);
}

TEST(PlanarPushes, FingerThatTouchesFromTheStartBorrowsItsOffset) {
  const Scratch scratch;
  Push touching;
  touching.rest = -0.005;
  PlanarPushReport report;
  const SlipLog log = import_text(scratch, log_of({{}, {}, touching}), &report);
  EXPECT_EQ(report.borrowed_offsets, 1);
  EXPECT_NEAR(log.surfaces.at("felt").slips[2].wrench(3, 1), 3, 1e-9);
}

TEST(PlanarPushes, DropsWhatIsNoPush) {
  const Scratch scratch;
  Push still, pulling;
  still.moves = 0.5;
  pulling.force = -3;
  PlanarPushReport report;
  const SlipLog log = import_text(scratch, log_of({{}, still, pulling, {}, {}}), &report);
  EXPECT_EQ(report.pushes, 5);
  EXPECT_EQ(report.kept, 3);
  EXPECT_EQ(report.train, 2);
  EXPECT_EQ(report.test, 1);
  ASSERT_EQ(report.dropped.size(), 2U);
  EXPECT_EQ(report.dropped[0].push, 1);
  EXPECT_THAT(report.dropped[0].reason, testing::HasSubstr("moves by 0.5 mm"));
  EXPECT_THAT(report.dropped[1].reason, testing::HasSubstr("pulls"));
  EXPECT_EQ(log.surfaces.at("felt").slips.back().id, "push-04");
  EXPECT_EQ(log.surfaces.at("felt").slips.back().split, Split::test);
}

// A time stamp that went wrong makes a push of years.
TEST(PlanarPushes, DropsAPushWithoutEnd) {
  const Scratch scratch;
  Push push;
  std::string text = push.text();
  const std::string last =
      fmt::format("\n{}", 1000 + 0.01 * static_cast<int>((push.rest + push.moves / 2.5) * 100));
  const auto at = text.find(last);
  ASSERT_NE(at, std::string::npos) << text;
  text.replace(at + 1, last.size() - 1, "1e18");
  PlanarPushReport report;
  import_text(scratch, "4\n" + text + log_of({{}, {}, {}}).substr(2), &report);
  ASSERT_EQ(report.dropped.size(), 1U);
  EXPECT_THAT(report.dropped[0].reason, testing::HasSubstr("lasts 1e+18 s"));
}

TEST(PlanarPushes, SeveralLogsAndARoundTrip) {
  const Scratch scratch;
  for (const char* name : {"logs/one", "logs/two"}) {
    fs::create_directories(scratch / name);
    put_bytes(scratch / (std::string(name) + "/a.txt"), log_of({{}, {}}));
  }
  put_bytes(scratch / "logs/LICENSE", "not a log");
  const SlipLog log = import_planar_pushes(std::vector<fs::path>{scratch / "logs"});
  ASSERT_EQ(log.surfaces.size(), 2U);
  EXPECT_TRUE(log.surfaces.contains("one") && log.surfaces.contains("two"));
  write_slip_log(scratch / "p.h5", log);
  EXPECT_EQ(read_slip_log(scratch / "p.h5"), log);
  put_bytes(scratch / "logs/two/b.txt", log_of({{}}));
  EXPECT_TRUE(import_planar_pushes(std::vector<fs::path>{scratch / "logs"}).surfaces.contains("two-b"));
}

// As editors write it.
TEST(PlanarPushes, AByteOrderMarkIsPassedOver) {
  const Scratch scratch;
  EXPECT_EQ(import_text(scratch, "\xef\xbb\xbf" + log_of({{}})).surfaces.at("felt").slips.size(), 1U);
}

TEST(PlanarPushes, SaysWhichLineAndColumn) {
  const Scratch scratch;
  const std::string file = scratch / "p.txt";
  const auto expect = [&](const std::string& text, const std::string& place, const std::string& reason) {
    put_bytes(file, text);
    expect_error<ImportError>([&] { import_planar_pushes(std::vector<fs::path>{file}); }, file, place,
                              reason);
  };
  const std::string pose = "1 2 3 1 0 0 0\n", head = "1\n" + pose + pose,
                    forces = head + "2\n0 1 2\n0.1 1 2\n", robot = forces + "2\n0 " + pose;
  expect("", "line 1", "the file ends where number of pushes should be");
  expect("many\n", "line 1, column number of pushes", "'many' is not an integer");
  expect("0\n", "line 1, column number of pushes", "0 is not in 1");
  expect("1\n\xff\xfe 2 3 1 0 0 0\n", "line 2", "is not UTF-8 text");
  expect("1\n1 2 3 1 0 0\n", "line 2, column qz", "6 of 7 numbers");
  expect("1\n1 2 3 1 0 0 0 9\n", "line 2, column 8", "'9' after the 7 numbers");
  expect("1\n1 x 3 1 0 0 0\n", "line 2, column y", "'x' is not a number");
  expect("1\n1 nan 3 1 0 0 0\n", "line 2, column y", "is not finite");
  expect("1\n1 2 3 1 1 0 0\n", "line 2, column qw", "quaternion of norm 1.41421");
  expect("1\n" + pose, "line 3", "the object's pose after the push");
  expect(head + "1\n", "line 4, column number of force samples", "1 is not in 2");
  expect(head + "2\n0 1 2\n0 1 2\n", "line 6, column t", "not strictly increasing");
  expect(forces, "line 7", "the file ends where number of robot poses should be");
  expect(robot + "0.1 1 2 3 1 0 0\n", "line 9, column qz", "7 of 8 numbers");
  expect(robot + "0.1 " + pose + "4\n", "line 10", "'4' after the last push");
  expect(robot + "0.1 " + pose, "line 1", "none of 1 pushes can be used");
  fs::remove(file);
  expect_error<ImportError>([&] { import_planar_pushes(std::vector<fs::path>{file}); }, file, "",
                            "no such file");
  fs::create_directories(scratch / "empty");
  expect_error<ImportError>([&] { import_planar_pushes(std::vector<fs::path>{scratch / "empty"}); },
                            scratch / "empty", "", "without .txt files");
  PlanarPushOptions options;
  options.block.mass = 0;
  EXPECT_THROW(import_planar_pushes(std::vector<fs::path>{file}, options), std::invalid_argument);
}

}  // namespace
}  // namespace unhand::datasets::test
