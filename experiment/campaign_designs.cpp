#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "datasets/near_miss.hpp"
#include "experiment/random_stream.hpp"
#include "experiment/synthetic_campaign.hpp"

namespace unhand::experiment {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// A solid box, or a can (a cylinder seen from its side), held at its CoM.
ThrownObject box(double drag_k) {
  constexpr double mass = 0.100, length = 0.12, height = 0.08;
  return {"box", {mass, mass * (length * length + height * height) / 12}, 0, {length, height, 0.06}, drag_k};
}
ThrownObject jar(double drag_k) {
  constexpr double mass = 0.022, radius = 0.035, height = 0.10;
  return {
      "jar", {mass, mass * (3 * radius * radius + height * height) / 12}, 0, {height, 0.07, 0.07}, drag_k};
}
ThrownObject bar(int millimetres, double drag_k) {
  ThrownObject out = loaded_bar(fmt::format("bar-{}", millimetres), millimetres * 1e-3);
  out.drag_k = drag_k;
  return out;
}

/// How a posture holds objects until the gripper opens: without jitter, with the campaign's patch.
struct Hold {
  double grasp_angle{};  ///< [rad]
  double grip_force{};   ///< the least that holds all of them [N]
};

/// The grasp angle at which the object with the largest moment loads the pads least, about where its CoM
/// follows the hand's acceleration against gravity: above the pads (standing) or below (hanging).
Hold hold_in(const CampaignDesign& design, const Posture& posture, bool standing) {
  const PlanarArmHand hand = throw_motion(design.arm, design.motion(posture, design.launch_acceleration));
  const double opening = design.opening.open_command + design.opening.dead_time;
  const Window window{hand.begin(), design.switch_time};
  const auto grip = [&](const ThrownObject& object, double grasp_angle) {
    double most = 0;
    constexpr int kInstants = 8;
    for (int i = 0; i <= kInstants; ++i) {
      const auto state = hand.at(window, design.begin + (opening - design.begin) * i / kInstants);
      const contact::Scene<double> scene{object.body, dynamics::level_gravity(design.gravity), state.pose,
                                         state.twist, state.acceleration};
      const auto wrench = contact::sticking_wrench(scene, {{object.com_offset, 0}, grasp_angle, {}, 0});
      most = std::max(most, std::hypot(wrench.fx, wrench.fz, wrench.tau / design.patch.length()));
    }
    return most / design.patch.f_max(1.0);
  };
  const auto state = hand.at(window, 0.5 * (design.begin + opening));
  const double x = state.acceleration.ax, z = state.acceleration.az + design.gravity;
  const double balanced = std::atan2(standing ? z : -z, standing ? x : -x) - state.pose.theta;
  const auto& heaviest = *std::max_element(
      design.objects.begin(), design.objects.end(), [](const ThrownObject& left, const ThrownObject& right) {
        return left.body.mass * left.com_offset < right.body.mass * right.com_offset;
      });
  Hold best{balanced, grip(heaviest, balanced)};
  for (int i = -40; i <= 40; ++i)
    if (const double angle = balanced + 0.01 * i, force = grip(heaviest, angle); force < best.grip_force)
      best = {angle, force};
  for (const ThrownObject& object : design.objects)
    best.grip_force = std::max(best.grip_force, grip(object, best.grasp_angle));
  return best;
}

}  // namespace

ThrownObject loaded_bar(std::string name, double com_offset) {
  constexpr double bar = 0.092, length = 0.32, width = 0.03, held = 0.01;  // kg, m, m, m from the tip
  constexpr double load = 0.154, radius = 0.01, height = 0.06;             // a steel cylinder along the bar
  constexpr double centre = 0.5 * length - held, mass = bar + load;
  const double slot = (mass * com_offset - bar * centre) / load;
  if (!(slot >= 0 && slot <= length - held - 0.5 * height))
    throw std::invalid_argument(fmt::format("loaded_bar: com_offset = {} m is not in [{:.4g}, {:.4g}] m",
                                            com_offset, bar * centre / mass,
                                            (bar * centre + load * (length - held - 0.5 * height)) / mass));
  const auto square = [](double x) { return x * x; };
  const double inertia = bar * (square(length) + square(width)) / 12 + bar * square(centre - com_offset) +
                         load * (3 * square(radius) + square(height)) / 12 + load * square(slot - com_offset);
  return {std::move(name), {mass, inertia}, com_offset, {length, width, 0.02}};
}

SensorSuite SensorSuite::perfect() const {
  SensorSuite out = *this;
  out.hand_sigma = out.normal_force_sigma = out.mocap_dropout = out.landing_time_sigma = 0;
  out.wrench_sigma = {};
  out.mocap_sigma = {};
  out.landing_sigma = {};
  return out;
}

int CampaignDesign::conditions() const {
  return static_cast<int>(objects.size() * postures.size() * release_accelerations.size());
}
int CampaignDesign::throws() const { return conditions() * repetitions; }

ThrowMotion CampaignDesign::motion(const Posture& posture, double release_acceleration) const {
  const double speed = posture.speed;
  return {begin,
          switch_time,
          follow_through,
          end,
          posture.hand,
          {speed * std::cos(posture.elevation), speed * std::sin(posture.elevation), posture.omega},
          launch_acceleration,
          release_acceleration};
}

