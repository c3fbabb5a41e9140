// The kinematic model: the object is carried rigidly until the gripper's delay has passed, then flies.
#pragma once

#include <vector>

#include "contact/contact_model.hpp"

namespace unhand::contact {

/// Time between the opening command and the release [s]: a number, or a distribution on [0, longest].
///
/// Predictions release after `centre`. `quantiles(n)` are delays to simulate where an outcome's distribution
/// is wanted: they are equally likely, and the mean over them is a quadrature of the expectation.
struct DelayDistribution {
  /// A number, or a distribution.
  enum class Kind {
    number,            ///< `centre`, known
    uniform,           ///< on [0, longest]
    truncated_normal,  ///< cut off at 0 and `longest`
  };
  Kind kind{Kind::number};  ///< which of them
  double centre{};          ///< the number; the mean, of the normal before truncation [s]
  double spread{};          ///< standard deviation before truncation [s]
  double longest{0.1};      ///< T: the distribution lives on [0, T] [s]

  /// A known delay [s], >= 0.
  static DelayDistribution number(double delay) { return {Kind::number, delay, 0, delay}; }
  /// Uniform on [0, longest] [s].
  static DelayDistribution uniform(double longest) { return {Kind::uniform, 0.5 * longest, 0, longest}; }
  /// Normal of the given mean and standard deviation before truncation, cut off at 0 and `longest`; all [s].
  static DelayDistribution normal(double mean, double deviation, double longest) {
    return {Kind::truncated_normal, mean, deviation, longest};
  }

  /// Mean after truncation [s]. Throws as validate() does.
  double mean() const;
  /// The delays at probabilities (k + ½)/n, k = 0 … n − 1 [s], increasing; n >= 1. A number gives itself
  /// once. Throws std::invalid_argument for another n, and as validate() does.
  std::vector<double> quantiles(int n) const;
};

/// Throws std::invalid_argument, naming parameter, value and accepted range.
void validate(const DelayDistribution&);

/// The model's name in the registry.
inline constexpr const char* kGripperDelay = "gripper_delay";

/// One mode, in which the object is part of the hand; released at `open_command + delay` with the twist of
/// its CoM. [LiuBillard2024] uses it with a delay distribution; D4.6 2.1.4 states its limit (grasps off the
/// CoM).
class GripperDelay final : public ContactModelFrom<GripperDelay> {
 public:
  /// `open_command` [s] on the robot's clock, `delay` [s] >= 0. Throws std::invalid_argument.
  GripperDelay(double open_command, const Dual& delay);

  std::string_view name() const override { return kGripperDelay; }
  int mode_count() const override { return 1; }
  std::string_view mode_name(int) const override { return "carried"; }
  dynamics::FlowKind kind(int) const override { return dynamics::FlowKind::frozen; }
  bool is_homogeneous(int) const override { return false; }
  int guard_count(int) const override { return 0; }
  dynamics::Guard guard(int, int) const override { return {}; }
  void separation(const NormalForce&, double& t) const override { t = open_command_ + delay_.a; }
  void separation(const NormalForce&, Dual& t) const override { t = open_command_ + delay_; }

  /// ContactModel's functions for either scalar, made virtual by ContactModelFrom.
  /// @{
  template <class S>
  Wrench<S> wrench_(int, const Scene<S>& scene, const Relative<S>& y) const {
    return sticking_wrench(scene, y);
  }
  template <class S>
  void rate_(int, const Scene<S>&, const Relative<S>&, State<S, 6>& dy) const {
    dy = {};
  }
  template <class S>
  void guards_(const Phase&, const SceneSource&, const S&, const Relative<S>&, S*) const {}
  template <class S>
  Entry<S, 6> on_guard_(const Phase& from, int, const SceneSource&, const S& t, const Relative<S>& y) const {
    return {from.mode, t, y.state(), S(0)};
  }
  template <class S>
  Entry<S, 6> membership_(int, const Window&, const SceneSource&, const S& t, const Relative<S>& y) const {
    return {0, t, Relative<S>{y.arm, y.angle, {S(0), S(0)}, S(0)}.state(), S(0)};
  }
  /// @}

 private:
  double open_command_;
  Dual delay_;
};

extern template class ContactModelFrom<GripperDelay>;

}  // namespace unhand::contact
