#include "fitting/discovery/footprints.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "experiment/parallel.hpp"
#include "fitting/dense_solve.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

using dynamics::Effect;
using dynamics::EffectParameter;

namespace {

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

template <class A, class B>
std::vector<std::pair<A, B>> pairs_of(const std::vector<A>& a, const std::vector<B>& b) {
  std::vector<std::pair<A, B>> out;
  for (const A& x : a)
    for (const B& y : b) out.push_back({x, y});
  return out;
}

/// A column that is a difference of two simulations.
struct Difference {
  CampaignProblem problem;
  std::vector<double> campaign;
  double step;
};

std::size_t index_of(const CampaignProblem& problem, const std::string& name) {
  for (std::size_t k = 0; k < problem.campaign().size(); ++k)
    if (problem.campaign()[k].name == name) return k;
  return problem.campaign().size();
}

void add_column(Candidate& candidate, const Unknown& u, std::size_t column) {
  candidate.parameters.push_back(u.name);
  candidate.columns.push_back(column);
  candidate.sides.push_back(side_of(u.start, u.low, u.high));
}

}  // namespace

std::vector<double> carried(const FitResult& from, const CampaignProblem& to) {
  std::vector<double> out = to.start();
  for (std::size_t k = 0; k < out.size(); ++k)
    for (const auto& fitted : from.campaign)
      if (fitted.unknown.name == to.campaign()[k].name) out[k] = fitted.value;
  return out;
}

Footprints footprints(const CampaignProblem& problem, const FitResult& fit,
                      const std::vector<std::string>& ids, const std::vector<std::string>& laws,
                      int threads) {
  Footprints out;
  out.fitted = problem.campaign().size();
  std::size_t width = out.fitted;

  // Derivatives: one problem for each combination of shapes, all effects that have no shape in the first.
  struct Derivative {
    CampaignProblem problem;
    std::vector<double> campaign;
    std::vector<std::pair<std::size_t, std::size_t>> columns;  ///< unknown → Gram column
  };
  std::vector<Derivative> derivatives;
  std::vector<Difference> differences;
  std::vector<std::size_t> difference_columns;
  std::vector<std::string> plain;
  for (const auto& id : ids) {
    const auto& present = problem.options().effects;
    if (std::find(present.begin(), present.end(), id) != present.end()) continue;
    const Effect effect = find_effect(id);
    const auto shapes = shapes_of(effect);
    if (!effect.one_sided && shapes.size() == 1) {
      plain.push_back(id);
      continue;
    }
    auto effects = present;
    effects.push_back(id);
    // A one-sided footprint may change with the effect's size: it is taken at several.
    const std::vector<double> sizes =
        effect.one_sided ? std::vector<double>{1, 6, 36} : std::vector<double>{1};
    for (const auto& [shape, size] : pairs_of(shapes, sizes)) {
      Candidate candidate{id, {}, {}, shape, {}};
      CampaignProblem extended = problem.with(problem.options().model, effects);
      auto campaign = carried(fit, extended);
      for (const auto& [name, value] : shape) campaign[index_of(extended, name)] = value;
      Derivative derivative{extended, campaign, {}};
      for (std::size_t k = out.fitted; k < campaign.size(); ++k) {
        const std::string& name = extended.campaign()[k].name;
        if (shape.contains(without_object(name))) continue;
        add_column(candidate, extended.campaign()[k], width);
        if (effect.one_sided) {
          auto stepped = campaign;
          const Unknown& u = extended.campaign()[k];
          const double step = std::min(size * u.scale, u.high - campaign[k]);
          stepped[k] += step;
          differences.push_back({extended, stepped, step});
          difference_columns.push_back(width);
        } else {
          derivative.columns.push_back({k, width});
        }
        ++width;
      }
      if (!effect.one_sided) derivatives.push_back(std::move(derivative));
      out.candidates.push_back(std::move(candidate));
    }
  }
  auto effects = problem.options().effects;
  effects.insert(effects.end(), plain.begin(), plain.end());
  CampaignProblem extended = problem.with(problem.options().model, effects);
  Derivative all{extended, carried(fit, extended), {}};
  for (std::size_t k = 0; k < out.fitted; ++k) all.columns.push_back({k, k});
  for (const auto& id : plain) {
    Candidate candidate{id, {}, {}, {}, {}};
    for (std::size_t k = out.fitted; k < extended.campaign().size(); ++k) {
      const std::string& name = extended.campaign()[k].name;
      if (name.rfind(id + ".", 0) != 0) continue;
      add_column(candidate, extended.campaign()[k], width);
      all.columns.push_back({k, width});
      ++width;
    }
    out.candidates.push_back(std::move(candidate));
  }
  derivatives.insert(derivatives.begin(), std::move(all));
  for (const auto& law : laws) {
    if (law == problem.options().model) continue;
    out.candidates.push_back({std::string(kLaw) + law, {""}, {width}, {}, {1}});
    CampaignProblem other = problem.with(law, problem.options().effects);
    auto campaign = carried(fit, other);
    differences.push_back({std::move(other), std::move(campaign), 1});
    difference_columns.push_back(width++);
  }
  const std::size_t residual = width++;

  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < fit.throws.size(); ++i)
    if (fit.throws[i].used) used.push_back(i);
  const auto w = static_cast<Eigen::Index>(width);
  std::vector<Eigen::MatrixXd> grams(used.size());
  experiment::parallel_for(used.size(), threads, [&](std::size_t n) {
    const std::size_t i = used[n];
    const auto& own = fit.throws[i].own;
    Eigen::MatrixXd columns, own_columns;
    bool solved = true;
    for (std::size_t d = 0; d < derivatives.size() && solved; ++d) {
      const auto& derivative = derivatives[d];
      const auto l =
          derivative.problem.linearise(derivative.problem.throws()[i], derivative.campaign, own, true);
      solved = l.solved;
      if (!solved) break;
      if (d == 0) {
        columns.setZero(l.residual.size(), w);
        columns.col(static_cast<Eigen::Index>(residual)) = l.residual;
        own_columns = l.own;
      }
      for (const auto& [k, column] : derivative.columns)
        columns.col(static_cast<Eigen::Index>(column)) = l.campaign.col(static_cast<Eigen::Index>(k));
    }
    for (std::size_t d = 0; d < differences.size() && solved; ++d) {
      const auto& difference = differences[d];
      const auto l =
          difference.problem.linearise(difference.problem.throws()[i], difference.campaign, own, false);
      if (l.solved)
        columns.col(static_cast<Eigen::Index>(difference_columns[d])) =
            (l.residual - columns.col(static_cast<Eigen::Index>(residual))) / difference.step;
    }
    grams[n].setZero(w, w);
    if (!solved) return;
    grams[n] = eliminated(throw_gram(own_columns, columns, own, fit.own_spread), own_columns.cols());
  });
  out.gram.setZero(w, w);
  for (const auto& gram : grams) out.gram += gram;
  for (const std::size_t i : used)
    out.samples += static_cast<double>(problem.throws()[i].observed.all.size());
  return out;
}

