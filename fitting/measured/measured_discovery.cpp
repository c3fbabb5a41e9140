#include "fitting/measured/measured_discovery.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "dynamics/median.hpp"
#include "fitting/distributions.hpp"
#include "fitting/measured/effect_trial.hpp"
#include "fitting/measured/grouped_footprints.hpp"
#include "fitting/measured/grouped_weights.hpp"
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
  for (std::size_t i = 0; i < fit.groups.size(); ++i) {
    const GroupFit& g = fit.groups[i];
    if (!g.used || !g.solved) continue;
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
  if (!out.unexplained) return;
  auto& u = *out.unexplained;
  u.description = fmt::format("{} in {}: {:.3g} times the variance of the noise is left on held-out groups",
                              u.channel, out.phase, u.chi2_per_dof);
  for (const auto& a : out.autocorrelation_after)
    if (a.channel == u.channel)
      u.description +=
          std::abs(a.z) > 3
              ? fmt::format(
                    "; neighbouring residuals correlate by {:.2f}: a slow error of the model or the sensor",
                    a.lag1)
              : std::string("; neighbouring residuals do not correlate: more noise than was declared");
  const ResidualProfile* largest = nullptr;
  for (const auto& p : out.profile_after)
    if (p.channel == u.channel && (!largest || std::abs(p.z) > std::abs(largest->z))) largest = &p;
  if (largest)
    u.description += fmt::format(
        "; its mean is largest at {:.0f} % of the duration ({:+.2g} sigma, {:.1f} standard errors)",
        100 * largest->share, largest->mean, std::abs(largest->z));
}

/// A misfit that is less than chance makes of so few samples is none.
double least_misfit(int n) { return std::max(0.2, 3 * std::sqrt(2.0 / std::max(1, n))); }

/// Of a misfit: what may be left of it where it is explained. A few times the noise is what trackers err by,
/// and no effect has to answer for it.
constexpr double kStays = 0.1, kTrackers = 10;

/// Whether the accepted effects explain some channel to within a tenth of its misfit, on train or on held-out
/// groups, or leave one in its noise that carries a tenth of what they take: a channel that they do not touch
/// says nothing of them. Where they leave more than that of every channel, they are the nearest names of
/// something else. What chance makes of so few samples is no misfit.
bool explains_a_channel(const std::vector<MeasuredMisfit>& misfit) {
  constexpr double kTenth = 0.1;  // of the fall of all channels
  double falls = 0;
  const auto fall = [](const MeasuredMisfit& m) {
    return std::max(0.0, m.before_train - m.after_train) * (m.n - m.n_test);
  };
  for (const auto& m : misfit) falls += fall(m);
  bool any = false;
  const auto explained = [&](int n, double before, double after) {
    const double none = least_misfit(n);
    if (before - 1 < none) return false;
    any = true;
    return after - 1 < std::max(kStays * (before - 1), none);
  };
  for (const auto& m : misfit)
    if (explained(m.n - m.n_test, m.before_train, m.after_train) ||
        explained(m.n_test, m.before_test, m.after_test) ||
        (fall(m) >= kTenth * falls && m.after_train - 1 < least_misfit(m.n - m.n_test)))
      return true;
  return !any;
}

/// Whether the answer explains a channel, on train or on held-out groups, to within a tenth of its misfit or
/// what trackers err by.
bool is_explained(const MeasuredMisfit& m) {
  const auto explained = [](double before, double after) {
    return after - 1 < std::max(kStays * (before - 1), kTrackers);
  };
  return explained(m.before_train, m.after_train) || explained(m.before_test, m.after_test);
}

/// Whether the answer explains the channel that an effect acts in. It is the one that it takes most from:
/// `without` is the χ² per sample of `names`, on train groups, if that effect alone is taken away. What
/// explains another channel beside it says nothing of it.
bool explains_its_channel(const std::vector<std::string>& names, const std::vector<double>& without,
                          const std::vector<MeasuredMisfit>& misfit) {
  const MeasuredMisfit* its = nullptr;
  double most = 0;
  for (const auto& m : misfit)
    for (std::size_t c = 0; c < names.size(); ++c)
      if (const double falls = (without[c] - m.after_train) * (m.n - m.n_test);
          names[c] == m.channel && falls > most)
        its = &m, most = falls;
  return !its || is_explained(*its);
}

