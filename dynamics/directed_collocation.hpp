// One step of collocation in the size and the direction of a part of the state.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "dynamics/radau_nodes.hpp"
#include "dynamics/small_inverse.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// A step of a flow whose rate depends on a part u of the state by its direction alone (the part that
/// HybridSystem::pace_weights names), by collocation of the part's size and direction.
///
/// With u = s n, |n| = 1, and z the rest of the state, u' = F(t, z, n), z' = g(t, z, s n) is
///
///   s' = n·F,   s n' = F − (n·F) n,
///
/// and nothing in it grows as 1/s. s', n and z' are polynomials with the nodes of Radau IIA: order nine at
/// the end, six in between. The equations are solved by Newton steps for all directions of the step at once,
/// with ∂F/∂n by differences, the sizes and the rest of the state following by quadrature.
template <int N>
class DirectedCollocation {
 public:
  /// Whether the iteration found the step's solution.
  enum class Solved {
    yes,         ///< to a small share of the error that the step may make
    no,          ///< it does not converge
    not_finite,  ///< the flow returned NaN or infinity
  };
  /// Where the iteration begins.
  enum class Guess {
    start,      ///< the state at the start of the step, unchanged
    same_step,  ///< the last solution, of a step from the same start
    next_step,  ///< the last solution, of the step before this one, extrapolated
  };
  /// |∂F/∂n| across n: of the direction that relaxes slowest, and fastest.
  struct Relaxation {
    double slowest{}, fastest{};  ///< in the unit of u' (u/s)
  };

  /// Of the errors that steps may make.
  explicit DirectedCollocation(const Tolerances& tolerances) : tolerances_(tolerances) {}

  /// The flow of the steps that follow.
  void enter(const HybridSystem<N>& system, const Phase& phase) {
    system_ = &system;
    phase_ = phase;
    name_parts(system.pace_weights());
  }

  /// A step of length h [s] from y at t.
  Solved solve(double t, const State<double, N>& y, double h, Guess guess) {
    predict(t, y, h, guess);
    return iterate();
  }

  /// Where a step of length h [s] from the same start ends; the solution at hand stays.
  std::optional<State<double, N>> again(double h) {
    const Solution kept = solution_;
    std::optional<State<double, N>> out;
    if (solve(kept.t0, kept.y0, h, Guess::same_step) == Solved::yes) out = end();
    solution_ = kept;
    return out;
  }

  /// |λ| [1/s] of the direction that relaxes fastest at (t, y); 0 where there is no direction.
  double relaxation_rate(double t, const State<double, N>& y) {
    Node node;
    node.y = y;
    node.n = weighted(y);
    node.size = solution_.size0 = std::sqrt(dot(node.n, node.n));
    if (count_ < 2 || !(node.size > 0)) return 0;
    for (double& x : node.n) x /= node.size;
    linearise(t, node, driven(t, node, node.n, node.rate));
    return relaxation(node).fastest / node.size;
  }

  // ---------------------------------------------------------------- what the solution says

  /// The length of the step [s].
  double length() const { return solution_.h; }
  /// The state at the end of the step.
  State<double, N> end() const {
    const Node& last = solution_.node[kNodes - 1];
    return state_of(last.y, last.size, last.n);
  }
  /// The state at the fraction θ of the step.
  State<double, N> state(double theta) const { return at(theta).y; }
  /// s' at the fraction θ of the step.
  double growth(double theta) const {
    double growth = 0, power = 1;
    for (int d = 0; d < kNodes; ++d, power *= theta)
      for (int j = 0; j < kNodes; ++j) growth += kPower[d][j] * power * solution_.node[j].growth;
    return growth;
  }

  /// The fraction of the step at which the size first passes zero, at a node or between two; 1 if it does
  /// not.
  double stop() const {
    double low = 0, high = 0, rate = growth(0);
    for (int i = 0; i < kNodes; ++i) {
      const Node& node = solution_.node[i];
      high = Nodes::kNode[i];
      if (!(node.size > 0)) return zero_between(low, high);
      if (rate < 0 && node.growth > 0) {  // it has turned: was it at zero before?
        double before = low, after = high;
        for (int k = 0; k < 30; ++k) {
          const double middle = 0.5 * (before + after);
          (growth(middle) < 0 ? before : after) = middle;
        }
        if (!(at(after).size > 0)) return zero_between(low, after);
      }
      rate = node.growth;
      low = high;
    }
    return 1;
  }

