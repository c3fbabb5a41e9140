#include "experiment/synthetic_sensors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "experiment/sample_window.hpp"

namespace unhand::experiment {

using datasets::Series;
using dynamics::Pose;

namespace {

/// A series of the given columns; σ is declared where there is noise.
Series series(std::size_t cols, std::vector<double> sigma = {}) {
  Series out;
  out.cols = cols;
  if (std::any_of(sigma.begin(), sigma.end(), [](double s) { return s > 0; })) out.sigma = std::move(sigma);
  return out;
}

template <std::size_t N>
void append(Series& to, const std::array<double, N>& row) {
  to.data.insert(to.data.end(), row.begin(), row.end());
  ++to.rows;
}

template <std::size_t N>
std::array<double, N> noisy(std::array<double, N> row, const std::array<double, N>& sigma,
                            RandomStream& random) {
  for (std::size_t i = 0; i < N; ++i) row[i] = random.normal(row[i], sigma[i]);
  return row;
}

std::array<double, 3> row(const Pose<double>& p) { return {p.x, p.z, p.theta}; }

/// The multiples of 1/rate inside [begin, end].
std::vector<double> sample_times(double begin, double end, double rate) {
  std::vector<double> out;
  for (double k = std::ceil((begin - kAtSample) * rate); k <= (end + kAtSample) * rate; ++k)
    out.push_back(k / rate);
  return out;
}

datasets::HandLog log_hand(const PlanarArmHand& hand, const SensorSuite& sensors, RandomStream random) {
  const double s = sensors.hand_sigma;
  datasets::HandLog log{series(1), series(3, {s, s, s}), series(3, {s, s, s}), series(3, {s, s, s})};
  const std::array<double, 3> sigma{s, s, s};
  const auto jumps = hand.jumps();
  for (const double t : sample_times(hand.begin(), hand.end(), sensors.hand_rate)) {
    const auto state = hand.at(window_at(hand.begin(), hand.end(), jumps, t), t);
    const auto& [v, a] = std::pair(state.twist, state.acceleration);
    append(log.time, std::array{t});
    append(log.pose, noisy(row(state.pose), sigma, random));
    append(log.twist, noisy(std::array{v.vx, v.vz, v.omega}, sigma, random));
    append(log.acceleration, noisy(std::array{a.ax, a.az, a.alpha}, sigma, random));
  }
  return log;
}

/// The sensor is behind one pad, so it feels its share of the wrench, and turns with the hand.
datasets::FtLog log_forces(const SensedThrow& sensed, const SensorSuite& sensors, RandomStream random) {
  const auto w = sensors.wrench ? sensors.wrench_sigma : std::array<double, 3>{};
  datasets::FtLog log{series(1), series(3, {w[0], w[1], w[2]}), series(1, {sensors.normal_force_sigma})};
  const double begin = sensed.commanded.begin(), end = sensed.commanded.end();
  const auto kinks = sensed.normal_force.kinks();
  for (const double t : sample_times(begin, end, sensors.ft_rate)) {
    const double stamp = t + sensed.ft_time_offset;
    std::array<double, 3> wrench{};
    if (sensors.wrench) {
      const auto felt = sensed.reader.wrench(stamp);
      wrench = {felt.fx, felt.fz, felt.tau};
    }
    const double force =
        sensed.normal_force.at(window_at(begin, end, kinks, t), t) + sensed.normal_force_bias;
    append(log.time, std::array{stamp});
    append(log.wrench, noisy(wrench, w, random));
    append(log.normal_force, noisy(std::array{force}, {sensors.normal_force_sigma}, random));
  }
  return log;
}

datasets::MocapLog log_mocap(const SensedThrow& sensed, const SensorSuite& sensors, RandomStream random) {
  const auto& s = sensors.mocap_sigma;
  datasets::MocapLog log{series(1), series(3, {s[0], s[1], s[2]}), {}};
  const double phase = random.uniform();  // the camera runs freely
  for (double k = 0;; ++k) {
    const double t = sensed.start + (k + phase) / sensors.mocap_rate, stamp = t + sensed.mocap_time_offset;
    if (t > sensed.landing_time) return log;
    std::array<double, 3> seen = noisy(row(sensed.reader.mocap(stamp)), s, random);
    const bool lost = random.uniform() < sensors.mocap_dropout;
    if (lost) seen.fill(std::numeric_limits<double>::quiet_NaN());
    append(log.time, std::array{stamp});
    append(log.pose, seen);
    log.valid.push_back(lost ? 0 : 1);
  }
}

datasets::LandingLog log_landing(const SensedThrow& sensed, const SensorSuite& sensors, RandomStream random) {
  const auto& s = sensors;
  datasets::LandingLog log{series(1, {s.landing_time_sigma}),
                           series(2, {s.landing_sigma[0], s.landing_sigma[1]})};
  const Pose<double>& pose = sensed.landing_pose;
  append(log.time, noisy(std::array{sensed.landing_time}, {s.landing_time_sigma}, random));
  append(log.pose, noisy(std::array{sensed.reader.landing_x(pose.x), pose.theta}, s.landing_sigma, random));
  return log;
}

}  // namespace

void record_sensors(const SensedThrow& sensed, const SensorSuite& sensors, std::uint64_t seed,
                    std::uint64_t index, datasets::Throw& record) {
  const auto stream = [&](Purpose purpose) { return RandomStream(seed, index, purpose); };
  record.hand_jump_times = sensed.commanded.jumps();
  record.hand = log_hand(sensed.commanded, sensors, stream(Purpose::hand));
  if (sensors.ft) record.ft = log_forces(sensed, sensors, stream(Purpose::force_torque));
  if (sensors.mocap) record.mocap = log_mocap(sensed, sensors, stream(Purpose::mocap));
  if (sensors.landing) record.landing = log_landing(sensed, sensors, stream(Purpose::landing));
}

}  // namespace unhand::experiment
