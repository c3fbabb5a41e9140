#include "fitting/discovery/footprint_columns.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/dense_solve.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

using dynamics::definite_solve, dynamics::eliminated, dynamics::inner_products, dynamics::product;
using dynamics::Effect;
using dynamics::EffectParameter;

namespace {

/// A one-sided footprint may change with the effect's size: it is taken at these, in typical steps.
constexpr std::array kSizes = {1.0, 6.0, 36.0};

/// All combinations of the shape parameters' grids.
std::vector<std::map<std::string, double>> shapes_of(const Effect& effect) {
  std::vector<std::map<std::string, double>> out{{}};
  for (const EffectParameter& p : effect.parameters) {
    if (!p.is_shape()) continue;
    std::vector<std::map<std::string, double>> next;
    for (const auto& shape : out)
      for (const double value : p.grid) {
        auto extended = shape;
        extended[effect.full_name(p)] = value;
        next.push_back(std::move(extended));
      }
    out = std::move(next);
  }
  return out;
}

}  // namespace

FootprintColumns::FootprintColumns(const CampaignProblem& problem, const FitResult& fit)
    : problem_(problem), fit_(fit), fitted_(problem.campaign().size()), width_(fitted_) {
  derivatives_.push_back({problem, fit.values(), {}});
  for (std::size_t k = 0; k < fitted_; ++k) derivatives_.front().columns.push_back({k, k});
}

void FootprintColumns::add_effects(const std::vector<std::string>& ids) {
  const auto& present = problem_.options().effects;
  std::vector<std::string> plain;
  for (const auto& id : ids) {
    if (std::find(present.begin(), present.end(), id) != present.end()) continue;
    const Effect effect = find_effect(id);
    const auto shapes = shapes_of(effect);
    if (!effect.one_sided && shapes.size() == 1) {
      plain.push_back(id);
      continue;
    }
    for (const auto& shape : shapes)
      for (const double size : kSizes) {
        add_alone(effect, shape, size);
        if (!effect.one_sided) break;  // derivatives have no size
      }
  }
  add_together(plain);
}

void FootprintColumns::add_law(const std::string& law) {
  if (law == problem_.options().model) return;
  CampaignProblem other = problem_.with(law, problem_.options().effects);
  auto at = carried(fit_, other);
  candidates_.push_back({std::string(kLaw) + law, {""}, {width_}, {}, {1}});
  differences_.push_back({std::move(other), std::move(at), 1, width_++});
}

void FootprintColumns::add_alone(const Effect& effect, const Shape& shape, double size) {
  auto effects = problem_.options().effects;
  effects.push_back(effect.id);
  CampaignProblem extended = problem_.with(problem_.options().model, effects);
  Derivatives derivatives{extended, carried(fit_, extended), {}};
  const auto shape_of = [&](std::size_t k) {
    return shape.find(without_object(extended.campaign()[k].name));
  };
  for (std::size_t k = fitted_; k < derivatives.at.size(); ++k)
    if (const auto found = shape_of(k); found != shape.end()) derivatives.at[k] = found->second;
  Candidate candidate{effect.id, {}, {}, shape, {}};
  for (std::size_t k = fitted_; k < derivatives.at.size(); ++k) {
    if (shape_of(k) != shape.end()) continue;
    const Unknown& u = extended.campaign()[k];
    const std::size_t column = add_column(candidate, u);
    if (!effect.one_sided) {
      derivatives.columns.push_back({k, column});
      continue;
    }
    Difference difference{extended, derivatives.at, std::min(size * u.scale, u.high - derivatives.at[k]),
                          column};
    difference.at[k] += difference.step;
    differences_.push_back(std::move(difference));
  }
  if (!effect.one_sided) derivatives_.push_back(std::move(derivatives));
  candidates_.push_back(std::move(candidate));
}

void FootprintColumns::add_together(const std::vector<std::string>& ids) {
  auto effects = problem_.options().effects;
  effects.insert(effects.end(), ids.begin(), ids.end());
  Derivatives& all = derivatives_.front();
  all.problem = problem_.with(problem_.options().model, effects);
  all.at = carried(fit_, all.problem);
  for (const auto& id : ids) {
    Candidate candidate{id, {}, {}, {}, {}};
    for (std::size_t k = fitted_; k < all.at.size(); ++k)
      if (all.problem.campaign()[k].name.starts_with(id + "."))
        all.columns.push_back({k, add_column(candidate, all.problem.campaign()[k])});
    candidates_.push_back(std::move(candidate));
  }
}

