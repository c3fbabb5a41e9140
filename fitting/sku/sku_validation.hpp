// Can this object be thrown with this gripper, so that it lands as predicted?
#pragma once

#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"
#include "fitting/card.hpp"
#include "fitting/evaluate.hpp"
#include "fitting/sku/sku_inputs.hpp"

namespace unhand::fitting {

/// How far from its prediction a landing may be.
struct LandingTolerance {
  double x{0.05};                             ///< [m]
  double theta{45 * std::numbers::pi / 180};  ///< [rad]
};

/// What `unhand validate-sku` is asked.
struct SkuRequest {
  LandingTolerance tolerance;              ///< for the landing
  double confidence{0.95};                 ///< share of throws that must land within the tolerance
  int samples{2000};                       ///< of the Monte Carlo
  std::uint64_t seed{1};                   ///< of the Monte Carlo
  int threads{0};                          ///< 0: one per core; the answer does not depend on it
  AssumedTolerances assumed;               ///< where the SKU file gives none
  const datasets::ThrowLog* log{};         ///< throws whose hand and normal force are taken, if any
  std::string log_file;                    ///< its name in errors
  std::optional<std::string> condition{};  ///< of the log; otherwise the one with the least spread
};

/// Whether an object can be thrown.
enum class SkuVerdict {
  throwable,       ///< enough of the landings lie within the tolerance
  too_uncertain,   ///< it lands, but not surely enough
  cannot_be_held,  ///< the grip lets it slip before the gripper opens
  does_not_land,   ///< release or flight has no answer
  /// The card's model carries the object rigidly, and its centre of mass is a lever (kLeastLever) from pads
  /// in which it turns as they open; measured throws do not show otherwise.
  beyond_the_model,
  /// Measured throws are not where they are foretold: fewer within the tolerance than chance would have
  /// (kTooFewToBeChance) where enough were foretold, or errors beyond twice what was foretold.
  contradicted,
};
/// From which distance of the centre of mass from the pads on an object turns in them [m]: under gravity
/// alone it then lands some ten degrees off, after 70 ms of opening and half a second of flight.
inline constexpr double kLeastLever = 0.005;
/// The verdict's name, as it is written above.
const char* to_string(SkuVerdict);

/// Of landings about a nominal one: 1 σ and mean [m, rad].
struct LandingSpread {
  double x{}, theta{};            ///< 1 σ
  double bias_x{}, bias_theta{};  ///< mean minus nominal
};

/// One input's part in the spread. Shares are of the variance σ_x²/tol_x² + σ_θ²/tol_θ² (first order).
struct BudgetLine {
  UncertainInput input;  ///< whose part it is
  double x{}, theta{};   ///< |∂(landing)/∂(input)| σ [m, rad]
  double share{};        ///< all shares add to 1; correlated inputs may have a negative one
  double curvature{};    ///< second-order part at ±1.5 σ, in units of the whole σ; the larger of x and θ
};

/// What one measurement would take off the variance at most: what is left when its inputs are known.
struct MeasurementGain {
  std::string measurement;          ///< what to measure
  std::vector<std::string> inputs;  ///< that it would make known
  double share{};                   ///< of the variance
};

/// One motion with this object.
struct ThrowCandidate {
  std::string condition;  ///< of the log; or of the reference throw
  std::string repeats;    ///< the log's object and condition whose motion it is; empty without a log
  bool held{}, landed{};  ///< the grip holds it until the gripper opens; the throw lands
  double landing_x{}, landing_theta{};  ///< nominal [m, rad]
  LandingSpread linear;                 ///< spread to first order
};

/// A simulated landing against the nominal one.
struct LandingSample {
  double x{}, theta{};                ///< [m, rad]
  double linear_x{}, linear_theta{};  ///< what the derivatives say of the same draw
};

/// A measured throw of this object against its prediction from the SKU's data.
struct MeasuredLanding {
  std::string id, condition;        ///< of the throw
  double error_x{}, error_theta{};  ///< predicted − measured [m, rad]
  double sigma_x{}, sigma_theta{};  ///< of the error: card, throw, SKU and the landing's sensor
};

/// Errors in their own σ beyond which throws contradict what was foretold of them: twice is more than a tail.
inline constexpr double kMostSurprise = 2;

/// Below this probability of so few throws within the tolerance they contradict that enough land there.
inline constexpr double kTooFewToBeChance = 0.05;

/// Throws of this object, set against what the SKU and the card say of them.
struct MeasuredVerdict {
  std::vector<MeasuredLanding> throws;  ///< one per throw with a landing and a prediction of it
  int never_lands{};  ///< further ones of which the card says that they never land: not within
  /// Both together.
  int count() const { return static_cast<int>(throws.size()) + never_lands; }
  /// The log is the card's own: the throws are those that it was not fitted to.
  bool held_out{};
  double within{};   ///< share that lands within the tolerance of its prediction
  double p_value{};  ///< of so few or fewer within it if a share `confidence` of all throws is (binomial)
  double mae_x{}, mae_theta{};    ///< [m, rad]
  double bias_x{}, bias_theta{};  ///< mean of predicted − measured [m, rad]
  double rms_z{};                 ///< errors in their own σ; 1 where the prediction knows how sure it is
  bool confirmed{};               ///< within >= confidence, and rms_z <= kMostSurprise
};

/// How far apart the same motion, repeated, brings this object down: predicted landings of the log's
/// repetitions, each with its own hand and force, about the mean of their condition. Of the answer's own
/// condition where that is repeated four times, as some motions repeat better than others; else pooled over
/// all that are repeated.
struct MotionRepeats {
  int motions{}, conditions{};        ///< that bring it to a landing; those with two or more of them
  double x{}, theta{};                ///< 1 σ [m, rad]
  double offset_x{}, offset_theta{};  ///< from the nominal landing to their mean [m, rad]
  /// Share of the Monte Carlo's draws within the tolerance of the nominal landing, with scatter and offset.
  double within{};
};

/// Whether an object can be thrown, how surely, and why.
struct SkuValidation {
  SkuVerdict verdict{};  ///< the answer
  std::string message;   ///< the verdict in words
  /// Where the object or the motion is outside of what the card has been tried on; the verdict holds only as
  /// far as the card holds there. Empty: inside.
  std::vector<UntriedCondition> untried;
  std::vector<std::string> notes;           ///< what was left out or assumed
  std::vector<ThrowCandidate> candidates;   ///< one per condition of the log, or the reference throw
  std::size_t chosen{};                     ///< among the candidates
  std::optional<double> needed_grip_force;  ///< where the grip of a profile slips: the least that holds [N]

