// Learning to throw-flip: which command to try next.
//
// [LiuDaCostaBillard2025]; where the text leaves a choice, docs/throw-flip.md says which was taken.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "planners/flip/flip_throw.hpp"
#include "planners/flip/plant.hpp"

namespace unhand::planners::flip {

/// Where a bar is to land, and how exactly.
struct FlipTarget {
  FlipPose pose;                                ///< x* [m], θ* [rad]
  double tolerance_x{0.05};                     ///< ε_x [m], > 0
  double tolerance_angle{0.78539816339744831};  ///< ε_θ [rad], > 0
};
/// Throws std::invalid_argument, naming value and accepted range. Learners check their target.
void validate(const FlipTarget& target);

/// e = |((x − x*)/ε_x, (θ − θ*)/ε_θ)| [-]
double normalized_error(const FlipPose& landing, const FlipTarget& target);
/// Both within their tolerances.
bool hits(const FlipPose& landing, const FlipTarget& target);

/// What is kept of the throws of one command: means over those that landed.
struct FlipDatum {
  FlipCommand command;    ///< thrown
  DetachVector detach{};  ///< m, m, rad, m/s, m/s, rad/s
  FlipPose landing;       ///< m, rad
  int throws{};           ///< that landed
};
/// Empty where none landed.
std::optional<FlipDatum> mean_of(std::span<const FlipTrial> trials);

/// Something that says which command to try next.
class FlipLearner {
 public:
  virtual ~FlipLearner() = default;
  /// The command to execute next; empty where the learner has nothing to go by.
  virtual std::optional<FlipCommand> next() = 0;
  /// The throws of the command last asked for.
  virtual void observe(std::span<const FlipTrial> trials) = 0;
};

/// How landings of commands between known ones are predicted.
enum class ForwardModel {
  landing,  ///< model 1, Eq. 27: the landing pose is taken as locally linear in the command
  detach,   ///< model 2, Eq. 28: the detach state is, and flight follows
};

/// Models 1 and 2 with Algorithm 1: of the plane of commands u = u_1 + Σ α_i (u_{i+1} − u_1) through three
/// data, the one whose prediction is nearest to the target, on a mesh with |α_i| <= 2.5. The neighbours are
/// the best datum and two others, the nearest three first; re-selection takes the nearest three that have not
/// been searched yet, so it acts exactly when the last throws changed nothing about which those are.
class ConeLearner final : public FlipLearner {
 public:
  /// `support`: what is known before, at least three throws of different commands. `tried`: commands that
  /// were executed, landed or not, and are not to be given again; those of the support are among them anyway.
  /// Throws std::invalid_argument for a smaller support, one that is not finite, and as validate() does.
  ConeLearner(ForwardModel model, std::vector<FlipDatum> support, const FlipTarget& target,
              const CommandRange& range, std::vector<FlipCommand> tried = {});
  std::optional<FlipCommand> next() override;
  void observe(std::span<const FlipTrial> trials) override;

 private:
  ForwardModel model_;
  std::vector<FlipDatum> data_;  ///< in the order in which they came
  std::vector<FlipCommand> tried_;
  std::set<std::array<std::size_t, 3>> searched_;  ///< triples of data, the base first
  FlipTarget target_;
  CommandRange range_;
};

/// (q^o, v^o) of a bar whose centre of mass lies Δh [m] further from the pads, the twist of the bar
/// unchanged.
DetachVector shifted(const DetachVector& detach, double shift);
/// The data as they would be with the centre of mass shifted: landings are those of the flights from the
/// shifted detach states, and data that then never land are left out. Without a shift, they are as measured.
std::vector<FlipDatum> transferred(std::span<const FlipDatum> data, double shift);

/// Model 3: transfer under a shift of the centre of mass, three opening iterations, then model 2 on their
/// data. Where a step finds no command, as when the commands executed so far lie on a line, the nearest
/// command of the past that has not been executed is.
class TransferLearner final : public FlipLearner {
 public:
  /// `past` are throws of the old bar. Throws std::invalid_argument for fewer than four that can be
  /// transferred, and as validate() does.
  TransferLearner(std::span<const FlipDatum> past, double shift, const FlipTarget& target,
                  const CommandRange& range);
  std::optional<FlipCommand> next() override;
  void observe(std::span<const FlipTrial> trials) override;

 private:
  std::optional<FlipCommand> nearest_left();

  std::vector<FlipDatum> past_;  ///< transferred, nearest to the target first
  std::vector<FlipDatum> own_;
  std::vector<FlipCommand> tried_;
  FlipTarget target_;
  CommandRange range_;
  std::unique_ptr<ConeLearner> after_;
};

}  // namespace unhand::planners::flip
