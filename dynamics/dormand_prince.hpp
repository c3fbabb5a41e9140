// Explicit Runge-Kutta of order 8(5,3) with dense output of order 7: the stepper of smooth flows.
#pragma once

#include <cmath>
#include <utility>

#include "dynamics/dormand_prince_coefficients.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// DOP853 of [HairerNorsettWanner1993] II.10. Twelve evaluations a step (the last is the first of the next),
/// and three more where the dense output is asked for. Its estimates are combined component by component, not
/// as two norms, as there: see SingleStep::error_norm. To the finer of the two another of order six is added,
/// since at some places in a step a kink goes unseen by each, but at none by both.
template <class S, int N>
class DormandPrince final : public SingleStep<DormandPrince<S, N>, S, N> {
 public:
  static constexpr double kOrder = 8;  ///< of the error estimate [-]
  using SingleStep<DormandPrince<S, N>, S, N>::SingleStep;

  /// The first stage, which after a step is the last of the one before.
  void prepare(bool fresh) {
    if (fresh)
      this->flow(this->t0_, this->y0_, k_[0]);
    else
      k_[0] = k_[kEnd];
  }
  /// A first step length [s].
  double guess(double longest) { return this->first_step(values<S, N>(k_[0]), longest); }

  /// Takes the step of length h [s] and returns its error norm.
  double attempt(const S& h) {
    h_ = h;
    bent_ = false;
    advance(h, this->y1_);
    this->flow(this->t0_ + h, this->y1_, k_[kEnd]);
    State<double, N> fine, coarse;
    for (int i = 0; i < N; ++i) {
      const double fifth = estimate(dop853::kError5, i), sixth = estimate(dop853::kError6, i);
      fine[i] = std::sqrt(fifth * fifth + sixth * sixth);
      coarse[i] = estimate(dop853::kError3, i);
    }
    return this->error_norm(fine, coarse);
  }

  /// h |λ| of the last step's fastest direction, from the flow at its end and at the stage before.
  double stiffness() const {
    double rates = 0, states = 0;
    for (int i = 0; i < N; ++i) {
      const double rate = value_of(k_[kEnd][i]) - value_of(k_[kEnd - 1][i]);
      const double state = value_of(this->y1_[i]) - value_of(last_stage_[i]);
      rates += rate * rate;
      states += state * state;
    }
    return states > 0 ? std::abs(value_of(h_)) * std::sqrt(rates / states) : 0.0;
  }

  int parts() const override { return 3; }
  void interpolate(double theta, State<S, N>& y) const override {
    if (!bent_) bend();
    const double one = 1 - theta;
    for (int i = 0; i < N; ++i) {
      const auto& [dy, b0, b1, b2, b3, b4, b5] = bend_[i];
      const S end = b2 + theta * (b3 + one * (b4 + theta * b5));
      y[i] = this->y0_[i] + theta * (dy + one * (b0 + theta * (b1 + one * end)));
    }
  }

  void retake(double h, State<S, N>& y) override {
    const auto kept = k_;  // the stages of the step are still needed by its dense output
    advance(S(h), y);
    k_ = kept;
  }

 private:
  static constexpr int kEnd = 12,
                       kStages = 16;  // of the flow at the end of the step; with the dense output's

  /// Σ_j weight_j k_j of component i over the first `Count` stages; zeros cost nothing.
  template <int Count, std::size_t Size>
  S weighted(const double (&weight)[Size], int i) const {
    S sum = weight[0] * k_[0][i];
    for (int j = 1; j < Count; ++j)
      if (weight[j] != 0) sum += weight[j] * k_[j][i];
    return sum;
  }
  /// h Σ_j weight_j k_j of component i, values alone.
  template <class Weights>
  double estimate(const Weights& weight, int i) const {
    double sum = 0;
    for (int j = 0; j < kEnd; ++j)
      if (weight[j] != 0) sum += weight[j] * value_of(k_[j][i]);
    return value_of(h_) * sum;
  }
  template <int Stage>
  void stage_state(const S& h, State<S, N>& y) const {
    for (int i = 0; i < N; ++i) y[i] = this->y0_[i] + h * weighted<Stage>(dop853::kA[Stage], i);
  }
  template <int Stage>
  void stage(const S& h) const {
    State<S, N> y;
    stage_state<Stage>(h, y);
    this->flow(this->t0_ + dop853::kNode[Stage] * h, y, k_[Stage]);
    if constexpr (Stage == kEnd - 1) last_stage_ = y;
  }

  void advance(const S& h, State<S, N>& y1) {
    [&]<int... Stage>(std::integer_sequence<int, Stage...>) { (stage<Stage + 1>(h), ...); }
    (std::make_integer_sequence<int, kEnd - 1>());
    stage_state<kEnd>(h, y1);
  }

  /// The dense output's stages and coefficients, when it is first asked for.
  void bend() const {
    stage<13>(h_);
    stage<14>(h_);
    stage<15>(h_);
    for (int i = 0; i < N; ++i) {
      const S dy = this->y1_[i] - this->y0_[i], begin = h_ * k_[0][i] - dy;
      bend_[i][0] = dy;
      bend_[i][1] = begin;
      bend_[i][2] = dy - h_ * k_[kEnd][i] - begin;
      for (int row = 0; row < 4; ++row) bend_[i][3 + row] = h_ * weighted<kStages>(dop853::kBend[row], i);
    }
    bent_ = true;
  }

  mutable std::array<State<S, N>, kStages> k_{};
  mutable State<S, N> last_stage_{};
  mutable std::array<std::array<S, 7>, N> bend_{};
  mutable bool bent_{};
  S h_{};
};

}  // namespace unhand::dynamics
