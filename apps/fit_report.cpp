// The answer of `unhand fit` on throws, as text.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/fit.hpp"
#include "contact/registry.hpp"
#include "fitting/advice.hpp"

namespace unhand::apps {
namespace {

using datasets::Split;
using experiment::ErrorStatistics;
using experiment::kDegrees;

std::string standing_of(const fitting::FitResult& fit, std::size_t k) {
  const auto& u = fit.campaign[k];
  if (u.at_bound) return "at its bound";
  if (!fitting::is_determined(fit, k)) return "not by this log";
  if (const auto [low, high] = u.interval95(); !std::isfinite(low) || !std::isfinite(high))
    return "to one side only";
  if (u.unknown.prior_sigma && u.data_sigma > *u.unknown.prior_sigma) return "less than the prior";
  return "yes";
}

Table parameter_table(const fitting::FitResult& fit) {
  Table out{{"parameter", "unit", "value", "1 sigma", "95 % interval", "determined"}, {}, 2};
  for (std::size_t k = 0; k < fit.campaign.size(); ++k) {
    const auto& u = fit.campaign[k];
    const auto [low, high] = u.interval95();
    const Rounded shown = rounded(u.value, u.sigma);
    const auto end = [&](double x) {
      if (!std::isfinite(x)) return std::string("open");
      return shown.decimals ? fmt::format("{:.{}f}", x, *shown.decimals) : fmt::format("{:.5g}", x);
    };
    out.rows.push_back(
        {u.unknown.name, u.unknown.unit, shown.value, std::isfinite(u.sigma) ? shown.sigma : "-",
         std::isfinite(low) || std::isfinite(high)
             ? fmt::format("[{}, {}]{}", end(low), end(high), u.profile ? " of the profile" : "")
             : "open",
         standing_of(fit, k)});
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

/// Errors, and beside them those of twins that obey the model.
Table error_table(const FitAnswer& a) {
  Table out{{"throws", "n"}, {}, 1};
  for (const auto& quantity : experiment::kQuantities) out.header.push_back(quantity.title);
  const auto add = [&](const char* name, std::size_t n, auto&& statistics) {
    std::vector<std::string> row{name, fmt::to_string(n)};
    for (int q = 0; q < experiment::kQuantityCount; ++q) {
      const ErrorStatistics s = statistics(q);
      row.push_back(s.n > 0
                        ? fmt::format("{} ({:+.{}f})",
                                      mean_and_spread(s.n, s.mae, s.std, experiment::kQuantities[q].decimals),
                                      s.bias, experiment::kQuantities[q].decimals)
                        : "-");
    }
    out.rows.push_back(std::move(row));
  };
  for (const Split split : {Split::train, Split::test}) {
    const auto n = static_cast<std::size_t>(std::count_if(
        a.errors.throws.begin(), a.errors.throws.end(), [&](const auto& one) { return one.split == split; }));
    if (n == 0) continue;
    add(to_string(split), n, [&](int q) { return a.errors.statistics(q, split); });
    if (!a.floor || a.floor->twins == 0) continue;
    const auto floor = [&](int q) { return a.floor->statistics(q, split); };
    add("  its floor", n, floor);
    std::vector<std::string> ratio{"  over it", ""};
    for (int q = 0; q < experiment::kQuantityCount; ++q) {
      const double least = floor(q).mae, mae = a.errors.statistics(q, split).mae;
      ratio.push_back(least > 0 ? fmt::format("{:.2f}", mae / least) : "-");
    }
    out.rows.push_back(std::move(ratio));
  }
  if (const auto& cv = a.cross_validation)
    add("cross-validated", cv->throws.size(), [&](int q) { return cv->statistics(q); });
  return out;
}

/// Whether pads that press on a wrench sensor could give, and are fitted as if they did not.
bool takes_pads_as_rigid(const FitAnswer& a, const FitRequest& request) {
  const auto& effects = request.effects;
  return contact::can_give(request.model) &&
         std::find(effects.begin(), effects.end(), "contact.pad_compliance") == effects.end() &&
         std::any_of(a.fit.misfit.begin(), a.fit.misfit.end(),
                     [](const auto& m) { return m.channel == experiment::Channel::wrench_fx; });
}

}  // namespace

std::string why_unfitted(const fitting::FitResult& fit) {
  return fit.outcome == fitting::FitOutcome::not_solved ? "the fit found no answer: " + fit.message
                                                        : fit.message;
}

std::vector<std::string> fit_notes(const FitAnswer& a, const FitRequest& request) {
  std::vector<std::string> out = a.problem.notes();
  if (takes_pads_as_rigid(a, request))
    out.push_back(
        "pads are taken as rigid. A give of a micrometre before they slip makes length some per cent too "
        "small, more than its interval says, and chi2 hardly shows it; --effects contact.pad_compliance fits "
        "it");
  return out;
}

std::string fit_text(const FitAnswer& a, const FitRequest& request, bool markdown) {
  const auto& fit = a.fit;
  std::size_t used = 0, n_train = 0;
  for (std::size_t i = 0; i < fit.throws.size(); ++i) {
    used += fit.throws[i].used;
    n_train += a.throws[i].comparison.split == Split::train;
  }
  std::string effects;
  for (const auto& id : request.effects) effects += (effects.empty() ? " with " : ", ") + id;
  const std::string log = request.log + ": " + a.origin;
  std::string out = markdown ? "# Fit\n\n" : "";
  const auto say = [&]<class... T>(fmt::format_string<T...> format, T&&... of) {
    out += fmt::format(format, std::forward<T>(of)...) +
           (markdown ? "\n\n" : "\n");  // else its lines are joined
  };
  const auto show = [&](const Table& table) { out += (markdown ? table.markdown() : table.text()) + "\n"; };
  say("{}", markdown ? markdown_text(log) : log);
  say("{}{} fitted to {} of {} train throws, {} samples: {}, {} iterations{}", request.model, effects, used,
      n_train, fit.samples,
      fit.outcome == fitting::FitOutcome::converged ? "converged" : "stopped before it converged",
      fit.iterations, markdown ? "" : "\n");
  show(parameter_table(fit));
  say("intervals: from the scatter between {}{}",
      plural(static_cast<std::size_t>(fit.clusters), fit.by_conditions ? "condition" : "throw"),
      fit.by_conditions ? ""
                        : "; what repetitions share of the model's errors is not in them: that would take "
                          "four conditions");
  for (const auto& open : fit.open)
    say("not determined by this log: {} ({}).\n  It would take {}.", open.meaning,
        std::isfinite(open.sigma) ? fmt::format("1 sigma is {:.2g} such steps", open.sigma)
                                  : std::string("no trace of it at all"),
        fitting::remedy(a.problem, open));
  for (const auto& pair : fitting::strong_correlations(fit))
    say("correlated: {} and {}, {:+.3f}", pair.first, pair.second, pair.value);
  if (!markdown) out += "\n";
  show(spread_table(a));
  show(misfit_table(fit));
  say("chi2 {:.6g} for {} degrees of freedom: {} each", fit.chi2, fit.degrees_of_freedom,
      fixed(fit.chi2_per_dof(), 3));
  if (fit.mode_changes > 0)
    say("{} throws changed their sequence of modes in the last round", fit.mode_changes);
  std::string outliers;
  for (const auto& t : fit.throws)
    if (t.used && t.weight < 1)
      outliers += fmt::format("{}{} ({:.2f})", outliers.empty() ? "" : ", ", t.id, t.weight);
  say("{}", outliers.empty() ? "no outlier throws" : "outlier throws (weight): " + outliers);
  if (fit.not_simulated > 0)
    say("{} train throws could not be simulated from the start and took no part: {}", fit.not_simulated,
        fit.why_not());
  if (const auto without = n_train - used - static_cast<std::size_t>(fit.not_simulated); without > 0)
    say("{} train throws have no observation among the channels asked for", without);
  if (markdown)
    for (const auto& warning : fit_warnings(a, request)) say("warning: {}", warning);
  for (const auto& note : fit_notes(a, request)) say("note: {}", note);
  if (!markdown) out += "\n";
  say("predictions: mean absolute error ± its standard deviation (bias)");
  out += markdown ? error_table(a).markdown() + "\n" : error_table(a).text();
  if (const auto& cv = a.cross_validation) {
    say("cross-validated: {} folds of whole conditions of the train throws", cv->folds);
    for (const auto& failure : cv->failed) say("{}", failure);
  }
  if (a.floor)
    say("floor: the mean of {} synthetic twins, simulated with the model as fitted and the declared noise, "
        "then fitted and predicted alike",
        a.floor->twins);
  if (a.errors.failed > 0) say("{} throws are not brought to a landing", a.errors.failed);
  if (!markdown) return out;  // how long it took: in the report and the JSON
  say("{:.2f} s on {} threads, Jacobian {:.0f} %", fit.seconds, a.threads, 100 * a.jacobian_share());
  const auto& g = a.gradients;
  if (g.plain > 0)
    say("a throw's derivatives by {} unknowns: {:.2f} ms exact, {:.1f} plain predictions; {:.2f} ms by "
        "central "
        "differences, {:.1f} of them (median deviation {:.1g})",
        g.unknowns, 1e3 * g.exact / static_cast<double>(used), g.exact / g.plain,
        1e3 * g.central / static_cast<double>(used), g.central / g.plain, g.deviation);
  return out;
}

Table fit_throw_table(const FitAnswer& a) {
  Table out{{"throw", "object", "condition", "split", "used", "weight", "weighted chi2"}, {}, 4};
  for (const auto& u : a.problem.own())
    out.header.push_back("fitted_" + u.name + (u.unit == "-" ? "" : "_" + u.unit));
  for (const char* name : {"detach_vx_m_s", "sigma", "detach_omega_deg_s", "sigma", "landing_x_m", "sigma",
                           "landing_theta_deg", "sigma"})
    out.header.push_back(std::string(name) == "sigma" ? "sigma_" + out.header.back() : name);
  for (const auto& quantity : experiment::kQuantities)
    out.header.push_back(std::string("error_") + quantity.key);
  for (std::size_t i = 0; i < a.throws.size(); ++i) {
    const auto& t = a.fit.throws[i];
    const auto& [c, sigma, own, seconds] = a.throws[i];
    const auto& p = c.prediction;
    const bool detached = p.release == release::ReleaseOutcome::detached;
    std::vector<std::string> row{c.id,
                                 c.object,
                                 c.condition,
                                 to_string(c.split),
                                 t.used ? "yes" : "no",
                                 all_digits(t.used, t.weight),
                                 all_digits(t.used, t.chi2)};
    for (const double value : t.own) row.push_back(all_digits(t.used, value));
    const auto s = sigma.value_or(fitting::OutcomeSigma{});
    const bool known = sigma.has_value();
    row.push_back(all_digits(detached, p.detach.twist.vx));
    row.push_back(all_digits(known, s.detach_vx));
    row.push_back(all_digits(detached, p.detach.twist.omega * kDegrees));
    row.push_back(all_digits(known, s.detach_omega * kDegrees));
    row.push_back(all_digits(p.landed(), p.landing.pose.x));
    row.push_back(all_digits(known, s.landing_x));
    row.push_back(all_digits(p.landed(), p.landing.pose.theta * kDegrees));
    row.push_back(all_digits(known, s.landing_theta * kDegrees));
    for (const auto& error : c.error) row.push_back(all_digits(error.has_value(), error.value_or(0)));
    out.rows.push_back(std::move(row));
  }
  return out;
}

}  // namespace unhand::apps
