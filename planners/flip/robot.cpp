#include "planners/flip/robot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <stdexcept>

#include "contact/patch.hpp"
#include "contact/registry.hpp"
#include "datasets/toml_keys.hpp"
#include "planners/arm/chain_file.hpp"
#include "planners/arm/dynamics.hpp"
#include "planners/flip/arm_throw.hpp"

namespace unhand::planners::flip {
namespace {

using datasets::TomlKeys;
using datasets::TomlLimits;

// What an arm with a hand and a bar may have; beyond, the simulation would answer, but mean nothing.
constexpr TomlLimits positive(double most, const char* unit) { return {0, most, true, unit}; }
constexpr TomlLimits not_negative(double most, const char* unit) { return {0, most, false, unit}; }
constexpr TomlLimits around_zero(double most, const char* unit) { return {-most, most, false, unit}; }
constexpr TomlLimits kBarMass{1e-3, 10, false, "kg"}, kBarInertia{1e-6, 1, false, "kg m^2"},
    kComOffset{0, 1, false, "m"};

/// One table of the file, its keys required but where they are asked for by `if_there`.
class Section {
 public:
  Section(TomlKeys& file, const char* name) : keys_(file.required(name, file.table(name))) {
    keys_.text("source");
    keys_.text("notes");
  }
  double number(const char* key, const TomlLimits& limits) {
    return keys_.required(key, keys_.number(key, limits));
  }
  std::optional<double> if_there(const char* key, const TomlLimits& limits) {
    return keys_.number(key, limits);
  }
  std::string text(const char* key) { return keys_.required(key, keys_.text(key)); }
  std::array<double, 2> range(const char* key, const TomlLimits& limits) {
    std::array<double, 2> out{};
    if (!keys_.numbers(key, limits, out)) keys_.fail(key, "required key is missing");
    if (!(out[0] < out[1])) keys_.fail(key, fmt::format("{} is not below {}", out[0], out[1]));
    return out;
  }
  Joints joints(const char* key, int count, const TomlLimits& limits) {
    Joints out(count);
    if (!keys_.numbers(key, limits, {out.data(), static_cast<std::size_t>(count)}))
      keys_.fail(key, "required key is missing");
    return out;
  }
  [[noreturn]] void fail(const char* key, const std::string& why) const { keys_.fail(key, why); }
  void done() const { keys_.reject_unknown(); }

