// Stepping in a variable of the system's own choice, for flows that are singular where they begin or end.
#pragma once

#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// The system in σ, dt/dσ = |u| (a Sundman transformation): state (y, t), no explicit dependence on σ.
///
/// Where y' = F(u/|u|) with u a part of y, the Jacobian grows as 1/|u|; with the pace |u| the right-hand side
/// becomes |u| F(u/|u|), homogeneous of degree one and regular down to u = 0, which is now reached
/// exponentially in σ: nothing can step over it, and errors relative to |u| cost the same number of steps at
/// every scale.
template <int N>
class PacedSystem final : public HybridSystem<N + 1> {
 public:
  /// The system in time, in one of its phases.
  void enter(const HybridSystem<N>& entered, const Phase& its_phase) {
    system = &entered;
    phase = its_phase;
    weights = entered.pace_weights();
  }
  const HybridSystem<N>* system{};  ///< the system in time
  Phase phase;                      ///< its mode and window
  State<double, N> weights{};       ///< of u, the system's pace_weights

  /// dt/dσ = |u|
  template <class S>
  S pace(const State<S, N>& y) const {
    using std::sqrt;
    S square(0.0);
    for (int i = 0; i < N; ++i)
      if (weights[i] != 0) {
        const S u = weights[i] * y[i];
        square += u * u;
      }
    return sqrt(square);
  }

  /// As HybridSystem says, of the system in σ: no guards and no events of its own.
  /// @{
  FlowKind kind(int mode) const override { return system->kind(mode); }
  std::string_view mode_name(int mode) const override { return system->mode_name(mode); }
  int guard_count(int) const override { return 0; }
  Guard guard(int, int) const override { return {}; }
  void time_events(std::vector<double>& out) const override { out.clear(); }
  void time_events(std::vector<Dual>& out) const override { out.clear(); }
  void flow(const Phase&, double, const State<double, N + 1>& y, State<double, N + 1>& dy) const override {
    flow_(y, dy);
  }
  void flow(const Phase&, const Dual&, const State<Dual, N + 1>& y, State<Dual, N + 1>& dy) const override {
    flow_(y, dy);
  }
  void guards(const Phase&, double, const State<double, N + 1>&, double*) const override {}
  void guards(const Phase&, const Dual&, const State<Dual, N + 1>&, Dual*) const override {}
  Entry<double, N + 1> on_guard(const Phase&, int, double, const State<double, N + 1>&) const override {
    return {};
  }
  Entry<Dual, N + 1> on_guard(const Phase&, int, const Dual&, const State<Dual, N + 1>&) const override {
    return {};
  }
  Entry<double, N + 1> on_time(int, const Window&, double, const State<double, N + 1>&) const override {
    return {};
  }
  Entry<Dual, N + 1> on_time(int, const Window&, const Dual&, const State<Dual, N + 1>&) const override {
    return {};
  }
  /// @}

  void error_scale(const Phase&, const Tolerances& tolerances, const State<double, N + 1>& y0,
                   const State<double, N + 1>& y1, State<double, N + 1>& scale) const override {
    State<double, N> inner;
    system->error_scale(phase, tolerances, state(y0), state(y1), inner);
    std::copy(inner.begin(), inner.end(), scale.begin());
    scale[N] = 0.1 * tolerances.absolute;  // of the time itself [s]
  }

  /// y without the time.
  template <class S>
  static State<S, N> state(const State<S, N + 1>& y) {
    State<S, N> out;
    std::copy_n(y.begin(), N, out.begin());
    return out;
  }

 private:
  template <class S>
  void flow_(const State<S, N + 1>& y, State<S, N + 1>& dy) const {
    const State<S, N> at = state(y);
    State<S, N> rate;
    system->flow(phase, y[N], at, rate);
    const S pace = this->pace(at);
    for (int i = 0; i < N; ++i) dy[i] = pace * rate[i];
    dy[N] = pace;
  }
};

/// Any stepper of the system in σ, seen from outside as one in t. Its steps are fractions of steps in σ.
template <int N>
class PacedStepper final : public Stepper<double, N> {
 public:
  /// `inner` steps a PacedSystem.
  explicit PacedStepper(std::unique_ptr<Stepper<double, N + 1>> inner) : inner_(std::move(inner)) {}

  void start(const HybridSystem<N>& system, const Phase& phase, const double& t,
             const State<double, N>& y) override {
    system_.enter(system, phase);
    State<double, N + 1> augmented;
    std::copy_n(y.begin(), N, augmented.begin());
    augmented[N] = t;
    this->t1_ = t;
    this->y1_ = y;
    if (!std::exchange(goes_on_, false)) {  // the last phase's length in σ says nothing here
      growth_ = growth(t, y);
      inner_->suggest(growth_ != 0 ? kFirst / std::abs(growth_) : 0);
    }
    inner_->start(system_, phase, 0.0, augmented);
  }

