// A Rosenbrock method of order 5(4), L-stable and stiffly accurate: the stepper of stiff flows.
#pragma once

#include <utility>

#include "dynamics/jacobian.hpp"
#include "dynamics/small_inverse.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// Rodas5P, [Steinebach2023]: one exact Jacobian, one inverse and eight evaluations a step; no
/// Newton iteration, so nothing fails to converge. Dense output of order 4. Unlike RODAS ([HairerWanner1996]
/// IV.7) it keeps its order where the solution follows a slowly moving equilibrium of the stiff part, which
/// is what slip does: there RODAS needs ten times the steps. Values only: the exact
/// tangent of a step would need the derivative of its Jacobian (TangentStepper carries derivatives beside
/// it).
///
/// A step of length h from (t₀, y₀), J = ∂f/∂y and f_t = ∂f/∂t there, in the form of [HairerWanner1996] IV.7
/// that needs no product with J:
///
///   (I/(h γ) − J) k_i = f(t₀ + c_i h, y₀ + Σ_j A_ij k_j) + Σ_j (C_ij/h) k_j + h d_i f_t,   j < i
///   y₁ = y₀ + Σ_j A_8j k_j + k_8,   error k_8
///   y(t₀ + s h) = (1 − s) y₀ + s (y₁ + (1 − s)(b₁ + s (b₂ + s b₃))),   b_r = Σ_j H_rj k_j
///
/// With the paper's α and Γ = (γ_ij), γ on its diagonal: C = I/γ − Γ⁻¹, A = α Γ⁻¹; c and d are the row sums
/// of α and Γ (the numbers below satisfy that to 2e-14).
template <int N>
class Rosenbrock final : public SingleStep<Rosenbrock<N>, double, N> {
 public:
  static constexpr double kOrder = 5;  ///< of the error estimate [-]
  /// `seeded`: the parameters of the system carry derivatives of their own.
  explicit Rosenbrock(const Tolerances& tolerances, bool seeded = false)
      : SingleStep<Rosenbrock<N>, double, N>(tolerances), seeded_(seeded) {}

  /// The Jacobian and the flow where the step begins.
  void prepare(bool /*fresh*/) {
    ++this->flow_evaluations_;
    State<double, N> ft;
    flow_jacobian<N>(*this->system_, this->phase_, this->t0_, this->y0_, f0_, jacobian_, ft, seeded_);
    for (int i = 0; i < N; ++i) ft_[i] = ft[i];
  }
  /// A first step length [s].
  double guess(double longest) { return this->first_step(f0_, longest); }

  /// Takes the step of length h [s] and returns its error norm.
  double attempt(const double& h) {
    State<double, N> error;
    advance(h, this->y1_, error);
    bent_ = false;
    return this->error_norm(error);
  }

