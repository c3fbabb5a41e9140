// The answer of `unhand fit` on throws, as JSON.
#include <algorithm>

#include "apps/compare.hpp"
#include "apps/fit.hpp"
#include "fitting/advice.hpp"

namespace unhand::apps {
namespace {

using datasets::Split;

template <class Statistics>
Json errors_json(int n, Statistics&& statistics) {
  Json out{{"n", n}};
  for (int q = 0; q < experiment::kQuantityCount; ++q)
    out[experiment::kQuantities[q].key] = statistics_json(statistics(q));
  return out;
}

Json parameters_json(const fitting::FitResult& fit) {
  Json out = Json::object();
  for (std::size_t k = 0; k < fit.campaign.size(); ++k) {
    const auto& u = fit.campaign[k];
    const auto [low, high] = u.interval95();
    Json& one = out[u.unknown.name] = {{"value", u.value},
                                       {"unit", u.unknown.unit},
                                       {"sigma", number(u.sigma)},
                                       {"interval95", {number(low), number(high)}},
                                       {"data_sigma", number(u.data_sigma)},
                                       {"determined", fitting::is_determined(fit, k)},
                                       {"at_bound", u.at_bound},
                                       {"prior", nullptr}};
    one["profiled"] = u.profile.has_value();
    if (u.unknown.prior_sigma) one["prior"] = {{"mean", u.unknown.start}, {"sigma", *u.unknown.prior_sigma}};
  }
  return out;
}

Json open_json(const FitAnswer& a) {
  Json out = Json::array();
  for (const auto& open : a.fit.open) {
    Json direction = Json::object();
    for (std::size_t k = 0; k < open.direction.size(); ++k)
      direction[a.fit.campaign[k].unknown.name] = open.direction[k] * a.fit.campaign[k].unknown.scale;
    out.push_back({{"meaning", open.meaning},
                   {"direction", direction},
                   {"sigma", number(open.sigma)},
                   {"would_fix_it", fitting::remedy(a.problem, open)}});
  }
  return out;
}

Json throws_json(const FitAnswer& a) {
  Json out = Json::array();
  for (std::size_t i = 0; i < a.fit.throws.size(); ++i) {
    const auto& t = a.fit.throws[i];
    Json own = Json::object();
    for (std::size_t k = 0; k < t.own.size(); ++k) own[a.problem.own()[k].name] = t.own[k];
    out.push_back({{"id", t.id},
                   {"split", to_string(a.throws[i].comparison.split)},
                   {"used", t.used},
                   {"why_not", t.why_not.empty() ? Json(nullptr) : Json(t.why_not)},
                   {"weight", t.weight},
                   {"weighted_chi2", number(t.chi2)},
                   {"own", own}});
  }
  return out;
}

}  // namespace

Json fit_json(const FitAnswer& a, const FitRequest& request) {
  const auto& fit = a.fit;
  Json out = json_head("fit");
  out["log"] = request.log;
  out["checksum"] = nullptr;
  if (const auto sum = fitting::checksum_of(request.log)) out["checksum"] = *sum;
  out["model"] = request.model;
  out["effects"] = request.effects;
  out["settings"] = {{"rtol", request.rtol}, {"kfold", request.kfold}};
  out["outcome"] = to_string(fit.outcome);
  out["message"] = fit.message;
  out["parameters"] = parameters_json(fit);
  Json names = Json::array(), matrix = Json::array();
  for (std::size_t i = 0; i < fit.campaign.size(); ++i) {
    names.push_back(fit.campaign[i].unknown.name);
    Json row = Json::array();
    for (std::size_t j = 0; j < fit.campaign.size(); ++j)
      row.push_back(number(fit.covariance[i * fit.campaign.size() + j]));
    matrix.push_back(std::move(row));
  }
  out["covariance"] = {{"names", names}, {"matrix", matrix}};
  out["intervals"] = {{"clusters", fit.clusters}, {"of", fit.by_conditions ? "conditions" : "throws"}};
  Json& correlations = out["correlations"] = Json::array();
  for (const auto& pair : fitting::strong_correlations(fit))
    correlations.push_back({{"first", pair.first}, {"second", pair.second}, {"value", pair.value}});
  out["open_directions"] = open_json(a);
  Json& spreads = out["own_spreads"] = Json::object();
  for (std::size_t k = 0; k < fit.own_spread.size(); ++k)
    spreads[a.problem.own()[k].name] = {{"sigma", fit.own_spread[k]}, {"unit", a.problem.own()[k].unit}};
  out["chi2"] = {{"value", fit.chi2},
                 {"samples", fit.samples},
                 {"degrees_of_freedom", fit.degrees_of_freedom},
                 {"per_degree_of_freedom", number(fit.chi2_per_dof())}};
  Json& misfit = out["chi2_by_channel"] = Json::array();
  for (const auto& m : fit.misfit)
    misfit.push_back({{"phase", to_string(m.phase)},
                      {"channel", to_string(m.channel)},
                      {"samples", m.n},
                      {"chi2", m.chi2},
                      {"weight", m.weight}});
  out["iterations"] = fit.iterations;
  out["mode_changes"] = fit.mode_changes;
  out["throws"] = throws_json(a);
  out["warnings"] = fit_warnings(a, request);
  out["notes"] = fit_notes(a, request);
  for (const Split split : {Split::train, Split::test}) {
    const auto n = static_cast<int>(std::count_if(a.errors.throws.begin(), a.errors.throws.end(),
                                                  [&](const auto& one) { return one.split == split; }));
    out[to_string(split)] = errors_json(n, [&](int q) { return a.errors.statistics(q, split); });
  }
  out["cross_validation"] = nullptr;
  if (const auto& cv = a.cross_validation) {
    out["cross_validation"] =
        errors_json(static_cast<int>(cv->throws.size()), [&](int q) { return cv->statistics(q); });
    out["cross_validation"]["folds"] = cv->folds;
    out["cross_validation"]["failed_folds"] = cv->failed;
  }
  out["failed"] = a.errors.failed;
  out["time"] = {{"seconds", fit.seconds},
                 {"jacobian_seconds", fit.jacobian_seconds},
                 {"threads", a.threads},
                 {"jacobian_share", a.jacobian_share()}};
  const auto& g = a.gradients;
  out["gradients"] = {{"unknowns", g.unknowns},
                      {"plain_seconds", g.plain},
                      {"exact_seconds", g.exact},
                      {"central_difference_seconds", g.central},
                      {"median_deviation", g.deviation}};
  out["floor"] = nullptr;
  if (a.floor) {
    Json& floor = out["floor"] = {{"twins", a.floor->twins}};
    for (const Split split : {Split::train, Split::test}) {
      const auto of = [&](int q) { return a.floor->statistics(q, split); };
      int n = 0;  // throws, of which some quantity may not be measured
      for (int q = 0; q < experiment::kQuantityCount; ++q) n = std::max(n, of(q).n);
      floor[to_string(split)] = errors_json(n, of);
    }
  }
  return out;
}

}  // namespace unhand::apps
