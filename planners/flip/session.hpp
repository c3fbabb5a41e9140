// A learner at a robot: the learning path of [LiuDaCostaBillard2025] Fig. 20 and 21.
#pragma once

#include <functional>
#include <vector>

#include "planners/flip/learner.hpp"

namespace unhand::planners::flip {

/// Executes a command once. `stage` names the part of the work ("support", "past", "path"), `index` counts
/// throws within it: together with the robot's seed they determine the throw's luck, the same for every
/// learner.
struct TrialRequest {
  std::string stage;
  int index{};
  FlipCommand command;
  Bar bar;
};
using Thrower = std::function<FlipTrial(const TrialRequest&)>;
/// A thrower that asks the plant.
Thrower thrower_of(const FlipPlant& plant, std::uint64_t seed);

/// The grid of 3 x 3 x 3 commands: ends and middle of the range.
std::vector<FlipCommand> population_grid(const CommandRange& range);
/// Four commands that form a simplex: every other corner of the range, drawn in by `inset` of it.
std::vector<FlipCommand> support_simplex(const CommandRange& range, double inset = 0.25);

/// Throws each command `repeats` times and keeps means (of those commands that landed at all).
struct Gathered {
  std::vector<FlipDatum> data;
  std::vector<FlipTrial> trials;
};
Gathered gather(const Thrower& thrower, const std::string& stage, std::span<const FlipCommand> commands,
                int repeats, const Bar& bar);

struct PathOptions {
  int iterations{5};
  int throws{3};  ///< of each command
  bool stop_at_success{false};
};

struct PathIteration {
  FlipCommand command;
  std::vector<FlipTrial> trials;
  std::optional<FlipPose> mean;  ///< of the landings; empty where none landed
  double error{};                ///< normalised, of the mean; infinite where none landed
  int hits{};                    ///< throws within the tolerances
};

struct LearningPath {
  double initial{};  ///< lowest error of what was known before
  std::vector<PathIteration> iterations;
  bool gave_up{};  ///< the learner had no command left to try

  double first() const;    ///< error after the first iteration
  double minimum() const;  ///< lowest error, the initial one included
  /// The first iteration, counted from 1, in which at least `hits` throws hit; 0: none.
  int reached(int hits) const;
};

LearningPath learn(FlipLearner& learner, const FlipTarget& target, std::span<const FlipDatum> known,
                   const Bar& bar, const Thrower& thrower, const PathOptions& options = {});

}  // namespace unhand::planners::flip
