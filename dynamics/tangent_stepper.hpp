// Values by a stepper in double, derivatives by the equations that they obey along its steps.
#pragma once

#include "dynamics/stepper.hpp"
#include "dynamics/variational_step.hpp"

namespace unhand::dynamics {

/// The values are those of `inner` to the last bit, steps and all. Beside them go S = dy/dp, taken not at
/// fixed t but at fixed places between the ends of the phase: where these move by ∂t/∂p, times between them
/// move in proportion. S then obeys dS/dt = f_y S + f_p + f_t ∂t/∂p + f d(∂t/∂p)/dt. (At fixed t, f_p has a
/// pole where data end at a time that depends on p as (t₁ − t)^q with q < 1.) The equation is linear;
/// VariationalSteps of order five solve it in the variable in which the inner stepper steps (so where that is
/// regular, so is this), with the flow's derivatives on the inner dense output at three nodes: one for a step
/// of order five, several for a longer one of order eight. S is not the derivative of the values' rounding
/// and truncation.
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
    inner_->start(system, phase, t.a, values<Dual, N>(y));
  }

  StepStatus step(const Dual& limit, double longest) override {
    this->t0_ = this->t1_;
    this->y0_ = this->y1_;
    const StepStatus status = inner_->step(limit.a, longest);
    count();
    if (status != StepStatus::accepted) return status;
    whole_ = inner_->fraction(inner_->t1() - inner_->t0());
    parts_ = inner_->parts();
    this->t1_ = inner_->t1() < limit.a ? this->t0_ + this->aimed(limit, inner_->t1() - inner_->t0()) : limit;
    this->t1_.a = inner_->t1();
    stretch_ = (this->t1_.v - this->t0_.v) / std::max(this->t1_.a - this->t0_.a, shortest_step(this->t0_.a));
    Sensitivity<N> s = sensitivity(this->y0_);
    for (int k = 0; k < parts_; ++k) {
      solve(s, k * whole_ / parts_, (k + 1) * whole_ / parts_, step_[k]);
      s = step_[k].end();
    }
    join(inner_->y1(), s, this->y1_);
    return status;
  }

  void interpolate(double theta, State<Dual, N>& y) const override {
    const double fraction = inner_->fraction(theta * (inner_->t1() - inner_->t0()));
    const int k = part(fraction);
    join(inner_->point(fraction).y, step_[k].at(fraction / whole_ * parts_ - k), y);
  }

  void retake(double h, State<Dual, N>& y) override {
    State<double, N> at;
    retake_values(h, at);
    const double fraction = inner_->fraction(h);
    const int k = part(fraction);
    VariationalStep<N> last;
    solve(k > 0 ? step_[k - 1].end() : sensitivity(this->y0_), k * whole_ / parts_, fraction, last);
    join(at, last.end(), y);
    // h after t0, not at the same place between the ends.
    State<double, N> rate;
    system_->flow(phase_, this->t0_.a + h, at, rate);
    for (int i = 0; i < N; ++i) y[i].v += rate[i] * (this->t0_.v - time(this->t0_.a + h).v);
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

  /// A time of the step, with its derivatives.
  Dual time(double t) const { return Dual(t, this->t0_.v + (t - this->t0_.a) * stretch_); }

  static Sensitivity<N> sensitivity(const State<Dual, N>& y) {
    Sensitivity<N> s;
    for (int i = 0; i < N; ++i)
      for (int k = 0; k < kDualSize; ++k) s[i][k] = y[i].v[k];
    return s;
  }
  static void join(const State<double, N>& at, const Sensitivity<N>& s, State<Dual, N>& y) {
    for (int i = 0; i < N; ++i) {
      y[i].a = at[i];
      for (int k = 0; k < kDualSize; ++k) y[i].v[k] = s[i][k];
    }
  }

  /// S from one fraction of the inner step, where it is `start`, to another.
  void solve(const Sensitivity<N>& start, double from, double to, VariationalStep<N>& step) {
    std::array<double, kDualSize> grows;
    for (int k = 0; k < kDualSize; ++k) grows[k] = stretch_[k];
    std::array<FlowDerivative<N>, 3> at;
    std::array<double, 3> speed;
    for (int k = 0; k < 3; ++k) {
      const StepPoint<N> point = inner_->point(from + VariationalStep<N>::kNode[k] * (to - from));
      at[k].evaluate(*system_, phase_, time(point.t), point.y, grows);
      speed[k] = point.speed;
    }
    dual_evaluations_ += 6;
    step.solve(start, to - from, at, speed);
  }

  void count() {
    this->flow_evaluations_ = inner_->flow_evaluations() + dual_evaluations_;
    this->rejected_ = inner_->rejected_steps();
  }

  std::unique_ptr<Stepper<double, N>> inner_;
  const HybridSystem<N>* system_{};
  Phase phase_;
  std::array<VariationalStep<N>, kMostParts> step_;
  decltype(Dual::v) stretch_{decltype(Dual::v)::Zero()};  // d(∂t/∂p)/dt along the last step
  int parts_{1};                                          // of it
  double whole_{1};  // the fraction of the inner step at which the step ends
  long dual_evaluations_{};
};

}  // namespace unhand::dynamics
