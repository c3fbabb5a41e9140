// Random numbers that are the same with every standard library.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace unhand::experiment {

/// What a stream is for; adding a purpose at the end leaves the others as they were.
enum class Purpose : std::uint64_t {
  variation,     ///< what differs from throw to throw
  hand,          ///< noise of the hand's log
  force_torque,  ///< noise of the force/torque sensor
  mocap,         ///< noise and losses of motion capture
  landing,       ///< noise of the landing's sensor
  split,         ///< which conditions are trained on
  design,        ///< a random campaign
  effect,        ///< a random effect
  validation,    ///< draws of validate_sku
  repetition     ///< its motions, repeated
};

/// A stream of random numbers. splitmix64 (Steele, Lea and Flood 2014), started from a hash of its key.
class RandomStream {
 public:
  /// The same three give the same stream.
  RandomStream(std::uint64_t seed, std::uint64_t index, Purpose purpose)
      : state_(mix(mix(mix(seed) ^ (index + 1)) ^ (static_cast<std::uint64_t>(purpose) + 1))) {}

  /// 64 random bits.
  std::uint64_t bits() { return mix(state_ += kGolden); }
  /// In [0, 1), 53 bits.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Standard normal (Box-Muller; the second of each pair is kept for the next call).
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2 * std::log(1 - uniform())), angle = 2 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }
  double normal(double mean, double sigma) { return mean + sigma * normal(); }
  /// One of 0 … n − 1.
  int index(int n) { return static_cast<int>(uniform() * n); }

 private:
  static constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15;
  static std::uint64_t mix(std::uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9;
    x = (x ^ (x >> 27)) * 0x94d049bb133111eb;
    return x ^ (x >> 31);
  }
  std::uint64_t state_;
  double spare_{};
  bool has_spare_{false};
};

}  // namespace unhand::experiment
