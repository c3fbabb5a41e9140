#include "fitting/measured/measured_discovery.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "dynamics/median.hpp"
#include "fitting/distributions.hpp"
#include "fitting/measured/effect_trial.hpp"
#include "fitting/measured/grouped_footprints.hpp"
#include "fitting/measured/measured_imitations.hpp"
#include "fitting/measured/wild_groups.hpp"

namespace unhand::fitting {

using datasets::Split;

namespace {

/// χ² per sample of a channel without stray samples: up to a hundredth of them, ten times farther off than
/// the others scatter. A sensor that fails for single samples is no structure; what is missing bends more
/// than those.
double without_strays(const GroupedProblem& problem, const GroupedFit& fit, std::size_t channel) {
  constexpr double kFar = 10, kFew = 0.01;
  std::vector<double> sizes;
  for (const std::size_t i : fit.solved_groups()) {
    const GroupFit& g = fit.groups[i];
    for (Eigen::Index j = 0; j < g.residual.size(); ++j)
      if (problem.groups()[i].rows[static_cast<std::size_t>(j)].channel == static_cast<int>(channel))
        sizes.push_back(std::abs(g.residual[j]));
  }
  if (sizes.empty()) return 0;
  const double far = kFar * std::max(1.0, 1.4826 * dynamics::median(sizes));
  double all = 0, near = 0, n = 0;
  for (const double x : sizes) {
    all += x * x;
    if (x <= far) near += x * x, n += 1;
  }
  const auto total = static_cast<double>(sizes.size());
  return total - n <= kFew * total ? near / n : all / total;
}

/// The channel whose neighbouring residuals correlate most surely, if what they share is a good part of the
/// declared noise. A noise that was declared too large hides a slow error in χ², which may be below one.
std::optional<MeasuredUnexplained> slow_error(const MeasuredDiscovery& out) {
  constexpr double kSurely = 5;  // standard deviations of white noise
  constexpr double kPart = 0.1;  // of the declared variance
  std::optional<MeasuredUnexplained> found;
  double most = kSurely;
  for (const auto& m : out.misfit)
    for (const auto& a : out.autocorrelation_after)
      if (a.channel == m.channel && a.z > most && a.lag1 * m.after_test > kPart)
        most = a.z, found = MeasuredUnexplained{out.phase, m.channel, m.after_test, {}};
  return found;
}

/// What neighbouring residuals say of what is left.
std::string in_words(const Autocorrelation& a) {
  constexpr double kSurely = 3, kPerhaps = 1.5;  // standard deviations of white noise
  if (std::abs(a.z) > kSurely)
    return fmt::format(
        "; neighbouring residuals correlate by {:.2f}: a slow error of the model or the sensor", a.lag1);
  if (std::abs(a.z) > kPerhaps)
    return fmt::format(
        "; neighbouring residuals correlate by {:.2f}, {:.1f} standard deviations of white noise: too few to "
        "tell a slow error from more noise than was declared",
        a.lag1, std::abs(a.z));
  return "; neighbouring residuals do not correlate: more noise than was declared";
}

void look_for_the_unexplained(const GroupedProblem& problem, const GroupedFit& held_out,
                              const MeasuredOptions& options, MeasuredDiscovery& out) {
  const auto& names = problem.channels();
  for (const auto& m : out.misfit) {
    const auto channel =
        static_cast<std::size_t>(std::find(names.begin(), names.end(), m.channel) - names.begin());
    const double left = without_strays(problem, held_out, channel),
                 most = std::max(options.unexplained, 1 + 3 * std::sqrt(2.0 / std::max(1, m.n_test)));
    if (left < most) {
      if (m.after_test >= most)
        out.evidence.push_back(
            {"",
             fmt::format("{}: a few stray samples make {:.3g} of {:.3g} times the variance "
                         "of the noise on held-out groups; nothing else is left there",
                         m.channel, m.after_test - left, m.after_test),
             false});
      continue;
    }
    if (out.unexplained && out.unexplained->chi2_per_dof >= left) continue;
    out.unexplained = MeasuredUnexplained{out.phase, m.channel, left, {}};
  }
  if (!out.unexplained) out.unexplained = slow_error(out);
  if (!out.unexplained) return;
  auto& u = *out.unexplained;
  u.description = fmt::format("{} in {}: {:.3g} times the variance of the noise is left on held-out groups",
                              u.channel, out.phase, u.chi2_per_dof);
  for (const auto& a : out.autocorrelation_after)
    if (a.channel == u.channel) u.description += in_words(a);
  const ResidualProfile* largest = nullptr;
  for (const auto& p : out.profile_after)
    if (p.channel == u.channel && (!largest || std::abs(p.z) > std::abs(largest->z))) largest = &p;
  if (largest)
    u.description += fmt::format(
        "; its mean is largest at {:.0f} % of the duration ({:+.2g} sigma, {:.1f} standard errors)",
        100 * largest->share, largest->mean, std::abs(largest->z));
}

/// The search without wild groups. One that the answer explains as it does the others is none: one that all
/// effects together bring so near takes part from the start, and the answer decides of each.
EffectSearch search_without_wild(GroupedProblem& problem, const EffectSearchOptions& options,
                                 std::vector<WildGroup>& wild) {
  const auto set_aside = [&](const std::vector<WildGroup>& groups) {
    std::vector<std::size_t> which;
    for (const WildGroup& one : groups) which.push_back(one.group);
    problem.set_aside(which);
  };
  wild = wild_groups(problem, problem.effects(), options.fit);
  auto aside = wild;
  std::erase_if(aside, [&](const WildGroup& one) { return one.apart <= options.fit.group_limit; });
  for (;;) {
    set_aside(aside);
    EffectSearch search = search_effects(problem, options);
    if (wild.empty()) return search;
    problem.set_aside({});
    auto still =
        search.solved ? still_wild(problem, wild, search.final, options.fit) : std::vector<WildGroup>{};
    const bool settled = still == aside;
    wild = aside = std::move(still);
    set_aside(aside);
    if (settled) return search;
  }
}

void tell_of_wild(const GroupedProblem& problem, const std::vector<WildGroup>& wild, MeasuredDiscovery& out) {
  if (wild.empty()) return;
  constexpr std::size_t kNamed = 5;
  std::string names;
  for (std::size_t k = 0; k < wild.size(); ++k) {
    const Group& group = problem.groups()[wild[k].group];
    const std::string how = wild[k].in_words();
    out.skipped.push_back({group.id, "set aside: " + how});
    if (k < kNamed)
      names += fmt::format("{}{} ({}{})", names.empty() ? "" : ", ", group.id,
                           group.split == Split::test ? "held out; " : "", how);
    else if (k == kNamed)
      names += fmt::format(" and {} more", wild.size() - kNamed);
  }
  std::string instead;
  for (const std::size_t i : problem.held_out_instead())
    instead +=
        fmt::format("{}{}", instead.empty() ? "; held out in their place: " : ", ", problem.groups()[i].id);
  out.evidence.push_back(
      {"",
       fmt::format("{} of {} throws set aside, which neither the answer nor all listed effects "
                   "together explain as they do the others: {}{}",
                   wild.size(), problem.groups().size(), names, instead),
       false});
}

}  // namespace

EffectSearch run_search(GroupedProblem& problem, const MeasuredOptions& options, MeasuredDiscovery& out) {
  std::vector<WildGroup> wild;
  EffectSearch search = search_without_wild(problem, options.search, wild);
  out.skipped = problem.skipped();
  tell_of_wild(problem, wild, out);
  if (!search.solved) {
    out.verdict = Verdict::not_answered;
    out.message = search.message;
    return search;
  }
  out.ranking = search.ranking;
  out.train = search.base.used, out.test = search.base_test.used;
  take_fits(problem, search, out);
  withdraw_imitations(problem, options.search, search, out);
  tell_fates(out.effects, {}, {}, out.ranking);
  out.first = leaves_noise(problem, search.base, 1.2, options.search.fit.threads);
  out.autocorrelation_before = autocorrelation(problem, search.base_test);
  out.autocorrelation_after = autocorrelation(problem, search.final_test);
  out.profile_before = residual_profile(problem, search.base);
  out.profile_after = residual_profile(problem, search.final);
  std::vector<dynamics::Effect> leading;
  for (const auto& id : leading_names(out.effects, out.ranking))
    for (auto& effect : problem.effects())
      if (effect.id == id) leading.push_back(std::move(effect));
  out.footprints = footprint_profiles(problem, search.base, leading, options.search.fit);
  look_for_the_unexplained(problem, search.final_test, options, out);
  if (out.unexplained)
    out.unexplained->missing =
        missing_acceleration(problem, search.final, search.final_test, options.search.fit);
  out.verdict = !out.effects.empty() ? Verdict::effect_found
                : out.unexplained    ? Verdict::unexplained
                                     : Verdict::no_missing_effect;
  return search;
}

void weigh_conditions(const EffectSearch& search, MeasuredDiscovery& out) {
  const auto is_told =
      [&](const SizeShift& s) {  // and not in other lengths, those of a scale that is gravity
        for (const auto& effect : out.effects)
          for (const auto& p : effect.parameters)
            if (effect.id == s.effect && p.name == s.parameter) return p.value == s.value;
        return false;
      };
  for (const SizeCondition& c : search.conditions) {
    if (c.instead_of.empty() && c.shifts.empty()) {
      out.evidence.push_back(
          {c.on,
           fmt::format("It is evident on the train groups (BIC {:.1f}), but held-out groups "
                       "show too little of it to confirm it",
                       c.delta_bic),
           false});
      continue;
    }
    if (!c.instead_of.empty() && !is_accepted(c.instead_of, out.effects)) continue;
    const std::string how =
        c.instead_of.empty()
            ? fmt::format("{} is evident beside it (BIC {:.1f}), though held-out groups do not confirm that",
                          c.on, c.delta_bic)
            : fmt::format("{} would explain the log as {} does", c.on, c.instead_of);
    std::map<std::string, std::string> sizes;  // by effect
    for (const SizeShift& s : c.shifts)
      if (is_told(s))
        sizes[s.effect] +=
            fmt::format("{}{} = {:#.4g} ± {:.2g}{}, not {:#.4g}", sizes[s.effect].empty() ? "" : "; ",
                        s.parameter, s.then, s.then_sigma, dynamics::after_number(s.unit), s.value);
    for (const auto& [effect, size] : sizes)
      out.evidence.push_back({effect, fmt::format("{}: with it {}", how, size), true});
  }
}

std::vector<AskedBeside> asked_beside(const GroupedProblem& problem, const GroupedFit& fit,
                                      const std::string& id, const MeasuredOptions& options) {
  std::vector<dynamics::Effect> beside;
  for (auto& effect : problem.effects())
    if (effect.id == id) beside.push_back(std::move(effect));
  if (beside.empty()) return {};
  auto parameters = shared_parameters(beside.front(), objects_of(problem));
  const auto f = grouped_footprints(problem, fit, beside, options.search.fit);
  std::vector<std::size_t> which;
  std::vector<Eigen::Index> columns;
  for (std::size_t n = 0; n < f.parts.size(); ++n) which.push_back(n);
  for (Eigen::Index k = 0; k + 1 < f.total.gram.rows(); ++k) columns.push_back(k);
  if (which.size() < columns.size() + 2) return {};
  const LinearStep step = linear_step(f.parts, which, columns);
  const double level = options.search.family_wise_level / static_cast<double>(parameters.size());
  std::vector<AskedBeside> out;
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(f.total.fitted + j);
    const double value = step.value[k], sigma = step.sigma[k];
    if (!(sigma > 0) || f_tail(value * value / (sigma * sigma), 1, step.freedom[k]) > level) continue;
    out.push_back({std::move(parameters[j]), value, sigma});
  }
  return out;
}

