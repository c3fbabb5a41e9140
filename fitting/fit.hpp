// The fit of a model to a campaign, and what it is worth.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "experiment/observations.hpp"
#include "fitting/campaign_problem.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

/// The part of a throw that an observation belongs to.
enum class Phase {
  grasped,  ///< until the gripper opens
  release,  ///< from then until detach
  flight,   ///< from detach on
  landing,  ///< channels of the landing
};
/// How many phases there are.
inline constexpr int kPhaseCount = 4;
/// The phase's name, as it is written above.
std::string_view to_string(Phase);
/// By the channel, and by the time between the opening and the detach.
Phase phase_of(const experiment::Observation& observation, double opening, double release);

/// Which throws take part.
enum class Share {
  train,  ///< those of the train split
  test,   ///< those of the test split
  all,    ///< both
};
/// Whether the throws of a split do.
inline bool takes(Share share, datasets::Split split) {
  return share == Share::all || (share == Share::train) == (split == datasets::Split::train);
}

/// What a channel that the model cannot follow counts for.
enum class Weigh {
  /// As many witnesses as its errors are independent: an error that stays for a stretch is one, and so is a
  /// condition, whose repetitions share what the law gets wrong about it. For parameters and predictions of a
  /// law that is not quite right.
  witnesses,
  /// 1/(the variance that it shows) in each phase: as the likelihood has it by which models are compared
  /// (Stage::bic), but for samples and throws that stray, which the fit lets count less and that likelihood
  /// does
  /// not.
  variances
};

/// How a fit runs.
struct FitOptions {
  Share share{Share::train};  ///< of the log that is fitted to
  int iterations{25};         ///< of the solver, in every round
  /// Rounds in which the spread of the throws' own unknowns is learned, and the weight of every channel in
  /// every phase (and quarter of the release): where the model cannot follow, it counts for what it knows.
  int rounds{4};
  Weigh weigh{Weigh::witnesses};  ///< of channels that the model cannot follow
  double sample_limit{5};         ///< residuals beyond this many σ count linearly [-]
  double throw_limit{3};          ///< a throw whose χ² exceeds this many medians counts less [-]
  double accuracy{1e-6};          ///< relative change of the cost at which a round ends
  int threads{0};                 ///< 0: one per core; the answer does not depend on it
  std::vector<double> start;      ///< of the campaign's unknowns, within their ranges; empty: the problem's
  /// Campaign unknowns that keep their start, by name; `all_fixed` for every one.
  std::vector<std::string> fixed;
  /// Nothing of the campaign is fitted, only the throws' own unknowns; what the log says of it is not asked.
  bool all_fixed{false};
  std::vector<double> own_spread;  ///< 1 σ of the throws' own unknowns, if it is known; empty: learned
  /// Per throw of the log, whether it takes part. Empty: all of the share that can be simulated at the start.
  /// Else exactly these of the share, so that fits can be compared: without one of them there is no answer.
  std::vector<bool> throws;
  /// Whether unknowns whose cost may not be a parabola are given the interval of their profile.
  bool profile{false};
};

/// How a fit ended.
enum class FitOutcome {
  converged,         ///< within `accuracy`
  iterations_spent,  ///< an answer, but short of `accuracy`
  no_start,          ///< no throw can be simulated at the start, or one that must be cannot
  not_solved,        ///< the solver failed
};
/// The outcome's name, as it is written above.
const char* to_string(FitOutcome);

/// An unknown's value and how sure it is.
struct FittedUnknown {
  Unknown unknown;  ///< name, unit, range
  double value{};   ///< in the unknown's unit
  /// 1 σ, from the scatter between clusters (see covariance); infinite without an answer, 0 of what was
  /// fixed.
  double sigma{};
  double data_sigma{};  ///< 1 σ without the prior; infinite where the log does not determine it, or was
                        ///< not asked, since the unknown was fixed
  bool at_bound{};      ///< the value is at an end of its range: sigma says little
  double degrees_of_freedom{};  ///< of sigma: it comes from the scatter between clusters
  /// The 95 % interval of the profile, where it departs from value ± t sigma: there, with everything else
  /// fitted again, the cost has risen by as much as it would at ± t sigma if it were a parabola. An end
  /// beyond the accepted range is infinite.
  std::optional<std::array<double, 2>> profile{};
  bool allows_for_few{};  ///< ±1.96 sigma is the 95 % interval: wider by Student's t, or of declared noise
  /// The 95 % interval: the profile's, or value ± t sigma, Student's t (1.96 where sigma allows for few).
  std::array<double, 2> interval95() const {
    return profile ? *profile : student_interval(value, sigma, interval_freedom());
  }
  /// Degrees of freedom of that t.
  double interval_freedom() const { return allows_for_few ? kCertain : degrees_of_freedom; }
};

/// A direction in the space of the campaign's unknowns that the log leaves open.
struct OpenDirection {
  std::vector<double> direction;  ///< per campaign unknown, in units of its scale, of unit length
  double sigma{};                 ///< along it, from the data alone, in scales; infinite: nothing
  std::string meaning;            ///< in words
  /// Whether unknown k takes part: its component is a fifth at least, or moves it by kOpen at sigma.
  bool moves(std::size_t k) const;
};

/// A direction is open where the log knows it to no better than so many changes that matter (scales) [-].
inline constexpr double kOpen = 3;