  /// The norm of the step's error, accepted where <= 1: the Legendre coefficients of degree four and three of
  /// the rates over the step, as the finer and the coarser estimate of SingleStep::error_norm.
  double error() const {
    const Solution& sol = solution_;
    // Legendre's coefficients of degree four and three on the step, of a polynomial by its values at the
    // nodes.
    const auto tail = [](const auto& value) {
      double fourth = 0, third = 0;
      for (int j = 0; j < kNodes; ++j) {
        fourth += kPower[4][j] * value(j);
        third += kPower[3][j] * value(j);
      }
      return std::pair{std::abs(fourth) / 70, std::abs(third + 2 * fourth) / 20};
    };
    const State<double, N> scale = this->scale();
    double sum = 0;
    const auto add = [&](int k, double fine, double coarse) {
      sum += combined_square(fine / scale[k], coarse / scale[k]);
    };
    for (int r = 0; r < N - count_; ++r) {
      const auto [fine, coarse] = tail([&](int j) { return sol.node[j].rate[rest_[r]]; });
      add(rest_[r], sol.h * fine, sol.h * coarse);
    }
    const Node& last = sol.node[kNodes - 1];
    const auto [fine, coarse] = tail([&](int j) { return sol.node[j].growth; });
    for (int k = 0; k < count_; ++k) {
      const auto [turns, turns_coarse] = tail([&](int j) { return sol.node[j].n[k]; });
      const double along = sol.h * std::abs(last.n[k]), size = std::abs(last.size);
      add(part_[k], (along * fine + size * turns) / weight_[k],
          (along * coarse + size * turns_coarse) / weight_[k]);
    }
    return kSafety * std::sqrt(sum / N);
  }

  /// At the end of the step.
  Relaxation relaxation() const { return relaxation(solution_.node[kNodes - 1]); }
  /// s at the end of the step.
  double size() const { return solution_.node[kNodes - 1].size; }
  /// The largest |s| of the step's nodes.
  double largest_size() const {
    double largest = 0;
    for (const Node& node : solution_.node) largest = std::max(largest, std::abs(node.size));
    return largest;
  }

  /// Evaluations of the flow since this was made.
  long flow_evaluations() const { return evaluations_; }

 private:
  using Nodes = RadauNodes;
  static constexpr int kNodes = Nodes::kCount;
  static constexpr auto kIntegral = Nodes::integrals(), kPower = Nodes::powers(),
                        kPrimitive = Nodes::primitives();
  static constexpr auto kSlope = Nodes::slopes();
  static constexpr auto kBarycentric = Nodes::barycentric();

  static constexpr double kSafety = 0.1;     // of the error estimate, of an order far below the method's
  static constexpr int kPasses = 10;         // of the iteration
  static constexpr double kShare = 1e-3;     // of the error that a step may make, left by the iteration
  static constexpr double kSizeShare = 100;  // of the relative tolerance: what a size may err by at most
  static constexpr double kSmallest = 1e-6;  // share of the starting size at which directions are evaluated

  /// Weighted components of the part; the third is 0 if it has but two.
  using Direction = std::array<double, 3>;

  struct Node {
    State<double, N> y, rate;  // of y the rest z, of the rate all
    Direction n, e[2];         // and two directions across n
    double size{}, growth{};   // s, s'
    double stiffness[2][2]{};  // −∂F/∂n across n, on e
    double oblique[2]{};       // n·∂F/∂n on e
  };
  struct Solution {
    double h{}, t0{}, size0{};  // the step's length, and where it begins
    Direction n0{};
    State<double, N> y0{};
    std::array<Node, kNodes> node;
  };
  struct Point {
    State<double, N> y;
    Direction n;
    double size;
  };

