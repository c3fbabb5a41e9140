#include "fitting/discovery/twin.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "contact/normal_force.hpp"
#include "experiment/random_stream.hpp"
#include "experiment/sample_window.hpp"

namespace unhand::fitting {

using datasets::Series;
using dynamics::Window;
using experiment::Channel;
using experiment::Purpose;
using experiment::RandomStream;

namespace {

constexpr Window kAlways{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};

void write_hand(const experiment::PreparedThrow& prepared, RandomStream random, datasets::HandLog& log) {
  const auto jumps = prepared.hand.jumps();
  for (std::size_t i = 0; i < log.time.rows; ++i) {
    const double t = log.time(i);
    if (t < prepared.hand.begin() || t > prepared.hand.end()) continue;
    const auto state =
        prepared.hand.at(experiment::window_at(prepared.hand.begin(), prepared.hand.end(), jumps, t), t);
    const auto put = [&](Series& series, const std::array<double, 3>& row,
                         const std::array<double, 3>& used) {
      for (std::size_t k = 0; k < 3 && !series.data.empty(); ++k)
        series.data[i * series.cols + k] =
            random.normal(row[k], series.sigma.empty() ? used[k] : series.sigma[k]);
    };
    const auto& [pose, twist, acceleration] = state;
    put(log.pose, {pose.x, pose.z, pose.theta}, prepared.hand_fit.pose_sigma);
    put(log.twist, {twist.vx, twist.vz, twist.omega}, prepared.hand_fit.twist_sigma);
    put(log.acceleration, {acceleration.ax, acceleration.az, acceleration.alpha},
        prepared.hand_fit.acceleration_sigma);
  }
}

/// The smoothed force, with the sensor's bias that the smoothing had faded out over the ramp put back.
void write_normal_force(const experiment::PreparedThrow& prepared, RandomStream random,
                        datasets::FtLog& log) {
  const auto& fit = prepared.force_fit;
  for (std::size_t i = 0; i < log.time.rows; ++i) {
    const double t = log.time(i);
    const double force = prepared.normal_force->at(kAlways, t) + contact::bias_share(fit, t) * fit.tail_mean;
    log.normal_force.data[i] = random.normal(force, fit.sigma);
  }
}

/// Where an observation stands in the log.
double* place_of(const experiment::Observation& o, datasets::Throw& record) {
  const auto cell = [&](const Series& time, Series& series, Channel first) -> double* {
    const auto at = std::lower_bound(time.data.begin(), time.data.end(), o.time) - time.data.begin();
    const auto column = static_cast<std::size_t>(static_cast<int>(o.channel) - static_cast<int>(first));
    return &series.data[static_cast<std::size_t>(at) * series.cols + column];
  };
  switch (o.channel) {
    case Channel::wrench_fx:
    case Channel::wrench_fz:
    case Channel::wrench_tau:
      return cell(record.ft->time, record.ft->wrench, Channel::wrench_fx);
    case Channel::mocap_x:
    case Channel::mocap_z:
    case Channel::mocap_theta:
      return cell(record.mocap->time, record.mocap->pose, Channel::mocap_x);
    case Channel::landing_x:
      return &record.landing->pose.data[0];
    case Channel::landing_theta:
      return &record.landing->pose.data[1];
    case Channel::landing_time:
      return &record.landing->time.data[0];
    case Channel::normal_force:
      break;  // an input
  }
  return nullptr;
}

std::optional<datasets::Throw> twin_throw(const datasets::ThrowLog& log, const datasets::Throw& logged,
                                          const CampaignThrow& thrown, const CampaignProblem& problem,
                                          const FitResult& fit, const experiment::ObservationOptions& every,
                                          std::uint64_t seed, std::uint64_t index) {
  const auto stream = [&](Purpose purpose) { return RandomStream(seed, index, purpose); };
  auto random = stream(Purpose::variation);
  std::vector<double> own;
  for (std::size_t k = 0; k < problem.own().size(); ++k) {
    const Unknown& u = problem.own()[k];
    // The smoothed inputs are the twin's truth.
    own.push_back(u.kind == Unknown::Kind::smoothing
                      ? 0.0
                      : std::clamp(random.normal(0, fit.own_spread[k]), u.low, u.high));
  }
  const auto observed = experiment::observe(log, logged, thrown.prepared, every);
  const auto predicted = problem.predict(thrown.prepared, observed, fit.values(), own);
  if (!predicted.landed()) return {};
  datasets::Throw out = logged;
  auto noise = stream(Purpose::mocap);
  for (std::size_t k = 0; k < observed.all.size(); ++k)
    if (double* place = place_of(observed.all[k], out))
      *place = noise.normal(predicted.channels[k], observed.all[k].sigma);
  write_hand(thrown.prepared, stream(Purpose::hand), *out.hand);
  if (out.ft && thrown.prepared.normal_force)
    write_normal_force(thrown.prepared, stream(Purpose::force_torque), *out.ft);
  if (out.detach_time) out.detach_time = predicted.detach.time;
  return out;
}

}  // namespace

datasets::ThrowLog twin_of(const datasets::ThrowLog& log, const CampaignProblem& problem,
                           const FitResult& fit, std::uint64_t seed) {
  datasets::ThrowLog out = log;
  out.throws.clear();
  out.title = fmt::format("synthetic twin of: {}", log.title);
  out.source =
      fmt::format("synthetic: simulated by unhand with {} as fitted, seed {}", problem.options().model, seed);
  experiment::ObservationOptions every;
  every.settling = every.before_jump = every.wrench_trust = 0;
  every.landing_noise = experiment::landing_noise(log);  // once, not for every throw
  for (std::size_t i = 0; i < log.throws.size(); ++i)
    if (auto one = twin_throw(log, log.throws[i], problem.throws()[i], problem, fit, every, seed, i))
      out.throws.push_back(std::move(*one));
  return out;
}

experiment::ErrorStatistics ErrorFloor::statistics(int quantity, datasets::Split split) const {
  experiment::ErrorStatistics out;
  for (const auto& model : models) {
    const auto one = model.statistics(quantity, split);
    const double share = 1.0 / static_cast<double>(models.size());
    out.n = one.n;
    out.mae += share * one.mae;
    out.std += share * one.std;
    out.bias += share * one.bias;
  }
  return out;
}

ErrorFloor error_floor(const datasets::ThrowLog& log, const std::string& file, const CampaignProblem& problem,
                       const FitResult& fit, const FitOptions& options, int twins, std::uint64_t seed) {
  ErrorFloor out;
  for (int k = 0; k < twins; ++k) {
    const auto twin = twin_of(log, problem, fit, seed + static_cast<std::uint64_t>(k));
    const CampaignProblem again(twin, file, problem.options());
    const FitResult refitted = fitting::fit(again, options);
    if (!refitted.is_answer()) continue;
    out.models.push_back(
        comparison_of(again, refitted, predict_throws(again, refitted, {false, options.threads})));
    ++out.twins;
  }
  return out;
}

}  // namespace unhand::fitting
