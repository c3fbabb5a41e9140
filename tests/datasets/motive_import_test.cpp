// Takes of a motion capture: units, heading, centre of mass, losses, and the flight in them.
#include "datasets/import_motive.hpp"

#include <Eigen/Geometry>
#include <numbers>
#include <stdexcept>

#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

constexpr double pi = std::numbers::pi;

/// The parts of a file as Motive writes it; a test changes what it is about.
struct File {
  std::string version = "1.23", rotation = "Quaternion", units = "Meters", space = "Global";
  std::string types =
      ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body";
  std::string names = ",Name,bar,bar,bar,bar,bar,bar,bar,bar";
  std::string ids = ",ID,\"9E20\",\"9E20\",\"9E20\",\"9E20\",\"9E20\",\"9E20\",\"9E20\",\"9E20\"";
  std::string kinds = ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error";
  std::string axes = "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,";
  std::string rows;

  std::string text() const {
    std::string header = "Format Version," + version +
                         ",Take Name,throw 7,Take Notes,,Capture Frame Rate,240.000000" +
                         ",Export Frame Rate,120.000000";
    if (!rotation.empty()) header += ",Rotation Type," + rotation;
    if (!units.empty()) header += ",Length Units," + units;
    header += ",Coordinate Space," + space;
    return header + "\r\n\r\n" + types + "\r\n" + names + "\r\n" + ids + "\r\n" + kinds + "\r\n" + axes +
           "\r\n" + rows;
  }
  File with(const std::string& more) const {
    File out = *this;
    out.rows += more;
    return out;
  }
};

MotiveTake read(const File& file, const MotiveOptions& options = {}) {
  const Scratch scratch;
  put_bytes(scratch / "take.csv", file.text());
  return read_motive_csv(scratch / "take.csv", options);
}

std::string row(int frame, double t, const Eigen::Quaterniond& q, const Eigen::Vector3d& p) {
  std::ostringstream out;
  out.precision(9);
  out << frame << ',' << t << ',' << q.x() << ',' << q.y() << ',' << q.z() << ',' << q.w() << ',' << p.x()
      << ',' << p.y() << ',' << p.z() << ",0.0001\r\n";
  return out.str();
}

Eigen::Quaterniond about(const Eigen::Vector3d& axis, double angle) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis));
}

Eigen::Quaterniond attitude(const MocapLog& mocap, std::size_t i) {
  return {mocap.pose(i, 3), mocap.pose(i, 4), mocap.pose(i, 5), mocap.pose(i, 6)};
}

const Eigen::Vector3d X = Eigen::Vector3d::UnitX(), Y = Eigen::Vector3d::UnitY(),
                      Z = Eigen::Vector3d::UnitZ();
const Eigen::Quaterniond upright = Eigen::Quaterniond::Identity();

TEST(Motive, SpatialTakeWithALoss) {
  File file;
  file.rows = row(10, 0.1, upright, {1, 2, 3}) + "11,0.108333,,,,,,,,\r\n" +
              row(12, 0.116667, about(Y, 0.3), {4, 5, 6});
  const MotiveTake take = read(file);
  EXPECT_EQ(take.name, "throw 7");
  EXPECT_EQ(take.body, "bar");
  EXPECT_EQ(take.frame_rate, 120);
  EXPECT_EQ(take.lost, 1U);
  EXPECT_EQ(take.mocap.valid, (Flags{1, 0, 1}));
  EXPECT_EQ(take.mocap.time.data, (std::vector<double>{0.1, 0.108333, 0.116667}));
  ASSERT_EQ(take.mocap.pose.cols, 7U);
  const Series& p = take.mocap.pose;
  EXPECT_NEAR((Eigen::Vector3d(p(0, 0), p(0, 1), p(0, 2)) - Eigen::Vector3d(1, -3, 2)).norm(), 0, 1e-15);
  EXPECT_NEAR(attitude(take.mocap, 0).angularDistance(upright), 0, 1e-7);  // upright there, upright here
  EXPECT_TRUE(std::isnan(p(1, 0)));
  EXPECT_NEAR(attitude(take.mocap, 2).angularDistance(about(Z, 0.3)), 0, 1e-7);  // about the vertical
}

