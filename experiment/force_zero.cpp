#include "experiment/force_zero.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "contact/normal_force.hpp"
#include "dynamics/median.hpp"

namespace unhand::experiment {
namespace {

constexpr double kStandardErrors = 5;
constexpr double kOfGrip = 0.005;

std::optional<contact::NormalForceSummary> opening_of_force(const datasets::Throw& one) {
  if (!one.ft || (!one.landing && !one.free_flight) || datasets::is_constant(one.ft->normal_force)) return {};
  const auto& series = one.ft->normal_force;
  contact::NormalForceOptions options;
  options.max_tail_bias = 1e3;  // the object flew, so what is left is the sensor's, whatever it is
  try {
    const auto smooth =
        contact::smooth_normal_force(one.ft->time.data, series.data, series.sigma_of(), options);
    if (std::isfinite(smooth.summary.release_time) && std::isfinite(smooth.summary.tail_mean_sigma))
      return smooth.summary;
  } catch (const std::invalid_argument&) {  // too short a series: those who use the throw say so
  }
  return {};
}

}  // namespace

std::string UntaredForce::in_words() const {
  return fmt::format(
      "/throws/*/ft/normal_force still reads {:.3g} N ({:.2g} % of the grip's {:.3g} N) after the pads have "
      "parted (median of {} throws): a sensor that was not tared? It is not taken off, and friction follows "
      "it: tare the log, or fit sensor.normal_force_bias",
      level, 100 * level / grip, grip, throws);
}

std::optional<UntaredForce> untared_force(const datasets::ThrowLog& log) {
  if (log.dimension != 2) return {};
  std::vector<double> levels, sigmas, grips;
  for (const auto& one : log.throws)
    if (const auto opening = opening_of_force(one)) {
      levels.push_back(opening->tail_mean);
      sigmas.push_back(opening->tail_mean_sigma);
      grips.push_back(opening->grip_force);
    }
  if (levels.empty()) return {};
  UntaredForce out{dynamics::median(levels), dynamics::median(sigmas), dynamics::median(grips),
                   static_cast<int>(levels.size())};
  // Zeros may scatter from throw to throw by more than a throw's samples show.
  std::vector<double> away;
  for (const double level : levels) away.push_back(std::abs(level - out.level));
  const double scatter = std::max(out.sigma, 1.4826 * dynamics::median(away)),
               median_error =
                   1.2533 * scatter / std::sqrt(static_cast<double>(out.throws));  // of normal ones
  if (std::abs(out.level) <= kStandardErrors * median_error || std::abs(out.level) <= kOfGrip * out.grip)
    return {};
  return out;
}

}  // namespace unhand::experiment
