// Names, and what a fit's result answers by itself.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>

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
  const double scale = std::sqrt(covariance[i * n + i] * covariance[j * n + j]);
  return scale > 0 ? covariance[i * n + j] / scale : 0;
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
