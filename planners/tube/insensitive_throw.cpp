#include "planners/tube/insensitive_throw.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "contact/registry.hpp"
#include "planners/tube/require.hpp"
#include "planners/tube/throw_once.hpp"

namespace unhand::planners {

using dynamics::Dual;

namespace {

/// The landings at ± √p σ of each unknown, weighed so that their squares add to the mean square.
class Points {
 public:
  explicit Points(const ReleaseThrow& problem) {
    const auto unknowns = unknowns_of(problem);
    int p = 0;
    for (const Uncertain& one : unknowns) p += one.sigma > 0;
    if (p == 0) draws_.push_back(nominal_draw(problem)), moved_.emplace_back("their nominal values");
    for (int k = 0; k < kUnknowns; ++k)
      for (const double side : {-1.0, 1.0}) {
        if (!(unknowns[k].sigma > 0)) continue;
        Draw draw = nominal_draw(problem);
        draw[k] += side * std::sqrt(p) * unknowns[k].sigma;
        if (!has_sign(k)) draw[k] = std::clamp(draw[k], 0.05 * unknowns[k].value, most_of(k));
        draws_.push_back(draw);
        moved_.emplace_back(name_of(static_cast<Unknown>(k)));
      }
  }
  /// The first unknown of which a draw does not land; empty: all do.
  std::string lost(const ReleaseThrow& problem, const PlanarHand& hand) const {
    for (std::size_t i = 0; i < draws_.size(); ++i)
      if (!throw_once<double>(problem, hand, draws_[i])) return moved_[i];
    return "";
  }
  int size() const { return static_cast<int>(draws_.size()); }
  double weight() const { return 1 / std::sqrt(static_cast<double>(draws_.size())); }

  template <class S>
  std::optional<std::vector<S>> residuals(const ReleaseThrow& problem, const PlanarHand& hand) const {
    std::vector<S> out;
    for (const Draw& draw : draws_) {
      std::array<S, kUnknowns> given;
      for (int k = 0; k < kUnknowns; ++k) given[k] = S(draw[k]);
      const auto thrown = throw_once<S>(problem, hand, given);
      if (!thrown) return {};
      out.push_back(S(weight() * thrown->miss));
    }
    return out;
  }

 private:
  std::vector<Draw> draws_;
  std::vector<std::string> moved_;  ///< the unknown that is moved in a draw
};

/// Limits of what a step may change: rows of a quadratic program in (δq̇₀, δq̈).
std::vector<QpConstraint> step_limits(const ReleaseThrow& p, const std::vector<int>& joints) {
  constexpr double kReserve = 0.02;  // of the limits, kept free
  const int m = static_cast<int>(joints.size());
  std::vector<QpConstraint> out;
  for (int i = 0; i < m; ++i) {
    const int joint = joints[i];
    const JointLimits& l = p.chain.joints[joint].limits;
    const double v = (1 - kReserve) * l.velocity, a = (1 - kReserve) * l.acceleration;
    const double qd = p.start.qd[joint], qdd = p.qdd[joint];
    const auto add = [&](double by_rate, double by_acceleration, double now, double most) {
      for (const double side : {1.0, -1.0}) {
        QpConstraint row{QpVector::Zero(2 * m), -most - side * now, false};
        row.a[i] = side * by_rate;
        row.a[m + i] = side * by_acceleration;
        if (std::isfinite(most)) out.push_back(std::move(row));
      }
    };
    add(1, 0, qd, v);
    add(1, p.hold, qd + p.hold * qdd, v);
    add(0, 1, qdd, a);
  }
  return out;
}

/// Levenberg-Marquardt over q̇₀ and q̈ of some joints.
class Descent {
 public:
  Descent(const ReleaseThrow& problem, const std::vector<int>& joints)
      : joints_(joints), points_(problem), at_(problem), cost_(cost_of(problem)) {}

  double cost() const { return cost_; }  // mean square miss [m²]
  const ReleaseThrow& at() const { return at_; }
  std::string lost() const { return points_.lost(at_, hand_of(at_)); }

