// Explicit steps where a flow is smooth, implicit ones where it turns out to be stiff.
#pragma once

#include "dynamics/dormand_prince.hpp"
#include "dynamics/rosenbrock.hpp"

namespace unhand::dynamics {

/// DormandPrince where stability lets it take the steps that accuracy asks for, else Rosenbrock. From
/// explicit to implicit once stability has set the length of kStiffSteps steps in a row ([HairerWanner1996]
/// IV.2: h |λ| from two evaluations at the end of a step, near the boundary of stability, 6.1 for this
/// method). From implicit to explicit once an explicit step of the same length would have been stable
/// kSmoothSteps times in a row, by the Jacobian's fastest eigenvalue. An explicit step costs some two
/// thirds of an implicit one (docs/integrator.md).
template <int N>
class SwitchingStepper final : public Stepper<double, N> {
 public:
  /// `kind`: phases of stiff flows begin with implicit steps. `seeded`: the parameters of the system carry
  /// derivatives of their own.
  explicit SwitchingStepper(const Tolerances& tolerances, bool seeded = false,
                            FlowKind kind = FlowKind::mixed)
      : explicit_(tolerances), implicit_(tolerances, seeded), kind_(kind) {}

  void start(const HybridSystem<N>& system, const Phase& phase, const double& t,
             const State<double, N>& y) override {
    system_ = &system;
    phase_ = phase;
    if (!std::exchange(goes_on_, false))
      current_ = kind_ == FlowKind::stiff ? static_cast<Stepper<double, N>*>(&implicit_) : &explicit_;
    in_a_row_ = 0;
    current_->start(system, phase, t, y);
    show();
  }

  StepStatus step(const double& limit, double longest) override {
    if (in_a_row_ >= (is_explicit() ? kStiffSteps : kSmoothSteps)) {
      Stepper<double, N>* other = is_explicit() ? static_cast<Stepper<double, N>*>(&implicit_) : &explicit_;
      other->suggest(current_->t1() - current_->t0());
      other->start(*system_, phase_, current_->t1(), current_->y1());
      current_ = other;
      in_a_row_ = 0;
    }
    const StepStatus status = current_->step(limit, longest);
    show();
    if (status == StepStatus::accepted) {
      const bool says_other =
          is_explicit() ? explicit_.stiffness() > kBoundary : implicit_.stiffness() < kBoundary;
      in_a_row_ = says_other ? in_a_row_ + 1 : 0;
    }
    return status;
  }

  void interpolate(double theta, State<double, N>& y) const override { current_->interpolate(theta, y); }
  void retake(double h, State<double, N>& y) override {
    current_->retake(h, y);
    count();
  }
  int parts() const override { return current_->parts(); }
  void goes_on() override { goes_on_ = true; }
  void suggest(double h) override {
    explicit_.suggest(h);
    implicit_.suggest(h);
  }

 private:
  static constexpr int kStiffSteps = 10, kSmoothSteps = 2;
  static constexpr double kBoundary = 5.5;  // of h |λ|

  bool is_explicit() const { return current_ == &explicit_; }
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
  FlowKind kind_;
  Stepper<double, N>* current_{&explicit_};
  const HybridSystem<N>* system_{};
  Phase phase_;
  bool goes_on_{};
  int in_a_row_{};  // steps that spoke for the other method
};

}  // namespace unhand::dynamics