 private:
  TomlKeys keys_;
};

FlipMotion motion_of(Section keys, const Chain& chain) {
  const int n = chain.size();
  FlipMotion out;
  out.pose = keys.joints("pose_rad", n, around_zero(10, "rad"));
  out.rate = keys.joints("rate_rad_s", n, around_zero(50, "rad/s"));
  if (!(out.rate.norm() > 0)) keys.fail("rate_rad_s", "no joint moves");
  out.duration = keys.number("duration_s", {0.05, 10, false, "s"});
  out.window = keys.number("window_s", {0.02, 1, false, "s"});
  const auto pitch = keys.range("pitch_rad", around_zero(10, "rad")),
             speed = keys.range("speed", positive(10, "")),
             damping = keys.range("damping_n_m_s", not_negative(500, "N m s/rad"));
  out.range = {{pitch[0], speed[0], damping[0]}, {pitch[1], speed[1], damping[1]}};
  keys.done();
  return out;
}

FlipControl control_of(Section keys, int n) {
  FlipControl out;
  out.stiffness = keys.joints("stiffness_n_m_rad", n, not_negative(5000, "N m/rad"));
  out.damping = keys.joints("damping_n_m_s", n, not_negative(500, "N m s/rad"));
  out.brake_stiffness = keys.joints("brake_stiffness_n_m_rad", n, not_negative(5000, "N m/rad"));
  out.brake_damping = keys.joints("brake_damping_n_m_s", n, not_negative(500, "N m s/rad"));
  out.brake_share = keys.joints("brake_share", n, not_negative(1, ""));
  out.torque_rate = keys.number("torque_rate_n_m_s", positive(1e5, "N m/s"));
  keys.done();
  return out;
}

Pads pads_of(Section keys) {
  Pads out;
  out.law = keys.text("law");
  const auto known = contact::pad_law_names();
  if (std::find(known.begin(), known.end(), out.law) == known.end())
    keys.fail("law", fmt::format("'{}' is no contact model that says how the pads let go", out.law));
  out.mu = keys.number("mu", {0, contact::kMostMu, true, ""});
  out.length = keys.number("length_m", {0, 0.5, true, "m"});
  const double pads = keys.number("pads", {1, 8, false, ""});
  if (pads != std::floor(pads)) keys.fail("pads", fmt::format("{} is not a whole number", pads));
  out.count = static_cast<int>(pads);
  for (const auto& own : contact::law_parameters(out.law)) {
    const TomlLimits accepted{own.low, own.high, false, own.unit == "-" ? "" : own.unit.c_str()};
    if (const auto value = keys.if_there(own.name.c_str(), accepted)) out.law_values[own.name] = *value;
  }
  for (const auto& name : known)
    for (const auto& other : contact::law_parameters(name))
      if (!out.law_values.contains(other.name) &&
          keys.if_there(other.name.c_str(), {-HUGE_VAL, HUGE_VAL, false, ""}))
        keys.fail(other.name.c_str(), fmt::format("is of {}, and the law is '{}'", name, out.law));
  keys.done();
  return out;
}

/// The arm with a hand, the tool between its pads.
Chain with_hand(const Chain& arm, Section keys) {
  const double mass = keys.number("mass_kg", positive(20, "kg")),
               length = keys.number("length_m", positive(1, "m")),
               across = keys.number("inertia_across_kg_m2", positive(1, "kg m^2")),
               along = keys.number("inertia_along_kg_m2", positive(1, "kg m^2"));
  keys.done();
  const Chain loaded =
      with_payload(arm, {mass, {0, 0, length / 2}, symmetric(across, across, along, 0, 0, 0)});
  return with_tool(loaded, {Eigen::Matrix3d::Identity(), {0, 0, length}});
}

Gripper gripper_of(Section keys) {
  const Gripper out{
      keys.number("grip_force_n", positive(1000, "N")), keys.number("dead_time_s", not_negative(1, "s")),
      keys.number("opening_time_s", positive(1, "s")), keys.number("shape", {0.1, 10, false, ""})};
  keys.done();
  return out;
}

Bar bar_of(Section keys) {
  const Bar out{keys.number("mass_kg", kBarMass), keys.number("inertia_kg_m2", kBarInertia),
                keys.number("com_offset_m", kComOffset)};
  keys.done();
  return out;
}

constexpr TomlLimits kShare{0, 0.5, false, ""};

RobotSpread robot_spread_of(Section keys) {
  const RobotSpread out{keys.number("link_mass", kShare),
                        keys.number("friction", kShare),
                        keys.number("torque_gain", kShare),
                        keys.number("mu", kShare),
                        keys.number("length", kShare),
                        keys.number("grip_force", kShare),
                        keys.number("shape", kShare),
                        keys.number("dead_time_s", not_negative(0.1, "s")),
                        keys.number("opening_time_s", not_negative(0.1, "s")),
                        keys.number("com_offset_m", not_negative(0.1, "m"))};
  keys.done();
  return out;
}

ThrowSpread throw_spread_of(Section keys) {
  const ThrowSpread out{keys.number("mu", kShare),
                        keys.number("grip_force", kShare),
                        keys.number("dead_time_s", not_negative(0.1, "s")),
                        keys.number("opening_time_s", not_negative(0.1, "s")),
                        keys.number("grasp_offset_m", not_negative(0.1, "m")),
                        keys.number("grasp_angle_rad", not_negative(1, "rad")),
                        keys.number("torque_noise", kShare)};
  keys.done();
  return out;
}

FlipSensors sensors_of(Section keys) {
  const FlipSensors out{keys.number("angle_rad", not_negative(0.1, "rad")),
                        keys.number("rate_rad_s", not_negative(1, "rad/s")),
                        keys.number("position_m", not_negative(1, "m")),
                        keys.number("turn_rad", not_negative(1, "rad")),
                        keys.number("speed_m_s", not_negative(1, "m/s")),
                        keys.number("omega_rad_s", not_negative(10, "rad/s")),
                        keys.number("landing_m", not_negative(1, "m")),
                        keys.number("landing_turn_rad", not_negative(1, "rad"))};
  keys.done();
  return out;
}

/// Why torques do not tell how the arm moves; empty where they do.
std::string why_not_simulable(const Chain& chain) {
  for (const Joint& joint : chain.joints)
    if (!std::isfinite(joint.limits.torque))
      return fmt::format("joint '{}' declares no limit of its torque", joint.name);
  constexpr double kQuickest = 1e6;  // rad/s² under 1 N m at one joint
  const int n = chain.size();
  const JointMatrix<double> M = mass_matrix<double>(chain, JointVector<double>::Constant(n, 0.5));
  for (int i = 0; i < n; ++i) {
    const JointVector<double> under = solve_positive<double>(M, JointVector<double>::Unit(n, i));
    if (!under.allFinite() || under.cwiseAbs().maxCoeff() > kQuickest)
      return fmt::format("its links are too light for joint '{}' to have an inertia", chain.joints[i].name);
  }
  return "";
}

}  // namespace

bool CommandRange::holds(const FlipCommand& u) const {
  const auto in = [](double x, double a, double b) { return x >= a && x <= b; };
  return in(u.pitch, low.pitch, high.pitch) && in(u.speed, low.speed, high.speed) &&
         in(u.damping, low.damping, high.damping);
}
FlipCommand CommandRange::clamp(const FlipCommand& u) const {
  return {std::clamp(u.pitch, low.pitch, high.pitch), std::clamp(u.speed, low.speed, high.speed),
          std::clamp(u.damping, low.damping, high.damping)};
}
FlipCommand CommandRange::at(double pitch, double speed, double damping) const {
  return {std::lerp(low.pitch, high.pitch, pitch), std::lerp(low.speed, high.speed, speed),
          std::lerp(low.damping, high.damping, damping)};
}
std::array<double, 3> CommandRange::fractions(const FlipCommand& u) const {
  return {(u.pitch - low.pitch) / (high.pitch - low.pitch), (u.speed - low.speed) / (high.speed - low.speed),
          (u.damping - low.damping) / (high.damping - low.damping)};
}

Chain carrying(const Chain& chain, const Bar& bar) {
  const double along = 0.02 * bar.inertia;  // about its own axis; nothing turns about it
  return with_payload(
      chain, {bar.mass, {0, 0, bar.com_offset}, symmetric(bar.inertia, bar.inertia, along, 0, 0, 0)});
}

FlipRobot read_flip_robot(const std::string& name_or_file) {
  TomlKeys keys = name_or_file == "panda-flip" ? TomlKeys::parse_text(built_in_robot(), name_or_file)
                                               : TomlKeys::parse(name_or_file);
  FlipRobot out;
  out.name = keys.required("name", keys.text("name"));
  keys.text("source");
  keys.text("notes");
  const std::string arm = keys.required("arm", keys.text("arm"));
  const auto beside = [&](const std::string& name) {
    return name == "panda" ? name : (std::filesystem::path(name_or_file).parent_path() / name).string();
  };
  try {
    out.chain = read_chain(beside(arm));
  } catch (const std::invalid_argument& error) {
    keys.fail("arm", error.what());
  }
  out.chain = with_hand(out.chain, {keys, "hand"});
  if (const std::string why = why_not_simulable(out.chain); !why.empty()) keys.fail("arm", why);
  out.motion = motion_of({keys, "motion"}, out.chain);
  out.control = control_of({keys, "control"}, out.chain.size());
  out.gripper = gripper_of({keys, "gripper"});
  out.pads = pads_of({keys, "pads"});
  out.bar = bar_of({keys, "bar"});
  out.robots = robot_spread_of({keys, "robots"});
  out.throws = throw_spread_of({keys, "throws"});
  out.sensors = sensors_of({keys, "sensors"});
  keys.reject_unknown();
  try {
    for (const FlipCommand& u : {out.motion.range.low, out.motion.range.high})
      for (const FlipCommand& v : {out.motion.range.low, out.motion.range.high})
        check_reference(out, {u.pitch, v.speed, u.damping});
  } catch (const std::invalid_argument& error) {
    keys.fail("motion", error.what());
  }
  return out;
}

std::string complaint_of(const Bar& bar) {
  std::string out;
  const auto ask = [&](const char* what, double value, const TomlLimits& limits) {
    if (limits.accept(value)) return;
    out += fmt::format("{}{}: {} is outside {}", out.empty() ? "" : "; ", what, value, limits.text());
  };
  ask("mass_kg", bar.mass, kBarMass);
  ask("inertia_kg_m2", bar.inertia, kBarInertia);
  ask("com_offset_m", bar.com_offset, kComOffset);
  return out;
}

}  // namespace unhand::planners::flip