TEST(Motive, UnitsOfLength) {
  for (const auto& [units, metres] :
       {std::pair("Millimeters", 0.001), {"Centimeters", 0.01}, {"Meters", 1.0}}) {
    File file;
    file.units = units;
    file.rows = row(0, 0, upright, {250, 0, 0});
    EXPECT_DOUBLE_EQ(read(file).mocap.pose(0, 0), 250 * metres) << units;
  }
}

TEST(Motive, OriginHeadingAndCentreOfMass) {
  File file;
  file.rows = row(0, 0, about(Y, pi / 2), {1, 1, 0});  // the body's x along −Z
  MotiveOptions options;
  options.heading = pi / 2;  // thrown along −Z
  options.origin = {1, 0.5, 0};
  options.com = {0.2, 0, 0};
  options.time_offset = -3;
  const MotiveTake take = read(file, options);
  EXPECT_NEAR(take.mocap.pose(0, 0), 0.2, 1e-8);
  EXPECT_NEAR(take.mocap.pose(0, 1), 0, 1e-8);
  EXPECT_NEAR(take.mocap.pose(0, 2), 0.5, 1e-8);
  EXPECT_EQ(take.mocap.time(0), -3);
  EXPECT_NEAR(attitude(take.mocap, 0).angularDistance(upright), 0, 1e-7);
}

// The same throw along every heading is the same planar track: x and z as thrown, θ rising through several
// turns.
TEST(Motive, PlanarThrowAlongAnyHeading) {
  for (const double heading : {0.0, 0.7, pi, -2.0}) {
    File file;
    const auto turned = about(Y, heading);  // Y is up: a heading counter-clockwise from above
    for (int k = 0; k < 40; ++k) {
      const double t = 0.01 * k, theta = -2.5 + 30 * t;
      // about Z, from X towards Y: from forward to up
      file.rows += k % 7 == 3 ? std::to_string(k) + "," + std::to_string(t) + ",,,,,,,,\n"
                              : row(k, t, turned * about(Z, theta),
                                    turned * Eigen::Vector3d(2 * t, 1 - 5 * t * t, 0.1));
    }
    MotiveOptions options;
    options.dimension = 2;
    options.heading = heading;
    options.sigma_position = 1e-4;
    options.sigma_angle = 2e-3;
    const MotiveTake take = read(file, options);
    EXPECT_LT(take.out_of_plane, 1e-7);
    EXPECT_LT(take.out_of_plane_angle, 1e-7);
    EXPECT_EQ(take.mocap.pose.sigma, (std::vector<double>{1e-4, 1e-4, 2e-3}));
    for (std::size_t i = 0; i < 40; ++i) {
      if (!take.mocap.is_valid(i)) continue;
      const double t = 0.01 * double(i);
      EXPECT_NEAR(take.mocap.pose(i, 0), 2 * t, 1e-8);
      EXPECT_NEAR(take.mocap.pose(i, 1), 1 - 5 * t * t, 1e-8);
      EXPECT_NEAR(take.mocap.pose(i, 2), -2.5 + 30 * t, 1e-7);  // nine printed digits
    }
  }
}

