#include "fitting/measured/fall_readings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamics/quantisation.hpp"
#include "dynamics/spline_fit.hpp"
#include "dynamics/third_difference.hpp"
#include "dynamics/white_noise.hpp"
#include "flight/quaternion.hpp"

namespace unhand::fitting {

using flight::Vec3;

namespace {

constexpr double kLongestMemory = 3;  // [s] before a fall in which it may have been at rest

/// Whether a throw that has a free flight is in it at this time [s].
bool falls_at(const datasets::Throw& one, double time) {
  return time >= one.free_flight->first - 1e-9 && time <= one.free_flight->second + 1e-9;
}

/// 1 σ of white noise on a smooth series, from its third differences without those of stray samples.
double scatter_of(const std::vector<Vec3<double>>& x, std::size_t axis) {
  std::vector<double> variances;
  for (std::size_t i = 3; i < x.size(); ++i)
    variances.push_back(
        dynamics::third_difference_variance(x[i - 3][axis], x[i - 2][axis], x[i - 1][axis], x[i][axis]));
  return dynamics::typical_rms(variances);
}

/// ω and ω̇ become those of the spline with as few knots as the gyroscope's noise allows. (Differences from
/// sample to sample would be noise more than ω̇, and a lever arm fitted to them too short.)
void smooth_turns(experiment::FallSamples& samples) {
  constexpr std::size_t kLeast = 8;  // samples; a piece of the spline has six coefficients
  auto& [time, omega, omega_rate, turned] = samples;
  if (omega.size() < kLeast) return;
  std::vector<double> rows;
  for (const auto& row : omega) rows.insert(rows.end(), row.begin(), row.end());
  dynamics::SplineProblem<3, 5> problem;
  problem.begin = time.front(), problem.end = time.back();
  auto& read = problem.observations.emplace_back();
  read.time = time, read.value = rows;
  for (std::size_t a = 0; a < 3; ++a) read.sigma[a] = std::max(scatter_of(omega, a), 1e-9);
  const auto polynomial = dynamics::fit_spline(problem).polynomial;
  for (std::size_t i = 0; i < time.size(); ++i) {
    const auto at = polynomial.at({problem.begin, problem.end}, time[i]);
    omega[i] = at.value;
    omega_rate.push_back(at.first);
  }
}

/// Why an axis says nothing of a fall, or nothing. One of a single value does not, unless that is all that
/// its grid can tell; nor does one that is cut off: most often it reads a value that none of the recordings
/// goes beyond.
std::string fault_in(const std::vector<Vec3<double>>& force, std::size_t axis, const ForceAxis& of) {
  constexpr double kPile = 0.02;  // of the readings in a fall
  constexpr std::size_t kLeast = 3, kValues = 4;
  std::map<double, std::size_t> values;
  for (const auto& f : force) ++values[f[axis]];
  const auto [value, times] = *std::max_element(
      values.begin(), values.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  const bool at_the_end = value == of.low || value == of.high;
  if (values.size() == 1 && (at_the_end || of.step == 0)) return "reads one value all the time";
  const bool piles =
      times >= kLeast && static_cast<double>(times) >= kPile * static_cast<double>(force.size());
  if (values.size() >= kValues && at_the_end && piles) return fmt::format("is cut off at {:.4g} m/s²", value);
  return {};
}

}  // namespace

BeforeFall before_fall(const datasets::ImuLog& imu, std::size_t first, double gravity) {
  constexpr double kWindow = 0.2, kQuiet = 0.6;  // [s], [m/s²]
  BeforeFall out;
  out.rest[2] = gravity;
  const auto mean_over = [&](std::size_t i, std::size_t j, Vec3<double>& mean, double& scatter) {
    mean = {};
    scatter = 0;
    const auto n = static_cast<double>(j - i);
    for (std::size_t k = i; k < j; ++k)
      for (std::size_t a = 0; a < 3; ++a) mean[a] += imu.specific_force(k, a) / n;
    for (std::size_t k = i; k < j; ++k)
      for (std::size_t a = 0; a < 3; ++a) scatter += std::pow(imu.specific_force(k, a) - mean[a], 2) / n;
    scatter = std::sqrt(scatter);
  };
  for (std::size_t end = first; end-- > 0;) {
    if (imu.time(first) - imu.time(end) > kLongestMemory) break;
    std::size_t begin = end;
    while (begin > 0 && imu.time(end) - imu.time(begin) < kWindow) --begin;
    if (imu.time(end) - imu.time(begin) < kWindow) break;
    Vec3<double> mean;
    double scatter = 0;
    mean_over(begin, end, mean, scatter);
    const double size = flight::norm(mean);
    if (scatter > kQuiet || std::abs(size - gravity) > kQuiet) continue;
    out.rest = mean, out.quiet = true;
    for (std::size_t k = end; k < first; ++k) {
      const double dt = imu.time(k + 1) - imu.time(k);
      for (const std::size_t i : {k, k + 1}) {
        const Vec3<double> f{imu.specific_force(i, 0), imu.specific_force(i, 1), imu.specific_force(i, 2)};
        out.speed += 0.5 * dt * (flight::dot(f, mean) / size - size);
      }
    }
    const double moving = imu.time(first) - imu.time(end);
    out.speed_sigma = 0.1 + 0.3 * moving;
    out.tilt_sigma = 0.03 + 0.1 * moving;
    return out;
  }
  // Never at rest: the vertical is that of the mean force.
  Vec3<double> mean;
  double scatter = 0;
  if (first > 1) {
    mean_over(0, first, mean, scatter);
    if (flight::norm(mean) > 0.3 * gravity) out.rest = mean;
  }
  return out;
}

FallReadings readings_of(const datasets::Throw& one) {
  const auto& imu = *one.imu;
  FallReadings out;
  auto& [time, omega, omega_rate, turned] = out.samples;
  for (std::size_t i = 0; i < imu.time.rows; ++i) {
    if (!falls_at(one, imu.time(i))) continue;
    if (!out.first) out.first = i;
    time.push_back(imu.time(i) - imu.time(*out.first));
    out.force.push_back({imu.specific_force(i, 0), imu.specific_force(i, 1), imu.specific_force(i, 2)});
    if (imu.angular_rate.empty()) continue;
    omega.push_back({imu.angular_rate(i, 0), imu.angular_rate(i, 1), imu.angular_rate(i, 2)});
    Vec3<double> angle{};
    if (!turned.empty())
      for (std::size_t a = 0; a < 3; ++a)
        angle[a] = turned.back()[a] + 0.5 * (time.back() - time[time.size() - 2]) *
                                          (omega.back()[a] + omega[omega.size() - 2][a]);
    turned.push_back(angle);
  }
  smooth_turns(out.samples);
  return out;
}

ForceAxes force_axes(const datasets::ThrowLog& log) {
  struct Readings {
    std::array<std::vector<double>, 3> all;
    std::vector<std::vector<Vec3<double>>> falls;
  };
  std::map<std::string, Readings> readings;
  for (const auto& one : log.throws) {
    if (!one.imu || !one.free_flight) continue;
    Readings& of = readings[one.object];
    auto& fall = of.falls.emplace_back();
    for (std::size_t i = 0; i < one.imu->time.rows; ++i) {
      const Vec3<double> f{one.imu->specific_force(i, 0), one.imu->specific_force(i, 1),
                           one.imu->specific_force(i, 2)};
      for (std::size_t a = 0; a < 3; ++a) of.all[a].push_back(f[a]);
      if (falls_at(one, one.imu->time(i))) fall.push_back(f);
    }
    if (fall.empty()) of.falls.pop_back();
  }
  ForceAxes out;
  for (const auto& [object, of] : readings)
    for (std::size_t a = 0; a < 3; ++a) {
      const auto [low, high] = std::minmax_element(of.all[a].begin(), of.all[a].end());
      if (low == of.all[a].end()) continue;
      ForceAxis& axis = out[object][a];
      axis = {*low, *high, dynamics::quantisation_step(of.all[a]), {}};
      std::string fault;
      std::size_t faulty = 0;
      for (const auto& fall : of.falls)
        if (auto why = fault_in(fall, a, axis); !why.empty()) fault = std::move(why), ++faulty;
      if (2 * faulty > of.falls.size()) axis.fault = fault;
    }
  return out;
}

AxisUse axis_use(const FallReadings& fall, const std::vector<double>& declared,
                 const std::array<ForceAxis, 3>& axes) {
  AxisUse out;
  for (std::size_t a = 0; a < 3; ++a) {
    const double scatter = scatter_of(fall.force, a);
    const double noise = declared.size() == 3 && declared[a] > 0 ? declared[a] : scatter;
    out.sigma[a] = std::max(noise, dynamics::rounding_sigma(axes[a].step));
    out.fault[a] = axes[a].fault.empty() ? fault_in(fall.force, a, axes[a]) : axes[a].fault;
    if (!out.fault[a].empty()) continue;
    out.used.push_back(a);
    if (out.sigma[a] > noise || scatter < 0.5 * axes[a].step) out.coarse.push_back(a);
  }
  return out;
}

}  // namespace unhand::fitting
