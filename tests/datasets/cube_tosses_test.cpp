// The import of measured cube tosses: which are kept, and how their noise is told.
#include "datasets/import_cube_tosses.hpp"

#include <cmath>
#include <iomanip>
#include <random>
#include <sstream>

#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

const std::string toss_header =
    "toss,k,t_s,x_m,y_m,z_m,qw,qx,qy,qz,vx,vy,vz,wx_body,wy_body,wz_body,before_first_contact\n";

std::string row(int toss, int k, bool before) {
  std::ostringstream out;
  out << toss << ',' << k << ',' << 0.006757 * k << ",0.2," << 0.01 * k << ",0.15,0.6,0,0.8,0,1,0,0,0,0,3,"
      << (before ? 1 : 0) << '\n';
  return out.str();
}

std::string toss(int number, int before, int after) {
  std::string text;
  for (int k = 0; k < before + after; ++k) text += row(number, k, k < before);
  return text;
}

TEST(CubeTosses, KeepsWhatFliesLongEnough) {
  const Scratch scratch;
  std::string text = toss_header;
  for (int n = 0; n < 10; ++n) text += toss(n, n == 3 ? 7 : 8 + n, 5);
  put_bytes(scratch / "t.csv", text);
  ImportReport report;
  const ThrowLog log = import_cube_tosses(scratch / "t.csv", {}, &report);

  EXPECT_EQ(report.tosses, 10);
  EXPECT_EQ(report.kept, 9);
  EXPECT_EQ(report.train, 7);
  EXPECT_EQ(report.test, 2);
  ASSERT_EQ(report.dropped.size(), 1U);
  EXPECT_EQ(report.dropped[0].toss, 3);
  EXPECT_EQ(report.dropped[0].samples, 7);
  EXPECT_THAT(report.dropped[0].reason, testing::HasSubstr("fewer than 8"));

  EXPECT_EQ(log.dimension, 3);
  EXPECT_EQ(log.objects.at("cube").inertia->size(), 3U);
  EXPECT_THAT(log.source, testing::HasSubstr("as published"));
  EXPECT_THAT(log.source, testing::HasSubstr("sigma estimated by the importer"));
  const Throw& last = log.throws.back();
  EXPECT_EQ(last.id, "toss-0009");
  EXPECT_EQ(last.repetition, 9);
  EXPECT_EQ(last.split, Split::test);
  EXPECT_EQ(last.condition, "toss");
  EXPECT_EQ(last.mocap->pose.rows, 17U + 5U);  // the whole series, contact included
  EXPECT_EQ(last.free_flight->first, 0);
  EXPECT_DOUBLE_EQ(last.free_flight->second, 0.006757 * 16);
  EXPECT_EQ(last.mocap->pose(4, 1), 0.04);
}

// What a set scatters by is declared of it, whatever the times between its samples are; a glitch is no noise.
TEST(CubeTosses, DeclaresTheScatterOfTheSamples) {
  const Scratch scratch;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  constexpr double sigma = 4e-4, sigma_q = 1.5e-3;
  std::ostringstream out;
  out << toss_header << std::setprecision(12);
  for (int n = 0; n < 60; ++n) {
    double t = 0;
    for (int k = 0; k < 20; ++k, t += k % 5 == 2 ? 0.02 : 0.004 + 0.002 * (k % 3)) {
      const double half = 3 * t / 2, glitch = k == 9 && n % 10 == 0 ? 0.05 : 0;
      double q[4] = {std::cos(half), 0, std::sin(half), 0}, norm = 0;
      for (double& x : q) x += sigma_q * normal(random), norm += x * x;
      out << n << ',' << k << ',' << t << ',' << 2 * t + glitch + sigma * normal(random) << ','
          << sigma * normal(random) << ',' << 1 - 4.905 * t * t + sigma * normal(random);
      for (const double x : q) out << ',' << (n % 2 == 0 ? 1 : -1) * x / std::sqrt(norm);
      out << ",0,0,0,0,3,0,1\n";
    }
  }
  put_bytes(scratch / "t.csv", out.str());
  const ThrowLog log = import_cube_tosses(scratch / "t.csv");
  const auto& declared = log.throws.front().mocap->pose.sigma;
  ASSERT_EQ(declared.size(), 7U);
  // 1020 differences per axis, three of four samples shared: σ is known to 4 %.
  for (std::size_t a = 0; a < 3; ++a) EXPECT_NEAR(declared[a], sigma, 0.15 * sigma);
  for (std::size_t a = 3; a < 7; ++a) EXPECT_NEAR(declared[a], sigma_q, 0.15 * sigma_q);
}

TEST(CubeTosses, ResultIsALogThatRoundTrips) {
  const Scratch scratch;
  put_bytes(scratch / "t.csv", toss_header + toss(0, 9, 2) + toss(4, 12, 0));
  const ThrowLog log = import_cube_tosses(scratch / "t.csv");
  EXPECT_EQ(reread(log), log);
}