/// χ² of one channel in one phase.
struct ChannelMisfit {
  experiment::Channel channel{};  ///< of which sensor
  Phase phase{};                  ///< of the throw
  int n{};                        ///< samples
  double chi2{};                  ///< of the residuals, not weighted
  double weight{1};  ///< factor on its residuals in the fit (of the release's quarters, the root mean square)
  int worst_n{};     ///< samples of the throw that errs most
  double worst_chi2{};  ///< its χ²
  /// 1 where the model explains the channel to its noise.
  double chi2_per_sample() const { return n > 0 ? chi2 / n : 0; }
  /// The same of all throws but the one that errs most; of a single throw itself.
  ChannelMisfit without_worst() const {
    return n > worst_n ? ChannelMisfit{channel, phase, n - worst_n, chi2 - worst_chi2, weight} : *this;
  }
};

/// One throw's part in a fit.
struct ThrowFit {
  std::string id;           ///< as in the log
  bool used{};              ///< of the share that is fitted to, with observations, and simulated
  std::string why_not;      ///< of the share with observations, but not simulated at the start: why, in words
  double weight{1};         ///< below 1: an outlier that counts less
  double chi2{};            ///< of its observations, weighted by group and robust (Huber)
  std::vector<double> own;  ///< its own unknowns
  std::vector<int> modes;   ///< the modes entered, in order
  double detach{};          ///< as the fit predicts it [s]
};

/// A fit: values, covariance, what is open, misfit by channel. Without an answer the values are the start's,
/// the sigmas infinite, and `covariance`, `own_spread`, `open`, `misfit` and `group_weight` empty.
struct FitResult {
  /// Only `converged` and `iterations_spent` are answers, and a fit that was never made is none.
  FitOutcome outcome{FitOutcome::not_solved};
  std::string message;                  ///< in words
  Share share{Share::train};            ///< of the log that was fitted to
  std::vector<FittedUnknown> campaign;  ///< in the problem's order
  /// Covariance of the campaign's unknowns, row by row. H⁻¹ G H⁻¹ with H the Gauss-Newton matrix after the
  /// throws' own unknowns are eliminated and G the scatter of the gradients of clusters, each enlarged by
  /// what the fit has taken out of it [BellMcCaffrey2002]: it holds when the noise within a cluster is
  /// correlated, or the law is wrong by something that differs from cluster to cluster. These are conditions
  /// if there are four and Weigh::witnesses is asked for, else throws. To clusters that agree too well, one
  /// that scatters as its noise is added.
  std::vector<double> covariance;
  bool by_conditions{};                  ///< the clusters are conditions, not throws
  int clusters{};                        ///< how many
  std::vector<double> own_spread;        ///< learned 1 σ of the throws' own unknowns
  std::vector<OpenDirection> open;       ///< directions without an answer
  std::vector<ThrowFit> throws;          ///< in the order of the log
  int not_simulated{};                   ///< throws of the share that took no part: their `why_not` says why
  std::vector<ChannelMisfit> misfit;     ///< of the throws used
  std::vector<double> group_weight;      ///< factor on the residuals of every group_of(part, channel)
  double chi2{};                         ///< of the throws used, not weighted
  long samples{}, degrees_of_freedom{};  ///< observations used; those minus unknowns
  int iterations{};                      ///< of the solver, over all rounds
  int mode_changes{};  ///< throws whose modes differ between the start and the end of the last round
  double seconds{}, jacobian_seconds{};  ///< the second summed over threads
  /// 1 where the model explains everything to its noise; none where there are no more observations than
  /// unknowns.
  std::optional<double> chi2_per_dof() const {
    if (degrees_of_freedom <= 0) return std::nullopt;
    return chi2 / static_cast<double>(degrees_of_freedom);
  }
  /// Whether the values mean anything: converged, or short of it by the iterations allowed.
  bool is_answer() const;
  /// Of the throws that took no part: the most frequent reason, and of how many; empty without one.
  std::string why_not() const;
  /// −2 log of the likelihood in which every channel of every phase has the variance that it shows, at least
  /// the declared one.
  double deviance() const;
  /// Of the campaign's unknowns, in their order and units.
  std::vector<double> values() const;
  /// Of unknowns i and j, −1 … 1; 0 where either is not determined, and without an answer. Throws
  /// std::out_of_range unless both are places in `campaign`.
  double correlation(std::size_t i, std::size_t j) const;
};

/// Throws std::invalid_argument unless the fit is an answer to the problem's own unknowns, by their names.
void require_fit_of(const CampaignProblem& problem, const FitResult& fit);

/// Whether the log alone, without the prior, tells unknown k: its σ from the data is less than its accepted
/// range, and it takes part in no direction that the log leaves open (dead_time + opening_time may be known
/// where neither is).
bool is_determined(const FitResult& fit, std::size_t k);

/// Least squares by Ceres (Levenberg-Marquardt; the throws' own unknowns eliminated by Schur's complement)
/// with exact derivatives. Without `options.start` from the problem's own, one-sided effects a typical step
/// from neutral, and from smaller ones where they end at neutral; with several effects, from each large
/// beside small others, too: of those the likeliest. With a start, the answer is the minimum that it leads
/// to: what a channel and a throw count for is learned on the way, and where the law cannot follow the log, a
/// start far off may end some sigma from the problem's own. Throws std::invalid_argument for options outside
/// their ranges, a start outside an unknown's, lists of the wrong length, and unknown names.
FitResult fit(const CampaignProblem& problem, const FitOptions& options = {});

}  // namespace unhand::fitting
