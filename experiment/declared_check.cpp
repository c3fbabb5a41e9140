#include "experiment/declared_check.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <vector>

#include "dynamics/median.hpp"
#include "dynamics/straight_line.hpp"
#include "experiment/time_check.hpp"
#include "experiment/unit_evidence.hpp"

namespace unhand::experiment {
namespace {

constexpr double kDensest = 22'600;     // osmium [kg/m³]
constexpr double kLargestDiagonal = 2;  // of an object that no dims tell of [m]
constexpr double kLargestPad = 0.2;     // radius [m]
constexpr double kRounding = 1.05;      // dims are declared to a few per cent

std::optional<double> diagonal_of(const datasets::Object& object) {
  if (!object.dims) return {};
  const auto& d = *object.dims;
  return std::hypot(d[0], d[1], d[2]);
}

/// The first of an object's inertias that no body of its mass and size has.
struct ImpossibleInertia {
  double ratio{};  ///< I/m over the bound that it passes
  std::string reason;
};

std::optional<ImpossibleInertia> first_impossible_inertia(const datasets::Object& object) {
  if (!object.inertia || !(object.mass > 0)) return {};
  const auto diagonal = diagonal_of(object);
  const auto [least, most] = gyration_range(object.mass, diagonal.value_or(kLargestDiagonal));
  for (const double inertia : *object.inertia) {
    const double gyration = inertia / object.mass;
    if (gyration >= least / kRounding && gyration <= most * kRounding) continue;
    const bool large = gyration > most;
    return ImpossibleInertia{
        gyration / (large ? most : least),
        fmt::format("inertia is {:.3g} kg m^2 for {:.4g} kg, a radius of gyration of {:.3g} m; a "
                    "body {} has {:.3g} to {:.3g} m: {}?",
                    inertia, object.mass, std::sqrt(gyration),
                    diagonal ? fmt::format("within its dims (a diagonal of {:.3g} m)", *diagonal)
                             : std::string("that a robot throws"),
                    std::sqrt(least), std::sqrt(most),
                    large ? "kg cm^2, g cm^2 or kg mm^2 for kg m^2"
                          : "the object's mass in g, or its inertia in another unit than kg m^2")};
  }
  return {};
}

std::optional<UnitDoubt> doubtful_inertia(const std::string& name, const datasets::Object& object) {
  const auto found = first_impossible_inertia(object);
  if (!found) return {};
  return UnitDoubt{fmt::format("/objects/{}@inertia", name), "inertia", found->ratio, 0, found->reason};
}

std::optional<UnitDoubt> doubtful_pad(const datasets::ThrowLog& log) {
  if (!log.gripper || !log.gripper->pad_radius) return {};
  const double radius = *log.gripper->pad_radius;
  double largest = 0;
  for (const auto& [name, object] : log.objects)
    largest = std::max(largest, diagonal_of(object).value_or(kLargestPad));
  const double most = std::min(kLargestPad, log.objects.empty() ? kLargestPad : kRounding * largest);
  if (radius <= most) return {};
  return UnitDoubt{
      "/gripper@pad_radius", "pad_radius", radius / most, 0,
      fmt::format(
          "pad_radius is {:.4g} m, and a pad that holds these objects has at most {:.3g} m: mm, cm or "
          "inches for m?",
          radius, most)};
}

/// Heights of the tracked frame where it lands [m].
struct LandedHeights {
  std::optional<double> at_x, at_time;  ///< where it passes the landing x; at landing/time
};

/// From the last stretch before landing/time that motion capture shows.
LandedHeights landed_heights(const datasets::ThrowLog& log, const datasets::Throw& logged) {
  constexpr double kStretch = 0.1, kContinued = 0.15;  // s
  constexpr double kForward = 0.5;                     // m/s
  constexpr std::size_t kEnough = 5;
  LandedHeights out;
  if (!logged.mocap || !logged.landing || logged.landing->pose.empty()) return out;
  if (!landed_before(log, logged).empty()) return out;
  const auto& mocap = *logged.mocap;
  const auto& landing = *logged.landing;
  std::vector<double> time, x, z;
  std::optional<double> last;
  for (std::size_t i = mocap.time.rows; i-- > 0;) {
    const double t = mocap.time(i);
    if (!mocap.is_valid(i) || (!landing.time.empty() && t > landing.time(0))) continue;
    if (!last) last = t;
    const double before = t - *last;
    if (before < -kStretch) break;
    time.push_back(before);
    x.push_back(mocap.pose(i, 0));
    z.push_back(mocap.pose(i, 1) + 0.5 * log.gravity * before * before);
  }
  if (x.size() < kEnough) return out;
  const auto across = dynamics::fit_line(time, x), up = dynamics::fit_line(time, z);
  const auto height = [&](double t) { return up.at(t) - 0.5 * log.gravity * t * t; };
  if (!landing.time.empty() && landing.time(0) - *last <= kContinued)
    out.at_time = height(landing.time(0) - *last);
  if (std::abs(across.slope) > kForward) {
    const double t = (landing.pose(0, 0) - across.at(0)) / across.slope;
    if (t >= -kStretch && t <= kContinued) out.at_x = height(t);
  }
  return out;
}

}  // namespace

GyrationRange gyration_range(double mass, double diagonal) {
  return {mass / (2 * std::numbers::pi * kDensest * diagonal), 0.25 * diagonal * diagonal};
}

std::string impossible_inertia(const datasets::Object& object) {
  const auto found = first_impossible_inertia(object);
  return found ? found->reason : std::string();
}

std::vector<UnitDoubt> impossible_declarations(const datasets::ThrowLog& log) {
  std::vector<UnitDoubt> out;
  for (const auto& [name, object] : log.objects)
    if (const auto doubt = doubtful_inertia(name, object)) out.push_back(*doubt);
  if (const auto doubt = doubtful_pad(log)) out.push_back(*doubt);
  return out;
}

std::vector<UnitDoubt> turned_levers(const datasets::ThrowLog& log) {
  constexpr double kRight = std::numbers::pi / 2, kWithin = 20 * std::numbers::pi / 180;
  std::map<std::string, std::vector<double>> angles;  // by object
  for (const auto& one : log.throws)
    if (const auto angle = lever_angle(log, one)) angles[one.object].push_back(*angle);
  std::vector<UnitDoubt> out;
  for (const auto& [object, all] : angles) {
    std::vector<double> size;
    for (const double angle : all) size.push_back(std::abs(angle));
    const double turned = dynamics::median(size);
    if (std::abs(turned - kRight) > kWithin && turned < 2 * kRight - kWithin) continue;
    out.push_back(
        {fmt::format("/objects/{}@com_offset", object), "com_offset", 1, static_cast<int>(all.size()),
         fmt::format("motion capture sees the centre of mass {:.0f} degrees from where com_offset, along "
                     "the object's x, has it (median of {} throws): axes swapped, or a sign?",
                     turned / kRight * 90, all.size())});
  }
  return out;
}

std::vector<UnitDoubt> contradicted_landing_height(const datasets::ThrowLog& log) {
  constexpr double kBoth = 0.1, kOne = 0.2, kLength = 0.2;  // m, m, -
  if (log.dimension != 2) return {};
  std::vector<double> at_x, at_time;
  for (const auto& one : log.throws) {
    const auto seen = landed_heights(log, one);
    if (seen.at_x) at_x.push_back(*seen.at_x - log.landing_height);
    if (seen.at_time) at_time.push_back(*seen.at_time - log.landing_height);
  }
  if (at_x.empty() && at_time.empty()) return {};
  const double x = dynamics::median(at_x.empty() ? at_time : at_x),
               time = dynamics::median(at_time.empty() ? at_x : at_time);
  const double off = std::abs(x) < std::abs(time) ? x : time;  // the one that speaks less against it
  const double height = log.landing_height + off,
               most = (at_x.empty() || at_time.empty() ? kOne : kBoth) + kLength * std::abs(height);
  if (x * time < 0 || std::abs(off) <= most) return {};
  const std::size_t throws = std::max(at_x.size(), at_time.size());
  return {{"/@landing_height", "landing_height", 1, static_cast<int>(throws),
           fmt::format("landing_height is {:.6g} m, and motion capture sees the objects land at {:.3g} m "
                       "(median of {} throws), accepted are {:.3g} to {:.3g} m: another height or frame?",
                       log.landing_height, height, throws, height - most, height + most)}};
}

}  // namespace unhand::experiment
