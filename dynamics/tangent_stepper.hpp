// Values by a stepper in double, derivatives by the equations that they obey along its steps.
#pragma once

#include "dynamics/stepper.hpp"
#include "dynamics/variational_step.hpp"

namespace unhand::dynamics {

/// The values are those of `inner` to the last bit, steps and all. Beside them S = ∂y/∂p at fixed t obeys
/// dS/dt = f_y S + f_p, a linear equation that VariationalSteps of order five solve, in the variable in which
/// the inner stepper steps (so where that is regular, so is this), with f_y and f_p on the inner dense output
/// at three nodes: one for a step of order five, several for a longer one of order eight. S therefore has the
/// order of the values, and their tolerance; it is not the derivative of their rounding and truncation.
template <int N>
class TangentStepper final : public Stepper<Dual, N> {
 public:
  /// `inner` decides the steps and the values.
  explicit TangentStepper(std::unique_ptr<Stepper<double, N>> inner) : inner_(std::move(inner)) {}

  void start(const HybridSystem<N>& system, const Phase& phase, const Dual& t,
             const State<Dual, N>& y) override {
    system_ = &system;
    phase_ = phase;
    this->t1_ = t;
    this->y1_ = y;
    const State<double, N> at = values<Dual, N>(y);
    State<double, N> rate;
    system.flow(phase, t.a, at, rate);
    for (int i = 0; i < N; ++i)
      for (int k = 0; k < kDualSize; ++k) end_[i][k] = y[i].v[k] - rate[i] * t.v[k];
    inner_->start(system, phase, t.a, at);
  }

  StepStatus step(const Dual& limit, double longest) override {
    this->t0_ = this->t1_;
    this->y0_ = this->y1_;
    begin_ = end_;
    const StepStatus status = inner_->step(limit.a, longest);
    count();
    if (status != StepStatus::accepted) return status;
    whole_ = inner_->fraction(inner_->t1() - inner_->t0());
    parts_ = inner_->parts();
    end_ = begin_;
    for (int k = 0; k < parts_; ++k) {
      solve(end_, k * whole_ / parts_, (k + 1) * whole_ / parts_, step_[k]);
      end_ = step_[k].end();
    }
    this->t1_ = inner_->t1() < limit.a ? Dual(inner_->t1()) : limit;
    join(inner_->y1(), end_, this->t1_, this->y1_);
    return status;
  }

  void interpolate(double theta, State<Dual, N>& y) const override {
    const double fraction = inner_->fraction(theta * (inner_->t1() - inner_->t0()));
    const Dual t = this->t0_ + theta * (this->t1_ - this->t0_);
    const int k = part(fraction);
    join(inner_->point(fraction).y, step_[k].at(fraction / whole_ * parts_ - k), t, y);
  }

  void retake(double h, State<Dual, N>& y) override {
    State<double, N> at;
    retake_values(h, at);
    const double fraction = inner_->fraction(h);
    const int k = part(fraction);
    VariationalStep<N> last;
    solve(k > 0 ? step_[k - 1].end() : begin_, k * whole_ / parts_, fraction, last);
    join(at, last.end(), Dual(this->t0_ + h), y);
  }

  void interpolate_values(double theta, State<double, N>& y) const override { inner_->interpolate(theta, y); }
  void retake_values(double h, State<double, N>& y) override {
    inner_->retake(h, y);
    count();
  }
  double fraction(double h) const override { return inner_->fraction(h); }
  StepPoint<N> point(double theta) const override { return inner_->point(theta); }
  void goes_on() override { inner_->goes_on(); }
  void suggest(double h) override { inner_->suggest(h); }

 private:
  static constexpr int kMostParts = 3;

  /// The part of the step in which a fraction of the inner one lies.
  int part(double fraction) const {
    return std::clamp(static_cast<int>(fraction / whole_ * parts_), 0, parts_ - 1);
  }

  /// The derivatives from one fraction of the inner step, where they are `start`, to another.
  void solve(const Sensitivity<N>& start, double from, double to, VariationalStep<N>& step) {
    std::array<FlowDerivative<N>, 3> at;
    std::array<double, 3> speed;
    for (int k = 0; k < 3; ++k) {
      const StepPoint<N> point = inner_->point(from + VariationalStep<N>::kNode[k] * (to - from));
      at[k].evaluate(*system_, phase_, point.t, point.y);
      speed[k] = point.speed;
    }
    dual_evaluations_ += 6;
    step.solve(start, to - from, at, speed);
  }

  /// Values and derivatives at a time that may move with the parameters.
  void join(const State<double, N>& at, const Sensitivity<N>& s, const Dual& t, State<Dual, N>& y) const {
    for (int i = 0; i < N; ++i) {
      y[i].a = at[i];
      for (int k = 0; k < kDualSize; ++k) y[i].v[k] = s[i][k];
    }
    if (t.v.isZero(0)) return;
    State<double, N> rate;
    system_->flow(phase_, t.a, at, rate);
    for (int i = 0; i < N; ++i) y[i].v += rate[i] * t.v;
  }

  void count() {
    this->flow_evaluations_ = inner_->flow_evaluations() + dual_evaluations_;
    this->rejected_ = inner_->rejected_steps();
  }

  std::unique_ptr<Stepper<double, N>> inner_;
  const HybridSystem<N>* system_{};
  Phase phase_;
  Sensitivity<N> begin_{}, end_{};  // at the ends of the last step, at fixed times
  std::array<VariationalStep<N>, kMostParts> step_;
  int parts_{1};     // of the last step
  double whole_{1};  // the fraction of the inner step at which the step ends
  long dual_evaluations_{};
};

}  // namespace unhand::dynamics
