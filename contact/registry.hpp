// The contact models by name.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "contact/contact_model.hpp"
#include "contact/friction_effects.hpp"
#include "contact/law_parameter.hpp"
#include "contact/limit_surface_shapes.hpp"
#include "contact/patch.hpp"
#include "contact/sliding_pivot.hpp"

namespace unhand::contact {

/// A number that nobody gave.
inline constexpr double kNotGiven = std::numeric_limits<double>::quiet_NaN();

/// Everything that some contact model takes. Each model reads what it needs.
template <class S>
struct ContactParameters {
  Patch<S> patch;                               ///< the limits, for laws that follow the pads
  SlideEnd slide_end{SlideEnd::latched_brake};  ///< of sliding_pivot alone
  LawValues<S> law_values{};                    ///< of the law's own parameters (ContactModelEntry::own)
  /// For other laws, which need both; NaN: not given.
  double open_command{kNotGiven};  ///< when the gripper is told to open [s]
  S delay{kNotGiven};              ///< from the command to the release [s]
  /// Departures of the friction limits; neutral by default. A law passes over what it does not have:
  /// gripper_delay all of it, sliding_pivot `compliance` and `loss_time`, all laws but the disc
  /// `pressure_exponent`, and every law `adhesion` and `parting_time`, which AdhesiveForce has.
  FrictionVariation<S> variation{};
};

/// 1 on a surface of limits, for w = (f_x, f_z, τ/L)/f_max with the forces in the hand's axes; homogeneous of
/// degree one.
using WrenchGauge = std::function<Dual(const Vec3<Dual>& w)>;

/// A contact model that can be chosen by name.
struct ContactModelEntry {
  std::string name;  ///< as in commands, cards and messages: of A-Z, a-z, 0-9, '_', '-' and '.'
  std::function<std::unique_ptr<ContactModel>(const ContactParameters<Dual>&)>
      make;  ///< throws as its constructor; never null. The law may outlive the parameters and owns what it
             ///< keeps of them
  std::vector<LawParameter> own{};  ///< what it takes beside ContactParameters' other members
  /// Whether it says how the pads' friction lets go of the object, and so needs the patch and a normal force.
  /// A law that does not, as gripper_delay, takes the delay.
  bool follows_pads{true};
  /// On which surface the wrench of pads that slip lies, for the friction that is read off such wrenches: the
  /// ellipsoid where there is none, the one that the wrenches fit best where there are several. Of a law with
  /// own parameters, that of their start.
  std::vector<WrenchGauge> gauges{};
  /// Whether where the pads press shapes its limits (contact.pressure_profile); else their length alone does.
  bool feels_pressure{false};
};

/// Makes a law known by name to everything in this program that takes names: make_contact_model, comparisons,
/// fits, discovery, planners. For a program's begin: not while another thread uses the registry. Throws
/// std::invalid_argument for a name that is empty, has other characters than ContactModelEntry::name says, is
/// taken, or is that of a model which is no contact law (limit_surface_naive, projectile, free_fall,
/// ellipsoid, ellipsoid_full, convex_quartic), for a missing maker, and for an own parameter that does not
/// keep what LawParameter says.
void register_contact_model(ContactModelEntry entry);

/// The names that make_contact_model knows, the library's own first.
std::vector<std::string> contact_model_names();

/// ContactModelEntry::follows_pads; true for a name that is not known.
bool follows_pads(std::string_view name);

/// Those of contact_model_names() that follow the pads.
std::vector<std::string> pad_law_names();

/// ContactModelEntry::feels_pressure; false for a name that is not known.
bool feels_pressure(std::string_view name);

/// Whether the law has pads that may give before they slip (contact.pad_compliance): what it says of itself
/// with some. Throws as make_contact_model does.
bool can_give(std::string_view name);

/// ContactModelEntry::gauges, or the ellipsoid's; this for a name that is not known, too.
std::vector<WrenchGauge> wrench_gauges(std::string_view name);

/// What a law takes of its own; empty for a name that is not known. Valid as long as the program runs: laws
/// are never taken out of the registry.
const std::vector<LawParameter>& law_parameters(std::string_view name);

/// One of a law's own parameters that has a value [LawParameter::unit].
struct GivenLawParameter {
  const LawParameter& parameter;  ///< of the registered law, valid as law_parameters()
  double value;                   ///< [LawParameter::unit]
};

/// Those of the law's own parameters that `values` knows, in the law's order.
std::vector<GivenLawParameter> given_law_parameters(std::string_view name, const LawValues<double>& values);

/// The model of that name. Throws std::invalid_argument, listing the names, if there is none, and as the
/// model's constructor does. Of the law's own parameters `law_values` may leave out any, which then have
/// their start; throws std::invalid_argument for one that the law does not have, and for one out of its
/// range; and, naming it, where `open_command` or `delay` is not given to a law that does not follow the
/// pads. std::logic_error, naming the law, where its maker gives null.
std::unique_ptr<ContactModel> make_contact_model(std::string_view name, const ContactParameters<double>&);
std::unique_ptr<ContactModel> make_contact_model(std::string_view name, const ContactParameters<Dual>&);

}  // namespace unhand::contact