// Columns are found by their names: another order, more of them, fewer that nobody reads, a byte order mark.
TEST(CubeTosses, ReadsColumnsByName) {
  const Scratch scratch;
  put_bytes(scratch / "t.csv", toss_header + toss(0, 9, 2) + toss(4, 12, 0));
  const ThrowLog expected = import_cube_tosses(scratch / "t.csv");
  const auto read = [&](const std::string& first, const std::string& separator, auto cells) {
    std::istringstream rows(toss(0, 9, 2) + toss(4, 12, 0));
    std::string text = first + "\n", line;
    while (std::getline(rows, line)) {
      std::vector<std::string> all;
      std::istringstream in(line);
      for (std::string cell; std::getline(in, cell, ',');) all.push_back(cell);
      const std::vector<std::string> wanted = cells(all);
      for (std::size_t j = 0; j < wanted.size(); ++j) text += (j > 0 ? separator : "") + wanted[j];
      text += "\n";
    }
    put_bytes(scratch / "u.csv", text);
    return import_cube_tosses(scratch / "u.csv");
  };
  using Cells = std::vector<std::string>;
  EXPECT_EQ(read("\xef\xbb\xbf" + toss_header.substr(0, toss_header.size() - 1), ",",
                 [](const Cells& c) { return c; }),
            expected);
  EXPECT_EQ(read("note,before_first_contact,qz,qy,qx,qw,z_m,y_m,x_m,t_s,k,toss", ",",
                 [](const Cells& c) {
                   return Cells{"\"a, b\"", c[16], c[9], c[8], c[7], c[6],
                                c[5],       c[4],  c[3], c[2], c[1], c[0]};
                 }),
            expected);
  EXPECT_EQ(read("toss;k;t_s;x_m;y_m;z_m;qw;qx;qy;qz;before_first_contact", ";",
                 [](const Cells& c) {
                   return Cells{c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[16]};
                 }),
            expected);
  // As a table of reals, or of truth values, is written.
  EXPECT_EQ(read("toss,k,t_s,x_m,y_m,z_m,qw,qx,qy,qz,before_first_contact", ",",
                 [](const Cells& c) {
                   return Cells{c[0] + ".0", c[1] + ".000e+00", c[2], c[3], c[4], c[5], c[6], c[7], c[8],
                                c[9],        c[16] + ".00"};
                 }),
            expected);
  EXPECT_EQ(
      read("toss,k,t_s,x_m,y_m,z_m,qw,qx,qy,qz,before_first_contact", ",",
           [](const Cells& c) {
             return Cells{
                 c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[16] == "1" ? "True" : "False"};
           }),
      expected);
}

// Half the space diagonal: with the centre above it, no orientation touches the table.
TEST(CubeTosses, LandingHeightClearsEveryOrientation) {
  const Scratch scratch;
  put_bytes(scratch / "t.csv", toss_header + toss(0, 9, 2));
  EXPECT_NEAR(import_cube_tosses(scratch / "t.csv").landing_height, std::hypot(0.0524, 0.0524, 0.0524),
              1e-15);
}

TEST(CubeTosses, SaysWhichLineAndColumn) {
  const Scratch scratch;
  const std::string file = scratch / "t.csv", start = toss_header + toss(0, 9, 2);
  const auto expect = [&](const std::string& text, const std::string& place, const std::string& reason) {
    put_bytes(file, text);
    expect_error<ImportError>([&] { import_cube_tosses(file); }, file, place, reason);
  };
  const std::string tail = "0.15,0.6,0,0.8,0,1,0,0,0,0,3,1\n";
  expect("", "line 1", "holds no tosses");
  expect(toss_header, "line 1", "holds no tosses");
  expect(toss(0, 9, 2), "line 1", "header is missing");
  expect("toss,k,t_s,x_m,y_m,z,qw,qx,qy,qz,before_first_contact\n0,0,0,0,0,0,1,0,0,0,1\n", "line 1",
         "there is no column 'z_m'");
  expect("toss,k,t_s,x_m,y_m,z_m,qw,qx,qy,qz,x_m,before_first_contact\n", "line 1, column x_m",
         "stands twice in the header");
  expect(start + "1,0,0,0.2,0,x.5,0.6,0,0.8,0,1,0,0,0,0,3,1\n", "line 13, column z_m",
         "'x.5' is not a number");
  expect(start + "1,0,0,0.2,0,,0.6,0,0.8,0,1,0,0,0,0,3,1\n", "line 13, column z_m", "'' is not a number");
  expect(start + "1,0,0,0.2,nan," + tail, "line 13, column y_m", "is not finite");
  expect(start + "1.5,0,0,0.2,0," + tail, "line 13, column toss", "'1.5' is not an integer");
  expect(start + "1,0,0,0.2," + tail, "line 13", "16 values, expected 17");
  expect(start + "1,0,0,0.2,0,0.15,0.6,0,0.8,0,1,0,0,0,0,3,2\n", "line 13, column before_first_contact",
         "2 is not 0 or 1");
  expect(start + "1,0,0,0.2,0,0.15,0.6,0,0.9,0,1,0,0,0,0,3,1\n", "line 13, column qw",
         "quaternion of norm 1.08");
  expect(start + row(1, 0, true) + row(1, 2, true), "line 14, column k", "sample 2 after 0");
  expect(start + row(0, 11, true), "line 13, column before_first_contact", "back to 1");
  expect(start + toss(1, 9, 0) + row(0, 0, true), "line 22, column toss", "appears in two places");
  expect(toss_header + toss(0, 3, 3), "line 1", "none of 1 tosses has 8 samples");
  std::filesystem::remove(file);
  expect_error<ImportError>([&] { import_cube_tosses(file); }, file, "", "no such file");
}

}  // namespace
}  // namespace unhand::datasets::test
