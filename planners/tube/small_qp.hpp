// Convex quadratic programs of a few unknowns, solved exactly.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace unhand::planners {

inline constexpr int kMaxUnknowns = 8;  ///< unknowns of a program, at most

/// At most kMaxUnknowns numbers, without heap.
using QpVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxUnknowns, 1>;
/// The same, in rows and columns.
using QpMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxUnknowns, kMaxUnknowns>;

/// aᵀx = b or aᵀx >= b.
struct QpConstraint {
  QpVector a;       ///< a
  double b{};       ///< b
  bool equality{};  ///< aᵀx = b, else aᵀx >= b
};

/// min ½ xᵀH x + cᵀx subject to the constraints; H symmetric positive definite.
struct QuadraticProgram {
  QpMatrix H;                             ///< symmetric, positive definite
  QpVector c;                             ///< c
  std::vector<QpConstraint> constraints;  ///< in any order
};

/// How a program ended.
enum class QpOutcome {
  solved,      ///< `x` is the minimum
  infeasible,  ///< `conflict` names constraints that no x obeys together
  not_solved,  ///< H is not positive definite, or too many constraints were added
};
/// The outcome's name, as it is written above.
const char* to_string(QpOutcome);

/// The minimum, or why there is none.
struct QpSolution {
  QpOutcome outcome{};  ///< only `solved` has an x
  QpVector x;           ///< the minimum
  /// λ with H x + c = Σ λ_k a_k; λ_k >= 0 of an inequality, zero where it is not active.
  std::vector<double> multipliers;
  std::vector<int> conflict;  ///< indices of constraints
};

/// The dual active-set method [GoldfarbIdnani1983]: starts at the free minimum and adds violated constraints
/// one by one, the most violated first and equalities before all, dropping those whose multiplier would turn
/// negative. It ends after finitely many steps at the solution, or with a certificate that there is none: a
/// violated constraint whose normal is a non-negative combination of the active ones' opposites. Throws
/// std::invalid_argument where sizes do not match or a number is not finite.
QpSolution solve(const QuadraticProgram& program);

}  // namespace unhand::planners
