#include "fitting/measured/grouped_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"
#include "fitting/measured/grouped_weights.hpp"
#include "fitting/scatter_covariance.hpp"

namespace unhand::fitting {

using dynamics::gram, dynamics::least_squares, dynamics::product, dynamics::pseudo_solve;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Steps on one linear model: samples that count linearly (Huber's) make it converge by a factor a step.
constexpr int kModelSteps = 100;

/// One group's equations, its own unknowns projected out.
struct Part {
  bool solved{}, quadratic{};  // quadratic: every row counts fully
  double cost{};
  MatrixXd information;  // shared
  VectorXd score;
  MatrixXd own_per_shared;  // change of own for a change of shared
  VectorXd own_step;
};

/// A step of a group's own unknowns.
struct OwnStep {
  VectorXd from, change;
  double cost{};  // of the group, before it
};

/// Gauss-Newton over the groups. Equations are dear and weights are not: each linear model is followed to its
/// own minimum, with its rows weighed again and again, before the equations are asked for there.
class Solver {
 public:
  Solver(const GroupedProblem& problem, GroupedFit& fit, const GroupedFitOptions& options)
      : problem_(problem), fit_(fit), options_(options), names_(fit.names()) {
    for (std::size_t i = 0; i < fit.groups.size(); ++i)
      if (fit.groups[i].used) used_.push_back(i);
    linearise();
  }

  /// To a minimum at the fit's weights.
  void descend() {
    project();
    double cost = total();
    for (int k = 0; k < options_.iterations; ++k) {
      ++fit_.iterations;
      std::vector<OwnStep> own;
      for (std::size_t n = 0; n < used_.size(); ++n)
        own.push_back({fit_.groups[used_[n]].own, {}, parts_[n].cost});
      const VectorXd values = fit_.values;
      const double little = 1e-9 * cost + 1e-9, promised = cost - follow_model(cost, little);
      if (std::abs(promised) <= little) break;  // so near, the model is the truth
      const VectorXd step = fit_.values - values;
      for (std::size_t n = 0; n < used_.size(); ++n) own[n].change = fit_.groups[used_[n]].own - own[n].from;
      // Groups that do not solve drop out of the sum; a step is halved until the sum falls.
      double factor = 1, moved = cost;
      bool better = false;
      for (int halving = 0; halving < 10 && promised > 0 && !better; ++halving, factor *= 0.5) {
        fit_.values = values + factor * step;
        moved = try_step(own, factor);
        better = moved <= cost * (1 + 1e-12);
      }
      if (!better) {
        fit_.values = values;
        for (std::size_t n = 0; n < used_.size(); ++n) fit_.groups[used_[n]].own = own[n].from;
      }
      linearise();
      project();
      if (!better || cost - moved <= little) break;
      cost = total();
    }
  }

  /// The residuals at the solution, and the shared parameters' covariance.
  void finish() {
    fit_.chi2 = 0, fit_.samples = 0, fit_.used = 0;
    double unknowns = static_cast<double>(fit_.values.size());
    const Index p = fit_.values.size();
    MatrixXd A = MatrixXd::Zero(p, p);
    std::vector<Cluster> clusters;
    for (std::size_t n = 0; n < used_.size(); ++n) {
      GroupFit& g = fit_.groups[used_[n]];
      const Group& group = problem_.groups()[used_[n]];
      g.solved = parts_[n].solved;
      if (!g.solved) continue;
      g.residual = equations_[n].residual;
      g.chi2 = 0, g.n = 0;
      for (Index i = 0; i < g.residual.size(); ++i)
        if (group.rows[static_cast<std::size_t>(i)].channel >= 0)
          g.chi2 += g.residual[i] * g.residual[i], ++g.n;
      const double w = fit_.weights.group[used_[n]];
      fit_.chi2 += g.chi2;
      fit_.samples += g.n;
      unknowns += group.taken();
      ++fit_.used;
      clusters.push_back({w * parts_[n].information, w * parts_[n].score});
      A += clusters.back().information;
    }
    fit_.degrees_of_freedom = fit_.samples - static_cast<long>(unknowns);
    fit_.solved = fit_.used > 0;
    if (p == 0) return;
    // Of a direction that no group sees nothing is known but the range.
    MatrixXd prior = MatrixXd::Zero(p, p);
    for (Index j = 0; j < p; ++j) {
      const SharedParameter& s = fit_.shared[static_cast<std::size_t>(j)];
      prior(j, j) = 12 / std::pow(s.high - s.low, 2);
    }
    const auto scatter = borrowing_scatter(clusters, A, prior);
    fit_.covariance = scatter.covariance;
    fit_.freedom = scatter.degrees_of_freedom;
    if (!fit_.covariance.allFinite())
      fit_.solved = false, fit_.message = "the shared parameters are not determined";
  }

 private:
  double total() const {
    double out = 0;
    for (std::size_t n = 0; n < used_.size(); ++n)
      if (parts_[n].solved) out += fit_.weights.group[used_[n]] * parts_[n].cost;
    return out;
  }

  /// The equations at the fit's values and own unknowns.
  void linearise() {
    equations_.resize(used_.size());
    const std::vector<double> values(fit_.values.data(), fit_.values.data() + fit_.values.size());
    dynamics::parallel_for(used_.size(), options_.threads, [&](std::size_t n) {
      equations_[n] = problem_.equations(used_[n], names_, values, fit_.groups[used_[n]].own,
                                         fit_.values.size() > 0 ? Derivatives::all : Derivatives::own);
    });
  }

  /// Weighs the model's rows, and takes out of them what the groups' own unknowns can do.
  void project() {
    parts_.assign(used_.size(), {});
    dynamics::parallel_for(used_.size(), options_.threads, [&](std::size_t n) { project(n); });
  }
  void project(std::size_t n) {
    Part& part = parts_[n];
    part.solved = false;
    if (!equations_[n].solved) return;
    const Group& group = problem_.groups()[used_[n]];
    GroupEquations e = equations_[n];
    part.cost = cost_of(e.residual, group, fit_.weights, options_.sample_limit);
    part.quadratic = is_quadratic(e.residual, group, fit_.weights, options_.sample_limit);
    weigh_rows(e, group, fit_.weights, options_.sample_limit);
    const Index p = e.shared.cols();
    MatrixXd columns(e.residual.size(), p + 1);
    columns << e.shared, e.residual;
    const MatrixXd own = least_squares(e.own, -columns);
    columns += product(e.own, own);
    const MatrixXd products = gram(columns);
    part.own_per_shared = own.leftCols(p);
    part.own_step = own.col(p);
    part.information = products.topLeftCorner(p, p);
    part.score = products.col(p).head(p);
    part.solved = own.allFinite();
  }

  /// Moves the fit to the minimum of the linear model, which has this cost, and returns the cost there.
  double follow_model(double cost, double little) {
    for (int k = 0; k < kModelSteps; ++k) {
      const VectorXd change = shared_step();
      fit_.values += change;
      dynamics::parallel_for(used_.size(), options_.threads, [&](std::size_t n) { move_group(n, change); });
      const double before = std::exchange(cost, total());
      if (before - cost <= little) break;
    }
    return cost;
  }
  void move_group(std::size_t n, const VectorXd& shared_change) {
    Part& part = parts_[n];
    if (!part.solved) return;
    GroupEquations& e = equations_[n];
    VectorXd own = part.own_step;
    if (shared_change.size() > 0) {
      own += part.own_per_shared * shared_change;
      e.residual += product(e.shared, shared_change);
    }
    e.residual += product(e.own, own);
    fit_.groups[used_[n]].own += own;
    const Group& group = problem_.groups()[used_[n]];
    if (!part.quadratic || !is_quadratic(e.residual, group, fit_.weights, options_.sample_limit))
      return project(n);
    // Its rows count as before: nothing is left for its own unknowns to do.
    part.cost = cost_of(e.residual, group, fit_.weights, options_.sample_limit);
    if (shared_change.size() > 0) part.score += part.information * shared_change;
    part.own_step.setZero();
  }

  /// To the minimum of the model in the shared parameters; those that want beyond their range go to its end.
  VectorXd shared_step() const {
    const Index p = fit_.values.size();
    MatrixXd A = MatrixXd::Zero(p, p);
    VectorXd b = VectorXd::Zero(p), step = b;
    for (std::size_t n = 0; n < used_.size(); ++n) {
      if (!parts_[n].solved) continue;
      const double w = fit_.weights.group[used_[n]];
      A += w * parts_[n].information;
      b += w * parts_[n].score;
    }
    std::vector<Index> free(static_cast<std::size_t>(p));
    std::iota(free.begin(), free.end(), Index{0});
    while (!free.empty()) {
      const VectorXd wanted = pseudo_solve(MatrixXd(A(free, free)), VectorXd(-(b + A * step)(free)));
      std::vector<Index> inside;
      VectorXd limited = step;
      for (std::size_t k = 0; k < free.size(); ++k) {
        const Index j = free[k];
        const SharedParameter& s = fit_.shared[static_cast<std::size_t>(j)];
        const double value = fit_.values[j] + wanted[static_cast<Index>(k)];
        limited[j] = std::clamp(value, s.low, s.high) - fit_.values[j];
        if (value >= s.low && value <= s.high) inside.push_back(j);
      }
      if (inside.size() == free.size()) return limited;
      for (const Index j : inside) limited[j] = 0;  // asked again beside those at their ends
      step = limited;
      free = inside;
    }
    return step;
  }

  /// The cost at the fit's values after a part of every group's own step.
  double try_step(const std::vector<OwnStep>& own, double factor) {
    std::vector<double> costs(used_.size(), 0.0);
    const std::vector<double> values(fit_.values.data(), fit_.values.data() + fit_.values.size());
    dynamics::parallel_for(used_.size(), options_.threads, [&](std::size_t n) {
      if (!parts_[n].solved) return;
      GroupFit& g = fit_.groups[used_[n]];
      const Group& group = problem_.groups()[used_[n]];
      const double w = fit_.weights.group[used_[n]];
      VectorXd change = factor * own[n].change;
      // A group alone may overshoot: it goes as far as it gains.
      for (int halving = 0; halving < 6; ++halving, change *= 0.5) {
        g.own = own[n].from + change;
        const auto e = problem_.equations(used_[n], names_, values, g.own, Derivatives::none);
        costs[n] = e.solved ? w * cost_of(e.residual, group, fit_.weights, options_.sample_limit)
                            : std::numeric_limits<double>::infinity();
        if (!values.empty() ? e.solved : costs[n] <= w * own[n].cost) break;
        if (halving == 5) g.own = own[n].from, costs[n] = w * own[n].cost;
      }
    });
    double out = 0;
    for (const double c : costs) out += c;
    return out;
  }

  const GroupedProblem& problem_;
  GroupedFit& fit_;
  const GroupedFitOptions& options_;
  std::vector<std::string> names_;
  std::vector<std::size_t> used_;
  std::vector<GroupEquations> equations_;  // of the groups used, before weighing; residuals on the model
  std::vector<Part> parts_;
};

}  // namespace

void solve_groups(const GroupedProblem& problem, GroupedFit& fit, const GroupedFitOptions& options) {
  if (fit.weights.group.empty()) fit.weights = neutral_weights(problem);
  Solver solver(problem, fit, options);
  for (int round = 0; round < (options.robust ? 2 : 1); ++round) {
    solver.descend();
    solver.finish();
    if (!fit.solved) return;
    if (round == 0 && options.robust) fit.weights = learned_weights(problem, fit, options);
  }
}

}  // namespace unhand::fitting
