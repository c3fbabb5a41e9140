#include "experiment/unit_rules.hpp"

#include <fmt/core.h>

#include <cmath>
#include <numbers>

namespace unhand::experiment {

namespace {

constexpr double kStandardGravity = 9.80665, kPoundForce = 4.4482216;
constexpr OtherUnit kLengths[] = {{1e3, "mm for m"}, {100, "cm for m"}, {1 / 0.0254, "inches for m"}};
constexpr OtherUnit kFalls[] = {{1e3, "mm for m"},
                                {100, "cm for m"},
                                {1 / 0.0254, "inches for m"},
                                {1e-6, "mocap/time in ms for s"},
                                {1e-12, "mocap/time in us for s"}};
constexpr OtherUnit kSpeeds[] = {{1e3, "mm/s for m/s"}, {100, "cm/s for m/s"}};
constexpr OtherUnit kAccelerations[] = {
    {1e3, "mm/s^2 for m/s^2"}, {100, "cm/s^2 for m/s^2"}, {1 / kStandardGravity, "g for m/s^2"}};
constexpr OtherUnit kSpecificForces[] = {
    {1e3, "mm/s^2 for m/s^2"}, {100, "cm/s^2 or mg for m/s^2"}, {1 / kStandardGravity, "g for m/s^2"}};
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
constexpr OtherUnit kSpans[] = {
    {1e3, "ms for s"}, {1e6, "us for s"}, {1e9, "ns for s"}, {1e-3, "s for ms"}, {1e-6, "s for us"}};

constexpr ColumnSide kDeclared{"what is declared", "", {}};

const std::map<SizedColumn, UnitRule> kRules{
    {SizedColumn::hand_clock,
     {{"hand/time", "time", kTimes}, kDeclared, "its twist and acceleration allow", 1.5}},
    {SizedColumn::ft_clock, {{"ft/time", "time", kSpans}, kDeclared, "the hand's clock runs", 4}},
    {SizedColumn::mocap_clock, {{"mocap/time", "time", kSpans}, kDeclared, "the hand's clock runs", 4}},
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
    {SizedColumn::fall, {{"mocap/pose", "position", kFalls}, kDeclared, "gravity makes of a free flight"}},
    {SizedColumn::rest,
     {{"imu/specific_force", "f", kSpecificForces}, kDeclared, "gravity makes of a sensor at rest"}},
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

using datasets::Series;
using datasets::Throw;

/// The series of a throw, where it has the group.
template <auto kGroup, auto kSeries>
const Series* series_of(const Throw& one) {
  const auto& group = one.*kGroup;
  return group ? &((*group).*kSeries) : nullptr;
}
constexpr auto kHandPose = series_of<&Throw::hand, &datasets::HandLog::pose>,
               kHandTwist = series_of<&Throw::hand, &datasets::HandLog::twist>,
               kHandAcceleration = series_of<&Throw::hand, &datasets::HandLog::acceleration>,
               kMocapPose = series_of<&Throw::mocap, &datasets::MocapLog::pose>,
               kWrench = series_of<&Throw::ft, &datasets::FtLog::wrench>,
               kNormalForce = series_of<&Throw::ft, &datasets::FtLog::normal_force>,
               kLandingPose = series_of<&Throw::landing, &datasets::LandingLog::pose>;
constexpr PlainColumn kPlain[] = {
    {{"hand/pose", "position", kLengths}, kHandPose, 0, 2, kShowsShift},
    {{"hand/pose", "theta", kAngles}, kHandPose, 2, 3, kShowsTurn},
    {{"hand/twist", "velocity", kSpeeds}, kHandTwist, 0, 2, kShowsSpeed},
    {{"hand/twist", "omega", kRates}, kHandTwist, 2, 3, kShowsSpin},
    {{"hand/acceleration", "a", kAccelerations}, kHandAcceleration, 0, 2, kShowsSpeed},
    {{"hand/acceleration", "alpha", kAngularAccelerations}, kHandAcceleration, 2, 3, kShowsSpin},
    {{"mocap/pose", "position", kLengths}, kMocapPose, 0, 2, kShowsShift},
    {{"mocap/pose", "theta", kAngles}, kMocapPose, 2, 3, kShowsTurn},
    {{"ft/wrench", "force", kForces}, kWrench, 0, 2, kShowsNewton},
    {{"ft/wrench", "tau", kTorques}, kWrench, 2, 3, kShowsNewtonMetre},
    {{"ft/normal_force", "f_N", kForces}, kNormalForce, 0, 1, kShowsNewton, true},
    {{"landing/pose", "x", kLengths}, kLandingPose, 0, 1, kShowsShift},
    {{"landing/pose", "theta", kAngles}, kLandingPose, 1, 2, kShowsTurn},
};

}  // namespace

std::string UnitRule::said_by(const ColumnSide& side) const {
  return side.units.empty() ? where : fmt::format("{} of {} says {}", side.column, side.path, where);
}

const std::map<SizedColumn, UnitRule>& unit_rules() { return kRules; }

std::span<const PlainColumn> plain_columns() { return kPlain; }

const OtherUnit* explaining_unit(std::span<const OtherUnit> units, double ratio, double within) {
  const OtherUnit* nearest = nullptr;
  double distance = std::log(within);
  for (const auto& unit : units)
    if (const double d = std::abs(std::log(ratio / unit.factor)); d < distance) distance = d, nearest = &unit;
  return nearest;
}

}  // namespace unhand::experiment
