#include "planners/tube/release_card.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <stdexcept>

#include "contact/registry.hpp"
#include "datasets/near_miss.hpp"

namespace unhand::planners {

const char* to_string(NumberSource source) {
  switch (source) {
    case NumberSource::assumed:
      return "assumed";
    case NumberSource::parameter:
      return "card";
    case NumberSource::range:
      return "card's range";
    case NumberSource::widened:
      return "assumed and card";
  }
  return "?";
}

namespace {

using datasets::CardError;

/// The numbers of a card, each into its place.
class CardReader {
 public:
  CardReader(const datasets::ModelCard& card, const std::string& file, ReleaseCard& out)
      : card_(card), file_(file), out_(out) {}

  void take(const char* name, const char* unit, double least, bool open, double most, double& value,
            double* sigma = nullptr) {
    known_.emplace_back(name);
    const auto found = card_.parameters.find(name);
    if (found == card_.parameters.end()) return;
    const std::string path = fmt::format("/parameters/{}", name);
    const datasets::CardParameter& told = found->second;
    if (told.unit != unit)
      throw CardError(file_, path + "/unit", fmt::format("is '{}', not '{}'", told.unit, unit));
    require(path + "/value", told.value, least, open, most);
    value = told.value;
    auto& origin = out_.origins[name] = {NumberSource::parameter, NumberSource::assumed};
    if (sigma == nullptr && told.sigma.value_or(0) > 0) out_.passed_over.emplace_back(name);
    if (sigma == nullptr || !told.sigma) return;
    *sigma = *told.sigma;
    origin.sigma = NumberSource::parameter;
  }

  /// The same, else from the valid range. `least_sigma` of what that tells.
  void take_or_range(const char* name, const char* unit, bool positive, double& value, double& sigma,
                     double least_share, double least_sigma) {
    take(name, unit, 0, positive, HUGE_VAL, value, &sigma);
    if (card_.parameters.contains(name)) return;
    const auto seen = datasets::middle_of_range(card_, file_, name, unit);
    if (!seen) return;
    require(fmt::format("/valid_range/{}", name), seen->value, 0, positive, HUGE_VAL);
    value = seen->value;
    sigma = std::max({*seen->sigma, least_share * seen->value, least_sigma});
    out_.origins[name] = {NumberSource::range, NumberSource::range};
  }

  /// σ of a spread from throw to throw, which comes on top of `base`; 0 where the card has none.
  double spread(const char* name, const char* unit, const char* adds_to, double base) {
    spreads_.emplace_back(name);
    const auto found = card_.own_spreads.find(name);
    if (found == card_.own_spreads.end()) return 0;
    if (found->second.unit != unit)
      throw CardError(file_, fmt::format("/own_spreads/{}/unit", name),
                      fmt::format("is '{}', not '{}'", found->second.unit, unit));
    NumberOrigin& origin = out_.origins[adds_to];
    if (origin.sigma == NumberSource::assumed)
      origin.sigma = base > 0 ? NumberSource::widened : NumberSource::parameter;
    if (found->second.sigma > 0 && adds_to != std::string_view(name)) origin.with.emplace_back(name);
    return found->second.sigma;
  }

  /// What the card's effects make of friction.
  contact::FrictionVariation<double> friction() {
    std::vector<std::string> names;
    std::vector<double> values;
    for (const std::string& id : card_.effects)
      if (const dynamics::Effect* effect = taken_effect(id))
        for (const auto& p : effect->parameters) {
          names.push_back(effect->full_name(p));
          values.push_back(p.neutral);
          take(names.back().c_str(), p.unit.c_str(), p.least.value_or(p.low), false, p.high, values.back());
        }
    contact::FrictionVariation<double> out;
    dynamics::apply_effects(contact::friction_effects(),
                            dynamics::Values<double>(std::span<const std::string>(names), values), out);
    take("reference_force", "N", 0, true, HUGE_VAL, out.reference_force);
    try {
      contact::validate(contact::constant(out));
    } catch (const std::invalid_argument& error) {
      throw CardError(file_, "/parameters", error.what());
    }
    return out;
  }

  /// Notes an effect on friction and gives its descriptor; null for those of sensors, of what a log measured
  /// or declared, whose parameters are passed over.
  const dynamics::Effect* taken_effect(const std::string& id) {
    for (const auto& one : contact::friction_effects())
      if (one.effect.id == id) {
        out_.effects.push_back(id);
        return &one.effect;
      }
    if (!id.starts_with("sensor."))
      throw CardError(file_, "/effects",
                      fmt::format("plans of throws take effects on friction, and pass over those of sensors; "
                                  "this card has {}",
                                  id));
    for (const auto& [name, ignored] : card_.parameters)
      if (name.starts_with(id + ".")) known_.push_back(name);
    return nullptr;
  }

  /// A spread that is right on any card of the model and moves nothing here.
  void pass_over_spread(const char* name) { spreads_.emplace_back(name); }

