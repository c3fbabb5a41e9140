#include "fitting/discovery/unexplained.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "dynamics/parallel.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/misfit_rules.hpp"
#include "fitting/discovery/own_drift.hpp"
#include "fitting/discovery/traces.hpp"
#include "fitting/discovery/where_acts.hpp"
#include "fitting/distributions.hpp"
#include "fitting/evaluate.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

using Vector3 = std::array<double, 3>;
using State = ResidualTrace::State;

/// How the missing quantity moves one throw against its prediction, on a grid of time.
class Displacement {
 public:
  template <class Missing>
  Displacement(const CampaignProblem& problem, const CampaignThrow& thrown, const StateSeries& states,
               double release, Phase phase, double end, const Missing& missing) {
    const PhaseClock clock = phase_clock(thrown, release, phase);
    const double inf = std::numeric_limits<double>::infinity();
    const auto& body = thrown.prepared.body;
    Vector3 velocity{}, position{}, last{};
    for (double t = clock.origin; t <= end + kStep; t += kStep) {
      Vector3 a{};
      const bool acts = phase == Phase::flight || t < release;
      if (acts) a = missing((t - clock.origin) / clock.scale, states.at(thrown, t));
      if (acts && phase == Phase::release) {  // a pad's wrench in the hand's frame
        const auto hand = thrown.prepared.hand.at(dynamics::Window{-inf, inf}, t);
        const auto f = dynamics::rotate(hand.pose.theta, dynamics::Vec2<double>{a[0], a[1]});
        const State s = states.at(thrown, t);
        const double lever = thrown.prepared.grasp.com_offset, pads = problem.model().pads;
        const double rx = lever * std::cos(s.theta), rz = lever * std::sin(s.theta);
        a = {pads * f.x / body.mass, pads * f.z / body.mass,
             pads * (a[2] + rz * f.x - rx * f.z) / body.inertia};
      }
      if (!time_.empty())
        for (std::size_t c = 0; c < 3; ++c) {
          position[c] += kStep * velocity[c] + kStep * kStep * (2 * last[c] + a[c]) / 6;
          velocity[c] += 0.5 * kStep * (last[c] + a[c]);
        }
      last = a;
      time_.push_back(t);
      at_.push_back(position);
    }
  }
  Vector3 at(double t) const {
    if (time_.empty() || t <= time_.front()) return {};
    const auto k = std::min(static_cast<std::size_t>((t - time_.front()) / kStep), time_.size() - 1);
    return at_[k];
  }

 private:
  static constexpr double kStep = 1e-3;  // [s]
  std::vector<double> time_;
  std::vector<Vector3> at_;
};

/// Mean square errors of one throw's prediction: in flight [m²] and of the landing [σ²].
struct OutcomeSquares {
  double flight{}, samples{}, landing{}, landings{};
};

template <class Missing>
OutcomeSquares squares_with(const CampaignProblem& problem, const CampaignThrow& thrown,
                            const Linearisation& predicted, Phase phase, const Missing& missing) {
  OutcomeSquares out;
  const Eigen::VectorXd& residual = predicted.residual;
  const StateSeries states = states_of(thrown, residual, MotionOf::model);
  if (states.time.empty()) return out;  // where it moved, and how fast, is not known
  const double release = thrown.release_or(predicted.detach), g = -thrown.prepared.gravity.z;
  double end = release;
  for (const auto& o : thrown.observed.all) end = std::max(end, o.time);
  const Displacement moved(problem, thrown, states, release, phase, end, missing);
  for (std::size_t j = 0; j < thrown.observed.all.size(); ++j) {
    const auto& o = thrown.observed.all[j];
    const double error = residual[static_cast<Eigen::Index>(j)] * o.sigma;
    const Phase in = phase_of(o, thrown.opening, release);
    const Vector3 by = moved.at(o.time);
    if (in == Phase::flight && (o.channel == Channel::mocap_x || o.channel == Channel::mocap_z)) {
      const double e = error + by[o.channel == Channel::mocap_x ? 0 : 1];
      out.flight += e * e;
      if (o.channel == Channel::mocap_x) out.samples += 1;
    }
    if (o.channel == Channel::landing_x || o.channel == Channel::landing_theta) {
      State s = states.at(thrown, o.time);
      s.vz -= g * (o.time - states.time.back());
      const double later = s.vz < -0.1 ? -by[1] / s.vz : 0;  // it passes the height that much later
      const double e =
          o.channel == Channel::landing_x ? error + by[0] + s.vx * later : error + by[2] + s.omega * later;
      out.landing += e * e / (o.sigma * o.sigma);
      out.landings += 1;
    }
  }
  return out;
}

}  // namespace

