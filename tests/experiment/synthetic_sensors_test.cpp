// What the sensors of synthetic throws show is the physics that made them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "tests/support/perfect_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;
using testing_support::kSeed;
using testing_support::perfect;

dynamics::Window window_at(const PlanarArmHand& hand, double t) {
  dynamics::Window w{hand.begin(), hand.end()};
  for (const double jump : hand.jumps())
    (jump <= t ? w.begin : w.end) = jump <= t ? jump : std::min(w.end, jump);
  return w;
}

/// Linear between the samples.
double at(const datasets::Series& time, const datasets::Series& values, std::size_t column, double t) {
  const auto next = std::upper_bound(time.data.begin(), time.data.end(), t);
  const std::size_t i = static_cast<std::size_t>(std::distance(time.data.begin(), next)) - 1;
  const double u = (t - time(i)) / (time(i + 1) - time(i));
  return (1 - u) * values(i, column) + u * values(i + 1, column);
}
TEST(SyntheticSensors, HeldObjectIsCarriedByTheHand) {
  const CampaignDesign design = perfect();
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    const double offset = design.objects[i / (design.throws() / 2)].com_offset;
    const PlanarArmHand hand = throw_motion(design.arm, truth.motion);
    const auto& mocap = *record.mocap;
    int held = 0;
    for (std::size_t k = 0; k < mocap.time.rows; ++k) {
      const double t = mocap.time(k);
      if (t > truth.motion.switch_time) break;  // from there on it may slip
      const auto pose = hand.at(window_at(hand, t), t).pose;
      const double angle = pose.theta + truth.grasp_angle;
      // the object's pose is made from the hand's: rounding only
      EXPECT_NEAR(mocap.pose(k, 0), pose.x + offset * std::cos(angle), 1e-14) << i << " at " << t;
      EXPECT_NEAR(mocap.pose(k, 1), pose.z + offset * std::sin(angle), 1e-14) << i << " at " << t;
      EXPECT_NEAR(mocap.pose(k, 2), angle, 1e-14) << i << " at " << t;
      ++held;
    }
    EXPECT_GE(held, 15) << "70 ms at 240 Hz";
  }
}

TEST(SyntheticSensors, HandLogIsTheMotionWithTheLaterAccelerationAtAJump) {
  const CampaignDesign design = perfect();
  const auto [record, truth] = generate_throw(design, kSeed, 3);
  const auto& log = *record.hand;
  EXPECT_EQ(log.time.rows, 351u);  // −50 … 300 ms
  EXPECT_EQ(record.hand_jump_times, (std::vector<double>{design.switch_time, design.follow_through}));
  const PlanarArmHand hand = throw_motion(design.arm, truth.motion);
  bool at_jump = false;
  for (std::size_t k = 0; k < log.time.rows; ++k) {
    const auto state = hand.at(window_at(hand, log.time(k)), log.time(k));
    EXPECT_EQ(log.pose(k, 0), state.pose.x);
    EXPECT_EQ(log.twist(k, 1), state.twist.vz);
    EXPECT_EQ(log.acceleration(k, 0), state.acceleration.ax) << log.time(k);
    at_jump = at_jump || log.time(k) == design.switch_time;
  }
  EXPECT_TRUE(at_jump) << "a multiple of 1 ms must be the double that the decimal number is";
}

