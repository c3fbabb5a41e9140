#include "fitting/fit.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <string>

#include "dynamics/dense_solve.hpp"
#include "dynamics/effect.hpp"
#include "experiment/campaign_effects.hpp"
#include "fitting/fit_rounds.hpp"
#include "fitting/give_start.hpp"
#include "fitting/profile.hpp"

namespace unhand::fitting {

using dynamics::Spectrum, dynamics::spectrum_of;

namespace {

/// Fewer conditions than these say too little of how far they agree.
constexpr std::size_t kFewestClusters = 4;

void describe_open_directions(const Eigen::MatrixXd& information, const CampaignProblem& problem,
                              const std::vector<double>& scale, FitResult& out) {
  const auto n = static_cast<Eigen::Index>(scale.size());
  Eigen::MatrixXd scaled = information;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      scaled(i, j) *= scale[static_cast<std::size_t>(i)] * scale[static_cast<std::size_t>(j)];
  const Spectrum spectrum = spectrum_of(scaled);
  for (Eigen::Index k = 0; k < n; ++k) {
    const double sigma = spectrum.values[k] > 0 ? 1 / std::sqrt(spectrum.values[k]) : HUGE_VAL;
    if (sigma < kOpen) continue;
    OpenDirection open;
    open.sigma = sigma;
    Eigen::VectorXd v = spectrum.vectors.col(k);
    Eigen::Index largest = 0;
    v.cwiseAbs().maxCoeff(&largest);
    if (v[largest] < 0) v = -v;
    open.direction.assign(v.begin(), v.end());
    for (std::size_t i = 0; i < scale.size(); ++i) {
      if (!open.moves(i)) continue;
      const Unknown& u = problem.campaign()[i];
      open.meaning += fmt::format("{}{} {:+.3g}{}", open.meaning.empty() ? "" : " with ", u.name,
                                  open.direction[i] * u.scale, dynamics::after_number(u.unit));
    }
    out.open.push_back(std::move(open));
  }
}

/// By the scatter between conditions, whose repetitions share what the law gets wrong about them, where there
/// are enough of them and the channels are weighed as witnesses, too; else between throws.
ScatterCovariance scatter_of(const CampaignProblem& problem, const FitRounds& rounds,
                             const Eigen::MatrixXd& prior, FitResult& out) {
  std::vector<std::string> condition;
  for (const std::size_t i : rounds.used()) condition.push_back(problem.throws()[i].prepared.experiment());
  const std::size_t n = std::set<std::string>(condition.begin(), condition.end()).size();
  out.by_conditions = rounds.shared().options.weigh == Weigh::witnesses && n >= kFewestClusters;
  out.clusters = static_cast<int>(out.by_conditions ? n : condition.size());
  return out.by_conditions ? scatter_covariance(rounds.equations(), condition, prior)
                           : scatter_covariance(rounds.equations(), prior);
}

/// Values, covariance and what the log leaves open.
void describe_campaign(const CampaignProblem& problem, const FitRounds& rounds, FitResult& out) {
  const auto& scale = rounds.shared().scale;
  const auto width = static_cast<Eigen::Index>(out.campaign.size());
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(width, width);
  for (Eigen::Index k = 0; k < width; ++k) {
    const Unknown& u = problem.campaign()[static_cast<std::size_t>(k)];
    if (u.prior_sigma) prior(k, k) = 1 / (*u.prior_sigma * *u.prior_sigma);
    if (rounds.is_fixed(u)) prior(k, k) = 1e30 / (u.scale * u.scale);
  }
  const auto [covariance, degrees_of_freedom, noise] = scatter_of(problem, rounds, prior, out);
  const Eigen::MatrixXd information = rounds.information(), data = guarded_inverse(information, scale);
  const auto values = rounds.campaign();
  for (Eigen::Index k = 0; k < width; ++k) {
    auto& fitted = out.campaign[static_cast<std::size_t>(k)];
    const auto& u = fitted.unknown;
    fitted.value = values[static_cast<std::size_t>(k)];
    fitted.sigma = rounds.is_fixed(u) ? 0 : std::sqrt(covariance(k, k));
    fitted.data_sigma = rounds.is_fixed(u) ? HUGE_VAL : std::sqrt(data(k, k));
    fitted.degrees_of_freedom = degrees_of_freedom[k];
    const double margin = 1e-6 * (u.high - u.low);
    fitted.at_bound = fitted.value < u.low + margin || fitted.value > u.high - margin;
    for (Eigen::Index j = 0; j < width; ++j) {
      const bool held =
          rounds.is_fixed(u) || rounds.is_fixed(problem.campaign()[static_cast<std::size_t>(j)]);
      out.covariance.push_back(held ? 0 : covariance(k, j));
    }
  }
  if (!rounds.shared().options.all_fixed) describe_open_directions(information, problem, scale, out);
}

using PhaseMisfits = std::array<ChannelMisfit, kPhaseCount * kChannelCount>;

/// Adds a throw's residuals, and remembers the throw that errs most. In place of the weights the sum of their
/// squares.
void add_throw(const CampaignThrow& thrown, const ThrowEquations& part, const Weighting& weighting,
               PhaseMisfits& groups) {
  PhaseMisfits own;
  for (std::size_t j = 0; j < thrown.observed.all.size(); ++j) {
    const auto& o = thrown.observed.all[j];
    const int where = part_of(o, thrown, part.detach);
    const Phase phase = phase_of_part(where);
    const auto g =
        static_cast<std::size_t>(static_cast<int>(phase) * kChannelCount + static_cast<int>(o.channel));
    const double r = part.residual[static_cast<Eigen::Index>(j)];
    own[g].n += 1;
    own[g].chi2 += r * r;
    const double weight = weighting.group[group_of(where, o.channel)];
    if (groups[g].n == 0 && own[g].n == 1) groups[g] = {o.channel, phase, 0, 0, 0};
    groups[g].weight += weight * weight;
  }
  for (std::size_t g = 0; g < own.size(); ++g) {
    ChannelMisfit& m = groups[g];
    m.n += own[g].n;
    m.chi2 += own[g].chi2;
    if (own[g].n > 0 && (m.worst_n == 0 || own[g].chi2 - own[g].n > m.worst_chi2 - m.worst_n))
      m.worst_n = own[g].n, m.worst_chi2 = own[g].chi2;
  }
}

/// Every throw's part, and the misfit by channel and phase.
void describe_throws(const CampaignProblem& problem, const FitRounds& rounds, FitResult& out) {
  const auto& weight = rounds.shared().weighting.group;
  out.group_weight.assign(weight.begin(), weight.end());
  PhaseMisfits groups;
  for (std::size_t i = 0; i < rounds.used().size(); ++i) {
    const auto& part = rounds.equations().throws[i];
    const CampaignThrow& thrown = problem.throws()[rounds.used()[i]];
    ThrowFit& one = out.throws[rounds.used()[i]];
    one.used = true;
    one.weight = part.weight;
    one.chi2 = part.chi2;
    one.own = rounds.own(i);
    one.modes = part.modes;
    one.detach = part.detach;
    out.samples += static_cast<long>(thrown.observed.all.size());
    add_throw(thrown, part, rounds.shared().weighting, groups);
  }
  for (ChannelMisfit& m : groups) {
    if (m.n == 0) continue;
    m.weight = std::sqrt(m.weight / m.n);
    out.chi2 += m.chi2;
    out.misfit.push_back(m);
  }
  const auto& unknowns = problem.campaign();
  const auto fitted =
      std::count_if(unknowns.begin(), unknowns.end(), [&](const Unknown& u) { return !rounds.is_fixed(u); });
  out.degrees_of_freedom =
      out.samples - fitted - static_cast<long>(rounds.used().size() * problem.own().size());
}

/// The sizes of effects among the campaign's unknowns, of one-sided effects alone or of all. At their neutral
/// values one-sided ones may have no derivative, so that a fit that is there cannot leave.
std::vector<std::size_t> effect_sizes(const CampaignProblem& problem, bool one_sided) {
  std::vector<std::size_t> out;
  for (const auto& id : problem.options().effects) {
    const dynamics::Effect effect = find_effect(id);
    for (const auto& p : effect.parameters)
      for (std::size_t k = 0; k < problem.campaign().size(); ++k)
        if ((effect.one_sided || !one_sided) && !p.is_shape() &&
            experiment::without_object(problem.campaign()[k].name) == effect.full_name(p))
          out.push_back(k);
  }
  return out;
}

void validate(const FitOptions& options, const CampaignProblem& problem) {
  const auto require = [](bool ok, const std::string& what) {
    if (!ok) throw std::invalid_argument("fit: " + what);
  };
  const auto sized = [&](const char* name, std::size_t size, std::size_t wanted, const char* what) {
    require(size == 0 || size == wanted,
            fmt::format("{} has {} values, not 0 or {}, one for each of the {}", name, size, wanted, what));
  };
  require(options.rounds >= 1, fmt::format("rounds = {} is not in [1, inf)", options.rounds));
  require(options.iterations >= 1, fmt::format("iterations = {} is not in [1, inf)", options.iterations));
  require(options.sample_limit > 0,
          fmt::format("sample_limit = {} is not in (0, inf]", options.sample_limit));
  require(options.throw_limit > 0, fmt::format("throw_limit = {} is not in (0, inf]", options.throw_limit));
  require(options.accuracy > 0 && options.accuracy < 1,
          fmt::format("accuracy = {} is not in (0, 1)", options.accuracy));
  sized("start", options.start.size(), problem.campaign().size(), "campaign's unknowns");
  sized("own_spread", options.own_spread.size(), problem.own().size(), "throws' own unknowns");
  sized("throws", options.throws.size(), problem.throws().size(), "log's throws");
  for (std::size_t k = 0; k < options.start.size(); ++k) {
    const Unknown& u = problem.campaign()[k];
    const double x = options.start[k];
    const double rounding = 1e-9 * (u.high - u.low);
    require(x >= u.low - rounding && x <= u.high + rounding,
            fmt::format("start: {} = {} is not in [{}, {}]{}", u.name, x, u.low, u.high,
                        dynamics::after_number(u.unit)));
  }
  for (const double x : options.own_spread)
    require(x > 0 && std::isfinite(x), fmt::format("own_spread: {} is not in (0, inf)", x));
  for (const auto& name : options.fixed)
    require(std::any_of(problem.campaign().begin(), problem.campaign().end(),
                        [&](const Unknown& u) { return u.name == name; }),
            fmt::format("fixed: the campaign has no unknown '{}'", name));
}

FitResult fit_from(std::vector<double> start, const CampaignProblem& problem, const FitOptions& options) {
  const auto begin = Clock::now();
  FitResult out;
  out.share = options.share;
  const auto& unknowns = problem.campaign();
  for (std::size_t k = 0; k < start.size(); ++k)
    start[k] = std::clamp(start[k], unknowns[k].low, unknowns[k].high);
  for (const auto& u : unknowns) out.campaign.push_back({u, u.start, HUGE_VAL, HUGE_VAL, false, 1, {}});
  for (const auto& thrown : problem.throws()) {
    auto& one = out.throws.emplace_back();
    one.id = thrown.prepared.id;
    one.own.assign(problem.own().size(), 0.0);
  }
  FitRounds rounds(problem, options, start);
  for (std::size_t i = 0; i < out.throws.size(); ++i) {
    out.throws[i].why_not = rounds.why_not()[i];
    out.not_simulated += !out.throws[i].why_not.empty();
  }
  if (rounds.used().empty()) {
    out.outcome = FitOutcome::no_start;
    const bool any =
        std::any_of(problem.throws().begin(), problem.throws().end(),
                    [&](const CampaignThrow& one) { return takes(options.share, one.prepared.split); });
    out.message =
        !any ? fmt::format("none of the log's {} throws has the split '{}', and no others are fitted to",
                           problem.throws().size(), options.share == Share::train ? "train" : "test")
        : rounds.refused()
            ? fmt::format("throw {} could not be simulated with the parameters that the fit starts from: {}",
                          out.throws[*rounds.refused()].id, out.why_not())
            : fmt::format(
                  "no throw of the fit's share could be simulated with the parameters that it starts "
                  "from: {}",
                  out.why_not());
    return out;
  }
  for (int round = 0; round < options.rounds; ++round) {
    const bool last = round + 1 == options.rounds;
    const bool usable = rounds.solve(last);
    out.iterations = rounds.iterations();
    out.message = rounds.solution().message;
    if (!usable) {
      out.outcome = FitOutcome::not_solved;
      return out;
    }
    if (!last) rounds.learn();
  }
  out.outcome = rounds.solution().converged ? FitOutcome::converged : FitOutcome::iterations_spent;
  out.own_spread = rounds.shared().own_sigma;
  out.mode_changes = rounds.mode_changes();
  describe_campaign(problem, rounds, out);
  describe_throws(problem, rounds, out);
  if (options.profile) profile(rounds, out);
  out.seconds = seconds_since(begin);
  out.jacobian_seconds = 1e-9 * static_cast<double>(rounds.shared().jacobian_nanoseconds.load());
  return out;
}

}  // namespace

FitResult fit(const CampaignProblem& problem, const FitOptions& options) {
  validate(options, problem);
  if (!options.start.empty()) return fit_from(options.start, problem, options);
  const auto free_sizes = [&](bool one_sided) {  // what is held stays at its start
    auto out = effect_sizes(problem, one_sided);
    std::erase_if(out, [&](std::size_t k) {
      return options.all_fixed || std::find(options.fixed.begin(), options.fixed.end(),
                                            problem.campaign()[k].name) != options.fixed.end();
    });
    return out;
  };
  const std::vector<std::size_t> sizes = free_sizes(true);
  const auto start = [&](double share) {  // of a typical step
    std::vector<double> out = problem.start();
    for (const std::size_t k : sizes) out[k] += share * problem.campaign()[k].scale;
    return out;
  };
  FitResult out = fit_from(start(1), problem, options);
  // Where a typical size is far too large, the first step overshoots to neutral and stays there. Pads give by
  // anything from micrometres to a millimetre.
  const auto is_stuck = [&] {
    return out.is_answer() && std::any_of(sizes.begin(), sizes.end(), [&](std::size_t k) {
             return out.campaign[k].at_bound && out.campaign[k].value < problem.campaign()[k].scale;
           });
  };
  const auto try_from = [&](const std::vector<double>& values) {
    FitResult other = fit_from(values, problem, options);
    const double seconds = out.seconds + other.seconds,
                 jacobian = out.jacobian_seconds + other.jacobian_seconds;
    // Deviances of the same throws; a start from which more of them have an answer is the better one.
    const bool likelier =
        other.samples == out.samples ? other.deviance() < out.deviance() : other.samples > out.samples;
    if (other.is_answer() && (!out.is_answer() || likelier)) out = std::move(other);
    out.seconds = seconds, out.jacobian_seconds = jacobian;
  };
  for (const double share : {0.1, 0.01}) {
    if (!is_stuck()) break;
    try_from(start(share));
  }
  const auto& effects = problem.options().effects;
  if (std::find(effects.begin(), effects.end(), "contact.pad_compliance") != effects.end() &&
      out.is_answer() && !options.all_fixed && options.fixed.empty())
    if (const auto other = likelier_give(problem, out.values(), out.throws, options)) try_from(*other);
  if (effects.size() < 2) return out;
  // Several effects may stand for each other, each with a minimum of its own in which it does most.
  constexpr double kMost = 4, kLeast = 0.1;  // typical steps
  for (const std::size_t k : free_sizes(false)) {
    std::vector<double> values = start(kLeast);
    values[k] =
        std::min(problem.start()[k] + kMost * problem.campaign()[k].scale, problem.campaign()[k].high);
    try_from(values);
  }
  return out;
}

}  // namespace unhand::fitting
