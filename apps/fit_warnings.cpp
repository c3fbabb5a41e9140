// Where the answer of `unhand fit` is not to be trusted as it is.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "apps/fit.hpp"

namespace unhand::apps {
namespace {

constexpr double kWildMisfit = 900;  ///< χ² per sample of a channel that is told of: 30 σ
constexpr double kPoorFit = 2;   ///< χ² per degree of freedom from which parameters are not to be trusted
constexpr double kHardly = 0.7;  ///< weight of a channel that the fit does not believe

/// Whether each channel but for the throw that errs most in it leaves a good fit.
bool is_of_single_throws(const fitting::FitResult& fit) {
  double chi2 = 0, n = 0;
  for (const auto& m : fit.misfit) {
    const auto rest = m.without_worst();
    chi2 += rest.chi2, n += rest.n;
  }
  return chi2 < kPoorFit * n;
}

}  // namespace

std::vector<std::string> fit_warnings(const FitAnswer& a, const FitRequest& request) {
  std::vector<std::string> out, left_out, disbelieved;
  for (std::size_t i = 0; i < a.throws.size(); ++i)
    if (a.throws[i].comparison.split == datasets::Split::train && !a.fit.throws[i].used)
      left_out.push_back(a.fit.throws[i].id);
  if (!left_out.empty())
    out.push_back(fmt::format(
        "fitted without {} of the train throws, which {} cannot simulate or which show nothing: {}",
        left_out.size(), request.model, fmt::join(left_out, ", ")));
  if (a.fit.outcome == fitting::FitOutcome::iterations_spent)
    out.push_back("the fit stopped before it had converged: " + a.fit.message);
  for (const auto& m : a.fit.misfit) {
    if (!(m.chi2_per_sample() > kWildMisfit)) continue;
    const bool of_one = m.without_worst().chi2_per_sample() < kPoorFit;
    out.push_back(fmt::format(
        "{} ({}) is off by {:.0f} sigma{}: it hardly counts in the fit. {}", to_string(m.channel),
        to_string(m.phase), std::sqrt(m.chi2_per_sample()), of_one ? ", nearly all of it in one throw" : "",
        of_one ? "A reading that went wrong?" : "Another unit, clock or frame, or not this model?"));
  }
  if (const auto chi2 = a.fit.chi2_per_dof(); chi2 && *chi2 > kPoorFit && !is_of_single_throws(a.fit))
    out.push_back(fmt::format(
        "chi2 per degree of freedom is {:.3g}: something is missing in {} or wrong in the log, and "
        "it bends the parameters, which no interval tells; ask unhand discover",
        *chi2, request.model));
  // No friction law acts in the firm grasp: what the model does not explain there is the object (its mass,
  // its inertia), the sensor, or pads that give.
  for (const auto& m : a.fit.misfit)
    if (m.phase == fitting::Phase::grasped && is_wrench(m.channel) && m.weight < kHardly)
      disbelieved.push_back(fmt::format("{} (weight {:.2f})", to_string(m.channel), m.weight));
  if (!disbelieved.empty())
    out.push_back(fmt::format(
        "in the firm grasp, where no friction acts, the model does not follow {}: a mass or an "
        "inertia declared wrong, the sensor, or pads that give. It bends the parameters, which no "
        "interval tells; ask unhand discover",
        fmt::join(disbelieved, ", ")));
  return out;
}

}  // namespace unhand::apps
