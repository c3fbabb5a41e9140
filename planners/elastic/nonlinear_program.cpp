#include "planners/elastic/nonlinear_program.hpp"

#include <fmt/format.h>

#include <IpIpoptApplication.hpp>
#include <IpSolveStatistics.hpp>
#include <IpTNLP.hpp>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <stdexcept>

namespace unhand::planners::elastic {
namespace {

using Ipopt::Index;
using Ipopt::Number;

/// What IPOPT asks for, gathered from the terms.
class Gathered final : public Ipopt::TNLP {
 public:
  Gathered(const NonlinearProgram& program, ProgramSummary& summary) : program_(program), summary_(summary) {
    for (const auto& term : program.objective) list(*term, 0);
    for (const auto& one : program.constraints) list(*one.term, one.term->outputs());
    find_pattern();
  }

  bool get_nlp_info(Index& n, Index& m, Index& jacobian, Index& hessian, IndexStyleEnum& style) override {
    n = static_cast<Index>(program_.start.size());
    m = rows_;
    jacobian = jacobian_entries_;
    hessian = static_cast<Index>(rows_of_.size());
    style = C_STYLE;
    return true;
  }
  bool get_bounds_info(Index n, Number* low, Number* high, Index, Number* g_low, Number* g_high) override {
    std::copy_n(program_.lower.begin(), n, low);
    std::copy_n(program_.upper.begin(), n, high);
    for (const auto& one : program_.constraints) {
      g_low = std::copy(one.lower.begin(), one.lower.end(), g_low);
      g_high = std::copy(one.upper.begin(), one.upper.end(), g_high);
    }
    return true;
  }
  bool get_starting_point(Index n, bool, Number* x, bool, Number*, Number*, Index, bool, Number*) override {
    std::copy_n(program_.start.begin(), n, x);
    return true;
  }
  bool eval_f(Index, const Number* x, bool, Number& f) override {
    f = 0;
    double one = 0;
    for (const auto& term : program_.objective) {
      term->value(gather(*term, x), &one);
      f += one;
    }
    return std::isfinite(f);
  }
  bool eval_grad_f(Index n, const Number* x, bool, Number* gradient) override {
    std::fill_n(gradient, n, 0.0);
    for (const auto& term : program_.objective) {
      term->jacobian(gather(*term, x), jacobian_.data());
      for (std::size_t i = 0; i < term->variables().size(); ++i)
        gradient[term->variables()[i]] += jacobian_[i];
    }
    return true;
  }
  bool eval_g(Index, const Number* x, bool, Index m, Number* g) override {
    Number* at = g;
    for (const auto& one : program_.constraints) {
      one.term->value(gather(*one.term, x), at);
      at += one.term->outputs();
    }
    return std::all_of(g, g + m, [](double v) { return std::isfinite(v); });
  }
  bool eval_jac_g(Index, const Number* x, bool, Index, Index, Index* rows, Index* columns,
                  Number* values) override {
    Index row = 0;
    for (const auto& one : program_.constraints) {
      const auto& variables = one.term->variables();
      if (values) {
        one.term->jacobian(gather(*one.term, x), values);
        values += variables.size() * one.term->outputs();
      } else {
        for (int o = 0; o < one.term->outputs(); ++o)
          for (const int v : variables) *rows++ = row + o, *columns++ = v;
      }
      row += one.term->outputs();
    }
    return true;
  }
  bool eval_h(Index, const Number* x, bool, Number scale, Index, const Number* lambda, bool, Index entries,
              Index* rows, Index* columns, Number* values) override {
    if (!values) {
      std::copy_n(rows_of_.begin(), entries, rows);
      std::copy_n(columns_of_.begin(), entries, columns);
      return true;
    }
    for (const Curved& one : curved_) {
      one.term->hessian(gather(*one.term, x), one.row < 0 ? &scale : lambda + one.row, packed_.data());
      for (const int k : one.kept) *values++ = packed_[k];
    }
    return true;
  }
  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* x, const Number*, const Number*, Index m,
                         const Number* g, const Number*, Number f, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    summary_.x.assign(x, x + n);
    summary_.objective = f;
    summary_.violation = 0;
    int row = 0;
    for (const auto& one : program_.constraints)
      for (std::size_t i = 0; i < one.lower.size() && row < m; ++i, ++row)
        summary_.violation = std::max({summary_.violation, one.lower[i] - g[row], g[row] - one.upper[i]});
  }

 private:
  struct Curved {
    const Term* term;
    int row;                ///< the first of its rows; −1: it belongs to the objective
    std::vector<int> kept;  ///< entries of the packed Hessian that are not zero by structure
  };

