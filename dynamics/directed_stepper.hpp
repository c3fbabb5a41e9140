// Collocation in size and direction, for flows that depend on the direction of a part of the state.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "dynamics/directed_collocation.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// Steps of flows whose rate depends on a part u of the state by its direction alone (the part that
/// HybridSystem::pace_weights names), while that direction is slaved: slip that creeps.
///
/// Where the direction n of u = s n is slaved (it relaxes within s/|∂F/∂n|), s and n are as smooth in time as
/// what drives them: while s sets out from next to nothing as (t − t₀)², and to the point where it passes
/// zero. So steps are taken in time, by DirectedCollocation. (In u itself, or in a pace of |u|, what is
/// solved is stiff or has a pole, and steps shrink with s.) Steps that do not converge, and steps of a
/// direction that hardly relaxes within them, which an explicit method takes for less, are left to another
/// stepper.
///
/// A step into a stop ends kBeforeStop before s passes zero; the system's own guard must see that coming.
template <int N>
class DirectedStepper final : public Stepper<double, N> {
 public:
  /// `other` takes the steps that this one does not.
  DirectedStepper(const Tolerances& tolerances, std::unique_ptr<Stepper<double, N>> other)
      : collocation_(tolerances), other_(std::move(other)) {}

  void start(const HybridSystem<N>& system, const Phase& phase, const double& t,
             const State<double, N>& y) override {
    system_ = &system;
    phase_ = phase;
    collocation_.enter(system, phase);
    this->t1_ = t;
    this->y1_ = y;
    guess_ = Guess::start;
    error_before_ = 0;
    if (!std::exchange(goes_on_, false)) {
      directed_ = slaved_ = true;
      met_ = false;
      wait_next_ = kWait;
    } else if (directed_) {
      h_next_ = length_before_;  // where data kink the direction has to find its way anew
    } else {
      other_->goes_on();
    }
    if (!directed_) other_->start(system, phase, t, y);
  }

  StepStatus step(const double& limit, double longest) override {
    this->t0_ = this->t1_;
    this->y0_ = this->y1_;
    const bool due = directed_ ? slaved_ : --wait_ <= 0;
    if (due && (guess_ != Guess::start || is_slaved()) && take(limit, longest)) {
      if (directed_) wait_next_ = kWait;
      directed_ = true;
      count();
      return StepStatus::accepted;
    }
    if (due || directed_) wait_ = std::exchange(wait_next_, std::min(4 * wait_next_, kLongestWait));
    guess_ = Guess::start;
    if (std::exchange(directed_, false)) {
      if (std::exchange(met_, true)) other_->goes_on();
      other_->start(*system_, phase_, this->t0_, this->y0_);
    }
    const StepStatus status = other_->step(limit, longest);
    this->t1_ = other_->t1();
    this->y1_ = other_->y1();
    h_next_ = std::max(h_next_, 2 * (this->t1_ - this->t0_));
    count();
    return status;
  }

  void interpolate(double theta, State<double, N>& y) const override {
    if (directed_)
      y = collocation_.state(theta);
    else
      other_->interpolate(theta, y);
  }
  void retake(double h, State<double, N>& y) override {
    if (!directed_)
      other_->retake(h, y);
    else if (const auto end = collocation_.again(h))
      y = *end;
    else
      y = collocation_.state(h / collocation_.length());
    count();
  }
  int parts() const override { return directed_ ? 3 : other_->parts(); }
  double fraction(double h) const override {
    return directed_ ? h / (this->t1_ - this->t0_) : other_->fraction(h);
  }
  StepPoint<N> point(double theta) const override {
    if (!directed_) return other_->point(theta);
    const double length = this->t1_ - this->t0_;
    return {this->t0_ + theta * length, collocation_.state(theta), length};
  }
  void goes_on() override { goes_on_ = true; }
  void suggest(double h) override { h_next_ = h; }

 private:
  using Collocation = DirectedCollocation<N>;
  using Guess = typename Collocation::Guess;
  using Solved = typename Collocation::Solved;

  static constexpr double kFirst = 4e-3;      // s: the length first tried
  static constexpr double kOrder = 7;         // by which the error estimate falls with the length
  static constexpr double kMostGrowth = 2.5;  // of a step's length
  static constexpr double kSlaved = 20;      // h |λ| of the next step below which the other stepper takes it
  static constexpr double kResolved = 1e10;  // h |λ| above which s' is lost in the rounding of F
  static constexpr double kTransient = 30;   // h |λ| of a step in which a direction finds its way
  static constexpr double kSmooth = 10;      // least power with which a direction may go into a stop
  static constexpr int kWait = 6, kLongestWait = 10'000;  // steps of the other between two trials
  static constexpr double kBeforeStop = 4e-9;             // s

