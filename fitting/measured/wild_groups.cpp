#include "fitting/measured/wild_groups.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "dynamics/dense_solve.hpp"
#include "dynamics/median.hpp"
#include "fitting/measured/grouped_footprints.hpp"

namespace unhand::fitting {

using datasets::Split;
using dynamics::pseudo_solve;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kGross = 6, kMedians = 10;     // robust sigmas; medians
constexpr double kUpper = 0.84;                 // one sigma of a normal distribution
constexpr std::size_t kFewestGroups = 6;        // groups that can say what is usual
constexpr int kWeighings = 30, kSearches = 10;  // of the weights; of setting aside

/// Inner products of a group's footprints and its residual (last), its own unknowns projected out.
struct Footing {
  std::size_t group{};
  bool train{};
  double n{};
  MatrixXd gram;
  double misfit(const VectorXd& values) const {
    const Index p = values.size();
    const double left =
        gram(p, p) + 2 * values.dot(gram.col(p).head(p)) + values.dot(gram.topLeftCorner(p, p) * values);
    return std::max(left, 1e-12 * gram(p, p)) / n;
  }
};

void add_parts(const GroupedProblem& problem, GroupedFit fit, const std::vector<dynamics::Effect>& effects,
               const GroupedFitOptions& options, std::vector<Footing>& to) {
  if (!fit.solved) return;
  fit.weights.group.assign(fit.groups.size(), 1.0);
  auto f = grouped_footprints(problem, fit, effects, options);
  std::size_t at = 0;
  for (std::size_t i = 0; i < fit.groups.size(); ++i) {
    if (!fit.groups[i].used || !fit.groups[i].solved) continue;
    MatrixXd& gram = f.parts[at++];
    const Index r = gram.rows() - 1;
    if (fit.groups[i].n > 0 && gram(r, r) > 0)
      to.push_back({i, problem.groups()[i].split == Split::train, static_cast<double>(fit.groups[i].n),
                    std::move(gram)});
  }
}

/// What all footprints add up to on the train parts that are kept: no part counts for more than `limit`
/// medians.
VectorXd fitted(const std::vector<Footing>& parts, const std::vector<bool>& kept, double limit) {
  const Index p = parts.front().gram.rows() - 1;
  VectorXd values = VectorXd::Zero(p);
  for (int k = 0; k < kWeighings; ++k) {
    std::vector<double> misfits;
    for (std::size_t i = 0; i < parts.size(); ++i)
      if (kept[i] && parts[i].train) misfits.push_back(parts[i].misfit(values));
    if (misfits.empty()) return values;
    const double most = limit * dynamics::median(misfits);
    MatrixXd A = MatrixXd::Zero(p, p);
    VectorXd b = VectorXd::Zero(p);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (!kept[i] || !parts[i].train) continue;
      const double w = std::min(1.0, most / parts[i].misfit(values));
      A += w * parts[i].gram.topLeftCorner(p, p);
      b += w * parts[i].gram.col(p).head(p);
    }
    const VectorXd next = pseudo_solve(A, -b), change = next - values;
    values = next;
    if (change.dot(A * change) < 1e-6 * std::max(1.0, most)) break;
  }
  return values;
}

/// The groups whose misfit is gross, by place among `misfits` and in that order.
std::vector<std::size_t> gross(const std::vector<double>& misfits, std::vector<WildGroup>& out) {
  std::vector<std::size_t> places;
  out.clear();
  std::vector<double> logs;
  for (const double m : misfits) logs.push_back(std::log(m));
  auto sorted = logs;
  std::sort(sorted.begin(), sorted.end());
  const double middle = dynamics::median(sorted);
  const double at = kUpper * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const double upper = sorted[below] + (at - static_cast<double>(below)) *
                                           (sorted[std::min(below + 1, sorted.size() - 1)] - sorted[below]);
  const double scatter = std::max(upper - middle, std::log(kMedians) / kGross);
  for (std::size_t i = 0; i < logs.size(); ++i)
    if (logs[i] - middle > kGross * scatter) {
      places.push_back(i);
      out.push_back({i, std::exp(logs[i] - middle), (logs[i] - middle) / scatter, 0});
    }
  return places;
}

bool is_too_many(const std::vector<Footing>& parts, const std::vector<std::size_t>& places) {
  if (static_cast<double>(places.size()) > std::max(1.0, kMostWild * static_cast<double>(parts.size())))
    return true;
  const auto all = std::count_if(parts.begin(), parts.end(), [](const Footing& p) { return p.train; });
  const auto wild = static_cast<std::ptrdiff_t>(places.size());
  return all <= 2 * wild;  // each may need another one in its place
}

}  // namespace

std::vector<WildGroup> wild_groups(const GroupedProblem& problem,
                                   const std::vector<dynamics::Effect>& effects,
                                   const GroupedFitOptions& options) {
  std::vector<Footing> parts;
  const GroupedFit base = fit_groups(problem, Split::train, {}, VectorXd(), options);
  add_parts(problem, base, effects, options, parts);
  add_parts(problem, fit_own(problem, Split::test, base, options), effects, options, parts);
  std::vector<WildGroup> out;
  if (parts.size() < kFewestGroups) return out;
  std::vector<bool> kept(parts.size(), true);
  std::vector<double> misfits;
  for (int round = 0; round < kSearches; ++round) {
    const VectorXd values = fitted(parts, kept, options.group_limit);
    misfits.clear();
    for (const Footing& part : parts) misfits.push_back(part.misfit(values));
    const auto places = gross(misfits, out);
    if (is_too_many(parts, places)) return {};
    std::vector<bool> next(parts.size(), true);
    for (const std::size_t i : places) next[i] = false;
    if (std::exchange(kept, next) == next) break;
  }
  double worst = 0;
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (kept[i]) worst = std::max(worst, misfits[i]);
  for (WildGroup& wild : out) {
    wild.apart = misfits[wild.group] / worst;
    wild.group = parts[wild.group].group;
  }
  return out;
}

std::vector<WildGroup> still_wild(const GroupedProblem& problem, const std::vector<WildGroup>& groups,
                                  const GroupedFit& answer, const GroupedFitOptions& options) {
  std::vector<Footing> parts;
  for (const Split split : {Split::train, Split::test})
    add_parts(problem, fit_own(problem, split, answer, options), {}, options, parts);
  const auto is_wild = [&](std::size_t group) {
    return std::any_of(groups.begin(), groups.end(), [&](const WildGroup& g) { return g.group == group; });
  };
  const auto misfit = [](const Footing& part) { return part.misfit(VectorXd::Zero(part.gram.rows() - 1)); };
  double worst = 0;
  for (const Footing& part : parts)
    if (!is_wild(part.group)) worst = std::max(worst, misfit(part));
  // One that could not be fitted is not explained.
  const auto is_explained = [&](const WildGroup& wild) {
    return std::any_of(parts.begin(), parts.end(), [&](const Footing& part) {
      return part.group == wild.group && misfit(part) <= options.group_limit * worst;
    });
  };
  std::vector<WildGroup> out;
  std::copy_if(groups.begin(), groups.end(), std::back_inserter(out),
               [&](const WildGroup& wild) { return !is_explained(wild); });
  return out;
}

}  // namespace unhand::fitting
