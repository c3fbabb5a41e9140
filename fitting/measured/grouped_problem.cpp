#include "fitting/measured/grouped_problem.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "fitting/discovery/held_out_split.hpp"
#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

using Eigen::Index;

namespace {

/// "id.parameter[object]"
std::string of_object(const std::string& id, const std::string& parameter, const std::string& object) {
  return fmt::format("{}.{}[{}]", id, parameter, object);
}

}  // namespace

GroupMotion GroupedProblem::motion(std::size_t, std::span<const std::string>, std::span<const double>,
                                   const Eigen::VectorXd&) const {
  return {};
}

Eigen::VectorXd GroupedProblem::response(std::size_t group, const std::vector<flight::Vec3<double>>&) const {
  return Eigen::VectorXd::Zero(static_cast<Index>(groups_[group].rows.size()));
}

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

double Group::taken() const {
  const auto priors = std::count_if(rows.begin(), rows.end(),
                                    [](const GroupRow& row) { return row.channel == kPriorChannel; });
  return std::max(0.0, static_cast<double>(start.size()) - static_cast<double>(priors));
}

std::vector<datasets::Split> splits_of(const datasets::ThrowLog& log) {
  const bool both = has_both_splits(log);
  std::vector<datasets::Split> out(log.throws.size(), datasets::Split::train);
  std::map<std::pair<std::string, std::string>, std::vector<std::size_t>> conditions;  // of each object
  for (std::size_t i = 0; i < out.size(); ++i) {
    conditions[{log.throws[i].object, log.throws[i].condition}].push_back(i);
    if (both) out[i] = log.throws[i].split;
  }
  if (both) return out;
  int seen = 0;  // on from condition to condition, since each may have few
  for (const auto& [condition, throws] : conditions)
    for (const std::size_t i : throws)
      if (++seen % 5 == 0) out[i] = datasets::Split::test;
  return out;
}

void GroupedProblem::set_aside(const std::vector<std::size_t>& which) {
  for (Group& group : groups_) group.set_aside = false;
  for (const std::size_t i : held_out_instead_) groups_[i].split = datasets::Split::train;
  held_out_instead_.clear();
  for (const std::size_t i : which) groups_[i].set_aside = true;
  for (const std::size_t i : which)
    if (groups_[i].split == datasets::Split::test) hold_out_in_place_of(i);
}

void GroupedProblem::hold_out_in_place_of(std::size_t group) {
  const Group& gone = groups_[group];
  const auto fits = [&](const Group& g, int strictness) {
    return g.split == datasets::Split::train && !g.set_aside &&
           (strictness < 2 || g.condition == gone.condition) && (strictness < 1 || g.object == gone.object);
  };
  for (int strictness = 2; strictness >= 0; --strictness)
    for (std::size_t k = 1; k < groups_.size(); ++k) {
      const std::size_t i = (group + k) % groups_.size();
      if (!fits(groups_[i], strictness)) continue;
      groups_[i].split = datasets::Split::test;
      held_out_instead_.push_back(i);
      return;
    }
}

double GroupedProblem::declared(const std::string& name) const {
  const auto it = declared_.find(name);
  return it == declared_.end() ? 0 : it->second;
}

bool GroupedProblem::may_act(const std::string& id, const std::vector<std::string>& others) const {
  const auto all = effects();
  const auto effect = std::find_if(all.begin(), all.end(), [&](const auto& e) { return e.id == id; });
  if (effect == all.end() || !effect->anisotropy) return true;
  const dynamics::Anisotropy& shape = *effect->anisotropy;
  if (std::find(others.begin(), others.end(), shape.of) != others.end()) return true;
  for (const auto& object : objects_of(*this))
    if (!(declared(of_object(shape.of, shape.parameter, object)) > 0)) return false;
  return true;
}

bool GroupedProblem::may_be(const GroupedFit& fit) const {
  const auto objects = objects_of(*this);
  for (const auto& effect : effects())
    if (effect.anisotropy)
      for (const auto& object : objects)
        if (!may_be(fit, effect, object)) return false;
  return true;
}

bool GroupedProblem::may_be(const GroupedFit& fit, const dynamics::Effect& effect,
                            const std::string& object) const {
  const dynamics::Anisotropy& shape = *effect.anisotropy;
  const std::string whole = of_object(shape.of, shape.parameter, object);
  const auto names = fit.names();
  // The weights of the fitted parameters along each axis.
  Eigen::MatrixXd along = Eigen::MatrixXd::Zero(3, fit.values.size());
  bool is_fitted = false;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto column = static_cast<Index>(i);
    if (names[i] == whole) along.col(column).setOnes();
    for (const auto& [parameter, weights] : shape.weights)
      if (names[i] == of_object(effect.id, parameter, object))
        along.col(column) = Eigen::Vector3d(weights.data()), is_fitted = true;
  }
  for (Index axis = 0; is_fitted && axis < 3; ++axis) {
    const double value = declared(whole) + along.row(axis).dot(fit.values),
                 variance = along.row(axis).dot(fit.covariance * along.row(axis).transpose());
    if (value + 2 * std::sqrt(std::max(0.0, variance)) < 0) return false;
  }
  return true;
}

}  // namespace unhand::fitting