// In flight nothing but gravity acts: z is a parabola, x and θ are straight lines, and they end where the
// landing is.
TEST(SyntheticSensors, FlightIsAParabolaToTheLanding) {
  const CampaignDesign design = perfect();
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    const auto& mocap = *record.mocap;
    std::size_t first = 0;
    while (mocap.time(first) < truth.detach_time) ++first;
    const std::size_t last = mocap.time.rows - 1;
    ASSERT_GT(last, first + 50);
    const auto v = [&](std::size_t k, std::size_t c) {
      const double h = 1 / design.sensors.mocap_rate;
      return (mocap.pose(k + 1, c) - mocap.pose(k, c)) / h;
    };
    for (std::size_t k = first; k + 2 <= last; ++k) {
      const double h = 1 / design.sensors.mocap_rate;
      // the quotient divides rounding of 1e-16 of a metre and of a second twice by 4 ms
      EXPECT_NEAR(v(k + 1, 0), v(k, 0), 1e-12);
      EXPECT_NEAR(v(k + 1, 2), v(k, 2), 1e-12);
      EXPECT_NEAR((v(k + 1, 1) - v(k, 1)) / h, -design.gravity, 1e-9);
    }
    const double t = record.landing->time(0) - mocap.time(last), h = 1 / design.sensors.mocap_rate;
    EXPECT_GE(t, 0);
    EXPECT_LT(t, h);
    const double vz = v(last - 1, 1) - 0.5 * design.gravity * h;
    EXPECT_NEAR(mocap.pose(last, 1) + t * (vz - 0.5 * design.gravity * t), design.landing_height, 1e-12);
    EXPECT_NEAR(record.landing->pose(0, 0), mocap.pose(last, 0) + t * v(last - 1, 0), 1e-12);
    EXPECT_NEAR(record.landing->pose(0, 1), mocap.pose(last, 2) + t * v(last - 1, 2), 1e-12);
  }
}

// m a = 2 f + m g and I α = 2 τ + torque of the force about the CoM, where a and α are the second differences
// of the tracked pose and f, τ what the sensor behind one of the two pads reports. Nothing here goes through
// the simulator.
TEST(SyntheticSensors, ForcesOfBothPadsAndGravityAreNewtons) {
  CampaignDesign design = perfect();
  design.sensors.mocap_rate = design.sensors.ft_rate = 4000;
  double worst_force = 0, worst_torque = 0;
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    const auto& body = design.objects[i / (design.throws() / 2)].body;
    const PlanarArmHand hand = throw_motion(design.arm, truth.motion);
    const auto& mocap = *record.mocap;
    const auto& ft = *record.ft;
    const double h = 1 / design.sensors.mocap_rate;
    int checked = 0;
    for (std::size_t k = 1; k + 1 < mocap.time.rows && mocap.time(k) + 2 * h < truth.detach_time; ++k) {
      const double t = mocap.time(k);
      if (std::abs(t - truth.motion.switch_time) < 2 * h)
        continue;  // the acceleration jumps inside the difference
      const auto second = [&](std::size_t c) {
        return (mocap.pose(k + 1, c) - 2 * mocap.pose(k, c) + mocap.pose(k - 1, c)) / (h * h);
      };
      const auto pose = hand.at(window_at(hand, t), t).pose;
      const auto force = dynamics::rotate(
          pose.theta,
          dynamics::Vec2<double>{2 * at(ft.time, ft.wrench, 0, t), 2 * at(ft.time, ft.wrench, 1, t)});
      const double rx = mocap.pose(k, 0) - pose.x, rz = mocap.pose(k, 1) - pose.z;
      const double torque = 2 * at(ft.time, ft.wrench, 2, t) + rz * force.x - rx * force.z;
      const double error_x = body.mass * second(0) - force.x;
      const double error_z = body.mass * (second(1) + design.gravity) - force.z;
      const double error_torque = body.inertia * second(2) - torque;
      worst_force = std::max({worst_force, std::abs(error_x), std::abs(error_z)});
      worst_torque = std::max(worst_torque, std::abs(error_torque));
      ++checked;
    }
    EXPECT_GT(checked, 500) << i;
  }
  // Second differences over 0.25 ms: h²/12 of the jerk's slope, and the dense output's 1e-9 over h²; the
  // forces are some newtons, the torques some tenths of a newton metre.
  EXPECT_LT(worst_force, 0.02);
  EXPECT_LT(worst_torque, 0.002);
}

