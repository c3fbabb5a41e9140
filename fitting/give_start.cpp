#include "fitting/give_start.hpp"

#include <algorithm>

namespace unhand::fitting {

namespace {

/// Some of the throws that a fit used, spread over the log.
std::vector<bool> some_of(std::span<const ThrowFit> throws) {
  constexpr std::size_t kSome = 12;
  const auto used = static_cast<std::size_t>(
      std::count_if(throws.begin(), throws.end(), [](const ThrowFit& t) { return t.used; }));
  const std::size_t every = std::max<std::size_t>(1, used / kSome);
  std::vector<bool> out;
  std::size_t n = 0;
  for (const ThrowFit& one : throws) out.push_back(one.used && n++ % every == 0);
  return out;
}

struct Give {
  double length, loss;  // [m] at the friction limit, [s]
};

std::vector<Give> gives_to_try() {
  constexpr double kLeast = 0.7e-6, kMost = 16e-6, kFinely = 1.3, kRings = 1e-3, kDamped = 5e-3;
  std::vector<Give> out{{1e-6, kDamped}, {3e-6, kDamped}, {9e-6, kDamped}};
  for (double length = kLeast; length < kMost; length *= kFinely) out.push_back({length, kRings});
  return out;
}

}  // namespace

double give_per_compliance(const CampaignProblem& problem, std::span<const double> values) {
  double mu = 0.5;
  for (std::size_t k = 0; k < values.size(); ++k)
    if (problem.campaign()[k].name == "mu") mu = values[k];
  return problem.model().pads * mu * problem.model().reference_force;
}

std::optional<std::vector<double>> likelier_give(const CampaignProblem& problem,
                                                 const std::vector<double>& values,
                                                 std::span<const ThrowFit> fitted,
                                                 const FitOptions& options) {
  FitOptions held;
  held.share = options.share;
  held.threads = options.threads;
  held.throws = some_of(fitted);
  held.weigh = Weigh::variances;
  held.all_fixed = true;
  held.rounds = 1, held.iterations = 3;
  held.start = values;
  const FitResult given = fit(problem, held);
  std::optional<std::vector<double>> best;
  double least = given.is_answer() ? given.deviance() : HUGE_VAL;
  for (const Give& give : gives_to_try()) {
    for (std::size_t k = 0; k < values.size(); ++k) {
      const Unknown& u = problem.campaign()[k];
      if (u.name == "contact.pad_compliance.compliance")
        held.start[k] = std::clamp(give.length / give_per_compliance(problem, values), u.low, u.high);
      if (u.name == "contact.pad_compliance.loss_time") held.start[k] = give.loss;
    }
    const FitResult tried = fit(problem, held);
    if (tried.is_answer() && tried.deviance() < least) least = tried.deviance(), best = held.start;
  }
  return best;
}

}  // namespace unhand::fitting
