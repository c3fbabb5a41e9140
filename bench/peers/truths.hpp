// Motions with a closed form that every engine can express, for work-precision comparisons.
//
// A body of 0.5 kg on one contact of f_max = 4 N and τ_max = L f_max, L = 2 cm, I = m L²; no lever. Answers
// are a position and an angle times L [m].
#pragma once

#include <algorithm>
#include <cmath>
#include <ctime>
#include <string>
#include <vector>

namespace unhand::bench {

constexpr double kMass = 0.5, kLength = 0.02, kInertia = kMass * kLength * kLength, kMu = 0.5;
constexpr double kNormal = 8;                        ///< of both pads together [N]
constexpr double kFriction = kMu * kNormal / kMass;  ///< 8 m/s²: L times the angular one is the same

/// Gravity along the contact plane from a time on: an incline, or a plate that accelerates the other way.
struct Push {
  double until{}, along{};  ///< s, m/s²
};

struct Truth {
  std::string name, words;
  double end{};            ///< s
  double slide{}, spin{};  ///< at first [m/s], [rad/s]
  std::vector<Push> pushes;
  bool releases{};             ///< the normal force falls linearly to zero at the end
  double position{}, angle{};  ///< closed form at the end [m], [rad]
};

inline std::vector<Truth> truths() {
  std::vector<Truth> out;
  out.push_back({"slide", "slides to rest from 1 m/s", 0.2, 1, 0, {{0.2, 0}}, false, 1 / (2 * kFriction), 0});
  out.push_back({"spin",
                 "spins to rest from 40 rad/s",
                 0.2,
                 0,
                 40,
                 {{0.2, 0}},
                 false,
                 0,
                 40 * 40 * kLength / (2 * kFriction)});
  out.push_back({"stick",
                 "held on an incline of 0.8 times the limit for 1 s",
                 1,
                 0,
                 0,
                 {{1, 0.8 * kFriction}},
                 false,
                 0,
                 0});
  // 2.5 times the limit, nothing, 0.9 times the limit: slips at 12 m/s², slows down by 8 m/s², stands
  const double fast = (2.5 - 1) * kFriction * 0.05;
  out.push_back({"stick-slip",
                 "a plate that jerks, coasts and pulls",
                 0.4,
                 0,
                 0,
                 {{0.05, 2.5 * kFriction}, {0.25, 0}, {0.4, 0.9 * kFriction}},
                 false,
                 0.5 * fast * 0.05 + fast * fast / (2 * kFriction),
                 0});
  // ω = ω₀ − α₀ (t − t²/(2T)),  θ = ω₀ T − α₀ T²/3 at T
  const double alpha = kFriction / kLength, T = 0.1;
  out.push_back({"release",
                 "pivots at 40 rad/s while the force is let go",
                 T,
                 0,
                 40,
                 {{T, 0}},
                 true,
                 0,
                 40 * T - alpha * T * T / 3});
  return out;
}

/// A ball dropped from 1 m that keeps half its speed at each bounce: height after 1.2 s, five bounces, 0.15 s
/// before it rests.
constexpr double kBallTime = 1.2, kRestitution = 0.5, kBallGravity = 9.81;
inline double ball_height() {
  double t = std::sqrt(2 / kBallGravity), v = kBallGravity * t * kRestitution;
  while (t + 2 * v / kBallGravity < kBallTime) t += 2 * v / kBallGravity, v *= kRestitution;
  const double s = kBallTime - t;
  return v * s - 0.5 * kBallGravity * s * s;
}

/// One run of an engine: error [m] against time per simulated second.
struct Work {
  std::string engine, setting, truth;
  double error{}, seconds{};  ///< m; s of one core's time per simulated second
};

/// One core's time of the calling thread [s], whatever else the machine does.
inline double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The fastest of as many runs as fit into 20 ms; one that takes longer runs once.
template <class Run>
double fastest(Run&& run) {
  double best = 1e300, total = 0;
  for (int k = 0; total < 0.02 && k < 10000; ++k) {
    const double begin = thread_seconds();
    run();
    const double took = thread_seconds() - begin;
    best = std::min(best, took);
    total += took;
  }
  return best;
}

inline double error_of(const Truth& truth, double position, double angle) {
  return std::max(std::abs(position - truth.position), kLength * std::abs(angle - truth.angle));
}

std::vector<Work> run_unhand();
// Each empty where the engine is not installed.
std::vector<Work> run_bullet();
std::vector<Work> run_mujoco();
std::vector<Work> run_siconos();

}  // namespace unhand::bench