std::size_t FootprintColumns::add_column(Candidate& candidate, const Unknown& u) {
  candidate.parameters.push_back(u.name);
  candidate.columns.push_back(width_);
  candidate.sides.push_back(side_of(u.start, u.low, u.high));
  return width_++;
}

std::vector<double> FootprintColumns::Difference::own_of(const CampaignProblem& base,
                                                         const std::vector<double>& own) const {
  std::vector<double> out(problem.own().size(), 0.0);
  for (std::size_t k = 0; k < out.size(); ++k)
    for (std::size_t j = 0; j < own.size(); ++j)
      if (base.own()[j].name == problem.own()[k].name) out[k] = own[j];
  return out;
}

Eigen::VectorXd FootprintColumns::weights_of(const CampaignThrow& thrown, const Linearisation& l) const {
  Eigen::VectorXd out = Eigen::VectorXd::Ones(l.residual.size());
  if (!sample_limit_) return out;
  for (Eigen::Index j = 0; j < out.size(); ++j) {
    const auto& o = thrown.observed.all[static_cast<std::size_t>(j)];
    const double group = fit_.group_weight[group_of(part_of(o, thrown, l.detach), o.channel)],
                 size = group * std::abs(l.residual[j]);
    out[j] = group * (size > *sample_limit_ ? std::sqrt(*sample_limit_ / size) : 1);
  }
  return out;
}

FootprintColumns::Columns FootprintColumns::columns_of(const CampaignThrow& thrown,
                                                       const std::vector<double>& own) const {
  Columns out;
  for (const Derivatives& d : derivatives_) {
    const auto l = d.problem.linearise(thrown, d.at, own, DerivativesBy::all);
    if (!l.solved) return out;
    if (&d == &derivatives_.front()) {
      out.all.setZero(l.residual.size(), width());
      out.all.col(residual()) = l.residual;
      out.own = l.own;
      out.weight = weights_of(thrown, l);
    }
    for (const auto& [k, column] : d.columns)
      out.all.col(static_cast<Eigen::Index>(column)) = l.campaign.col(static_cast<Eigen::Index>(k));
  }
  out.solved = out.complete = true;
  for (const Difference& d : differences_) {
    const auto l = d.problem.linearise(thrown, d.at, d.own_of(problem_, own), DerivativesBy::nothing);
    out.complete = out.complete && l.solved;
    if (l.solved)
      out.all.col(static_cast<Eigen::Index>(d.column)) = (l.residual - out.all.col(residual())) / d.step;
  }
  out.all = out.weight.asDiagonal() * out.all;
  out.own = out.weight.asDiagonal() * out.own;
  return out;
}

FootprintColumns::Gram FootprintColumns::gram(const CampaignThrow& thrown,
                                              const std::vector<double>& own) const {
  const Columns columns = columns_of(thrown, own);
  if (!columns.solved) return {Eigen::MatrixXd::Zero(width(), width()), false, false};
  const auto products = throw_gram(columns.own, columns.all, own, fit_.own_spread);
  return {eliminated(products, columns.own.cols()), true, columns.complete};
}

Eigen::MatrixXd FootprintColumns::combined(const CampaignThrow& thrown, const std::vector<double>& own,
                                           const Eigen::MatrixXd& coefficients) const {
  const Columns columns = columns_of(thrown, own);
  if (!columns.solved) return {};
  Eigen::MatrixXd out = product(columns.all, coefficients), H = inner_products(columns.own, columns.own);
  for (Eigen::Index k = 0; k < H.rows(); ++k)
    H(k, k) +=
        1 / (fit_.own_spread[static_cast<std::size_t>(k)] * fit_.own_spread[static_cast<std::size_t>(k)]);
  out -= product(columns.own, definite_solve(H, inner_products(columns.own, out)));
  return columns.weight.cwiseInverse().asDiagonal() * out;
}

}  // namespace unhand::fitting
