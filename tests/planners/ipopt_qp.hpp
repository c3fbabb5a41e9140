// What the planners' own solver of quadratic programs is held against: the KKT conditions, and IPOPT.
#pragma once

#include <coin/IpIpoptApplication.hpp>
#include <coin/IpTNLP.hpp>

#include <algorithm>
#include <cmath>

#include "planners/tube/small_qp.hpp"

namespace unhand::planners {

/// How far (x, λ) is from optimal: the largest of the stationarity residual, constraint violation, negative
/// multiplier and complementarity |λ_k (a_kᵀx − b_k)|.
inline double kkt_residual(const QuadraticProgram& program, const QpSolution& solution) {
  QpVector gradient = program.H * solution.x + program.c;
  double worst = 0;
  for (std::size_t k = 0; k < program.constraints.size(); ++k) {
    const QpConstraint& constraint = program.constraints[k];
    const double slack = constraint.a.dot(solution.x) - constraint.b, lambda = solution.multipliers[k];
    gradient -= lambda * constraint.a;
    worst = std::max(worst, constraint.equality ? std::abs(slack) : std::max(-slack, 0.0));
    if (!constraint.equality) worst = std::max({worst, -lambda, std::abs(lambda * slack)});
  }
  return std::max(worst, gradient.cwiseAbs().maxCoeff());
}

class IpoptQp final : public Ipopt::TNLP {
 public:
  using Index = Ipopt::Index;
  using Number = Ipopt::Number;

  explicit IpoptQp(const QuadraticProgram& program) : p_(program), x(program.c.size()) {}

  bool get_nlp_info(Index& n, Index& m, Index& jacobian, Index& hessian, IndexStyleEnum& style) override {
    n = size(), m = static_cast<Index>(p_.constraints.size());
    jacobian = n * m, hessian = n * (n + 1) / 2, style = C_STYLE;
    return true;
  }
  bool get_bounds_info(Index n, Number* low, Number* high, Index m, Number* g_low, Number* g_high) override {
    for (Index i = 0; i < n; ++i) low[i] = -1e19, high[i] = 1e19;
    for (Index k = 0; k < m; ++k) {
      g_low[k] = p_.constraints[k].b;
      g_high[k] = p_.constraints[k].equality ? p_.constraints[k].b : 1e19;
    }
    return true;
  }
  bool get_starting_point(Index n, bool, Number* start, bool, Number*, Number*, Index, bool,
                          Number*) override {
    for (Index i = 0; i < n; ++i) start[i] = 0;
    return true;
  }
  bool eval_f(Index, const Number* at, bool, Number& value) override {
    value = 0.5 * vector(at).dot(p_.H * vector(at)) + p_.c.dot(vector(at));
    return true;
  }
  bool eval_grad_f(Index n, const Number* at, bool, Number* out) override {
    const QpVector gradient = p_.H * vector(at) + p_.c;
    for (Index i = 0; i < n; ++i) out[i] = gradient[i];
    return true;
  }
  bool eval_g(Index, const Number* at, bool, Index m, Number* out) override {
    for (Index k = 0; k < m; ++k) out[k] = p_.constraints[k].a.dot(vector(at));
    return true;
  }
  bool eval_jac_g(Index n, const Number*, bool, Index m, Index, Index* row, Index* column,
                  Number* values) override {
    for (Index k = 0, at = 0; k < m; ++k)
      for (Index i = 0; i < n; ++i, ++at)
        if (values == nullptr)
          row[at] = k, column[at] = i;
        else
          values[at] = p_.constraints[k].a[i];
    return true;
  }
  bool eval_h(Index n, const Number*, bool, Number factor, Index, const Number*, bool, Index, Index* row,
              Index* column, Number* values) override {
    for (Index i = 0, at = 0; i < n; ++i)
      for (Index j = 0; j <= i; ++j, ++at)
        if (values == nullptr)
          row[at] = i, column[at] = j;
        else
          values[at] = factor * p_.H(i, j);
    return true;
  }
  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* at, const Number*, const Number*, Index,
                         const Number*, const Number*, Number, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    for (Index i = 0; i < n; ++i) x[i] = at[i];
  }

 private:
  Index size() const { return static_cast<Index>(p_.c.size()); }
  QpVector vector(const Number* at) const { return Eigen::Map<const QpVector>(at, size()); }
  const QuadraticProgram& p_;

 public:
  QpVector x;
};

struct IpoptAnswer {
  Ipopt::ApplicationReturnStatus status;
  QpVector x;
};
inline IpoptAnswer solve_by_ipopt(const QuadraticProgram& program) {
  Ipopt::SmartPtr<Ipopt::IpoptApplication> solver = IpoptApplicationFactory();
  solver->Options()->SetIntegerValue("print_level", 0);
  solver->Options()->SetStringValue("sb", "yes");
  solver->Options()->SetNumericValue("tol", 1e-12);
  solver->Options()->SetNumericValue("bound_relax_factor", 0);
  solver->Initialize();
  Ipopt::SmartPtr<IpoptQp> problem = new IpoptQp(program);
  const auto status = solver->OptimizeTNLP(problem);
  return {status, problem->x};
}

}  // namespace unhand::planners
