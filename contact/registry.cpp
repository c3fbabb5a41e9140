#include "contact/registry.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <stdexcept>
#include <tuple>

#include "contact/gripper_delay.hpp"
#include "contact/limit_surface.hpp"
#include "dynamics/effect.hpp"

namespace unhand::contact {
namespace {

using Parameters = ContactParameters<Dual>;
using Model = std::unique_ptr<ContactModel>;

template <class Shape>
WrenchGauge gauge_of(const Shape& shape) {
  return [shape](const Vec3<Dual>& w) { return shape.gauge(w); };
}

/// Of a sliding pivot, whose limits of force and torque know nothing of each other.
Dual decoupled_gauge(const Vec3<Dual>& w) {
  const Dual force = hypot(w[0], w[1]), torque = abs(w[2]);
  return force < torque ? torque : force;
}

/// A contact model is one entry here. Addresses stay as more are registered.
std::deque<ContactModelEntry>& models() {
  static std::deque<ContactModelEntry> known{
      {.name = "sliding_pivot",
       .make = [](const Parameters& p) -> Model {
         return std::make_unique<SlidingPivot>(p.patch, p.slide_end, p.variation);
       },
       // Real pads follow no rectangle, and the ellipsoid's values serve the pivot better there.
       .gauges = {gauge_of(Ellipsoid{}), decoupled_gauge}},
      {.name = "limit_surface",
       .make = [](const Parameters& p) -> Model {
         return std::make_unique<LimitSurface<Ellipsoid>>("limit_surface", p.patch, Ellipsoid{}, p.variation);
       }},
      {.name = "limit_surface_disc",
       .make = [](const Parameters& p) -> Model {
         const Dual& exponent = p.variation.pressure_exponent;
         if (!dynamics::is_zero(exponent))
           return std::make_unique<LimitSurface<PressedDisc>>("limit_surface_disc", p.patch,
                                                              PressedDisc(exponent), p.variation);
         return std::make_unique<LimitSurface<UniformDisc>>("limit_surface_disc", p.patch, UniformDisc{},
                                                            p.variation);
       },
       .gauges = {gauge_of(UniformDisc{})},
       .feels_pressure = true},
      {.name = "limit_surface_quartic",
       .make = [](const Parameters& p) -> Model {
         return std::make_unique<LimitSurface<IsotropicQuartic>>(
             "limit_surface_quartic", p.patch, IsotropicQuartic(p.law_values.at("kappa")), p.variation);
       },
       // Of the shape (IsotropicQuartic). The disc's, and about as far from it as the ellipsoid's 1 is
       // likely; convex from 0 to 3, singular at both.
       .own = {{"kappa", "-", ConvexQuartic::kappa_closest_to_disc(), 0, 3, 0.05, 2.95, 0.2, 0.3,
                "throws whose pads slide and turn at once, with force and torque measured behind a pad"}},
       .gauges = {gauge_of(IsotropicQuartic::closest_to_disc())}},
      {.name = kGripperDelay,
       .make = [](const Parameters& p) -> Model {
         return std::make_unique<GripperDelay>(p.open_command, p.delay);
       },
       .follows_pads = false},
  };
  return known;
}

const ContactModelEntry* find(std::string_view name) {
  const auto& all = models();
  const auto at = std::find_if(all.begin(), all.end(), [&](const auto& entry) { return entry.name == name; });
  return at == all.end() ? nullptr : &*at;
}

/// Models of comparisons, flights, falls and slips that are no contact law of a release
/// (release::kNaiveModel, fitting::surface_models, and what discover calls its base models). This folder must
/// not know them.
constexpr std::string_view kReserved[] = {"limit_surface_naive", "projectile",     "free_fall",
                                          "ellipsoid",           "ellipsoid_full", "convex_quartic"};

bool is_name(std::string_view name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  });
}

/// The names that fits and cards have for what every law takes, and for what a throw has of its own.
constexpr std::string_view kTaken[] = {"mu",
                                       "length",
                                       "pads",
                                       "reference_force",
                                       "grip_force",
                                       "dead_time",
                                       "opening_time",
                                       "shape",
                                       "delay",
                                       "delay_sigma",
                                       "grasp_angle",
                                       "grasp_offset",
                                       "mu_deviation",
                                       "force_deviation",
                                       "delay_deviation",
                                       "dead_time_deviation"};

