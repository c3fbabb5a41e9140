// A model of a throw: a contact law with its parameters, from the prepared throw to the landing.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "contact/gripper_delay.hpp"
#include "contact/patch.hpp"
#include "contact/registry.hpp"
#include "experiment/prepared_throw.hpp"
#include "release/naive_release.hpp"
#include "release/simulate_release.hpp"

namespace unhand::experiment {

/// Campaign parameters of a model; each model reads what it needs.
struct ModelParameters {
  double mu{0.5};                           ///< friction coefficient [-]
  double length{contact::kFingerLength};    ///< L = c a = τ_max/f_max [m]
  int pads{2};                              ///< n >= 1
  contact::LawValues<double> law_values{};  ///< of the law's own parameters
  contact::DelayDistribution delay{contact::DelayDistribution::number(0.05)};  ///< gripper_delay
  release::NaiveOptions naive{};                                               ///< limit_surface_naive
};

/// The names that a comparison of releases knows: contact::contact_model_names() and limit_surface_naive.
std::vector<std::string> release_model_names();

/// Throws std::invalid_argument, listing the names, unless `name` is one of them.
void require_release_model(const std::string& name);

/// One throw through one model.
struct Prediction {
  release::ReleaseOutcome release{};                                ///< how the release ended
  flight::FlightOutcome flight{flight::FlightOutcome::not_solved};  ///< how the flight ended
  release::DetachState<double> detach;                              ///< the CoM where the pads part
  flight::Landing<double> landing;                                  ///< of the CoM
  int events{};           ///< of the release; for limit_surface_naive, reversals of the slip
  bool slips_at_start{};  ///< the grip cannot hold the object even before it opens
  /// Whether release and flight have an answer.
  bool landed() const {
    return release == release::ReleaseOutcome::detached && flight == flight::FlightOutcome::landed;
  }
};

/// Simulates the release with the named model and flies to the landing. Throws std::invalid_argument for
/// parameters out of range, and for a model that needs the normal force when it was neither measured nor
/// told.
Prediction predict(const PreparedThrow& throw_, const std::string& model, const ModelParameters& parameters,
                   const dynamics::IntegratorOptions& options = {});

/// The contact model that predict() uses; null for limit_surface_naive, which has none.
std::unique_ptr<contact::ContactModel> contact_model_for(const PreparedThrow& throw_,
                                                         const std::string& model,
                                                         const ModelParameters& parameters);

/// The release problem of a prepared throw. `contact` must outlive it.
release::ReleaseProblem<double> release_problem(const PreparedThrow& throw_,
                                                const contact::ContactModel& contact);

}  // namespace unhand::experiment
