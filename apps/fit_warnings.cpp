// Where the answer of `unhand fit` is not to be trusted as it is.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "apps/fit.hpp"
#include "dynamics/median.hpp"

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

/// Places of values that no other resembles: 25 robust sigmas from the median; none where more than an
/// eighth are, or of fewer than eight.
std::vector<std::size_t> unlike_others(const std::vector<double>& values) {
  constexpr double kFar = 25;  // conditions differ manyfold in what a model errs by
  if (values.size() < 8) return {};
  const double middle = dynamics::median(values);
  std::vector<double> away;
  for (const double x : values) away.push_back(std::abs(x - middle));
  const double far = kFar * 1.4826 * dynamics::median(away);
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < away.size(); ++i)
    if (away[i] > far && far > 0) out.push_back(i);
  return 8 * out.size() > values.size() ? std::vector<std::size_t>{} : out;
}

/// Throws, fitted or held out, whose outcome errs as no other's does: a line for each quantity.
std::vector<std::string> strays(const FitAnswer& a) {
  std::vector<std::string> out;
  for (std::size_t q = 0; q < experiment::kQuantityCount; ++q) {
    std::vector<const experiment::ThrowComparison*> judged;
    std::vector<double> errors;
    for (const auto& one : a.throws)
      if (const auto error = one.comparison.error[q])
        judged.push_back(&one.comparison), errors.push_back(*error);
    std::vector<std::string> names;
    for (const std::size_t i : unlike_others(errors))
      names.push_back(fmt::format("{}{} ({:+.3g})", judged[i]->id,
                                  judged[i]->split == datasets::Split::test ? ", held out" : "", errors[i]));
    if (!names.empty())
      out.push_back(
          fmt::format("{} errs as in no other throw in {}: throws that went wrong, or were written down "
                      "wrongly? The errors that are told include them",
                      experiment::kQuantities[q].title, fmt::join(names, "; ")));
  }
  return out;
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
    out.push_back(
        fmt::format("{} ({}) is off by {:.0f} sigma{}: {}. {}", to_string(m.channel), to_string(m.phase),
                    std::sqrt(m.chi2_per_sample()), of_one ? ", nearly all of it in one throw" : "",
                    m.weight < kHardly ? "it hardly counts in the fit" : "it counts in the fit",
                    of_one ? "A reading that went wrong?"
                           : "Another unit, clock or frame, throws that went wrong, or not this model?"));
  }
  if (const auto chi2 = a.fit.chi2_per_dof(); chi2 && *chi2 > kPoorFit && !is_of_single_throws(a.fit))
    out.push_back(fmt::format(
        "chi2 per degree of freedom is {:.3g}: something is missing in {} or wrong in the log, and "
        "it bends the parameters, which no interval tells; ask unhand discover",
        *chi2, request.model));
  if (const auto chi2 = a.fit.chi2_per_dof(); chi2 && *chi2 > kPoorFit && !a.understated.empty())
    out.push_back(fmt::format("noise is declared too small, which chi2 takes for misfit: {}",
                              fmt::join(a.understated, "; ")));
  for (const std::string& stray : strays(a)) out.push_back(stray);
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