TEST(SyntheticSensors, NormalForceIsTheOpeningAndBoundsTheFriction) {
  const CampaignDesign design = perfect();
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    const auto& [open, grip, dead, opening, shape] = truth.opening;
    EXPECT_NEAR(truth.detach_time, open + dead + opening, 1e-12);
    const auto& ft = *record.ft;
    for (std::size_t k = 0; k < ft.time.rows; ++k) {
      const double s = std::clamp((ft.time(k) - open - dead) / opening, 0.0, 1.0);
      EXPECT_NEAR(ft.normal_force(k), grip * std::pow(1 - s, shape), 1e-10 * grip) << ft.time(k);
      // the force of one pad: μ f_N; the stop at the surface is found to the tolerance of the integrator
      const double force = std::hypot(ft.wrench(k, 0), ft.wrench(k, 1));
      EXPECT_LE(force, truth.patch.mu * ft.normal_force(k) * (1 + 1e-6) + 1e-12) << ft.time(k);
      EXPECT_LE(std::abs(ft.wrench(k, 2)),
                truth.patch.length() * truth.patch.mu * ft.normal_force(k) * (1 + 1e-6) + 1e-12)
          << ft.time(k);
    }
  }
}

// Residuals against the noise-free twin of the campaign, in units of the declared σ: mean 0, mean square 1.
TEST(SyntheticSensors, NoiseIsAsDeclared) {
  const CampaignDesign design = campaign_design("quick12"), quiet = perfect();
  struct Moments {
    double n = 0, sum = 0, squares = 0, cubes = 0, fourths = 0;
    void add(double x) { ++n, sum += x, squares += x * x, cubes += x * x * x, fourths += x * x * x * x; }
  };
  std::map<std::string, Moments> moments;
  double lost = 0, all = 0, below = 0, after = 0;
  const auto compare = [&](const std::string& name, const datasets::Series& a, const datasets::Series& b,
                           const datasets::MocapLog* mask = nullptr) {
    ASSERT_EQ(a.sigma.size(), a.cols) << name;
    ASSERT_EQ(a.rows, b.rows) << name;
    for (std::size_t k = 0; k < a.rows; ++k)
      for (std::size_t c = 0; c < a.cols; ++c)
        if (!mask || mask->is_valid(k)) moments[name].add((a(k, c) - b(k, c)) / a.sigma[c]);
  };
  for (int i = 0; i < design.throws(); ++i) {
    const auto loud = generate_throw(design, kSeed, i), clean = generate_throw(quiet, kSeed, i);
    const auto &a = loud.record, &b = clean.record;
    compare("hand/pose", a.hand->pose, b.hand->pose);
    compare("hand/acceleration", a.hand->acceleration, b.hand->acceleration);
    compare("ft/wrench", a.ft->wrench, b.ft->wrench);
    compare("ft/normal_force", a.ft->normal_force, b.ft->normal_force);
    compare("mocap/pose", a.mocap->pose, b.mocap->pose, &*a.mocap);
    for (std::size_t k = 0; k < a.mocap->time.rows; ++k) {
      ++all;
      lost += !a.mocap->is_valid(k);
      EXPECT_EQ(a.mocap->is_valid(k), !std::isnan(a.mocap->pose(k, 0)));
    }
    for (std::size_t k = 0; k < a.ft->time.rows; ++k)
      if (a.ft->time(k) > loud.truth.detach_time) ++after, below += a.ft->normal_force(k) < 0;
  }
  for (const auto& [name, m] : moments) {
    // five standard deviations of each mean: those of x, x², x³, x⁴ are 1, √2, √15, √96 over √n
    const double five = 5 / std::sqrt(m.n);
    EXPECT_NEAR(m.sum / m.n, 0.0, five) << name;
    EXPECT_NEAR(m.squares / m.n, 1.0, std::sqrt(2.0) * five) << name;
    EXPECT_NEAR(m.cubes / m.n, 0.0, std::sqrt(15.0) * five) << name;
    EXPECT_NEAR(m.fourths / m.n, 3.0, std::sqrt(96.0) * five) << name;
  }
  EXPECT_NEAR(lost / all, 0.005, 5 * std::sqrt(0.005 / all));
  EXPECT_NEAR(below / after, 0.5, 5 * 0.5 / std::sqrt(after));
}

}  // namespace