// Whatever heading was asked for, wherever the body was carried before (here high up, and to the side), and
// whatever it does after it has hit the floor.
TEST(Motive, FindsTheHeadingOfTheThrow) {
  for (const double heading : {0.0, 0.7, 3.0, -2.0}) {
    File file;
    const auto turned = about(Y, heading);
    for (int k = -100; k < 0; ++k) {
      const double t = 0.01 * k;
      file.rows += row(k, t, upright, turned * Eigen::Vector3d(0, 1 - t, 2 * t));
    }
    for (int k = 0; k < 60; ++k) {
      const double t = 0.01 * k, rolled = std::max(0.0, t - 0.45);
      const double up = 1 + t - 5 * std::pow(std::min(t, 0.45), 2) + 2 * rolled;
      file.rows += row(k, t, upright, turned * Eigen::Vector3d(2 * t, up, 5 * rolled));
    }
    MotiveOptions options;
    options.dimension = 2;
    const MotiveTake take = read(file, options);
    ASSERT_TRUE(take.run.has_value());
    EXPECT_NEAR(std::remainder(take.run->heading - heading, 2 * pi), 0, 0.02) << heading;
    EXPECT_NEAR(take.run->length, 0.9, 0.03);
    EXPECT_LT(take.run->beside, 0.03);
  }
}

/// [rad] A window may reach a frame or two beyond either end of a flight.
constexpr double kEnds = 0.1;

// A short throw along X, and a long bounce to the side: what is known of the flight decides.
TEST(Motive, TheFlightIsTheOneThatIsKnown) {
  File file;
  for (int k = 0; k < 100; ++k) {
    const double t = 0.01 * k, u = t - 0.3;  // at 0.3 s it meets the floor
    file.rows += k < 30 ? row(k, t, upright, {2 * t, 0.4414 - 4.905 * t * t, 0})
                        : row(k, t, upright, {0.6, 3.4 * u - 4.905 * u * u, 2 * u});
  }
  MotiveOptions options;
  options.dimension = 2;
  EXPECT_NEAR(read(file, options).run.value().heading, -pi / 2, kEnds);  // the longest one
  const auto forward = [&](double length) {
    const auto run = read(file, options).run;
    ASSERT_TRUE(run.has_value());
    EXPECT_NEAR(run->heading, 0, kEnds);
    EXPECT_NEAR(run->length, length, 0.03);
  };
  options.free_flight = {0.05, 0.25};
  forward(0.4);
  options.gravity = 1.62;  // a known flight is believed
  forward(0.4);
  options.time_offset = 5;  // it is on the robot's clock
  EXPECT_FALSE(read(file, options).run.has_value());
}

TEST(Motive, NothingAfterTheLandingIsTheFlight) {
  File file;
  for (int k = 0; k < 100; ++k) {
    const double t = 0.01 * k, u = t - 0.2;  // it falls over an edge, and falls on to the side
    file.rows += k < 20 ? row(k, t, upright, {2 * t, 1 - 4.905 * t * t, 0})
                        : row(k, t, upright, {0.4, 0.8038 - 4.905 * u * u, 2 * u});
  }
  MotiveOptions options;
  options.dimension = 2;
  EXPECT_NEAR(read(file, options).run.value().heading, -pi / 2, kEnds);
  options.landing_height = 0.81;
  EXPECT_NEAR(read(file, options).run.value().heading, 0, kEnds);
}

TEST(Motive, AFlightFallsByTheCampaignsGravity) {
  File file, rest;
  for (int k = 0; k < 100; ++k) {
    const double t = 0.01 * k;
    file.rows += row(k, t, upright, {2 * t, 1 - 0.5 * 1.62 * t * t, 0});
    rest.rows += row(k, t, upright, {0, 0, 0});
  }
  MotiveOptions options;
  options.dimension = 2;
  EXPECT_FALSE(read(file, options).run.has_value());
  options.gravity = 1.62;
  EXPECT_NEAR(read(file, options).run.value().length, 1.98, 1e-6);
  EXPECT_FALSE(read(rest, options).run.has_value());
}

TEST(Motive, OutOfPlaneIsSaid) {
  File file;
  file.rows = row(0, 0, upright, {0, 0, 0}) + row(1, 0.1, about(Y, 0.1), {0, 0, 0.02});
  MotiveOptions options;
  options.dimension = 2;
  const MotiveTake take = read(file, options);
  EXPECT_NEAR(take.out_of_plane, 0.02, 1e-9);
  EXPECT_NEAR(take.out_of_plane_angle, 0.1, 1e-8);
}

