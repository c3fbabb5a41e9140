// Explicit steps, and implicit ones from where a flow turns out to be stiff.
#pragma once

#include "dynamics/dormand_prince.hpp"
#include "dynamics/rosenbrock.hpp"

namespace unhand::dynamics {

/// DormandPrince until stability, not accuracy, has set the length of kStiffSteps steps in a row; then
/// Rosenbrock to the end of the phase. The test is that of [HairerWanner1996] IV.2: h |λ| from two
/// evaluations at the end of a step, near the boundary of stability (3.3 for this method). An explicit step
/// costs a quarter of an implicit one.
template <int N>
class SwitchingStepper final : public Stepper<double, N> {
 public:
  /// `seeded`: the parameters of the system carry derivatives of their own.
  explicit SwitchingStepper(const Tolerances& tolerances, bool seeded = false)
      : explicit_(tolerances), implicit_(tolerances, seeded) {}

  void start(const HybridSystem<N>& system, const Phase& phase, const double& t,
             const State<double, N>& y) override {
    system_ = &system;
    phase_ = phase;
    current_ = &explicit_;
    suspicious_ = 0;
    current_->start(system, phase, t, y);
    show();
  }

  StepStatus step(const double& limit, double longest) override {
    if (suspicious_ >= kStiffSteps && current_ == &explicit_) {
      current_ = &implicit_;
      implicit_.suggest(explicit_.t1() - explicit_.t0());
      implicit_.start(*system_, phase_, explicit_.t1(), explicit_.y1());
    }
    const StepStatus status = current_->step(limit, longest);
    show();
    if (current_ == &explicit_ && status == StepStatus::accepted)
      suspicious_ = explicit_.stiffness() > kBoundary ? suspicious_ + 1 : 0;
    return status;
  }

  void interpolate(double theta, State<double, N>& y) const override { current_->interpolate(theta, y); }
  void retake(double h, State<double, N>& y) override {
    current_->retake(h, y);
    count();
  }
  void suggest(double h) override { explicit_.suggest(h); }

 private:
  static constexpr int kStiffSteps = 10;
  static constexpr double kBoundary = 3.0;  // of h |λ|

  void show() {
    this->t0_ = current_->t0();
    this->t1_ = current_->t1();
    this->y0_ = current_->y0();
    this->y1_ = current_->y1();
    count();
  }
  void count() {
    this->flow_evaluations_ = explicit_.flow_evaluations() + implicit_.flow_evaluations();
    this->rejected_ = explicit_.rejected_steps() + implicit_.rejected_steps();
  }

  DormandPrince<double, N> explicit_;
  Rosenbrock<N> implicit_;
  Stepper<double, N>* current_{&explicit_};
  const HybridSystem<N>* system_{};
  Phase phase_;
  int suspicious_{};
};

}  // namespace unhand::dynamics
