#include "fitting/grouped_fit.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "experiment/parallel.hpp"

namespace unhand::fitting {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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
  MatrixXd out = MatrixXd::Zero(equations.residual.size(), static_cast<Index>(all));
  for (std::size_t k = 0; k < from.size(); ++k)
    out.col(static_cast<Index>(from[k])) = equations.shared.col(static_cast<Index>(k));
  equations.shared = std::move(out);
}

std::vector<datasets::Split> splits_of(const datasets::ThrowLog& log) {
  bool train = false, test = false;
  for (const auto& t : log.throws) (t.split == datasets::Split::train ? train : test) = true;
  std::vector<datasets::Split> out;
  std::map<std::string, int> seen;
  for (const auto& t : log.throws)
    out.push_back(train && test                  ? t.split
                  : ++seen[t.condition] % 5 == 0 ? datasets::Split::test
                                                 : datasets::Split::train);
  return out;
}

std::vector<std::string> GroupedFit::names() const {
  std::vector<std::string> out;
  for (const auto& p : shared) out.push_back(p.name);
  return out;
}

namespace {

/// Huber: the factor on a residual whose size is `r` in units of `limit`.
double huber(double r) { return r > 1 ? std::sqrt(1 / r) : 1; }

double cost_of(const VectorXd& residual, const Group& group, const GroupedWeights& weights, double limit) {
  double out = 0;
  for (Index i = 0; i < residual.size(); ++i) {
    const int c = group.rows[static_cast<std::size_t>(i)].channel;
    const double scale = c >= 0 ? weights.channel_scale[static_cast<std::size_t>(c)] : 1,
                 r = std::abs(residual[i]) / scale;
    out += (r <= limit ? r * r : 2 * limit * r - limit * limit) * scale * scale;
  }
  return out;
}

void weigh_rows(GroupEquations& e, const Group& group, const GroupedWeights& weights, double limit) {
  for (Index i = 0; i < e.residual.size(); ++i) {
    const int c = group.rows[static_cast<std::size_t>(i)].channel;
    const double scale = c >= 0 ? weights.channel_scale[static_cast<std::size_t>(c)] : 1;
    const double w = huber(std::abs(e.residual[i]) / (limit * scale));
    if (w == 1) continue;
    e.residual[i] *= w;
    if (e.shared.size() > 0) e.shared.row(i) *= w;
    if (e.own.size() > 0) e.own.row(i) *= w;
  }
}

/// An orthonormal basis of the columns' span.
MatrixXd basis_of(const MatrixXd& own) {
  if (own.cols() == 0) return MatrixXd::Zero(own.rows(), 0);
  const VectorXd unit = own.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  Eigen::ColPivHouseholderQR<MatrixXd> qr(own * unit.asDiagonal());
  qr.setThreshold(1e-10);
  return qr.householderQ() * MatrixXd::Identity(own.rows(), qr.rank());
}

struct Part {
  bool solved{};
  double cost{};
  MatrixXd information;  // shared
  VectorXd score;
  MatrixXd own_per_shared;  // change of own for a change of shared
  VectorXd own_step;
};

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
    const VectorXd unit = A.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd inverse = unit.asDiagonal() *
                             MatrixXd(unit.asDiagonal() * A * unit.asDiagonal())
                                 .completeOrthogonalDecomposition()
                                 .pseudoInverse() *
                             unit.asDiagonal();
    const double n = fit_.used;
    fit_.covariance = inverse * B * inverse * (n / std::max(1.0, n - static_cast<double>(p)));
    for (Index j = 0; j < p; ++j)
      if (fit_.covariance(j, j) < inverse(j, j))
        fit_.covariance.row(j) *= std::sqrt(inverse(j, j) / std::max(1e-300, fit_.covariance(j, j))),
            fit_.covariance.col(j) *= std::sqrt(inverse(j, j) / std::max(1e-300, fit_.covariance(j, j)));
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
    experiment::parallel_for(used_.size(), options_.threads, [&](std::size_t n) {
      GroupFit& g = fit_.groups[used_[n]];
      const Group& group = problem_.groups()[used_[n]];
      Part& part = parts_[n];
      auto e = problem_.equations(used_[n], names_, values, g.own, true);
      if (!e.solved) return;
      g.residual = e.residual;
      part.cost = cost_of(e.residual, group, fit_.weights, options_.sample_limit);
      weigh_rows(e, group, fit_.weights, options_.sample_limit);
      const VectorXd unit = e.own.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
      Eigen::ColPivHouseholderQR<MatrixXd> qr(e.own * unit.asDiagonal());
      qr.setThreshold(1e-10);
      part.own_step = unit.asDiagonal() * VectorXd(qr.solve(-e.residual));
      part.own_per_shared = MatrixXd::Zero(e.own.cols(), e.shared.cols());
      if (e.shared.cols() > 0)  // Eigen's solve reads the first column of the right-hand side
        part.own_per_shared = unit.asDiagonal() * MatrixXd(qr.solve(-e.shared));
      const MatrixXd F = e.shared + e.own * part.own_per_shared;
      const VectorXd r = e.residual + e.own * part.own_step;
      part.information = F.transpose() * F;
      part.score = F.transpose() * r;
      part.solved = part.own_step.allFinite() && part.own_per_shared.allFinite();
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
    const VectorXd unit = A.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatrixXd scaled = unit.asDiagonal() * A * unit.asDiagonal();
    return unit.asDiagonal() *
           VectorXd(scaled.completeOrthogonalDecomposition().solve(unit.asDiagonal() * VectorXd(-b)));
  }

  /// The cost after a step of the shared parameters and of every group's own.
  double try_step(const std::vector<VectorXd>& own, const VectorXd& shared_change, double factor) {
    std::vector<double> costs(used_.size(), 0.0);
    const std::vector<double> values(fit_.values.data(), fit_.values.data() + fit_.values.size());
    experiment::parallel_for(used_.size(), options_.threads, [&](std::size_t n) {
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

double median_of(std::vector<double> x) {
  if (x.empty()) return 0;
  const auto middle = x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2);
  std::nth_element(x.begin(), middle, x.end());
  return *middle;
}

GroupedWeights neutral_weights(const GroupedProblem& problem) {
  return {std::vector<double>(problem.channels().size(), 1e6),
          std::vector<double>(problem.groups().size(), 1.0)};
}

GroupedWeights learned_weights(const GroupedProblem& problem, const GroupedFit& fit,
                               const GroupedFitOptions& options) {
  GroupedWeights out = neutral_weights(problem);
  std::vector<std::vector<double>> sizes(problem.channels().size());
  std::vector<double> means;
  for (std::size_t i = 0; i < fit.groups.size(); ++i) {
    const GroupFit& g = fit.groups[i];
    if (!g.used || !g.solved) continue;
    for (Index j = 0; j < g.residual.size(); ++j)
      if (const int c = problem.groups()[i].rows[static_cast<std::size_t>(j)].channel; c >= 0)
        sizes[static_cast<std::size_t>(c)].push_back(std::abs(g.residual[j]));
    if (g.n > 0) means.push_back(g.chi2 / g.n);
  }
  for (std::size_t c = 0; c < sizes.size(); ++c)
    out.channel_scale[c] = std::max(1.0, 1.4826 * median_of(std::move(sizes[c])));
  const double limit = options.group_limit * std::max(1.0, median_of(means));
  for (std::size_t i = 0; i < fit.groups.size(); ++i)
    if (const GroupFit& g = fit.groups[i]; g.used && g.n > 0 && g.chi2 / g.n > limit)
      out.group[i] = limit / (g.chi2 / g.n);
  return out;
}

GroupedFit begin(const GroupedProblem& problem, datasets::Split split) {
  GroupedFit fit;
  fit.groups.resize(problem.groups().size());
  for (std::size_t i = 0; i < fit.groups.size(); ++i) {
    const Group& g = problem.groups()[i];
    fit.groups[i].used = g.split == split;
    fit.groups[i].own = Eigen::Map<const VectorXd>(g.start.data(), static_cast<Index>(g.start.size()));
  }
  return fit;
}

void solve(const GroupedProblem& problem, GroupedFit& fit, const GroupedFitOptions& options) {
  if (fit.weights.group.empty()) fit.weights = neutral_weights(problem);
  for (int round = 0; round < (options.robust ? 2 : 1); ++round) {
    Solver solver(problem, fit, options);
    solver.run();
    solver.finish();
    if (!fit.solved) return;
    if (round == 0 && options.robust) fit.weights = learned_weights(problem, fit, options);
  }
}

}  // namespace

GroupedFit fit_groups(const GroupedProblem& problem, datasets::Split split,
                      const std::vector<SharedParameter>& shared, const VectorXd& values,
                      const GroupedFitOptions& options) {
  GroupedFit fit = begin(problem, split);
  fit.shared = shared;
  fit.values = values;
  solve(problem, fit, options);
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
                           const VectorXd& own, bool derivatives) const override {
    auto out = problem_.equations(group, names_, values_, own, derivatives);
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
                   const GroupedFitOptions& options) {
  const Held held(problem, fit);
  GroupedFit out = begin(problem, split);
  solve(held, out, options);
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
  out.solved = false;
  for (int k = 0; k < 8; ++k) {
    const auto e = problem.equations(group, names, values, out.own, true);
    if (!e.solved) return out;
    const MatrixXd O = e.own(rows, Eigen::all);
    const VectorXd unit = O.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
    Eigen::ColPivHouseholderQR<MatrixXd> qr(O * unit.asDiagonal());
    qr.setThreshold(1e-10);
    const VectorXd step = unit.asDiagonal() * VectorXd(qr.solve(-VectorXd(e.residual(rows))));
    out.own += step;
    if ((O * step).squaredNorm() < 1e-8) break;
  }
  const auto e = problem.equations(group, names, values, out.own, false);
  out.residual = e.residual;
  out.solved = e.solved;
  return out;
}

ProjectedEquations projected(const GroupedProblem& problem, std::size_t group,
                             std::span<const std::string> names, std::span<const double> values,
                             const VectorXd& own, const GroupedWeights& weights, double sample_limit) {
  ProjectedEquations out;
  auto e = problem.equations(group, names, values, own, true);
  if (!e.solved) return out;
  weigh_rows(e, problem.groups()[group], weights, sample_limit);
  MatrixXd columns(e.residual.size(), e.shared.cols() + 1);
  columns << e.shared, e.residual;
  out.own_basis = basis_of(e.own);
  out.columns = columns - out.own_basis * (out.own_basis.transpose() * columns);
  out.solved = true;
  return out;
}

std::vector<GroupedMisfit> misfit(const GroupedProblem& problem, const GroupedFit& fit) {
  std::vector<GroupedMisfit> out;
  for (const auto& name : problem.channels()) out.push_back({name, 0, 0});
  for (std::size_t i = 0; i < fit.groups.size(); ++i) {
    const GroupFit& g = fit.groups[i];
    if (!g.used || !g.solved) continue;
    for (Index j = 0; j < g.residual.size(); ++j)
      if (const int c = problem.groups()[i].rows[static_cast<std::size_t>(j)].channel; c >= 0) {
        out[static_cast<std::size_t>(c)].n += 1;
        out[static_cast<std::size_t>(c)].chi2 += g.residual[j] * g.residual[j];
      }
  }
  return out;
}

}  // namespace unhand::fitting
