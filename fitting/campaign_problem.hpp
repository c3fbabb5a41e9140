// A campaign of throws as a least-squares problem: which numbers are unknown, and what each throw says of
// them.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"
#include "experiment/model.hpp"
#include "experiment/throw_prediction.hpp"

namespace unhand::fitting {

/// An unknown: of the campaign, or of every throw.
struct Unknown {
  /// Of a throw's own unknown: what its spread is learned from.
  enum class Kind {
    /// Where the object was held; about zero. Its zero is what the log's sensors say: a clock or a pose of
    /// the hand that is off moves it for whole conditions, and the throw must be free to take that back.
    placement,
    /// What differs between repetitions by itself; about the mean of their condition. What all of them share
    /// is where the law fails, and must not be hidden from the campaign's unknowns.
    scatter,
    smoothing  ///< what the smoothing of an input leaves open: as that says, not learned
  };
  std::string name, unit;         ///< of the parameter; "-" where it has none
  double start{}, low{}, high{};  ///< where fits start; accepted range, ends included
  double scale{};                 ///< a change of it that matters
  /// 1 σ of what is known of it without this log, about `start`.
  std::optional<double> prior_sigma{};
  Kind kind{Kind::placement};  ///< of a throw's own unknown
  bool of_law{false};          ///< of a campaign's unknown: a parameter of the contact law
};

/// Which model, effects and channels a campaign's problem has.
struct CampaignOptions {
  std::string model{"limit_surface_disc"};      ///< a name that contact::make_contact_model knows
  std::vector<std::string> effects;             ///< ids whose parameters are unknowns, too; each once
  experiment::ObservationOptions observations;  ///< which channels, how far trusted
  dynamics::IntegratorOptions integrator{.tolerances = {1e-6, 1e-9}};  ///< of release and flight
  int threads{0};          ///< 0: one per core; the answer does not depend on it
  bool check_units{true};  ///< refuse a log with a column in another unit (experiment::require_units)
  /// For predictions with parameters from elsewhere: the log need hold no observations, starts are not looked
  /// for, and the campaign's own numbers (ThrowModel) are these if given.
  bool predict_only{false};
  std::optional<int> pads{};                ///< 1 … 1000, as in logs
  std::optional<double> reference_force{};  ///< f₀ of contact::FrictionVariation, > 0 [N]
};

/// One throw and its observations.
struct CampaignThrow {
  experiment::PreparedThrow prepared;  ///< its inputs
  experiment::Observations observed;   ///< what was measured
  /// By observation: the phase's boundaries as the log has them [s], for choosing samples.
  double opening{}, release{};  ///< s; release is NaN where none was measured
  /// The measured release, or a predicted one where there is none.
  double release_or(double predicted) const { return release == release ? release : predicted; }
};

/// The values that the throws of one object read.
struct Layout {
  std::vector<std::string> names;  ///< "mu", "contact.viscous.1/v_0", ...
  std::vector<int> columns;        ///< where they are: campaign unknowns first, then the throw's own
};

/// Derivatives of a linearisation: every sweep of dual numbers has room for a few, and is a simulation.
enum class DerivativesBy {
  nothing,  ///< values alone
  own,      ///< by the throw's own unknowns
  all,      ///< and by the campaign's
};

/// r = (predicted − observed)/σ, and its derivatives with respect to the campaign's unknowns and the throw's
/// own.
struct Linearisation {
  bool solved{};                  ///< false: release or flight has no answer, and what follows is empty
  std::string why_not;            ///< then: why, in words
  Eigen::VectorXd residual;       ///< one per observation [σ]
  Eigen::MatrixXd campaign, own;  ///< its derivatives, a column per unknown; 0 by what was not asked for
  std::vector<int> modes;         ///< the modes entered, in order
  double detach{};                ///< [s]
};

/// A campaign with a model: unknowns, residuals and their derivatives.
class CampaignProblem {
 public:
  /// Prepares every throw, on several threads. Throws datasets::LogError for a log that breaks the rules of
  /// its kind and for throws that lack what a release needs, std::invalid_argument for an unknown model or
  /// effect, an effect named twice, pads or a reference force out of range, or a log without any
  /// observation.
  CampaignProblem(const datasets::ThrowLog& log, const std::string& file, const CampaignOptions& options);

