#include "datasets/import_motive.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>

#include "datasets/assemble.hpp"
#include "datasets/channel_rules.hpp"
#include "datasets/csv.hpp"
#include "datasets/near_miss.hpp"
#include "datasets/units.hpp"

namespace unhand::datasets {
namespace {

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

/// The first line: names and values in turn.
struct TakeHeader {
  std::string version, take, rotation;
  double frame_rate = 0;
  const Unit* length = nullptr;
};

std::optional<std::size_t> cell_of(const CsvLine& line, std::string_view name) {
  const auto found = std::find(line.cells.begin(), line.cells.end(), name);
  if (found == line.cells.end() || found + 1 == line.cells.end()) return {};
  return static_cast<std::size_t>(found - line.cells.begin()) + 1;
}

TakeHeader parse_take_header(const CsvLine& line) {
  const auto text = [&](std::string_view name) {
    const auto i = cell_of(line, name);
    return i ? line.cells[*i] : std::string();
  };
  TakeHeader out;
  if (line.cells.front() != "Format Version")
    line.fail("",
              "expected Motive's header, 'Format Version,1.23,Take Name,...': export with TakeHeader "
              "Information on");
  out.version = text("Format Version");
  if (out.version.size() < 4 || !out.version.starts_with("1.2"))
    line.fail("Format Version", fmt::format("'{}' is not supported, expected 1.20 to 1.29", out.version));
  out.take = text("Take Name");
  const std::string space = text("Coordinate Space");
  if (!space.empty() && space != "Global")
    line.fail("Coordinate Space", fmt::format("'{}' is not supported, expected Global", space));
  const std::string units = text("Length Units");
  if (units.empty())
    line.fail("Length Units", "the header does not say it, expected Millimeters, Centimeters or Meters");
  out.length = find_unit(units == "Millimeters"   ? "mm"
                         : units == "Centimeters" ? "cm"
                         : units == "Meters"      ? "m"
                                                  : "?");
  if (out.length == nullptr)
    line.fail("Length Units",
              fmt::format("'{}' is not known, expected Millimeters, Centimeters or Meters", units));
  out.rotation = text("Rotation Type");
  if (const auto i = cell_of(line, "Export Frame Rate"); i && line.is_number(*i))
    out.frame_rate = line.real(*i, "Export Frame Rate");
  else if (const auto j = cell_of(line, "Capture Frame Rate"); j && line.is_number(*j))
    out.frame_rate = line.real(*j, "Capture Frame Rate");
  return out;
}

/// Where the body's numbers stand in a row.
struct TakeColumns {
  std::size_t time = 0, width = 0;
  std::array<std::size_t, 3> position{};
  std::vector<std::size_t> rotation;  // X Y Z W, X Y Z, or none
  std::vector<std::string> bodies;
  std::string body;
};

/// The rows between the header and the data: types, names, IDs, perhaps parents, then what a column is, then
/// its axis beside "Frame" and "Time (Seconds)".
TakeColumns find_columns(CsvReader& reader, const std::string& wanted) {
  std::vector<CsvLine> rows(1);
  while (reader.next(rows.back()) && rows.back().cells.front() != "Frame") {
    if (rows.size() > 8)
      rows.back().fail("", "expected the row 'Frame,Time (Seconds),...' within ten lines of the header");
    rows.emplace_back();
  }
  const CsvLine& axes = rows.back();
  if (axes.cells.empty() || axes.cells.front() != "Frame")
    reader.fail(reader.line(), "the file ends before the row 'Frame,Time (Seconds),...'");
  if (rows.size() < 4)
    axes.fail("", "expected rows of types, names and Rotation or Position before this one");
  const CsvLine &types = rows[0], &names = rows[1], &kinds = rows[rows.size() - 2];
  for (const CsvLine* row : {&types, &names, &kinds}) row->expect_cells(axes.cells.size());

  TakeColumns out;
  out.width = axes.cells.size();
  const auto clock = std::find_if(axes.cells.begin(), axes.cells.end(),
                                  [](const std::string& cell) { return cell.starts_with("Time ("); });
  if (clock == axes.cells.end()) axes.fail("", "there is no column 'Time (Seconds)'");
  if (*clock != "Time (Seconds)") axes.fail(*clock, "expected 'Time (Seconds)'");
  out.time = static_cast<std::size_t>(clock - axes.cells.begin());
  for (std::size_t j = 0; j < out.width; ++j)
    if (types.cells[j] == "Rigid Body" &&
        std::find(out.bodies.begin(), out.bodies.end(), names.cells[j]) == out.bodies.end())
      out.bodies.push_back(names.cells[j]);
  if (out.bodies.empty()) types.fail("", "there is no rigid body in it: export with Rigid Bodies on");
  if (wanted.empty() && out.bodies.size() > 1)
    names.fail("", fmt::format("say which rigid body: {}", fmt::join(out.bodies, ", ")));
  out.body = wanted.empty() ? out.bodies.front() : wanted;
  if (std::find(out.bodies.begin(), out.bodies.end(), out.body) == out.bodies.end())
    names.fail("", unknown_name(fmt::format("there is no rigid body '{}'", wanted), wanted, out.bodies));

  const auto find = [&](std::string_view kind, std::string_view axis) -> std::optional<std::size_t> {
    for (std::size_t j = 0; j < out.width; ++j)
      if (types.cells[j] == "Rigid Body" && names.cells[j] == out.body && kinds.cells[j] == kind &&
          axes.cells[j] == axis)
        return j;
    return {};
  };
  const std::string_view letters[] = {"X", "Y", "Z", "W"};
  for (std::size_t j = 0; j < 3; ++j) {
    const auto column = find("Position", letters[j]);
    if (!column)
      axes.fail("", fmt::format("rigid body '{}' has no column Position {}", out.body, letters[j]));
    out.position[j] = *column;
  }
  for (const std::string_view letter : letters)
    if (const auto column = find("Rotation", letter)) out.rotation.push_back(*column);
  if (out.rotation.size() == 1 || out.rotation.size() == 2)
    axes.fail("", fmt::format("rigid body '{}' has some columns of Rotation and not others", out.body));
  return out;
}

/// Position and rotation in Motive's axes, for the rows of one file.
class Pose {
 public:
  Pose(const CsvLine& header, const TakeHeader& facts, const TakeColumns& columns)
      : facts_(facts), columns_(columns) {
    if (columns.rotation.empty()) return;
    const std::string& type = facts.rotation;
    std::string sorted = type.substr(0, 3);
    std::sort(sorted.begin(), sorted.end());
    euler_ = sorted == "XYZ";
    if (type.empty())
      header.fail("Rotation Type", "the header does not say it, expected Quaternion or XYZ, ZYX, ...");
    if (!euler_ && type != "Quaternion")
      header.fail("Rotation Type",
                  fmt::format("'{}' is not known, expected Quaternion or XYZ, ZYX, ...", type));
    if ((columns.rotation.size() == 4) == euler_)
      header.fail("Rotation Type", fmt::format("'{}', but the columns of Rotation are {}", type,
                                               euler_ ? "X Y Z W" : "X Y Z"));
  }

