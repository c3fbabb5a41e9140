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
  std::string stage;    ///< part of the work
  int index{};          ///< of the throw within the stage, from 0
  FlipCommand command;  ///< to execute
  Bar bar;              ///< in the hand
};
/// Executes a request and says what was seen.
using Thrower = std::function<FlipTrial(const TrialRequest&)>;
/// A thrower that asks the plant.
Thrower thrower_of(const FlipPlant& plant, std::uint64_t seed);

/// The grid of 3 x 3 x 3 commands: ends and middle of the range.
std::vector<FlipCommand> population_grid(const CommandRange& range);
/// Four commands that form a simplex: every other corner of the range, drawn in by `inset` of it.
std::vector<FlipCommand> support_simplex(const CommandRange& range, double inset = 0.25);

/// Throws each command `repeats` times and keeps means (of those commands that landed at all).
struct Gathered {
  std::vector<FlipDatum> data;    ///< one per command that landed
  std::vector<FlipTrial> trials;  ///< all of them
};
/// See Gathered.
Gathered gather(const Thrower& thrower, const std::string& stage, std::span<const FlipCommand> commands,
                int repeats, const Bar& bar);

/// How long a session lasts.
struct PathOptions {
  int iterations{5};  ///< commands tried
  int throws{3};      ///< of each command
  /// What is known are landings that a transfer from another bar predicts; nobody has seen them.
  bool transferred{false};
};

/// One iteration of a learner.
struct PathIteration {
  FlipCommand command;            ///< tried
  std::vector<FlipTrial> trials;  ///< its throws
  std::optional<FlipPose> mean;   ///< of the landings; empty where none landed
  double error{};                 ///< normalised, of the mean; infinite where none landed
  int hits{};                     ///< throws within the tolerances
};

/// What a learner reached, iteration by iteration.
struct LearningPath {
  double initial{};                       ///< lowest error of what was known before
  bool initial_is_seen{true};             ///< not only predicted
  std::vector<PathIteration> iterations;  ///< in order
  bool gave_up{};                         ///< the learner had no command left to try

  double first() const;  ///< error after the first iteration
  /// Lowest error that was seen until the end of that many iterations, the initial one included where it was
  /// seen.
  double lowest(std::size_t iterations) const;
  double minimum() const { return lowest(iterations.size()); }  ///< of all iterations
  /// The first iteration, counted from 1, in which at least `hits` throws hit; 0: none.
  int reached(int hits) const;
};

/// Lets a learner try commands one after the other; `known` is what its target's error is counted against.
LearningPath learn(FlipLearner& learner, const FlipTarget& target, std::span<const FlipDatum> known,
                   const Bar& bar, const Thrower& thrower, const PathOptions& options = {});

}  // namespace unhand::planners::flip
