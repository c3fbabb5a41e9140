// The loop on accelerometers in free fall.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "dynamics/median.hpp"
#include "fitting/clock.hpp"
#include "fitting/measured/effect_trial.hpp"
#include "fitting/measured/fall_discovery.hpp"
#include "fitting/measured/measured_discovery.hpp"

namespace unhand::fitting {
namespace {

/// The mean residual of falls, measured − predicted: what they have in common, and how far it scatters about
/// that from fall to fall [m/s²].
struct MeanResidual {
  std::array<double, 3> common{}, scatter{};
};
MeanResidual mean_residual(const FallProblem& problem, const GroupedFit& fit) {
  MeanResidual out;
  std::array<std::vector<double>, 3> means;  // of the falls whose axis is used
  for (const std::size_t i : fit.solved_groups()) {
    std::array<double, 3> mean{}, n{};
    const auto& rows = problem.groups()[i].rows;
    const Eigen::VectorXd left = problem.left_of(i, fit.groups[i].residual);
    for (std::size_t j = 0; j < rows.size(); ++j)
      if (rows[j].channel >= 0) {
        const auto a = static_cast<std::size_t>(rows[j].channel);
        mean[a] += left[static_cast<Eigen::Index>(j)], n[a] += 1;
      }
    for (std::size_t a = 0; a < 3; ++a)
      if (n[a] > 0) means[a].push_back(mean[a] / n[a]);
  }
  for (std::size_t a = 0; a < 3; ++a) {
    const auto falls = static_cast<double>(means[a].size());
    for (const double mean : means[a]) out.common[a] += mean / falls;
    double squares = 0;
    for (const double mean : means[a]) squares += std::pow(mean - out.common[a], 2);
    out.scatter[a] = falls > 1 ? std::sqrt(squares / (falls - 1)) : 0;
  }
  return out;
}

/// A drag slows a fall by what its speed is. Where the fit moves the speeds at the start from what the sensor
/// gained in the hand, by more than that is known to, a drag, the bias along the vertical and those speeds
/// trade against each other, and the drag's size is none that the falls determine.
void weigh_start_speeds(const datasets::ThrowLog& log, const FallProblem& problem, const EffectSearch& search,
                        MeasuredDiscovery& out) {
  constexpr double kFar = 2, kOpen = 0.5;  // sigma, in the mean of squares; of the speed in flight
  double n = 0, mean = 0, squares = 0, speeds = 0;
  for (const std::size_t i : search.final.solved_groups()) {
    const GroupFit& g = search.final.groups[i];
    const auto& rows = problem.groups()[i].rows;
    std::size_t speed = 0;  // the first row of what is known beforehand
    while (rows[speed].channel != kPriorChannel) ++speed;
    const double v = problem.groups()[i].start[0], falls = log.gravity * rows[speed - 1].time;
    n += 1, mean += g.own[0] - v;
    speeds += v * v - v * falls + falls * falls / 3;  // the mean of its square
    squares += std::pow(g.residual[static_cast<Eigen::Index>(speed)], 2);
  }
  if (!(n > 0) || !(squares > kFar * kFar * n)) return;
  const double share = std::abs(mean / n) / std::sqrt(std::max(1e-12, speeds / n));
  for (const auto& effect : out.effects)
    if (effect.id == "flight.quadratic_drag" || effect.id == "flight.linear_drag")
      out.evidence.push_back(
          {effect.id,
           fmt::format(
               "The fit starts the falls {:.2f} m/s more {}, in the mean, than the sensor says of the "
               "time before ({:.1f} sigma, rms), {:.0f} % of the speed in flight. A drag, the bias along "
               "the vertical and the speeds at the start trade against each other{}",
               std::abs(mean / n), mean > 0 ? "upward" : "downward", std::sqrt(squares / n), 100 * share,
               share > kOpen ? ": how large the drag and the bias are, these falls do not determine" : ""),
           true});
}

/// The sensor's scale as it shows at rest, where it reads gravity once the fitted bias is taken off. A fall
/// by itself does not tell it from the size of a drag: what is read there is their product.
void weigh_gain(const datasets::ThrowLog& log, const FallProblem& problem, const EffectSearch& search,
                MeasuredDiscovery& out) {
  constexpr double kSurely = 3;    // standard errors
  constexpr double kLeast = 2e-3;  // of gravity: it differs by more than that from place to place
  constexpr std::size_t kFewest = 3;
  flight::Vec3<double> bias{};
  const char* const axes[] = {"x", "y", "z"};
  for (std::size_t k = 0; k < search.final.shared.size(); ++k)
    for (std::size_t a = 0; a < 3; ++a)
      if (search.final.shared[k].name == fmt::format("sensor.accelerometer_bias.{}", axes[a]))
        bias[a] = search.final.values[static_cast<Eigen::Index>(k)];
  std::vector<double> sizes;
  for (std::size_t i = 0; i < problem.groups().size(); ++i)
    if (problem.before(i).quiet)
      sizes.push_back(flight::norm(flight::difference(problem.before(i).rest, bias)));
  if (sizes.size() < kFewest) return;
  const double n = static_cast<double>(sizes.size()), gain = dynamics::median(sizes) / log.gravity;
  double square = 0;
  for (const double size : sizes) square += std::pow(size / log.gravity - gain, 2);
  const double error = std::sqrt(std::numbers::pi / 2 * square / (n - 1) / n);  // of a median
  if (std::abs(gain - 1) < std::max(kLeast, kSurely * error)) return;
  for (const auto& effect : out.effects) {
    if (effect.id != "flight.quadratic_drag" && effect.id != "flight.linear_drag") continue;
    std::string sizes_then;
    for (const auto& p : effect.parameters)
      sizes_then += fmt::format("{}{} = {:#.4g}{}, not {:#.4g}", sizes_then.empty() ? "" : "; ", p.name,
                                p.value / gain, dynamics::after_number(p.unit), p.value);
    out.evidence.push_back(
        {effect.id,
         fmt::format(
             "At rest before {} falls the sensor reads {:.4g} of the declared gravity, ± {:.1g}, once the "
             "fitted bias is taken off. If its scale is off by that, {}",
             sizes.size(), gain, error, sizes_then),
         true});
  }
}

/// Whether an accepted effect lives from zeros that differ from fall to fall, which turned forces that cancel
/// in the mean (a large drag, a bias and a drift against it) take up: where every fall has a zero of its own,
/// it is not told from none.
bool lives_from_zeros(const FallProblem& own_zeros, const EffectSearch& search,
                      const MeasuredOptions& options) {
  if (search.effects.empty()) return false;
  const GroupedFit fit = fit_groups(own_zeros, datasets::Split::train, search.final.shared,
                                    search.final.values, options.search.fit);
  return fit.solved && std::any_of(search.effects.begin(), search.effects.end(), [&](const auto& effect) {
           return !(wald_of(fit, effect.id).p_value(fit) < options.search.family_wise_level);
         });
}

void explain(const datasets::ThrowLog& log, const FallProblem& problem, const EffectSearch& search,
             MeasuredDiscovery& out) {
  for (const std::string& note : problem.notes()) out.evidence.push_back({"", note, false});
  const auto [common, scatter] = mean_residual(problem, search.final);
  const double largest = std::max({scatter[0], scatter[1], scatter[2]});
  out.evidence.push_back(
      {"sensor.accelerometer_bias",
       fmt::format(
           "From fall to fall the mean of what is left scatters by ({:.3f}, {:.3f}, {:.3f}) m/s²; a turn of "
           "{:.1f} rad/s about an axis 5 cm from the sensor would do that, and {}",
           scatter[0], scatter[1], scatter[2], std::sqrt(largest / 0.05),
           problem.has_gyroscope() ? "the gyroscope saw what turns there were"
                                   : "only a gyroscope could say"),
       largest > 0.02});
  const double offset = std::max({std::abs(common[0]), std::abs(common[1]), std::abs(common[2])});
  if (offset > largest)
    out.evidence.push_back(
        {"sensor.accelerometer_bias",
         fmt::format("What is left has a mean of ({:.3f}, {:.3f}, {:.3f}) m/s² that the falls share: "
                     "a bias, or what pulls or brakes all falls alike",
                     common[0], common[1], common[2]),
         false});
  for (const auto& effect : out.effects) {
    if (effect.id == "flight.quadratic_drag") {
      for (const auto& p : effect.parameters)
        out.evidence.push_back({effect.id,
                                fmt::format("{} = {:.4f} 1/m is a terminal speed of {:.1f} m/s", p.name,
                                            p.value, std::sqrt(log.gravity / std::max(1e-12, p.value))),
                                false});
      out.separating.push_back(
          {effect.id,
           "drag in proportion to v² or to v, or a bias that drifts with time: falls from different heights, "
           "or throws upwards, where drag changes its sign at the apex and a drift does not"});
    }
    if (effect.id == "sensor.accelerometer_bias")
      out.separating.push_back(
          {effect.id,
           "a bias and a steady turn about an axis off the sensor: a gyroscope in the same recording"});
  }
  weigh_start_speeds(log, problem, search, out);
  weigh_gain(log, problem, search, out);
  std::map<std::string, int> conditions;
  for (const auto& g : problem.groups()) ++conditions[g.condition];
  std::string text;
  for (const auto& [name, n] : conditions) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n, name);
  out.evidence.push_back({"", "Falls by condition: " + text, false});
}

}  // namespace

