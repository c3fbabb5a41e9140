#include "fitting/sku/sku_inputs.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "contact/registry.hpp"
#include "experiment/campaign_effects.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "fitting/card.hpp"

namespace unhand::fitting {
namespace {

constexpr const char* kLocate = "see where the object sits in the hand before the throw";
constexpr const char* kForce = "measure the pads' normal force while they open";

/// Collects inputs and the values that they move.
class Collector {
 public:
  explicit Collector(ThrowInputs& out) : out_(out) {}

  std::size_t value(const std::string& name, double start) {
    const auto found = std::find(out_.names.begin(), out_.names.end(), name);
    if (found != out_.names.end()) return static_cast<std::size_t>(found - out_.names.begin());
    out_.names.push_back(name);
    out_.values.push_back(start);
    return out_.names.size() - 1;
  }

  /// An input with a σ of 0 is none.
  void input(UncertainInput input) {
    if (input.sigma > 0) out_.inputs.push_back(std::move(input));
  }

 private:
  ThrowInputs& out_;
};

std::string measurement_for(const std::string& name) {
  if (name == "mu") return "more throws for the card in which the pads slip under force (a slower opening)";
  if (name == "length") return "more throws for the card in which the object pivots, with the pads' torque";
  if (name == "delay") return "more throws for the card, with motion capture of the flight";
  return "more throws for the card that show " + name.substr(0, name.find('['));
}

/// The card's parameters that this throw reads, with their covariance.
void add_card(const datasets::Sku& sku, const datasets::ModelCard& card, Collector& collect,
              ThrowInputs& out) {
  for (const auto& [name, parameter] : card.parameters) {
    if (name == "pads" || name == "reference_force") continue;
    const std::size_t bracket = name.find('[');
    if (bracket != std::string::npos && name.substr(bracket + 1) != sku.name + "]") {
      out.notes.push_back(name + " is of another object: left out");
      continue;
    }
    if (const auto* effect = experiment::effect_of(name.substr(0, bracket));
        effect && effect->about_declaration) {
      out.notes.push_back(name + " is about what the card's log declared: left out");
      continue;
    }
    const std::size_t k = collect.value(name.substr(0, bracket), parameter.value);
    const double sigma = parameter.sigma.value_or(0);
    if (!(sigma > 0)) continue;
    collect.input({name,
                   parameter.unit,
                   parameter.value,
                   sigma,
                   InputSource::card,
                   measurement_for(name),
                   {{k, 1}},
                   parameter.determined});
  }
}

/// Of the inputs: the card's where it tells one, σ² on the diagonal otherwise.
Eigen::MatrixXd covariance_of(const std::vector<UncertainInput>& inputs, const datasets::ModelCard& card) {
  const datasets::CardCovariance told = card.covariance.value_or(datasets::CardCovariance{});
  const auto n = static_cast<Eigen::Index>(inputs.size());
  return Eigen::MatrixXd::NullaryExpr(n, n, [&](Eigen::Index i, Eigen::Index j) {
    const UncertainInput &a = inputs[static_cast<std::size_t>(i)], &b = inputs[static_cast<std::size_t>(j)];
    const double own = i == j ? a.sigma * a.sigma : 0;
    if (a.source != InputSource::card || b.source != InputSource::card) return own;
    return told.of(a.name, b.name).value_or(own);
  });
}

/// Friction and grip force that a card knows to a tenth or less are drawn by their logarithms: the pads'
/// limits know the product alone, which of (1 + e)(1 − e) would be off by e².
void draw_product(std::vector<UncertainInput>& inputs) {
  constexpr double kRough = 0.1;
  const auto named = [&](const char* name) {
    return std::find_if(inputs.begin(), inputs.end(), [&](const UncertainInput& one) {
      return one.source == InputSource::card && one.name == name && one.value > 0;
    });
  };
  const auto mu = named("mu"), force = named("grip_force");
  if (mu == inputs.end() || force == inputs.end()) return;
  if (std::max(mu->sigma / mu->value, force->sigma / force->value) > kRough)
    mu->logarithmic = force->logarithmic = true;
}

void add_spreads(const datasets::ModelCard& card, Collector& collect) {
  for (const auto& [name, spread] : card.own_spreads)
    collect.input({name,
                   spread.unit,
                   0,
                   spread.sigma,
                   InputSource::throw_to_throw,
                   name.starts_with("grasp") ? kLocate : "",
                   {{collect.value(name, 0), 1}}});
}

/// How the gripper opens, where nothing measured it: what the card has seen, else what the synthetic
/// campaigns take.
void add_opening(const datasets::ModelCard& card, const std::string& file, const AssumedTolerances& assumed,
                 Collector& collect) {
  const auto design = experiment::campaign_design("batch180").opening;
  const auto add = [&](const char* name, const char* unit, double value, double sigma) {
    if (card.parameters.contains(name)) return;  // fitted, with its own σ
    const auto seen = datasets::middle_of_range(card, file, name, unit);
    if (seen) {
      value = seen->value;
      sigma = std::max(sigma, *seen->sigma);
    }
    const std::size_t k = collect.value(name, value);
    collect.input(
        {name, unit, value, sigma, seen ? InputSource::gripper : InputSource::assumed, kForce, {{k, 1}}});
  };
  add("grip_force", "N", design.grip_force, assumed.grip_force * design.grip_force);
  add("opening_time", "s", design.opening_time, assumed.opening_time);
  add("dead_time", "s", design.dead_time, assumed.dead_time);
  add("shape", "-", design.shape, 0);
}

/// Whether the inertia is that of a uniform shape.
bool is_shaped(const datasets::Sku& sku) {
  return sku.shape && sku.dims && sku.inertia &&
         *sku.inertia == datasets::shape_inertia(*sku.shape, sku.mass, *sku.dims);
}

void add_object(const datasets::Sku& sku, const AssumedTolerances& assumed, Collector& collect) {
  const auto source = [](bool told) { return told ? InputSource::sku : InputSource::assumed; };
  const std::size_t mass = collect.value("sensor.mass.ratio", 1),
                    inertia = collect.value("sensor.inertia.ratio", 1),
                    offset = collect.value("grasp_offset", 0);
  UncertainInput weight{"mass",
                        "kg",
                        sku.mass,
                        mass_sigma_of(sku, assumed),
                        source(sku.mass_sigma.has_value()),
                        "weigh the object",
                        {{mass, 1 / sku.mass}}};
  if (is_shaped(sku)) weight.moves.push_back({inertia, 1 / sku.mass});  // I = m k²
  collect.input(std::move(weight));
  const double I = sku.inertia.value_or(0);
  collect.input({"inertia",
                 "kg m^2",
                 I,
                 inertia_sigma_of(sku, assumed),
                 source(sku.inertia_sigma.has_value()),
                 "time the object's swing as a pendulum: its inertia",
                 {{inertia, 1 / I}}});
  collect.input({"com_offset",
                 "m",
                 sku.com_offset,
                 sku.com_offset_sigma.value_or(assumed.com_offset),
                 source(sku.com_offset_sigma.has_value()),
                 "balance the object on an edge: its centre of mass",
                 {{offset, 1}}});
}

}  // namespace

double mass_sigma_of(const datasets::Sku& sku, const AssumedTolerances& assumed) {
  return sku.mass_sigma.value_or(assumed.mass * sku.mass);
}

double inertia_sigma_of(const datasets::Sku& sku, const AssumedTolerances& assumed) {
  return sku.inertia_sigma.value_or((is_shaped(sku) ? assumed.shape : assumed.inertia) *
                                    sku.inertia.value_or(0));
}

const char* to_string(InputSource source) {
  constexpr const char* kNames[] = {"card", "throw to throw", "gripper", "SKU", "assumed"};
  return kNames[static_cast<int>(source)];
}

std::vector<double> ThrowInputs::moved(const Eigen::VectorXd& by) const {
  std::vector<double> out = values;
  for (std::size_t k = 0; k < inputs.size(); ++k)
    for (const auto& [value, per_unit] : inputs[k].moves)
      out[value] += per_unit * by[static_cast<Eigen::Index>(k)];
  return out;
}

std::vector<double> ThrowInputs::drawn(const Eigen::VectorXd& by) const {
  Eigen::VectorXd by_value = by;
  for (std::size_t k = 0; k < inputs.size(); ++k)
    if (inputs[k].logarithmic) {
      double& step = by_value[static_cast<Eigen::Index>(k)];
      step = inputs[k].value * std::expm1(step / inputs[k].value);
    }
  return moved(by_value);
}

Eigen::MatrixXd ThrowInputs::mixing() const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(values.size()),
                                              static_cast<Eigen::Index>(inputs.size()));
  for (std::size_t k = 0; k < inputs.size(); ++k)
    for (const auto& [value, per_unit] : inputs[k].moves)
      out(static_cast<Eigen::Index>(value), static_cast<Eigen::Index>(k)) += per_unit;
  return out;
}

