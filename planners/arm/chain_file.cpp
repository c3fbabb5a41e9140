#include "planners/arm/chain_file.hpp"

#include <fmt/format.h>

#include <numbers>
#include <stdexcept>

#include "datasets/toml_keys.hpp"
#include "planners/arm/kinematics.hpp"
#include "planners/arm/panda.hpp"

namespace unhand::planners {
namespace {

using datasets::TomlKeys;
using datasets::TomlLimits;

constexpr TomlLimits length_limits{-10, 10, false, "m"};
constexpr TomlLimits turn_limits{-360, 360, false, "deg"};
constexpr TomlLimits angle_limits{-100, 100, false, "rad"};
constexpr TomlLimits velocity_limits{0, 1e3, true, "rad/s"};
constexpr TomlLimits acceleration_limits{0, 1e6, true, "rad/s^2"};
constexpr TomlLimits jerk_limits{0, 1e9, true, "rad/s^3"};
constexpr TomlLimits torque_limits{0, 1e6, true, "N m"};
constexpr TomlLimits mass_limits{0, 1e4, false, "kg"};
constexpr TomlLimits inertia_limits{-1e5, 1e5, false, "kg m^2"};
constexpr TomlLimits friction_limits{-1e6, 1e6, false, "N m, s/rad, rad/s"};

Transform<double> frame_of(TomlKeys& keys) {
  const double degree = std::numbers::pi / 180;
  const double a = keys.number("a_m", length_limits).value_or(0);
  const double alpha = keys.number("alpha_deg", turn_limits).value_or(0) * degree;
  const double d = keys.number("d_m", length_limits).value_or(0);
  const double theta = keys.number("theta_deg", turn_limits).value_or(0) * degree;
  Transform<double> out = modified_dh(a, alpha, d);
  if (theta != 0) out.R = joint_rotation(out.R, theta);
  return out;
}

Joint joint_of(TomlKeys& keys) {
  Joint joint;
  joint.name = keys.required("name", keys.text("name"));
  joint.origin = frame_of(keys);
  JointLimits& l = joint.limits;
  l.lower = keys.number("lower_rad", angle_limits).value_or(l.lower);
  l.upper = keys.number("upper_rad", angle_limits).value_or(l.upper);
  l.velocity = keys.number("velocity_rad_s", velocity_limits).value_or(l.velocity);
  l.acceleration = keys.number("acceleration_rad_s2", acceleration_limits).value_or(l.acceleration);
  l.jerk = keys.number("jerk_rad_s3", jerk_limits).value_or(l.jerk);
  l.torque = keys.number("torque_n_m", torque_limits).value_or(l.torque);
  joint.link.mass = keys.number("mass_kg", mass_limits).value_or(0);
  if (const auto com = keys.triple("com_m", length_limits))
    joint.link.com = {(*com)[0], (*com)[1], (*com)[2]};
  double inertia[6]{}, friction[3]{};
  if (keys.numbers("inertia_kg_m2", inertia_limits, inertia))
    joint.link.about_com = symmetric(inertia[0], inertia[1], inertia[2], inertia[3], inertia[4], inertia[5]);
  if (keys.numbers("friction", friction_limits, friction))
    joint.friction = {friction[0], friction[1], friction[2]};
  keys.reject_unknown();
  return joint;
}

Chain chain_of(TomlKeys keys) {
  Chain out;
  out.name = keys.required("name", keys.text("name"));
  keys.text("source");
  keys.text("notes");
  for (TomlKeys& one : keys.tables("joint")) out.joints.push_back(joint_of(one));
  if (auto tip = keys.table("tip")) {
    out.tip = frame_of(*tip);
    tip->reject_unknown();
  }
  std::vector<double> home(out.joints.size());
  if (keys.numbers("home_rad", angle_limits, home))
    out.home = JointVector<double>::Map(home.data(), static_cast<Eigen::Index>(home.size()));
  keys.reject_unknown();
  try {
    validate(out);
  } catch (const std::invalid_argument& error) {
    keys.fail("joint", error.what());
  }
  return out;
}

}  // namespace

Chain read_toml_chain(const std::filesystem::path& file) { return chain_of(TomlKeys::parse(file)); }
Chain toml_chain(std::string_view text, const std::string& name) {
  return chain_of(TomlKeys::parse_text(text, name));
}

Chain read_chain(const std::string& name_or_file, const std::string& tip) {
  const std::filesystem::path file(name_or_file);
  if (file.extension() == ".urdf" || file.extension() == ".xml") return read_urdf_chain(file, tip);
  if (!tip.empty()) throw std::invalid_argument(fmt::format("tip: '{}' is no .urdf file", name_or_file));
  if (name_or_file == "panda") return panda();
  if (file.extension() == ".toml") return read_toml_chain(file);
  throw std::invalid_argument(
      fmt::format("arm: '{}' is not panda, a .toml file or a .urdf file", name_or_file));
}

}  // namespace unhand::planners
