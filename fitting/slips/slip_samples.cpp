#include "fitting/slips/slip_samples.hpp"

#include <algorithm>
#include <cmath>

namespace unhand::fitting {
namespace {

using Row = std::array<double, 3>;

double norm(const Row& a) { return std::hypot(a[0], a[1], a[2]); }

/// A stretch of sliding as it grows.
struct Stretch {
  Row path{}, wrench{}, first{};
  double length = 0, lasted = 0;  // m, s

  void add(const Row& f, const Row& moved, double weight, double dt) {
    if (length == 0) first = moved;
    for (std::size_t j = 0; j < 3; ++j) {
      path[j] += moved[j];
      wrench[j] += weight * f[j];
    }
    length += weight;
    lasted += dt;
  }
  /// The angle between this row's motion and the first one's [rad].
  double turned(const Row& moved) const {
    const double along = first[0] * moved[0] + first[1] * moved[1] + first[2] * moved[2];
    return std::acos(std::clamp(along / (norm(first) * norm(moved)), -1.0, 1.0));
  }
  void finish(std::vector<SlipSample>& out, int slip) {
    const double gone = norm(path);
    if (length > 0 && gone > 0) {
      SlipSample sample{{}, {}, slip, length / lasted};
      for (std::size_t j = 0; j < 3; ++j) {
        sample.wrench[j] = wrench[j] / length;
        sample.direction[j] = path[j] / gone;
      }
      if (norm(sample.wrench) > 0) out.push_back(sample);
    }
    *this = {};
  }
};

/// How long row i lasts [s]; a single row, one second: only ratios count.
double duration(const datasets::Series& time, std::size_t i) {
  const std::size_t n = time.rows;
  if (n < 2) return 1;
  return (time(std::min(i + 1, n - 1)) - time(i > 0 ? i - 1 : 0)) / 2;
}

/// The speed |(v_x, v_y, L ω)| [m/s] below which a patch rests, beside how it slides in the rest of a slip.
double resting_speed(const datasets::Slip& slip, double length) {
  constexpr double kRests = 0.05, kUpper = 0.9;
  std::vector<double> speeds;
  for (std::size_t i = 0; i < slip.time.rows; ++i) {
    const double speed = norm({slip.twist(i, 0), slip.twist(i, 1), slip.twist(i, 2) * length});
    if (speed > 0) speeds.push_back(speed);
  }
  if (speeds.empty()) return 0;
  const auto upper =
      speeds.begin() + static_cast<std::ptrdiff_t>(kUpper * static_cast<double>(speeds.size() - 1));
  std::nth_element(speeds.begin(), upper, speeds.end());
  return kRests * *upper;
}

}  // namespace

SlipSamples slip_samples(const std::string& name, const datasets::Surface& surface, double turn) {
  SlipSamples out{name, surface.characteristic_length, {}, {}};
  const double length = surface.characteristic_length;
  for (const datasets::Slip& slip : surface.slips) {
    const int index = static_cast<int>(out.slips.size());
    out.slips.push_back(slip.id);
    Stretch stretch;
    const double rests = resting_speed(slip, length);
    for (std::size_t i = 0; i < slip.time.rows; ++i) {
      const auto& f = slip.wrench;
      const auto& v = slip.twist;
      const double dt = duration(slip.time, i);
      const Row wrench{f(i, 0), f(i, 1), f(i, 2) / length};
      const Row moved{dt * v(i, 0), dt * v(i, 1), dt * v(i, 2) * length};
      const double weight = norm(moved);
      if (!(norm(wrench) > 0 && weight > 0 && weight >= rests * dt)) continue;
      if (stretch.length > 0 && stretch.turned(moved) > turn) stretch.finish(out.samples, index);
      stretch.add(wrench, moved, weight, dt);
    }
    stretch.finish(out.samples, index);
  }
  return out;
}

}  // namespace unhand::fitting
