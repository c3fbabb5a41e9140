#include "planners/elastic/throw_terms.hpp"

#include <algorithm>
#include <numeric>

namespace unhand::planners::elastic {
namespace {

/// x₁ − x₀ − h/6 (ẋ₀ + 4 ẋ_m + ẋ₁) and x_m − ½ (x₀ + x₁) − h/8 (ẋ₀ − ẋ₁)
struct HermiteSimpson {
  double scale;  ///< of ẋ
  template <class S>
  void operator()(const S* x, S* f) const {
    const S h = scale * x[6];
    f[0] = x[2] - x[0] - h * (x[3] + 4.0 * x[4] + x[5]) / 6.0;
    f[1] = x[1] - 0.5 * (x[0] + x[2]) - 0.125 * h * (x[3] - x[5]);
  }
};

/// Derivatives of the arm's own functions are taken by these nine, q, q̇, q̈, whatever of them is unknown: the
/// arm's recursions are compiled for one size of dual numbers only.
constexpr int kSlots = 9;

/// (q, q̇, q̈/kAcceleration) -> joint torques
template <int Outputs>
struct JointTorques {
  static constexpr int kOutputs = Outputs;
  const ClutchedArm* arm;
  template <class S>
  void operator()(const S* x, S* f) const {
    const Links<S> tau =
        joint_torque<S>(*arm, Links<S>(x[0], x[1], x[2]), Links<S>(x[3], x[4], x[5]),
                        Links<S>(kAcceleration * x[6], kAcceleration * x[7], kAcceleration * x[8]));
    for (int i = 0; i < kOutputs; ++i) f[i] = tau[i];
  }
};

/// (q, q̇) -> x, z, vx, vz of the tip
struct Tip {
  static constexpr int kOutputs = 4;
  const ClutchedArm* arm;
  template <class S>
  void operator()(const S* x, S* f) const {
    const TipState<S> tip = tip_of<S>(*arm, Links<S>(x[0], x[1], x[2]), Links<S>(x[3], x[4], x[5]));
    f[0] = tip.x, f[1] = tip.z, f[2] = tip.vx, f[3] = tip.vz;
  }
};

struct Linear {
  int output, variable;  ///< the variable's place among the term's
  double factor;
};

/// law(slots) + Σ factor · variable. The term's first variables fill the slots named, the other slots are
/// zero.
template <class Law>
class SlotTerm final : public Term {
 public:
  SlotTerm(std::vector<int> variables, std::vector<int> slots, Law law, std::vector<Linear> linear)
      : Term(std::move(variables)), slots_(std::move(slots)), law_(law), linear_(std::move(linear)) {}

  int outputs() const override { return Law::kOutputs; }
  void value(const double* x, double* f) const override {
    double in[kSlots]{};
    for (std::size_t i = 0; i < slots_.size(); ++i) in[slots_[i]] = x[i];
    law_(in, f);
    for (const Linear& one : linear_) f[one.output] += one.factor * x[one.variable];
  }
  void jacobian(const double* x, double* J) const override {
    using First = dynamics::DualOf<kSlots>;
    First in[kSlots], out[Law::kOutputs];
    for (std::size_t i = 0; i < slots_.size(); ++i) in[slots_[i]] = First(x[i], slots_[i]);
    law_(in, out);
    const std::size_t n = variables().size();
    std::fill_n(J, n * Law::kOutputs, 0.0);
    for (int o = 0; o < Law::kOutputs; ++o)
      for (std::size_t i = 0; i < slots_.size(); ++i) J[o * n + i] = out[o].v[slots_[i]];
    for (const Linear& one : linear_) J[one.output * n + one.variable] += one.factor;
  }
  void hessian(const double* x, const double* weight, double* packed) const override {
    using Second = SecondDual<kSlots>;
    Second in[kSlots], out[Law::kOutputs], total;
    for (std::size_t i = 0; i < slots_.size(); ++i) in[slots_[i]] = Second::independent(x[i], slots_[i]);
    law_(in, out);
    for (int o = 0; o < Law::kOutputs; ++o) total += weight[o] * out[o];
    const int n = static_cast<int>(variables().size());
    std::fill_n(packed, n * (n + 1) / 2, 0.0);
    for (int i = 0; i < static_cast<int>(slots_.size()); ++i)
      for (int j = 0; j <= i; ++j) {
        const int a = std::max(slots_[i], slots_[j]), b = std::min(slots_[i], slots_[j]);
        packed[i * (i + 1) / 2 + j] = total.h[a * (a + 1) / 2 + b];
      }
  }

 private:
  std::vector<int> slots_;
  Law law_;
  std::vector<Linear> linear_;
};

/// Rows of factors times the variables.
class LinearTerm final : public Term {
 public:
  LinearTerm(std::vector<int> variables, std::vector<double> factors)
      : Term(std::move(variables)), factors_(std::move(factors)) {}
  int outputs() const override { return static_cast<int>(factors_.size() / variables().size()); }
  void value(const double* x, double* f) const override {
    const std::size_t n = variables().size();
    for (int o = 0; o < outputs(); ++o) f[o] = std::inner_product(x, x + n, factors_.data() + o * n, 0.0);
  }
  void jacobian(const double*, double* J) const override { std::copy(factors_.begin(), factors_.end(), J); }
  void hessian(const double*, const double*, double* packed) const override {
    std::fill_n(packed, variables().size() * (variables().size() + 1) / 2, 0.0);
  }