/// Whether, on train and on held-out groups, more is left of some channel's misfit than they take from any.
bool leave_more_than_they_take(const std::vector<MeasuredMisfit>& misfit) {
  double left = 0, taken = 0, test_left = 0, test_taken = 0;
  for (const auto& m : misfit) {
    left = std::max(left, m.after_train - 1), taken = std::max(taken, m.before_train - m.after_train);
    test_left = std::max(test_left, m.after_test - 1);
    test_taken = std::max(test_taken, m.before_test - m.after_test);
  }
  return left > taken && test_left > test_taken && left > kTrackers && test_left > kTrackers;
}

void take_fits(const GroupedProblem& problem, const EffectSearch& search, MeasuredDiscovery& out) {
  out.effects = search.effects;
  out.stability = search.stability;
  out.parameters = search.final.names();
  out.covariance.assign(search.final.covariance.data(),
                        search.final.covariance.data() + search.final.covariance.size());
  const auto a = misfit(problem, search.base), b = misfit(problem, search.base_test),
             c = misfit(problem, search.final), d = misfit(problem, search.final_test);
  out.misfit.clear();
  for (std::size_t k = 0; k < a.size(); ++k)
    if (a[k].n + b[k].n > 0)
      out.misfit.push_back({a[k].channel, a[k].n + b[k].n, a[k].chi2_per_sample(), b[k].chi2_per_sample(),
                            c[k].chi2_per_sample(), d[k].chi2_per_sample(), b[k].n});
}

/// χ² per sample by channel where every group counts by these weights.
std::vector<double> weighed_misfit(const GroupedProblem& problem, const GroupedFit& fit,
                                   const GroupedWeights& weights) {
  std::vector<double> out;
  for (const GroupedMisfit& m : misfit(problem, fit, &weights))
    out.push_back(m.weight > 0 ? m.chi2 / m.weight : 0);
  return out;
}

/// Whether groups count for less than others as exceptions do: an eighth of them at most.
bool are_exceptions(const EffectSearch& search) {
  double all = 0, less = 0;
  for (const GroupedFit* fit : {&search.final, &search.final_test})
    for (std::size_t i = 0; i < fit->groups.size(); ++i)
      if (fit->groups[i].used && fit->groups[i].solved) all += 1, less += fit->weights.group[i] < 1 ? 1 : 0;
  return less <= std::max(1.0, kMostWild * all);
}

/// The misfit where groups that the answer leaves far more than the others count for as much less, before it
/// and after: as they do in its fits. A few that something touched do not veto what all others show.
std::vector<MeasuredMisfit> as_groups_count(const GroupedProblem& problem, const EffectSearch& search,
                                            std::vector<MeasuredMisfit> misfit) {
  if (!are_exceptions(search)) return misfit;
  const auto a = weighed_misfit(problem, search.base, search.final.weights),
             b = weighed_misfit(problem, search.base_test, search.final_test.weights),
             c = weighed_misfit(problem, search.final, search.final.weights),
             d = weighed_misfit(problem, search.final_test, search.final_test.weights);
  const auto& names = problem.channels();
  for (auto& m : misfit) {
    const auto k = static_cast<std::size_t>(std::find(names.begin(), names.end(), m.channel) - names.begin());
    m.before_train = a[k], m.before_test = b[k], m.after_train = c[k], m.after_test = d[k];
  }
  return misfit;
}

