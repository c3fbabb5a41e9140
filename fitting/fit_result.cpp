// Names, and what a fit's result answers by itself.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "fitting/fit.hpp"

namespace unhand::fitting {

using experiment::Channel;

std::string_view to_string(Phase phase) {
  constexpr std::string_view kNames[kPhaseCount] = {"grasped", "release", "flight", "landing"};
  return kNames[static_cast<int>(phase)];
}

const char* to_string(FitOutcome outcome) {
  constexpr const char* kNames[] = {"converged", "iterations_spent", "no_start", "not_solved"};
  return kNames[static_cast<int>(outcome)];
}

Phase phase_of(const experiment::Observation& o, double opening, double release) {
  if (o.channel == Channel::landing_x || o.channel == Channel::landing_theta ||
      o.channel == Channel::landing_time)
    return Phase::landing;
  if (o.time < opening) return Phase::grasped;
  return o.time < release ? Phase::release : Phase::flight;
}

bool FitResult::is_answer() const {
  return outcome == FitOutcome::converged || outcome == FitOutcome::iterations_spent;
}

std::string FitResult::why_not() const {
  std::map<std::string, int> reasons;
  for (const ThrowFit& one : throws)
    if (!one.why_not.empty()) ++reasons[one.why_not];
  const auto most = std::max_element(reasons.begin(), reasons.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == reasons.end() ? "" : fmt::format("{} ({} throws)", most->first, most->second);
}

double FitResult::deviance() const {
  double out = 0;
  for (const auto& m : misfit) {
    const double variance = std::max(1.0, m.chi2_per_sample());
    out += m.n * std::log(variance) + m.chi2 / variance;
  }
  return out;
}

std::vector<double> FitResult::values() const {
  std::vector<double> out;
  for (const auto& u : campaign) out.push_back(u.value);
  return out;
}

double FitResult::correlation(std::size_t i, std::size_t j) const {
  const std::size_t n = campaign.size();
  if (i >= n || j >= n)
    throw std::out_of_range(fmt::format("correlation: {} of {} unknowns", std::max(i, j), n));
  if (covariance.empty()) return 0;
  const double scale = std::sqrt(covariance[i * n + i] * covariance[j * n + j]);
  return scale > 0 ? covariance[i * n + j] / scale : 0;
}

void require_fit_of(const CampaignProblem& problem, const FitResult& fit) {
  const auto& unknowns = problem.campaign();
  const bool same =
      std::equal(unknowns.begin(), unknowns.end(), fit.campaign.begin(), fit.campaign.end(),
                 [](const Unknown& a, const FittedUnknown& b) { return a.name == b.unknown.name; });
  const auto names = [](const auto& list, const auto& name_of) {
    std::string out;
    for (const auto& one : list) out += (out.empty() ? "" : ", ") + name_of(one);
    return out.empty() ? std::string("none") : out;
  };
  if (!same || fit.own_spread.size() > problem.own().size())
    throw std::invalid_argument(
        fmt::format("the fit is of another problem: its unknowns are {}, and the problem's {}",
                    names(fit.campaign, [](const FittedUnknown& u) { return u.unknown.name; }),
                    names(unknowns, [](const Unknown& u) { return u.name; })));
  if (!fit.is_answer())
    throw std::invalid_argument(
        fmt::format("the fit is no answer ({}): {}", to_string(fit.outcome), fit.message));
}

bool OpenDirection::moves(std::size_t k) const {
  constexpr double kTakesPart = 0.2, kRounding = 1e-3;
  const double part = std::abs(direction[k]);
  return part >= kTakesPart || (part > kRounding && part * sigma >= kOpen);
}

bool is_determined(const FitResult& fit, std::size_t k) {
  const FittedUnknown& u = fit.campaign[k];
  return u.data_sigma < u.unknown.high - u.unknown.low &&
         std::none_of(fit.open.begin(), fit.open.end(),
                      [&](const OpenDirection& open) { return open.moves(k); });
}

}  // namespace unhand::fitting
