// Radau IIA of order 5, L-stable and stiffly accurate: an implicit stepper of another family, to compare
// with.
#pragma once

#include "dynamics/jacobian.hpp"
#include "dynamics/small_inverse.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// Three-stage collocation at c = (4 ∓ √6)/10, 1, [HairerWanner1996] IV.8. The stage equations are
/// transformed so that a real and a complex N × N system take the place of one of 3N, and solved by
/// simplified Newton iterations with one exact Jacobian a step, started from the last step's collocation
/// polynomial. The error estimate is of order 3, the dense output the collocation polynomial.
///
/// Its stages are of high order themselves, so it keeps long steps where a flow follows a slowly moving
/// equilibrium of its stiff part, as slip does, and where the linearisation at the start of a step (all that
/// a Rosenbrock method knows) does not hold to its end.
template <int N>
class Radau final : public SingleStep<Radau<N>, double, N> {
 public:
  static constexpr double kOrder = 4;  ///< of the error estimate, plus one [-]
  /// `seeded`: the parameters of the system carry derivatives of their own.
  explicit Radau(const Tolerances& tolerances, bool seeded = false)
      : SingleStep<Radau<N>, double, N>(tolerances), seeded_(seeded) {}

  /// The Jacobian and the flow where the step begins.
  void prepare(bool fresh) {
    State<double, N> ft;
    flow_jacobian<N>(*this->system_, this->phase_, this->t0_, this->y0_, f0_, jacobian_, ft, seeded_);
    ++this->flow_evaluations_;
    this->system_->error_scale(this->phase_, this->tolerances_, this->y0_, this->y0_, scale_);
    extrapolate_ = !fresh;
    refine_ = fresh;
    factored_ = 0;
  }
  /// A first step length [s].
  double guess(double longest) { return this->first_step(f0_, longest); }

  /// Takes the step of length h [s] and returns its error norm: 32 where the iterations do not converge, NaN
  /// where the flow is not finite.
  double attempt(const double& h) {
    Stages z = start_values(h);
    if (!solve(h, z)) {
      extrapolate_ = false;
      return finite_ ? 32
                     : std::numeric_limits<double>::quiet_NaN();  // no convergence: shorten by about half
    }
    for (int i = 0; i < N; ++i) this->y1_[i] = this->y0_[i] + z[2][i];
    double error = estimate(h, z);
    if (error <= 1) {
      h_before_ = h;
      accepted_ = z;
      start_ = this->y0_;
    } else {
      extrapolate_ = false;
      refine_ = true;
    }
    return error;
  }

  void interpolate(double theta, State<double, N>& y) const override { collocation(theta, y); }

  void retake(double h, State<double, N>& y) override {
    const double whole = h_before_;
    Stages z;
    for (int k = 0; k < 3; ++k) {
      collocation(kC[k] * h / whole, z[k]);
      for (int i = 0; i < N; ++i) z[k][i] -= this->y0_[i];
    }
    if (solve(h, z))
      for (int i = 0; i < N; ++i) y[i] = this->y0_[i] + z[2][i];
    else
      collocation(h / whole, y);  // a shorter step than one that converged does too: not expected
  }

 private:
  using Stages = std::array<State<double, N>, 3>;
  static constexpr double kRoot6 = 2.449489742783178;
  static constexpr double kC[3] = {(4 - kRoot6) / 10, (4 + kRoot6) / 10, 1};
  // The eigenvalues of the inverse Runge-Kutta matrix, γ and α ± iβ, and the transformation that shows them.
  static constexpr double kGamma = 3.637834252744496, kAlpha = 2.681082873627752, kBeta = 3.050430199247411;
  static constexpr double kT[3][3] = {
      {9.1232394870892942792e-02, -0.14125529502095420843, -3.0029194105147424492e-02},
      {0.24171793270710701896, 0.20412935229379993199, 0.38294211275726193779},
      {0.96604818261509293619, 1, 0}};
  static constexpr double kInverse[3][3] = {
      {4.3255798900631553510, 0.33919925181580986954, 0.54177053993587487119},
      {-4.1787185915519047273, -0.32768282076106238708, 0.47662355450055045196},
      {-0.50287263494578687595, 2.5719269498556054292, -0.59603920482822492497}};
  static constexpr double kError[3] = {-(13 + 7 * kRoot6) / 3, (-13 + 7 * kRoot6) / 3, -1.0 / 3};

  /// The collocation polynomial of the accepted step: cubic through its start and its stages.
  void collocation(double theta, State<double, N>& y) const {
    constexpr double a = kC[0], b = kC[1];
    const double l1 = theta * (theta - b) * (theta - 1) / (a * (a - b) * (a - 1));
    const double l2 = theta * (theta - a) * (theta - 1) / (b * (b - a) * (b - 1));
    const double l3 = theta * (theta - a) * (theta - b) / ((1 - a) * (1 - b));
    for (int i = 0; i < N; ++i)
      y[i] = start_[i] + l1 * accepted_[0][i] + l2 * accepted_[1][i] + l3 * accepted_[2][i];
  }

  Stages start_values(double h) const {
    Stages z{};
    if (!extrapolate_) return z;
    const double ratio = h / h_before_;
    for (int k = 0; k < 3; ++k) {
      collocation(1 + kC[k] * ratio, z[k]);
      for (int i = 0; i < N; ++i) z[k][i] -= this->y0_[i];
    }
    return z;
  }