  /// h |λ| of the last step's fastest direction: power iteration, one product a step.
  double stiffness() {
    double before = 0, after = 0;
    State<double, N> image{};
    for (int i = 0; i < N; ++i) before += fastest_[i] * fastest_[i];
    if (!(before > 0) || !std::isfinite(before)) {
      before = N;
      fastest_.fill(1);
    }
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < N; ++i) image[i] += jacobian_(i, j) * fastest_[j];
    for (int i = 0; i < N; ++i) after += image[i] * image[i];
    const double rate = std::sqrt(after / before);
    for (int i = 0; i < N; ++i) fastest_[i] = image[i] / std::max(rate, 1e-300);
    return (this->t1_ - this->t0_) * rate;
  }

  void interpolate(double s, State<double, N>& y) const override {
    if (!bent_) bend();
    const double s1 = 1 - s;
    for (int i = 0; i < N; ++i)
      y[i] =
          s1 * this->y0_[i] + s * (this->y1_[i] + s1 * (bend_[0][i] + s * (bend_[1][i] + s * bend_[2][i])));
  }

  void retake(double h, State<double, N>& y) override {
    if (!bent_) bend();  // the stages of the step are still needed by its dense output
    State<double, N> error;
    advance(h, y, error);
  }

 private:
  static constexpr int kStages = 8, kPadded = SmallInverse<N>::kPadded;
  using Vector = typename SmallInverse<N>::Vector;
  using Packed = Eigen::Matrix<double, kPadded, 1>;
  static constexpr double kGamma = 0.21193756319429014;
  static constexpr double kNode[kStages] = {
      // c
      0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1, 1, 1};
  static constexpr double kTimeWeight[kStages] = {// d
                                                  0.21193756319429014,
                                                  -0.42387512638858027,
                                                  -0.3384627126235924,
                                                  1.8046452872882734,
                                                  2.325825639765069,
                                                  0,
                                                  0,
                                                  0};
  // A: row i has the weights of stages 0 … i − 1 in the argument of stage i; rows 6 and 7 are row 5 and the
  // stages after it with weight 1.
  static constexpr double kA[6][5] = {
      {0, 0, 0, 0, 0},
      {3.0, 0, 0, 0, 0},
      {2.849394379747939, 0.45842242204463923, 0, 0, 0},
      {-6.954028509809101, 2.489845061869568, -10.358996098473584, 0, 0},
      {2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641, 0},
      {-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256,
       0.030198172008377946}};
  static constexpr double kC[kStages][kStages - 1] = {
      {0, 0, 0, 0, 0, 0, 0},
      {-14.155112264123755, 0, 0, 0, 0, 0, 0},
      {-17.97296035885952, -2.859693295451294, 0, 0, 0, 0, 0},
      {147.12150275711716, -1.41221402718213, 71.68940251302358, 0, 0, 0, 0},
      {165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306, 0, 0, 0},
      {24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471, 0,
       0},
      {30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
       -28.087943162872662, 0},
      {37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
       -54.66780262877968, -9.48861652309627}};
  static constexpr double kH[3][kStages] = {
      {25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073,
       1.1241088310450404, 0.4272876194431874, -0.17202221070155493},
      {-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044,
       15.98066361424651, -6.789040303419874, -6.710236069923372},
      {11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654,
       -59.78993625266729, -0.15582684282751913, 4.883087185713722}};

  /// The coefficients of the dense output, when it is first asked for.
  void bend() const {
    for (int row = 0; row < 3; ++row)
      for (int i = 0; i < N; ++i) {
        bend_[row][i] = 0;
        for (int j = 0; j < kStages; ++j) bend_[row][i] += kH[row][j] * k_[j][i];
      }
    bent_ = true;
  }

  void advance(double h, State<double, N>& y1, State<double, N>& error) {
    double matrix[N][N];
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) matrix[i][j] = -jacobian_(i, j);
      matrix[i][i] += 1 / (h * kGamma);
    }
    inverse_.compute(matrix);
    State<double, N> y = this->y0_;
    [&]<int... Stage>(std::integer_sequence<int, Stage...>) { (advance_stage<Stage>(h, y), ...); }
    (std::make_integer_sequence<int, kStages>());
    for (int i = 0; i < N; ++i) {
      error[i] = k_[kStages - 1][i];
      y1[i] = y[i] + k_[kStages - 1][i];
    }
  }

  template <int Stage>
  void advance_stage(double h, State<double, N>& y) {
    State<double, N> f = f0_;
    if constexpr (Stage > 5) {
      for (int i = 0; i < N; ++i) y[i] += k_[Stage - 1][i];
    } else if constexpr (Stage > 0) {
      const Packed sum = weighted<Stage>(kA[Stage]);
      for (int i = 0; i < N; ++i) y[i] = this->y0_[i] + sum[i];
    }
    if constexpr (Stage > 0) this->flow(this->t0_ + kNode[Stage] * h, y, f);
    alignas(16) Vector rhs;
    auto packed = Eigen::Map<Packed, Eigen::Aligned16>(rhs);
    packed = (kTimeWeight[Stage] * h) * ft_;
    if constexpr (Stage > 0) packed += (1 / h) * weighted<Stage>(kC[Stage]);
    for (int i = 0; i < N; ++i) rhs[i] += f[i];
    inverse_.multiply(rhs, k_[Stage]);
  }

  /// Σ_j weight_j k_j over the first `Count` stages.
  template <int Count, std::size_t Size>
  Packed weighted(const double (&weight)[Size]) const {
    Packed sum = weight[0] * stage(0);
    for (int j = 1; j < Count; ++j) sum += weight[j] * stage(j);
    return sum;
  }
  Eigen::Map<const Packed, Eigen::Aligned16> stage(int j) const {
    return Eigen::Map<const Packed, Eigen::Aligned16>(k_[j]);
  }

  Eigen::Matrix<double, N, N> jacobian_;
  SmallInverse<N> inverse_;
  State<double, N> f0_{}, fastest_{};
  Packed ft_ = Packed::Zero();
  alignas(16) double k_[kStages][kPadded]{};
  mutable std::array<State<double, N>, 3> bend_{};
  mutable bool bent_{};
  bool seeded_;
};

}  // namespace unhand::dynamics
