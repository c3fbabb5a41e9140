#include "experiment/model.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <stdexcept>

#include "datasets/near_miss.hpp"

namespace unhand::experiment {
namespace {

/// For models that do not follow the pads.
class NoForce final : public contact::NormalForce {
 public:
  double at(const dynamics::Window&, double) const override { return 0; }
  dynamics::Dual at(const dynamics::Window&, const dynamics::Dual&) const override {
    return dynamics::Dual(0.0);
  }
  void kinks(std::vector<double>&) const override {}
  void kinks(std::vector<dynamics::Dual>&) const override {}
  double release_time() const override { return 0; }
};
const NoForce kNoForce;

contact::Patch<double> patch_of(const ModelParameters& p) {
  return contact::Patch<double>::of_length(p.mu, p.length, p.pads);
}

const contact::NormalForce& force_of(const PreparedThrow& throw_) {
  if (throw_.normal_force) return *throw_.normal_force;
  if (throw_.told_force) return *throw_.told_force;
  return kNoForce;
}

void require_force(const PreparedThrow& throw_, const std::string& model) {
  if (throw_.normal_force || throw_.told_force) return;
  throw std::invalid_argument(
      fmt::format("throw {}: {} needs the normal force, which was not measured (no ft group); a card of "
                  "`unhand fit` on throws "
                  "without it tells how the pads open",
                  throw_.id, model));
}

}  // namespace

std::vector<std::string> release_model_names() {
  auto names = contact::contact_model_names();
  names.emplace_back(release::kNaiveModel);
  return names;
}

void require_release_model(const std::string& name) {
  const auto names = release_model_names();
  if (std::find(names.begin(), names.end(), name) == names.end())
    throw std::invalid_argument(
        datasets::unknown_name(fmt::format("there is no model '{}'", name), name, names));
}

std::unique_ptr<contact::ContactModel> contact_model_for(const PreparedThrow& throw_,
                                                         const std::string& model, const ModelParameters& p) {
  if (model == release::kNaiveModel) return nullptr;
  if (contact::follows_pads(model)) require_force(throw_, model);
  return contact::make_contact_model(model,
                                     contact::ContactParameters<double>{.patch = patch_of(p),
                                                                        .law_values = p.law_values,
                                                                        .open_command = throw_.open_command,
                                                                        .delay = p.delay.centre});
}

release::ReleaseProblem<double> release_problem(const PreparedThrow& throw_,
                                                const contact::ContactModel& contact) {
  return {
      throw_.hand, force_of(throw_), contact, throw_.body, throw_.gravity, throw_.grasp, throw_.start, {}, 0};
}

Prediction predict(const PreparedThrow& throw_, const std::string& model, const ModelParameters& parameters,
                   const dynamics::IntegratorOptions& options) {
  require_release_model(model);
  Prediction out;
  if (const auto contact = contact_model_for(throw_, model, parameters)) {
    const auto result = release::simulate_release(release_problem(throw_, *contact), {options, false});
    out.release = result.outcome;
    out.detach = result.detach;
    out.events = static_cast<int>(result.events.size());
    out.slips_at_start = result.slips_at_start;
  } else {
    require_force(throw_, model);
    const contact::GripperDelay unused(0, dynamics::Dual(0.0));
    const auto result = release::simulate_release_naive(release_problem(throw_, unused), patch_of(parameters),
                                                        parameters.naive);
    out.release = result.outcome;
    out.detach = result.detach;
    out.events = result.reversals;
  }
  if (out.release != release::ReleaseOutcome::detached) return out;
  const auto flown = flight::fly(flight::FlightProblem<double>{
      out.detach.pose, out.detach.twist, throw_.gravity, throw_.drag_k, throw_.landing_height, {}, 30});
  out.flight = flown.outcome;
  out.landing = flown.landing;
  return out;
}

}  // namespace unhand::experiment
