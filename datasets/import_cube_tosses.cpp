#include "datasets/import_cube_tosses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "datasets/channel_rules.hpp"
#include "datasets/channel_table.hpp"
#include "datasets/csv.hpp"
#include "datasets/near_miss.hpp"
#include "datasets/sample_noise.hpp"

namespace unhand::datasets {
namespace {

constexpr double kTossSigmaPosition = 3e-5, kTossSigmaQuaternion = 2e-4;  // [m], [1]: at least
constexpr std::size_t kTossMinSamples = 8;                                // before the first contact
constexpr int kTossTestEvery = 5;                                         // one in five is held out

/// The columns that are read, in any order; others are passed over.
constexpr std::string_view toss_columns = "toss,k,t_s,x_m,y_m,z_m,qw,qx,qy,qz,before_first_contact";
constexpr std::size_t n_toss_columns = 11;

struct Row {
  int toss = 0, k = 0;
  bool before_contact = false;
  double t = 0;
  std::array<double, 7> pose{};
};

struct Toss {
  std::vector<Row> rows;
  std::size_t flight = 0;  // samples before the first contact
};

/// Where these columns stand.
struct TossColumns {
  std::size_t width = 0;
  std::array<std::size_t, n_toss_columns> index{};
};

TossColumns toss_columns_of(const CsvLine& line) {
  if (line.is_number(0))
    line.fail("", fmt::format("the header is missing, expected one with '{}'", toss_columns));
  TossColumns out;
  out.width = line.cells.size();
  for (std::size_t j = 0; j < n_toss_columns; ++j) {
    const std::string name(part_of(toss_columns, j));
    const auto found = std::find(line.cells.begin(), line.cells.end(), name);
    if (found == line.cells.end())
      line.fail("", unknown_name(fmt::format("there is no column '{}'", name), name, line.cells));
    if (std::find(found + 1, line.cells.end(), name) != line.cells.end())
      line.fail(name, "stands twice in the header");
    out.index[j] = static_cast<std::size_t>(found - line.cells.begin());
  }
  return out;
}

/// 0 or 1, also as False or True, which is what a table of truth values is written as.
bool flag_in(const CsvLine& line, std::size_t i, std::string_view name) {
  for (const auto& [word, flag] :
       {std::pair{"True", true}, {"true", true}, {"False", false}, {"false", false}})
    if (line.cells[i] == word) return flag;
  const int flag = line.integer(i, name);
  if (flag != 0 && flag != 1) line.fail(name, fmt::format("{} is not 0 or 1", flag));
  return flag == 1;
}

Row parse_row(const CsvLine& line, const TossColumns& columns) {
  line.expect_cells(columns.width);
  const auto integer = [&](std::size_t j) {
    return line.integer(columns.index[j], part_of(toss_columns, j));
  };
  Row row;
  row.toss = integer(0);
  row.k = integer(1);
  row.t = line.real(columns.index[2], "t_s");
  for (std::size_t j = 0; j < 7; ++j)
    row.pose[j] = line.real(columns.index[3 + j], part_of(toss_columns, 3 + j));
  row.before_contact = flag_in(line, columns.index[10], part_of(toss_columns, 10));
  if (row.toss < 0) line.fail("toss", fmt::format("{} is negative", row.toss));
  double norm = 0;
  for (std::size_t j = 3; j < 7; ++j) norm += row.pose[j] * row.pose[j];
  norm = std::sqrt(norm);
  if (std::abs(norm - 1) > kQuaternionTolerance)
    line.fail("qw", fmt::format("quaternion of norm {:.6g}, expected 1", norm));
  return row;
}

/// The rows of one toss follow one another in the file: samples counted from 0, time rising, flag falling
/// once.
void append(const CsvLine& line, std::vector<Toss>& tosses, std::set<int>& seen, const Row& row) {
  if (tosses.empty() || tosses.back().rows.back().toss != row.toss) {
    if (!seen.insert(row.toss).second)
      line.fail("toss", fmt::format("toss {} appears in two places", row.toss));
    if (row.k != 0) line.fail("k", fmt::format("a toss starts at sample {}, expected 0", row.k));
    tosses.emplace_back();
  } else {
    const Row& last = tosses.back().rows.back();
    if (row.k != last.k + 1) line.fail("k", fmt::format("sample {} after {}", row.k, last.k));
    if (row.t <= last.t)
      line.fail("t_s", fmt::format("time is not strictly increasing: {} after {}", row.t, last.t));
    if (row.before_contact && !last.before_contact)
      line.fail("before_first_contact", "back to 1 after contact");
  }
  tosses.back().rows.push_back(row);
  tosses.back().flight += row.before_contact;
}

std::vector<Toss> read_tosses(const std::filesystem::path& csv, int& rows) {
  CsvReader reader(csv, '\0');
  std::vector<Toss> tosses;
  std::set<int> seen;
  CsvLine line;
  TossColumns columns;
  if (reader.next(line)) columns = toss_columns_of(line);
  for (; reader.next(line); ++rows) append(line, tosses, seen, parse_row(line, columns));
  if (tosses.empty()) reader.fail(1, "holds no tosses");
  return tosses;
}

/// Half the rotation vector that turns one row's attitude into the other's, as its quaternion's noise has it.
std::array<double, 3> half_turn(const Row& from, const Row& to) {
  const std::span<const double, 4> p(from.pose.data() + 3, 4), q(to.pose.data() + 3, 4);
  const double w = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3];
  std::array<double, 3> v{p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2],
                          p[0] * q[2] - p[2] * q[0] - p[3] * q[1] + p[1] * q[3],
                          p[0] * q[3] - p[3] * q[0] - p[1] * q[2] + p[2] * q[1]};
  const double sine = std::hypot(v[0], v[1], v[2]);
  const double factor = sine > 1e-12 ? std::atan2(sine, std::abs(w)) / sine : 1;
  for (double& x : v) x *= w < 0 ? -factor : factor;
  return v;
}

