// Model 4: the release's physics predicts, what is left over is learned with its uncertainty, and the next
// command is the one that most probably lands within the tolerances.
#pragma once

#include <Eigen/Core>

#include "planners/flip/forecast.hpp"

namespace unhand::planners::flip {

/// Observed minus predicted, of the state at detach carried back to the bar's point between the pads
/// (`shifted` by −com_offset): there it does not depend on where the bar's centre of mass lies, as far as
/// the wrench does not. Units as DetachVector.
struct LeftOver {
  std::array<double, 3> at{};  ///< the command, as fractions of the range
  Bar bar;                     ///< that was thrown
  DetachVector value{};        ///< observed minus predicted
  int throws{1};               ///< that it is the mean of
};
/// Of data with a predicted release.
std::vector<LeftOver> left_over(const HandLibrary& library, const ReleaseCard& card,
                                std::span<const FlipDatum> data);

/// Pooled variances of throws of one command about their mean, and how many degrees of freedom they have.
/// A prior counts for four.
struct ThrowScatter {
  double x{}, angle{};    ///< of the landing [m², rad²]
  DetachVector detach{};  ///< of the bar's point between the pads
  int freedom{};          ///< degrees of freedom
};
/// Of throws of any commands, `com_offset` [m] that of their bar.
ThrowScatter scatter_of(std::span<const FlipTrial> trials, double com_offset);

/// A Gaussian process for each component of what is left over:
///   cov = σ_j² likeness(u, u') ρ^[other bar]
/// u in fractions of the range, ρ = 0.8; σ_j is the multiple of kDiscrepancy, from 1/8 to 4 by
/// factors of two, with the largest evidence.
class LeftOverField {
 public:
  /// Takes new samples, `throw_variance` that of one throw, and chooses σ_j again.
  void set(std::vector<LeftOver> samples, const DetachVector& throw_variance);
  /// What is expected to be left over, and its variance.
  struct At {
    DetachVector mean{}, variance{};  ///< in DetachVector's units, and squared
  };
  /// At a command, in fractions of the range, for a bar.
  At at(const std::array<double, 3>& fractions, const Bar& bar) const;

 private:
  std::vector<LeftOver> samples_;
  DetachVector sigma_ = kDiscrepancy;
  std::array<Eigen::MatrixXd, 6> inverse_;  ///< of the covariance of the samples
  std::array<Eigen::VectorXd, 6> weights_;
};

/// What model 4 says of a command.
struct FlipForecast {
  FlipPose mean;                                   ///< of the landings
  double sigma_x{}, sigma_angle{}, correlation{};  ///< of what is not known of the command's mean landing
  double scatter_x{}, scatter_angle{};             ///< 1 σ of a throw about it [m, rad]
  double probability{};                            ///< that all throws of it land within the tolerances
};

/// The probability that `throws` of a command all land within the target's tolerances: they share the
/// command's mean landing, of which the forecast tells, and each scatters about it. To 1e-4, by the
/// trapezoidal rule over what is not known of the mean (scatter > 0); less exact where that is more than
/// forty times the scatter.
double probability_of_hits(const FlipForecast& forecast, const FlipTarget& target, int throws);

/// The state at detach that a card predicts, and how it changes by one σ of what is not known: of the card,
/// in four directions that do not correlate, and between throws as the robot declares it: friction with grip
/// force, dead time, opening time, the held point along the bar, the bar's angle in the hand.
struct PredictedDetach {
  static constexpr std::size_t kOfCard = 4, kAll = 9;  ///< directions
  DetachVector detach{};                               ///< m, m, rad, m/s, m/s, rad/s
  std::array<DetachVector, kAll> by{};                 ///< half the change from −σ to +σ
};
/// Empty where the bar is not let go in time.
std::optional<PredictedDetach> predicted_detach(const release::HandMotion& hand, const ReleaseFit& fit,
                                                const Bar& bar, const ThrowSpread& throws);

/// Model 4: tries the command that most probably lands within the tolerances.
class ReleaseLearner final : public FlipLearner {
 public:
  /// `known`: what was left over of earlier throws, of this bar or another one. `scatter`: of their landings;
  /// how it differs between commands is as the robot declares its throws. `throws`: of each command. Keeps a
  /// reference to `library`. Throws std::invalid_argument as validate(target) does, and for fewer than one
  /// throw.
  ReleaseLearner(const HandLibrary& library, const ReleaseFit& fit, std::vector<LeftOver> known,
                 const ThrowScatter& scatter, const FlipTarget& target, int throws);
  /// With the same knowledge at another target.
  ReleaseLearner aimed_at(const FlipTarget& target) const;
  /// Searched on the library's mesh, and from its best points on between mesh points.
  std::optional<FlipCommand> next() override;
  void observe(std::span<const FlipTrial> trials) override;
  /// Empty where the physics predicts no landing.
  std::optional<FlipForecast> forecast(const FlipCommand& u) const;

 private:
  using Fractions = std::array<double, 3>;
  std::optional<PredictedDetach> between(const Fractions& fractions) const;
  std::optional<FlipForecast> forecast(const Fractions& fractions, const PredictedDetach& predicted) const;
  double worth(const std::optional<FlipForecast>& forecast) const;

  const HandLibrary& library_;
  ReleaseFit fit_;
  std::vector<LeftOver> samples_;
  ThrowScatter scatter_;
  /// Seen variances of landings over those that are declared for the same commands, x and angle; none where
  /// nothing was thrown.
  std::optional<std::array<double, 2>> of_declared_;
  FlipTarget target_;
  int throws_;
  LeftOverField field_;
  /// Of the library's commands: the state at detach, and its changes.
  std::array<std::vector<std::optional<DetachVector>>, 1 + PredictedDetach::kAll> mesh_;
};

}  // namespace unhand::planners::flip
