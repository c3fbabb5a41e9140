#include "fitting/measured/fall_discovery.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "dynamics/median.hpp"
#include "flight/quaternion.hpp"

namespace unhand::fitting {

using flight::Vec3;

namespace {

constexpr double kTurningRate = 0.5;  // [rad/s] that an object let go by hand may turn with
constexpr const char* kLeverArm = "sensor.lever_arm";

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

/// How many falls an axis is left out of, and in how many it is coarse.
struct FallProblem::AxisCounts {
  std::map<std::string, int> left_out;                       // by what is said of it
  std::map<std::string, std::array<std::size_t, 3>> coarse;  // by object and axis
};

FallProblem::FallProblem(const datasets::ThrowLog& log) : gravity_(log.gravity) {
  datasets::validate(log);
  channels_ = {"force_x", "force_y", "force_z"};
  covariates_ = {"speed at the start [m/s]", "duration [s]", "vertical along body z [-]", "order"};
  const auto splits = splits_of(log);
  const ForceAxes axes = force_axes(log);
  AxisCounts counts;
  for (std::size_t n = 0; n < log.throws.size(); ++n) {
    const auto& one = log.throws[n];
    if (const std::string why = add(one, splits[n], axes, counts); !why.empty())
      skipped_.push_back({one.id, why});
  }
  for (const auto& [what, times] : counts.left_out)
    notes_.push_back(fmt::format("{}: left out of {} falls", what, times));
  for (const auto& [object, of] : counts.coarse)
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

FallProblem::FallProblem(const datasets::ThrowLog& log, const GroupedFit& fit) : FallProblem(log) {
  std::vector<std::string> names;
  std::vector<double> values;
  for (std::size_t k = 0; k < fit.shared.size(); ++k)
    if (fit.shared[k].effect == kLeverArm) {
      names.push_back(fit.shared[k].name);
      values.push_back(fit.values[static_cast<Eigen::Index>(k)]);
    }
  free_zeros(names, values);
}

std::string FallProblem::add(const datasets::Throw& one, datasets::Split split, const ForceAxes& axes,
                             AxisCounts& counts) {
  constexpr std::size_t kFewest = 12;
  if (!one.imu) return "no imu";
  if (!one.free_flight) return "no free_flight: it is not known when it falls";
  Fall fall;
  fall.readings = readings_of(one);
  const auto& time = fall.readings.samples.time;
  if (time.size() < kFewest)
    return fmt::format("{} samples in free fall, fewer than {}", time.size(), kFewest);

  const AxisUse use = axis_use(fall.readings, one.imu->specific_force.sigma, axes.at(one.object));
  std::string faults;
  for (std::size_t a = 0; a < 3; ++a) {
    if (use.fault[a].empty()) continue;
    faults += fmt::format("{}{} {}", faults.empty() ? "" : ", ", channels_[a], use.fault[a]);
    ++counts.left_out[fmt::format("{} of {} {}", channels_[a], one.object, use.fault[a])];
  }
  for (const std::size_t a : use.coarse) ++counts.coarse[one.object][a];
  if (use.used.empty()) return faults;
  fall.axes = use.used, fall.sigma = use.sigma;
  fall.before = before_fall(*one.imu, *fall.readings.first, gravity_);

  Group group{one.id, one.object, one.condition, split, {}, {}, {}};
  group.start = {fall.before.speed, 0, 0, 0, 0, 0, 0};
  for (const double t : time)
    for (const std::size_t a : fall.axes) group.rows.push_back({static_cast<int>(a), t});
  for (int k = 0; k < 7; ++k) group.rows.push_back({kPriorChannel, 0});
  const auto& rest = fall.before.rest;
  group.covariates = {fall.before.speed, time.back(), rest[2] / flight::norm(rest),
                      static_cast<double>(groups_.size())};
  groups_.push_back(std::move(group));
  falls_.push_back(std::move(fall));
  return {};
}

bool FallProblem::has_gyroscope() const {
  return std::none_of(falls_.begin(), falls_.end(),
                      [](const Fall& fall) { return fall.readings.samples.omega.empty(); });
}

std::vector<Vec3<double>> FallProblem::without_turns(std::size_t group,
                                                     const dynamics::Values<double>& given) const {
  const Fall& fall = falls_[group];
  const auto turned = experiment::falling_readings<double>(started(fall, given, groups_[group].start),
                                                           fall.readings.samples, gravity_, given);
  std::vector<Vec3<double>> out = fall.readings.force;
  for (std::size_t n = 0; n < out.size(); ++n) out[n] = flight::difference(out[n], turned[n]);
  return out;
}

void FallProblem::free_zeros(std::span<const std::string> names, std::span<const double> values) {
  for (const std::string& object : objects_of(*this)) {
    const OwnNames mine(names, object);
    const std::vector<double> shared = mine.values(values);
    const dynamics::Values<double> given(mine.names, shared);
    std::vector<std::vector<Vec3<double>>> force(falls_.size());
    for (std::size_t i = 0; i < falls_.size(); ++i)
      if (groups_[i].object == object) force[i] = without_turns(i, given);
    for (std::size_t a = 0; a < 3; ++a) {
      std::vector<double> zeros, variances;
      std::vector<Fall*> of;
      for (std::size_t i = 0; i < falls_.size(); ++i) {
        Fall& fall = falls_[i];
        if (groups_[i].object != object ||
            std::find(fall.axes.begin(), fall.axes.end(), a) == fall.axes.end())
          continue;
        const double still = std::clamp(fall.before.speed / gravity_, 0.0, fall.readings.samples.time.back());
        const Smoothed zero = smoothed_at(fall.readings.samples.time, force[i], a, still);
        zeros.push_back(zero.value), variances.push_back(zero.variance * fall.sigma[a] * fall.sigma[a]);
        of.push_back(&fall);
      }
      const double differ = differ_by(zeros, variances);
      for (Fall* fall : of) {
        const double noise = fall->sigma[a] * fall->sigma[a],
                     n = static_cast<double>(fall->readings.samples.time.size());
        fall->mean[a] = std::sqrt(noise / (noise + n * differ * differ));
      }
      if (differ > 0)
        notes_.push_back(
            fmt::format("{} of {}: from fall to fall its zero differs by {:.2g} m/s², as biases do "
                        "from recording to recording; the mean of a fall counts by so much less",
                        channels_[a], object, differ));
    }
  }
}

Eigen::VectorXd FallProblem::left_of(std::size_t group, const Eigen::VectorXd& residual) const {
  const Fall& fall = falls_[group];
  const auto axes = static_cast<Eigen::Index>(fall.axes.size()),
             rows = axes * static_cast<Eigen::Index>(fall.readings.samples.time.size());
  Eigen::VectorXd out(rows);
  for (Eigen::Index k = 0; k < axes; ++k) {
    const std::size_t a = fall.axes[static_cast<std::size_t>(k)];
    const auto of_axis = Eigen::seqN(k, fall.readings.samples.time.size(), axes);
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

template <class S>
experiment::FallStart<S> FallProblem::started(const Fall& fall, const dynamics::Values<S>& given,
                                              const std::vector<S>& x) const {
  experiment::Accelerometer<S> sensor;
  dynamics::apply_effects(experiment::accelerometer_effects(), given, sensor);
  Vec3<S> rest;
  for (std::size_t a = 0; a < 3; ++a) rest[a] = fall.before.rest[a] - sensor.bias[a];
  const Vec3<S> up = flight::rotate(flight::exp(Vec3<S>{x[1], x[2], x[3]}),
                                    flight::scaled(S(1.0 / flight::norm(rest)), rest));
  return {x[0], up, {x[4], x[5], x[6]}};
}

template <class S>
void FallProblem::discount_means(const Fall& fall, std::vector<S>& rows) {
  const std::size_t axes = fall.axes.size(), n = rows.size() / axes;
  for (std::size_t k = 0; k < axes; ++k) {
    const double rest_of_mean = fall.mean[fall.axes[k]];
    if (rest_of_mean == 1) continue;
    S sum(0);
    for (std::size_t i = 0; i < n; ++i) sum += rows[i * axes + k];
    const S off = sum * ((1 - rest_of_mean) / static_cast<double>(n));
    for (std::size_t i = 0; i < n; ++i) rows[i * axes + k] -= off;
  }
}

GroupEquations FallProblem::equations(std::size_t group, std::span<const std::string> names,
                                      std::span<const double> values, const Eigen::VectorXd& own,
                                      Derivatives derivatives) const {
  const Fall& fall = falls_[group];
  const OwnNames mine(names, groups_[group].object);
  const auto residual = [&]<class S>(const std::vector<S>& effects, const std::vector<S>& x) {
    const dynamics::Values<S> given(mine.names, effects);
    const auto force =
        experiment::falling_readings<S>(started(fall, given, x), fall.readings.samples, gravity_, given);
    std::vector<S> out;
    out.reserve(groups_[group].rows.size());
    for (std::size_t i = 0; i < force.size(); ++i)
      for (const std::size_t a : fall.axes)
        out.push_back((force[i][a] - fall.readings.force[i][a]) / fall.sigma[a]);
    discount_means(fall, out);
    out.push_back((x[0] - fall.before.speed) / fall.before.speed_sigma);
    for (std::size_t a = 1; a < 4; ++a) out.push_back(x[a] / fall.before.tilt_sigma);
    for (std::size_t a = 4; a < 7; ++a)
      out.push_back(x[a] / (fall.readings.samples.omega.empty() ? kTurningRate : 0.02));
    return out;
  };
  GroupEquations out = swept(mine.values(values), own, derivatives, residual);
  if (derivatives == Derivatives::all) mine.spread(out, names.size());
  return out;
}

GroupMotion FallProblem::motion(std::size_t group, std::span<const std::string> names,
                                std::span<const double> values, const Eigen::VectorXd& own) const {
  const Fall& fall = falls_[group];
  const OwnNames mine(names, groups_[group].object);
  const std::vector<double> shared = mine.values(values);
  const dynamics::Values<double> given(mine.names, shared);
  const auto start = started(fall, given, std::vector<double>(own.data(), own.data() + own.size()));
  GroupMotion out;
  for (const auto& body : experiment::falling_bodies<double>(start, fall.readings.samples, gravity_, given)) {
    out.time.push_back(body.time);
    out.velocity.push_back(flight::scaled(body.velocity, body.up));
    out.body.push_back({Vec3<double>{1, 0, 0}, Vec3<double>{0, 1, 0}, Vec3<double>{0, 0, 1}});
  }
  return out;
}

Eigen::VectorXd FallProblem::response(std::size_t group,
                                      const std::vector<Vec3<double>>& acceleration) const {
  const Fall& fall = falls_[group];
  std::vector<double> rows;
  for (const auto& a : acceleration)
    for (const std::size_t axis : fall.axes) rows.push_back(a[axis] / fall.sigma[axis]);
  discount_means(fall, rows);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(groups_[group].rows.size()));
  out.head(static_cast<Eigen::Index>(rows.size())) =
      Eigen::Map<const Eigen::VectorXd>(rows.data(), static_cast<Eigen::Index>(rows.size()));
  return out;
}

FallErrors fall_errors(const FallProblem& problem, const GroupedFit& fit) {
  FallErrors out;
  double squares = 0, n = 0;
  for (const std::size_t i : fit.solved_groups()) {
    const GroupFit& g = fit.groups[i];
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
