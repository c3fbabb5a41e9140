// The contact models by name.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "contact/contact_model.hpp"
#include "contact/friction_effects.hpp"
#include "contact/patch.hpp"
#include "contact/sliding_pivot.hpp"

namespace unhand::contact {

/// Everything that some contact model takes. Each model reads what it needs.
template <class S>
struct ContactParameters {
  Patch<S> patch;                               ///< the limits, for all but gripper_delay
  SlideEnd slide_end{SlideEnd::latched_brake};  ///< sliding_pivot
  std::optional<S> kappa;            ///< limit_surface_quartic; the closest to a uniform disc if absent [-]
  double open_command{};             ///< gripper_delay: when the gripper is told to open [s]
  S delay{};                         ///< gripper_delay: from the command to the release [s]
  FrictionVariation<S> variation{};  ///< departures of the friction limits; neutral by default
};

/// The names that make_contact_model knows.
std::vector<std::string> contact_model_names();

/// The model of that name. Throws std::invalid_argument, listing the names, if there is none, and as the
/// model's constructor does.
std::unique_ptr<ContactModel> make_contact_model(std::string_view name, const ContactParameters<double>&);
std::unique_ptr<ContactModel> make_contact_model(std::string_view name, const ContactParameters<Dual>&);

}  // namespace unhand::contact