  void reject_unknown() const {
    for (const auto& [name, ignored] : card_.parameters)
      if (std::find(known_.begin(), known_.end(), name) == known_.end())
        throw CardError(file_, "/parameters/" + name,
                        fmt::format("is not what plans of throws take of a card of {}: {}", card_.model,
                                    fmt::join(known_, ", ")));
    for (const auto& [name, ignored] : card_.own_spreads)
      if (std::find(spreads_.begin(), spreads_.end(), name) == spreads_.end())
        throw CardError(
            file_, "/own_spreads/" + name,
            fmt::format("is not what plans of throws take of a card: {}", fmt::join(spreads_, ", ")));
  }

  /// The card's covariance of two parameters; 0 where it does not tell.
  double covariance(const char* a, const char* b) const {
    if (!card_.covariance) return 0;
    const auto& names = card_.covariance->names;
    const auto i = static_cast<std::size_t>(std::find(names.begin(), names.end(), a) - names.begin()),
               j = static_cast<std::size_t>(std::find(names.begin(), names.end(), b) - names.begin());
    return i < names.size() && j < names.size() ? card_.covariance->matrix[i * names.size() + j] : 0;
  }

 private:
  void require(const std::string& path, double value, double least, bool open, double most) const {
    if (!std::isfinite(value) || value < least || (open && value == least) || value > most)
      throw CardError(file_, path,
                      fmt::format("is {}; accepted: {}{}, {}{}", value, open ? '(' : '[', least, most,
                                  std::isfinite(most) ? ']' : ')'));
  }

  const datasets::ModelCard& card_;
  const std::string& file_;
  ReleaseCard& out_;
  std::vector<std::string> known_, spreads_;
};

}  // namespace

ReleaseCard release_card(const datasets::ModelCard& card, const std::string& file,
                         const ReleaseCard& otherwise) {
  const auto laws = contact::pad_law_names();
  if (std::find(laws.begin(), laws.end(), card.model) == laws.end())
    throw CardError(file, "/model",
                    datasets::unknown_name(fmt::format("'{}' does not say how the pads let go", card.model),
                                           card.model, laws));
  ReleaseCard out = otherwise;
  out.model = card.model;
  out.law_values.clear();
  out.effects.clear();
  out.passed_over.clear();
  CardReader reader(card, file, out);
  reader.take("mu", "-", 0, true, contact::kMostMu, out.mu.value, &out.mu.sigma);
  reader.take("length", "m", 0, true, contact::kUniformDisc, out.length, &out.length_sigma);
  for (const auto& own : contact::law_parameters(card.model)) {
    if (!card.parameters.contains(own.name)) continue;
    double value = own.start;
    reader.take(own.name.c_str(), own.unit.c_str(), own.low, false, own.high, value);
    out.law_values[own.name] = value;
  }
  constexpr int kMostPads = 1000;
  double pads = out.pads;
  reader.take("pads", "-", 0, true, HUGE_VAL, pads);
  if (pads != std::floor(pads) || pads > kMostPads)
    throw CardError(file, "/parameters/pads/value",
                    fmt::format("is {}; accepted: whole numbers from 1 to {}", pads, kMostPads));
  out.pads = static_cast<int>(pads);
  double force_sigma = 0;
  reader.take_or_range("grip_force", "N", true, out.grip_force, force_sigma, kLeastForceSigma, 0);
  reader.take_or_range("dead_time", "s", false, out.dead_time.value, out.dead_time.sigma, 0,
                       kLeastOpeningSigma);
  reader.take_or_range("opening_time", "s", true, out.opening_time.value, out.opening_time.sigma, 0,
                       kLeastOpeningSigma);
  reader.take_or_range("shape", "-", true, out.shape, out.shape_sigma, 0, 0);
  out.friction = reader.friction();
  reader.pass_over_spread("force_deviation");
  reader.pass_over_spread("grasp_across");  // plans hold objects on their axis
  // Friction's limits know the product of mu and the force alone, of which a card without a measured force
  // knows more than of either.
  const double mu = out.mu.value, per_newton = mu / out.grip_force;
  const double variance = std::pow(out.mu.sigma, 2) + std::pow(per_newton * force_sigma, 2) +
                          2 * per_newton * reader.covariance("mu", "grip_force");
  if (force_sigma > 0) {
    NumberOrigin& origin = out.origins["mu"];
    if (origin.sigma == NumberSource::assumed) origin.sigma = NumberSource::widened;
    origin.with.emplace_back("grip_force");
    out.origins["grip_force"].counted_in = "mu";
  }
  out.mu.sigma = std::sqrt(std::max(0.0, variance));
  out.mu.sigma = std::hypot(out.mu.sigma, mu * reader.spread("mu_deviation", "-", "mu", out.mu.sigma));
  out.dead_time.sigma = std::hypot(
      out.dead_time.sigma, reader.spread("dead_time_deviation", "s", "dead_time", out.dead_time.sigma));
  out.grasp_offset = reader.spread("grasp_offset", "m", "com_offset", 0);
  out.grasp_angle = reader.spread("grasp_angle", "rad", "grasp_angle", 0);
  reader.reject_unknown();
  return out;
}

}  // namespace unhand::planners
