#include "fitting/measured/grouped_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"
#include "fitting/measured/grouped_weights.hpp"

namespace unhand::fitting {

using dynamics::congruent, dynamics::gram, dynamics::least_squares, dynamics::product,
    dynamics::pseudo_inverse, dynamics::pseudo_solve;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// One group's equations, its own unknowns projected out.
struct Part {
  bool solved{};
  double cost{};
  MatrixXd information;  // shared
  VectorXd score;
  MatrixXd own_per_shared;  // change of own for a change of shared
  VectorXd own_step;
};

/// Gauss-Newton over the groups.
class Solver {
 public:
  Solver(const GroupedProblem& problem, GroupedFit& fit, const GroupedFitOptions& options)
      : problem_(problem), fit_(fit), options_(options), names_(fit.names()) {
    for (std::size_t i = 0; i < fit.groups.size(); ++i)
      if (fit.groups[i].used) used_.push_back(i);
  }

  void run() {
    linearise();
    double cost = total();
    for (int k = 0; k < options_.iterations; ++k) {
      ++fit_.iterations;
      const VectorXd step = shared_step();
      // Groups that do not solve drop out of the sum; a step is halved until the sum falls.
      std::vector<VectorXd> own;
      for (const std::size_t i : used_) own.push_back(fit_.groups[i].own);
      const VectorXd values = fit_.values;
      double factor = 1, moved = cost;
      bool better = false;
      for (int halving = 0; halving < 10 && !better; ++halving, factor *= 0.5) {
        fit_.values = values + factor * step;
        for (Index j = 0; j < step.size(); ++j)
          fit_.values[j] = std::clamp(fit_.values[j], fit_.shared[static_cast<std::size_t>(j)].low,
                                      fit_.shared[static_cast<std::size_t>(j)].high);
        moved = try_step(own, fit_.values - values, factor);
        better = moved <= cost * (1 + 1e-12);
      }
      if (!better) {
        fit_.values = values;
        for (std::size_t n = 0; n < used_.size(); ++n) fit_.groups[used_[n]].own = own[n];
        break;
      }
      const bool done = cost - moved <= 1e-9 * cost + 1e-9;
      linearise();
      cost = total();
      if (done) break;
    }
  }

