// One interface for every way of advancing a smooth flow.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "dynamics/hybrid_system.hpp"

namespace unhand::dynamics {

/// How a step ended.
enum class StepStatus {
  accepted,    ///< its error is within the tolerances
  too_small,   ///< the error cannot be met above the spacing of representable times
  not_finite,  ///< the flow returned NaN or infinity however short the step
};

/// The components without their derivatives.
template <class S, int N>
State<double, N> values(const State<S, N>& y) {
  if constexpr (std::is_same_v<S, double>) {
    return y;
  } else {
    State<double, N> out;
    for (int i = 0; i < N; ++i) out[i] = value_of(y[i]);
    return out;
  }
}

/// A point of a step: the time, the state and dt/dθ, θ the fraction of the step in the variable it is taken
/// in.
template <int N>
struct StepPoint {
  double t{};            ///< s
  State<double, N> y{};  ///< state at t
  double speed{};        ///< dt/dθ [s]: the step's length where it is taken in time
};

/// Advances one phase. `start` fixes where; each `step` replaces the last accepted step [t0, t1] by the next
/// one. With S = Dual the values alone choose the step.
template <class S, int N>
class Stepper {
 public:
  virtual ~Stepper() = default;

  /// Begins at (t, y). Step-size memory is kept: the next step starts from the length of the last one.
  virtual void start(const HybridSystem<N>& system, const Phase& phase, const S& t, const State<S, N>& y) = 0;

  /// One error-controlled step of at most `longest` [s], ending exactly at `limit` if it gets there.
  virtual StepStatus step(const S& limit, double longest) = 0;

  /// The state at t0 + θ (t1 − t0) from the dense output of the last step, 0 <= θ <= 1.
  virtual void interpolate(double theta, State<S, N>& y) const = 0;

  /// The last step taken again with the length h <= t1 − t0, without the dense output's error: what event
  /// times are polished with.
  virtual void retake(double h, State<S, N>& y) = 0;

  /// The values of both alone, as searches for roots need them.
  virtual void interpolate_values(double theta, State<double, N>& y) const {
    State<S, N> at;
    interpolate(theta, at);
    y = values<S, N>(at);
  }
  /// As retake, values alone.
  virtual void retake_values(double h, State<double, N>& y) {
    State<S, N> at;
    retake(h, at);
    y = values<S, N>(at);
  }

  /// Into how many parts the last step is to be cut for a method of order five to resolve it as well, at most
  /// three.
  virtual int parts() const { return 1; }

  /// The last step in the variable that it was taken in: the fraction at which `h` has passed since t0, and
  /// the point at a fraction.
  virtual double fraction(double h) const { return h / (value_of(t1_) - value_of(t0_)); }
  /// The time, state and dt/dθ at the fraction `theta` of the last step, in the variable it was taken in.
  virtual StepPoint<N> point(double theta) const {
    const double length = value_of(t1_) - value_of(t0_);
    StepPoint<N> at{value_of(t0_) + theta * length, {}, length};
    interpolate_values(theta, at.y);
    return at;
  }

  /// The next start only follows the same flow past a time event: what was learnt of it still holds.
  virtual void goes_on() {}

  /// The length with which the next start tries its first step, instead of the one remembered.
  virtual void suggest(double /*h*/) {}

  /// Where the last step began [s].
  const S& t0() const { return t0_; }
  /// Where it ended [s].
  const S& t1() const { return t1_; }
  /// The state where it began.
  const State<S, N>& y0() const { return y0_; }
  /// The state where it ended.
  const State<S, N>& y1() const { return y1_; }

  /// Evaluations of the flow since the stepper was made; a Jacobian, or one in dual numbers, counts as one.
  long flow_evaluations() const { return flow_evaluations_; }
  /// Steps tried and found too inaccurate since the stepper was made.
  long rejected_steps() const { return rejected_; }

 protected:
  /// The length h [s] of a step on the way from t0 to `limit`: where the limit moves with the parameters, the
  /// step's end does in proportion.
  S aimed(const S& limit, double h) const {
    S length(h);
    if constexpr (!std::is_same_v<S, double>) length.v = h / (limit.a - t0_.a) * (limit.v - t0_.v);
    return length;
  }