  StepStatus step(const double& limit, double longest) override {
    this->t0_ = this->t1_;
    this->y0_ = this->y1_;
    const double pace = system_.pace(this->y0_);
    const StepStatus status = inner_->step(kFar, std::min(longest / pace, length_to(limit, pace)));
    count();
    if (status != StepStatus::accepted) return status;
    if (inner_->y1()[N] < limit) {
      this->t1_ = inner_->y1()[N];
      this->y1_ = PacedSystem<N>::state(inner_->y1());
      growth_ = (system_.pace(this->y1_) - pace) / (this->t1_ - this->t0_);
      return this->t1_ > this->t0_ ? StepStatus::accepted : StepStatus::too_small;
    }
    land(limit, this->y1_);
    this->t1_ = limit;
    return StepStatus::accepted;
  }

  void interpolate(double theta, State<double, N>& y) const override {
    State<double, N + 1> augmented;
    inner_->interpolate(fraction_at(this->t0_ + theta * (this->t1_ - this->t0_)), augmented);
    y = PacedSystem<N>::state(augmented);
  }

  double fraction(double h) const override { return fraction_at(this->t0_ + h); }
  StepPoint<N> point(double theta) const override {
    State<double, N + 1> augmented;
    inner_->interpolate(theta, augmented);
    const State<double, N> y = PacedSystem<N>::state(augmented);
    return {augmented[N], y, length() * system_.pace(y)};
  }

  int parts() const override { return inner_->parts(); }
  void goes_on() override {
    goes_on_ = true;
    inner_->goes_on();
  }
  void retake(double h, State<double, N>& y) override {
    land(this->t0_ + h, y);
    count();
  }

 private:
  static constexpr double kFar = 1e300;
  static constexpr double kFirst = 0.05;      // by which the pace changes in the first step of a phase
  static constexpr double kBeyond = 1.03;     // of the time to a limit
  static constexpr double kStraight = 1e-11;  // s: so near an instant the rest is a straight line

  /// d(pace)/dt along the flow, which is d ln(pace)/dσ.
  double growth(double t, const State<double, N>& y) const {
    constexpr double kProbe = 1e-6;  // of the time in which the state changes by the pace
    State<double, N> rate, ahead;
    system_.system->flow(system_.phase, t, y, rate);
    const double pace = system_.pace(y);
    double fastest = 0;
    for (int i = 0; i < N; ++i) fastest = std::max(fastest, std::abs(rate[i]));
    const double dt = kProbe * pace / std::max(fastest, 1e-300);
    for (int i = 0; i < N; ++i) ahead[i] = y[i] + dt * rate[i];
    const double growth = (system_.pace(ahead) - pace) / dt;
    return std::isfinite(growth) ? growth : 0;
  }

  /// The length in σ until a little after `limit` if the pace goes on as it did: what lies beyond the limit
  /// belongs to other data.
  double length_to(double limit, double pace) const {
    const double steady = (kBeyond * (limit - this->t0_) + kStraight) / pace, grown = steady * growth_;
    if (std::abs(grown) < 1e-3) return steady;
    return grown > -1 ? std::log1p(grown) / growth_ : kFar;
  }

  double length() const { return inner_->t1() - inner_->t0(); }
  void count() {
    this->flow_evaluations_ = inner_->flow_evaluations();
    this->rejected_ = inner_->rejected_steps();
  }

  /// The fraction of the inner step at which its dense output passes t.
  double fraction_at(double t) const {
    const double t0 = inner_->y0()[N], t1 = inner_->y1()[N];
    if (t >= t1) return 1;
    double low = 0, high = 1, theta = (t - t0) / (t1 - t0), before = 0, passed_before = t0;
    for (int k = 0; k < 60; ++k) {
      State<double, N + 1> y;
      inner_->interpolate(theta, y);
      const double passed = y[N];
      (passed < t ? low : high) = theta;
      if (std::abs(passed - t) <= 1e-15 * (t1 - t0) || high - low < 1e-15) break;
      const double slope = (passed - passed_before) / (theta - before);
      before = theta;
      passed_before = passed;
      const double next = theta + (t - passed) / slope;
      theta = next > low && next < high ? next : 0.5 * (low + high);
    }
    return theta;
  }

  /// True steps from the start of the last one until t is met.
  void land(double t, State<double, N>& y) {
    State<double, N + 1> augmented;
    double h = fraction_at(t) * length();
    for (int k = 0; k < 4; ++k) {
      inner_->retake(h, augmented);
      const double missed = t - augmented[N];
      y = PacedSystem<N>::state(augmented);
      if (std::abs(missed) < kStraight) break;
      h += missed / system_.pace(y);
    }
    // What is left of t, along the flow.
    State<double, N + 1> rate;
    system_.flow(system_.phase, h, augmented, rate);
    const double left = (t - augmented[N]) / rate[N];
    for (int i = 0; i < N; ++i) y[i] += left * rate[i];
  }

  std::unique_ptr<Stepper<double, N + 1>> inner_;
  PacedSystem<N> system_;
  bool goes_on_{};
  double growth_{};  // of the pace in the last step [1/s of pace]
};

}  // namespace unhand::dynamics