// About the turned axes, in the order of the letters: R = R_a(α) R_b(β) R_c(γ).
TEST(Motive, EulerAnglesInEveryOrder) {
  for (const std::string order : {"XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"}) {
    File file;
    file.rotation = order;
    file.types = ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body";
    file.names = ",Name,bar,bar,bar,bar,bar,bar";
    file.ids = ",ID,9,9,9,9,9,9";
    file.kinds = ",,Rotation,Rotation,Rotation,Position,Position,Position";
    file.axes = "Frame,Time (Seconds),X,Y,Z,X,Y,Z";
    file.rows = "0,0,20,-35,110,0,0,0\n";
    const std::map<char, Eigen::Quaterniond> turn{
        {'X', about(X, 20 * pi / 180)}, {'Y', about(Y, -35 * pi / 180)}, {'Z', about(Z, 110 * pi / 180)}};
    const Eigen::Quaterniond motive = turn.at(order[0]) * turn.at(order[1]) * turn.at(order[2]);
    const Eigen::Quaterniond lift = about(X, pi / 2);
    EXPECT_NEAR(attitude(read(file).mocap, 0).angularDistance(lift * motive * lift.conjugate()), 0, 1e-7)
        << order;
  }
}

TEST(Motive, QuaternionsKeepTheirSign) {
  File file;
  Eigen::Quaterniond flipped = about(Y, 0.11);
  flipped.coeffs() *= -1;
  file.rows = row(0, 0, about(Y, 0.1), {0, 0, 0}) + row(1, 0.1, flipped, {0, 0, 0});
  const MotiveTake take = read(file);
  EXPECT_GT(attitude(take.mocap, 0).dot(attitude(take.mocap, 1)), 0.99);
}

// Markers beside the body, a row of parents, a column of time codes (format 1.24 and later), a second body.
TEST(Motive, OtherColumnsAreLeftAside) {
  File file;
  file.version = "1.25";
  file.types = ",Type,,Rigid Body Marker,Rigid Body,Rigid Body,Rigid Body,Marker,Rigid Body";
  file.names = ",Name,,bar:Marker1,bar,bar,bar,bar,hand";
  file.ids += "\r\n,Parent,,bar,,,,,";
  file.ids = ",ID,,1,2,2,2,3,4\r\n,Parent,,bar,,,,,";
  file.kinds = ",,,Position,Position,Position,Position,Position,Position";
  file.axes = "Frame,Time (Seconds),TimeCode,X,X,Y,Z,X,X";
  file.rows = "0,0.5,15:26:46:12.02,9,1,2,3,8,7\n";
  MotiveOptions options;
  options.body = "bar";
  const MotiveTake take = read(file, options);
  EXPECT_EQ(take.mocap.pose, (Series{1, 3, {1, -3, 2}, {}}));  // no rotation was exported
  EXPECT_THAT(take.bodies, testing::ElementsAre("bar", "hand"));
}

