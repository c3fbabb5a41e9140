#include "fitting/measured/measured_imitations.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "fitting/gross_outliers.hpp"
#include "fitting/measured/effect_trial.hpp"
#include "fitting/measured/grouped_weights.hpp"

namespace unhand::fitting {

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

namespace {

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

/// χ² per sample by channel where every group counts by these weights.
std::vector<double> weighed_misfit(const GroupedProblem& problem, const GroupedFit& fit,
                                   const GroupedWeights& weights) {
  std::vector<double> out;
  for (const GroupedMisfit& m : misfit(problem, fit, &weights)) out.push_back(m.chi2_per_sample());
  return out;
}

/// Whether groups count for less than others as exceptions do: an eighth of them at most.
bool are_exceptions(const EffectSearch& search) {
  double all = 0, less = 0;
  for (const GroupedFit* fit : {&search.final, &search.final_test})
    for (const std::size_t i : fit->solved_groups()) all += 1, less += fit->weights.group[i] < 1 ? 1 : 0;
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

}  // namespace

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
  search.conditions.clear();
  search.final = search.base;
  search.final_test = search.base_test;
  take_fits(problem, search, out);
}

}  // namespace unhand::fitting
