// Arms from TOML and URDF files.
#include "planners/arm/chain_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>

#include "datasets/log_error.hpp"
#include "planners/arm/dynamics.hpp"
#include "tests/support/scratch.hpp"

namespace unhand::planners {
namespace {

using testing::HasSubstr;
using Joints = JointVector<double>;

class ChainFile : public testing::Test {
 protected:
  std::string put(const std::string& name, const std::string& text) const {
    std::ofstream(folder / name) << text;
    return (folder / name).string();
  }
  const support::Scratch scratch;
  const std::filesystem::path folder = scratch.path();
};

/// Two links of 0.5 and 0.4 m in the x-z plane, each with its mass halfway. With the axes −y the angles are
/// counter-clockwise from +x to +z.
constexpr double l1 = 0.5, l2 = 0.4, m1 = 2.0, m2 = 1.5;
void expect_two_links(const Chain& arm) {
  ASSERT_EQ(arm.size(), 2);
  const Joints q{{0.7, -1.1}};
  const auto tip = forward_kinematics(arm, q);
  const double a = q[0], b = q[0] + q[1];
  EXPECT_NEAR(tip.p[0], l1 * std::cos(a) + l2 * std::cos(b), 1e-15);
  EXPECT_NEAR(tip.p[1], 0, 1e-15);
  EXPECT_NEAR(tip.p[2], 0.3 + l1 * std::sin(a) + l2 * std::sin(b), 1e-15);
  const Joints g = gravity_torque(arm, q);
  const double second = m2 * 9.81 * l2 / 2 * std::cos(b);
  EXPECT_NEAR(g[1], second, 1e-13);
  EXPECT_NEAR(g[0], second + 9.81 * (m1 / 2 + m2) * l1 * std::cos(a), 1e-13);
  // M of the textbook's two links, with I about each com.
  const double c = std::cos(q[1]), I = 0.01;
  const auto M = mass_matrix(arm, q);
  const double m22 = m2 * l2 * l2 / 4 + I, m12 = m22 + m2 * l1 * l2 / 2 * c;
  EXPECT_NEAR(M(1, 1), m22, 1e-14);
  EXPECT_NEAR(M(0, 1), m12, 1e-14);
  EXPECT_NEAR(M(0, 0), m1 * l1 * l1 / 4 + I + m2 * l1 * l1 + 2 * m12 - m22, 1e-14);
  EXPECT_EQ(arm.joints[0].limits.upper, 2.5);
  EXPECT_EQ(arm.joints[1].limits.velocity, 3);
  EXPECT_EQ(arm.joints[1].limits.torque, 40);
}

const std::string two_links = R"(name = "two links"
source = "this test"
[[joint]]
name = "shoulder"
alpha_deg = 90
d_m = 0
lower_rad = -2.5
upper_rad = 2.5
mass_kg = 2.0
com_m = [0.25, 0, 0]
inertia_kg_m2 = [0.01, 0.01, 0.01, 0, 0, 0]
[[joint]]
name = "elbow"
a_m = 0.5
velocity_rad_s = 3
torque_n_m = 40
jerk_rad_s3 = 5000
mass_kg = 1.5
com_m = [0.2, 0, 0]
inertia_kg_m2 = [0.01, 0.01, 0.01, 0, 0, 0]
[tip]
a_m = 0.4
)";

TEST_F(ChainFile, Toml) {
  Chain arm = read_chain(put("arm.toml", two_links));
  EXPECT_EQ(arm.name, "two links");
  EXPECT_EQ(arm.joints[1].limits.jerk, 5000);
  EXPECT_EQ(arm.home.size(), 0);
  EXPECT_EQ(read_chain(put("rests.toml", "home_rad = [0.5, -1]\n" + two_links)).home, (Joints{{0.5, -1}}));
  arm.joints[0].origin.p[2] = 0.3;  // modified parameters cannot put the first axis, which is level, there
  expect_two_links(arm);
}

TEST_F(ChainFile, TomlMistakesAreToldWhereTheyAre) {
  const auto refused = [&](std::string from, const std::string& to, const std::string& why) {
    std::string text = two_links;
    text.replace(text.find(from), from.size(), to);
    EXPECT_THAT([&] { read_toml_chain(put("bad.toml", text)); },
                testing::ThrowsMessage<datasets::TomlError>(HasSubstr(why)));
  };
  refused("source", "home_rad = [0.5]\nsource", "home_rad: [ 0.5 ] is not a list of 2 numbers");
  refused("source", "home_rad = [3, 0]\nsource", "home of joint 'shoulder': 3 is not in [-2.5, 2.5] rad");
  refused("mass_kg = 2.0", "mass_kg = -2", "bad.toml:9:11: mass_kg: -2 is outside [0, 10000] kg");
  refused("jerk_rad", "jrek_rad", ": unknown key: did you mean 'jerk_rad_s3'?");
  refused("name = \"elbow\"", "", "name: required key is missing");
  refused("com_m = [0.2, 0, 0]", "com_m = [0.2, 0]", "is not a list of 3 numbers");
  refused("lower_rad = -2.5", "lower_rad = 3", "limits [3, 2.5] rad are empty");
  refused("inertia_kg_m2 = [0.01", "inertia_kg_m2 = [0.05", "no body of 2 kg can have its inertia");
  EXPECT_THROW(read_chain("kuka"), std::invalid_argument);
  EXPECT_THROW(read_chain("/none.toml"), datasets::TomlError);
}

/// The same arm with axes along −y, masses in links of their own that are fixed to the moving ones, and a
/// base that turns everything by half a turn and back.
const std::string urdf = R"(<?xml version="1.0"?>
<robot name="two links">
  <link name="world"/><link name="base"/>
  <link name="upper"/><link name="upper_mass"><inertial><mass value="2"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 0.2" rpy="0 0 0.3"/><mass value="1.5"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"/>
  <joint name="stand" type="fixed"><parent link="world"/><child link="base"/>
    <origin xyz="0 0 0.3" rpy="0 0 3.141592653589793"/></joint>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0" rpy="0 0 3.141592653589793"/><axis xyz="0 -2 0"/>
    <limit lower="-2.5" upper="2.5" velocity="2" effort="80"/></joint>
  <joint name="bolt" type="fixed"><parent link="upper"/><child link="upper_mass"/>
    <origin xyz="0.25 0 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.5 0 0" rpy="0 1.5707963267948966 0"/><axis xyz="0 -1 0"/>
    <limit velocity="3" effort="40"/></joint>
  <joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/>
    <origin xyz="0 0 0.4"/></joint>
</robot>
)";

