// What the loop says of logs that are no throws from a hand: free flights, accelerometers in free fall,
// slips.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "datasets/slip_log.hpp"
#include "fitting/discovery/verdict.hpp"
#include "fitting/measured/effect_search.hpp"
#include "fitting/measured/missing_acceleration.hpp"
#include "fitting/measured/residual_tests.hpp"

namespace unhand::fitting {

/// An error of a model, with its unit in the name ("trajectory_rms_m"); NaN where it was not measured.
using NamedErrors = std::vector<std::pair<std::string, double>>;

class FlightProblem;
class FallProblem;
/// FlightErrors or FallErrors by name.
NamedErrors named_errors(const FlightProblem& problem, const GroupedFit& fit, int threads);
NamedErrors named_errors(const FallProblem& problem, const GroupedFit& fit);

/// Misfit of a channel before and after the accepted effects, on train and held-out groups: χ² per sample or,
/// of slips, the mean angle between predicted and measured directions [deg].
struct MeasuredMisfit {
  std::string channel;                                                ///< which
  int n{};                                                            ///< measurements
  double before_train{}, before_test{}, after_train{}, after_test{};  ///< see above
  int n_test{};                                                       ///< of n, held out
};

/// Something else that the log says about an answer.
struct Evidence {
  std::string about;  ///< an effect's id, or empty
  std::string text;   ///< in words
  bool against{};     ///< it speaks against the answer
};

/// Where structure remains that no effect accounts for.
struct MeasuredUnexplained {
  std::string phase, channel;  ///< where it is largest
  double chi2_per_dof{};       ///< on held-out groups; 1 is the noise; NaN of slips, which declare none
  std::string description;     ///< in words
  /// Of slips: what residual directions of neighbouring wrenches of different slips correlate by.
  std::optional<double> correlation{};
  /// Of flights and falls: the acceleration that is missing, as a function.
  std::optional<MissingAcceleration> missing{};
};

/// The answer of the loop on a log without a hand: what is missing, the errors before and after, and what is
/// left.
struct MeasuredDiscovery {
  std::string kind, model, phase;                  ///< "free flights", "projectile", "flight"
  Verdict verdict{};                               ///< found, nothing missing, unexplained, or no answer
  std::string message;                             ///< the answer in words
  std::vector<AcceptedEffect> effects;             ///< in order of acceptance
  std::vector<Ranked> ranking;                     ///< best first
  std::optional<MeasuredUnexplained> unexplained;  ///< what is left, if anything
  LeavesNoise first;                               ///< where the base model's residual first leaves the noise
  int train{}, test{};                             ///< groups
  std::vector<std::string> parameters;             ///< full names of the fitted ones
  std::vector<double> covariance;                  ///< row by row
  NamedErrors before_train, before_test, after_train, after_test;              ///< base model; the answer
  std::vector<MeasuredMisfit> misfit;                                          ///< by channel
  std::vector<Autocorrelation> autocorrelation_before, autocorrelation_after;  ///< held-out groups
  std::vector<ResidualProfile> profile_before, profile_after;                  ///< train groups
  std::vector<FootprintProfile> footprints;  ///< beside the base model: the answer's, and others that lead
  std::vector<Stability> stability;          ///< of the accepted parameters over halves of the groups
  std::vector<Evidence> evidence;            ///< what else speaks for or against
  std::vector<std::pair<std::string, std::string>>
      separating;  ///< effect, what would tell it from its equivalents
  std::vector<std::pair<std::string, std::string>> skipped;  ///< groups, with the reason
  double seconds{};                                          ///< of the whole loop
};

/// Options of the loop on logs without a hand.
struct MeasuredOptions {
  EffectSearchOptions search;  ///< what may be tried, and what convinces it
  double unexplained{
      1.5};         ///< χ² per sample of a channel on held-out groups from which on something is missing
  double floor{0};  ///< height of the floor that boxes come to rest on [m]
};

/// Free flights, in space or in a plane. Throws std::invalid_argument as FlightProblem does.
MeasuredDiscovery discover_flights(const datasets::ThrowLog& log, const MeasuredOptions& options);
/// Accelerometers in free fall. Throws std::invalid_argument as FallProblem does.
MeasuredDiscovery discover_falls(const datasets::ThrowLog& log, const MeasuredOptions& options);

/// The part that flights and falls share: the search, residual tests, the verdict. Groups that err as no
/// other does (wild_groups.hpp) are set aside of the problem, and named among the skipped.
EffectSearch run_search(GroupedProblem& problem, const MeasuredOptions& options, MeasuredDiscovery& out);
/// On what the sizes of the answer's effects hang (EffectSearch::conditions), as evidence.
void weigh_conditions(const EffectSearch& search, MeasuredDiscovery& out);
/// A parameter that the train groups ask for, to first order and with either sign.
struct AskedBeside {
  SharedParameter parameter;  ///< which
  double value{}, sigma{};    ///< from neutral, and 1 σ, in its unit
};
/// Those of an effect, beside a fit, that differ from neutral by the scatter between groups, at the level of
/// the search.
std::vector<AskedBeside> asked_beside(const GroupedProblem& problem, const GroupedFit& fit,
                                      const std::string& id, const MeasuredOptions& options);
/// Whether the form of a drag is the one that it is named by: evidence against a quadratic or a linear one
/// beside which the train groups want some of the other, by the scatter between groups, at the level of the
/// search. Some less than none of the linear one says that it grows faster than v².
void weigh_drag_form(const GroupedProblem& problem, const EffectSearch& search,
                     const MeasuredOptions& options, MeasuredDiscovery& out);
/// An answer that depends on where one looks is not the whole truth: evidence from out.stability.
void weigh_stability(MeasuredDiscovery& out);

}  // namespace unhand::fitting
