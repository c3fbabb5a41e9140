#include "fitting/measured/grouped_fit.hpp"

#include "dynamics/dense_solve.hpp"
#include "fitting/measured/grouped_solver.hpp"
#include "fitting/measured/grouped_weights.hpp"

namespace unhand::fitting {

using dynamics::inner_products, dynamics::least_squares, dynamics::orthonormal_basis, dynamics::product;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<std::string> GroupedFit::names() const {
  std::vector<std::string> out;
  for (const auto& p : shared) out.push_back(p.name);
  return out;
}

std::vector<std::size_t> GroupedFit::solved_groups() const {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (groups[i].used && groups[i].solved) out.push_back(i);
  return out;
}

namespace {

/// Every group of the split, from its start or from where it was in `near`.
GroupedFit begin(const GroupedProblem& problem, datasets::Split split, const GroupedFit* near) {
  GroupedFit fit;
  fit.groups.resize(problem.groups().size());
  for (std::size_t i = 0; i < fit.groups.size(); ++i) {
    const Group& g = problem.groups()[i];
    fit.groups[i].used = g.split == split && !g.set_aside;
    fit.groups[i].own =
        near && near->groups[i].used && near->groups[i].solved
            ? near->groups[i].own
            : VectorXd(Eigen::Map<const VectorXd>(g.start.data(), static_cast<Index>(g.start.size())));
  }
  return fit;
}

}  // namespace

GroupedFit fit_groups(const GroupedProblem& problem, datasets::Split split,
                      const std::vector<SharedParameter>& shared, const VectorXd& values,
                      const GroupedFitOptions& options, const GroupedFit* near) {
  GroupedFit fit = begin(problem, split, near);
  fit.shared = shared;
  fit.values = values;
  solve_groups(problem, fit, options);
  return fit;
}

namespace {

/// The same problem with its shared parameters at fixed values.
class Held final : public GroupedProblem {
 public:
  Held(const GroupedProblem& problem, const GroupedFit& fit) : problem_(problem), names_(fit.names()) {
    groups_ = problem.groups();
    channels_ = problem.channels();
    values_.assign(fit.values.data(), fit.values.data() + fit.values.size());
  }
  std::vector<dynamics::Effect> effects() const override { return {}; }
  GroupEquations equations(std::size_t group, std::span<const std::string>, std::span<const double>,
                           const VectorXd& own, Derivatives derivatives) const override {
    auto out = problem_.equations(group, names_, values_, own,
                                  derivatives == Derivatives::all ? Derivatives::own : derivatives);
    out.shared = MatrixXd::Zero(out.residual.size(), 0);
    return out;
  }

 private:
  const GroupedProblem& problem_;
  std::vector<std::string> names_;
  std::vector<double> values_;
};

}  // namespace

GroupedFit fit_own(const GroupedProblem& problem, datasets::Split split, const GroupedFit& fit,
                   const GroupedFitOptions& options, const GroupedFit* near) {
  const Held held(problem, fit);
  GroupedFit out = begin(problem, split, near);
  solve_groups(held, out, options);
  out.shared = fit.shared;
  out.values = fit.values;
  out.covariance = fit.covariance;
  return out;
}

GroupFit fit_own_part(const GroupedProblem& problem, std::size_t group, const GroupedFit& fit,
                      const std::function<bool(const GroupRow&)>& use) {
  const Group& g = problem.groups()[group];
  const auto names = fit.names();
  const std::vector<double> values(fit.values.data(), fit.values.data() + fit.values.size());
  GroupFit out = fit.groups[group];
  if (out.own.size() == 0)
    out.own = Eigen::Map<const VectorXd>(g.start.data(), static_cast<Index>(g.start.size()));
  std::vector<Index> rows;
  for (std::size_t i = 0; i < g.rows.size(); ++i)
    if (g.rows[i].channel == kPriorChannel || use(g.rows[i])) rows.push_back(static_cast<Index>(i));
  VectorXd counts = VectorXd::Ones(static_cast<Index>(rows.size()));
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (g.rows[static_cast<std::size_t>(rows[k])].channel == kPriorChannel)
      counts[static_cast<Index>(k)] = fit.weights.prior;
  out.solved = false;
  for (int k = 0; k < 8; ++k) {
    const auto e = problem.equations(group, names, values, out.own, Derivatives::own);
    if (!e.solved) return out;
    const MatrixXd O = counts.asDiagonal() * e.own(rows, Eigen::all);
    const VectorXd r = counts.cwiseProduct(e.residual(rows)), step = least_squares(O, -r);
    out.own += step;
    if ((O * step).squaredNorm() < 1e-8) break;
  }
  const auto e = problem.equations(group, names, values, out.own, Derivatives::none);
  out.residual = e.residual;
  out.solved = e.solved;
  return out;
}

ProjectedEquations projected(const GroupedProblem& problem, std::size_t group,
                             std::span<const std::string> names, std::span<const double> values,
                             const VectorXd& own, const GroupedWeights& weights, double sample_limit) {
  auto e = problem.equations(group, names, values, own, Derivatives::all);
  return e.solved ? projected(std::move(e), problem.groups()[group], weights, sample_limit)
                  : ProjectedEquations{};
}

ProjectedEquations projected(GroupEquations e, const Group& group, const GroupedWeights& weights,
                             double sample_limit) {
  ProjectedEquations out;
  weigh_rows(e, group, weights, sample_limit);
  MatrixXd columns(e.residual.size(), e.shared.cols() + 1);
  columns << e.shared, e.residual;
  out.own_basis = orthonormal_basis(e.own);
  const MatrixXd along = inner_products(out.own_basis, columns);
  out.columns = columns - product(out.own_basis, along);
  out.solved = true;
  return out;
}

std::vector<GroupedMisfit> misfit(const GroupedProblem& problem, const GroupedFit& fit,
                                  const GroupedWeights* weights) {
  std::vector<GroupedMisfit> out;
  for (const auto& name : problem.channels()) out.push_back({name, 0, 0, 0});
  for (const std::size_t i : fit.solved_groups()) {
    const GroupFit& g = fit.groups[i];
    for (Index j = 0; j < g.residual.size(); ++j)
      if (const int c = problem.groups()[i].rows[static_cast<std::size_t>(j)].channel; c >= 0) {
        GroupedMisfit& of = out[static_cast<std::size_t>(c)];
        const double weight = weights ? weights->group[i] : 1.0;
        of.n += 1, of.weight += weight;
        of.chi2 += weight * g.residual[j] * g.residual[j];
      }
  }
  return out;
}

}  // namespace unhand::fitting
