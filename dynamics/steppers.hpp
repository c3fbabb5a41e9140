// The steppers of one integration, chosen by what the flow of a mode asks for.
#pragma once

#include <memory>

#include "dynamics/integrator.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// y' = 0: nothing to integrate, steps only sample the guards.
template <class S, int N>
class Frozen final : public Stepper<S, N> {
 public:
  void start(const HybridSystem<N>&, const Phase&, const S& t, const State<S, N>& y) override {
    this->t1_ = t;
    this->y1_ = y;
  }
  StepStatus step(const S& limit, double longest) override {
    this->t0_ = this->t1_;
    this->y0_ = this->y1_;
    const double left = value_of(limit) - value_of(this->t0_);
    this->t1_ = left <= longest * (1 + 1e-9) ? limit : S(this->t0_ + left / std::ceil(left / longest));
    return StepStatus::accepted;
  }
  void interpolate(double, State<S, N>& y) const override { y = this->y0_; }
  void retake(double, State<S, N>& y) override { y = this->y0_; }
};

/// One stepper per kind of flow, paced or not, each made when first needed; Method::automatic takes
/// DormandPrince for smooth flows, SwitchingStepper for the others. With Dual, DormandPrince steps in dual
/// numbers, and all others carry derivatives in a TangentStepper. Instantiated as `integrate` is.
template <class S, int N>
class Steppers {
 public:
  /// The options are kept by reference.
  explicit Steppers(const IntegratorOptions& options) : options_(options) {}

  /// The stepper for modes of one kind; it stays this object's.
  Stepper<S, N>& of(FlowKind kind, bool paced);
  /// Writes the work of all steppers so far into `statistics`.
  void count(IntegratorStatistics& statistics) const;

 private:
  Method method(FlowKind kind) const;

  const IntegratorOptions& options_;
  Frozen<S, N> frozen_;
  std::unique_ptr<Stepper<S, N>> made_[4][2];  // by kind and pace
};

extern template class Steppers<double, 2>;
extern template class Steppers<double, 6>;
extern template class Steppers<double, 7>;
extern template class Steppers<Dual, 2>;
extern template class Steppers<Dual, 6>;
extern template class Steppers<Dual, 7>;

}  // namespace unhand::dynamics
