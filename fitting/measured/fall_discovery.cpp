#include "fitting/measured/fall_discovery.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "dynamics/median.hpp"
#include "dynamics/quantisation.hpp"
#include "dynamics/third_difference.hpp"
#include "flight/quaternion.hpp"

namespace unhand::fitting {

using flight::Vec3;

namespace {

constexpr double kTurningRate = 0.5;  // [rad/s] that an object let go by hand may turn with
constexpr double kLongestMemory = 3;  // [s] before a fall in which it may have been at rest

/// The last quiet stretch before a fall, and the speed gained from there on. `rest` is what the sensor reads
/// there, a bias included: the vertical, once the bias is taken off.
struct BeforeFall {
  Vec3<double> rest{0, 0, 1};
  double speed{}, speed_sigma{3}, tilt_sigma{0.3};
};

BeforeFall before_fall(const datasets::ImuLog& imu, std::size_t first, double g) {
  constexpr double kWindow = 0.2, kQuiet = 0.6;  // [s], [m/s²]
  BeforeFall out;
  out.rest[2] = g;
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
    if (scatter > kQuiet || std::abs(size - g) > kQuiet) continue;
    out.rest = mean;
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
    if (flight::norm(mean) > 0.3 * g) out.rest = mean;
  }
  return out;
}

/// 1 σ of white noise on a smooth series, from its third differences.
double scatter_of(const std::vector<Vec3<double>>& x, std::size_t axis) {
  double sum = 0;
  for (std::size_t i = 3; i < x.size(); ++i)
    sum += dynamics::third_difference_variance(x[i - 3][axis], x[i - 2][axis], x[i - 1][axis], x[i][axis]);
  return std::sqrt(sum / static_cast<double>(x.size() - 3));
}

/// Whether a throw that has a free flight is in it at this time [s].
bool falls_at(const datasets::Throw& one, double time) {
  return time >= one.free_flight->first - 1e-9 && time <= one.free_flight->second + 1e-9;
}

/// An axis of an object over all its recordings: between which values it reads, and on which grid.
struct Axis {
  double low{}, high{}, step{};  // step: 0 on none [m/s²]
  std::string fault;             // why it says nothing of most falls, or nothing
};

/// Why an axis says nothing of a fall, or nothing. One of a single value does not, unless that is all that
/// its grid can tell; nor does one that is cut off: most often it reads a value that none of the recordings
/// goes beyond.
std::string fault_in(const std::vector<Vec3<double>>& force, std::size_t axis, const Axis& of) {
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

/// By object and axis, of throws that have falls. What says nothing of most falls is not asked in the others:
/// they are the exception.
std::map<std::string, std::array<Axis, 3>> axes_of(const datasets::ThrowLog& log) {
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
  std::map<std::string, std::array<Axis, 3>> out;
  for (const auto& [object, of] : readings)
    for (std::size_t a = 0; a < 3; ++a) {
      const auto [low, high] = std::minmax_element(of.all[a].begin(), of.all[a].end());
      if (low == of.all[a].end()) continue;
      Axis& axis = out[object][a];
      axis = {*low, *high, dynamics::quantisation_step(of.all[a]), {}};
      std::string fault;
      std::size_t faulty = 0;
      for (const auto& fall : of.falls)
        if (auto why = fault_in(fall, a, axis); !why.empty()) fault = std::move(why), ++faulty;
      if (2 * faulty > of.falls.size()) axis.fault = fault;
    }
  return out;
}

/// A series at one time, by the parabola through it, and the variance of that in units of a sample's.
struct Smoothed {
  double value{}, variance{};
};
Smoothed smoothed_at(const std::vector<double>& time, const std::vector<Vec3<double>>& x, std::size_t axis,
                     double at) {
  const auto n = static_cast<Eigen::Index>(time.size());
  Eigen::MatrixX3d powers(n, 3);
  Eigen::VectorXd values(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = time[static_cast<std::size_t>(i)] - at;
    powers.row(i) << 1, t, t * t;
    values[i] = x[static_cast<std::size_t>(i)][axis];
  }
  const Eigen::Matrix3d inverse = (powers.transpose() * powers).inverse();
  return {(inverse * (powers.transpose() * values))[0], inverse(0, 0)};
}

/// 1 σ of what numbers differ by beyond the noise of each, robust; 0 of too few.
double differ_by(const std::vector<double>& values, const std::vector<double>& variances) {
  constexpr std::size_t kLeast = 4;
  if (values.size() < kLeast) return 0;
  const double middle = dynamics::median(values);
  std::vector<double> away;
  for (const double value : values) away.push_back(std::abs(value - middle));
  const double scatter = 1.4826 * dynamics::median(away);
  return std::sqrt(std::max(0.0, scatter * scatter - dynamics::median(variances)));
}

}  // namespace

FallProblem::FallProblem(const datasets::ThrowLog& log, Zeros zeros) : gravity_(log.gravity) {
  datasets::validate(log);
  channels_ = {"force_x", "force_y", "force_z"};
  covariates_ = {"speed at the start [m/s]", "duration [s]", "vertical along body z [-]", "order"};
  const auto splits = splits_of(log);
  const auto axes = axes_of(log);
  std::map<std::string, int> left_out;  // what of which axis, and in how many falls
  std::map<std::string, std::array<std::size_t, 3>>
      coarse;  // falls whose readings scatter by less than a step
  for (std::size_t n = 0; n < log.throws.size(); ++n) {
    const auto& one = log.throws[n];
    if (!one.imu || !one.free_flight) {
      skipped_.push_back({one.id, !one.imu ? "no imu" : "no free_flight: it is not known when it falls"});
      continue;
    }
    const auto& imu = *one.imu;
    Fall fall;
    std::optional<std::size_t> first;
    for (std::size_t i = 0; i < imu.time.rows; ++i) {
      if (!falls_at(one, imu.time(i))) continue;
      if (!first) first = i;
      auto& [time, omega, turned] = fall.samples;
      time.push_back(imu.time(i) - imu.time(*first));
      fall.force.push_back({imu.specific_force(i, 0), imu.specific_force(i, 1), imu.specific_force(i, 2)});
      if (imu.angular_rate.empty()) continue;
      omega.push_back({imu.angular_rate(i, 0), imu.angular_rate(i, 1), imu.angular_rate(i, 2)});
      Vec3<double> angle{};
      if (!turned.empty())
        for (std::size_t a = 0; a < 3; ++a)
          angle[a] = turned.back()[a] + 0.5 * (time.back() - time[time.size() - 2]) *
                                            (omega.back()[a] + omega[omega.size() - 2][a]);
      turned.push_back(angle);
    }
    const auto& time = fall.samples.time;
    if (time.size() < 12) {
      skipped_.push_back({one.id, fmt::format("{} samples in free fall, fewer than 12", time.size())});
      continue;
    }
    const bool declared = imu.specific_force.sigma.size() == 3;
    const auto& known = axes.at(one.object);
    std::string faults;
    for (std::size_t a = 0; a < 3; ++a) {
      const double scatter = declared && imu.specific_force.sigma[a] > 0 ? imu.specific_force.sigma[a]
                                                                         : scatter_of(fall.force, a);
      fall.sigma[a] = std::max(scatter, dynamics::rounding_sigma(known[a].step));
      if (const auto fault = known[a].fault.empty() ? fault_in(fall.force, a, known[a]) : known[a].fault;
          !fault.empty()) {
        faults += fmt::format("{}{} {}", faults.empty() ? "" : ", ", channels_[a], fault);
        ++left_out[fmt::format("{} of {} {}", channels_[a], one.object, fault)];
        continue;
      }
      fall.axes.push_back(a);
      if (fall.sigma[a] > scatter || scatter_of(fall.force, a) < 0.5 * known[a].step) ++coarse[one.object][a];
    }
    if (fall.axes.empty()) {
      skipped_.push_back({one.id, faults});
      continue;
    }
    const BeforeFall before = before_fall(imu, *first, gravity_);
    fall.rest = before.rest, fall.speed = before.speed;
    fall.speed_sigma = before.speed_sigma, fall.tilt_sigma = before.tilt_sigma;
    Group group{one.id, one.object, one.condition, splits[n], {}, {}, {}};
    group.start = {fall.speed, 0, 0, 0, 0, 0, 0};
    for (const double t : time)
      for (const std::size_t a : fall.axes) group.rows.push_back({static_cast<int>(a), t});
    for (int k = 0; k < 7; ++k) group.rows.push_back({kPriorChannel, 0});
    group.covariates = {fall.speed, time.back(), fall.rest[2] / flight::norm(fall.rest),
                        static_cast<double>(groups_.size())};
    groups_.push_back(std::move(group));
    falls_.push_back(std::move(fall));
  }
  if (zeros == Zeros::own) free_zeros();
  for (const auto& [what, times] : left_out)
    notes_.push_back(fmt::format("{}: left out of {} falls", what, times));
  for (const auto& [object, of] : coarse)
    for (std::size_t a = 0; a < 3; ++a)
      if (of[a] > 0)
        notes_.push_back(fmt::format(
            "{} of {} reads in steps of {:.3g} m/s², and in {} falls its noise is less than half of one: "
            "what is constant is known to half a step there, whatever its interval",
            channels_[a], object, axes.at(object)[a].step, of[a]));
  if (groups_.empty())
    throw std::invalid_argument("falls: no throw is one" +
                                (skipped_.empty() ? "" : ": " + skipped_.front().second));
}

void FallProblem::free_zeros() {
  for (const std::string& object : objects_of(*this))
    for (std::size_t a = 0; a < 3; ++a) {
      std::vector<double> zeros, variances;
      std::vector<Fall*> of;
      for (std::size_t i = 0; i < falls_.size(); ++i) {
        Fall& fall = falls_[i];
        if (groups_[i].object != object ||
            std::find(fall.axes.begin(), fall.axes.end(), a) == fall.axes.end())
          continue;
        const double still = std::clamp(fall.speed / gravity_, 0.0, fall.samples.time.back());
        const Smoothed zero = smoothed_at(fall.samples.time, fall.force, a, still);
        zeros.push_back(zero.value), variances.push_back(zero.variance * fall.sigma[a] * fall.sigma[a]);
        of.push_back(&fall);
      }
      const double differ = differ_by(zeros, variances);
      for (Fall* fall : of) {
        const double noise = fall->sigma[a] * fall->sigma[a],
                     n = static_cast<double>(fall->samples.time.size());
        fall->mean[a] = std::sqrt(noise / (noise + n * differ * differ));
      }
      if (differ > 0)
        notes_.push_back(
            fmt::format("{} of {}: from fall to fall its zero differs by {:.2g} m/s², as biases do "
                        "from recording to recording; the mean of a fall counts by so much less",
                        channels_[a], object, differ));
    }
}

Eigen::VectorXd FallProblem::left_of(std::size_t group, const Eigen::VectorXd& residual) const {
  const Fall& fall = falls_[group];
  const auto axes = static_cast<Eigen::Index>(fall.axes.size()),
             rows = axes * static_cast<Eigen::Index>(fall.samples.time.size());
  Eigen::VectorXd out(rows);
  for (Eigen::Index k = 0; k < axes; ++k) {
    const std::size_t a = fall.axes[static_cast<std::size_t>(k)];
    const auto of_axis = Eigen::seqN(k, fall.samples.time.size(), axes);
    const double mean = residual(of_axis).mean();
    out(of_axis) = -fall.sigma[a] * (residual(of_axis).array() + (1 / fall.mean[a] - 1) * mean);
  }
  return out;
}

std::vector<dynamics::Effect> FallProblem::effects() const {
  std::set<std::size_t> seen;
  for (const Fall& fall : falls_) seen.insert(fall.axes.begin(), fall.axes.end());
  auto out = experiment::known_fall_effects();
  for (auto& effect : out)
    std::erase_if(effect.parameters, [&](const dynamics::EffectParameter& p) {
      return p.on_axis && !seen.contains(*p.on_axis);
    });
  return out;
}

GroupEquations FallProblem::equations(std::size_t group, std::span<const std::string> names,
                                      std::span<const double> values, const Eigen::VectorXd& own,
                                      Derivatives derivatives) const {
  const Fall& fall = falls_[group];
  const OwnNames mine(names, groups_[group].object);
  const auto residual = [&]<class S>(const std::vector<S>& effects, const std::vector<S>& x) {
    const dynamics::Values<S> given(mine.names, effects);
    experiment::Accelerometer<S> sensor;
    dynamics::apply_effects(experiment::accelerometer_effects(), given, sensor);
    Vec3<S> rest;
    for (std::size_t a = 0; a < 3; ++a) rest[a] = fall.rest[a] - sensor.bias[a];
    const Vec3<S> up = flight::rotate(flight::exp(Vec3<S>{x[1], x[2], x[3]}),
                                      flight::scaled(S(1.0 / flight::norm(rest)), rest));
    const auto force =
        experiment::falling_readings<S>({x[0], up, {x[4], x[5], x[6]}}, fall.samples, gravity_, given);
    std::vector<S> out;
    out.reserve(groups_[group].rows.size());
    for (std::size_t i = 0; i < force.size(); ++i)
      for (const std::size_t a : fall.axes) out.push_back((force[i][a] - fall.force[i][a]) / fall.sigma[a]);
    const std::size_t n = force.size(), axes = fall.axes.size();
    for (std::size_t k = 0; k < axes; ++k) {
      const double rest_of_mean = fall.mean[fall.axes[k]];
      if (rest_of_mean == 1) continue;
      S sum(0);
      for (std::size_t i = 0; i < n; ++i) sum += out[i * axes + k];
      const S off = sum * ((1 - rest_of_mean) / static_cast<double>(n));
      for (std::size_t i = 0; i < n; ++i) out[i * axes + k] -= off;
    }
    out.push_back((x[0] - fall.speed) / fall.speed_sigma);
    for (std::size_t a = 1; a < 4; ++a) out.push_back(x[a] / fall.tilt_sigma);
    for (std::size_t a = 4; a < 7; ++a)
      out.push_back(x[a] / (fall.samples.omega.empty() ? kTurningRate : 0.02));
    return out;
  };
  GroupEquations out = swept(mine.values(values), own, derivatives, residual);
  if (derivatives == Derivatives::all) mine.spread(out, names.size());
  return out;
}

FallErrors fall_errors(const FallProblem& problem, const GroupedFit& fit) {
  FallErrors out;
  double squares = 0, n = 0;
  for (std::size_t i = 0; i < fit.groups.size(); ++i) {
    const GroupFit& g = fit.groups[i];
    if (!g.used || !g.solved) continue;
    const auto& rows = problem.groups()[i].rows;
    Vec3<double> speed{}, position{}, last{};
    double before = 0;
    const auto& axes = problem.axes(i);
    const Eigen::VectorXd left = problem.left_of(i, g.residual);
    for (std::size_t j = 0; j < rows.size() && rows[j].channel >= 0; j += axes.size()) {
      const double dt = rows[j].time - before;
      before = rows[j].time;
      for (std::size_t k = 0; k < axes.size(); ++k) {
        const std::size_t a = axes[k];
        const double r = -left[static_cast<Eigen::Index>(j + k)];
        squares += r * r;
        position[a] += dt * (speed[a] + 0.25 * dt * (r + last[a]));
        speed[a] += 0.5 * dt * (r + last[a]);
        last[a] = r;
      }
      n += 1;
    }
    ++out.n;
    out.end_speed_mae += flight::norm(speed);
    out.end_position_mae += flight::norm(position);
  }
  if (out.n == 0) return out;
  out.specific_force_rms = std::sqrt(squares / n);
  out.end_speed_mae /= out.n;
  out.end_position_mae /= out.n;
  out.chi2_per_dof = fit.chi2_per_dof();
  return out;
}

}  // namespace unhand::fitting
