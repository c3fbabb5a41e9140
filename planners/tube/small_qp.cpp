#include "planners/tube/small_qp.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace unhand::planners {

const char* to_string(QpOutcome outcome) {
  switch (outcome) {
    case QpOutcome::solved:
      return "solved";
    case QpOutcome::infeasible:
      return "infeasible";
    case QpOutcome::not_solved:
      return "not_solved";
  }
  return "unknown";
}

namespace {

constexpr double kSlack = 1e-10;  ///< of a constraint whose normal is scaled to length one
constexpr int kMostSteps = 200;   ///< constraints added, at most

/// H = L Lᵀ
using Factor = Eigen::LLT<QpMatrix>;

/// In y = Lᵀx, where the objective is ½ |y|² + const, with normals of length one.
struct Scaled {
  QpVector normal;
  double offset{}, length{};
};

/// The active constraints: their normals N = Q R by Gram-Schmidt, twice for accuracy.
class ActiveSet {
 public:
  explicit ActiveSet(int unknowns) : Q_(unknowns, 0), R_(0, 0) {}

  struct Member {
    int constraint;
    QpVector normal;
    double multiplier;
    bool equality;
    double sign;  ///< −1: an equality taken with its normal turned round
  };
  std::vector<Member> members;

  /// What of n the active normals leave, and r with N r = the rest.
  struct Split {
    QpVector free;
    QpVector r;
  };
  Split split(const QpVector& n) const {
    Split out = projected(n);
    const int k = static_cast<int>(Q_.cols());
    for (int i = k - 1; i >= 0; --i) {
      for (int j = i + 1; j < k; ++j) out.r[i] -= R_(i, j) * out.r[j];
      out.r[i] /= R_(i, i);
    }
    return out;
  }
  void add(Member member) {
    append(member.normal);
    members.push_back(std::move(member));
  }
  void drop(int which) {
    members.erase(members.begin() + which);
    Q_.resize(Q_.rows(), 0);
    R_.resize(0, 0);
    for (const Member& m : members) append(m.normal);
  }

 private:
  /// What of n the columns of Q leave, and its components along them.
  Split projected(const QpVector& n) const {
    const int k = static_cast<int>(Q_.cols());
    Split out{n, QpVector::Zero(k)};
    for (int pass = 0; pass < 2; ++pass)
      for (int j = 0; j < k; ++j) {
        const double part = Q_.col(j).dot(out.free);
        out.free -= part * Q_.col(j);
        out.r[j] += part;
      }
    return out;
  }
  void append(const QpVector& n) {
    const int k = static_cast<int>(Q_.cols());
    const auto [free, along] = projected(n);
    const double length = free.norm();
    Q_.conservativeResize(Eigen::NoChange, k + 1);
    R_.conservativeResize(k + 1, k + 1);
    Q_.col(k) = free / length;
    R_.row(k).setZero();
    R_.col(k).head(k) = along;
    R_(k, k) = length;
  }
  QpMatrix Q_, R_;
};

void check(const QuadraticProgram& p) {
  const auto n = p.c.size();
  bool fits = n > 0 && p.H.rows() == n && p.H.cols() == n && p.H.allFinite() && p.c.allFinite();
  for (const QpConstraint& k : p.constraints)
    fits = fits && k.a.size() == n && k.a.allFinite() && std::isfinite(k.b);
  if (!fits) throw std::invalid_argument("quadratic program: sizes do not match, or a number is not finite");
}

std::vector<Scaled> scaled_constraints(const QuadraticProgram& program, const Factor& H) {
  std::vector<Scaled> out;
  for (const QpConstraint& constraint : program.constraints) {
    QpVector a = H.matrixL().solve(constraint.a);
    const double length = a.norm();
    if (length > 0) a /= length;
    out.push_back({a, length > 0 ? constraint.b / length : constraint.b, length});
  }
  return out;
}

/// The constraint to add at y: any equality that is not settled, or the inequality violated most; −1: none.
int next_constraint(const QuadraticProgram& program, const std::vector<Scaled>& scaled,
                    const std::vector<bool>& settled, const QpVector& y) {
  int chosen = -1;
  double worst = 0;
  for (std::size_t k = 0; k < scaled.size(); ++k) {
    if (settled[k]) continue;
    if (program.constraints[k].equality) return static_cast<int>(k);
    const double slack = scaled[k].normal.dot(y) - scaled[k].offset;
    if (slack < -kSlack * (1 + std::abs(scaled[k].offset)) && slack < worst)
      chosen = static_cast<int>(k), worst = slack;
  }
  return chosen;
}

}  // namespace