/// x, y, z and every part of the quaternion: what was found of the published tosses, or more where the
/// samples in the air scatter by more.
std::vector<double> sigma_of(const std::vector<Toss>& tosses) {
  std::array<SampleNoise, 3> position;
  SampleNoise attitude;
  for (const Toss& toss : tosses)
    for (std::size_t i = 3; i < toss.flight; ++i) {
      const Row* row = &toss.rows[i - 3];
      const std::array<double, 4> times{row[0].t, row[1].t, row[2].t, row[3].t};
      std::array<std::array<double, 3>, 4> turns;
      for (std::size_t k = 0; k < 4; ++k) turns[k] = half_turn(row[0], row[k]);
      for (std::size_t a = 0; a < 3; ++a) {
        position[a].add(times, {row[0].pose[a], row[1].pose[a], row[2].pose[a], row[3].pose[a]});
        attitude.add(times, {turns[0][a], turns[1][a], turns[2][a], turns[3][a]});
      }
    }
  std::vector<double> out;
  for (const SampleNoise& axis : position) out.push_back(std::max(kTossSigmaPosition, axis.sigma()));
  out.resize(7, std::max(kTossSigmaQuaternion, attitude.sigma()));
  return out;
}

Throw make_throw(const Toss& toss, const std::vector<double>& sigma) {
  const std::size_t n = toss.rows.size();
  Throw out;
  out.repetition = toss.rows.front().toss;
  out.id = fmt::format("toss-{:04}", out.repetition);
  out.object = "cube";
  out.condition = "toss";
  out.split = out.repetition % kTossTestEvery == kTossTestEvery - 1 ? Split::test : Split::train;
  MocapLog& mocap = out.mocap.emplace();
  mocap.time = {n, 1, {}, {}};
  mocap.pose = {n, 7, {}, sigma};
  const double start = toss.rows.front().t;
  for (const Row& row : toss.rows) {
    mocap.time.data.push_back(row.t - start);
    mocap.pose.data.insert(mocap.pose.data.end(), row.pose.begin(), row.pose.end());
  }
  normalise_quaternions(mocap.pose, {});
  out.free_flight = {mocap.time(0), mocap.time(toss.flight - 1)};
  return out;
}

void check_options(const CubeTossOptions& options) {
  const auto& [ix, iy, iz] = options.inertia;
  for (const auto& [name, value] :
       {std::pair{"mass", options.mass}, {"side", options.side}, {"inertia", std::min({ix, iy, iz})}})
    if (!(value > 0 && std::isfinite(value)))
      throw std::invalid_argument(fmt::format("{}: {} is not > 0", name, value));
}

}  // namespace

ThrowLog import_cube_tosses(const std::filesystem::path& csv, const CubeTossOptions& options,
                            ImportReport* report) {
  check_options(options);
  ImportReport counts;
  const std::vector<Toss> tosses = read_tosses(csv, counts.rows);
  counts.tosses = static_cast<int>(tosses.size());

  ThrowLog log;
  log.dimension = 3;
  log.title = "cube tosses";
  log.source =
      options.source +
      "; sigma estimated by the importer from the scatter about a smooth flight, not stated by the source";
  log.licence = options.licence;
  log.gravity = options.gravity;
  log.landing_height = std::sqrt(3.0) / 2 * options.side;
  Object cube;
  cube.mass = options.mass;
  cube.inertia = std::vector<double>(options.inertia.begin(), options.inertia.end());
  cube.dims = {options.side, options.side, options.side};
  log.objects.emplace("cube", cube);

  const std::vector<double> sigma = sigma_of(tosses);
  for (const Toss& toss : tosses) {
    const int number = toss.rows.front().toss;
    if (toss.flight < kTossMinSamples) {
      counts.dropped.push_back(
          {number, static_cast<int>(toss.flight),
           fmt::format("{} samples before contact, fewer than {}", toss.flight, kTossMinSamples)});
      continue;
    }
    log.throws.push_back(make_throw(toss, sigma));
    ++(log.throws.back().split == Split::train ? counts.train : counts.test);
  }
  counts.kept = static_cast<int>(log.throws.size());
  if (log.throws.empty()) {
    throw ImportError(
        csv.string(), "line 1",
        fmt::format("none of {} tosses has {} samples before contact", counts.tosses, kTossMinSamples));
  }
  std::sort(log.throws.begin(), log.throws.end(), [](const Throw& a, const Throw& b) { return a.id < b.id; });
  validate(log, csv.string());
  if (report != nullptr) *report = std::move(counts);
  return log;
}

}  // namespace unhand::datasets
