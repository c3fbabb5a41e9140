#include "fitting/measured/grouped_problem.hpp"

#include <map>
#include <set>

namespace unhand::fitting {

using Eigen::Index;

std::vector<std::string> objects_of(const GroupedProblem& problem) {
  std::set<std::string> out;
  for (const auto& g : problem.groups()) out.insert(g.object);
  return {out.begin(), out.end()};
}

std::vector<SharedParameter> shared_parameters(const dynamics::Effect& effect,
                                               const std::vector<std::string>& objects) {
  std::vector<SharedParameter> out;
  for (const auto& p : effect.parameters)
    for (const auto& object : effect.per_object ? objects : std::vector<std::string>{""}) {
      const std::string suffix = object.empty() ? "" : "[" + object + "]";
      out.push_back({effect.full_name(p) + suffix, effect.id, p.name + suffix, p.unit, p.neutral, p.low,
                     p.high, p.typical, p.is_shape()});
    }
  return out;
}

OwnNames::OwnNames(std::span<const std::string> all, const std::string& object) {
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto bracket = all[k].find('[');
    if (bracket != std::string::npos && all[k].substr(bracket) != "[" + object + "]") continue;
    names.push_back(all[k].substr(0, bracket));
    from.push_back(k);
  }
}

std::vector<double> OwnNames::values(std::span<const double> all) const {
  std::vector<double> out;
  for (const std::size_t k : from) out.push_back(all[k]);
  return out;
}

void OwnNames::spread(GroupEquations& equations, std::size_t all) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(equations.residual.size(), static_cast<Index>(all));
  for (std::size_t k = 0; k < from.size(); ++k)
    out.col(static_cast<Index>(from[k])) = equations.shared.col(static_cast<Index>(k));
  equations.shared = std::move(out);
}

std::vector<datasets::Split> splits_of(const datasets::ThrowLog& log) {
  bool train = false, test = false;
  for (const auto& t : log.throws) (t.split == datasets::Split::train ? train : test) = true;
  std::vector<datasets::Split> out(log.throws.size(), datasets::Split::train);
  std::map<std::string, std::vector<std::size_t>> conditions;
  for (std::size_t i = 0; i < out.size(); ++i) {
    conditions[log.throws[i].condition].push_back(i);
    if (train && test) out[i] = log.throws[i].split;
  }
  if (train && test) return out;
  int seen = 0;  // on from condition to condition, since each may have few
  for (const auto& [condition, throws] : conditions)
    for (const std::size_t i : throws)
      if (++seen % 5 == 0) out[i] = datasets::Split::test;
  return out;
}

}  // namespace unhand::fitting