std::optional<MissingEstimate> estimate_missing(const Stage& stage, Phase phase,
                                                const DiscoverOptions& options) {
  if (phase == Phase::landing) phase = Phase::flight;
  if (phase == Phase::grasped) return std::nullopt;
  const auto& problem = stage.problem;
  MissingEstimate out;
  out.phase = phase;
  const PhaseTraces seen = traces_of(stage.problem, stage.fit, phase, options.fit.threads);
  if (seen.all.size() < 4) return std::nullopt;
  for (const auto& [name, number] : seen.objects) out.groups.push_back({name, number});
  out.curves = missing_curves(seen.all, seen.how);
  out.candidate = missing_terms(seen.all, seen.how);

  // As a correction, on held-out throws that are predicted from what is known before the throw.
  std::vector<std::size_t> held_out;
  for (std::size_t i = 0; i < problem.throws().size(); ++i)
    if (stage.held_out.throws[i].used) held_out.push_back(i);
  const auto predicted = predict_some(problem, stage.fit, held_out, {false, options.fit.threads});
  constexpr int kTried = 3;
  std::vector<std::array<OutcomeSquares, kTried>> squares(held_out.size());
  dynamics::parallel_for(held_out.size(), options.fit.threads, [&](std::size_t k) {
    const CampaignThrow& thrown = problem.throws()[held_out[k]];
    const auto l = problem.linearise(thrown, stage.fit.values(), predicted[k].own, DerivativesBy::nothing);
    if (!l.solved) return;
    const int group = seen.objects.at(thrown.prepared.object);
    const auto curve = std::find_if(out.curves.begin(), out.curves.end(),
                                    [&](const MissingCurve& c) { return c.group == group; });
    squares[k][0] = squares_with(problem, thrown, l, phase, [](double, const State&) { return Vector3{}; });
    squares[k][1] = squares_with(problem, thrown, l, phase, [&](double t, const State&) {
      return curve == out.curves.end() ? Vector3{} : curve->at(t);
    });
    squares[k][2] =
        squares_with(problem, thrown, l, phase, [&](double, const State& s) { return out.candidate.at(s); });
  });
  std::array<OutcomeSquares, kTried> sum{};
  for (const auto& of : squares)
    for (std::size_t c = 0; c < kTried; ++c) {
      sum[c].flight += of[c].flight, sum[c].samples += of[c].samples;
      sum[c].landing += of[c].landing, sum[c].landings += of[c].landings;
    }
  // Of the motion in flight where it was seen, of the landing otherwise.
  const bool tracked = sum[0].samples > 0;
  if (!tracked && !(sum[0].landings > 0)) {
    out.correction = Correction::not_judged;
    return out;
  }
  const auto error = [&](std::size_t c) {
    return tracked ? std::sqrt(sum[c].flight / sum[c].samples) : std::sqrt(sum[c].landing / sum[c].landings);
  };
  out.error_before = out.error_after = error(0);
  out.error_unit = tracked ? "m" : "sigma";
  for (std::size_t c = 1; c < kTried; ++c) {
    if (c == 2 && out.candidate.terms.empty()) continue;
    if (!(error(c) < *out.error_after * (out.correction == Correction::withheld ? kCorrects : 1.0))) continue;
    out.error_after = error(c);
    out.correction = c == 1 ? Correction::curve : Correction::candidate;
  }
  return out;
}

