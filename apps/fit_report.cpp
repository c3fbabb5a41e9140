// The answer of `unhand fit` on throws, as text and as JSON.
#include <fmt/format.h>

#include <cmath>

#include "apps/fit.hpp"
#include "fitting/advice.hpp"

namespace unhand::apps {
namespace {

using datasets::Split;
using experiment::ErrorStatistics;
using experiment::kDegrees;

constexpr int decimals[experiment::kQuantityCount] = {4, 2, 4, 2};

struct Interval {
  double low{}, high{};
};
Interval interval95(const fitting::FittedUnknown& u, double factor) {
  return {u.value - factor * u.sigma, u.value + factor * u.sigma};
}

std::string standing_of(const fitting::FittedUnknown& u) {
  if (u.at_bound) return "at its bound";
  if (!std::isfinite(u.data_sigma)) return "not by this log";
  if (u.unknown.prior_sigma && u.data_sigma > *u.unknown.prior_sigma) return "less than the prior";
  return "yes";
}

Table parameter_table(const fitting::FitResult& fit) {
  Table out{{"parameter", "unit", "value", "1 sigma", "95 % interval", "determined"}, {}, 2};
  for (const auto& u : fit.campaign) {
    const auto [low, high] = interval95(u, fitting::interval_factor(fit));
    out.rows.push_back({u.unknown.name, u.unknown.unit, fmt::format("{:.6g}", u.value),
                        fmt::format("{:.2g}", u.sigma), fmt::format("[{:.5g}, {:.5g}]", low, high),
                        standing_of(u)});
  }
  return out;
}

Table spread_table(const FitAnswer& a) {
  Table out{{"own unknown of every throw", "unit", "learned 1 sigma"}, {}, 2};
  for (std::size_t k = 0; k < a.fit.own_spread.size(); ++k)
    out.rows.push_back(
        {a.problem.own()[k].name, a.problem.own()[k].unit, fmt::format("{:.3g}", a.fit.own_spread[k])});
  return out;
}

Table misfit_table(const fitting::FitResult& fit) {
  Table out{{"phase", "channel", "samples", "chi2/sample", "weight"}, {}, 2};
  for (const auto& m : fit.misfit)
    out.rows.push_back({std::string(to_string(m.phase)), std::string(to_string(m.channel)),
                        fmt::to_string(m.n), fmt::format("{:.3f}", m.chi2_per_sample()),
                        fmt::format("{:.3f}", m.weight)});
  return out;
}

Table error_table(const FitAnswer& a) {
  Table out{{"throws", "n"}, {}, 1};
  for (const auto& quantity : experiment::kQuantities) out.header.push_back(quantity.title);
  const auto add = [&](const char* name, std::size_t n, auto&& statistics) {
    std::vector<std::string> row{name, fmt::to_string(n)};
    for (int q = 0; q < experiment::kQuantityCount; ++q) {
      const ErrorStatistics s = statistics(q);
      row.push_back(s.n > 0 ? fmt::format("{} ({:+.{}f})", plus_minus(true, s.mae, s.std, decimals[q]),
                                          s.bias, decimals[q])
                            : "-");
    }
    out.rows.push_back(std::move(row));
  };
  for (const auto& [split, name] : {std::pair{Split::train, "train"}, {Split::test, "test"}}) {
    const auto n =
        static_cast<std::size_t>(std::count_if(a.errors.throws.begin(), a.errors.throws.end(),
                                               [s = split](const auto& one) { return one.split == s; }));
    if (n > 0) add(name, n, [&, s = split](int q) { return a.errors.statistics(q, s); });
  }
  if (const auto& cv = a.cross_validation)
    add("cross-validated", cv->throws.size(), [&](int q) { return cv->statistics(q); });
  return out;
}

Json statistics_json(const ErrorStatistics& s) {
  if (s.n == 0) return {{"n", 0}, {"mae", nullptr}, {"std", nullptr}, {"bias", nullptr}};
  return {{"n", s.n}, {"mae", s.mae}, {"std", s.std}, {"bias", s.bias}};
}

template <class Statistics>
Json errors_json(int n, Statistics&& statistics) {
  Json out{{"n", n}};
  for (int q = 0; q < experiment::kQuantityCount; ++q)
    out[experiment::kQuantities[q].key] = statistics_json(statistics(q));
  return out;
}

Json parameters_json(const fitting::FitResult& fit) {
  Json out = Json::object();
  for (const auto& u : fit.campaign) {
    const auto [low, high] = interval95(u, fitting::interval_factor(fit));
    Json& one = out[u.unknown.name] = {{"value", u.value},
                                       {"unit", u.unknown.unit},
                                       {"sigma", number(u.sigma)},
                                       {"interval95", {number(low), number(high)}},
                                       {"data_sigma", number(u.data_sigma)},
                                       {"determined", std::isfinite(u.data_sigma)},
                                       {"at_bound", u.at_bound},
                                       {"prior", nullptr}};
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
                   {"split", a.throws[i].comparison.split == Split::train ? "train" : "test"},
                   {"used", t.used},
                   {"weight", t.weight},
                   {"chi2", number(t.chi2)},
                   {"own", own}});
  }
  return out;
}

double jacobian_share(const FitAnswer& a) {
  return a.fit.seconds > 0 ? a.fit.jacobian_seconds / (a.fit.seconds * a.threads) : 0;
}

}  // namespace