 private:
  std::vector<double> factors_;
};

struct WeightedSquare {
  double weight;
  template <class S>
  void operator()(const S* x, S* f) const {
    f[0] = weight * x[0] * x[0];
  }
};

struct SquareInShare {
  double weight;
  template <class S>
  void operator()(const S* x, S* f) const {
    f[0] = weight * x[0] * x[0] * x[1] / (x[1] + x[2]);
  }
};

/// (vx, vz) -> −0.1 |v|²
struct MinusSquaredSpeed {
  template <class S>
  void operator()(const S* x, S* f) const {
    f[0] = -0.1 * (x[0] * x[0] + x[1] * x[1]);
  }
};

struct MissOfBox {
  Target target;
  double gravity;
  template <class S>
  void operator()(const S* x, S* f) const {
    f[0] = x[0] + x[2] * x[4] - target.x;
    f[1] = x[1] + x[3] * x[4] - 0.5 * gravity * x[4] * x[4] - target.z;
  }
};

template <int Inputs, int Outputs, class Law>
TermPointer term(std::vector<int> variables, Law law) {
  return std::make_unique<TermOf<Inputs, Outputs, Law>>(std::move(variables), law);
}

}  // namespace

TermPointer hermite_simpson(std::vector<int> v, double scale) {
  return term<7, 2>(std::move(v), HermiteSimpson{scale});
}
TermPointer weighted_square(std::vector<int> v, double weight) {
  return term<1, 1>(std::move(v), WeightedSquare{weight});
}
TermPointer square_in_share(std::vector<int> v, double weight) {
  return term<3, 1>(std::move(v), SquareInShare{weight});
}
TermPointer linear(std::vector<int> v, std::vector<double> factors) {
  return std::make_unique<LinearTerm>(std::move(v), std::move(factors));
}

namespace {

/// A torque term whose last variables are the `motors` torques at a node, or at both nodes beside a middle:
/// their mean is taken from the first outputs.
template <int Outputs = kLinks>
TermPointer torques(std::vector<int> v, std::vector<int> slots, const ClutchedArm& arm,
                    std::vector<Linear> linear_part, int base, int motors) {
  const int sets = (static_cast<int>(v.size()) - base) / motors;
  for (int k = 0; k < sets * motors; ++k) linear_part.push_back({k % motors, base + k, -1.0 / sets});
  return std::make_unique<SlotTerm<JointTorques<Outputs>>>(
      std::move(v), std::move(slots), JointTorques<Outputs>{&arm}, std::move(linear_part));
}

}  // namespace

TermPointer series_torques(std::vector<int> v, const ClutchedArm& arm) {
  const ClutchedJoint& j = arm.last;
  return torques(std::move(v), {0, 1, 2, 3, 4, 5, 6, 7, 8}, arm,
                 {{2, 8, kAcceleration * j.spring_inertia},
                  {2, 9, -j.stiffness},
                  {2, 2, j.stiffness},
                  {2, 10, -j.damping},
                  {2, 5, j.damping}},
                 11, 2);
}
TermPointer braked_torques(std::vector<int> v, const ClutchedArm& arm) {
  const ClutchedJoint& j = arm.last;
  return torques(std::move(v), {0, 1, 2, 3, 4, 6, 7}, arm,
                 {{2, 7, -j.stiffness}, {2, 2, j.stiffness}, {2, 8, -j.damping}}, 9, 2);
}
TermPointer passive_torques(std::vector<int> v, const ClutchedArm& arm) {
  const ClutchedJoint& j = arm.last;
  return torques(std::move(v), {0, 1, 2, 3, 4, 5, 6, 7, 8}, arm,
                 {{2, 8, kAcceleration * j.spring_inertia},
                  {2, 9, -j.stiffness},
                  {2, 2, j.stiffness},
                  {2, 5, j.damping}},
                 10, 2);
}
TermPointer locked_torques(std::vector<int> v, const ClutchedArm& arm) {
  return torques<2>(std::move(v), {0, 1, 2, 3, 4, 6, 7}, arm, {}, 7, 2);
}
TermPointer rigid_torques(std::vector<int> v, const ClutchedArm& arm) {
  return torques(std::move(v), {0, 1, 2, 3, 4, 5, 6, 7, 8}, arm,
                 {{2, 8, kAcceleration * (arm.last.spring_inertia + arm.last.motor_inertia)}}, 9, 3);
}
TermPointer tip_state(std::vector<int> v, const ClutchedArm& arm) {
  return std::make_unique<SlotTerm<Tip>>(std::move(v), std::vector{0, 1, 2, 3, 4, 5}, Tip{&arm},
                                         std::vector<Linear>{{0, 6, -1}, {1, 7, -1}, {2, 8, -1}, {3, 9, -1}});
}
TermPointer minus_squared_speed(std::vector<int> v) { return term<2, 1>(std::move(v), MinusSquaredSpeed{}); }
TermPointer miss(std::vector<int> v, const Target& target, double gravity) {
  return term<5, 2>(std::move(v), MissOfBox{target, gravity});
}

}  // namespace unhand::planners::elastic