namespace {

bool is_tracked(Channel c) {
  return c == Channel::mocap_x || c == Channel::mocap_z || c == Channel::mocap_theta;
}

/// Whether tracked flights lack no acceleration, of whatever form, that chance would not show: what is off in
/// them then is how they begin, and has its cause before the detach.
bool lacks_no_acceleration(const Stage& stage, const DiscoverOptions& options) {
  const PhaseTraces flights = traces_of(stage.problem, stage.fit, Phase::flight, options.fit.threads);
  double fall = 0;
  int values = 0;
  for (const MissingCurve& curve : missing_curves(flights.all, flights.how)) {
    fall += curve.chi2_before - curve.chi2_after;
    values += 3 * static_cast<int>(curve.knots.size());
  }
  return values > 0 && chi2_tail(fall, values) > options.family_wise_level;
}

/// √χ² of what a channel leaves where it is white and alike in all phases, as a declared σ that is too small
/// leaves it: the number that it is too small by.
std::optional<double> too_small_by(const Discovery& so_far, Channel channel) {
  constexpr int kFewest = 50;                     // samples of a phase
  constexpr double kWhite = 0.15, kAlike = 1.15;  // autocorrelation; √χ² of a phase against all
  constexpr double kLeast = 1.2;                  // less is no matter of a declaration
  const StructureOptions named;
  double sum = 0, n = 0;
  std::vector<double> each;
  for (const auto& s : so_far.structure_after) {
    if (s.channel != channel || s.structure.n < kFewest) continue;
    if (std::abs(s.structure.autocorrelation) > kWhite) return {};
    for (const Dependence& d : s.structure.depends)
      if (d.share > named.share && d.p_value < named.level) return {};
    sum += s.structure.n * s.structure.chi2_per_sample, n += s.structure.n;
    each.push_back(std::sqrt(s.structure.chi2_per_sample));
  }
  if (each.size() < 2) return {};
  const double mean = std::sqrt(sum / n);
  for (const double one : each)
    if (one > kAlike * mean || mean > kAlike * one) return {};
  if (mean < kLeast) return {};
  return mean;
}

/// No law of pads is quite right; of flight and of sensors they are.
double rest_of(const Stage& stage) { return acts_on_pads(stage) ? kRest : 0; }

/// What the answer leaves of a channel in a phase.
std::string in_words(const Discovery& so_far, const Unexplained& left) {
  std::string words = fmt::format("{:.3g} times the variance of the noise", left.chi2_per_dof);
  for (const auto& s : so_far.structure_after)
    if (s.channel == left.channel && s.phase == left.phase) words = s.structure.in_words();
  return fmt::format("{} in {}: {}", to_string(left.channel), to_string(left.phase), words);
}

/// Where a channel leaves more than noise: the first phase, and in it the channel in which most is left.
std::optional<Unexplained> left_in_channels(const Stage& stage, const Discovery& so_far,
                                            const DiscoverOptions& options) {
  std::optional<Unexplained> out;
  const std::vector<ChannelMisfit> left = left_by_answer(stage, so_far, options);
  const ChannelMisfit* worst = nullptr;
  for (const ChannelMisfit& m : left) {
    if (!worst || m.chi2_per_sample() > worst->chi2_per_sample()) worst = &m;
    if (out && (m.phase != out->phase || m.chi2_per_sample() <= out->chi2_per_dof)) continue;
    out = Unexplained{m.phase, m.channel, m.chi2_per_sample(), {}, {}};
  }
  if (!out) return out;
  out->description = in_words(so_far, *out);
  constexpr double kFarMore = 3;
  if (worst->phase != out->phase && worst->chi2_per_sample() > kFarMore * out->chi2_per_dof)
    out->description += fmt::format("; most is left in {} in {}, {:.3g} times", to_string(worst->channel),
                                    to_string(worst->phase), worst->chi2_per_sample());
  if (const auto factor = too_small_by(so_far, out->channel))
    out->description +=
        fmt::format("; white and alike in all phases: a sigma too small by {:.2g} would do", *factor);
  else if (out->phase == Phase::flight && is_tracked(out->channel) && lacks_no_acceleration(stage, options)) {
    out->phase = Phase::release;
    out->description = "in release, seen in " + out->description;
    out->description += ", from how flights begin: they lack no acceleration";
  }
  return out;
}

/// Where flights asked for what no effect has the form of, though no channel need show it any more: in the
/// tracked channel that is off most.
std::optional<Unexplained> asked_for_in_flight(const Stage& stage, const Discovery& so_far) {
  if (!so_far.asked || !so_far.asked->unlisted) return {};
  const ChannelMisfit* worst = nullptr;
  for (const ChannelMisfit& m : stage.fit.misfit)
    if (m.phase == Phase::flight && is_tracked(m.channel) &&
        (!worst || m.chi2_per_sample() > worst->chi2_per_sample()))
      worst = &m;
  if (!worst) return {};
  Unexplained out{worst->phase, worst->channel, worst->chi2_per_sample(), {}, {}};
  out.description =
      fmt::format("{}; flights ask for an acceleration of {}", in_words(so_far, out), so_far.asked->words);
  return out;
}

/// Of what was tracked in flight, which says more than the landing does.
bool is_of_flight(const OutcomeLack& lack) {
  return lack.outcome == Outcome::position || lack.outcome == Outcome::orientation;
}

/// Outcomes that held-out throws are predicted so badly in, where the train throws confirm that it goes with
/// the condition: the fit has followed these as far as it could, so that less is left of them. Held-out
/// throws are off by what the fit is uncertain of, too: four times the scatter is beyond that.
std::vector<OutcomeLack> lacking_held_out(const Discovery& so_far, const DiscoverOptions& options) {
  constexpr double kFarOff = 4;
  std::vector<OutcomeLack> out;
  for (const OutcomeLack& lack : so_far.after_test.lacks)
    if (is_lacking(lack, options.family_wise_level / kOutcomes) && lack.fit.ratio() >= kFarOff &&
        lack_in(so_far.after_train, lack.outcome).fit.p_value < kConfirmedAt)
      out.push_back(lack);
  return out;
}

/// Where every channel is noise once a throw's own unknowns follow it, but predictions made before the throw
/// are off by what repetitions share: something acts before the detach that those unknowns take up.
std::optional<Unexplained> left_in_predictions(const Discovery& so_far, double rest,
                                               const DiscoverOptions& options) {
  std::optional<OutcomeLack> most;
  std::vector<OutcomeLack> all = lacking(so_far.after_train, so_far.after_test, options);
  const bool held_out = all.empty();
  if (held_out) all = lacking_held_out(so_far, options);
  for (const OutcomeLack& lack : all) {
    const double base = lack_in(held_out ? so_far.before_test : so_far.before_train, lack.outcome).fit.shared;
    if (!so_far.effects.empty() && lack.fit.shared < rest * base) continue;
    const bool more =
        !most || (is_of_flight(lack) == is_of_flight(*most) ? lack.fit.ratio() > most->fit.ratio()
                                                            : is_of_flight(lack));
    if (more) most = lack;
  }
  if (!most) return std::nullopt;
  constexpr Channel kShown[] = {Channel::mocap_x, Channel::mocap_theta, Channel::landing_x,
                                Channel::landing_theta};
  const Channel channel = kShown[static_cast<int>(most->outcome)];
  const bool angle = most->outcome == Outcome::orientation || most->outcome == Outcome::landing_theta;
  const double unit = angle ? experiment::kDegrees : 1e3;
  return Unexplained{
      is_of_flight(*most) ? Phase::release : Phase::landing,
      channel,
      most->fit.ratio(),
      fmt::format(
          "{}, predicted before the throw{}: {:.3g} times the mean square that repetitions scatter by "
          "({:.3g} instead of {:.3g} {} rms): the errors go with the condition",
          to_string(most->outcome), held_out ? ", on held-out throws" : "", most->fit.ratio(),
          unit * std::sqrt(most->fit.repetitions + most->fit.shared), unit * std::sqrt(most->fit.repetitions),
          angle ? "deg" : "mm"),
      {}};
}

/// Where every throw's own unknowns take up what changes over the campaign.
std::optional<Unexplained> left_in_own_unknowns(const Stage& stage, const DiscoverOptions& options) {
  const auto drift = own_drift(stage.problem, stage.fit, stage.held_out, options.family_wise_level);
  if (!drift) return std::nullopt;
  const bool friction = drift->name == "mu_deviation";
  const auto& seen = stage.fit.misfit;
  const bool felt = std::any_of(seen.begin(), seen.end(),
                                [](const ChannelMisfit& m) { return m.channel == Channel::wrench_fx; });
  const Channel shown = friction && felt               ? Channel::wrench_fx
                        : drift->name == "grasp_angle" ? Channel::mocap_theta
                                                       : Channel::mocap_x;
  return Unexplained{
      friction ? Phase::release : Phase::grasped,
      shown,
      drift->ratio,
      fmt::format("the throws' own {} drifts with their order in the log, by {:+.3g}{} from the first to the "
                  "last (correlation {:.3f} about the means of the conditions; held-out throws agree): {}",
                  drift->name, drift->change, dynamics::after_number(drift->unit), drift->correlation,
                  friction
                      ? "friction changes over the campaign, as pads do that wear or warm; every throw is "
                        "fitted a friction of its own, so that channels do not show it"
                      : "what is tracked moves against the object, or the grasp against the hand"),
      {}};
}

/// The candidate that would take most of the misfit away to first order, with how much of it; nothing where
/// that is little, as it then resembles nothing.
std::string nearest_footprint(const Stage& stage, const Discovery& so_far, const DiscoverOptions& options) {
  constexpr double kLeast = 0.25;
  double misfit = 0;
  for (const ChannelMisfit& m : stage.fit.misfit)
    if (is_misfit(m, options)) misfit += m.chi2 - m.n;
  if (so_far.ranking.empty() || !(so_far.ranking.front().gain > kLeast * misfit) || !(misfit > 0)) return {};
  const Ranked& nearest = so_far.ranking.front();
  return fmt::format("; the nearest footprint is that of {}, with {:.0f} % of the misfit to first order",
                     nearest.id, 100 * std::min(1.0, nearest.gain / misfit));
}

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

/// Where a channel is far off in one half of the throws and noise in the other: something is wrong with those
/// throws, or it acts so that only they show it.
std::optional<Unexplained> left_in_one_half(const Stage& stage, const DiscoverOptions& options) {
  constexpr double kFar = 10;  // parameters from one half leave less in the other
  std::optional<Unexplained> out;
  for (const bool train : {true, false}) {
    const FitResult& half = train ? stage.fit : stage.held_out;
    const FitResult& other = train ? stage.held_out : stage.fit;
    for (const ChannelMisfit& m : half.misfit) {
      const bool in_both = std::any_of(other.misfit.begin(), other.misfit.end(), [&](const ChannelMisfit& o) {
        return o.channel == m.channel && o.phase == m.phase && is_left(o, options);
      });
      if (!is_misfit(m, options) || in_both) continue;
      if (m.chi2_per_sample() < kFar * unexplained_from(m.channel, m.phase, false, options)) continue;
      if (out && m.chi2_per_sample() <= out->chi2_per_dof) continue;
      out =
          Unexplained{m.phase,
                      m.channel,
                      m.chi2_per_sample(),
                      fmt::format("{} in {}: {:.3g} times the variance of the noise in the {} throws, {:.3g} "
                                  "times in the {} ones; nearly all of it is of {}: something is wrong "
                                  "with them, or it shows in them alone",
                                  to_string(m.channel), to_string(m.phase), m.chi2_per_sample(),
                                  train ? "train" : "held-out", misfit_in(other.misfit, m.channel, m.phase),
                                  train ? "held-out" : "train", held_by(stage, half, m, options.fit.threads)),
                      {}};
    }
  }
  return out;
}

}  // namespace

