#include "planners/elastic/clutched_arm.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <stdexcept>

#include "datasets/toml_keys.hpp"
#include "planners/arm/chain_file.hpp"
#include "planners/elastic/built_in_arms.hpp"

namespace unhand::planners::elastic {

const char* to_string(ClutchMode mode) {
  switch (mode) {
    case ClutchMode::free:
      return "free";
    case ClutchMode::hold:
      return "hold";
    case ClutchMode::sea:
      return "SEA";
    case ClutchMode::brk:
      return "BRK";
    case ClutchMode::still:
      return "spring";
    case ClutchMode::locked:
      return "locked";
    case ClutchMode::rigid:
      break;
  }
  return "rigid";
}

Eigen::Matrix<double, kCoordinates, Eigen::Dynamic, 0, kCoordinates, kCoordinates> free_velocities(
    ClutchMode mode) {
  // Columns: which coordinates move together. θ, ψ, q₁, q₂, q₃.
  const auto of = [](std::initializer_list<std::initializer_list<int>> columns) {
    Eigen::Matrix<double, kCoordinates, Eigen::Dynamic, 0, kCoordinates, kCoordinates> Z(
        kCoordinates, static_cast<int>(columns.size()));
    Z.setZero();
    int c = 0;
    for (const auto& column : columns) {
      for (const int row : column) Z(row, c) = 1;
      ++c;
    }
    return Z;
  };
  switch (mode) {
    case ClutchMode::free:
      return of({{0}, {1}, {2}, {3}, {4}});
    case ClutchMode::hold:
      return of({{0}, {2}, {3}, {4}});
    case ClutchMode::sea:
      return of({{0}, {1, 4}, {2}, {3}});
    case ClutchMode::brk:
      return of({{0}, {2}, {3}});
    case ClutchMode::still:
      return of({{1, 4}, {2}, {3}});
    case ClutchMode::locked:
      return of({{2}, {3}});
    case ClutchMode::rigid:
      break;
  }
  return of({{0, 1, 4}, {2}, {3}});
}

void validate(const ClutchedArm& arm) {
  planners::validate(arm.chain);
  if (arm.chain.size() != kLinks)
    throw std::invalid_argument(
        fmt::format("clutched arm '{}': {} joints; accepted: {}", arm.chain.name, arm.chain.size(), kLinks));
  const auto frames = frames_of<double>(arm.chain, JointVector<double>::Zero(kLinks));
  for (int i = 0; i < kLinks; ++i) {
    const Joint& joint = arm.chain.joints[i];
    if ((frames.links[i].R.col(2) - Eigen::Vector3d(0, -1, 0)).norm() > 1e-12)
      throw std::invalid_argument(
          fmt::format("clutched arm: the axis of joint '{}' is not −y of the base", joint.name));
    if (!std::isfinite(joint.limits.velocity) || !std::isfinite(joint.limits.torque) ||
        !std::isfinite(joint.limits.lower) || !std::isfinite(joint.limits.upper))
      throw std::invalid_argument(
          fmt::format("clutched arm: joint '{}' needs limits of angle, velocity and torque", joint.name));
    if (!(arm.rotor_inertia[i] >= 0) || (i == kLinks - 1 && arm.rotor_inertia[i] != 0))
      throw std::invalid_argument(
          fmt::format("clutched arm: rotor inertia {} kg m² of joint '{}'; accepted: >= 0, and 0 "
                      "for the last, whose motor stands behind the spring",
                      arm.rotor_inertia[i], joint.name));
  }
  const auto positive = [](const char* name, double value) {
    if (!(value > 0) || !std::isfinite(value))
      throw std::invalid_argument(fmt::format("clutched arm: {} = {}; accepted: > 0", name, value));
  };
  const ClutchedJoint& j = arm.last;
  positive("stiffness", j.stiffness);
  positive("motor_inertia", j.motor_inertia);
  positive("spring_inertia", j.spring_inertia);
  positive("motor_speed", j.motor_speed);
  positive("motor_torque", j.motor_torque);
  positive("deflection", j.deflection);
  positive("brake_torque", j.brake_torque);
  if (!(j.damping >= 0) || !std::isfinite(j.damping))
    throw std::invalid_argument(fmt::format("clutched arm: damping = {}; accepted: >= 0", j.damping));
}

ClutchedArm read_clutched_arm(const std::string& name_or_file) {
  using datasets::TomlKeys;
  const BuiltInArm* built_in = nullptr;
  for (const BuiltInArm& one : built_in_arms())
    if (one.name == name_or_file) built_in = &one;
  TomlKeys keys =
      built_in ? TomlKeys::parse_text(built_in->arm, name_or_file) : TomlKeys::parse(name_or_file);
  const auto positive = [](const char* unit) { return datasets::TomlLimits{0, 1e6, true, unit}; };
  keys.text("source");
  keys.text("notes");
  ClutchedArm arm;
  const std::string chain = keys.required("chain", keys.text("chain"));
  arm.chain = built_in ? toml_chain(built_in->chain, chain)
                       : read_toml_chain(std::filesystem::path(name_or_file).parent_path() / chain);
  double rotors[2]{};
  keys.numbers("rotor_inertia_kg_m2", {0, 1e6, false, "kg m^2"}, rotors);
  arm.rotor_inertia = {rotors[0], rotors[1], 0};
  TomlKeys last = keys.required("last", keys.table("last"));
  const auto number = [&](const char* key, const datasets::TomlLimits& limits) {
    return last.required(key, last.number(key, limits));
  };
  last.text("source");
  last.text("notes");
  arm.last.stiffness = number("stiffness_n_m_rad", positive("N m/rad"));
  arm.last.damping = number("damping_n_m_s_rad", {0, 1e6, false, "N m s/rad"});
  arm.last.motor_inertia = number("motor_inertia_kg_m2", positive("kg m^2"));
  arm.last.spring_inertia = number("spring_inertia_kg_m2", positive("kg m^2"));
  arm.last.motor_speed = number("motor_speed_rad_s", positive("rad/s"));
  arm.last.motor_torque = number("motor_torque_n_m", positive("N m"));
  arm.last.deflection = number("deflection_rad", positive("rad"));
  arm.last.brake_torque = number("brake_torque_n_m", positive("N m"));
  last.reject_unknown();
  keys.reject_unknown();
  try {
    validate(arm);
  } catch (const std::invalid_argument& error) {
    keys.fail("chain", error.what());
  }
  return arm;
}

}  // namespace unhand::planners::elastic
