// Values by a stepper in double, derivatives by the equations that they obey along its steps.
#pragma once

#include "dynamics/stepper.hpp"
#include "dynamics/variational_step.hpp"

namespace unhand::dynamics {

/// The values are those of `inner` to the last bit, steps and all. Beside them S = ∂y/∂p at fixed t obeys
/// dS/dt = f_y S + f_p, a linear equation that one VariationalStep solves a step, in the variable in which
/// the inner stepper takes it (so where that is regular, so is this), with f_y and f_p on the inner dense
/// output at three nodes. S therefore has the order of the values, and their tolerance; it is not the
/// derivative of their rounding and truncation.
template <int N>
class TangentStepper final : public Stepper<Dual, N> {
 public:
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
    solve(whole_, step_);
    end_ = step_.end();
    this->t1_ = inner_->t1() < limit.a ? Dual(inner_->t1()) : limit;
    join(inner_->y1(), end_, this->t1_, this->y1_);
    return status;
  }

  void interpolate(double theta, State<Dual, N>& y) const override {
    const double fraction = inner_->fraction(theta * (inner_->t1() - inner_->t0()));
    const Dual t = this->t0_ + theta * (this->t1_ - this->t0_);
    join(inner_->point(fraction).y, step_.at(fraction / whole_), t, y);
  }

  void retake(double h, State<Dual, N>& y) override {
    State<double, N> at;
    retake_values(h, at);
    VariationalStep<N> part;
    solve(inner_->fraction(h), part);
    join(at, part.end(), Dual(this->t0_ + h), y);
  }

  void interpolate_values(double theta, State<double, N>& y) const override { inner_->interpolate(theta, y); }
  void retake_values(double h, State<double, N>& y) override {
    inner_->retake(h, y);
    count();
  }
  void suggest(double h) override { inner_->suggest(h); }

 private:
  /// The derivatives from the start of the step to a fraction of it.
  void solve(double fraction, VariationalStep<N>& step) {
    std::array<FlowDerivative<N>, 3> at;
    std::array<double, 3> speed;
    for (int k = 0; k < 3; ++k) {
      const StepPoint<N> point = inner_->point(VariationalStep<N>::kNode[k] * fraction);
      at[k].evaluate(*system_, phase_, point.t, point.y);
      speed[k] = point.speed;
    }
    dual_evaluations_ += 6;
    step.solve(begin_, fraction, at, speed);
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
  VariationalStep<N> step_;
  double whole_{1};  // the fraction of the inner step at which the step ends
  long dual_evaluations_{};
};

}  // namespace unhand::dynamics