std::vector<ChannelMisfit> left_by_answer(const Stage& stage, const Discovery& so_far,
                                          const DiscoverOptions& options) {
  const bool elsewhere = std::any_of(stage.fit.misfit.begin(), stage.fit.misfit.end(), [&](const auto& m) {
    return is_misfit(m, options) &&
           m.chi2_per_sample() >= unexplained_from(m.channel, m.phase, true, options) &&
           is_confirmed(stage.held_out.misfit, m);
  });
  std::vector<ChannelMisfit> out;
  for (const ChannelMisfit& m : stage.fit.misfit) {
    const double base = misfit_in(so_far.base.misfit, m.channel, m.phase);
    const double limit =
        std::max(unexplained_from(m.channel, m.phase, elsewhere, options), 1 + rest_of(stage) * (base - 1));
    if (is_misfit(m, options) && m.chi2_per_sample() >= limit && is_confirmed(stage.held_out.misfit, m))
      out.push_back(m);
  }
  return out;
}

std::optional<Unexplained> unexplained(const Stage& stage, const Discovery& so_far,
                                       const DiscoverOptions& options) {
  std::optional<Unexplained> out = asked_for_in_flight(stage, so_far);
  if (!out) out = left_in_channels(stage, so_far, options);
  if (!out) {
    if (auto few = left_in_one_half(stage, options)) {
      few->description += suspects(*few, so_far);
      return few;
    }
    out = left_in_predictions(so_far, rest_of(stage), options);
    if (!out) return left_in_own_unknowns(stage, options);
  }
  out->description += "; no effect of the catalogue explains it on held-out throws";
  for (const Imitation& one : so_far.imitations)
    out->description += fmt::format("; {} imitates it ({})", one.id, one.why);
  if (so_far.effects.empty() && so_far.imitations.empty() && !too_small_by(so_far, out->channel))
    out->description += nearest_footprint(stage, so_far, options);
  out->missing = estimate_missing(stage, out->phase, options);
  if (out->phase == Phase::grasped && is_tracked(out->channel)) {  // what acts there may act in flight, too
    auto in_flight = estimate_missing(stage, Phase::flight, options);
    if (in_flight && !in_flight->candidate.terms.empty()) out->missing = std::move(in_flight);
  }
  if (!out->missing) return out;
  const MissingEstimate& missing = *out->missing;
  const char* quantity = missing.phase == Phase::flight ? "acceleration in flight" : "wrench of a pad";
  const bool asked = so_far.asked && so_far.asked->unlisted;  // its terms have been said
  if (!missing.candidate.terms.empty() && !asked)
    out->description += fmt::format("; of the forms tried, the missing {} is nearest to {}", quantity,
                                    missing.candidate.in_words());
  if (missing.correction == Correction::withheld)
    out->description +=
        fmt::format("; as a correction it does not lower the held-out error by {:.0f} % and is withheld",
                    100 * (1 - kCorrects));
  else if (missing.correction == Correction::not_judged)
    out->description += "; no held-out motion was tracked to judge it by as a correction";
  else
    out->description += fmt::format("; as a correction it lowers the held-out error from {:.3g} to {:.3g} {}",
                                    *missing.error_before, *missing.error_after, missing.error_unit);
  return out;
}

}  // namespace unhand::fitting
