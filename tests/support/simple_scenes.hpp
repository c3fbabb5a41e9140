// Simple worlds for tests: a hand at rest or in uniform acceleration, a normal force that never changes, and
// a hand seen from another frame.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "contact/normal_force.hpp"
#include "contact/registry.hpp"
#include "release/hand_motion.hpp"
#include "release/simulate_release.hpp"
#include "tests/support/random_throw.hpp"

namespace unhand::support {

/// f_N = const; the pads never part.
class ConstantForce final : public contact::NormalForce {
 public:
  explicit ConstantForce(double force) : force_(force) {}
  double at(const contact::Window&, double) const override { return force_; }
  dynamics::Dual at(const contact::Window&, const dynamics::Dual&) const override {
    return dynamics::Dual(force_);
  }
  void kinks(std::vector<double>&) const override {}
  void kinks(std::vector<dynamics::Dual>&) const override {}
  double release_time() const override { return std::numeric_limits<double>::infinity(); }

 private:
  double force_;
};

inline SwayingHand still_hand(double end) { return SwayingHand({}, end); }

/// From rest at the origin with a constant acceleration [m/s², m/s², rad/s²].
inline SwayingHand accelerating_hand(const dynamics::Acceleration<double>& a, double end) {
  std::array<SwayingHand::Coordinate, 3> c{};
  c[0].a = a.ax;
  c[1].a = a.az;
  c[2].a = a.alpha;
  return SwayingHand(c, end);
}

/// A hand in another frame: mirrored (x → −x) if so asked, then turned by `angle` [rad], then moving on at
/// `velocity`.
class TransformedHand final : public release::HandMotion {
 public:
  TransformedHand(const release::HandMotion& hand, bool mirrored, double angle,
                  dynamics::Vec2<double> velocity)
      : hand_(hand), mirror_(mirrored ? -1.0 : 1.0), angle_(angle), velocity_(velocity) {}

  release::HandState<double> at(const release::Window& w, double t) const override { return at_(w, t); }
  release::HandState<dynamics::Dual> at(const release::Window& w, const dynamics::Dual& t) const override {
    return at_(w, t);
  }
  std::vector<double> jumps() const override { return hand_.jumps(); }
  double begin() const override { return hand_.begin(); }
  double end() const override { return hand_.end(); }

  /// A vector of the original world in this one.
  template <class S>
  dynamics::Vec2<S> vector(const dynamics::Vec2<S>& a) const {
    return dynamics::rotate(S(angle_), dynamics::Vec2<S>{mirror_ * a.x, a.z});
  }

 private:
  template <class S>
  release::HandState<S> at_(const release::Window& w, const S& t) const {
    const release::HandState<S> h = hand_.at(w, t);
    const auto p = vector<S>({h.pose.x, h.pose.z}), v = vector<S>(h.twist.linear()),
               a = vector<S>(h.acceleration.linear());
    const S theta = mirror_ > 0 ? h.pose.theta : S(M_PI - h.pose.theta);
    return {{p.x + velocity_.x * t, p.z + velocity_.z * t, theta + angle_},
            {v.x + velocity_.x, v.z + velocity_.z, mirror_ * h.twist.omega},
            {a.x, a.z, mirror_ * h.acceleration.alpha}};
  }

  const release::HandMotion& hand_;
  double mirror_, angle_;
  dynamics::Vec2<double> velocity_;
};

constexpr double kGravity = 9.81;  // m/s²

/// What every contact model needs of a random throw.
inline contact::ContactParameters<double> parameters_of(const RandomThrow& thrown) {
  contact::ContactParameters<double> p;
  p.patch = thrown.patch;
  p.open_command = thrown.force.profile().open_command;
  p.delay = 0.7 * (thrown.force.release_time() - p.open_command);
  return p;
}

inline release::ReleaseProblem<double> problem_of(const RandomThrow& thrown,
                                                  const contact::ContactModel& model) {
  return {thrown.hand,  thrown.force, model, thrown.body, dynamics::level_gravity(kGravity),
          thrown.grasp, 0.0,          {},    0.0};
}

inline dynamics::IntegratorOptions tight(double relative, double absolute) {
  dynamics::IntegratorOptions o;
  o.tolerances = {relative, absolute};
  return o;
}

}  // namespace unhand::support