  S t0_{}, t1_{};                    ///< s: ends of the last step
  State<S, N> y0_{}, y1_{};          ///< states there
  mutable long flow_evaluations_{};  // dense output may be worked out when it is first asked for
  long rejected_{};                  ///< steps rejected
};

/// Root mean square of e_i / scale_i; NaN if anything is.
template <int N>
double scaled_norm(const State<double, N>& error, const State<double, N>& scale) {
  double sum = 0;
  for (int i = 0; i < N; ++i) sum += (error[i] / scale[i]) * (error[i] / scale[i]);
  return std::sqrt(sum / N);
}

/// The shortest step [s] that still moves t.
inline double shortest_step(double t) {
  return 16 * std::numeric_limits<double>::epsilon() * std::max(std::abs(t), 1e-9);
}

/// The step controller that all single-step methods share: h_next = h · clamp(0.9 err^(−1/order), 0.2, 5).
inline double step_factor(double error, double order) {
  if (error <= 1e-30) return 5.0;
  return std::clamp(0.9 * std::pow(error, -1.0 / order), 0.2, 5.0);
}

/// Gustafsson's predictive controller ([HairerWanner1996] IV.8): no more than step_factor, and no more than
/// if the error grew to the next step as it did from the last one, whose error was `error_before` (0: no
/// trend is known), to this one, `lengthened` times as long. Without it a flow that quickens steadily has
/// every other step rejected.
inline double predicted_factor(double error, double error_before, double lengthened, double order) {
  double factor = step_factor(error, order);
  if (error_before > 0)
    factor = std::min(factor,
                      0.9 * lengthened * std::pow(error_before / std::max(error * error, 1e-20), 1 / order));
  return std::max(factor, 0.2);
}

/// The square of the error in a component by two estimates of different orders, both over the error's scale:
/// e q with q = e/√(e² + (coarse/10)²), at least a tenth. Where the flow is smooth, e q is of the method's
/// own order. Where it is not (a normal force that ends as (t₁ − t)^p, a knot of a spline), the error is of
/// the order of e, and q is small only because of what else sways: the quotient of two norms, over all
/// components, would let 1e-2 pass for 1e-4. NaN goes on.
inline double combined_square(double fine, double coarse) {
  constexpr double kLeast = 0.1 * 0.1;  // of q²
  const double square = fine * fine, both = square + 0.01 * coarse * coarse;
  return both <= 0 ? 0.0 : square * std::max(square / both, kLeast);
}

/// The error-controlled step of a single-step method. Derived supplies
///   double attempt(const S& h)   takes y0_ at t0_ to y1_ and returns the error norm (NaN if not finite),
///   kOrder                       the exponent's order,
///   void prepare(bool retry)     what a new start point needs (once a step),
///   double guess(double longest) a first step length, found without looking further than `longest` [s].
template <class Derived, class S, int N>
class SingleStep : public Stepper<S, N> {
 public:
  /// Errors are judged by `tolerances` through HybridSystem::error_scale.
  explicit SingleStep(const Tolerances& tolerances) : tolerances_(tolerances) {}

  void start(const HybridSystem<N>& system, const Phase& phase, const S& t, const State<S, N>& y) override {
    system_ = &system;
    phase_ = phase;
    this->t1_ = t;
    this->y1_ = y;
    fresh_ = true;
  }

  void suggest(double h) override { h_next_ = h; }

  StepStatus step(const S& limit, double longest) override {
    this->t0_ = this->t1_;
    this->y0_ = this->y1_;
    self().prepare(fresh_);
    const double t = value_of(this->t0_);
    const double left = value_of(limit) - t;
    if (fresh_ && !(h_next_ > 0)) h_next_ = self().guess(std::min(left, longest));
    if (fresh_) error_before_ = 0;
    fresh_ = false;
    double h = std::min(h_next_, longest);
    for (bool rejected = false;; rejected = true) {
      // Land on the limit rather than leave a sliver before it.
      const bool last = h >= left * (1 - 1e-10);
      if (!last && h > 0.5 * left) h = 0.5 * left;
      const S length = last ? S(limit - this->t0_) : this->aimed(limit, h);
      const double error = self().attempt(length);
      if (error <= 1.0) {
        this->t1_ = last ? limit : S(this->t0_ + length);
        const double taken = value_of(length);
        const double factor = predicted_factor(error, error_before_, taken / taken_before_, Derived::kOrder);
        // A step cut short by a limit tells no trend.
        error_before_ = !rejected && taken < 0.99 * std::min(h_next_, longest) ? 0.0 : std::max(error, 1e-3);
        taken_before_ = taken;
        const double next = taken * (rejected ? std::min(factor, 1.0) : factor);
        // A step cut short by a limit says nothing against the length that was meant.
        h_next_ = !rejected && (last || h >= longest) ? std::max(next, h_next_) : next;
        return StepStatus::accepted;
      }
      ++this->rejected_;
      const bool finite = std::isfinite(error);
      // An error that shrinks more slowly than the order says is not to be chased by small cuts.
      h = value_of(length) *
          (finite ? std::min(step_factor(error, Derived::kOrder), rejected ? 0.5 : 0.8) : 0.1);
      if (h < shortest_step(t)) return finite ? StepStatus::too_small : StepStatus::not_finite;
    }
  }

