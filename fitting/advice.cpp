#include "fitting/advice.hpp"

#include <algorithm>
#include <cmath>

#include "contact/registry.hpp"
#include "experiment/campaign_effects.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

bool has(const CampaignProblem& problem, Channel channel) {
  for (const auto& t : problem.throws())
    for (const auto& o : t.observed.all)
      if (o.channel == channel) return true;
  return false;
}

bool all_forces(const CampaignProblem& problem) {
  return std::all_of(problem.throws().begin(), problem.throws().end(),
                     [](const CampaignThrow& t) { return t.prepared.normal_force.has_value(); });
}

/// For one unknown by its name; what the log has already is not asked for again.
std::string remedy_for(const CampaignProblem& problem, const std::string& name) {
  const bool wrench = has(problem, Channel::wrench_fx) || has(problem, Channel::wrench_fz),
             torque = has(problem, Channel::wrench_tau), mocap = has(problem, Channel::mocap_x);
  if (name == "mu" || name == "grip_force") {
    if (!all_forces(problem))
      return "the pads' normal force: without it mu and grip_force enter as their product";
    if (!wrench) return "the tangential force behind a pad while the gripper opens";
    return "throws whose pads slip while the normal force is still well above its noise (a slower opening)";
  }
  if (name == "length") {
    if (!torque) return "the torque behind a pad while the gripper opens";
    return "throws in which the object pivots in the grip: a CoM further from the pads";
  }
  for (const auto& p : contact::law_parameters(problem.options().model))
    if (name == p.name && !p.remedy.empty()) return p.remedy;
  if (name == "dead_time" || name == "opening_time" || name == "shape")
    return "the pads' normal force while they open";
  if (name == "delay")
    return mocap ? "throws with the landing measured, or with a faster hand" : "motion capture of the flight";
  const std::string bare = experiment::without_object(name);
  if (const auto* parameter = experiment::find_parameter(bare); parameter && !parameter->remedy.empty())
    return parameter->remedy;
  if (const auto* effect = experiment::effect_of(bare); effect && !effect->remedy.empty())
    return mocap || effect->untracked_remedy.empty() ? effect->remedy : effect->untracked_remedy;
  return "throws in which the pads slip for longer and at other speeds and forces: other accelerations, a "
         "slower opening";
}

}  // namespace

std::string remedy(const CampaignProblem& problem, const OpenDirection& open) {
  std::vector<std::string> said;
  std::string out;
  for (std::size_t k = 0; k < open.direction.size() && k < problem.campaign().size(); ++k) {
    if (!open.moves(k)) continue;
    auto one = remedy_for(problem, problem.campaign()[k].name);
    if (std::find(said.begin(), said.end(), one) != said.end()) continue;
    out += (out.empty() ? "" : "; or ") + one;
    said.push_back(std::move(one));
  }
  return out;
}

std::vector<Correlation> strong_correlations(const FitResult& fit, double limit) {
  std::vector<Correlation> out;
  if (fit.covariance.empty()) return out;
  for (std::size_t i = 0; i < fit.campaign.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (const double r = fit.correlation(i, j); std::abs(r) > limit)
        out.push_back({fit.campaign[j].unknown.name, fit.campaign[i].unknown.name, r});
  std::sort(out.begin(), out.end(),
            [](const Correlation& a, const Correlation& b) { return std::abs(a.value) > std::abs(b.value); });
  return out;
}

}  // namespace unhand::fitting
