// A Rosenbrock method of order 4(3), L-stable and stiffly accurate: the stepper of stiff flows.
#pragma once

#include <Eigen/LU>

#include "dynamics/jacobian.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// RODAS, [HairerWanner1996] IV.7: one exact Jacobian, one LU factorisation and six evaluations a step; no Newton
/// iteration, so nothing fails to converge. Dense output of order 3. Values only: the tangent of a Rosenbrock step
/// would need the derivative of its Jacobian (Sdirk carries derivatives through stiff phases).
template <int N>
class Rosenbrock final : public SingleStep<Rosenbrock<N>, double, N> {
 public:
  static constexpr double kOrder = 4;
  using SingleStep<Rosenbrock<N>, double, N>::SingleStep;

  void prepare(bool /*fresh*/) {
    ++this->flow_evaluations_;
    flow_jacobian<N>(*this->system_, this->phase_, this->t0_, this->y0_, f0_, jacobian_, ft_);
  }
  double guess() const { return first_step<double, N>(this->y0_, f0_, this->tolerances_); }

  double attempt(const double& h) {
    State<double, N> error;
    advance(h, this->y1_, error);
    kept_ = k_;
    return error_norm<double, N>(error, this->y0_, this->y1_, this->tolerances_);
  }

  void interpolate(double s, State<double, N>& y) const override {
    const double s1 = 1 - s;
    for (int i = 0; i < N; ++i) {
      const double c2 = kD[0][0] * kept_[0][i] + kD[0][1] * kept_[1][i] + kD[0][2] * kept_[2][i] +
                        kD[0][3] * kept_[3][i] + kD[0][4] * kept_[4][i];
      const double c3 = kD[1][0] * kept_[0][i] + kD[1][1] * kept_[1][i] + kD[1][2] * kept_[2][i] +
                        kD[1][3] * kept_[3][i] + kD[1][4] * kept_[4][i];
      y[i] = s1 * this->y0_[i] + s * (this->y1_[i] + s1 * (c2 + s * c3));
    }
  }

  void retake(double h, State<double, N>& y) override {
    State<double, N> error;
    advance(h, y, error);
  }

 private:
  using Vector = Eigen::Matrix<double, N, 1>;
  static constexpr double kGamma = 0.25;
  static constexpr double kAlpha[4] = {0, 0.386, 0.21, 0.63};
  static constexpr double kGammaI[4] = {0.25, -0.1043, 0.1035, -0.0362};
  static constexpr double kA[5][4] = {
      {0, 0, 0, 0},
      {1.544, 0, 0, 0},
      {0.9466785280815826, 0.2557011698983284, 0, 0},
      {3.314825187068521, 2.896124015972201, 0.9986419139977817, 0},
      {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950}};
  static constexpr double kC[6][5] = {
      {0, 0, 0, 0, 0},
      {-5.6688, 0, 0, 0, 0},
      {-2.430093356833875, -0.2063599157091915, 0, 0, 0},
      {-0.1073529058151375, -9.594562251023355, -20.47028614809616, 0, 0},
      {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160, 0},
      {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054}};
  static constexpr double kD[2][5] = {
      {10.12623508344586, -7.487995877610167, -34.80091861555747, -7.992771707568823, 1.025137723295662},
      {-0.6762803392806898, 6.087714651680015, 16.43084320892478, 24.76722511418386, -6.594389125716872}};

  void advance(double h, State<double, N>& y1, State<double, N>& error) {
    Eigen::Matrix<double, N, N> matrix = -jacobian_;
    matrix.diagonal().array() += 1 / (h * kGamma);
    lu_.compute(matrix);
    State<double, N> y = this->y0_, f = f0_;
    for (int stage = 0; stage < 6; ++stage) {
      if (stage > 0 && stage < 5) {
        for (int i = 0; i < N; ++i) {
          y[i] = this->y0_[i];
          for (int j = 0; j < stage; ++j) y[i] += kA[stage][j] * k_[j][i];
        }
      } else if (stage == 5) {
        for (int i = 0; i < N; ++i) y[i] += k_[4][i];
      }
      if (stage > 0) this->flow(this->t0_ + (stage < 4 ? kAlpha[stage] : 1.0) * h, y, f);
      Vector rhs;
      for (int i = 0; i < N; ++i) {
        double c = 0;
        for (int j = 0; j < stage; ++j) c += kC[stage][j] * k_[j][i];
        rhs[i] = f[i] + (stage < 4 ? kGammaI[stage] * h * ft_[i] : 0.0) + c / h;
      }
      const Vector k = lu_.solve(rhs);
      for (int i = 0; i < N; ++i) k_[stage][i] = k[i];
    }
    for (int i = 0; i < N; ++i) {
      error[i] = k_[5][i];
      y1[i] = y[i] + k_[5][i];
    }
  }

  Eigen::Matrix<double, N, N> jacobian_;
  Eigen::PartialPivLU<Eigen::Matrix<double, N, N>> lu_;
  State<double, N> f0_{}, ft_{};
  std::array<State<double, N>, 6> k_{}, kept_{};
};

}  // namespace unhand::dynamics