TEST(Motive, SaysWhichLineAndColumn) {
  const Scratch scratch;
  const std::string path = scratch / "take.csv";
  MotiveOptions options;
  const auto expect_text = [&](const std::string& text, const std::string& place, const std::string& reason) {
    put_bytes(path, text);
    expect_error<ImportError>([&] { read_motive_csv(path, options); }, path, place, reason);
  };
  const auto expect = [&](const auto& change, const std::string& place, const std::string& reason) {
    File file;
    file.rows = row(0, 0, upright, {1, 2, 3});
    change(file);
    expect_text(file.text(), place, reason);
  };
  expect_text("", "line 1", "is empty");
  expect_text("Frame,Time\n0,0\n", "line 1", "expected Motive's header");
  expect_text("Format Version,1.23,Length Units,Meters\n\n,Type,a\n", "line 3",
              "the file ends before the row 'Frame");
  expect([](File& f) { f.version = "1.1"; }, "line 1, column Format Version", "'1.1' is not supported");
  expect([](File& f) { f.units.clear(); }, "line 1, column Length Units", "does not say it");
  expect([](File& f) { f.units = "Inches"; }, "line 1, column Length Units", "'Inches' is not known");
  expect([](File& f) { f.space = "Local"; }, "line 1, column Coordinate Space", "'Local' is not supported");
  expect([](File& f) { f.rotation.clear(); }, "line 1, column Rotation Type", "does not say it");
  expect([](File& f) { f.rotation = "XXY"; }, "line 1, column Rotation Type", "'XXY' is not known");
  expect([](File& f) { f.rotation = "ZYX"; }, "line 1, column Rotation Type",
         "the columns of Rotation are X Y Z W");
  expect([](File& f) { f.rows.clear(); }, "line 1", "holds no frames");
  expect([](File& f) { f.rows = "0,0,,,,,,,,\n"; }, "line 1", "'bar' is lost in all of its 1 frames");
  expect([](File& f) { f.axes = "Frame,Time (Seconds),X,Y,Z,W,X,Y,Q,"; }, "line 7",
         "has no column Position Z");
  expect([](File& f) { f.axes = "Frame,Zeit,X,Y,Z,W,X,Y,Z,"; }, "line 7", "no column 'Time (Seconds)'");
  expect([](File& f) { f.names = ",Name,bar"; }, "line 4", "3 values, expected 10");
  expect([](File& f) { f.types = ",Type,Bone,Bone,Bone,Bone,Bone,Bone,Bone,Bone"; }, "line 3",
         "there is no rigid body");
  expect([](File& f) { f.names = ",Name,bar,bar,bar,bar,bar,bar,bar,rod"; }, "line 4",
         "say which rigid body: bar, rod");
  expect(
      [](File& f) {
        f.rows += row(1, 0, upright, {0, 0, 0});
      },
      "line 9, column Time (Seconds)", "time is not strictly increasing: 0 s after 0 s");
  expect([](File& f) { f.rows += "1,0.1,0,0,0,2,0,0,0,\n"; }, "line 9, column bar Rotation X",
         "quaternion of norm 2");
  expect([](File& f) { f.rows += "1,0.1,0,0,0,1,0,nan,0,\n"; }, "line 9, column bar Position Y",
         "not finite");
  expect([](File& f) { f.rows += "1,0.1,0,0,0,1,0"; }, "line 9", "is it cut off?");
  options.body = "bra";
  expect([](File&) {}, "line 4", "there is no rigid body 'bra'; did you mean 'bar'?");
  options.dimension = 4;
  EXPECT_THROW(read_motive_csv(path, options), std::invalid_argument);
  options = {};
  options.sigma_position = 1e-4;
  EXPECT_THROW(read_motive_csv(path, options), std::invalid_argument);
  options.sigma_angle = -1;
  EXPECT_THROW(read_motive_csv(path, options), std::invalid_argument);
}

// Whatever is left of a file that was cut off, it is read up to there or refused.
TEST(Motive, CutOffAnywhere) {
  const Scratch scratch;
  const std::string path = scratch / "take.csv";
  File file;
  for (int k = 0; k < 3; ++k) file.rows += row(k, 0.1 * k, about(Z, 0.3 * k), {1, 2, 3});
  const std::string text = file.text();
  int read_whole = 0;
  for (std::size_t n = 0; n < text.size(); ++n) {
    put_bytes(path, text.substr(0, n));
    try {
      const MotiveTake take = read_motive_csv(path, {});
      EXPECT_EQ(take.mocap.pose.rows, take.mocap.time.rows);
      ++read_whole;
    } catch (const ImportError& error) {
      EXPECT_EQ(error.file, path) << n;
    }
  }
  EXPECT_LT(read_whole, 40);  // after a whole line, or within its last cell, of which nothing is used
}

}  // namespace
}  // namespace unhand::datasets::test
