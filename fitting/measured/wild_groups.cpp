#include "fitting/measured/wild_groups.hpp"

#include <utility>

#include "fitting/measured/grouped_footprints.hpp"

namespace unhand::fitting {

using datasets::Split;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

void add_parts(const GroupedProblem& problem, GroupedFit fit, const std::vector<dynamics::Effect>& effects,
               const GroupedFitOptions& options, std::vector<GroupFooting>& to) {
  if (!fit.solved) return;
  fit.weights.group.assign(fit.groups.size(), 1.0);
  auto f = grouped_footprints(problem, fit, effects, options);
  std::size_t at = 0;
  for (const std::size_t i : fit.solved_groups()) {
    MatrixXd& gram = f.parts[at++];
    const Index r = gram.rows() - 1;
    if (fit.groups[i].n > 0 && gram(r, r) > 0)
      to.push_back({i, problem.groups()[i].split == Split::train, static_cast<double>(fit.groups[i].n),
                    std::move(gram)});
  }
}

}  // namespace

std::vector<WildGroup> wild_groups(const GroupedProblem& problem,
                                   const std::vector<dynamics::Effect>& effects,
                                   const GroupedFitOptions& options) {
  std::vector<GroupFooting> parts;
  const GroupedFit base = fit_groups(problem, Split::train, {}, VectorXd(), options);
  add_parts(problem, base, effects, options, parts);
  add_parts(problem, fit_own(problem, Split::test, base, options), effects, options, parts);
  return gross_outliers(parts, options.group_limit);
}

std::vector<WildGroup> still_wild(const GroupedProblem& problem, const std::vector<WildGroup>& groups,
                                  const GroupedFit& answer, const GroupedFitOptions& options) {
  std::vector<GroupFooting> parts;
  for (const Split split : {Split::train, Split::test})
    add_parts(problem, fit_own(problem, split, answer, options), {}, options, parts);
  return still_gross(groups, parts, options.group_limit);
}

}  // namespace unhand::fitting
