#include "fitting/gross_outliers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "dynamics/dense_solve.hpp"
#include "dynamics/median.hpp"

namespace unhand::fitting {

using dynamics::pseudo_solve;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::string WildGroup::in_words() const {
  return fmt::format("{:.0f} times the median misfit that they leave, {:.1f} robust sigmas in its logarithm",
                     times, sigmas);
}

bool is_among(const std::vector<WildGroup>& wild, std::size_t group) {
  return std::any_of(wild.begin(), wild.end(), [&](const WildGroup& one) { return one.group == group; });
}

double GroupFooting::misfit(const VectorXd& sizes) const {
  const Index p = sizes.size();
  const double left =
      gram(p, p) + 2 * sizes.dot(gram.col(p).head(p)) + sizes.dot(gram.topLeftCorner(p, p) * sizes);
  return std::max(left, 1e-12 * gram(p, p)) / n;
}

double GroupFooting::misfit() const { return gram(gram.rows() - 1, gram.rows() - 1) / n; }

namespace {

constexpr double kGross = 6, kMedians = 10;     // robust sigmas; medians
constexpr double kUpper = 0.84;                 // one sigma of a normal distribution
constexpr std::size_t kFewestGroups = 6;        // groups that can say what is usual
constexpr int kWeighings = 30, kSearches = 10;  // of the weights; of setting aside

/// What all footprints add up to on the train parts that are kept: no part counts for more than `limit`
/// medians.
VectorXd fitted(const std::vector<GroupFooting>& parts, const std::vector<bool>& kept, double limit) {
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

bool is_too_many(const std::vector<GroupFooting>& parts, const std::vector<std::size_t>& places) {
  if (static_cast<double>(places.size()) > std::max(1.0, kMostWild * static_cast<double>(parts.size())))
    return true;
  const auto all = std::count_if(parts.begin(), parts.end(), [](const GroupFooting& p) { return p.train; });
  const auto wild = static_cast<std::ptrdiff_t>(places.size());
  return all <= 2 * wild;  // each may need another one in its place
}

}  // namespace

std::vector<WildGroup> gross_outliers(const std::vector<GroupFooting>& parts, double limit) {
  std::vector<WildGroup> out;
  if (parts.size() < kFewestGroups) return out;
  std::vector<bool> kept(parts.size(), true);
  std::vector<double> misfits;
  for (int round = 0; round < kSearches; ++round) {
    const VectorXd values = fitted(parts, kept, limit);
    misfits.clear();
    for (const GroupFooting& part : parts) misfits.push_back(part.misfit(values));
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

std::vector<WildGroup> still_gross(const std::vector<WildGroup>& wild,
                                   const std::vector<GroupFooting>& groups, double limit) {
  double worst = 0;
  for (const GroupFooting& part : groups)
    if (!is_among(wild, part.group)) worst = std::max(worst, part.misfit());
  const auto is_explained = [&](const WildGroup& one) {
    return std::any_of(groups.begin(), groups.end(), [&](const GroupFooting& part) {
      return part.group == one.group && part.misfit() <= limit * worst;
    });
  };
  std::vector<WildGroup> out;
  std::copy_if(wild.begin(), wild.end(), std::back_inserter(out),
               [&](const WildGroup& one) { return !is_explained(one); });
  return out;
}

}  // namespace unhand::fitting