QpSolution solve(const QuadraticProgram& program) {
  check(program);
  const int n = static_cast<int>(program.c.size()), m = static_cast<int>(program.constraints.size());
  QpSolution out;
  out.multipliers.assign(static_cast<std::size_t>(m), 0.0);
  const Factor H(program.H);
  if (H.info() != Eigen::Success) {
    out.outcome = QpOutcome::not_solved;
    out.x = QpVector::Zero(n);
    return out;
  }
  QpVector y = -H.matrixL().solve(program.c);
  const std::vector<Scaled> scaled = scaled_constraints(program, H);
  const auto slack = [&](int k) { return scaled[k].normal.dot(y) - scaled[k].offset; };
  ActiveSet active(n);
  std::vector<bool> settled(static_cast<std::size_t>(m), false);  // active, or following from what is
  const auto finish = [&](QpOutcome outcome) {
    out.outcome = outcome;
    out.x = H.matrixU().solve(y);
    for (const auto& one : active.members)
      out.multipliers[one.constraint] = one.sign * one.multiplier / scaled[one.constraint].length;
    return out;
  };

  for (int steps = 0;;) {
    const int chosen = next_constraint(program, scaled, settled, y);
    if (chosen < 0) return finish(QpOutcome::solved);
    const double sign = program.constraints[chosen].equality && slack(chosen) > 0 ? -1 : 1;
    const QpVector normal = sign * scaled[chosen].normal;
    double multiplier = 0;
    for (;;) {
      if (++steps > kMostSteps) return finish(QpOutcome::not_solved);
      const double s = sign * slack(chosen);
      const auto [free, r] = active.split(normal);
      const double room = free.squaredNorm();
      const bool dependent = !(room > 1e-18);
      if (dependent && program.constraints[chosen].equality &&
          std::abs(s) <= kSlack * (1 + std::abs(scaled[chosen].offset)))
        break;  // an equality that says what others say already
      // How far the multipliers of the active inequalities allow, and how far it is to the constraint.
      double step = dependent ? std::numeric_limits<double>::infinity() : -s / room;
      int leaves = -1;
      for (int j = 0; j < static_cast<int>(active.members.size()); ++j)
        if (!active.members[j].equality && r[j] > 1e-14 && active.members[j].multiplier / r[j] < step)
          step = active.members[j].multiplier / r[j], leaves = j;
      if (!std::isfinite(step)) {
        finish(QpOutcome::infeasible);
        out.conflict = {chosen};
        for (int j = 0; j < static_cast<int>(active.members.size()); ++j)
          if (std::abs(r[j]) > 1e-9) out.conflict.push_back(active.members[j].constraint);
        return out;
      }
      if (!dependent) y += step * free;
      for (int j = 0; j < static_cast<int>(active.members.size()); ++j)
        active.members[j].multiplier -= step * r[j];
      multiplier += step;
      if (leaves >= 0) {
        settled[active.members[leaves].constraint] = false;
        active.drop(leaves);
        continue;
      }
      active.add({chosen, normal, multiplier, program.constraints[chosen].equality, sign});
      break;
    }
    settled[chosen] = true;
  }
}

}  // namespace unhand::planners
