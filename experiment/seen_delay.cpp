#include "experiment/seen_delay.hpp"

#include <vector>

#include "contact/contact_model.hpp"
#include "flight/fly.hpp"

namespace unhand::experiment {
namespace {

struct Sample {
  double time, x, z;
};

/// The CoM's pose and twist while the hand carries it.
struct Carried {
  dynamics::Pose<double> pose;
  dynamics::Twist<double> twist;
};

Carried carried_at(const PreparedThrow& prepared, double t) {
  const auto hand = prepared.hand.at({prepared.hand.begin(), prepared.hand.end()}, t);
  contact::Scene<double> scene;
  scene.hand = hand.pose;
  scene.hand_twist = hand.twist;
  const contact::Relative<double> held{{prepared.grasp.com_offset, 0}, prepared.grasp.angle, {}, 0};
  return {object_pose(scene, held), object_twist(scene, held)};
}

/// Sum of the squared distances between the samples and a path that is carried until `release` [m²].
double misfit(const PreparedThrow& prepared, const std::vector<Sample>& samples, double release) {
  std::vector<double> since;
  double sum = 0;
  const auto add = [&](const Sample& seen, const dynamics::Pose<double>& pose) {
    sum += (seen.x - pose.x) * (seen.x - pose.x) + (seen.z - pose.z) * (seen.z - pose.z);
  };
  for (const Sample& s : samples)
    if (s.time > release)
      since.push_back(s.time - release);
    else
      add(s, carried_at(prepared, s.time).pose);
  const Carried from = carried_at(prepared, release);
  const flight::FlightProblem<double> flight{from.pose, from.twist, prepared.gravity, prepared.drag_k,
                                             prepared.landing_height};
  const auto poses = flight::fly_through(flight, since);
  const std::size_t before = samples.size() - since.size();
  for (std::size_t i = 0; i < poses.size(); ++i) add(samples[before + i], poses[i]);
  return sum;
}

}  // namespace

std::optional<double> seen_delay(const datasets::ThrowLog& log, const datasets::Throw& logged,
                                 const PreparedThrow& prepared) {
  constexpr std::size_t kEnough = 8;
  constexpr int kSteps = 50, kHalvings = 24;
  const double open = prepared.open_command, longest = prepared.hand.end() - open;
  if (!logged.mocap || open < prepared.hand.begin() || !(longest > 0)) return {};
  const auto& mocap = *logged.mocap;
  const double until = flight_end(log, logged, open);
  std::vector<Sample> samples;
  for (std::size_t i = 0; i < mocap.time.rows; ++i)
    if (mocap.is_valid(i) && mocap.time(i) > open && mocap.time(i) < until)
      samples.push_back({mocap.time(i), mocap.pose(i, 0), mocap.pose(i, 1)});
  if (samples.size() < kEnough) return {};
  const auto at = [&](double delay) { return misfit(prepared, samples, open + delay); };
  int best = 0;
  double least = HUGE_VAL;
  for (int k = 0; k <= kSteps; ++k)
    if (const double value = at(longest * k / kSteps); value < least) least = value, best = k;
  if (best == kSteps) return {};
  double delay = longest * best / kSteps;
  double step = longest / kSteps;
  for (int k = 0; k < kHalvings; ++k) {
    step /= 2;
    for (const double other : {delay - step, delay + step})
      if (const double value = other >= 0 ? at(other) : HUGE_VAL; value < least) {
        least = value, delay = other;
        break;
      }
  }
  return delay;
}

}  // namespace unhand::experiment
