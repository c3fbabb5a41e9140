#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "dynamics/parallel.hpp"
#include "fitting/discovery/left_over.hpp"
#include "fitting/discovery/misfit_rules.hpp"

namespace unhand::fitting {

namespace {

/// Of which throws a misfit is: the fewest that hold most of it, by name or by the condition they share.
std::string held_by(const Stage& stage, const FitResult& half, const ChannelMisfit& m, int threads) {
  constexpr double kMost = 0.9;
  constexpr std::size_t kNamed = 3;
  struct Excess {
    double chi2;
    const experiment::PreparedThrow* thrown;
  };
  std::vector<Excess> all;
  double sum = 0;
  const auto residuals = residuals_of(stage.problem, half, threads);
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (residuals[i].size() == 0) continue;
    const CampaignThrow& thrown = stage.problem.throws()[i];
    const double release = thrown.release_or(half.throws[i].detach);
    double chi2 = 0;
    for (std::size_t j = 0; j < thrown.observed.all.size(); ++j) {
      const auto& o = thrown.observed.all[j];
      if (o.channel != m.channel || phase_of(o, thrown.opening, release) != m.phase) continue;
      const double r = residuals[i][static_cast<Eigen::Index>(j)];
      chi2 += r * r - 1;
    }
    all.push_back({chi2, &thrown.prepared});
    sum += std::max(0.0, chi2);
  }
  std::sort(all.begin(), all.end(), [](const Excess& a, const Excess& b) { return a.chi2 > b.chi2; });
  std::size_t few = 0;
  for (double held = 0; few < all.size() && held < kMost * sum; ++few) held += std::max(0.0, all[few].chi2);
  const std::string condition = all[0].thrown->experiment();
  const auto is_of_it = [&](const Excess& e) { return e.thrown->experiment() == condition; };
  const bool one = std::all_of(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(few), is_of_it);
  if (few > kNamed) return one ? condition : fmt::format("{} of its {} throws", few, all.size());
  std::string names;
  for (std::size_t i = 0; i < few; ++i) names += (i == 0 ? "" : ", ") + all[i].thrown->id;
  const bool no_other = static_cast<std::size_t>(std::count_if(all.begin(), all.end(), is_of_it)) == few;
  return one && no_other ? fmt::format("{} ({})", names, condition) : names;
}

/// χ² per sample that the parameters' covariance alone makes of a held-out misfit: few train throws tell them
/// badly, and what is held out is then off without anything being wrong with it.
double by_parameters(const Stage& stage, const ChannelMisfit& m, int threads) {
  const std::vector<double> campaign = stage.fit.values();
  const auto width = static_cast<Eigen::Index>(campaign.size());
  const Eigen::Map<const Eigen::MatrixXd> covariance(stage.fit.covariance.data(), width, width);
  const auto& throws = stage.problem.throws();
  std::vector<double> sum(throws.size()), count(throws.size());
  dynamics::parallel_for(throws.size(), threads, [&](std::size_t i) {
    const ThrowFit& fitted = stage.held_out.throws[i];
    if (!fitted.used) return;
    const Linearisation l = stage.problem.linearise(throws[i], campaign, fitted.own, DerivativesBy::all);
    if (!l.solved) return;
    const double release = throws[i].release_or(fitted.detach);
    for (std::size_t j = 0; j < throws[i].observed.all.size(); ++j) {
      const auto& o = throws[i].observed.all[j];
      if (o.channel != m.channel || phase_of(o, throws[i].opening, release) != m.phase) continue;
      const Eigen::VectorXd slope = l.campaign.row(static_cast<Eigen::Index>(j));
      sum[i] += slope.dot(covariance * slope), count[i] += 1;
    }
  });
  const double n = std::accumulate(count.begin(), count.end(), 0.0);
  return n > 0 ? std::accumulate(sum.begin(), sum.end(), 0.0) / n : 0;
}

/// Effects beside which most of a held-out misfit vanishes, though the train throws alone do not show them
/// surely enough.
std::string suspects(const Unexplained& left, const Discovery& so_far) {
  std::string out;
  for (const Ranked& ranked : so_far.ranking)
    if (ranked.held_out_gain && *ranked.held_out_gain > 0.5 * (left.chi2_per_dof - 1))
      out += fmt::format(
          "; {}, fitted to the train throws, would take most of it away, but is not told from none by them",
          ranked.id);
  return out;
}

}  // namespace

std::optional<Unexplained> left_in_one_half(const Stage& stage, const Discovery& so_far,
                                            const DiscoverOptions& options) {
  constexpr double kFar = 10;  // parameters from one half leave less in the other
  std::optional<Unexplained> out;
  for (const bool train : {true, false}) {
    const FitResult& half = train ? stage.fit : stage.held_out;
    const FitResult& other = train ? stage.held_out : stage.fit;
    for (const ChannelMisfit& m : half.misfit) {
      const ChannelMisfit* there = find_misfit(other.misfit, m.channel, m.phase);
      if (!is_misfit(m, options) || (there && is_left(*there, options))) continue;
      const double from = unexplained_from(m.channel, m.phase, false, options);
      if (m.chi2_per_sample() < kFar * from) continue;
      if (out && m.chi2_per_sample() <= out->chi2_per_dof) continue;
      if (!train && m.chi2_per_sample() < kFar * (from + by_parameters(stage, m, options.fit.threads)))
        continue;
      out = Unexplained{m.phase, m.channel, m.chi2_per_sample(), {}, {}};
      out->description = fmt::format(
          "{} in {}: {:.3g} times the variance of the noise in the {} throws, {:.3g} times in the {} ones; "
          "nearly all of it is of {}: something is wrong with them, or it shows in them alone",
          to_string(m.channel), to_string(m.phase), m.chi2_per_sample(), train ? "train" : "held-out",
          there ? there->chi2_per_sample() : 1.0, train ? "held-out" : "train",
          held_by(stage, half, m, options.fit.threads));
    }
  }
  if (out) out->description += suspects(*out, so_far);
  return out;
}

}  // namespace unhand::fitting