 protected:
  /// dy/dt of the phase at (t, y), counted.
  void flow(const S& t, const State<S, N>& y, State<S, N>& dy) const {
    ++this->flow_evaluations_;
    system_->flow(phase_, t, y, dy);
  }

  /// Norm of a step's local error against the system's error_scale: accepted where <= 1.
  double error_norm(const State<S, N>& error) const {
    State<double, N> scale;
    system_->error_scale(phase_, tolerances_, values<S, N>(this->y0_), values<S, N>(this->y1_), scale);
    return scaled_norm<N>(values<S, N>(error), scale);
  }

  /// Norm of the local error by two embedded estimates of different orders, as combined_square says.
  double error_norm(const State<double, N>& fine, const State<double, N>& coarse) const {
    State<double, N> scale;
    system_->error_scale(phase_, tolerances_, values<S, N>(this->y0_), values<S, N>(this->y1_), scale);
    double sum = 0;
    for (int i = 0; i < N; ++i) sum += combined_square(fine[i] / scale[i], coarse[i] / scale[i]);
    return std::sqrt(sum / N);
  }

  /// A first step length from the sizes of the state, its rate and the change of its rate over a trial step
  /// ([HairerNorsettWanner1993] II.4) of at most `longest` [s]: beyond it other data may hold.
  double first_step(const State<double, N>& rate, double longest) {
    const State<double, N> y = values<S, N>(this->y0_);
    State<double, N> scale;
    system_->error_scale(phase_, tolerances_, y, y, scale);
    const double d0 = scaled_norm<N>(y, scale), d1 = scaled_norm<N>(rate, scale);
    const double trial = std::min(d0 > 1e-5 && d1 > 1e-5 ? 0.01 * d0 / d1 : 1e-6, longest);
    State<double, N> ahead, change;
    for (int i = 0; i < N; ++i) ahead[i] = y[i] + trial * rate[i];
    ++this->flow_evaluations_;
    system_->flow(phase_, value_of(this->t0_) + trial, ahead, change);
    for (int i = 0; i < N; ++i) change[i] -= rate[i];
    const double most = std::max(d1, scaled_norm<N>(change, scale) / trial);
    if (!(most > 1e-15) || !std::isfinite(most)) return trial;
    return std::min(1e3 * trial, std::pow(0.01 / most, 1 / Derived::kOrder));
  }

  const HybridSystem<N>* system_{};         ///< the system whose phase is integrated
  Phase phase_;                             ///< its mode and window
  Tolerances tolerances_;                   ///< of the local error
  double h_next_{};                         ///< s: the length to try next; 0 before the first
  double error_before_{}, taken_before_{};  ///< the last accepted step: error norm [-], and length [s]
  bool fresh_{true};                        ///< a phase has begun and no step of it been taken

 private:
  Derived& self() { return static_cast<Derived&>(*this); }
};

/// The ways of stepping a flow; `automatic` takes dormand_prince for smooth modes, and for the others
/// whichever of dormand_prince and rosenbrock goes, a stiff one beginning with rosenbrock (SwitchingStepper).
enum class Method {
  automatic,       ///< by the kind of each mode
  dormand_prince,  ///< explicit, order 8: smooth flows
  rosenbrock,      ///< linearly implicit, order 5: stiff flows
  radau,           ///< implicit, order 5, to compare with
  cvode,           ///< multistep (SUNDIALS), to compare with; double only
};

/// CVODE (SUNDIALS) behind the same interface: Adams for smooth, BDF with the exact Jacobian for the other
/// modes. It is the oracle of the other steppers; double only.
template <int N>
std::unique_ptr<Stepper<double, N>> make_cvode_stepper(const Tolerances&, FlowKind);

}  // namespace unhand::dynamics
