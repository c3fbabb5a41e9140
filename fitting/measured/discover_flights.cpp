// The loop on free flights.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "dynamics/median.hpp"
#include "fitting/clock.hpp"
#include "fitting/measured/flight_discovery.hpp"
#include "fitting/measured/measured_discovery.hpp"
#include "fitting/measured/rest_heights.hpp"

namespace unhand::fitting {
namespace {

constexpr const char *kScale = "sensor.length_scale", *kClock = "sensor.time_scale",
                     *kGravity = "flight.gravity";

constexpr double kMostScale = 0.2;  // beyond it, it is the floor that is elsewhere

bool is_one_of_the_scales(const std::string& id) { return id == kScale || id == kClock || id == kGravity; }

/// By how much reported g t²/2 would exceed the declared one if nothing but this effect were there, as a
/// share of it, and 1 σ.
struct ApparentGravity {
  double excess{}, sigma{};
};
ApparentGravity apparent_gravity(const AcceptedEffect& effect) {
  const double s = effect.parameters.front().value, sigma = effect.parameters.front().sigma;
  if (effect.id == kClock) return {1 / (s * s) - 1, 2 * sigma / (s * s * s)};
  return {s - 1, sigma};
}

/// The answer goes by another of its names, in everything that names its parameter.
void rename(AcceptedEffect& effect, const char* id, const char* parameter, MeasuredDiscovery& out) {
  const auto full = [](const std::string& of, const std::string& name) {
    return fmt::format("{}.{}", of, name);
  };
  const std::string was = full(effect.id, effect.parameters.front().name), is = full(id, parameter);
  for (auto& [other, correlation] : effect.equivalent)
    if (other == id) other = effect.id;
  effect.id = id;
  effect.parameters.front().name = parameter;
  std::replace(out.parameters.begin(), out.parameters.end(), was, is);
  for (auto& s : out.stability)
    if (s.parameter == was) s.parameter = is;
}

/// Were a scale s gravity, reported lengths would be true ones: what else was found is s times as long.
void in_reported_lengths(MeasuredDiscovery& out, double s) {
  std::map<std::string, double> factors;  // by full name
  for (auto& effect : out.effects)
    for (auto& p : effect.parameters) {
      const double factor = std::pow(s, dynamics::length_power(p.unit));
      factors[effect.id + "." + p.name] = factor;
      p.value *= factor, p.sigma *= factor;
    }
  const auto factor_of = [&](const std::string& name) {
    const auto at = factors.find(name);
    return at == factors.end() ? 1.0 : at->second;
  };
  for (auto& half : out.stability) {
    const double factor = factor_of(half.parameter);
    half.low *= factor, half.low_sigma *= factor, half.high *= factor, half.high_sigma *= factor;
  }
  const std::size_t n = out.parameters.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      out.covariance[i * n + j] *= factor_of(out.parameters[i]) * factor_of(out.parameters[j]);
}

/// Where boxes at rest put the tracker's scale nearer to none than to what the flights need, that is
/// gravity's (or the clock's).
void name_scale(const datasets::ThrowLog& log, const MeasuredOptions& options, MeasuredDiscovery& out) {
  for (auto& effect : out.effects) {
    const auto other_name = [&](const auto& other) { return other.first == kGravity; };
    if (effect.id != kScale || std::none_of(effect.equivalent.begin(), effect.equivalent.end(), other_name))
      continue;
    const double apparent = apparent_gravity(effect).excess;
    for (const auto& [name, object] : log.objects) {
      const auto rest = rest_heights(log, name, options.floor);
      if (!rest || std::abs(rest->scale) > kMostScale || 3 * rest->sigma >= std::abs(apparent)) continue;
      if (std::abs(rest->scale) >= std::abs(rest->scale - apparent)) continue;
      in_reported_lengths(out, 1 + apparent);
      rename(effect, kGravity, "ratio", out);
      break;
    }
  }
}

void weigh_scales(const datasets::ThrowLog& log, const MeasuredOptions& options, MeasuredDiscovery& out) {
  for (auto& effect : out.effects) {
    if (!is_one_of_the_scales(effect.id)) continue;
    const auto [apparent, sigma] = apparent_gravity(effect);
    out.evidence.push_back(
        {effect.id,
         fmt::format(
             "Read as gravity, the flights say {:.4f} ± {:.4f} m/s² where {:.4f} is declared; a steady "
             "pull along the vertical of {:+.3f} m/s² would be the same",
             log.gravity * (1 + apparent), log.gravity * sigma, log.gravity, -log.gravity * apparent),
         false});
    out.separating.push_back(
        {effect.id,
         "in free flight a metric scale, a clock and gravity all scale g t²/2 and nothing else: they are "
         "separated by the pose of a hand that held the object, a known length in the tracker's volume, a "
         "second clock, or a box of known size at rest on a floor of known height"});
    for (const auto& [name, object] : log.objects) {
      const auto rest = rest_heights(log, name, options.floor);
      if (rest && std::abs(rest->scale) > kMostScale) {
        out.evidence.push_back(
            {effect.id,
             fmt::format(
                 "{} throws of {} end at rest on a face, {:.4g} m above where its size puts them: the "
                 "floor is not at {:.4g} m, and with its height (--floor) they would say the scale",
                 rest->n, name, rest->above, options.floor),
             false});
      } else if (rest) {
        const double apart = (rest->scale - apparent) / std::hypot(rest->sigma, sigma);
        const bool scaled = std::abs(rest->scale) > 4 * rest->sigma && rest->scale * apparent > 0;
        const bool enough = std::abs(rest->scale - apparent) < 0.5 * std::abs(apparent);
        out.evidence.push_back(
            {effect.id,
             fmt::format("{} throws of {} end at rest on a face: if the floor is at {:.4g} m, its known size "
                         "makes the metric scale "
                         "{:.4f} ± {:.4f} (the flights would need {:.4f} ± {:.4f}; {:.1f} sigma apart). {}",
                         rest->n, name, options.floor, 1 + rest->scale, rest->sigma, 1 + apparent, sigma,
                         std::abs(apart),
                         scaled && enough ? "That is a metric scale, not gravity and not the clock"
                         : scaled         ? "The scale is off, but not by what the flights need"
                                          : "The scale is not off: gravity or the clock is"),
             !(scaled && enough)});
        std::string where;
        for (std::size_t a = 0; a < 3; ++a)
          if (rest->offset[a])
            where += fmt::format("{}{:+.2f} ± {:.2f}", where.empty() ? "" : ", ", 1e3 * *rest->offset[a],
                                 1e3 * rest->offset_sigma[a]);
        out.evidence.push_back({"sensor.com_offset",
                                fmt::format("At rest, the tracked point of {} lies ({}) mm from the middle "
                                            "of the box: what the flights say beyond that is "
                                            "the distance of the CoM from the middle",
                                            name, where),
                                false});
      }
      if (object.dims && object.mass > 0) {
        constexpr double kAir = 1.2, kAddedMass = 0.67;  // kg/m³; of a cube, in units of the air it displaces
        const double share = kAir * (*object.dims)[0] * (*object.dims)[1] * (*object.dims)[2] / object.mass;
        out.evidence.push_back({effect.id,
                                fmt::format("Air that {} displaces weighs {:.2f} % of it: buoyancy and the "
                                            "added mass (of a cube) make gravity seem {:.2f} % "
                                            "smaller, and no flight tells that from a scale",
                                            name, 100 * share, 100 * share * (1 + kAddedMass)),
                                std::abs(share * (1 + kAddedMass)) > 2 * sigma});
      }
    }
  }
}

/// A drag that no box of that size has is not the whole truth.
void weigh_drag(const datasets::ThrowLog& log, MeasuredDiscovery& out) {
  constexpr double kAir = 1.2, kLargest = 1.3;  // kg/m³; tumbling cubes are reported at about 1
  for (const auto& effect : out.effects) {
    if (effect.id != "flight.quadratic_drag") continue;
    out.separating.push_back({effect.id, "drag in proportion to v² or to v: throws at twice the speed"});
    if (log.dimension != 3) continue;  // in a plane a box does not show all its sides
    for (const auto& [name, object] : log.objects)
      for (const auto& p : effect.parameters) {
        if (p.name != "k[" + name + "]" || !object.dims || !(object.mass > 0)) continue;
        const auto& d = *object.dims;
        const double area =
            0.5 * (d[0] * d[1] + d[1] * d[2] + d[2] * d[0]);  // Cauchy: a quarter of the surface
        const double factor = 2 * object.mass / (kAir * area);
        out.evidence.push_back({effect.id,
                                fmt::format("k = {:.4f} ± {:.4f} 1/m is a drag coefficient of {:.2f} ± "
                                            "{:.2f} on the mean area that a turning "
                                            "box of its size shows; boxes are known for about 1",
                                            p.value, p.sigma, factor * p.value, factor * p.sigma),
                                factor * p.value > kLargest});
      }
  }
}

/// flight.cubic_drag is traceless: it shapes a drag by how a cube lies in the air, by k + κ (s − 3/5) with s
/// from 1/3 along a diagonal to 1 along an axis. Where that is negative, the air would push.
void weigh_thrust(const datasets::ThrowLog& log, const FlightProblem& problem, MeasuredDiscovery& out) {
  std::vector<double> speeds;
  for (const auto& g : problem.groups()) speeds.push_back(g.covariates.front());
  const double speed = std::max(1e-9, dynamics::median(speeds));
  for (const auto& [name, object] : log.objects) {
    // The drag: declared, quadratic, and linear at the speed of a launch.
    double drag = object.drag_k.value_or(0), variance = 0;
    const Parameter* shape = nullptr;
    for (const auto& effect : out.effects)
      for (const auto& p : effect.parameters) {
        const bool linear = effect.id == "flight.linear_drag" && p.name == "c[" + name + "]";
        const double per = linear ? speed : 1;
        if (linear || (effect.id == "flight.quadratic_drag" && p.name == "k[" + name + "]"))
          drag += p.value / per, variance += std::pow(p.sigma / per, 2);
        if (p.name == "kappa[" + name + "]") shape = &p;
      }
    if (!shape) continue;
    constexpr double kMean = 0.6;
    const double along = shape->value < 0 ? 1 - kMean : 1.0 / 3 - kMean, least = drag + along * shape->value,
                 sigma = std::sqrt(variance + std::pow(along * shape->sigma, 2));
    if (!(least + 2 * sigma < 0)) continue;
    out.evidence.push_back(
        {"flight.cubic_drag",
         fmt::format(
             "Along {} of {} the drag adds up to {:.4f} ± {:.4f} 1/m: air would push there, so that "
             "this is no drag by itself; it has the form of one, and what it is the flights do not say",
             shape->value < 0 ? "an axis" : "a diagonal", name, least, sigma),
         true});
  }
}

/// χ² per sample of some train flights without their first or last frames, each flight's start fitted to the
/// others; of all frames where `first` and `last` are 0.
double left_without(const FlightProblem& problem, const GroupedFit& fit, std::size_t first,
                    std::size_t last) {
  constexpr std::size_t kAsked = 40;  // flights are enough to tell
  double chi2 = 0, n = 0;
  std::size_t asked = 0;
  for (std::size_t i = 0; i < fit.groups.size() && asked < kAsked; ++i) {
    if (!fit.groups[i].used || !fit.groups[i].solved) continue;
    const auto& rows = problem.groups()[i].rows;
    std::vector<double> times;
    for (const GroupRow& row : rows)
      if (row.channel != kPriorChannel && (times.empty() || row.time > times.back()))
        times.push_back(row.time);
    if (times.size() < 3 * (first + last) + 3) continue;
    const double from = times[first], to = times[times.size() - 1 - last];
    const auto stays = [&](const GroupRow& row) { return row.time >= from && row.time <= to; };
    const GroupFit part = fit_own_part(problem, i, fit, stays);
    if (!part.solved) continue;
    ++asked;
    for (std::size_t j = 0; j < rows.size(); ++j)
      if (rows[j].channel != kPriorChannel && stays(rows[j]))
        chi2 += std::pow(part.residual[static_cast<Eigen::Index>(j)], 2), n += 1;
  }
  return n > 0 ? chi2 / n : std::nan("");
}

/// Whether a misfit lies in the first or in the last frames: a recording that begins in the hand, or goes on
/// into an impact. An acceleration that is missing bends all of a flight.
void weigh_ends(const FlightProblem& problem, const GroupedFit& fit, MeasuredDiscovery& out) {
  constexpr std::size_t kFrames = 4;
  constexpr double kGoes = 0.25;  // of the misfit stays
  constexpr double kMisfit = 2;   // χ² per sample
  if (!out.unexplained) return;
  const double all = left_without(problem, fit, 0, 0);
  if (!(all > kMisfit)) return;
  const double begins = left_without(problem, fit, kFrames, 0), ends = left_without(problem, fit, 0, kFrames);
  const auto tell = [&](double without, double other, const char* which, const char* cause) {
    if (!(without - 1 < kGoes * (all - 1)) || !(without - 1 < kGoes * (other - 1))) return;
    out.evidence.push_back({"",
                            fmt::format("Without the {} {} frames of each flight {:.3g} times the variance "
                                        "of the noise is left of {:.3g}: "
                                        "{}? Then declare free_flight to be shorter",
                                        which, kFrames, without, all, cause),
                            false});
  };
  tell(begins, ends, "first", "does the recording begin while something still holds the object");
  tell(ends, begins, "last", "does it go on after the object has met something");
}

/// A declared drag that is too large: no effect takes of it, as none is a thrust.
void weigh_declared_drag(const datasets::ThrowLog& log, const FlightProblem& problem,
                         const EffectSearch& search, const MeasuredOptions& options, MeasuredDiscovery& out) {
  const std::string drag = "flight.quadratic_drag";
  const bool declared = std::any_of(log.objects.begin(), log.objects.end(),
                                    [](const auto& object) { return object.second.drag_k.value_or(0) > 0; });
  if (!out.unexplained || !declared || is_accepted(drag, out.effects)) return;
  for (const auto& [parameter, value, sigma] : asked_beside(problem, search.final, drag, options))
    for (const auto& [name, object] : log.objects)
      if (parameter.short_name == "k[" + name + "]" && value < 0 && object.drag_k.value_or(0) > 0)
        out.evidence.push_back(
            {drag,
             fmt::format(
                 "The flights of {} ask for {:.3g} ± {:.2g} 1/m less than its declared drag_k of {:.4g} 1/m: "
                 "is that too large?",
                 name, -value, sigma, *object.drag_k),
             false});
}

}  // namespace

NamedErrors named_errors(const FlightProblem& problem, const GroupedFit& fit, int threads) {
  const FlightErrors e = flight_errors(problem, fit, threads);
  return {{"trajectory_rms_m", e.trajectory_rms},
          {"end_position_mae_m", e.end_position_mae},
          {"end_position_median_m", e.end_position_median},
          {"end_orientation_mae_deg", e.end_orientation_mae},
          {"end_orientation_median_deg", e.end_orientation_median},
          {"chi2_per_dof", e.chi2_per_dof}};
}

MeasuredDiscovery discover_flights(const datasets::ThrowLog& log, const MeasuredOptions& options) {
  const auto begin = Clock::now();
  const int threads = options.search.fit.threads;
  MeasuredDiscovery out;
  out.kind = "free flights";
  out.model = "projectile";
  out.phase = "flight";
  FlightProblem problem(log, threads);
  const EffectSearch search = run_search(problem, options, out);
  if (out.verdict == Verdict::not_answered) {
    out.seconds = seconds_since(begin);
    return out;
  }
  out.before_train = named_errors(problem, search.base, threads);
  out.before_test = named_errors(problem, search.base_test, threads);
  out.after_train = named_errors(problem, search.final, threads);
  out.after_test = named_errors(problem, search.final_test, threads);
  name_scale(log, options, out);
  weigh_stability(out);
  weigh_conditions(search, out);
  weigh_ends(problem, search.final, out);
  weigh_scales(log, options, out);
  weigh_drag(log, out);
  weigh_drag_form(problem, search, options, out);
  weigh_thrust(log, problem, out);
  weigh_declared_drag(log, problem, search, options, out);
  if (const RestsOnFaces rests = rests_on_faces(log); rests.is_doubtful())
    out.evidence.push_back({"", rests.in_words(), true});
  if (problem.glitches() > 0)
    out.evidence.push_back(
        {"",
         fmt::format(
             "{} frames in which the tracker was elsewhere for once, or held the pose before, were taken out",
             problem.glitches()),
         false});
  out.seconds = seconds_since(begin);
  return out;
}

}  // namespace unhand::fitting
