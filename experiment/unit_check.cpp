#include "experiment/unit_check.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <span>

#include "dynamics/median.hpp"
#include "experiment/unit_evidence.hpp"

namespace unhand::experiment {

namespace {

/// A quantity in this unit has `factor` times the number that it has in SI units.
struct OtherUnit {
  double factor;
  const char* words;
};
constexpr double kStandardGravity = 9.80665, kPoundForce = 4.4482216;
constexpr OtherUnit kLengths[] = {{1e3, "mm for m"}, {100, "cm for m"}, {1 / 0.0254, "inches for m"}};
constexpr OtherUnit kSpeeds[] = {{1e3, "mm/s for m/s"}, {100, "cm/s for m/s"}};
constexpr OtherUnit kAccelerations[] = {
    {1e3, "mm/s^2 for m/s^2"}, {100, "cm/s^2 for m/s^2"}, {1 / kStandardGravity, "g for m/s^2"}};
constexpr OtherUnit kAngles[] = {{180 / std::numbers::pi, "degrees for rad"}};
constexpr OtherUnit kRates[] = {{180 / std::numbers::pi, "deg/s for rad/s"}};
constexpr OtherUnit kAngularAccelerations[] = {{180 / std::numbers::pi, "deg/s^2 for rad/s^2"}};
constexpr OtherUnit kForces[] = {{1e3, "mN for N, or the object's mass in t"},
                                 {1e-3, "kN for N, or the object's mass in g"},
                                 {1 / kStandardGravity, "kgf for N"},
                                 {1 / kPoundForce, "lbf for N"}};
constexpr OtherUnit kTorques[] = {{1e3, "N mm for N m"},
                                  {100, "N cm for N m"},
                                  {100 / kStandardGravity, "kgf cm for N m"},
                                  {1 / kStandardGravity, "kgf m for N m"}};
constexpr OtherUnit kTimes[] = {{1e3, "ms for s"}, {1e6, "us for s"}, {1e9, "ns for s"}};

/// One side of a comparison.
struct Side {
  const char *path, *column;  ///< the path inside a throw, or from the root
  std::span<const OtherUnit> units;
};
/// Two columns that say the same of a throw.
struct Rule {
  Side seen, expected;
  const char* where;    ///< they are compared
  double within = 1.5;  ///< a factor of a unit's, to be taken for it
};
constexpr Side kDeclared{"what is declared", "", {}};

const std::map<SizedColumn, Rule> kRules{
    {SizedColumn::hand_clock,
     {{"hand/time", "time", kTimes}, kDeclared, "its twist and acceleration allow", 1.5}},
    {SizedColumn::ft_clock, {{"ft/time", "time", kTimes}, kDeclared, "the hand's clock runs", 4}},
    {SizedColumn::mocap_clock, {{"mocap/time", "time", kTimes}, kDeclared, "the hand's clock runs", 4}},
    {SizedColumn::landing_clock,
     {{"landing/time", "time", kTimes}, kDeclared, "a free fall from the opening takes", 3}},
    {SizedColumn::hand_shift,
     {{"hand/pose", "position", kLengths}, {"hand/twist", "velocity", kSpeeds}, "added up over time"}},
    {SizedColumn::hand_turn,
     {{"hand/pose", "theta", kAngles}, {"hand/twist", "omega", kRates}, "added up over time"}},
    {SizedColumn::hand_speed,
     {{"hand/twist", "velocity", kSpeeds}, {"hand/acceleration", "a", kAccelerations}, "added up over time"}},
    {SizedColumn::hand_spin,
     {{"hand/twist", "omega", kRates},
      {"hand/acceleration", "alpha", kAngularAccelerations},
      "added up over time"}},
    {SizedColumn::held_shift,
     {{"mocap/pose", "position", kLengths}, {"hand/pose", "position", kLengths}, "while the object is held"}},
    {SizedColumn::held_turn,
     {{"mocap/pose", "theta", kAngles}, {"hand/pose", "theta", kAngles}, "while the object is held"}},
    {SizedColumn::lever,
     {{"/objects/*@com_offset", "com_offset", kLengths},
      kDeclared,
      "motion capture sees between hand and held object"}},
    {SizedColumn::force,
     {{"ft/wrench", "force", kForces}, kDeclared, "mass and motion of the held object need"}},
    {SizedColumn::torque,
     {{"ft/wrench", "tau", kTorques}, kDeclared, "inertia, lever and motion of the held object need"}},
    {SizedColumn::landing_x,
     {{"landing/pose", "x", kLengths}, kDeclared, "a free flight from the opening reaches", 3}},
    {SizedColumn::landing_turn,
     {{"landing/pose", "theta", kAngles}, {"mocap/pose", "theta", kAngles}, "just before the landing"}},
};

std::string path_of(const Side& side) {
  return side.path[0] == '/' ? side.path : fmt::format("/throws/*/{}", side.path);
}

const OtherUnit* explains(const Side& side, double ratio, double within) {
  const OtherUnit* nearest = nullptr;
  double distance = std::log(within);
  for (const auto& unit : side.units)
    if (const double d = std::abs(std::log(ratio / unit.factor)); d < distance) distance = d, nearest = &unit;
  return nearest;
}

}  // namespace

std::vector<UnitDoubt> unit_doubts(const datasets::ThrowLog& log) {
  std::vector<UnitDoubt> out;
  constexpr double kMostGravity = 100;  // [m/s²]
  if (log.gravity > kMostGravity)
    out.push_back({"/@gravity", "gravity", log.gravity, 1,
                   fmt::format("gravity is {:.6g} m/s², more than {}: mm/s² or cm/s² for m/s²?", log.gravity,
                               kMostGravity)});
  if (log.dimension != 2 || !out.empty()) return out;
  SizeRatios ratios;
  for (const auto& one : log.throws) compare_sizes(log, one, ratios);
  for (const auto& [column, all] : ratios) {
    const auto found = kRules.find(column);
    if (found == kRules.end()) continue;
    const Rule& rule = found->second;
    const double ratio = dynamics::median(all);
    const auto doubt = [&](const Side& side, const Side& other, double size) {
      const OtherUnit* unit = explains(side, size, rule.within);
      if (!unit) return;
      const std::string path = path_of(side);
      if (std::any_of(out.begin(), out.end(),
                      [&](const auto& told) { return told.path == path && told.column == side.column; }))
        return;
      const std::string against = other.units.empty()
                                      ? std::string(rule.where)
                                      : fmt::format("{} of {} says {}", other.column, other.path, rule.where);
      out.push_back({path, side.column, size, static_cast<int>(all.size()),
                     fmt::format("{} is {:.3g} times what {} (median of {} throws): {}?", side.column, size,
                                 against, all.size(), unit->words)});
    };
    doubt(rule.seen, rule.expected, ratio);
    doubt(rule.expected, rule.seen, 1 / ratio);
    if (column == SizedColumn::hand_clock && !out.empty()) return out;  // it is behind all that follows
  }
  std::vector<double> angles;
  for (const auto& one : log.throws)
    if (one.grasp_angle) angles.push_back(std::abs(*one.grasp_angle));
  if (const double turn = angles.empty() ? 0 : dynamics::median(angles); turn > 2 * std::numbers::pi)
    out.push_back(
        {"/throws/*@grasp_angle", "grasp_angle", turn, static_cast<int>(angles.size()),
         fmt::format("grasp_angle is {:.3g} rad (median of {} throws), more than a whole turn: degrees "
                     "for rad?",
                     turn, angles.size())});
  const auto& friction = ratios[SizedColumn::slip_force];
  const double mu = friction.empty() ? kMostFriction : dynamics::median(friction);
  const bool dead = mu == 0;  // a wrench that says nothing is no unit
  if (out.empty() && !dead && (mu < kLeastFriction || mu > kMostFriction))
    out.push_back(
        {"/throws/*/ft/normal_force", "f_N", mu, static_cast<int>(friction.size()),
         fmt::format("where the pads slip their wrench takes a friction of {:.3g} of it (median of {} "
                     "throws), and there are pads of {} to {}: {}?",
                     mu, friction.size(), kLeastFriction, kMostFriction,
                     mu > 1 ? "kgf, lbf or kN for N" : "mN for N")});
  return out;
}

void require_units(const datasets::ThrowLog& log, const std::string& file) {
  const auto doubts = unit_doubts(log);
  if (doubts.empty()) return;
  std::string reason = doubts.front().reason;
  for (std::size_t i = 1; i < doubts.size(); ++i) reason += "; " + doubts[i].path + ": " + doubts[i].reason;
  throw datasets::LogError(file, doubts.front().path, reason);
}

}  // namespace unhand::experiment
