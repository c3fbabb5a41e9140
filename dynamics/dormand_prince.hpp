// Explicit Runge-Kutta of order 5(4) with dense output of order 4: the stepper of smooth flows.
#pragma once

#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// [DormandPrince1980]; dense output after [HairerNorsettWanner1993] II.6. Six evaluations a step (the last
/// is the first of the next).
template <class S, int N>
class DormandPrince final : public SingleStep<DormandPrince<S, N>, S, N> {
 public:
  static constexpr bool kPredictive = false;
  static constexpr double kOrder = 5;
  using SingleStep<DormandPrince<S, N>, S, N>::SingleStep;

  void prepare(bool fresh) {
    if (fresh)
      this->flow(this->t0_, this->y0_, k_[0]);
    else
      k_[0] = k_[6];
  }
  double guess() const { return this->first_step(values<S, N>(k_[0])); }

  double attempt(const S& h) {
    advance(h, this->y1_, true);
    State<S, N> error;
    for (int i = 0; i < N; ++i)
      error[i] = h * (71.0 / 57600 * k_[0][i] - 71.0 / 16695 * k_[2][i] + 71.0 / 1920 * k_[3][i] -
                      17253.0 / 339200 * k_[4][i] + 22.0 / 525 * k_[5][i] - 1.0 / 40 * k_[6][i]);
    h_ = h;
    return this->error_norm(error);
  }

  /// h |λ| of the last step's fastest direction, from the flow at its end and at the stage before.
  double stiffness() const {
    double rates = 0, states = 0;
    for (int i = 0; i < N; ++i) {
      const double rate = value_of(k_[6][i]) - value_of(k_[5][i]);
      const double state = value_of(this->y1_[i]) - value_of(last_stage_[i]);
      rates += rate * rate;
      states += state * state;
    }
    return states > 0 ? std::abs(value_of(h_)) * std::sqrt(rates / states) : 0.0;
  }

  void interpolate(double theta, State<S, N>& y) const override {
    const double one = 1 - theta;
    for (int i = 0; i < N; ++i) {
      const S dy = this->y1_[i] - this->y0_[i];
      const S bend = h_ * k_[0][i] - dy;
      const S twist = dy - h_ * k_[6][i] - bend;
      const S d = h_ * (-12715105075.0 / 11282082432.0 * k_[0][i] + 87487479700.0 / 32700410799.0 * k_[2][i] -
                        10690763975.0 / 1880347072.0 * k_[3][i] + 701980252875.0 / 199316789632.0 * k_[4][i] -
                        1453857185.0 / 822651844.0 * k_[5][i] + 69997945.0 / 29380423.0 * k_[6][i]);
      y[i] = this->y0_[i] + theta * (dy + one * (bend + theta * (twist + one * d)));
    }
  }

  void retake(double h, State<S, N>& y) override {
    // The stages of the accepted step are still needed by the dense output.
    const auto kept = k_;
    advance(S(h), y, false);
    k_ = kept;
  }

 private:
  void advance(const S& h, State<S, N>& y1, bool with_last) {
    const S& t = this->t0_;
    const State<S, N>& y0 = this->y0_;
    State<S, N> y;
    for (int i = 0; i < N; ++i) y[i] = y0[i] + h * (1.0 / 5 * k_[0][i]);
    this->flow(t + 1.0 / 5 * h, y, k_[1]);
    for (int i = 0; i < N; ++i) y[i] = y0[i] + h * (3.0 / 40 * k_[0][i] + 9.0 / 40 * k_[1][i]);
    this->flow(t + 3.0 / 10 * h, y, k_[2]);
    for (int i = 0; i < N; ++i)
      y[i] = y0[i] + h * (44.0 / 45 * k_[0][i] - 56.0 / 15 * k_[1][i] + 32.0 / 9 * k_[2][i]);
    this->flow(t + 4.0 / 5 * h, y, k_[3]);
    for (int i = 0; i < N; ++i)
      y[i] = y0[i] + h * (19372.0 / 6561 * k_[0][i] - 25360.0 / 2187 * k_[1][i] + 64448.0 / 6561 * k_[2][i] -
                          212.0 / 729 * k_[3][i]);
    this->flow(t + 8.0 / 9 * h, y, k_[4]);
    for (int i = 0; i < N; ++i)
      y[i] = y0[i] + h * (9017.0 / 3168 * k_[0][i] - 355.0 / 33 * k_[1][i] + 46732.0 / 5247 * k_[2][i] +
                          49.0 / 176 * k_[3][i] - 5103.0 / 18656 * k_[4][i]);
    this->flow(t + h, y, k_[5]);
    for (int i = 0; i < N; ++i)
      y1[i] = y0[i] + h * (35.0 / 384 * k_[0][i] + 500.0 / 1113 * k_[2][i] + 125.0 / 192 * k_[3][i] -
                           2187.0 / 6784 * k_[4][i] + 11.0 / 84 * k_[5][i]);
    if (!with_last) return;
    this->flow(t + h, y1, k_[6]);
    last_stage_ = y;
  }

  std::array<State<S, N>, 7> k_{};
  State<S, N> last_stage_{};
  S h_{};
};

}  // namespace unhand::dynamics
