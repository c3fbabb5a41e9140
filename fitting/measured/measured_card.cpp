#include "fitting/measured/measured_card.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "fitting/card.hpp"
#include "fitting/measured/fall_discovery.hpp"
#include "fitting/measured/flight_discovery.hpp"

namespace unhand::fitting {

using datasets::CardError;
using datasets::ModelCard;
using datasets::Split;

namespace {

constexpr const char *kFlights = "projectile", *kFalls = "free_fall";

/// The card's effects and their values, as a fit would have them.
GroupedFit given_by(const ModelCard& card, const std::string& file, const GroupedProblem& problem) {
  GroupedFit out;
  std::vector<double> values;
  std::set<std::string> read;
  const auto known = problem.effects();
  for (const auto& id : card.effects) {
    const auto effect =
        std::find_if(known.begin(), known.end(), [&](const dynamics::Effect& e) { return e.id == id; });
    if (effect == known.end()) {
      std::vector<std::string> ids;
      for (const auto& e : known) ids.push_back(e.id);
      throw CardError(
          file, "/effects",
          fmt::format("{} does not act on this log's throws; what does is {}", id, fmt::join(ids, ", ")));
    }
    for (auto& p : shared_parameters(*effect, objects_of(problem))) {
      const auto found = card.parameters.find(p.name);
      if (found == card.parameters.end())
        throw CardError(file, "/parameters/" + p.name,
                        fmt::format("is missing: {} takes it on this log", id));
      require_parameter(file, p.name, found->second, p.unit, p.low, p.high);
      values.push_back(found->second.value);
      out.shared.push_back(std::move(p));
    }
  }
  for (const auto& [name, ignored] : card.parameters)
    if (std::none_of(card.effects.begin(), card.effects.end(),
                     [&](const std::string& id) { return name.starts_with(id + "."); }))
      throw CardError(file, "/parameters/" + name, "is of none of the card's effects");
  out.values = Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  return out;
}

/// `errors` names those of a fit.
template <class Errors>
CardComparison compared(const GroupedProblem& problem, const GroupedFit& card, int threads,
                        const Errors& errors) {
  GroupedFitOptions options;
  options.threads = threads;
  CardComparison out;
  out.skipped = problem.skipped();
  const auto of = [&](const GroupedFit& model, Split split, int& groups,
                      std::vector<ResidualProfile>& profile) {
    const GroupedFit fit = fit_own(problem, split, model, options);
    groups = fit.used;
    if (fit.used > 0) profile = residual_profile(problem, fit);  // of the held-out ones, which come last
    return fit.used > 0 ? errors(fit) : NamedErrors{};
  };
  const GroupedFit base;
  out.base_train = of(base, Split::train, out.train, out.base_profile);
  out.base_test = of(base, Split::test, out.test, out.base_profile);
  out.card_train = of(card, Split::train, out.train, out.card_profile);
  out.card_test = of(card, Split::test, out.test, out.card_profile);
  return out;
}

}  // namespace

bool is_of_free_motion(const ModelCard& card) { return card.model == kFlights || card.model == kFalls; }

CardComparison compare_with_card(const ModelCard& card, const std::string& file,
                                 const datasets::ThrowLog& log, int threads) {
  CardComparison out;
  if (card.model == kFlights) {
    const FlightProblem problem(log, threads);
    out = compared(problem, given_by(card, file, problem), threads,
                   [&](const GroupedFit& fit) { return named_errors(problem, fit, threads); });
    out.kind = "free flights";
  } else if (card.model == kFalls) {
    const FallProblem problem(log);
    out = compared(problem, given_by(card, file, problem), threads,
                   [&](const GroupedFit& fit) { return named_errors(problem, fit); });
    out.kind = "falls";
  } else {
    throw CardError(file, "/model", fmt::format("'{}' is neither {} nor {}", card.model, kFlights, kFalls));
  }
  return out;
}

}  // namespace unhand::fitting
