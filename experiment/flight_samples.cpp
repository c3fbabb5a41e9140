#include "experiment/flight_samples.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "dynamics/third_difference.hpp"
#include "dynamics/white_noise.hpp"
#include "experiment/glitches.hpp"

namespace unhand::experiment {
namespace {

template <class T>
void keep(std::vector<T>& values, const std::vector<bool>& good) {
  if (values.empty()) return;
  std::size_t n = 0;
  for (std::size_t i = 0; i < good.size(); ++i)
    if (good[i]) values[n++] = values[i];
  values.resize(n);
}

void read_sigma(const datasets::Series& pose, FlightSamples& out) {
  const std::vector<double>& s = pose.sigma;
  out.declared = s.size() == pose.cols && std::all_of(s.begin(), s.end(), [](double x) { return x > 0; });
  if (!out.declared) return;
  const std::size_t n = out.axes.size();
  for (std::size_t j = 0; j < n; ++j) out.sigma[static_cast<std::size_t>(out.axes[j])] = s[j];
  if (pose.cols == 7) {
    double squares = 0;
    for (std::size_t j = 3; j < 7; ++j) squares += s[j] * s[j];
    out.sigma_angle = 2 * std::sqrt(squares / 4);  // a rotation by θ moves a quaternion by θ/2
  } else if (n == 2) {
    out.sigma_angle = s[2];
  }
}

}  // namespace

FlightSamples read_flight_samples(const datasets::ThrowLog& log, const datasets::Throw& one) {
  const datasets::MocapLog& mocap = *one.mocap;
  const bool planar = log.dimension == 2;
  const double infinity = std::numeric_limits<double>::infinity();
  const auto [begin, end] = one.free_flight.value_or(std::pair{-infinity, infinity});
  FlightSamples out;
  out.axes = planar ? std::vector<int>{0, 2} : std::vector<int>{0, 1, 2};
  read_sigma(mocap.pose, out);
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    const double t = mocap.time(i);
    if (!mocap.is_valid(i) || t < begin - 1e-9 || t > end + 1e-9)
      continue;  // the bounds are sample times themselves
    const auto p = [&](std::size_t j) { return mocap.pose(i, j); };
    out.times.push_back(t);
    out.elapsed.push_back(t - out.times.front());
    if (planar) {
      out.position.push_back({p(0), 0, p(1)});
      out.theta.push_back(p(2));
    } else {
      out.position.push_back({p(0), p(1), p(2)});
      if (mocap.pose.cols == 7)
        out.attitude.push_back(flight::normalised(flight::Quaternion<double>{p(3), p(4), p(5), p(6)}));
    }
  }
  return out;
}

FlightScatter scatter_of(const FlightSamples& s) {
  FlightScatter out;
  std::vector<flight::Vec3<double>> turns;  // between neighbours: their second differences are third ones
  for (std::size_t i = 1; i < s.attitude.size(); ++i)
    turns.push_back(flight::rotation_between(s.attitude[i - 1], s.attitude[i]));
  std::array<std::vector<double>, 3> position;  // variances
  std::vector<double> angle;
  for (std::size_t i = 3; i < s.position.size(); ++i) {
    ++out.n;
    double turned = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      position[a].push_back(dynamics::third_difference_variance(s.position[i - 3][a], s.position[i - 2][a],
                                                                s.position[i - 1][a], s.position[i][a]));
      if (i < s.attitude.size())
        turned += std::pow(turns[i - 1][a] - 2 * turns[i - 2][a] + turns[i - 3][a], 2) / 60;
    }
    if (i < s.theta.size())
      turned =
          dynamics::third_difference_variance(s.theta[i - 3], s.theta[i - 2], s.theta[i - 1], s.theta[i]);
    angle.push_back(turned);
  }
  for (std::size_t a = 0; a < 3; ++a) out.position[a] = dynamics::typical_rms(position[a]);
  out.angle = dynamics::typical_rms(angle);
  return out;
}

FlightScatter pooled(const std::vector<FlightScatter>& flights) {
  FlightScatter out;
  for (const FlightScatter& one : flights) {
    const auto n = static_cast<double>(one.n);
    out.n += one.n;
    for (std::size_t a = 0; a < 3; ++a) out.position[a] += n * one.position[a] * one.position[a];
    out.angle += n * one.angle * one.angle;
  }
  if (out.n == 0) return out;
  for (double& x : out.position) x = std::sqrt(x / static_cast<double>(out.n));
  out.angle = std::sqrt(out.angle / static_cast<double>(out.n));
  return out;
}

std::size_t remove_glitches(FlightSamples& s) {
  std::vector<std::vector<double>> columns;
  std::vector<double> sigma;
  for (const int axis : s.axes) {
    const auto a = static_cast<std::size_t>(axis);
    sigma.push_back(s.sigma[a]);
    columns.emplace_back();
    for (const auto& p : s.position) columns.back().push_back(p[a]);
  }
  std::vector<bool> good = glitches(s.times, columns, sigma);
  good.flip();
  // The last frames may have met the ground.
  std::fill(good.end() - static_cast<std::ptrdiff_t>(std::min<std::size_t>(3, good.size())), good.end(),
            true);
  const std::vector<bool> held = held_frames(columns, sigma);
  for (std::size_t i = 0; i < good.size(); ++i)
    if (held[i]) good[i] = false;
  const auto removed = static_cast<std::size_t>(std::count(good.begin(), good.end(), false));
  if (removed == 0) return 0;
  const double first = s.times.front();
  keep(s.times, good);
  keep(s.elapsed, good);
  for (double& t : s.elapsed) t -= s.times.front() - first;
  keep(s.position, good);
  keep(s.attitude, good);
  keep(s.theta, good);
  return removed;
}

}  // namespace unhand::experiment
