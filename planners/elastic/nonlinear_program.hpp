// Sparse nonlinear programs of small functions of few variables each, solved by an interior point.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "dynamics/scalar.hpp"
#include "planners/elastic/second_dual.hpp"

namespace unhand::planners::elastic {

/// A function of some of the program's variables.
class Term {
 public:
  /// `variables`: indices into the program's.
  explicit Term(std::vector<int> variables) : variables_(std::move(variables)) {}
  virtual ~Term() = default;

  /// Indices into the program's, in the order in which value() reads them.
  const std::vector<int>& variables() const { return variables_; }
  /// How many numbers value() writes.
  virtual int outputs() const = 0;
  /// f(x), x the values of `variables`.
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
  /// `variables` as many as Inputs.
  TermOf(std::vector<int> variables, Law law) : Term(std::move(variables)), law_(std::move(law)) {}

  /// As Term says.
  int outputs() const override { return Outputs; }
  /// As Term says.
  void value(const double* x, double* f) const override { law_(x, f); }
  void jacobian(const double* x, double* J) const override {
    using First = dynamics::DualOf<Inputs>;
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
  /// A term between bounds.
  struct Constraint {
    std::unique_ptr<Term> term;        ///< its outputs
    std::vector<double> lower, upper;  ///< one per output; ±1e19 and beyond: unbounded
  };

  /// Adds a variable and returns its index.
  int add_variable(double lower, double upper, double start);
  /// Adds a term of one output to the objective.
  void minimise(std::unique_ptr<Term> term) { objective.push_back(std::move(term)); }
  /// Adds a constraint, one bound per output.
  void constrain(std::unique_ptr<Term> term, std::vector<double> low, std::vector<double> high) {
    constraints.push_back({std::move(term), std::move(low), std::move(high)});
  }

  std::vector<double> lower, upper, start;       ///< of the variables; ±1e19 and beyond: unbounded
  std::vector<std::unique_ptr<Term>> objective;  ///< terms of one output each
  std::vector<Constraint> constraints;           ///< in order of their addition
};

/// Tolerance and budgets.
struct ProgramOptions {
  int iterations{400};     ///< at most
  double tolerance{1e-7};  ///< of the scaled optimality error
  double seconds{30};      ///< budget of CPU time
  bool warm{false};        ///< the start is near a solution: begin with a small barrier
};

/// How a program ended.
enum class ProgramOutcome {
  solved,            ///< `x` is a local minimum
  infeasible,        ///< converged to a point that violates the constraints least
  iterations_spent,  ///< more than the options allow
  time_spent,        ///< more CPU time than the options allow
  failed,            ///< the functions could not be evaluated, or the linear algebra broke down
};

/// The minimum, or how far it got.
struct ProgramSummary {
  ProgramOutcome outcome{ProgramOutcome::failed};  ///< only `solved` has a minimum
  std::vector<double> x;                           ///< the program's variables
  double objective{};                              ///< there
  double violation{};                              ///< largest of the constraints, in their own units
  double seconds{};                                ///< of CPU time
};

/// Solves with IPOPT [WaechterBiegler2006], exact sparse Jacobian and Hessian. Throws std::invalid_argument
/// if bounds are empty or the start is not finite.
ProgramSummary solve(const NonlinearProgram& program, const ProgramOptions& options = {});

}  // namespace unhand::planners::elastic
