// Sparse nonlinear programs of small functions of few variables each, solved by an interior point.
#pragma once

#include <ceres/jet.h>

#include <memory>
#include <utility>
#include <vector>

#include "planners/elastic/second_dual.hpp"

namespace unhand::planners::elastic {

/// A function of some of the program's variables.
class Term {
 public:
  explicit Term(std::vector<int> variables) : variables_(std::move(variables)) {}
  virtual ~Term() = default;

  const std::vector<int>& variables() const { return variables_; }
  virtual int outputs() const = 0;
  virtual void value(const double* x, double* f) const = 0;
  /// ∂f/∂x, row by row.
  virtual void jacobian(const double* x, double* J) const = 0;
  /// Σ weight_i ∂²f_i/∂x², its lower triangle packed row by row.
  virtual void hessian(const double* x, const double* weight, double* packed) const = 0;

 private:
  std::vector<int> variables_;
};

/// A term from a function object `law(const S* x, S* f)` templated on its scalar: derivatives are exact, by
/// dual numbers.
template <int Inputs, int Outputs, class Law>
class TermOf final : public Term {
 public:
  TermOf(std::vector<int> variables, Law law) : Term(std::move(variables)), law_(std::move(law)) {}

  int outputs() const override { return Outputs; }
  void value(const double* x, double* f) const override { law_(x, f); }
  void jacobian(const double* x, double* J) const override {
    using First = ceres::Jet<double, Inputs>;
    First in[Inputs], out[Outputs];
    for (int i = 0; i < Inputs; ++i) in[i] = First(x[i], i);
    law_(in, out);
    for (int o = 0; o < Outputs; ++o)
      for (int i = 0; i < Inputs; ++i) J[o * Inputs + i] = out[o].v[i];
  }
  void hessian(const double* x, const double* weight, double* packed) const override {
    using Second = SecondDual<Inputs>;
    Second in[Inputs], out[Outputs], sum;
    for (int i = 0; i < Inputs; ++i) in[i] = Second::independent(x[i], i);
    law_(in, out);
    for (int o = 0; o < Outputs; ++o) sum += weight[o] * out[o];
    for (int k = 0; k < Second::kPairs; ++k) packed[k] = sum.h[k];
  }

 private:
  Law law_;
};

/// min Σ f over the objective's terms, subject to bounds of the variables and of the constraints' terms.
class NonlinearProgram {
 public:
  struct Constraint {
    std::unique_ptr<Term> term;
    std::vector<double> lower, upper;
  };

  int add_variable(double lower, double upper, double start);
  void minimise(std::unique_ptr<Term> term) { objective.push_back(std::move(term)); }
  void constrain(std::unique_ptr<Term> term, std::vector<double> low, std::vector<double> high) {
    constraints.push_back({std::move(term), std::move(low), std::move(high)});
  }

  std::vector<double> lower, upper, start;  ///< of the variables; ±1e19 and beyond: unbounded
  std::vector<std::unique_ptr<Term>> objective;
  std::vector<Constraint> constraints;
};

struct ProgramOptions {
  int iterations{400};
  double tolerance{1e-7};  ///< of the scaled optimality error
  double seconds{30};      ///< budget of CPU time
  bool warm{false};        ///< the start is near a solution: begin with a small barrier
};

enum class ProgramOutcome {
  solved,
  infeasible,  ///< converged to a point that violates the constraints least
  iterations_spent,
  time_spent,
  failed,  ///< the functions could not be evaluated, or the linear algebra broke down
};
const char* to_string(ProgramOutcome);

struct ProgramSummary {
  ProgramOutcome outcome{ProgramOutcome::failed};
  std::vector<double> x;
  double objective{};
  double violation{};  ///< largest of the constraints, in their own units
  int iterations{};
  double seconds{};  ///< of CPU time
};

/// Solves with IPOPT [WaechterBiegler2006], exact sparse Jacobian and Hessian. Throws std::invalid_argument
/// if bounds are empty or the start is not finite.
ProgramSummary solve(const NonlinearProgram& program, const ProgramOptions& options = {});

}  // namespace unhand::planners::elastic