ThrowInputs throw_inputs(const datasets::Sku& sku, const datasets::ModelCard& card,
                         const std::string& card_file, const experiment::PreparedThrow& thrown,
                         const AssumedTolerances& assumed) {
  const CampaignOptions options = options_of(card, card_file);
  ThrowInputs out;
  out.model.contact_model = card.model;
  out.model.pads = options.pads.value_or(2);
  out.model.reference_force = options.reference_force.value_or(20);
  out.model.integrator = options.integrator;
  Collector collect(out);
  add_card(sku, card, collect, out);
  const bool card_tells = !out.inputs.empty();
  draw_product(out.inputs);
  add_spreads(card, collect);
  const bool follows_pads = contact::follows_pads(card.model);
  if (follows_pads && !thrown.normal_force) add_opening(card, card_file, assumed, collect);
  add_object(sku, assumed, collect);
  if (const auto mu = card.parameters.find("mu"); mu != card.parameters.end())
    collect.input({"surface",
                   "-",
                   mu->second.value,
                   assumed.other_surface * mu->second.value,
                   InputSource::assumed,
                   "throws of an object with this surface for the card",
                   {{collect.value("mu", mu->second.value), 1}}});
  out.covariance = covariance_of(out.inputs, card);
  if (!card_tells) out.notes.push_back("the card tells no uncertainty of its parameters (`unhand fit` does)");
  return out;
}

}  // namespace unhand::fitting
