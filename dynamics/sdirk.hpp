// A singly diagonally implicit Runge-Kutta method of order 4(3), L-stable: carries derivatives through stiff flows.
#pragma once

#include <Eigen/LU>

#include "dynamics/jacobian.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// SDIRK4, [HairerWanner1996] IV.6 Table 6.5 (γ = 1/4). The stage equations are solved by Newton's iteration with one
/// real factorisation a step; with S = Dual the iteration runs until the derivative parts stand still too, which by
/// the implicit function theorem makes them the exact derivatives of the discrete solution, for the price of first
/// derivatives only.
template <class S, int N>
class Sdirk final : public SingleStep<Sdirk<S, N>, S, N> {
 public:
  static constexpr bool kPredictive = true;
  static constexpr double kOrder = 4;
  using SingleStep<Sdirk<S, N>, S, N>::SingleStep;

  void prepare(bool /*fresh*/) {
    State<double, N> y, ft;
    for (int i = 0; i < N; ++i) y[i] = value_of(this->y0_[i]);
    flow_jacobian<N>(*this->system_, this->phase_, value_of(this->t0_), y, f0_, jacobian_, ft,
                     !std::is_same_v<S, double>);
    ++this->flow_evaluations_;
    if constexpr (std::is_same_v<S, double>) slope0_ = f0_;
    else this->flow(this->t0_, this->y0_, slope0_);
  }
  double guess() const { return this->first_step(f0_); }

  double attempt(const S& h) {
    State<S, N> error;
    if (!advance(h, this->y1_, error)) return slow_ ? 1e3 : std::numeric_limits<double>::quiet_NaN();
    h_ = h;
    this->flow(this->t0_ + h, this->y1_, slope1_);
    return this->error_norm(error);
  }

  /// Cubic Hermite: enough to bracket a root, which is then polished with `retake`.
  void interpolate(double s, State<S, N>& y) const override {
    const double s1 = 1 - s;
    for (int i = 0; i < N; ++i) {
      const S dy = this->y1_[i] - this->y0_[i];
      y[i] = s1 * this->y0_[i] + s * this->y1_[i] +
             (s * s1) * ((s1 - s) * (-dy) + s1 * h_ * slope0_[i] - s * h_ * slope1_[i]);
    }
  }

  void retake(double h, State<S, N>& y) override {
    State<S, N> error;
    if (!advance(S(h), y, error)) interpolate(h / value_of(h_), y);  // a shorter step converges too: not expected
  }

 private:
  using Vector = Eigen::Matrix<double, N, 1>;
  static constexpr double kGamma = 0.25;
  static constexpr double kC[5] = {1.0 / 4, 3.0 / 4, 11.0 / 20, 1.0 / 2, 1.0};
  static constexpr double kA[5][5] = {{1.0 / 4, 0, 0, 0, 0},
                                      {1.0 / 2, 1.0 / 4, 0, 0, 0},
                                      {17.0 / 50, -1.0 / 25, 1.0 / 4, 0, 0},
                                      {371.0 / 1360, -137.0 / 2720, 15.0 / 544, 1.0 / 4, 0},
                                      {25.0 / 24, -49.0 / 48, 125.0 / 16, -85.0 / 12, 1.0 / 4}};
  static constexpr double kEmbedded[5] = {59.0 / 48, -17.0 / 96, 225.0 / 32, -85.0 / 12, 0};

  /// x := LU⁻¹ x, part by part when x carries derivatives.
  void solve(State<S, N>& x) const {
    Vector part;
    if constexpr (std::is_same_v<S, double>) {
      for (int i = 0; i < N; ++i) part[i] = x[i];
      part = lu_.solve(part).eval();
      for (int i = 0; i < N; ++i) x[i] = part[i];
    } else {
      Eigen::Matrix<double, N, kDualSize + 1> parts;
      for (int i = 0; i < N; ++i) {
        parts(i, 0) = x[i].a;
        for (int k = 0; k < kDualSize; ++k) parts(i, k + 1) = x[i].v[k];
      }
      parts = lu_.solve(parts).eval();
      for (int i = 0; i < N; ++i) {
        x[i].a = parts(i, 0);
        for (int k = 0; k < kDualSize; ++k) x[i].v[k] = parts(i, k + 1);
      }
    }
  }

  /// The largest part of `x` in units of the tolerance (values) and of the largest derivative (derivatives).
  double size(const State<S, N>& x, const State<S, N>& reference, double h) const {
    double worst = 0;
    for (int i = 0; i < N; ++i) {
      worst = std::max(worst, std::abs(h * value_of(x[i])) / scale_[i]);
      if constexpr (!std::is_same_v<S, double>) {
        const double largest = 1 + reference[i].v.cwiseAbs().maxCoeff() * h + this->y0_[i].v.cwiseAbs().maxCoeff();
        worst = std::max(worst, h * x[i].v.cwiseAbs().maxCoeff() / (1e-9 * largest));
      }
      if (!std::isfinite(value_of(x[i]))) return std::numeric_limits<double>::quiet_NaN();
    }
    return worst;
  }

  bool advance(const S& h, State<S, N>& y1, State<S, N>& error) {
    constexpr int kMaxIterations = 25;
    slow_ = false;
    const double hv = value_of(h);
    Eigen::Matrix<double, N, N> matrix = -hv * kGamma * jacobian_;
    matrix.diagonal().array() += 1.0;
    lu_.compute(matrix);
    const State<double, N> start = values<S, N>(this->y0_);
    this->system_->error_scale(this->phase_, this->tolerances_, start, start, scale_);
    for (int stage = 0; stage < 5; ++stage) {
      State<S, N> base = this->y0_;
      for (int j = 0; j < stage; ++j)
        for (int i = 0; i < N; ++i) base[i] += h * (kA[stage][j] * k_[j][i]);
      State<S, N>& k = k_[stage];
      k = stage == 0 ? slope0_ : k_[stage - 1];
      double last = std::numeric_limits<double>::infinity();
      bool converged = false;
      for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
        State<S, N> y, f;
        for (int i = 0; i < N; ++i) y[i] = base[i] + h * (kGamma * k[i]);
        this->flow(this->t0_ + kC[stage] * h, y, f);
        for (int i = 0; i < N; ++i) f[i] -= k[i];
        solve(f);
        for (int i = 0; i < N; ++i) k[i] += f[i];
        const double moved = size(f, k, hv);
        if (!std::isfinite(moved)) return false;
        if (moved < 1e-3) { converged = true; break; }
        if (iteration > 4 && moved > last) break;
        last = moved;
      }
      if (!converged) { slow_ = true; return false; }
    }
    for (int i = 0; i < N; ++i) {
      y1[i] = this->y0_[i];
      error[i] = S(0);
      for (int j = 0; j < 5; ++j) {
        y1[i] += h * (kA[4][j] * k_[j][i]);
        error[i] += h * ((kA[4][j] - kEmbedded[j]) * k_[j][i]);
      }
    }
    solve(error);  // ([HairerWanner1996] IV.8) of the stiff parts only what the step does not damp is an error
    return true;
  }

  Eigen::Matrix<double, N, N> jacobian_;
  Eigen::PartialPivLU<Eigen::Matrix<double, N, N>> lu_;
  State<double, N> f0_{}, scale_{};
  State<S, N> slope0_{}, slope1_{};
  std::array<State<S, N>, 5> k_{};
  S h_{};
  bool slow_{};
};

}  // namespace unhand::dynamics
