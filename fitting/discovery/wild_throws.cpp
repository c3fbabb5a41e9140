#include "fitting/discovery/wild_throws.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "dynamics/parallel.hpp"
#include "fitting/discovery/footprint_columns.hpp"

namespace unhand::fitting {

namespace {

/// The footings of a fit's throws, by columns that may be of another fit of the same problem.
void add_footings(const FootprintColumns& columns, const CampaignProblem& problem, const FitResult& fit,
                  int threads, std::vector<GroupFooting>& to) {
  std::vector<GroupFooting> of(fit.throws.size());
  dynamics::parallel_for(of.size(), threads, [&](std::size_t i) {
    if (!fit.throws[i].used) return;
    const CampaignThrow& thrown = problem.throws()[i];
    auto gram = columns.gram(thrown, fit.throws[i].own);
    if (!gram.solved) return;
    of[i] = {i, thrown.prepared.split == datasets::Split::train,
             static_cast<double>(thrown.observed.all.size()), std::move(gram.products)};
  });
  for (GroupFooting& one : of)
    if (one.n > 0 && one.misfit() > 0) to.push_back(std::move(one));
}

/// The spreads of a fit's throws for the same throws and others beside them, which may show another own
/// unknown.
std::vector<double> spreads_for(const CampaignProblem& problem, const CampaignProblem& fitted,
                                const FitResult& fit) {
  std::vector<double> out;
  for (const Unknown& u : problem.own()) {
    const auto same = std::find_if(fitted.own().begin(), fitted.own().end(),
                                   [&](const Unknown& other) { return other.name == u.name; });
    out.push_back(same == fitted.own().end()
                      ? u.prior_sigma.value_or(u.scale)
                      : fit.own_spread[static_cast<std::size_t>(same - fitted.own().begin())]);
  }
  return out;
}

}  // namespace

std::vector<WildGroup> wild_throws(const Stage& stage, const DiscoverOptions& options) {
  FootprintColumns columns(stage.problem, stage.fit);
  columns.add_effects(catalogue(options));
  for (const auto& law : options.laws) columns.add_law(law);
  std::vector<GroupFooting> footings;
  for (const FitResult* fit : {&stage.fit, &stage.held_out})
    add_footings(columns, stage.problem, *fit, options.fit.threads, footings);
  auto wild = gross_outliers(footings, options.fit.throw_limit);
  const auto condition_of = [&](std::size_t i) {
    const auto& prepared = stage.problem.throws()[i].prepared;
    return std::pair(prepared.object, prepared.condition);
  };
  std::map<std::pair<std::string, std::string>, std::pair<int, int>> conditions;  // wild throws; others
  for (const GroupFooting& one : footings) {
    auto& [strays, others] = conditions[condition_of(one.group)];
    ++(is_among(wild, one.group) ? strays : others);
  }
  std::erase_if(wild, [&](const WildGroup& one) {
    const auto& [strays, others] = conditions.at(condition_of(one.group));
    return strays > 1 && others == 0;
  });
  return wild;
}

std::string told(const WildGroup& wild, const Stage& stage) {
  const FitResult& fit = stage.fit.throws[wild.group].used ? stage.fit : stage.held_out;
  const CampaignThrow& thrown = stage.problem.throws()[wild.group];
  const auto l =
      stage.problem.linearise(thrown, stage.fit.values(), fit.throws[wild.group].own, DerivativesBy::nothing);
  std::map<experiment::Channel, double> chi2;
  for (Eigen::Index j = 0; j < l.residual.size(); ++j)
    chi2[thrown.observed.all[static_cast<std::size_t>(j)].channel] += l.residual[j] * l.residual[j];
  const auto most = std::max_element(chi2.begin(), chi2.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return fmt::format("set aside: {}{}", wild.in_words(),
                     most == chi2.end() ? ""
                                        : fmt::format("; by the base model most of it in {}",
                                                      experiment::to_string(most->first)));
}

std::vector<WildGroup> still_wild(const CampaignProblem& answer, const FitResult& fitted,
                                  const CampaignProblem& all, const std::vector<WildGroup>& wild,
                                  const DiscoverOptions& options) {
  const CampaignProblem problem = all.with(answer.options().model, answer.options().effects);
  FitOptions own = options.fit;
  own.share = Share::all, own.all_fixed = true, own.throws.clear();
  own.start = carried(fitted, problem), own.own_spread = spreads_for(problem, answer, fitted);
  const FitResult every = fit(problem, own);
  if (!every.is_answer()) return wild;
  std::vector<GroupFooting> footings;
  add_footings(FootprintColumns(problem, every), problem, every, options.fit.threads, footings);
  return still_gross(wild, footings, options.fit.throw_limit);
}

datasets::ThrowLog without_throws(datasets::ThrowLog log, const std::vector<WildGroup>& wild) {
  std::vector<std::size_t> places;
  for (const WildGroup& one : wild) places.push_back(one.group);
  std::sort(places.begin(), places.end());
  for (auto place = places.rbegin(); place != places.rend(); ++place)
    log.throws.erase(log.throws.begin() + static_cast<std::ptrdiff_t>(*place));
  return log;
}

}  // namespace unhand::fitting
