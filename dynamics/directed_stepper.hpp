// Collocation in size and direction, for flows that depend on the direction of a part of the state.
#pragma once

#include <array>
#include <memory>
#include <utility>

#include "dynamics/radau_nodes.hpp"
#include "dynamics/small_inverse.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {

/// Steps of flows whose rate depends on a part u of the state by its direction alone (the part that
/// HybridSystem::pace_weights names), while that direction is slaved: slip that creeps.
///
/// With u = s n, |n| = 1, and z the rest of the state, u' = F(t, z, n), z' = g(t, z, s n) is
///
///   s' = n·F,   s n' = F − (n·F) n,
///
/// and nothing in it grows as 1/s. Where n is slaved (it relaxes within s/|∂F/∂n|), s and n are as smooth in
/// time as what drives them: while s sets out from next to nothing as (t − t₀)², and to the point where it
/// passes zero. So steps are taken in time, by collocation of s', n and z' on the nodes of Radau IIA: order
/// nine at the end, six in between. (In u itself, or in a pace of |u|, what is solved is stiff or has a pole,
/// and steps shrink with s.)
///
/// The equations are solved by Newton steps for all directions of the step at once, with ∂F/∂n by
/// differences, the sizes and the rest of the state following by quadrature. Steps that do not converge, and
/// steps of a direction that hardly relaxes within them, which an explicit method takes for less, are left to
/// another stepper.
///
/// A step into a stop ends kBeforeStop before s passes zero; the system's own guard must see that coming.
///
/// Error estimate: the Legendre coefficients of degree four and three of the rates over the step, as the
/// finer and the coarser estimate of SingleStep::error_norm.
template <int N>
class DirectedStepper final : public Stepper<double, N> {
 public:
  /// `other` takes the steps that this one does not.
  DirectedStepper(const Tolerances& tolerances, std::unique_ptr<Stepper<double, N>> other)
      : tolerances_(tolerances), other_(std::move(other)) {}

  void start(const HybridSystem<N>& system, const Phase& phase, const double& t,
             const State<double, N>& y) override {
    system_ = &system;
    phase_ = phase;
    name_parts(system.pace_weights());
    this->t1_ = t;
    this->y1_ = y;
    guess_from_ = kNone;
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
    if (due && (guess_from_ != kNone || is_slaved()) && take(limit, longest)) {
      if (directed_) wait_next_ = kWait;
      directed_ = true;
      count();
      return StepStatus::accepted;
    }
    if (due || directed_) wait_ = std::exchange(wait_next_, std::min(4 * wait_next_, kLongestWait));
    guess_from_ = kNone;
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
      y = at(theta).y;
    else
      other_->interpolate(theta, y);
  }
  void retake(double h, State<double, N>& y) override {
    if (directed_) {
      const Solution taken = solution_;
      guess_from_ = 0;
      const bool solved = solve(h) == Solved::yes;
      if (solved) y = end_state();
      solution_ = taken;
      if (!solved) y = at(h / taken.h).y;
    } else {
      other_->retake(h, y);
    }
    count();
  }
  int parts() const override { return directed_ ? 3 : other_->parts(); }
  double fraction(double h) const override {
    return directed_ ? h / (this->t1_ - this->t0_) : other_->fraction(h);
  }
  StepPoint<N> point(double theta) const override {
    if (!directed_) return other_->point(theta);
    const double length = this->t1_ - this->t0_;
    return {this->t0_ + theta * length, at(theta).y, length};
  }
  void goes_on() override { goes_on_ = true; }
  void suggest(double h) override { h_next_ = h; }

 private:
  using Nodes = RadauNodes;
  static constexpr int kNodes = Nodes::kCount;
  static constexpr auto kIntegral = Nodes::integrals(), kPower = Nodes::powers(),
                        kPrimitive = Nodes::primitives();
  static constexpr auto kSlope = Nodes::slopes();
  static constexpr auto kBarycentric = Nodes::barycentric();

