#include "datasets/import_planar_pushes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>

#include "datasets/log_error.hpp"
#include "datasets/planar_push_file.hpp"
#include "dynamics/median.hpp"

namespace unhand::datasets {
namespace {

namespace fs = std::filesystem;
using Vec2 = std::array<double, 2>;

// What the header says of offset, contact and samples.
constexpr double kPushStep = 0.1, kPushRest = 0.2;  // [s]
constexpr double kPushOffsetTolerance = 0.3;        // [N]
constexpr double kPushContactTolerance = 0.004;     // [m]
constexpr double kPushLeastMotion = 0.001;          // [m]
constexpr double kPushLeastSpeed = 2e-4;            // [m/s]
constexpr double kPushLeastForce = 0.3;             // [N]
constexpr std::size_t kPushTestEvery = 5;

Vec2 operator+(Vec2 a, Vec2 b) { return {a[0] + b[0], a[1] + b[1]}; }
Vec2 operator-(Vec2 a, Vec2 b) { return {a[0] - b[0], a[1] - b[1]}; }
Vec2 operator*(double k, Vec2 a) { return {k * a[0], k * a[1]}; }
double dot(Vec2 a, Vec2 b) { return a[0] * b[0] + a[1] * b[1]; }
double cross(Vec2 a, Vec2 b) { return a[0] * b[1] - a[1] * b[0]; }
Vec2 turn(double angle, Vec2 a) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * a[0] - s * a[1], s * a[0] + c * a[1]};
}

double yaw(const std::array<double, 7>& pose) { return 2 * std::atan2(pose[6], pose[3]); }
Vec2 position(const std::array<double, 7>& pose) { return {1e-3 * pose[0], 1e-3 * pose[1]}; }

Vec2 median_of(const std::vector<Vec2>& values) {
  std::vector<double> x, y;
  for (const Vec2& v : values) {
    x.push_back(v[0]);
    y.push_back(v[1]);
  }
  return {dynamics::median(x), dynamics::median(y)};
}

/// The screw that carries the block's centre frame from one pose to the other: body twist (v, ω) over the
/// unit of s.
struct Screw {
  Vec2 start{};  // the centre before
  double angle = 0, omega = 0;
  Vec2 v{};

  Screw(const RawPush& push, Vec2 centre) : angle(yaw(push.before)) {
    omega = std::remainder(yaw(push.after) - angle, 2 * std::numbers::pi);
    start = position(push.before) + turn(angle, centre);
    const Vec2 moved =
        turn(-angle, position(push.after) + turn(yaw(push.after), centre) - start);  // in the frame before
    const double half = omega / 2, k = std::abs(half) > 1e-9 ? half / std::tan(half) : 1.0;
    v = {k * moved[0] + half * moved[1], -half * moved[0] + k * moved[1]};
  }

  /// Where a point of the world is in the centre frame at s.
  Vec2 local(Vec2 point, double s) const {
    const double a = s * omega;
    const bool straight = std::abs(omega) < 1e-9;
    const double p = straight ? s : std::sin(a) / omega;
    const double q = straight ? 0.0 : (1 - std::cos(a)) / omega;
    const Vec2 moved{p * v[0] - q * v[1], q * v[0] + p * v[1]};
    return turn(-a, turn(-angle, point - start) - moved);
  }
};

/// A straight edge of the outline, in the centre frame; the normal points inwards.
struct Edge {
  Vec2 point{}, normal{};
  double depth(Vec2 p) const { return dot(normal, p - point); }
};

std::vector<Edge> edges_of(const PushedBlock& block) {
  std::vector<Edge> out;
  const std::size_t n = block.outline.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec2 a = block.outline[i], b = block.outline[(i + 1) % n];
    const Vec2 along = (1 / std::hypot(b[0] - a[0], b[1] - a[1])) * (b - a);
    out.push_back({a - block.centre, {-along[1], along[0]}});
  }
  return out;
}

void check_block(const PushedBlock& block) {
  constexpr std::size_t kMostCorners = 1000;
  constexpr double kLeastSide = 1e-4;  // [m]
  for (const auto& [name, value] :
       {std::pair{"mass", block.mass}, {"characteristic_length", block.characteristic_length}})
    if (!(value > 0 && std::isfinite(value)))
      throw std::invalid_argument(fmt::format("{}: {} is not > 0", name, value));
  const std::size_t n = block.outline.size();
  if (n < 3 || n > kMostCorners)
    throw std::invalid_argument(fmt::format("outline: {} corners are not 3 to {}", n, kMostCorners));
  double turned = 0;  // all the way round: once, or the outline crosses itself
  for (std::size_t i = 0; i < n; ++i) {
    const Vec2 here = block.outline[i], next = block.outline[(i + 1) % n];
    const Vec2 side = next - here, following = block.outline[(i + 2) % n] - next;
    if (!(std::hypot(side[0], side[1]) >= kLeastSide && std::isfinite(side[0] + side[1])))
      throw std::invalid_argument(
          fmt::format("outline: corners {} and {} are closer than {} m, or not finite", i + 1,
                      (i + 1) % n + 1, kLeastSide));
    const double turn = std::atan2(cross(side, following), dot(side, following));
    turned += turn;
    if (!(turn >= 0))
      throw std::invalid_argument(
          fmt::format("outline: not convex and counter-clockwise at corner {} ({}, {})", (i + 1) % n + 1,
                      next[0], next[1]));
  }
  if (!(turned < 3 * std::numbers::pi)) throw std::invalid_argument("outline: it goes round more than once");
}