TEST_F(ChainFile, Urdf) {
  const std::string file = put("arm.urdf", urdf);
  // The bolt's mass hangs beside the way to the hand: as one solid with the upper arm it must still count.
  Chain arm = read_urdf_chain(file, "hand");
  EXPECT_EQ(arm.name, "two links");
  EXPECT_EQ(arm.joints[0].limits.acceleration, JointLimits::kNone);
  expect_two_links(arm);
}

TEST_F(ChainFile, UrdfSaysWhichMassesDoNotCount) {
  std::string text = urdf;
  const auto mass = [](const std::string& kg) {
    return "<inertial><mass value=\"" + kg +
           "\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
  };
  const auto joined = [](const std::string& joint, const std::string& type, const std::string& parent,
                         const std::string& child) {
    return "<joint name=\"" + joint + "\" type=\"" + type + "\"><parent link=\"" + parent +
           "\"/><child link=\"" + child + "\"/></joint>\n";
  };
  text.replace(text.find("</robot>"), 8,
               "<link name=\"finger\">" + mass("0.03") + "</link><link name=\"nail\">" + mass("0.005") +
                   "</link><link name=\"camera\"/><link name=\"lens\"/><link name=\"cart\">" + mass("9") +
                   "</link>\n" + joined("grip", "prismatic", "hand", "finger") +
                   joined("glue", "fixed", "finger", "nail") +
                   joined("pan", "revolute", "upper_mass", "camera") +
                   joined("focus", "fixed", "camera", "lens") + joined("rail", "prismatic", "base", "cart") +
                   "</robot>");
  const Chain arm = read_urdf_chain(put("fingers.urdf", text), "hand");
  expect_two_links(arm);
  // What has no mass is not missed, and the base bears what hangs on it.
  EXPECT_THAT(arm.notes, testing::ElementsAre(
                             "joint 'grip' is beside the chain: what it moves, 0.035 kg, does not count"));
  EXPECT_THAT(read_urdf_chain(put("arm.urdf", urdf), "hand").notes, testing::IsEmpty());
}