void weigh_drag_form(const GroupedProblem& problem, const EffectSearch& search,
                     const MeasuredOptions& options, MeasuredDiscovery& out) {
  const std::string quadratic = "flight.quadratic_drag", linear = "flight.linear_drag";
  const bool squared = is_accepted(quadratic, out.effects);
  if (squared == is_accepted(linear, out.effects)) return;
  const std::string &is = squared ? quadratic : linear, &other = squared ? linear : quadratic;
  for (const auto& [parameter, value, sigma] : asked_beside(problem, search.final, other, options)) {
    const char* form = is == linear ? (value > 0 ? "grows faster than v" : "grows less than v")
                                    : (value > 0 ? "grows less than v²" : "grows faster than v²");
    out.evidence.push_back(
        {is,
         fmt::format(
             "Its form is not confirmed: beside it the fit would take {} = {:.3g} ± {:.2g} {} ({:.1f} "
             "sigma). What slows them {}, or something else bends them alike: its size is one for "
             "these speeds",
             parameter.name, value, sigma, parameter.unit, std::abs(value) / sigma, form),
         true});
  }
}

void weigh_stability(MeasuredDiscovery& out) {
  const double tests = std::max<double>(1, static_cast<double>(out.stability.size()));
  for (const auto& s : out.stability) {
    if (f_tail(s.z() * s.z(), 1, s.degrees_of_freedom) > 0.05 / tests) continue;
    out.evidence.push_back(
        {s.parameter.substr(0, s.parameter.rfind('.')),
         fmt::format(
             "{} depends on {}: {:.4g} ± {:.2g} below {:.3g}, {:.4g} ± {:.2g} above ({:.1f} sigma apart)",
             s.parameter, s.covariate, s.low, s.low_sigma, s.split_at, s.high, s.high_sigma, std::abs(s.z())),
         true});
  }
}

}  // namespace unhand::fitting