  bool lost(const CsvLine& line) const {
    const auto blank = [&](std::size_t j) { return line.cells[j].empty(); };
    return std::any_of(columns_.position.begin(), columns_.position.end(), blank) ||
           std::any_of(columns_.rotation.begin(), columns_.rotation.end(), blank);
  }

  Vector3d position(const CsvLine& line) const {
    Vector3d p;
    for (std::size_t j = 0; j < 3; ++j)
      p[static_cast<Eigen::Index>(j)] =
          facts_.length->to_si(line.real(columns_.position[j], column("Position", j)));
    return p;
  }

  Quaterniond rotation(const CsvLine& line) const {
    std::array<double, 4> v{0, 0, 0, 1};
    for (std::size_t j = 0; j < columns_.rotation.size(); ++j)
      v[j] = line.real(columns_.rotation[j], column("Rotation", j));
    if (euler_) {
      Quaterniond q = Quaterniond::Identity();
      for (std::size_t k = 0; k < 3; ++k) {
        const auto axis = facts_.rotation[k] - 'X';
        q = q * Quaterniond(AngleAxisd(v[static_cast<std::size_t>(axis)] * std::numbers::pi / 180,
                                       Vector3d::Unit(axis)));
      }
      return q;
    }
    const Quaterniond q(v[3], v[0], v[1], v[2]);
    if (!(std::abs(q.norm() - 1) <= kQuaternionTolerance))
      line.fail(column("Rotation", 0), fmt::format("quaternion of norm {:.6g}, expected 1", q.norm()));
    return q.normalized();
  }

 private:
  std::string column(std::string_view kind, std::size_t j) const {
    return fmt::format("{} {} {}", columns_.body, kind, "XYZW"[j]);
  }