  /// The residuals at the solution, and the shared parameters' covariance.
  void finish() {
    fit_.chi2 = 0, fit_.samples = 0, fit_.used = 0;
    long unknowns = fit_.values.size();
    const Index p = fit_.values.size();
    MatrixXd A = MatrixXd::Zero(p, p), B = MatrixXd::Zero(p, p);
    for (std::size_t n = 0; n < used_.size(); ++n) {
      GroupFit& g = fit_.groups[used_[n]];
      const Group& group = problem_.groups()[used_[n]];
      g.solved = parts_[n].solved;
      if (!g.solved) continue;
      g.chi2 = 0, g.n = 0;
      for (Index i = 0; i < g.residual.size(); ++i)
        if (group.rows[static_cast<std::size_t>(i)].channel >= 0)
          g.chi2 += g.residual[i] * g.residual[i], ++g.n;
      const double w = fit_.weights.group[used_[n]];
      fit_.chi2 += g.chi2;
      fit_.samples += g.n;
      unknowns += g.own.size();
      ++fit_.used;
      A += w * parts_[n].information;
      B += w * w * parts_[n].score * parts_[n].score.transpose();
    }
    for (std::size_t n = 0; n < used_.size(); ++n)  // what is known beforehand counts as measured
      for (const auto& row : problem_.groups()[used_[n]].rows)
        if (row.channel == kPriorChannel && fit_.groups[used_[n]].solved) --unknowns;
    fit_.degrees_of_freedom = fit_.samples - unknowns;
    fit_.solved = fit_.used > 0;
    if (p == 0) return;
    const MatrixXd inverse = pseudo_inverse(A);
    const double n = fit_.used;
    fit_.covariance = congruent(inverse, B) * (n / std::max(1.0, n - static_cast<double>(p)));
    VectorXd widened = VectorXd::Ones(p);  // no parameter is surer than independent noise would let it be
    for (Index j = 0; j < p; ++j)
      if (fit_.covariance(j, j) < inverse(j, j))
        widened[j] = std::sqrt(inverse(j, j) / std::max(1e-300, fit_.covariance(j, j)));
    fit_.covariance = widened.asDiagonal() * fit_.covariance * widened.asDiagonal();
    // Of a direction that no group sees nothing is known but the range.
    const MatrixXd unseen = MatrixXd::Identity(p, p) - product(inverse, A);
    VectorXd range(p);
    for (Index j = 0; j < p; ++j) {
      const SharedParameter& s = fit_.shared[static_cast<std::size_t>(j)];
      range[j] = std::pow(s.high - s.low, 2) / 12;
    }
    if (unseen.diagonal().maxCoeff() > 1e-3)
      fit_.covariance += congruent(unseen, MatrixXd(range.asDiagonal()));
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

  void linearise() {
    parts_.assign(used_.size(), {});
    const std::vector<double> values(fit_.values.data(), fit_.values.data() + fit_.values.size());
    dynamics::parallel_for(used_.size(), options_.threads, [&](std::size_t n) {
      GroupFit& g = fit_.groups[used_[n]];
      const Group& group = problem_.groups()[used_[n]];
      Part& part = parts_[n];
      auto e = problem_.equations(used_[n], names_, values, g.own, true);
      if (!e.solved) return;
      g.residual = e.residual;
      part.cost = cost_of(e.residual, group, fit_.weights, options_.sample_limit);
      weigh_rows(e, group, fit_.weights, options_.sample_limit);
      const Index p = e.shared.cols();
      MatrixXd columns(e.residual.size(), p + 1);
      columns << e.shared, e.residual;
      const MatrixXd own = least_squares(e.own, -columns);
      columns += product(e.own, own);  // own unknowns projected out
      const MatrixXd products = gram(columns);
      part.own_per_shared = own.leftCols(p);
      part.own_step = own.col(p);
      part.information = products.topLeftCorner(p, p);
      part.score = products.col(p).head(p);
      part.solved = own.allFinite();
    });
  }

  VectorXd shared_step() const {
    const Index p = fit_.values.size();
    if (p == 0) return {};
    MatrixXd A = MatrixXd::Zero(p, p);
    VectorXd b = VectorXd::Zero(p);
    for (std::size_t n = 0; n < used_.size(); ++n) {
      if (!parts_[n].solved) continue;
      const double w = fit_.weights.group[used_[n]];
      A += w * parts_[n].information;
      b += w * parts_[n].score;
    }
    return pseudo_solve(A, -b);
  }

  /// The cost after a step of the shared parameters and of every group's own.
  double try_step(const std::vector<VectorXd>& own, const VectorXd& shared_change, double factor) {
    std::vector<double> costs(used_.size(), 0.0);
    const std::vector<double> values(fit_.values.data(), fit_.values.data() + fit_.values.size());
    dynamics::parallel_for(used_.size(), options_.threads, [&](std::size_t n) {
      if (!parts_[n].solved) return;
      GroupFit& g = fit_.groups[used_[n]];
      const Group& group = problem_.groups()[used_[n]];
      const double w = fit_.weights.group[used_[n]];
      VectorXd change = factor * parts_[n].own_step;
      if (shared_change.size() > 0) change += parts_[n].own_per_shared * shared_change;
      // A group alone may overshoot: it goes as far as it gains.
      for (int halving = 0; halving < 6; ++halving, change *= 0.5) {
        g.own = own[n] + change;
        const auto e = problem_.equations(used_[n], names_, values, g.own, false);
        costs[n] = e.solved ? w * cost_of(e.residual, group, fit_.weights, options_.sample_limit)
                            : std::numeric_limits<double>::infinity();
        if (shared_change.size() > 0 ? e.solved : costs[n] <= w * parts_[n].cost) break;
        if (halving == 5) g.own = own[n], costs[n] = w * parts_[n].cost;
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
  std::vector<Part> parts_;
};

}  // namespace

void solve_shared(const GroupedProblem& problem, GroupedFit& fit, const GroupedFitOptions& options) {
  Solver solver(problem, fit, options);
  solver.run();
  solver.finish();
}

}  // namespace unhand::fitting