  /// One step, as long as one lowers the cost; whether one did.
  bool step() {
    const auto linear = linearise();
    if (!linear) return false;
    constexpr int kAttempts = 6;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      QuadraticProgram program = *linear;
      damp(program);
      const QpSolution solution = solve(program);
      if (solution.outcome != QpOutcome::solved) return false;
      const ReleaseThrow next = moved(solution.x);
      const double tried = cost_of(next);
      damping_ *= tried < cost_ ? 0.3 : 8;
      if (!(tried < cost_)) continue;
      at_.start = next.start, at_.qdd = next.qdd, cost_ = tried;
      return true;
    }
    return false;
  }

 private:
  int count() const { return static_cast<int>(joints_.size()); }

  double cost_of(const ReleaseThrow& p) const {
    const auto residuals = points_.residuals<double>(p, hand_of(p));
    if (!residuals) return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (const double r : *residuals) sum += r * r;
    return sum;
  }

  /// Gauss and Newton's quadratic program in (δq̇₀, δq̈); nothing where a draw does not land.
  std::optional<QuadraticProgram> linearise() const {
    const int m = count(), n = 2 * m;
    JointVector<Dual> qd = at_.start.qd.cast<Dual>(), qdd = at_.qdd.cast<Dual>();
    for (int i = 0; i < m; ++i) {
      qd[joints_[i]].v[i] = 1;
      qdd[joints_[i]].v[m + i] = 1;
    }
    const auto residuals = points_.residuals<Dual>(at_, hand_of(at_, qd, qdd));
    if (!residuals) return {};
    QuadraticProgram out{QpMatrix::Zero(n, n), QpVector::Zero(n), step_limits(at_, joints_)};
    for (const Dual& r : *residuals)
      for (int i = 0; i < n; ++i) {
        out.c[i] += r.a * r.v[i];
        for (int j = 0; j < n; ++j) out.H(i, j) += r.v[i] * r.v[j];
      }
    return out;
  }

  /// A step of a whole limit costs `damping_` square decimetres.
  void damp(QuadraticProgram& program) const {
    const int m = count();
    for (int i = 0; i < m; ++i) {
      const JointLimits& l = at_.chain.joints[joints_[i]].limits;
      program.H(i, i) += damping_ * 1e-2 / (l.velocity * l.velocity);
      program.H(m + i, m + i) += damping_ * 1e-2 / (l.acceleration * l.acceleration);
    }
  }

  ReleaseThrow moved(const QpVector& by) const {
    ReleaseThrow out = at_;
    for (int i = 0; i < count(); ++i) {
      out.start.qd[joints_[i]] += by[i];
      out.qdd[joints_[i]] += by[count() + i];
    }
    return out;
  }

  const std::vector<int>& joints_;
  const Points points_;
  ReleaseThrow at_;
  double cost_, damping_{1e-3};
};

}  // namespace

InsensitiveResult make_insensitive(const ReleaseThrow& problem, const std::vector<int>& joints) {
  constexpr int kIterations = 15;      // at most
  constexpr double kTolerance = 1e-3;  // relative decrease of the cost at which it is enough
  constexpr std::size_t kMostJoints = dynamics::kDualSize / 2;
  validate(problem);
  if (joints.empty() || joints.size() > kMostJoints)
    throw std::invalid_argument(
        fmt::format("make_insensitive: {} joints named; accepted: 1 to {}", joints.size(), kMostJoints));
  require_distinct(problem.chain, "make_insensitive", joints);
  Descent descent(problem, joints);
  InsensitiveResult out{problem.start, problem.qdd, std::sqrt(descent.cost()), std::sqrt(descent.cost()), 0};
  if (!std::isfinite(descent.cost())) {
    out.lost = descent.lost();
    return out;
  }
  for (; out.iterations < kIterations; ++out.iterations) {
    const double before = descent.cost();
    if (!descent.step() || descent.cost() > (1 - kTolerance) * before) break;
  }
  out.start = descent.at().start, out.qdd = descent.at().qdd;
  out.after = std::sqrt(descent.cost());
  return out;
}

}  // namespace unhand::planners