/// Pitch, speed and how hard the hand brakes, each at three levels, as in the task of
/// [LiuDaCostaBillard2025]: the pads become a hinge and the bar flips on. Bar, pads and gripper are those of
/// planners/flip/robot.toml.
CampaignDesign throw_flip_campaign() {
  CampaignDesign design;
  design.name = "throw-flip";
  design.objects = {{"bar", {0.242, 1.6e-3}, 0.12, {0.32, 0.03, 0.02}}};
  design.patch = {0.6, 0.0105};
  design.opening = {0.050, 33, 0.015, 0.050, 1.0};
  design.begin = -0.02;
  design.switch_time = 0.050;  // the brake begins with the command to open
  design.release_accelerations = {-4, -12, -20};
  design.repetitions = 3;
  for (const int pitch : {-45, -25, -5})
    for (const double speed : {2.0, 2.4, 2.8}) {
      Posture posture{fmt::format("pitch{:+}/speed{:.1f}", pitch, speed),
                      {0.45, 0.55, pitch * kDegree},
                      speed,
                      (pitch + 67) * kDegree,
                      2.2 * speed};
      posture.grasp_angle = hold_in(design, posture, false).grasp_angle;
      design.postures.push_back(posture);
    }
  return design;
}

std::vector<std::string> campaign_names() { return {"batch180", "throw-flip", "quick12", "random"}; }

CampaignDesign campaign_design(std::string_view name, std::uint64_t seed) {
  if (name == "random") return random_campaign(seed);
  if (name == "throw-flip") return throw_flip_campaign();
  CampaignDesign design;
  design.name = name;
  design.objects = {loaded_bar("bar-com100", 0.10), loaded_bar("bar-com160", 0.16)};
  const auto posture = [](int pitch, double speed, double elevation) -> Posture {
    return {fmt::format("pitch{:+}", pitch), {0.50, 0.55, pitch * kDegree}, speed, elevation * kDegree, 4.0};
  };
  if (name == "batch180") {
    design.postures = {posture(-40, 2.4, 34), posture(-22, 2.4, 42), posture(-4, 2.4, 50)};
    design.release_accelerations = {8, 3, -4, -9, -14, -19};
  } else if (name == "quick12") {
    design.postures = {posture(-22, 2.4, 42)};
    design.release_accelerations = {8, -4, -14};
    design.repetitions = 2;
  } else {
    throw std::invalid_argument(
        datasets::unknown_name(fmt::format("no campaign is called '{}'", name), name, campaign_names()));
  }
  return design;
}

CampaignDesign random_campaign(std::uint64_t seed) {
  RandomStream random(seed, 0, Purpose::design);
  CampaignDesign design;
  design.name = "random";

  const bool drag = random.uniform() < 0.5;
  std::vector<ThrownObject> objects{bar(100, 0), bar(120, 0), bar(160, 0), box(0), jar(0)};
  const std::array<std::array<double, 2>, 5> drags{
      {{0.005, 0.02}, {0.005, 0.02}, {0.005, 0.02}, {0.02, 0.06}, {0.05, 0.2}}};
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const double k = random.uniform(drags[i][0], drags[i][1]);
    if (drag) objects[i].drag_k = k;
  }
  // One is a bar: friction has little to say about objects held at their CoM.
  const auto first = random.index(3), second = (first + 1 + random.index(4)) % 5;
  design.objects = {objects[static_cast<std::size_t>(first)], objects[static_cast<std::size_t>(second)]};
  if (random.uniform() < 0.5) std::swap(design.objects[0], design.objects[1]);

  design.patch = {random.uniform(0.45, 0.6), random.uniform(9.5e-3, 13e-3)};
  design.declared_pad_radius = design.patch.radius * random.uniform(0.9, 1.1);
  const double dead_time = random.uniform(6e-3, 9e-3), opening_time = random.uniform(48e-3, 60e-3);
  design.opening = {0.050, random.uniform(20, 30), dead_time, opening_time,
                    random.uniform() < 0.5 ? 1.0 : 1.25};
  // The arm brakes, or speeds up, while the gripper opens.
  design.begin = -0.02;
  design.switch_time = 0.060;
  design.follow_through = 0.17;
  design.launch_acceleration = random.uniform(0.5, 1.1);

  const bool over = random.uniform() < 0.5;
  const double middle = over ? 105 : -23, spread = random.uniform(15, 20), speed = random.uniform(2.3, 2.7),
               omega = random.uniform(3.9, 4.6), elevation = random.uniform(38, 46);
  for (const int i : {-1, 0, 1}) {
    const double pitch = middle + i * spread;
    Posture posture{fmt::format("{}{:+.0f}", over ? "over" : "under", pitch),
                    {0.45, over ? 0.75 : 0.55, pitch * kDegree},
                    speed,
                    (elevation + 6 * i) * kDegree,
                    over ? -omega : omega};
    const Hold hold = hold_in(design, posture, over);
    posture.grasp_angle = hold.grasp_angle;
    // a quarter for what varies from throw to throw
    design.opening.grip_force = std::max(design.opening.grip_force, 1.25 * hold.grip_force);
    design.postures.push_back(posture);
  }
  const bool three = random.uniform() < 0.4;
  const double faster = random.uniform(3.3, 5.5), slower = random.uniform(-16.5, -14.3);
  design.release_accelerations = {faster, slower};
  if (three)
    design.release_accelerations.insert(design.release_accelerations.begin() + 1, random.uniform(-5.5, -4.5));
  // names say the design, so it is as round as they are
  for (double& a : design.release_accelerations) a = std::round(10 * a) / 10;
  design.repetitions = three ? 3 : random.uniform() < 0.5 ? 4 : 5;

  design.variation.grip_force = 0.02;
  design.variation.mu = random.uniform(0.01, 0.04);
  design.variation.grasp_offset = 0.3e-3;
  design.variation.dead_time = 0.3e-3;
  design.variation.opening_time = 0.5e-3;
  return design;
}

}  // namespace unhand::experiment