/// What lies in the way of believing the accepted effects, in words; empty if nothing does.
std::string fault_of(const GroupedProblem& problem, const EffectSearchOptions& options,
                     const EffectSearch& search, const MeasuredDiscovery& out) {
  const auto misfit = as_groups_count(problem, search, out.misfit);
  if (!explains_a_channel(misfit)) return "leave more than a tenth of it in every channel";
  const GroupedWeights weights = are_exceptions(search) ? search.final.weights : neutral_weights(problem);
  const bool all_explained = std::all_of(misfit.begin(), misfit.end(), is_explained);
  for (const auto& effect : out.effects) {
    if (all_explained) break;
    const GroupedFit without = fit_without(problem, search.final, effect.id, options.fit);
    if (without.solved &&
        !explains_its_channel(problem.channels(), weighed_misfit(problem, without, weights), misfit))
      return fmt::format("more than a tenth of it is left in the channel that {} acts in most", effect.id);
  }
  return leave_more_than_they_take(misfit) ? "leave more of it in one channel than they take from any" : "";
}

/// Names that explain no channel, or not the one they act in, or less than they leave, are taken back; all of
/// them, as each was found beside the others.
void withdraw_imitations(const GroupedProblem& problem, const EffectSearchOptions& options,
                         EffectSearch& search, MeasuredDiscovery& out) {
  if (out.effects.empty()) return;
  const std::string fault = fault_of(problem, options, search, out);
  if (fault.empty()) return;
  std::vector<std::string> withdrawn;
  for (const auto& effect : out.effects) withdrawn.push_back(effect.id);
  out.evidence.push_back({"",
                          fmt::format("Withdrawn: {}. They lower the misfit, but {}: the nearest names of "
                                      "something that is not listed",
                                      fmt::join(withdrawn, ", "), fault),
                          false});
  tell_fates({}, withdrawn, {}, out.ranking);
  search.effects.clear();
  search.stability.clear();
  search.final = search.base;
  search.final_test = search.base_test;
  take_fits(problem, search, out);
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
    const std::string how =
        fmt::format("{:.0f} times the median misfit that they leave, {:.1f} robust sigmas in its logarithm",
                    wild[k].times, wild[k].sigmas);
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

void weigh_drag_form(const GroupedProblem& problem, const EffectSearch& search,
                     const MeasuredOptions& options, MeasuredDiscovery& out) {
  const std::string quadratic = "flight.quadratic_drag", linear = "flight.linear_drag";
  const auto has = [&](const std::string& id) {
    return std::any_of(out.effects.begin(), out.effects.end(), [&](const auto& e) { return e.id == id; });
  };
  if (has(quadratic) == has(linear)) return;
  const std::string &is = has(quadratic) ? quadratic : linear, &other = has(quadratic) ? linear : quadratic;
  std::vector<dynamics::Effect> beside;
  for (auto& effect : problem.effects())
    if (effect.id == other) beside.push_back(std::move(effect));
  if (beside.empty()) return;
  const auto parameters = shared_parameters(beside.front(), objects_of(problem));
  const auto f = grouped_footprints(problem, search.final, beside, options.search.fit);
  std::vector<std::size_t> which;
  std::vector<Eigen::Index> columns;
  for (std::size_t n = 0; n < f.parts.size(); ++n) which.push_back(n);
  for (Eigen::Index k = 0; k + 1 < f.total.gram.rows(); ++k) columns.push_back(k);
  if (which.size() < columns.size() + 2) return;
  const LinearStep step = linear_step(f.parts, which, columns);
  const double level = options.search.family_wise_level / static_cast<double>(parameters.size());
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(f.total.fitted + j);
    const double value = step.value[k], sigma = step.sigma[k];
    const auto groups = static_cast<double>(which.size());
    if (!(sigma > 0) || f_tail(value * value / (sigma * sigma), 1, groups - 1) > level) continue;
    const char* form = is == linear ? (value > 0 ? "grows faster than v" : "grows less than v")
                                    : (value > 0 ? "grows less than v²" : "grows faster than v²");
    out.evidence.push_back(
        {is,
         fmt::format(
             "Its form is not confirmed: beside it the fit would take {} = {:.3g} ± {:.2g} {} ({:.1f} "
             "sigma). What slows them {}, or something else bends them alike: its size is one for "
             "these speeds",
             parameters[j].name, value, sigma, parameters[j].unit, std::abs(value) / sigma, form),
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