  /// Whether the next step would be one of a slaved direction, by what the flow says where it begins.
  bool is_slaved() { return length() * collocation_.relaxation_rate(this->t0_, this->y0_) > kSlaved; }
  /// Of the step to try next [s].
  double length() const { return h_next_ > 0 ? h_next_ : kFirst; }
  /// h |λ| of the fastest, at the end of the step.
  double slaving() const {
    return collocation_.length() * collocation_.relaxation().fastest / collocation_.size();
  }

  // ---------------------------------------------------------------- one step

  /// Takes the step; false if the other stepper is to take it.
  bool take(double limit, double longest) {
    const double left = limit - this->t0_;
    double h = std::min(length(), longest);
    bool stops = false, rejected = false;
    double rejected_with = std::numeric_limits<double>::infinity();  // the error of the attempt before
    for (int attempt = 0, failures = 0; attempt < 12; ++attempt) {
      const bool last = !stops && h >= left * (1 - 1e-10);
      if (!last && !stops && h > 0.5 * left) h = 0.5 * left;
      const double length = last ? left : h;
      const Solved solved = collocation_.solve(this->t0_, this->y0_, length, guess_);
      guess_ = solved == Solved::yes ? Guess::same_step : Guess::start;
      if (solved != Solved::yes) {
        if (++failures > 2 || solved == Solved::not_finite) return false;
        h = 0.25 * length;
        rejected = true;
        continue;
      }
      if (length * collocation_.relaxation().fastest > kResolved * collocation_.largest_size()) return false;
      if (const double theta = collocation_.stop(); theta < 1) {
        // Before a stop at t* directions relax as (t* − t) to the power of |∂F/∂n|/|s'|.
        if (collocation_.relaxation().slowest < kSmooth * std::abs(collocation_.growth(theta))) return false;
        h = theta * length - kBeforeStop;
        if (!(h > kBeforeStop)) return false;
        stops = true;
        continue;
      }
      const double now = collocation_.error();
      if (now <= 1) {
        this->t1_ = last ? limit : this->t0_ + length;
        if (!(this->t1_ > this->t0_)) return false;
        this->y1_ = collocation_.end();
        const double factor = predicted_factor(now, error_before_, length / length_before_, kOrder);
        const double next = length * std::min(factor, rejected ? 1.0 : kMostGrowth);
        h_next_ = last || stops ? std::max(next, h_next_) : next;
        error_before_ = last || stops ? 0.0 : std::max(now, 1e-3);
        length_before_ = length;
        slaved_ = slaving() * step_factor(now, kOrder) > kSlaved;
        guess_ = Guess::next_step;
        return true;
      }
      ++own_rejected_;
      if (!std::isfinite(now)) return false;
      h = length * std::min(step_factor(now, kOrder), 0.7);
      if (now > 0.5 * rejected_with) {
        // An error that hardly falls with h: data have kinked, and the direction is still on its way.
        const double relaxed = length * collocation_.relaxation().slowest / collocation_.size();
        if (relaxed <= kSlaved) return false;
        h = std::min(h, length * kTransient / relaxed);
      }
      rejected_with = now;
      stops = false;
      rejected = true;
    }
    return false;
  }

  void count() {
    this->flow_evaluations_ = collocation_.flow_evaluations() + other_->flow_evaluations();
    this->rejected_ = own_rejected_ + other_->rejected_steps();
  }

  Collocation collocation_;
  std::unique_ptr<Stepper<double, N>> other_;
  const HybridSystem<N>* system_{};
  Phase phase_;
  double h_next_{};
  Guess guess_{Guess::start};                   // where the iteration of the next step begins
  double error_before_{}, length_before_{};     // of the last step taken here
  bool directed_{true}, slaved_{}, goes_on_{};  // whether the last step was taken here; and the next is to be
  int wait_{}, wait_next_{kWait};  // steps of the other until the next trial, and from that to the one after
  bool met_{};                     // whether the other has taken steps of this phase
  long own_rejected_{};
};

}  // namespace unhand::dynamics
