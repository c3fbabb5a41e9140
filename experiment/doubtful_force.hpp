// A measured normal force whose smoothing is not quite sure of when the pads part.
#pragma once

#include "contact/normal_force.hpp"

namespace unhand::experiment {

/// The smoothed force f of a ramp (r − t)^p from s to r [s], with r moved by δ = z σ_r, z the deviation in
/// standard deviations [-] and σ_r that of the release in the smoothing. What the samples know better than r
/// follows it as they would have it follow: with white noise and many samples, least squares give
///
///   δs = δ/(2p)²,   δp = (δ p/(r − s)) ((2p + 1)/(2p))²
///
/// (the grip is known from the plateau before). The error left is that of the last bit of the ramp, where f
/// is small and a share of it large: slipping pads' wrenches are proportional to f, so that it matters there.
///
/// A release that is uncertain by more than a twentieth of the ramp saturates: δ = d tanh(z σ_r/d) with d a
/// fifth of the ramp, so that it stays a ramp at every z, and has the slope σ_r at z = 0.
class DoubtfulForce final : public contact::NormalForce {
 public:
  /// `base`, with a ramp, must outlive it. Throws std::invalid_argument unless the ramp stays one: |δ| below
  /// half its length.
  DoubtfulForce(const contact::NormalForce& base, const contact::NormalForceSummary& ramp,
                const dynamics::Dual& deviation);
  /// f [N] at t [s].
  double at(const dynamics::Window& window, double t) const override { return at_(window, t); }
  dynamics::Dual at(const dynamics::Window& window, const dynamics::Dual& t) const override {
    return at_(window, t);
  }
  using NormalForce::kinks;
  /// Those of the base, moved [s].
  void kinks(std::vector<double>& out) const override { kinks_(out); }
  void kinks(std::vector<dynamics::Dual>& out) const override { kinks_(out); }
  double release_time() const override;

  /// Whether a summary tells of a ramp and of how sure its end is.
  static bool applies_to(const contact::NormalForceSummary& ramp);

 private:
  /// The time at which the base has what this force has at t: stretched over the ramp.
  template <class S>
  S to_base(const S& t) const;
  template <class S>
  S from_base(double t) const;
  template <class S>
  S at_(const dynamics::Window& window, const S& t) const;
  template <class S>
  void kinks_(std::vector<S>& out) const;

  const contact::NormalForce& base_;
  double start_, release_;                  // of the base [s]
  dynamics::Dual new_start_, new_release_;  // [s]
  dynamics::Dual power_;                    // δp [-]
};

}  // namespace unhand::experiment
