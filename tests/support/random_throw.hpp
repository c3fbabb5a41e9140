// Random analytic throws: a smooth hand (polynomial plus a sway) and an opening profile.
#pragma once

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "contact/normal_force.hpp"
#include "contact/patch.hpp"
#include "dynamics/rigid_body.hpp"
#include "release/grasp.hpp"
#include "release/hand_motion.hpp"

namespace unhand::support {

/// Each coordinate is p + v t + ½ a t² + A sin(w t + φ): acceleration and sway make the demand on the grip
/// vary.
class SwayingHand final : public release::HandMotion {
 public:
  struct Coordinate {
    double p{}, v{}, a{}, amplitude{}, frequency{1}, phase{};
  };
  SwayingHand(std::array<Coordinate, 3> coordinates, double end) : coordinates_(coordinates), end_(end) {
    for (int i = 0; i < 3; ++i) {
      const auto& c = coordinates_[i];
      in_phase_[i] = c.amplitude * std::cos(c.phase);
      in_quadrature_[i] = c.amplitude * std::sin(c.phase);
    }
  }

  release::HandState<double> at(const release::Window&, double t) const override { return at_(t); }
  release::HandState<release::Dual> at(const release::Window&, const release::Dual& t) const override {
    return at_(t);
  }
  std::vector<double> jumps() const override { return {}; }
  double begin() const override { return 0; }
  double end() const override { return end_; }

 private:
  template <class S>
  release::HandState<S> at_(const S& t) const {
    using std::cos;
    using std::sin;
    std::array<S, 3> q, v, a;
    S sine{}, cosine{};
    double frequency = 0;  // of the sine at hand: one serves all coordinates that sway together
    for (int i = 0; i < 3; ++i) {
      const auto& c = coordinates_[i];
      q[i] = c.p + t * (c.v + 0.5 * c.a * t);
      v[i] = c.v + c.a * t;
      a[i] = S(c.a);
      if (c.amplitude == 0) continue;
      if (c.frequency != frequency) {
        frequency = c.frequency;
        sine = sin(S(frequency * t));
        cosine = cos(S(frequency * t));
      }
      const S sway = in_phase_[i] * sine + in_quadrature_[i] * cosine;
      q[i] += sway;
      v[i] += frequency * (in_phase_[i] * cosine - in_quadrature_[i] * sine);
      a[i] -= frequency * frequency * sway;
    }
    return {{q[0], q[1], q[2]}, {v[0], v[1], v[2]}, {a[0], a[1], a[2]}};
  }
  std::array<Coordinate, 3> coordinates_;
  std::array<double, 3> in_phase_{}, in_quadrature_{};  // amplitudes of sin w t and cos w t
  double end_;
};

struct RandomThrow {
  SwayingHand hand;
  contact::ProfileNormalForce force;
  contact::Patch<double> patch;
  dynamics::RigidBody<double> body;
  release::Grasp<double> grasp;
};

/// A throw of a bar or box: 0.05 to 0.5 kg held 0 to 0.16 m off its CoM, speeds of 1 to 3 m/s, opening in 20
/// to 80 ms. `sway` scales the shaking of the hand [-]; 0 is a smooth throw, 1 makes several switches of
/// mode.
inline RandomThrow random_throw(std::mt19937_64& random, double sway) {
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  const double frequency = uniform(60, 250), shake = sway * uniform(5, 25);  // rad/s, m/s²
  std::array<SwayingHand::Coordinate, 3> c{
      {{0.5, uniform(0.5, 2.5), uniform(-12, 12), shake / (frequency * frequency), frequency,
        uniform(0, 6.28)},
       {0.8, uniform(0.5, 2.5), uniform(-12, 12), shake / (frequency * frequency), frequency,
        uniform(0, 6.28)},
       {uniform(-1.5, 1.5), uniform(-6, 6), uniform(-60, 60),
        sway * uniform(20, 200) / (frequency * frequency), frequency, uniform(0, 6.28)}}};
  const double dead = uniform(0.0, 0.01), opening = uniform(0.02, 0.08), grip = uniform(10, 40);
  contact::OpeningProfile<double> profile;
  profile.open_command = 0.02;
  profile.grip_force = grip;
  profile.dead_time = dead;
  profile.opening_time = opening;
  profile.shape = uniform(1.0, 1.5);
  const double mass = uniform(0.05, 0.5), gyration = uniform(0.03, 0.1);
  const contact::Patch<double> patch{uniform(0.3, 0.9), uniform(0.006, 0.015)};
  return {SwayingHand(c, 0.02 + dead + opening + 0.02),
          contact::ProfileNormalForce(profile),
          patch,
          {mass, mass * gyration * gyration},
          {uniform(0, 0.16), uniform(-0.2, 0.2)}};
}

}  // namespace unhand::support
