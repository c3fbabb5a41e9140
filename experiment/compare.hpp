// Models against the measured outcomes of a campaign.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "experiment/friction_estimate.hpp"
#include "experiment/model.hpp"

namespace unhand::experiment {

/// Errors are predicted minus measured.
struct ErrorStatistics {
  int n{};        ///< errors
  double mae{};   ///< mean of the absolute error
  double std{};   ///< standard deviation of the absolute error
  double bias{};  ///< mean of the error
};
/// Of any number of errors; zeros without one.
ErrorStatistics statistics_of(const std::vector<double>& errors);

/// The compared quantities, in the order of the table.
struct Quantity {
  const char* key;    ///< in JSON, with its unit
  const char* title;  ///< in tables
  int decimals;       ///< in tables
};
inline constexpr double kDegrees = 57.29577951308232;  ///< per radian
/// What models are compared by.
inline constexpr Quantity kQuantities[] = {{"detach_vx_m_s", "detach vx [m/s]", 4},
                                           {"detach_omega_deg_s", "detach omega [deg/s]", 2},
                                           {"landing_x_m", "landing x [m]", 4},
                                           {"landing_theta_deg", "landing theta [deg]", 2}};
inline constexpr int kQuantityCount = 4;  ///< of quantities

/// One throw's prediction and its errors.
struct ThrowComparison {
  std::string id, object, condition;  ///< as in the log
  datasets::Split split{};            ///< whether it may be fitted to
  Prediction prediction;              ///< what the model says
  std::optional<double>
      error[kQuantityCount];  ///< in the units of kQuantities; absent if not measured or not predicted
};

/// The errors at the detach from the prediction there, if both are known. A model may let go earlier or later
/// than the pads did: v_x and ω are subtracted as they are, each at its own detach, for gravity alone changes
/// neither.
void judge_detach(const PreparedThrow& prepared, ThrowComparison& comparison);

/// A prediction with its errors at the detach, and at the landing where it lands.
ThrowComparison judge(const PreparedThrow& prepared, const Prediction& prediction);

/// A fitted parameter as tables show it; sigma is NaN where it is not known.
struct NamedParameter {
  std::string name, unit;   ///< as a card has them
  double value{}, sigma{};  ///< in `unit`; 1 σ
};

/// One object under one condition: what is repeated.
struct ThrownCondition {
  std::string object, condition;  ///< as in the log
  std::string label;              ///< the condition, after its object where several share its name
  bool held_out{};                ///< at least one of its throws is a test throw
};

/// One model's predictions and errors, throw by throw.
struct ModelComparison {
  std::string model;                    ///< its name
  FrictionEstimate estimate;            ///< where its parameters are from, unless a card gave them
  std::vector<NamedParameter> named;    ///< of a fitted model, in place of estimate.parameters; else empty
  bool from_card{};                     ///< the parameters are a card's
  std::vector<ThrowComparison> throws;  ///< in the order of the log
  int failed{};  ///< throws without a predicted landing: at most their detach is in a statistic
  double microseconds_per_throw{};  ///< release and flight, one thread's time, warmed up

  /// Over the throws of one split; `quantity` is a place in kQuantities.
  ErrorStatistics statistics(int quantity, datasets::Split split) const;
  /// The same over the throws of one object under one condition: its held-out ones where it has any.
  ErrorStatistics of_condition(int quantity, const ThrownCondition& condition) const;
};

/// The conditions of predicted throws, in order of appearance.
std::vector<ThrownCondition> conditions_of(const std::vector<ThrowComparison>& throws);

/// How far repetitions of a condition scatter about their mean: the floor of any model that does not know
/// what differs between them.
struct RepetitionScatter {
  int conditions{};                     ///< with at least two repetitions
  std::optional<double> landing_x;      ///< pooled standard deviation [m]; absent where none was measured
  std::optional<double> landing_theta;  ///< [deg]
};

/// Models against the measured outcomes of a campaign.
struct Comparison {
  std::vector<ThrownCondition> conditions;  ///< in order of appearance
  std::vector<ModelComparison> models;      ///< in the order asked for
  RepetitionScatter repetitions;            ///< the floor under all of them
  double worst_hand_chi2{};                 ///< how well the smoothed hands explain the logged ones
  std::optional<double> mean_force_chi2;    ///< and the normal forces, over the throws that have one
};

/// Which models are compared, and with which parameters.
struct CompareOptions {
  std::vector<std::string> models;         ///< names of release_model_names()
  int threads{0};                          ///< 0: one per core; the answer does not depend on it
  dynamics::IntegratorOptions integrator;  ///< of release and flight
  std::map<std::string, ModelParameters>
      parameters;               ///< by model, from cards; otherwise estimated from the log
  release::NaiveOptions naive;  ///< of limit_surface_naive
};

/// All throws prepared, on several threads, without frames in which the tracker was elsewhere for once
/// (mark_glitches). `file` names the log in errors. Throws datasets::LogError for a
/// log that breaks the rules of its kind (datasets::validate), for one with a column in another unit than it
/// says (require_units; not asked without `check_units`), and for throws that lack what a release needs.
std::vector<PreparedThrow> prepare_all(const datasets::ThrowLog& log, const std::string& file, int threads,
                                       bool check_units = true);

/// Simulates every prepared throw with every model. Throws std::invalid_argument for unknown models and what
/// the log does not determine.
Comparison compare(const datasets::ThrowLog& log, const std::vector<PreparedThrow>& prepared,
                   const CompareOptions& options);

}  // namespace unhand::experiment