  LandingSpread linear, monte_carlo;  ///< of the landing, by derivatives and by simulation
  double within_linear{}, within{};   ///< shares within the tolerance of the nominal landing
  double within_sigma{};              ///< 1 σ of a Monte Carlo share that is the one asked for
  double lost{};                      ///< share of draws that the grip does not hold or that never land
  bool agree{};                       ///< Monte Carlo and the derivatives, to a tenth of σ
  /// Which input bends the answer, or that it is draws that are lost; empty: they agree.
  std::string disagreement;
  std::vector<BudgetLine> budget;           ///< the largest share first
  std::vector<MeasurementGain> gains;       ///< the largest first
  std::vector<LandingSample> samples;       ///< of the draws that land
  std::optional<MotionRepeats> repeats;     ///< of the log's motions, where they are repeated
  std::optional<MeasuredVerdict> measured;  ///< against the log's throws of this object, if there are any

  /// Share within the tolerance that the verdict goes by: with what repetitions differ, where a log has some.
  double share() const { return repeats ? repeats->within : within; }
  /// The motion that the answer is about.
  const ThrowCandidate& reference() const { return candidates[chosen]; }
};

/// The landing of the nominal throw and how it scatters, to first order by exact derivatives,
///   Σ_y = J A Σ_p Aᵀ Jᵀ,  J = ∂(landing)/∂(values), A = ∂(values)/∂(inputs),
/// and by Monte Carlo of normal inputs p (log-normal ones where UncertainInput says so); the same draws go
/// through both. Draws at which a value leaves its range are drawn again.
///
/// The motion is a logged one with this object in the hand or, without a log, experiment::reference_throw.
/// How well the robot repeats its motion is known of a log that repeats some (MotionRepeats), and the verdict
/// counts it then; else it does not. What the model lacks is in neither: the card's errors on held-out throws
/// tell that.
///
/// Throws datasets::CardError as options_of does, std::invalid_argument for an SKU without inertia, a request
/// out of range or a condition that the log does not have, datasets::LogError as prepare() does.
SkuValidation validate_sku(const datasets::Sku& sku, const datasets::ModelCard& card,
                           const std::string& card_file, const SkuRequest& request = {});

}  // namespace unhand::fitting