  void factor(double h) {
    if (factored_ == h) return;
    double real[N][N], pair[2 * N][2 * N];  // x + iy of the complex system as (x, y)
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) {
        const double one = i == j;
        real[i][j] = kGamma / h * one - jacobian_(i, j);
        pair[i][j] = pair[N + i][N + j] = kAlpha / h * one - jacobian_(i, j);
        pair[N + i][j] = kBeta / h * one;
        pair[i][N + j] = -kBeta / h * one;
      }
    real_.compute(real);
    pair_.compute(pair);
    factored_ = h;
  }

  /// Simplified Newton iterations for the stage increments z. False if they do not converge.
  bool solve(double h, Stages& z) {
    constexpr int kMaxIterations = 12;
    factor(h);
    // A fiftieth of the error tolerance, or what rounding leaves.
    double target = 0.02;
    for (int i = 0; i < N; ++i)
      target = std::max(target, 1e-14 * (std::abs(this->y0_[i]) + std::abs(h * f0_[i])) / scale_[i]);
    Stages w, f;
    transform(kInverse, z, w);
    double before = 0, contraction = 0.5;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      for (int k = 0; k < 3; ++k) {
        State<double, N> y;
        for (int i = 0; i < N; ++i) y[i] = this->y0_[i] + z[k][i];
        this->flow(this->t0_ + kC[k] * h, y, f[k]);
      }
      Stages g;
      transform(kInverse, f, g);
      // g − (Λ/h) w is the defect of the transformed equations, Λ the real block form of the eigenvalues.
      typename SmallInverse<N>::Vector first, add_first;
      typename SmallInverse<2 * N>::Vector second, add_second;
      for (int i = 0; i < N; ++i) {
        first[i] = g[0][i] - kGamma / h * w[0][i];
        second[i] = g[1][i] - (kAlpha * w[1][i] - kBeta * w[2][i]) / h;
        second[N + i] = g[2][i] - (kAlpha * w[2][i] + kBeta * w[1][i]) / h;
      }
      real_.multiply(first, add_first);
      pair_.multiply(second, add_second);
      double moved = 0;
      for (int i = 0; i < N; ++i) {
        const double add[3] = {add_first[i], add_second[i], add_second[N + i]};
        for (int k = 0; k < 3; ++k) {
          w[k][i] += add[k];
          moved += (add[k] / scale_[i]) * (add[k] / scale_[i]);
        }
      }
      transform(kT, w, z);
      moved = std::sqrt(moved / (3 * N));
      finite_ = std::isfinite(moved);
      if (!finite_) return false;
      if (iteration > 0 && before > 0) contraction = std::max(moved / before, 1e-6);
      if (iteration > 0 && contraction >= 0.99 && moved > target) return false;
      before = moved;
      const double left = contraction < 1 ? moved * contraction / (1 - contraction) : moved;
      if (left <= target) return true;
    }
    return false;
  }

  static void transform(const double (&matrix)[3][3], const Stages& from, Stages& to) {
    for (int i = 0; i < N; ++i) {
      const double a = from[0][i], b = from[1][i], c = from[2][i];
      for (int k = 0; k < 3; ++k) to[k][i] = matrix[k][0] * a + matrix[k][1] * b + matrix[k][2] * c;
    }
  }

  double estimate(double h, const Stages& z) {
    typename SmallInverse<N>::Vector e, solved;
    State<double, N> combined, error;
    for (int i = 0; i < N; ++i)
      combined[i] = (kError[0] * z[0][i] + kError[1] * z[1][i] + kError[2] * z[2][i]) / h;
    for (int i = 0; i < N; ++i) e[i] = combined[i] + f0_[i];
    real_.multiply(e, solved);
    for (int i = 0; i < N; ++i) error[i] = solved[i];
    double size = scaled(error);
    // On transients, where the estimate of a very stiff flow is too large: once more through the flow.
    if (size > 1 && refine_) {
      State<double, N> y;
      State<double, N> f;
      for (int i = 0; i < N; ++i) y[i] = this->y0_[i] + error[i];
      this->flow(this->t0_, y, f);
      for (int i = 0; i < N; ++i) e[i] = combined[i] + f[i];
      real_.multiply(e, solved);
      for (int i = 0; i < N; ++i) error[i] = solved[i];
      const double again = scaled(error);
      if (std::isfinite(again)) size = again;
    }
    return size;
  }

  double scaled(const State<double, N>& error) const {
    State<double, N> scale;
    this->system_->error_scale(this->phase_, this->tolerances_, this->y0_, this->y1_, scale);
    return scaled_norm<N>(error, scale);
  }

  Eigen::Matrix<double, N, N> jacobian_;
  SmallInverse<N> real_;      // (γ/h − J)⁻¹
  SmallInverse<2 * N> pair_;  // ((α + iβ)/h − J)⁻¹
  State<double, N> f0_{}, scale_{}, start_{};
  Stages accepted_{};
  double h_before_{}, factored_{};
  bool extrapolate_{}, refine_{}, finite_{true};
  bool seeded_;
};

}  // namespace unhand::dynamics
