#include "fitting/discovery/footprints.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"
#include "fitting/discovery/footprint_columns.hpp"

namespace unhand::fitting {

using dynamics::definite_solve, dynamics::inner_products, dynamics::product, dynamics::pseudo_solve;

std::vector<double> carried(const FitResult& from, const CampaignProblem& to) {
  std::vector<double> out = to.start();
  for (std::size_t k = 0; k < out.size(); ++k)
    for (const auto& fitted : from.campaign)
      if (fitted.unknown.name == to.campaign()[k].name) out[k] = fitted.value;
  return out;
}

Footprints footprints(const FootprintColumns& columns, const CampaignProblem& problem, const FitResult& fit,
                      int threads) {
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < fit.throws.size(); ++i)
    if (fit.throws[i].used) used.push_back(i);
  std::vector<Eigen::MatrixXd> grams(used.size());
  dynamics::parallel_for(used.size(), threads, [&](std::size_t n) {
    grams[n] = columns.gram(problem.throws()[used[n]], fit.throws[used[n]].own).products;
  });
  Footprints out;
  out.candidates = columns.candidates();
  out.fitted = columns.fitted();
  out.gram = Eigen::MatrixXd::Zero(columns.width(), columns.width());
  for (std::size_t n = 0; n < used.size(); ++n) out.gram += columns.weight_of(used[n]) * grams[n];
  for (const std::size_t i : used)
    out.samples += static_cast<double>(problem.throws()[i].observed.all.size());
  return out;
}

Footprints footprints(const CampaignProblem& problem, const FitResult& fit,
                      const std::vector<std::string>& ids, const std::vector<std::string>& laws,
                      int threads) {
  FootprintColumns columns(problem, fit);
  columns.add_effects(ids);
  for (const auto& law : laws) columns.add_law(law);
  return footprints(columns, problem, fit, threads);
}

std::vector<std::string> silent_ids(const Footprints& f) {
  const auto shows = [&](const Candidate& candidate) {
    return std::any_of(candidate.columns.begin(), candidate.columns.end(), [&](std::size_t k) {
      return f.gram(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k)) > 0;
    });
  };
  std::vector<std::string> out;
  for (const Candidate& candidate : f.candidates)
    if (std::none_of(f.candidates.begin(), f.candidates.end(),
                     [&](const Candidate& other) { return other.id == candidate.id && shows(other); }) &&
        std::find(out.begin(), out.end(), candidate.id) == out.end())
      out.push_back(candidate.id);
  return out;
}

namespace {

/// R⁻¹ B in units in which R's diagonal is one; a small prior keeps what R does not determine.
Eigen::MatrixXd solved_by(Eigen::MatrixXd R, const Eigen::MatrixXd& B) {
  const Eigen::VectorXd unit = R.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  R = unit.asDiagonal() * R * unit.asDiagonal();
  R.diagonal().array() += 1e-12;
  return unit.asDiagonal() * definite_solve(R, unit.asDiagonal() * B);
}

/// The Gram matrix of `kept` columns after `removed` ones are projected out; a column that keeps less than
/// 1e-6 of its norm is set to zero.
Eigen::MatrixXd project(const Eigen::MatrixXd& gram, const std::vector<Eigen::Index>& removed,
                        const std::vector<Eigen::Index>& kept) {
  Eigen::MatrixXd G = gram(kept, kept);
  if (!removed.empty()) {
    const Eigen::MatrixXd cross = gram(removed, kept);
    G -= inner_products(cross, solved_by(gram(removed, removed), cross));
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

Eigen::VectorXd left_of(const Footprints& f, const Score& score) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(f.gram.rows());
  const auto& columns = f.candidates[score.candidate].columns;
  for (std::size_t k = 0; k < columns.size(); ++k) out[static_cast<Eigen::Index>(columns[k])] = score.step[k];
  const auto fitted = static_cast<Eigen::Index>(f.fitted);
  if (fitted > 0)
    out.head(fitted) = -solved_by(f.gram.topLeftCorner(fitted, fitted), product(f.gram.topRows(fitted), out));
  return out;
}

Eigen::VectorXd contribution_of(const FitResult& fit, const dynamics::Effect& effect) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(fit.campaign.size()));
  for (std::size_t k = 0; k < fit.campaign.size(); ++k)
    for (const auto& p : effect.parameters)
      if (!p.is_shape() && without_object(fit.campaign[k].unknown.name) == effect.full_name(p))
        out[static_cast<Eigen::Index>(k)] = fit.campaign[k].value - p.neutral;
  return out;
}

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