  /// In the order of the log.
  const std::vector<CampaignThrow>& throws() const { return *throws_; }
  /// The unknowns that all throws share.
  const std::vector<Unknown>& campaign() const { return campaign_; }
  /// The unknowns that every throw has for itself; their values are one list per throw.
  const std::vector<Unknown>& own() const { return own_; }
  /// What predictions are made with.
  const experiment::ThrowModel& model() const { return model_; }
  /// As they were given, with the model and the effects of with() and the noise of landings that declare
  /// none.
  const CampaignOptions& options() const { return options_; }
  /// What was left out of the log, and why.
  const std::vector<std::string>& notes() const { return notes_; }

  /// The same throws (shared, not copied) with other effects, or another contact model. Throws
  /// std::invalid_argument as the constructor does.
  CampaignProblem with(const std::string& model, const std::vector<std::string>& effects) const;

  /// Where a fit starts: the campaign's unknowns, in their order.
  std::vector<double> start() const;

  /// How a throw's values are named and found among the unknowns.
  const Layout& layout(const experiment::PreparedThrow& prepared) const {
    return layouts_.at(prepared.object);
  }

  /// The residual of one throw, of all its observations or of some; its derivatives through dual numbers. Not
  /// solved where the unknowns are outside the physics (a gripper that opens before it is told to).
  Linearisation linearise(const CampaignThrow& thrown, std::span<const double> campaign,
                          std::span<const double> own, DerivativesBy derivatives) const {
    return linearise(thrown.prepared, thrown.observed, campaign, own, derivatives);
  }
  Linearisation linearise(const experiment::PreparedThrow& prepared, const experiment::Observations& observed,
                          std::span<const double> campaign, std::span<const double> own,
                          DerivativesBy derivatives) const;

  /// The prediction itself.
  experiment::ThrowPrediction<double> predict(const CampaignThrow& thrown, std::span<const double> campaign,
                                              std::span<const double> own) const {
    return predict(thrown.prepared, thrown.observed, campaign, own);
  }
  experiment::ThrowPrediction<double> predict(const experiment::PreparedThrow& prepared,
                                              const experiment::Observations& observed,
                                              std::span<const double> campaign,
                                              std::span<const double> own) const;

  /// The recorded release of that prediction (experiment::visit_release).
  void visit_release(const experiment::PreparedThrow& prepared, std::span<const double> campaign,
                     std::span<const double> own, const experiment::UseOfRelease& use) const;

  /// The prediction in dual numbers, kDualSize unknowns at a time: `use` is given each with the unknowns that
  /// its derivatives are by (campaign first, then own), until it returns false.
  using UseOfDuals =
      std::function<bool(const experiment::ThrowPrediction<dynamics::Dual>&, std::span<const int> unknowns)>;
  /// Calls `use` for one sweep of derivatives after the other, of `all` or those by the throw's `own`
  /// unknowns.
  void differentiate(const experiment::PreparedThrow& prepared, const experiment::Observations& observed,
                     std::span<const double> campaign, std::span<const double> own, DerivativesBy derivatives,
                     const UseOfDuals& use) const;

 private:
  /// Where the pads' wrenches, or the releases that motion capture shows, let fits start.
  void guess_start(const datasets::ThrowLog& log, const std::vector<experiment::PreparedThrow>& prepared,
                   bool pressed);
  /// Makes the throws, with what was measured of them; how many observations there are.
  std::size_t observe(const datasets::ThrowLog& log, std::vector<experiment::PreparedThrow> prepared);
  void name_unknowns(const std::vector<dynamics::Effect>& effects);
  std::vector<double> values_of(const Layout&, std::span<const double> campaign,
                                std::span<const double> own) const;

  datasets::ThrowLog header_;  // objects and gripper, without its throws
  CampaignOptions options_;
  experiment::ThrowModel model_;
  std::vector<Unknown> campaign_, own_;
  std::shared_ptr<const std::vector<CampaignThrow>> throws_;
  std::map<std::string, Layout> layouts_;  // by object
  std::vector<std::string> notes_;
  experiment::ModelParameters first_guess_;
  bool scatters_across_{};  // repetitions differ in where the pads hold the object across its x axis
};

/// The effect of that id. Throws std::invalid_argument, listing the ids, if there is none.
dynamics::Effect find_effect(const std::string& id);

}  // namespace unhand::fitting