Vec2 finger_at(const RawPush& push, double time) {
  const auto after = std::lower_bound(push.robot.begin(), push.robot.end(), time,
                                      [](const TimedPose& p, double t) { return p.time < t; });
  if (after == push.robot.begin()) return position(after->pose);
  if (after == push.robot.end()) return position(push.robot.back().pose);
  const auto before = after - 1;
  const double share = (time - before->time) / (after->time - before->time);
  return position(before->pose) + share * (position(after->pose) - position(before->pose));
}

Vec2 rest_force(const RawPush& push) {
  std::vector<Vec2> values;
  for (const TimedForce& f : push.forces)
    if (f.time <= push.forces.front().time + kPushRest) values.push_back(f.force);
  return median_of(values);
}

/// The least s at which the finger is at the edge, short of it by `gap`; between 0 and 1.
double reached(const Screw& screw, const Edge& edge, double gap, Vec2 finger) {
  const auto ahead = [&](double s) { return edge.depth(screw.local(finger, s)) - gap; };
  if (ahead(0) <= 0) return 0;
  if (ahead(1) >= 0) return 1;
  double low = 0, high = 1;
  for (int k = 0; k < 40; ++k) {
    const double middle = (low + high) / 2;
    (ahead(middle) > 0 ? low : high) = middle;
  }
  return (low + high) / 2;
}

struct Reading {
  Slip slip;
  std::size_t dropped = 0;
  std::string reason;  // why there is no slip
};

Reading read_push(const RawPush& push, Vec2 offset, const std::vector<Edge>& edges,
                  const PushedBlock& block) {
  Reading out;
  const Screw screw(push, block.centre);
  const double length = block.characteristic_length;
  const double motion = std::hypot(screw.v[0], screw.v[1], length * screw.omega);
  if (motion < kPushLeastMotion) {
    out.reason = fmt::format("moves by {:.2g} mm, less than {:.2g} mm", 1e3 * motion, 1e3 * kPushLeastMotion);
    return out;
  }
  const double begin = push.forces.front().time, end = push.forces.back().time;
  const Vec2 last = screw.local(finger_at(push, end), 1);
  const Edge& edge = *std::min_element(edges.begin(), edges.end(), [&](const Edge& a, const Edge& b) {
    return std::abs(a.depth(last)) < std::abs(b.depth(last));
  });
  const double gap = edge.depth(last);
  if (std::abs(gap) > kPushContactTolerance) {
    out.reason = fmt::format("the finger ends {:.1f} mm from the nearest edge", 1e3 * std::abs(gap));
    return out;
  }

  const double tool = yaw(push.robot.front().pose);
  const double speed = std::hypot(screw.v[0], screw.v[1]) + length * std::abs(screw.omega);
  Slip& slip = out.slip;
  slip.wrench.cols = slip.twist.cols = 3;
  double s = reached(screw, edge, gap, finger_at(push, begin)), pressed = 0;
  auto next = push.forces.begin();
  constexpr double kMostIntervals = 1e6;
  if (!((end - begin) / kPushStep <= kMostIntervals)) {
    out.reason = fmt::format("lasts {:.3g} s, more than {:.0f} intervals of {:.3g} s", end - begin,
                             kMostIntervals, kPushStep);
    return out;
  }
  const auto intervals = static_cast<int>(std::floor((end - begin) / kPushStep));
  for (int k = 0; k < intervals; ++k) {
    const double from = begin + k * kPushStep, to = from + kPushStep;
    const double before = s;
    s = std::max(s, reached(screw, edge, gap, finger_at(push, to)));
    Vec2 sum{};
    int n = 0;
    for (; next != push.forces.end() && next->time < to; ++next, ++n) sum = sum + next->force;
    const double rate = (s - before) / kPushStep;
    if (n == 0 || rate * speed < kPushLeastSpeed) {
      ++out.dropped;
      continue;
    }
    const Vec2 raw = (1.0 / n) * sum - offset;
    const Vec2 mounted = (-1 / std::numbers::sqrt2) * Vec2{raw[0] + raw[1], raw[0] - raw[1]};
    const double at = (before + s) / 2;
    const Vec2 f = turn(tool - screw.angle - at * screw.omega, mounted);
    if (std::hypot(f[0], f[1]) < kPushLeastForce) {
      ++out.dropped;
      continue;
    }
    const Vec2 r = screw.local(finger_at(push, (from + to) / 2), at);
    slip.time.data.push_back((from + to) / 2 - begin);
    for (const double x : {f[0], f[1], cross(r, f)}) slip.wrench.data.push_back(x);
    for (const double x : {screw.v[0], screw.v[1], screw.omega}) slip.twist.data.push_back(rate * x);
    pressed += rate * dot(f, edge.normal);
  }
  slip.time.rows = slip.wrench.rows = slip.twist.rows = slip.time.data.size();
  if (slip.time.empty()) {
    out.reason = "no interval in which the block moves under force";
  } else if (pressed <= 0) {
    out.reason = "the mean force pulls at the edge";
  }
  return out;
}