namespace {

/// The Gram matrix of `kept` columns after `removed` ones are projected out; a column that keeps less than
/// 1e-6 of its norm is set to zero.
Eigen::MatrixXd project(const Eigen::MatrixXd& gram, const std::vector<Eigen::Index>& removed,
                        const std::vector<Eigen::Index>& kept) {
  Eigen::MatrixXd G = gram(kept, kept);
  if (!removed.empty()) {
    Eigen::MatrixXd R = gram(removed, removed);
    const Eigen::VectorXd unit = R.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    R = unit.asDiagonal() * R * unit.asDiagonal();
    R.diagonal().array() += 1e-12;
    const Eigen::MatrixXd cross = unit.asDiagonal() * Eigen::MatrixXd(gram(removed, kept));
    G -= inner_products(cross, definite_solve(R, cross));
  }
  for (Eigen::Index k = 0; k < G.rows(); ++k)
    if (!(G(k, k) > 1e-6 * gram(kept[static_cast<std::size_t>(k)], kept[static_cast<std::size_t>(k)]))) {
      G.row(k).setZero();
      G.col(k).setZero();
    }
  return G;
}

std::vector<Eigen::Index> range(std::size_t n) {
  std::vector<Eigen::Index> out;
  for (std::size_t i = 0; i < n; ++i) out.push_back(static_cast<Eigen::Index>(i));
  return out;
}

}  // namespace

std::vector<Score> scores(const Footprints& f) {
  std::vector<Score> out;
  for (std::size_t c = 0; c < f.candidates.size(); ++c) {
    std::vector<Eigen::Index> kept;
    for (const std::size_t k : f.candidates[c].columns) kept.push_back(static_cast<Eigen::Index>(k));
    kept.push_back(static_cast<Eigen::Index>(f.residual()));
    const Eigen::MatrixXd G = project(f.gram, range(f.fitted), kept);
    const Eigen::Index n = G.rows() - 1;
    const Eigen::VectorXd b = -G.col(n).head(n),
                          x = pseudo_solve(G.topLeftCorner(n, n), b, f.candidates[c].sides);
    Score score;
    score.candidate = c;
    score.gain = b.dot(x);
    score.visible = G.diagonal().head(n).maxCoeff() > 0;
    score.step.assign(x.data(), x.data() + x.size());
    out.push_back(std::move(score));
  }
  return out;
}

namespace {

/// Cosine between Σ y_k column_k over `part` and the nearest that `other` can do, with `removed` projected
/// out.
double cosine(const Eigen::MatrixXd& gram, const std::vector<Eigen::Index>& removed,
              const std::vector<Eigen::Index>& part, const Eigen::VectorXd& y, const Candidate& other) {
  std::vector<Eigen::Index> kept = part;
  for (const std::size_t k : other.columns) kept.push_back(static_cast<Eigen::Index>(k));
  const Eigen::MatrixXd G = project(gram, removed, kept);
  const Eigen::Index n = y.size(), m = G.rows() - n;
  const double norm = y.dot(G.topLeftCorner(n, n) * y);
  if (!(norm > 0)) return 0;
  const Eigen::VectorXd b = G.bottomLeftCorner(m, n) * y;
  const double shared = b.dot(pseudo_solve(G.bottomRightCorner(m, m), b, other.sides));
  return std::sqrt(std::clamp(shared / norm, 0.0, 1.0));
}

}  // namespace

double correlation(const Footprints& f, const Eigen::VectorXd& contribution, const Candidate& candidate) {
  // Fitted columns that take part in the contribution are not projected out.
  std::vector<Eigen::Index> removed, part;
  for (Eigen::Index k = 0; k < contribution.size(); ++k) (contribution[k] != 0 ? part : removed).push_back(k);
  return cosine(f.gram, removed, part, contribution(part), candidate);
}

double between(const Footprints& f, const Candidate& a, const std::vector<double>& step, const Candidate& b) {
  std::vector<Eigen::Index> part;
  for (const std::size_t k : a.columns) part.push_back(static_cast<Eigen::Index>(k));
  const Eigen::Map<const Eigen::VectorXd> y(step.data(), static_cast<Eigen::Index>(step.size()));
  return cosine(f.gram, range(f.fitted), part, y, b);
}

}  // namespace unhand::fitting
