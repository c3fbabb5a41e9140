// What is uncertain about throwing one object with one gripper, and what that uncertainty moves.
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "datasets/model_card.hpp"
#include "datasets/sku.hpp"
#include "experiment/throw_prediction.hpp"

namespace unhand::fitting {

/// Where an uncertainty is known from.
enum class InputSource {
  card,            ///< the card's covariance: the same in every throw
  throw_to_throw,  ///< the card's spreads: drawn anew in every throw
  gripper,         ///< how the gripper opens where no normal force was measured: the card's range, or assumed
  sku,             ///< the SKU file's tolerance
  assumed,         ///< the SKU file gives none
};
/// The source's name, as it is written above.
const char* to_string(InputSource);

/// One independent or, between card inputs, correlated number.
struct UncertainInput {
  std::string name, unit;   ///< of the number; "-" where it has none
  double value{}, sigma{};  ///< 1 σ
  InputSource source{};     ///< who says how uncertain it is
  std::string measurement;  ///< what would make it better known; empty: nothing does before the throw
  /// The values that it moves, by their place, and how far per unit of it.
  std::vector<std::pair<std::size_t, double>> moves;
  bool determined{true};  ///< false: the card's log alone says nothing of it
  /// Drawn as value · exp(δ/value) for a normal δ, so that products keep their spread: of friction and grip
  /// force, where a fit knows their product far better than either.
  bool logarithmic{false};
};

/// Where the SKU file gives no tolerance, 1 σ is taken to be
struct AssumedTolerances {
  double mass{0.01};          ///< of the mass [-]: a kitchen scale
  double com_offset{2e-3};    ///< [m]
  double inertia{0.05};       ///< of a declared inertia [-]
  double shape{0.10};         ///< of the inertia of a uniform shape [-]: few objects are one
  double other_surface{0};    ///< of mu, where the object's surface is not that of the card's log [-]
  double grip_force{0.03};    ///< of the grip force, where the card's range does not tell [-]
  double dead_time{1e-3};     ///< of the gripper [s]
  double opening_time{1e-3};  ///< likewise [s]
};

/// 1 σ of an object's mass [kg], as the SKU file tells it or else assumed.
double mass_sigma_of(const datasets::Sku& sku, const AssumedTolerances& assumed = {});
/// The same of its inertia [kg m²].
double inertia_sigma_of(const datasets::Sku& sku, const AssumedTolerances& assumed = {});

/// The values of a throw as experiment::predict_channels reads them, and what is uncertain about them.
struct ThrowInputs {
  experiment::ThrowModel model;        ///< contact law and pads
  std::vector<std::string> names;      ///< as experiment::ThrowModel says
  std::vector<double> values;          ///< one per name, SI units
  std::vector<UncertainInput> inputs;  ///< what is uncertain
  Eigen::MatrixXd covariance;          ///< of the inputs
  std::vector<std::string> notes;      ///< what was left out, and why

  /// The values with the inputs moved by so much.
  std::vector<double> moved(const Eigen::VectorXd& by) const;
  /// The same for a normal draw of the inputs: those that are logarithmic are moved by value (exp(by/value) −
  /// 1), which is `by` to first order.
  std::vector<double> drawn(const Eigen::VectorXd& by) const;
  /// ∂(value)/∂(input).
  Eigen::MatrixXd mixing() const;
};

/// For an object thrown as `thrown` says. A card's estimates of what its own log declared wrong (sensor.mass,
/// sensor.inertia, sensor.com_offset) are left out, and so are effects of single other objects. Throws
/// datasets::CardError as options_of does.
ThrowInputs throw_inputs(const datasets::Sku& sku, const datasets::ModelCard& card,
                         const std::string& card_file, const experiment::PreparedThrow& thrown,
                         const AssumedTolerances& assumed = {});

}  // namespace unhand::fitting