TEST_F(ChainFile, UrdfMistakesAreToldWhereTheyAre) {
  const auto refused = [&](std::string from, const std::string& to, const std::string& why) {
    std::string text = urdf;
    if (!from.empty()) text.replace(text.find(from), from.size(), to);
    EXPECT_THAT([&] { read_urdf_chain(put("bad.urdf", text), from.empty() ? "" : "hand"); },
                testing::ThrowsMessage<datasets::ImportError>(HasSubstr(why)));
  };
  refused("continuous", "prismatic", "line 16: type 'prismatic' is not revolute, continuous or fixed");
  refused("xyz=\"0 -2 0\"", "xyz=\"0 0 0\"", "line 11: its axis has no direction");
  refused("<axis xyz=\"0 -1 0\"/>",
          "<axis xyz=\"0 -1 0\"/>\n    <mimic joint=\"shoulder\" multiplier=\"-1\"/>",
          "line 18: joint 'elbow' mimics 'shoulder', and does not move by itself");
  refused("xyz=\"0 0 0.4\"", "xyz=\"0 0\"", "xyz=\"0 0\" is not three numbers");
  refused("link=\"hand\"/>", "link=\"paw\"/>", "there is no link 'paw'");
  refused("mass value=\"1.5\"", "mass value=\"-1.5\"", "a mass of -1.5 kg");
  refused("velocity=\"3\"", "velocity=\"3,0\"", "velocity=\"3,0\" is not a number");
  refused("link name=\"hand\"", "link name=\"upper\"", "there is another link 'upper'");
  refused("", "", "the tip is 'hand' or 'upper_mass' or another: name it");
  refused("</robot>", "", "bad.urdf: line");
  EXPECT_THROW(read_urdf_chain(folder / "none.urdf"), datasets::ImportError);
}

// rpy is about the fixed axes, roll first: an upright rod that is rolled by 90° lies along −y, and a yaw of
// 90° then turns it to +x; a pitch in between is about the fixed y, along which it lies, and moves nothing.
TEST_F(ChainFile, UrdfTurnsAboutFixedAxes) {
  const auto rod = [](const std::string& rpy) {  // 1 kg, along its own z
    return R"(<robot name="rod"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 0" rpy=")" +
           rpy +
           R"("/><mass value="1"/><inertia ixx="0.08" iyy="0.09" izz="0.01" ixy="0" ixz="0" iyz="0"/>
             </inertial></link><link name="end"/>
             <joint name="j" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/></joint>
             <joint name="k" type="fixed"><parent link="rod"/><child link="end"/>
               <origin xyz="0 0 0.5" rpy=")" +
           rpy + R"("/></joint></robot>)";
  };
  const auto read = [&](const std::string& rpy) { return read_urdf_chain(put("rod.urdf", rod(rpy)), "end"); };
  const std::string quarter = "1.5707963267948966";
  const Chain turned = read(quarter + " 0.7 " + quarter);
  EXPECT_LT((turned.tip.R.col(2) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
  // Along x: least about x. The rod's own x axis, pitched by 0.7 in the x-z plane, is yawed into y-z.
  const double c = std::cos(0.7), s = std::sin(0.7);
  const Eigen::Vector3d x(0, c, -s), y = Eigen::Vector3d(1, 0, 0).cross(x);
  const Eigen::Matrix3d expected = 0.08 * x * x.transpose() + 0.09 * y * y.transpose() +
                                   0.01 * Eigen::Vector3d::UnitX() * Eigen::Vector3d::UnitX().transpose();
  EXPECT_LT((turned.joints[0].link.about_com - expected).norm(), 1e-12);
  EXPECT_NEAR(mass_matrix<double>(turned, Joints::Zero(1))(0, 0), expected(2, 2), 1e-12);
}

}  // namespace
}  // namespace unhand::planners