  const TakeHeader& facts_;
  const TakeColumns& columns_;
  bool euler_ = false;
};

Vector3d vector(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }

/// C: from Y up to z up.
Vector3d upright(const Vector3d& a) { return {a.x(), -a.z(), a.y()}; }

void check_options(const MotiveOptions& options) {
  if (options.dimension != 2 && options.dimension != 3)
    throw std::invalid_argument(fmt::format("dimension: {} is not 2 or 3", options.dimension));
  for (const auto& [name, sigma] :
       {std::pair("sigma_position", options.sigma_position), {"sigma_angle", options.sigma_angle}})
    if (!(std::isfinite(sigma) && sigma >= 0))
      throw std::invalid_argument(fmt::format("{}: {} is not >= 0", name, sigma));
  if (!(std::isfinite(options.gravity) && options.gravity >= 0))
    throw std::invalid_argument(fmt::format("gravity: {} is not >= 0", options.gravity));
}

/// A frame in which the body was seen: upright, not turned by any heading.
struct Seen {
  double t;  // s
  Vector3d at;
};

/// Whether frames [first, last] are a free flight: on a parabola that gravity bends, and nothing else.
bool is_free(const std::vector<Seen>& seen, std::size_t first, std::size_t last, double gravity) {
  const double other = std::min(2.5, gravity / 3);  // m/s², a drag or a tracker's noise; no rest
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero(), b = A;
  for (std::size_t i = first; i <= last; ++i) {
    const double t = seen[i].t - seen[first].t;
    const Vector3d powers(1, t, t * t);
    A += powers * powers.transpose();
    b += powers * (seen[i].at - seen[first].at).transpose();
  }
  const Vector3d bend = 2 * A.ldlt().solve(b).row(2).transpose();
  return (bend + Vector3d(0, 0, gravity)).norm() <= other;
}

/// First and last frame of the longest free flight; twice the same where there is none.
std::pair<std::size_t, std::size_t> longest_flight(const std::vector<Seen>& seen, double gravity) {
  constexpr double kWindow = 0.1;     // s, at least
  constexpr std::size_t kFrames = 6;  // in it, at least
  std::size_t begin = 0, end = 0, from = 0;
  bool was_free = false;  // where it hits something, some windows are not
  for (std::size_t i = 0, j = 0; i < seen.size(); ++i) {
    while (j < seen.size() && (seen[j].t - seen[i].t < kWindow || j + 1 < i + kFrames)) ++j;
    if (j == seen.size()) break;
    const bool free = is_free(seen, i, j, gravity);
    if (free && !was_free) from = i;
    was_free = free;
    if (free && seen[j].t - seen[from].t > seen[end].t - seen[begin].t) begin = from, end = j;
  }
  return {begin, end};
}

/// Where the body runs over the floor in its free flight: a throw may be carried anywhere before, and bounce
/// after.
std::optional<FlightRun> run_of(std::vector<Seen> seen, const MocapLog& mocap, const MotiveOptions& options) {
  const auto& known = options.free_flight;
  if (known) {
    std::erase_if(seen, [&](const Seen& one) { return one.t < known->first || one.t > known->second; });
  } else if (options.landing_height) {
    const auto landing = landing_of(mocap, options.dimension, *options.landing_height);
    if (landing) std::erase_if(seen, [&](const Seen& one) { return one.t > landing->time(0); });
  }
  if (seen.empty()) return {};
  const auto [begin, end] =
      known ? std::pair(std::size_t{0}, seen.size() - 1) : longest_flight(seen, options.gravity);
  if (end == begin) return {};
  const Eigen::Vector2d way = (seen[end].at - seen[begin].at).head<2>(), along = way.normalized();
  FlightRun out{way.norm(), std::atan2(along.y(), along.x()), 0};
  for (std::size_t i = begin; i <= end; ++i) {
    const Eigen::Vector2d off = (seen[i].at - seen[begin].at).head<2>();
    out.beside = std::max(out.beside, std::abs(along.x() * off.y() - along.y() * off.x()));
  }
  return out;
}

/// The log's poses, sample by sample.
class Track {
 public:
  Track(MotiveTake& take, const MotiveOptions& options, bool rotations)
      : take_(take),
        options_(options),
        turned_(AngleAxisd(-options.heading, Vector3d::UnitZ())),
        cols_(options.dimension == 2 ? 3
              : rotations            ? 7
                                     : 3) {
    const double p = options.sigma_position, a = options.sigma_angle;
    take.mocap.pose = {0, cols_, {}, {}};
    std::vector<double>& sigma = take.mocap.pose.sigma;
    if (p > 0 && options.dimension == 2 && a > 0) sigma = {p, p, a};
    if (p > 0 && cols_ == 7 && a > 0) sigma = {p, p, p, a / 2, a / 2, a / 2, a / 2};
    if (p > 0 && options.dimension == 3 && cols_ == 3) sigma = {p, p, p};
  }