  void list(const Term& term, int outputs) {
    const int n = static_cast<int>(term.variables().size());
    curved_.push_back({&term, outputs > 0 ? rows_ : -1, {}});
    rows_ += outputs;
    jacobian_entries_ += n * outputs;
    local_.resize(std::max<std::size_t>(local_.size(), n));
    jacobian_.resize(std::max<std::size_t>(jacobian_.size(), n));
    packed_.resize(std::max<std::size_t>(packed_.size(), n * (n + 1) / 2));
  }

  /// An entry of the Hessian that is exactly zero at two points chosen without any relation is zero by
  /// structure.
  void find_pattern() {
    std::vector<double> weight(16, 1.0);
    for (Curved& one : curved_) {
      const auto& variables = one.term->variables();
      const int n = static_cast<int>(variables.size());
      std::vector<char> present(n * (n + 1) / 2);
      for (int trial = 0; trial < 2; ++trial) {
        for (int i = 0; i < n; ++i)
          local_[i] = 0.37 + 0.61 * std::fmod((i + 1) * 0.6180339887 + 0.27 * trial, 1.0);
        one.term->hessian(local_.data(), weight.data(), packed_.data());
        for (std::size_t k = 0; k < present.size(); ++k) present[k] |= packed_[k] != 0;
      }
      for (int i = 0, k = 0; i < n; ++i)
        for (int j = 0; j <= i; ++j, ++k)
          if (present[k]) {
            one.kept.push_back(k);
            rows_of_.push_back(std::max(variables[i], variables[j]));
            columns_of_.push_back(std::min(variables[i], variables[j]));
          }
    }
    std::erase_if(curved_, [](const Curved& one) { return one.kept.empty(); });
  }

  const double* gather(const Term& term, const Number* x) {
    for (std::size_t i = 0; i < term.variables().size(); ++i) local_[i] = x[term.variables()[i]];
    return local_.data();
  }

  const NonlinearProgram& program_;
  ProgramSummary& summary_;
  std::vector<Curved> curved_;
  std::vector<int> rows_of_, columns_of_;
  std::vector<double> local_, jacobian_, packed_;
  int rows_{}, jacobian_entries_{};
};

/// Of this thread.
double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void check(const NonlinearProgram& p) {
  for (std::size_t i = 0; i < p.start.size(); ++i)
    if (!std::isfinite(p.start[i]) || !(p.lower[i] <= p.upper[i]))
      throw std::invalid_argument(fmt::format("nonlinear program: variable {} starts at {} in [{}, {}]", i,
                                              p.start[i], p.lower[i], p.upper[i]));
}

}  // namespace

int NonlinearProgram::add_variable(double low, double high, double first) {
  lower.push_back(low);
  upper.push_back(high);
  start.push_back(std::clamp(first, low, high));
  return static_cast<int>(start.size()) - 1;
}

ProgramSummary solve(const NonlinearProgram& program, const ProgramOptions& options) {
  check(program);
  ProgramSummary summary;
  const double begin = cpu_seconds();
  Ipopt::SmartPtr<Ipopt::TNLP> gathered = new Gathered(program, summary);
  Ipopt::SmartPtr<Ipopt::IpoptApplication> app = new Ipopt::IpoptApplication(false);
  const auto set = app->Options();
  set->SetIntegerValue("print_level", 0);
  set->SetStringValue("sb", "yes");
  set->SetIntegerValue("max_iter", options.iterations);
  set->SetNumericValue("tol", options.tolerance);
  set->SetNumericValue("max_cpu_time", options.seconds);
  set->SetStringValue("linear_solver", "mumps");
  set->SetNumericValue("bound_relax_factor", 0.0);  // no limit is exceeded, not even by 1e-8
  set->SetStringValue("mu_strategy", "adaptive");
  if (options.warm) {
    set->SetStringValue("mu_strategy", "monotone");
    set->SetNumericValue("mu_init", 1e-4);
    set->SetNumericValue("bound_push", 1e-6);
    set->SetNumericValue("bound_frac", 1e-6);
  }
  if (app->Initialize() != Ipopt::Solve_Succeeded)
    throw std::runtime_error("nonlinear program: IPOPT does not start");
  const Ipopt::ApplicationReturnStatus status = app->OptimizeTNLP(gathered);
  switch (status) {
    case Ipopt::Solve_Succeeded:
    case Ipopt::Solved_To_Acceptable_Level:
      summary.outcome = ProgramOutcome::solved;
      break;
    case Ipopt::Infeasible_Problem_Detected:
      summary.outcome = ProgramOutcome::infeasible;
      break;
    case Ipopt::Maximum_Iterations_Exceeded:
      summary.outcome = ProgramOutcome::iterations_spent;
      break;
    case Ipopt::Maximum_CpuTime_Exceeded:
      summary.outcome = ProgramOutcome::time_spent;
      break;
    default:
      summary.outcome = ProgramOutcome::failed;
  }
  summary.seconds = cpu_seconds() - begin;
  return summary;
}

}  // namespace unhand::planners::elastic