std::string fit_text(const FitAnswer& a, const FitRequest& request, bool markdown) {
  const auto table = [&](const Table& t) { return markdown ? t.markdown() : t.text(); };
  const auto& fit = a.fit;
  std::size_t used = 0, n_train = 0;
  for (std::size_t i = 0; i < fit.throws.size(); ++i) {
    used += fit.throws[i].used;
    n_train += a.throws[i].comparison.split == Split::train;
  }
  std::string effects;
  for (const auto& id : request.effects) effects += (effects.empty() ? " with " : ", ") + id;
  std::string out =
      fmt::format("{}{}: {}{} fitted to {} of {} train throws, {} samples: {}, {} iterations\n\n",
                  markdown ? "# Fit\n\n" : "", request.log, request.model, effects, used, n_train,
                  fit.samples, to_string(fit.outcome), fit.iterations);
  out += table(parameter_table(fit)) + "\n";
  for (const auto& open : fit.open)
    out += fmt::format("not determined by this log: {} ({}).\n  It would take {}.\n", open.meaning,
                       std::isfinite(open.sigma) ? fmt::format("1 sigma is {:.2g} such steps", open.sigma)
                                                 : std::string("no trace of it at all"),
                       fitting::remedy(a.problem, open));
  for (const auto& pair : fitting::strong_correlations(fit))
    out += fmt::format("correlated: {} and {}, {:+.3f}\n", pair.first, pair.second, pair.value);
  if (!fit.open.empty() || !fitting::strong_correlations(fit).empty()) out += "\n";
  out += table(spread_table(a)) + "\n";
  out += fmt::format("{}\nchi2 {:.6g} for {} degrees of freedom: {:.3f} each\n", table(misfit_table(fit)),
                     fit.chi2, fit.degrees_of_freedom, fit.chi2_per_dof());
  if (fit.mode_changes > 0)
    out += fmt::format("{} throws changed their sequence of modes in the last round\n", fit.mode_changes);
  std::string outliers;
  for (const auto& t : fit.throws)
    if (t.used && t.weight < 1)
      outliers += fmt::format("{}{} ({:.2f})", outliers.empty() ? "" : ", ", t.id, t.weight);
  out += outliers.empty() ? "no outlier throws\n" : fmt::format("outlier throws (weight): {}\n", outliers);
  if (used < n_train)
    out += fmt::format("{} train throws could not be simulated from the start and took no part\n",
                       n_train - used);
  for (const auto& note : a.problem.notes()) out += fmt::format("note: {}\n", note);
  out += fmt::format("\npredictions: mean absolute error ± its standard deviation (bias)\n{}{}",
                     markdown ? "\n" : "", table(error_table(a)));
  if (const auto& cv = a.cross_validation) {
    out += fmt::format("cross-validated: {} folds of whole conditions of the train throws\n", cv->folds);
    for (const auto& failure : cv->failed) out += failure + "\n";
  }
  if (a.errors.failed > 0) out += fmt::format("{} throws are not brought to a landing\n", a.errors.failed);
  out += fmt::format("\n{:.2f} s on {} threads, Jacobian {:.0f} %\n", fit.seconds, a.threads,
                     100 * jacobian_share(a));
  return out;
}

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
                 {"per_degree_of_freedom", fit.chi2_per_dof()}};
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
  out["notes"] = a.problem.notes();
  for (const auto& [split, name] : {std::pair{Split::train, "train"}, {Split::test, "test"}}) {
    const auto n = static_cast<int>(std::count_if(a.errors.throws.begin(), a.errors.throws.end(),
                                                  [s = split](const auto& one) { return one.split == s; }));
    out[name] = errors_json(n, [&, s = split](int q) { return a.errors.statistics(q, s); });
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
                 {"jacobian_share", jacobian_share(a)}};
  return out;
}

Table fit_throw_table(const FitAnswer& a) {
  Table out{{"throw", "object", "condition", "split", "used", "weight", "chi2"}, {}, 4};
  for (const auto& u : a.problem.own())
    out.header.push_back("fitted_" + u.name + (u.unit == "-" ? "" : "_" + u.unit));
  for (const char* name : {"detach_vx_m_s", "sigma", "detach_omega_deg_s", "sigma", "landing_x_m", "sigma",
                           "landing_theta_deg", "sigma"})
    out.header.push_back(std::string(name) == "sigma" ? "sigma_" + out.header.back() : name);
  for (const auto& quantity : experiment::kQuantities)
    out.header.push_back(std::string("error_") + quantity.key);
  const auto text = [](bool known, double value) { return known ? fmt::format("{}", value) : std::string(); };
  for (std::size_t i = 0; i < a.throws.size(); ++i) {
    const auto& t = a.fit.throws[i];
    const auto& [c, sigma, own, seconds] = a.throws[i];
    const auto& p = c.prediction;
    const bool detached = p.release == release::ReleaseOutcome::detached;
    std::vector<std::string> row{c.id,
                                 c.object,
                                 c.condition,
                                 c.split == Split::train ? "train" : "test",
                                 t.used ? "yes" : "no",
                                 text(t.used, t.weight),
                                 text(t.used, t.chi2)};
    for (const double value : t.own) row.push_back(text(t.used, value));
    const auto s = sigma.value_or(fitting::OutcomeSigma{});
    const bool known = sigma.has_value();
    row.push_back(text(detached, p.detach.twist.vx));
    row.push_back(text(known, s.detach_vx));
    row.push_back(text(detached, p.detach.twist.omega * kDegrees));
    row.push_back(text(known, s.detach_omega * kDegrees));
    row.push_back(text(p.landed(), p.landing.pose.x));
    row.push_back(text(known, s.landing_x));
    row.push_back(text(p.landed(), p.landing.pose.theta * kDegrees));
    row.push_back(text(known, s.landing_theta * kDegrees));
    for (const auto& error : c.error) row.push_back(text(error.has_value(), error.value_or(0)));
    out.rows.push_back(std::move(row));
  }
  return out;
}

}  // namespace unhand::apps