  void add_lost() {
    take_.mocap.pose.data.insert(take_.mocap.pose.data.end(), cols_,
                                 std::numeric_limits<double>::quiet_NaN());
    add_flag(0);
    ++take_.lost;
  }

  void add(double t, const Vector3d& pivot, const Quaterniond& q_M) {
    const Vector3d p_M = pivot + q_M * vector(options_.com) - vector(options_.origin);
    frames_.push_back({t, upright(p_M)});
    const Vector3d p = turned_ * frames_.back().at;
    const Vector3d axis = upright(q_M.vec());  // C q C⁻¹ turns about the turned axis
    Quaterniond q = turned_ * Quaterniond(q_M.w(), axis.x(), axis.y(), axis.z());
    if (seen_ && q.coeffs().dot(last_.coeffs()) < 0) q.coeffs() *= -1;
    if (options_.dimension == 2) {
      const Vector3d x = q * Vector3d::UnitX();
      double theta = std::atan2(x.z(), x.x());
      if (seen_) theta -= 2 * std::numbers::pi * std::round((theta - theta_) / (2 * std::numbers::pi));
      if (!seen_) first_y_ = p.y();
      take_.out_of_plane = std::max(take_.out_of_plane, std::abs(p.y() - first_y_));
      take_.out_of_plane_angle =
          std::max(take_.out_of_plane_angle, std::asin(std::min(1.0, std::abs(x.y()))));
      theta_ = theta;
      append({p.x(), p.z(), theta});
    } else if (cols_ == 7) {
      append({p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
    } else {
      append({p.x(), p.y(), p.z()});
    }
    last_ = q;
    seen_ = true;
    add_flag(1);
  }

  const std::vector<Seen>& frames() const { return frames_; }

 private:
  void append(std::initializer_list<double> row) {
    take_.mocap.pose.data.insert(take_.mocap.pose.data.end(), row);
  }
  void add_flag(std::uint8_t flag) {
    take_.mocap.valid.push_back(flag);
    ++take_.mocap.pose.rows;
  }

  MotiveTake& take_;
  const MotiveOptions& options_;
  Quaterniond turned_, last_ = Quaterniond::Identity();
  std::size_t cols_;
  double theta_ = 0, first_y_ = 0;
  bool seen_ = false;
  std::vector<Seen> frames_;
};

}  // namespace

MotiveTake read_motive_csv(const std::filesystem::path& file, const MotiveOptions& options) {
  check_options(options);
  CsvReader reader(file);
  CsvLine header, line;
  if (!reader.next(header)) reader.fail(1, "is empty, expected Motive's header 'Format Version,1.23,...'");
  const TakeHeader facts = parse_take_header(header);
  const TakeColumns columns = find_columns(reader, options.body);
  const Pose pose(header, facts, columns);
  if (columns.rotation.empty() && (options.dimension == 2 || options.com != std::array<double, 3>{}))
    header.fail(
        "Rotation Type",
        fmt::format("rigid body '{}' has no rotations: a planar pose and an offset of the CoM need them",
                    columns.body));

  if (!columns.rotation.empty() && (options.sigma_position > 0) != (options.sigma_angle > 0))
    throw std::invalid_argument("sigma: give it for positions and angles, or for neither");

  MotiveTake take;
  take.name = facts.take, take.version = facts.version, take.frame_rate = facts.frame_rate;
  take.body = columns.body, take.bodies = columns.bodies;
  Track track(take, options, !columns.rotation.empty());
  Series& time = take.mocap.time;
  while (reader.next(line)) {
    line.expect_cells(columns.width);
    const double t = line.real(columns.time, "Time (Seconds)") + options.time_offset;
    if (time.rows > 0 && t <= time.data.back())
      line.fail("Time (Seconds)",
                fmt::format("time is not strictly increasing: {} s after {} s", t, time.data.back()));
    time.data.push_back(t);
    ++time.rows;
    if (pose.lost(line))
      track.add_lost();
    else
      track.add(t, pose.position(line),
                columns.rotation.empty() ? Quaterniond::Identity() : pose.rotation(line));
  }
  if (time.rows == 0) reader.fail(header.number, "holds no frames");
  if (take.lost == time.rows)
    reader.fail(header.number,
                fmt::format("rigid body '{}' is lost in all of its {} frames", columns.body, time.rows));
  take.run = run_of(track.frames(), take.mocap, options);
  return take;
}

}  // namespace unhand::datasets
