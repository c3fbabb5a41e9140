// What a release may do otherwise than its log says.
#pragma once

#include <vector>

#include "contact/normal_force.hpp"
#include "dynamics/effect.hpp"
#include "release/hand_motion.hpp"

namespace unhand::release {

/// Times by which the gripper and the arm are late.
template <class S>
struct Lateness {
  S opening_delay{};  ///< f_N acts this much later than logged [s]
  S tracking_lag{};   ///< τ: the true hand follows the logged one as τ ẏ + y = y_log [s]
};

/// release.opening_delay, release.hand_tracking_lag
std::span<const dynamics::EffectOn<Lateness>> lateness_effects();

/// f_N(t − delay). `base` must outlive it.
class DelayedForce final : public contact::NormalForce {
 public:
  /// `delay` [s], positive where the force acts later than logged. Throws std::invalid_argument outside of
  /// the effect's range.
  DelayedForce(const contact::NormalForce& base, const dynamics::Dual& delay);
  DelayedForce(const contact::NormalForce&&, const dynamics::Dual&) = delete;
  double at(const Window& window, double t) const override;
  Dual at(const Window& window, const Dual& t) const override;
  void kinks(std::vector<double>& out) const override;
  void kinks(std::vector<Dual>& out) const override;
  double release_time() const override { return base_.release_time() + delay_.a; }

 private:
  const contact::NormalForce& base_;
  Dual delay_;
};

/// The hand behind a logged one by the first-order lag τ ẏ + y = y_log, in closed form: between the breaks of
/// the log's polynomials y = Σ_k (−τ)^k dᵏ/dtᵏ y_log + C exp(−(t − t_i)/τ), with the C that keep y
/// and ẏ continuous; before the log begins the lag has settled (C = 0). `logged` must outlive it.
class LaggedHand final : public HandMotion {
 public:
  /// `lag` τ [s]. Throws std::invalid_argument outside of the effect's range.
  LaggedHand(const PolynomialHand& logged, const dynamics::Dual& lag);
  LaggedHand(const PolynomialHand&&, const dynamics::Dual&) = delete;
  HandState<double> at(const Window& window, double t) const override { return at_(window, t); }
  HandState<Dual> at(const Window& window, const Dual& t) const override { return at_(window, t); }
  std::vector<double> jumps() const override { return logged_.jumps(); }
  double begin() const override { return logged_.begin(); }
  double end() const override { return logged_.end(); }

 private:
  template <class S>
  HandState<S> at_(const Window& window, const S& t) const;

  /// One piece: Σ_j settled[j] (t − t_i)ʲ + transient · exp(−(t − t_i)/τ)
  struct Piece {
    std::array<std::array<Dual, 3>, 6> settled;
    std::array<Dual, 3> transient;
  };
  const PolynomialHand& logged_;
  Dual lag_;
  std::vector<Piece> pieces_;
};

}  // namespace unhand::release
