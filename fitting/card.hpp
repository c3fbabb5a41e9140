// Between fits and model cards.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "datasets/model_card.hpp"
#include "fitting/evaluate.hpp"

namespace unhand::fitting {

/// A condition of a throw that a card's valid range speaks of.
struct Condition {
  std::string name, unit;  ///< as in the card's valid range
  double value{};          ///< in `unit`
};

/// As far as they are known of a throw:
///   mass [kg], com_offset [m]     the object and the lever from the pads to its CoM
///   release_speed [m/s], release_omega [rad/s]   of the hand when the gripper is told to open
///   grip_force [N], opening_time [s]             of the measured normal force: before it falls, and its fall
///   shape [-], dead_time [s]      exponent of that fall, and from the command to its begin
///   detach_speed [m/s], detach_omega [rad/s]     of the object, measured in flight
std::vector<Condition> conditions_of(const experiment::PreparedThrow& prepared);

/// Smallest and largest condition of the train throws among `throws`.
std::map<std::string, datasets::CardRange> valid_range_of(
    const std::vector<experiment::PreparedThrow>& throws);
/// The same of the problem's throws of a share.
std::map<std::string, datasets::CardRange> valid_range_of(const CampaignProblem& problem, Share share);

/// By this share of its ends a throw may lie beyond a valid range: sensors are no better, and a model that
/// holds inside does not end there. It may also do so by three sigma of what the card's own throws scattered
/// by unseen (grip_force: mu_deviation, as its share; com_offset: grasp_offset; opening_time and dead_time:
/// dead_time_deviation), and by what no robot repeats: com_offset 1 mm, dead_time 1 ms, shape 0.1, speeds
/// 0.02 m/s, rates 0.05 rad/s. So a range without width is no equality.
inline constexpr double kRangeMargin = 0.01;
/// A condition in which a card has not been tried.
struct UntriedCondition {
  std::string condition;  ///< "mass"
  std::string reason;     ///< "mass 0.5 kg is outside [0.24, 0.26]"
};

/// Where a throw lies outside a card's valid range; empty: inside. Conditions that the throw does not tell
/// are passed over.
std::vector<UntriedCondition> outside_range(const datasets::ModelCard& card,
                                            const experiment::PreparedThrow& prepared);

/// The same of conditions at hand, as of a throw that is planned.
std::vector<UntriedCondition> outside_range(const datasets::ModelCard& card,
                                            const std::vector<Condition>& conditions);

/// Whether pads on this surface are what the card's friction was estimated on: nothing if its log names the
/// surface, or if the model has no friction.
std::optional<UntriedCondition> untried_surface(const datasets::ModelCard& card, const std::string& surface);

/// The reasons alone.
std::vector<std::string> reasons_of(const std::vector<UntriedCondition>& untried);

/// "fnv1a64:" and 16 hexadecimal digits: the 64-bit FNV-1a hash of the file's bytes (offset basis
/// cbf29ce484222325, prime 100000001b3). It tells logs apart and is no protection. Nothing if the file cannot
/// be read.
std::optional<std::string> checksum_of(const std::filesystem::path& file);

/// What a model that follows the pads takes from the card where a throw has no normal force: how they open.
inline constexpr std::array kOpeningParameters = {"grip_force", "dead_time", "opening_time", "shape"};

/// Errors by quantity, of the throws of one split; quantities that were not measured are left out.
std::map<std::string, datasets::CardStatistics> errors_of(const experiment::ModelComparison& model,
                                                          datasets::Split split);

/// The card of a fit. Beside the unknowns it holds what the model takes from the campaign: `pads`, and
/// `reference_force`, f₀ of contact::FrictionVariation. Errors and log are the caller's to add, the log's
/// file at least. Throws std::invalid_argument as require_fit_of does.
datasets::ModelCard card_of(const CampaignProblem& problem, const FitResult& fit);

/// Whether the card comes from a fit (it holds effects, spreads or a covariance), rather than from a plain
/// estimate.
bool is_fitted(const datasets::ModelCard& card);

/// Throws datasets::CardError, naming `file`, for a parameter of a card in another unit or out of range.
void require_parameter(const std::string& file, const std::string& name,
                       const datasets::CardParameter& parameter, const std::string& unit, double low,
                       double high);

/// The problem's options that a fitted card asks for, to predict with it. Throws datasets::CardError, naming
/// `file`, for a model, an effect or a parameter that this library lacks, a wrong unit or a value out of
/// range.
CampaignOptions options_of(const datasets::ModelCard& card, const std::string& file);

/// The fit that a card holds, as predict_throws takes it, for a problem made with options_of. Throws
/// datasets::CardError if an unknown of the problem (of an object that the card has not seen, say) is not on
/// the card.
FitResult fit_of(const datasets::ModelCard& card, const CampaignProblem& problem, const std::string& file);

}  // namespace unhand::fitting