/// Every log with its surface's name.
std::map<std::string, fs::path> logs_of(std::span<const fs::path> inputs) {
  std::vector<fs::path> files;
  for (const fs::path& input : inputs) {
    std::error_code error;
    if (!fs::is_directory(input, error)) {
      files.push_back(input);
      continue;
    }
    const std::size_t before = files.size();
    for (const auto& entry : fs::recursive_directory_iterator(input))
      if (entry.is_regular_file() && entry.path().extension() == ".txt") files.push_back(entry.path());
    if (files.size() == before) throw ImportError(input.string(), "", "a folder without .txt files");
  }
  std::sort(files.begin(), files.end());
  const auto folder = [](const fs::path& file) {
    return fs::absolute(file).lexically_normal().parent_path();
  };
  std::map<fs::path, int> in_folder;
  for (const fs::path& file : files) ++in_folder[folder(file)];
  std::map<std::string, fs::path> out;
  for (const fs::path& file : files) {
    const fs::path home = folder(file);
    std::string name = home.filename().string();
    if (in_folder[home] > 1 || name.empty()) name += (name.empty() ? "" : "-") + file.stem().string();
    if (const auto [other, fresh] = out.emplace(name, file); !fresh)
      throw ImportError(file.string(), "",
                        fmt::format("surface '{}' comes from {} already", name, other->second.string()));
  }
  return out;
}

}  // namespace

PushedBlock homogeneous_block(std::vector<Vec2> outline, double mass) {
  PushedBlock out;
  out.mass = mass, out.outline = std::move(outline);
  out.description.clear(), out.licence.clear();
  check_block(out);
  // Triangles from the first corner, which is taken for the origin: areas, centroids, second moments.
  const Vec2 origin = out.outline.front();
  double area = 0, moment = 0;
  Vec2 first{};
  for (std::size_t i = 1; i + 1 < out.outline.size(); ++i) {
    const Vec2 a = out.outline[i] - origin, b = out.outline[i + 1] - origin;
    const double part = cross(a, b) / 2;
    area += part;
    first = first + (part / 3) * (a + b);
    moment += part / 6 * (dot(a, a) + dot(a, b) + dot(b, b));
  }
  const Vec2 middle = (1 / area) * first;
  out.centre = origin + middle;
  out.characteristic_length = std::sqrt(moment / area - dot(middle, middle));
  return out;
}

SlipLog import_planar_pushes(std::span<const fs::path> inputs, const PlanarPushOptions& options,
                             PlanarPushReport* report) {
  const PushedBlock& block = options.block;
  check_block(block);
  const std::vector<Edge> edges = edges_of(block);
  PlanarPushReport counts;
  SlipLog log;
  for (const auto& [name, file] : logs_of(inputs)) {
    const std::vector<RawPush> pushes = read_push_file(file);
    std::vector<Vec2> rests;
    for (const RawPush& push : pushes) rests.push_back(rest_force(push));
    const Vec2 usual = median_of(rests);
    Surface surface{
        block.mass,
        block.characteristic_length,
        fmt::format("log {}/{}: planar pushes of {}", name, file.filename().string(), block.description),
        block.licence,
        {}};
    for (std::size_t k = 0; k < pushes.size(); ++k) {
      ++counts.pushes;
      const Vec2 apart = rests[k] - usual;
      const bool touching = std::hypot(apart[0], apart[1]) > kPushOffsetTolerance;
      Reading reading = read_push(pushes[k], touching ? usual : rests[k], edges, block);
      if (!reading.reason.empty()) {
        counts.dropped.push_back({name, static_cast<int>(k), reading.reason});
        continue;
      }
      Slip& slip = reading.slip;
      slip.id = fmt::format("push-{:02}", k);
      slip.split = k % kPushTestEvery == kPushTestEvery - 1 ? Split::test : Split::train;
      ++(slip.split == Split::train ? counts.train : counts.test);
      ++counts.kept;
      counts.borrowed_offsets += touching;
      counts.samples += slip.time.rows;
      counts.dropped_samples += reading.dropped;
      surface.slips.push_back(std::move(slip));
    }
    if (surface.slips.empty())
      throw ImportError(file.string(), "line 1", fmt::format("none of {} pushes can be used", pushes.size()));
    log.surfaces.emplace(name, std::move(surface));
  }
  if (log.surfaces.empty()) throw std::invalid_argument("inputs: no file is named");
  validate(log, inputs.front().string());
  if (report != nullptr) *report = std::move(counts);
  return log;
}

}  // namespace unhand::datasets
