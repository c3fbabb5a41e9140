// Closing the loop: where a model's residual leaves the noise, which effect leaves such a footprint, and
// whether held-out throws agree.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fitting/fit.hpp"
#include "fitting/missing_force.hpp"
#include "fitting/residuals.hpp"

namespace unhand::fitting {

struct DiscoverOptions {
  CampaignOptions campaign;
  FitOptions fit;
  /// An effect matters if, on held-out throws, it takes at least this much off the χ² per sample of some
  /// channel of the motion in some phase (1 is the noise), and a tenth of the misfit there.
  double matters{0.5};
  /// The same for the wrench channels, whose misfit must also have been so many times the noise: near the end
  /// of a release a patch slips in parts, and no law of the catalogue follows its torque better.
  double wrench_matters{1}, wrench_misfit{3};
  double law_matters{0.005};          ///< another contact law: share of the held-out χ² as a whole
  double false_discovery_rate{0.02};  ///< shared among the effects that were tried
  double equivalent{0.98};            ///< footprints that correlate by this much are one answer
  int refits{4};                      ///< candidates that are fitted in full, in every step
  int most_effects{3};
  double unexplained{1.5};  ///< χ² per sample of a channel in a phase from which on something is missing
  std::vector<std::string> forget;  ///< effects that are not in the catalogue today
  std::vector<std::string> laws{"limit_surface", "limit_surface_disc", "limit_surface_quartic",
                                "sliding_pivot"};
};

enum class Verdict { effect_found, no_missing_effect, unexplained, not_answered };
const char* to_string(Verdict);

/// Errors of the outcome, predicted before the throw (own unknowns from the grasp alone) minus measured.
struct OutcomeErrors {
  int n{};
  double landing_x_mae{};      ///< [m]
  double landing_theta_mae{};  ///< [deg]
  double detach_vx_mae{};      ///< [m/s]
  double detach_omega_mae{};   ///< [deg/s]
  double trajectory_rms{};     ///< of the position in flight [m]
  double chi2_per_dof{};       ///< with the throws' own unknowns fitted
};

struct Parameter {
  std::string name, unit;
  double value{}, sigma{};
};

/// An experiment that would tell an accepted effect from another name of its footprint.
struct SeparatingExperiment {
  std::string from;  ///< the other name
  std::string what;  ///< to do, in words
  double before{},
      after{};  ///< correlation of the footprints: in this log, and with the experiment added to it
};

struct AcceptedEffect {
  std::string id;
  std::vector<std::pair<std::string, double>> equivalent;  ///< ids, with the correlation of the footprints
  std::vector<SeparatingExperiment> separating;            ///< the most telling first, for each other name
  std::vector<Parameter> parameters;
  double delta_bic{}, p_value{}, test_error_ratio{};
  std::string why;  ///< where the held-out misfit fell, in words
  Phase phase{};    ///< where it fell most
};

/// One candidate, as it was scored in the step in which it came nearest to being accepted.
struct Ranked {
  std::string id;
  double gain{};      ///< of χ², to first order
  double p_value{1};  ///< of the gain, in units of what is left unexplained
  double correlation_with_best{};
  bool visible{true};
  bool refitted{false};
  double delta_bic{};
  double held_out_gain{};  ///< largest fall of χ² per sample in a channel and phase
};

/// How a prediction may use what is estimated to be missing.
enum class Correction { withheld, curve, candidate };

/// What is missing, without a form assumed: an acceleration in flight over the time since the detach [m/s²,
/// m/s², rad/s²], or a pad's wrench in the hand's frame over the share of the opening that has passed [N, N,
/// N m].
struct MissingEstimate {
  Phase phase{};
  std::vector<std::pair<std::string, int>> groups;  ///< objects, and the group of their curve
  std::vector<MissingCurve> curves;
  MissingCandidate candidate;
  /// What lowers the held-out error, if anything: else it is withheld.
  Correction correction{};
  double error_before{}, error_after{};  ///< rms, of the flight where it was seen, else of the landing
  std::string error_unit;                ///< "m", or "sigma" of the landing
};

struct Unexplained {
  Phase phase{};
  experiment::Channel channel{};
  double chi2_per_dof{};
  std::string description;
  std::optional<MissingEstimate> missing;
};

/// Where the residual first leaves the noise.
struct FirstMisfit {
  bool any{false};
  Phase phase{};
  experiment::Channel channel{};
  double chi2_per_sample{};
};

struct Discovery {
  Verdict verdict{};
  std::string message;
  std::vector<AcceptedEffect> effects;
  std::vector<std::string> imitations;  ///< accepted at first, and withdrawn since too much was left
  std::vector<std::string> along;       ///< effects that are fitted along as nuisances, too small to matter
  std::optional<Unexplained> unexplained;
  FirstMisfit first;
  OutcomeErrors before_train, before_test, after_train, after_test;
  std::vector<Ranked> ranking;  ///< best first
  FitResult base, final;
  std::vector<ChannelMisfit> base_test, final_test;  ///< misfit on held-out throws
  std::string model;                                 ///< of the answer (contact.law changes it)
  std::vector<ResidualBin> residual_before, residual_after;
  std::vector<ChannelStructure> structure_before, structure_after;  ///< of the train throws
  std::shared_ptr<const CampaignProblem> problem;                   ///< of the answer
  double seconds{};
};

/// Runs the loop. A log without a test split is split by condition, every other one of an object held out.
/// Throws as CampaignProblem does.
Discovery discover(const datasets::ThrowLog& log, const std::string& file, const DiscoverOptions& options);

}  // namespace unhand::fitting