void validate(const ContactModelEntry& entry) {
  const auto fail = [&](const std::string& why) {
    throw std::invalid_argument(fmt::format("register_contact_model: \"{}\" {}", entry.name, why));
  };
  if (!is_name(entry.name)) fail("is not a valid name: use A-Z, a-z, 0-9, '_', '-' and '.'");
  if (std::find(std::begin(kReserved), std::end(kReserved), entry.name) != std::end(kReserved))
    fail("is the name of a model that is no contact law");
  if (find(entry.name)) fail("is taken");
  if (!entry.make) fail("has no maker");
  for (const LawParameter& p : entry.own) {
    if (p.name.empty() || p.name.find_first_of(".[]") != std::string::npos ||
        std::find(std::begin(kTaken), std::end(kTaken), p.name) != std::end(kTaken))
      fail(fmt::format("has a parameter named \"{}\", which is empty, taken or has one of . [ ]", p.name));
    if (p.unit.empty()) fail(fmt::format("has \"{}\" without a unit; \"-\" where it has none", p.name));
    if (std::count_if(entry.own.begin(), entry.own.end(), [&](const auto& q) { return q.name == p.name; }) >
        1)
      fail(fmt::format("has two parameters named \"{}\"", p.name));
    if (!(p.low <= p.search_low && p.search_low <= p.start && p.start <= p.search_high &&
          p.search_high <= p.high && p.search_low < p.search_high && std::isfinite(p.high - p.low)))
      fail(
          fmt::format("has \"{}\" = {}, to be searched in [{}, {}] and accepted in [{}, {}]: each must hold "
                      "the one before it, and be finite",
                      p.name, p.start, p.search_low, p.search_high, p.low, p.high));
    if (!(p.typical > 0 && std::isfinite(p.typical) && p.prior_sigma.value_or(1) > 0))
      fail(fmt::format("has \"{}\" with a step of {} and a prior sigma of {}: both must be > 0", p.name,
                       p.typical, p.prior_sigma.value_or(HUGE_VAL)));
  }
}

Model made(const ContactModelEntry& entry, const Parameters& parameters) {
  if (!entry.follows_pads)
    for (const auto& [name, value, what] :
         {std::tuple{"open_command", parameters.open_command, "when the gripper is told to open"},
          std::tuple{"delay", parameters.delay.a, "from the command to the release"}})
      if (std::isnan(value))
        throw std::invalid_argument(
            fmt::format("contact model \"{}\" needs {} [s], {}: it is not given", entry.name, name, what));
  Model law = entry.make(parameters);
  if (!law) throw std::logic_error(fmt::format("contact model \"{}\": its maker gave null", entry.name));
  return law;
}

/// Values of all the law's own parameters: those given, else their start.
LawValues<Dual> complete(const ContactModelEntry& entry, LawValues<Dual> values) {
  for (const auto& [name, value] : values)
    if (std::none_of(entry.own.begin(), entry.own.end(), [&](const auto& own) { return own.name == name; }))
      throw std::invalid_argument(
          fmt::format("contact model \"{}\" has no parameter \"{}\"", entry.name, name));
  for (const LawParameter& own : entry.own) {
    const double value = values.try_emplace(own.name, Dual(own.start)).first->second.a;
    if (!(value >= own.low && value <= own.high))
      throw std::invalid_argument(fmt::format("contact model \"{}\": {} = {} is not in [{}, {}]{}",
                                              entry.name, own.name, value, own.low, own.high,
                                              dynamics::after_number(own.unit)));
  }
  return values;
}

}  // namespace

void register_contact_model(ContactModelEntry entry) {
  validate(entry);
  models().push_back(std::move(entry));
}

std::vector<std::string> contact_model_names() {
  std::vector<std::string> names;
  for (const auto& entry : models()) names.push_back(entry.name);
  return names;
}

bool follows_pads(std::string_view name) {
  const auto* entry = find(name);
  return !entry || entry->follows_pads;
}

std::vector<std::string> pad_law_names() {
  std::vector<std::string> names = contact_model_names();
  std::erase_if(names, [](const std::string& name) { return !follows_pads(name); });
  return names;
}

bool feels_pressure(std::string_view name) {
  const auto* entry = find(name);
  return entry && entry->feels_pressure;
}

bool can_give(std::string_view name) {
  ContactParameters<double> giving;
  giving.patch = {0.5, 0.01};
  giving.open_command = giving.delay = 0;
  giving.variation.compliance = 1e-6;
  return make_contact_model(name, giving)->needs_hold();
}

std::vector<WrenchGauge> wrench_gauges(std::string_view name) {
  const auto* entry = find(name);
  if (!entry || entry->gauges.empty()) return {gauge_of(Ellipsoid{})};
  return entry->gauges;
}

const std::vector<LawParameter>& law_parameters(std::string_view name) {
  static const std::vector<LawParameter> kNone;
  const auto* entry = find(name);
  return entry ? entry->own : kNone;
}

std::vector<GivenLawParameter> given_law_parameters(std::string_view name, const LawValues<double>& values) {
  std::vector<GivenLawParameter> out;
  for (const auto& own : law_parameters(name))
    if (const auto value = values.find(own.name); value != values.end()) out.push_back({own, value->second});
  return out;
}

std::unique_ptr<ContactModel> make_contact_model(std::string_view name,
                                                 const ContactParameters<Dual>& given) {
  const auto* entry = find(name);
  if (!entry)
    throw std::invalid_argument(fmt::format("contact model \"{}\" is unknown; there are {}", name,
                                            fmt::join(contact_model_names(), ", ")));
  if (entry->own.empty() && given.law_values.empty()) return made(*entry, given);
  ContactParameters<Dual> parameters = given;
  parameters.law_values = complete(*entry, given.law_values);
  return made(*entry, parameters);
}

std::unique_ptr<ContactModel> make_contact_model(std::string_view name, const ContactParameters<double>& p) {
  return make_contact_model(
      name, ContactParameters<Dual>{constant(p.patch), p.slide_end,
                                    LawValues<Dual>(p.law_values.begin(), p.law_values.end()), p.open_command,
                                    Dual(p.delay), constant(p.variation)});
}

}  // namespace unhand::contact