  static double dot(const Direction& a, const Direction& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }

  void name_parts(const State<double, N>& weights) {
    count_ = 0;
    int others = 0;
    for (int k = 0; k < N; ++k) {
      if (weights[k] != 0 && count_ < 3) {
        weight_[count_] = weights[k];
        part_[count_++] = k;
      } else {
        rest_[others++] = k;
      }
    }
  }
  Direction weighted(const State<double, N>& y) const {
    Direction u{};
    for (int k = 0; k < count_; ++k) u[k] = weight_[k] * y[part_[k]];
    return u;
  }
  State<double, N> state_of(State<double, N> y, double size, const Direction& n) const {
    for (int k = 0; k < count_; ++k) y[part_[k]] = size * n[k] / weight_[k];
    return y;
  }

  // ---------------------------------------------------------------- one step's equations

  /// F at the node's z and the direction n, at the node's size; all rates into `rate`.
  Direction driven(double t, const Node& node, const Direction& n, State<double, N>& rate) {
    ++evaluations_;
    system_->flow(phase_, t, state_of(node.y, std::max(std::abs(node.size), kSmallest * solution_.size0), n),
                  rate);
    return weighted(rate);
  }

  /// Two unit vectors across n inside the part; the second is zero where the part has but two components.
  void basis(Node& node) const {
    const Direction& n = node.n;
    if (count_ == 2) {
      node.e[0] = {-n[1], n[0], 0};
      node.e[1] = {0, 0, 0};
      return;
    }
    int least = 0;  // the axis that n is farthest from
    for (int k = 1; k < 3; ++k)
      if (std::abs(n[k]) < std::abs(n[least])) least = k;
    const int a = (least + 1) % 3, b = (least + 2) % 3;
    const double inverse = 1 / std::sqrt(n[a] * n[a] + n[b] * n[b]);
    Direction& e = node.e[0] = {0, 0, 0};
    e[a] = -n[b] * inverse;
    e[b] = n[a] * inverse;
    node.e[1] = {n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]};
  }

  /// ∂F/∂n by differences: the way of the iteration depends on it, its answer does not.
  void linearise(double t, Node& node, const Direction& F) {
    constexpr double kTilt = 1e-6;
    basis(node);
    Direction change[2]{};
    for (int k = 0; k + 1 < count_; ++k) {
      Direction n = node.n;
      for (int c = 0; c < 3; ++c) n[c] += kTilt * node.e[k][c];
      State<double, N> rate;
      const Direction tilted = driven(t, node, n, rate);
      for (int c = 0; c < 3; ++c) change[k][c] = (tilted[c] - F[c]) / kTilt;
    }
    for (int k = 0; k < 2; ++k) {
      node.oblique[k] = dot(node.n, change[k]);
      for (int l = 0; l < 2; ++l) node.stiffness[l][k] = -dot(node.e[l], change[k]);
    }
  }

  void integrate_sizes() {
    for (int i = 0; i < kNodes; ++i) {
      double change = 0;
      for (int j = 0; j < kNodes; ++j) change += kIntegral[i][j] * solution_.node[j].growth;
      solution_.node[i].size = solution_.size0 + solution_.h * change;
    }
  }
  void integrate_rest() {
    for (int i = 0; i < kNodes; ++i)
      for (int r = 0; r < N - count_; ++r) {
        const int k = rest_[r];
        double change = 0;
        for (int j = 0; j < kNodes; ++j) change += kIntegral[i][j] * solution_.node[j].rate[k];
        solution_.node[i].y[k] = solution_.y0[k] + solution_.h * change;
      }
  }

  /// The step's start, and where its iteration begins.
  void predict(double t, const State<double, N>& y, double h, Guess guess) {
    constexpr double kFarthest = 3.6;  // steps: where the last solution still says something
    Solution next;
    next.h = h;
    next.t0 = t;
    next.y0 = y;
    next.n0 = weighted(y);
    next.size0 = std::sqrt(dot(next.n0, next.n0));
    for (double& x : next.n0) x /= next.size0;
    for (int i = 0; i < kNodes; ++i) {
      Node& node = next.node[i];
      const double theta = guess == Guess::start
                               ? kFarthest
                               : (guess == Guess::next_step ? 1 : 0) + Nodes::kNode[i] * h / solution_.h;
      const Point from = theta < kFarthest ? at(theta) : Point{y, next.n0, next.size0};
      node.y = from.y;
      node.n = from.n;
      node.size = from.size;
    }
    solution_ = next;
  }

  /// One Newton step for the directions of all nodes, F being the rates at those of now; the largest move of
  /// s n. The matrix is the first pass's.
  double turn(const std::array<Direction, kNodes>& F, int pass) {
    constexpr int kSize = 2 * kNodes;
    auto& node = solution_.node;
    alignas(16) double residual[kSize], tilt[kSize];
    double matrix[kSize][kSize];
    for (int i = 0; i < kNodes; ++i) {
      const double share = node[i].size / solution_.h;
      Direction slope;  // n' h
      for (int k = 0; k < 3; ++k) {
        slope[k] = kSlope[i][0] * solution_.n0[k];
        for (int j = 0; j < kNodes; ++j) slope[k] += kSlope[i][j + 1] * node[j].n[k];
      }
      for (int k = 0; k < 2; ++k) {
        residual[2 * i + k] = dot(node[i].e[k], F[i]) - share * dot(node[i].e[k], slope);
        if (pass > 0) continue;
        for (int j = 0; j < kNodes; ++j)
          for (int l = 0; l < 2; ++l)
            matrix[2 * i + k][2 * j + l] = share * kSlope[i][j + 1] * dot(node[i].e[k], node[j].e[l]);
        for (int l = 0; l < 2; ++l) matrix[2 * i + k][2 * i + l] += node[i].stiffness[k][l];
        matrix[2 * i + k][2 * i + k] += node[i].growth;
      }
      if (count_ == 2 && pass == 0) matrix[2 * i + 1][2 * i + 1] = 1;
    }
    if (pass == 0) inverse_.compute(matrix);
    inverse_.multiply(residual, tilt);
    double moved = 0;
    for (int i = 0; i < kNodes; ++i) {
      const double a = tilt[2 * i], b = tilt[2 * i + 1], square = a * a + b * b;
      if (!(square < 1)) return std::numeric_limits<double>::infinity();
      moved = std::max(moved, std::abs(node[i].size) * std::sqrt(square));
      for (int k = 0; k < 3; ++k) node[i].n[k] += a * node[i].e[0][k] + b * node[i].e[1][k];
      const double inverse = 1 / std::sqrt(dot(node[i].n, node[i].n));
      for (double& x : node[i].n) x *= inverse;
      node[i].growth += node[i].oblique[0] * a + node[i].oblique[1] * b;
    }
    return moved;
  }

  /// Newton steps until what is left of them does not count.
  Solved iterate() {
    const double h = solution_.h;
    auto& nodes = solution_.node;
    double allowed = 0, before[2]{};  // what the last two passes moved
    for (int pass = 0; pass < kPasses; ++pass) {
      std::array<Direction, kNodes> F;
      std::array<double, kNodes> growth;
      for (int i = 0; i < kNodes; ++i) {
        Node& node = nodes[i];
        const double t = solution_.t0 + Nodes::kNode[i] * h;
        F[i] = driven(t, node, node.n, node.rate);
        if (pass == 0)
          linearise(t, node, F[i]);
        else
          for (Direction& e : node.e) {  // across the n of now
            const double along = dot(e, node.n);
            for (int k = 0; k < 3; ++k) e[k] -= along * node.n[k];
          }
        growth[i] = std::exchange(node.growth, dot(node.n, F[i]));
        if (!std::isfinite(node.growth)) return Solved::not_finite;
      }
      integrate_sizes();
      double moved = turn(F, pass), largest = 0;
      if (!std::isfinite(moved)) return Solved::no;
      integrate_sizes();
      integrate_rest();
      for (int i = 0; i < kNodes; ++i) {
        moved = std::max(moved, h * std::abs(nodes[i].growth - growth[i]));
        largest = std::max(largest, std::abs(nodes[i].size));
      }
      if (pass == 0) allowed = scale()[part_[0]] * weight_[0];
      // What is left after a pass is what it moved times what passes gain; s' is known to the rounding of F.
      const double gain = pass > 1 ? std::min(1.0, moved / before[(pass + 1) % 2]) : 1.0;
      const double rounding = std::max(1e-14 * largest, 1e-15 * h * relaxation().fastest);
      if (pass > 0 && (moved * gain <= kShare * allowed || moved <= rounding)) return Solved::yes;
      if (pass > 2 && moved > 0.1 * before[pass % 2]) return Solved::no;
      before[pass % 2] = moved;
    }
    return Solved::no;
  }

  /// The polynomials of the solution at the fraction θ of its step.
  Point at(double theta) const {
    const Solution& sol = solution_;
    std::array<double, kNodes + 1> weight;  // of the values at the start and the nodes
    double below = 1, above = 1;
    for (int j = 0; j <= kNodes; ++j) {
      weight[j] = kBarycentric[j] * below;
      below *= theta - Nodes::from_start(j);
    }
    for (int j = kNodes; j >= 0; --j) {
      weight[j] *= above;
      above *= theta - Nodes::from_start(j);
    }
    std::array<double, kNodes> integral{};  // of the rates at the nodes
    double power = sol.h;
    for (int d = 0; d < kNodes; ++d) {
      power *= theta;
      for (int j = 0; j < kNodes; ++j) integral[j] += kPrimitive[d][j] * power;
    }
    Point point{sol.y0, {}, sol.size0};
    for (int k = 0; k < 3; ++k) {
      point.n[k] = weight[0] * sol.n0[k];
      for (int j = 0; j < kNodes; ++j) point.n[k] += weight[j + 1] * sol.node[j].n[k];
    }
    const double inverse = 1 / std::sqrt(dot(point.n, point.n));
    for (double& x : point.n) x *= inverse;
    for (int j = 0; j < kNodes; ++j) {
      point.size += integral[j] * sol.node[j].growth;
      for (int r = 0; r < N - count_; ++r) point.y[rest_[r]] += integral[j] * sol.node[j].rate[rest_[r]];
    }
    point.y = state_of(point.y, point.size, point.n);
    return point;
  }

  /// Newton's method inside the bracket.
  double zero_between(double low, double high) const {
    double theta = 0.5 * (low + high);
    for (int k = 0; k < 60; ++k) {
      const double size = at(theta).size;
      (size > 0 ? low : high) = theta;
      double next = theta - size / (solution_.h * growth(theta));
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      const double moved = std::abs(next - theta);
      theta = next;
      if (moved < 1e-14) break;
    }
    return theta;
  }

  /// |∂F/∂n| at a node: of the direction that relaxes slowest, and fastest.
  Relaxation relaxation(const Node& node) const {
    const auto& k = node.stiffness;
    if (count_ == 2) return {k[0][0], k[0][0]};
    const double mean = 0.5 * (k[0][0] + k[1][1]), determinant = k[0][0] * k[1][1] - k[0][1] * k[1][0];
    const double spread = std::sqrt(std::max(0.0, mean * mean - determinant));
    return {mean - spread, mean + spread};
  }
  /// The error that the step may make in each component.
  State<double, N> scale() const {
    State<double, N> scale;
    system_->error_scale(phase_, tolerances_, solution_.y0, end(), scale);
    const double most = kSizeShare * tolerances_.relative * largest_size();
    for (int k = 0; k < count_; ++k) scale[part_[k]] = std::min(scale[part_[k]], most / weight_[k]);
    return scale;
  }

  Tolerances tolerances_;
  const HybridSystem<N>* system_{};
  Phase phase_;
  int count_{}, part_[3]{}, rest_[N]{};  // components of the part, and the others
  double weight_[3]{};
  Solution solution_;
  SmallInverse<2 * kNodes> inverse_;
  long evaluations_{};
};

}  // namespace unhand::dynamics
