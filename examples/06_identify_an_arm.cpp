// What the links of an arm weigh and how stiff its spring is, from logs of its motors. A simulated arm stands
// in for a robot.
#include <cmath>
#include <cstdio>
#include <random>
#include <utility>
#include <vector>

#include "planners/elastic/clutched_arm.hpp"
#include "planners/elastic/identify.hpp"

using namespace unhand::planners;

int main() {
  const elastic::ClutchedArm drawn = elastic::read_clutched_arm("bsa3");  // or FILE.toml
  elastic::ClutchedArm arm = drawn;  // as it was built: a heavier wrist, a softer spring
  arm.chain.joints[2].link.mass *= 1.3;
  arm.last.stiffness = 7.2;
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0, 0.05);  // of a torque [N m]

  // The links: a periodic motion within the limits that shows as much of them as one can.
  const auto excitation = elastic::design_excitation(drawn.chain);
  std::vector<elastic::MotionSample> motion;
  for (int k = 0; k < 400; ++k) {
    elastic::MotionSample s;
    excitation.motion.at(excitation.motion.period * k / 400, s.q, s.qd, s.qdd);
    s.torque = inverse_dynamics<double>(arm.chain, s.q, s.qd, s.qdd);
    for (double& one : s.torque) one += noise(random);
    motion.push_back(s);
  }
  const auto links = elastic::identify_inertia(drawn.chain, motion);
  const double m = links.feasible.joints[2].link.mass, c = links.feasible.joints[2].link.com.x();
  std::printf("%d combinations, condition %.0f, torques to %.3f N m; wrist: m c = %.4f kg m, drawn %.4f\n",
              static_cast<int>(links.estimate.size()), links.condition, links.torque_noise, m * c,
              drawn.chain.joints[2].link.mass * drawn.chain.joints[2].link.com.x());

  // The spring: the brake holds the link, the motor swings against it.
  std::vector<elastic::SpringSample> swing;
  for (int k = 0; k < 500; ++k) {
    const double t = 0.004 * k;
    elastic::SpringSample s;
    for (const auto& [amplitude, w] : {std::pair{0.25, 6.0}, {0.10, 2.7}}) {
      s.deflection += amplitude * std::sin(w * t);
      s.rate += amplitude * w * std::cos(w * t);
      s.acceleration -= amplitude * w * w * std::sin(w * t);
    }
    s.torque = arm.last.stiffness * s.deflection + arm.last.damping * s.rate +
               arm.last.motor_inertia * s.acceleration + noise(random);
    swing.push_back(s);
  }
  const auto spring = elastic::identify_spring(swing);
  std::printf("spring: %.3f +- %.3f N m/rad, drawn %.1f\n", spring.stiffness, spring.stiffness_sigma,
              drawn.last.stiffness);

  elastic::ClutchedArm found = drawn;  // to plan throws with
  found.chain = links.feasible;
  found.last.stiffness = spring.stiffness;
  elastic::validate(found);
  const double wrong = m * c / (arm.chain.joints[2].link.mass * arm.chain.joints[2].link.com.x()) - 1;
  return std::abs(wrong) < 0.02 && std::abs(spring.stiffness / arm.last.stiffness - 1) < 0.02 ? 0 : 1;
}