NamedErrors named_errors(const FallProblem& problem, const GroupedFit& fit) {
  const FallErrors e = fall_errors(problem, fit);
  return {{"specific_force_rms_m_s2", e.specific_force_rms},
          {"end_speed_mae_m_s", e.end_speed_mae},
          {"end_position_mae_m", e.end_position_mae},
          {"chi2_per_dof", e.chi2_per_dof}};
}

MeasuredDiscovery discover_falls(const datasets::ThrowLog& log, const MeasuredOptions& options) {
  const auto begin = Clock::now();
  MeasuredDiscovery out;
  out.kind = "accelerometers in free fall";
  out.model = "free_fall";
  out.phase = "flight";
  const MeasuredDiscovery nothing = out;
  FallProblem problem(log);
  EffectSearch search = run_search(problem, options, out);
  if (FallProblem own_zeros(log, search.final); lives_from_zeros(own_zeros, search, options)) {
    problem = std::move(own_zeros);
    out = nothing;
    search = run_search(problem, options, out);
  }
  if (out.verdict == Verdict::not_answered) {
    out.seconds = seconds_since(begin);
    return out;
  }
  out.before_train = named_errors(problem, search.base);
  out.before_test = named_errors(problem, search.base_test);
  out.after_train = named_errors(problem, search.final);
  out.after_test = named_errors(problem, search.final_test);
  weigh_stability(out);
  weigh_conditions(search, out);
  explain(log, problem, search, out);
  weigh_drag_form(problem, search, options, out);
  out.seconds = seconds_since(begin);
  return out;
}

}  // namespace unhand::fitting