  static constexpr double kFirst = 4e-3;      // s: the length first tried
  static constexpr double kOrder = 7;         // by which the error estimate falls with the length
  static constexpr double kSafety = 0.1;      // of the estimate, of an order far below the method's
  static constexpr double kMostGrowth = 2.5;  // of a step's length
  static constexpr int kPasses = 10;          // of the iteration
  static constexpr double kShare = 1e-3;      // of the error that a step may make, left by the iteration
  static constexpr double kSizeShare = 100;   // of the relative tolerance: what a size may err by at most
  static constexpr double kSlaved = 20;      // h |λ| of the next step below which the other stepper takes it
  static constexpr double kResolved = 1e10;  // h |λ| above which s' is lost in the rounding of F
  static constexpr double kTransient = 30;   // h |λ| of a step in which a direction finds its way
  static constexpr double kSmooth = 10;      // least power with which a direction may go into a stop
  static constexpr int kWait = 6, kLongestWait = 10'000;  // steps of the other between two trials
  static constexpr double kBeforeStop = 4e-9;             // s
  static constexpr double kSmallest = 1e-6;  // share of the starting size at which directions are evaluated
  static constexpr double kNone = -1;

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
    double h{}, size0{};
    Direction n0{};
    State<double, N> y0{};
    std::array<Node, kNodes> node;
  };
  struct Point {
    State<double, N> y;
    Direction n;
    double size;
  };
  enum class Solved { yes, no, not_finite };

  static double dot(const Direction& a, const Direction& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }

  // ---------------------------------------------------------------- the part and the rest

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
  State<double, N> end_state() const {
    const Node& last = solution_.node[kNodes - 1];
    return state_of(last.y, last.size, last.n);
  }

  // ---------------------------------------------------------------- one step's equations

  /// F at the node's z and the direction n, at the node's size; all rates into `rate`.
  Direction driven(double t, const Node& node, const Direction& n, State<double, N>& rate) {
    ++own_evaluations_;
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
        solution_.node[i].y[k] = this->y0_[k] + solution_.h * change;
      }
  }

  /// Where the iteration begins: on the polynomials of the solution at hand, if they say something, or with
  /// the state as it is.
  void predict(double h) {
    Solution next;
    next.h = h;
    next.y0 = this->y0_;
    next.n0 = weighted(this->y0_);
    next.size0 = std::sqrt(dot(next.n0, next.n0));
    for (double& x : next.n0) x /= next.size0;
    for (int i = 0; i < kNodes; ++i) {
      Node& node = next.node[i];
      const double theta = guess_from_ == kNone ? 9 : guess_from_ + Nodes::kNode[i] * h / solution_.h;
      const Point guess = theta < 3.6 ? at(theta) : Point{this->y0_, next.n0, next.size0};
      node.y = guess.y;
      node.n = guess.n;
      node.size = guess.size;
    }
    solution_ = next;
  }

  /// One Newton step for the directions of all nodes, F being the rates at those of now; the largest move of
  /// s n. The matrix is that of the first two passes.
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

  /// A step of length h from the last state.
  Solved solve(double h) {
    predict(h);
    auto& nodes = solution_.node;
    double allowed = 0, before[2]{};  // what the last two passes moved
    for (int pass = 0; pass < kPasses; ++pass) {
      std::array<Direction, kNodes> F;
      std::array<double, kNodes> growth;
      for (int i = 0; i < kNodes; ++i) {
        Node& node = nodes[i];
        const double t = this->t0_ + Nodes::kNode[i] * h;
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
      if (pass == 0) {
        allowed = scale()[part_[0]] * weight_[0];
      }
      // What is left after a pass is what it moved times what passes gain; s' is known to the rounding of F.
      const double gain = pass > 1 ? std::min(1.0, moved / before[(pass + 1) % 2]) : 1.0;
      const double rounding = std::max(1e-14 * largest, 1e-15 * h * relaxation().second);
      if (pass > 0 && (moved * gain <= kShare * allowed || moved <= rounding)) return Solved::yes;
      if (pass > 2 && moved > 0.1 * before[pass % 2]) return Solved::no;
      before[pass % 2] = moved;
    }
    return Solved::no;
  }

  // ---------------------------------------------------------------- what a solution says

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

  /// s' at the fraction θ of the step.
  double growth_at(double theta) const {
    double growth = 0, power = 1;
    for (int d = 0; d < kNodes; ++d, power *= theta)
      for (int j = 0; j < kNodes; ++j) growth += kPower[d][j] * power * solution_.node[j].growth;
    return growth;
  }

  /// The fraction of the step at which the size first passes zero, at a node or between two; 1 if it does
  /// not.
  double stop() const {
    double low = 0, high = 0, growth = growth_at(0);
    for (int i = 0; i < kNodes; ++i) {
      const Node& node = solution_.node[i];
      high = Nodes::kNode[i];
      if (!(node.size > 0)) return zero_between(low, high);
      if (growth < 0 && node.growth > 0) {  // it has turned: was it at zero before?
        double before = low, after = high;
        for (int k = 0; k < 30; ++k) {
          const double middle = 0.5 * (before + after);
          (growth_at(middle) < 0 ? before : after) = middle;
        }
        if (!(at(after).size > 0)) return zero_between(low, after);
      }
      growth = node.growth;
      low = high;
    }
    return 1;
  }
  /// Newton's method inside the bracket.
  double zero_between(double low, double high) const {
    double theta = 0.5 * (low + high);
    for (int k = 0; k < 60; ++k) {
      const double size = at(theta).size;
      (size > 0 ? low : high) = theta;
      double next = theta - size / (solution_.h * growth_at(theta));
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      const double moved = std::abs(next - theta);
      theta = next;
      if (moved < 1e-14) break;
    }
    return theta;
  }

  /// The norm of the step's error: accepted where <= 1.
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

  /// Whether a step of the length at hand would be one of a slaved direction, by what the flow says where it
  /// begins.
  bool is_slaved() {
    Node node;
    node.y = this->y0_;
    node.n = weighted(this->y0_);
    node.size = solution_.size0 = std::sqrt(dot(node.n, node.n));
    if (count_ < 2 || !(node.size > 0)) return false;
    for (double& x : node.n) x /= node.size;
    linearise(this->t0_, node, driven(this->t0_, node, node.n, node.rate));
    return length() * relaxation(node).second > kSlaved * node.size;
  }
  /// Of the step to try next.
  double length() const { return h_next_ > 0 ? h_next_ : kFirst; }

  /// |∂F/∂n| at a node: of the direction that relaxes slowest, and fastest.
  std::pair<double, double> relaxation(const Node& node) const {
    const auto& k = node.stiffness;
    if (count_ == 2) return {k[0][0], k[0][0]};
    const double mean = 0.5 * (k[0][0] + k[1][1]), determinant = k[0][0] * k[1][1] - k[0][1] * k[1][0];
    const double spread = std::sqrt(std::max(0.0, mean * mean - determinant));
    return {mean - spread, mean + spread};
  }
  /// The error that the step may make in each component.
  State<double, N> scale() const {
    State<double, N> scale;
    system_->error_scale(phase_, tolerances_, this->y0_, end_state(), scale);
    const double most = kSizeShare * tolerances_.relative * largest_size();
    for (int k = 0; k < count_; ++k) scale[part_[k]] = std::min(scale[part_[k]], most / weight_[k]);
    return scale;
  }
  double largest_size() const {
    double largest = 0;
    for (const Node& node : solution_.node) largest = std::max(largest, std::abs(node.size));
    return largest;
  }
  /// |∂F/∂n| at the end of the step.
  std::pair<double, double> relaxation() const { return relaxation(solution_.node[kNodes - 1]); }
  /// h |λ| of the fastest.
  double slaving() const { return solution_.h * relaxation().second / solution_.node[kNodes - 1].size; }

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
      const Solved solved = solve(length);
      guess_from_ = solved == Solved::yes ? 0 : kNone;
      if (solved != Solved::yes) {
        if (++failures > 2 || solved == Solved::not_finite) return false;
        h = 0.25 * length;
        rejected = true;
        continue;
      }
      if (length * relaxation().second > kResolved * largest_size()) return false;
      if (const double theta = stop(); theta < 1) {
        // Before a stop at t* directions relax as (t* − t) to the power of |∂F/∂n|/|s'|.
        if (relaxation().first < kSmooth * std::abs(growth_at(theta))) return false;
        h = theta * length - kBeforeStop;
        if (!(h > kBeforeStop)) return false;
        stops = true;
        continue;
      }
      const double now = error();
      if (now <= 1) {
        this->t1_ = last ? limit : this->t0_ + length;
        if (!(this->t1_ > this->t0_)) return false;
        this->y1_ = end_state();
        const double next = length * growth_of_step(now, length, rejected);
        h_next_ = last || stops ? std::max(next, h_next_) : next;
        error_before_ = last || stops ? 0.0 : std::max(now, 1e-3);
        length_before_ = length;
        slaved_ = slaving() * step_factor(now, kOrder) > kSlaved;
        guess_from_ = 1;
        return true;
      }
      ++own_rejected_;
      if (!std::isfinite(now)) return false;
      h = length * std::min(step_factor(now, kOrder), 0.7);
      if (now > 0.5 * rejected_with) {
        // An error that hardly falls with h: data have kinked, and the direction is still on its way.
        const double relaxed = length * relaxation().first / solution_.node[kNodes - 1].size;
        if (relaxed <= kSlaved) return false;
        h = std::min(h, length * kTransient / relaxed);
      }
      rejected_with = now;
      stops = false;
      rejected = true;
    }
    return false;
  }

  /// What the next step's length is of this one's: as SingleStep's predictive controller says.
  double growth_of_step(double error, double length, bool rejected) const {
    double factor = std::min(rejected ? 1.0 : kMostGrowth, step_factor(error, kOrder));
    if (error_before_ > 0)
      factor = std::min(factor, 0.9 * length / length_before_ *
                                    std::pow(error_before_ / std::max(error * error, 1e-20), 1 / kOrder));
    return std::max(factor, 0.2);
  }

  void count() {
    this->flow_evaluations_ = own_evaluations_ + other_->flow_evaluations();
    this->rejected_ = own_rejected_ + other_->rejected_steps();
  }

  Tolerances tolerances_;
  std::unique_ptr<Stepper<double, N>> other_;
  const HybridSystem<N>* system_{};
  Phase phase_;
  int count_{}, part_[3]{}, rest_[N]{};  // components of the part, and the others
  double weight_[3]{};
  Solution solution_;
  SmallInverse<2 * kNodes> inverse_;
  double h_next_{};
  double guess_from_{kNone};                    // where in the solution at hand the next one begins
  double error_before_{}, length_before_{};     // of the last step taken here
  bool directed_{true}, slaved_{}, goes_on_{};  // whether the last step was taken here; and the next is to be
  int wait_{}, wait_next_{kWait};  // steps of the other until the next trial, and from that to the one after
  bool met_{};                     // whether the other has taken steps of this phase
  long own_evaluations_{}, own_rejected_{};
};

}  // namespace unhand::dynamics
