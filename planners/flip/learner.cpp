#include "planners/flip/learner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <tuple>

namespace unhand::planners::flip {
namespace {

std::array<double, 6> plus(std::array<double, 6> base, double a, const std::array<double, 6>& x,
                           const std::array<double, 6>& x0, double b, const std::array<double, 6>& y) {
  for (std::size_t i = 0; i < 6; ++i) base[i] += a * (x[i] - x0[i]) + b * (y[i] - x0[i]);
  return base;
}

void sort_by_error(std::vector<FlipDatum>& data, const FlipTarget& target) {
  std::stable_sort(data.begin(), data.end(), [&](const FlipDatum& a, const FlipDatum& b) {
    return normalized_error(a.landing, target) < normalized_error(b.landing, target);
  });
}

/// How many of the commands differ.
std::size_t different(std::span<const FlipDatum> data) {
  std::size_t out = 0;
  for (std::size_t i = 0; i < data.size(); ++i)
    out += std::none_of(data.begin(), data.begin() + static_cast<std::ptrdiff_t>(i),
                        [&](const FlipDatum& before) { return before.command == data[i].command; });
  return out;
}

void require_finite(std::span<const FlipDatum> data) {
  for (const FlipDatum& one : data) {
    double sum = one.landing.x + one.landing.angle;
    for (const double x : one.detach) sum += x;
    if (!std::isfinite(sum))
      throw std::invalid_argument(
          fmt::format("flip learner: the detach or landing of command ({}, {}, {}) is "
                      "not finite",
                      one.command.pitch, one.command.speed, one.command.damping));
  }
}

constexpr std::size_t kSimplex = 3;  ///< throws of different commands that model 2 begins with

}  // namespace

void validate(const FlipTarget& target) {
  if (!std::isfinite(target.pose.x) || !std::isfinite(target.pose.angle))
    throw std::invalid_argument(
        fmt::format("flip target: x = {} m, angle = {} rad is not finite", target.pose.x, target.pose.angle));
  for (const auto& [name, value, unit] : {std::tuple{"tolerance_x", target.tolerance_x, "m"},
                                          {"tolerance_angle", target.tolerance_angle, "rad"}})
    if (!(value > 0 && std::isfinite(value)))
      throw std::invalid_argument(
          fmt::format("flip target: {} = {} is not in (0, inf) {}", name, value, unit));
}

double normalized_error(const FlipPose& landing, const FlipTarget& target) {
  return std::hypot((landing.x - target.pose.x) / target.tolerance_x,
                    (landing.angle - target.pose.angle) / target.tolerance_angle);
}

bool hits(const FlipPose& landing, const FlipTarget& target) {
  return std::abs(landing.x - target.pose.x) <= target.tolerance_x &&
         std::abs(landing.angle - target.pose.angle) <= target.tolerance_angle;
}

std::optional<FlipDatum> mean_of(std::span<const FlipTrial> trials) {
  FlipDatum out;
  for (const FlipTrial& t : trials) {
    if (t.outcome != FlipOutcome::landed) continue;
    out.command = t.command;
    ++out.throws;
    for (std::size_t i = 0; i < 6; ++i) out.detach[i] += t.detach[i];
    out.landing.x += t.landing.x;
    out.landing.angle += t.landing.angle;
  }
  if (out.throws == 0) return {};
  for (double& x : out.detach) x /= out.throws;
  out.landing.x /= out.throws;
  out.landing.angle /= out.throws;
  return out;
}

namespace {

/// Searches the mesh for the command whose prediction is nearest to the target; commands out of range, and
/// those in `tried`, are passed over. Deltas come from `simplex`, prediction and command start at `base` (the
/// simplex's first entry, but for model 3). Empty where no mesh point remains, or the simplex is degenerate.
std::optional<FlipCommand> cone_search(ForwardModel model, const FlipDatum& base,
                                       std::span<const FlipDatum, 3> simplex, const FlipTarget& target,
                                       const CommandRange& range, std::span<const FlipCommand> tried) {
  constexpr int kMesh = 50;       // to either side
  constexpr double kStep = 0.05;  // of α
  const auto u0 = range.fractions(simplex[0].command), u1 = range.fractions(simplex[1].command),
             u2 = range.fractions(simplex[2].command), from = range.fractions(base.command);
  std::array<double, 3> d1{}, d2{};
  for (std::size_t i = 0; i < 3; ++i) d1[i] = u1[i] - u0[i], d2[i] = u2[i] - u0[i];
  const double a = d1[1] * d2[2] - d1[2] * d2[1], b = d1[2] * d2[0] - d1[0] * d2[2],
               c = d1[0] * d2[1] - d1[1] * d2[0];
  const auto norm = [](const std::array<double, 3>& d) { return std::hypot(d[0], d[1], d[2]); };
  if (!(std::hypot(a, b, c) > 1e-3 * norm(d1) * norm(d2))) return {};
  std::optional<FlipCommand> best;
  double least = std::numeric_limits<double>::infinity();
  for (int i = -kMesh; i <= kMesh; ++i)
    for (int j = -kMesh; j <= kMesh; ++j) {
      const double x = i * kStep, y = j * kStep;
      std::array<double, 3> f{};
      bool inside = true;
      for (std::size_t k = 0; k < 3; ++k) {
        f[k] = from[k] + x * d1[k] + y * d2[k];
        inside = inside && f[k] >= -1e-12 && f[k] <= 1 + 1e-12;
      }
      if (!inside) continue;
      const auto near = [&](const FlipCommand& other) {
        const auto o = range.fractions(other);
        return std::hypot(o[0] - f[0], o[1] - f[1], o[2] - f[2]) < 1e-6;
      };
      if (std::any_of(tried.begin(), tried.end(), near)) continue;
      std::optional<FlipPose> landing;
      if (model == ForwardModel::detach) {
        landing = fly_flip(plus(base.detach, x, simplex[1].detach, simplex[0].detach, y, simplex[2].detach));
      } else {
        const auto along = [&](double FlipPose::*of) {
          const double zero = simplex[0].landing.*of;
          return base.landing.*of + x * (simplex[1].landing.*of - zero) + y * (simplex[2].landing.*of - zero);
        };
        landing = FlipPose{along(&FlipPose::x), along(&FlipPose::angle)};
      }
      if (!landing) continue;
      const double error = normalized_error(*landing, target);
      if (error < least) least = error, best = range.clamp(range.at(f[0], f[1], f[2]));
    }
  return best;
}

}  // namespace

ConeLearner::ConeLearner(ForwardModel model, std::vector<FlipDatum> support, const FlipTarget& target,
                         const CommandRange& range, std::vector<FlipCommand> tried)
    : model_(model), data_(std::move(support)), tried_(std::move(tried)), target_(target), range_(range) {
  validate(target_);
  require_finite(data_);
  if (const std::size_t n = different(data_); n < kSimplex)
    throw std::invalid_argument(fmt::format(
        "flip learner: the support has {} different commands; accepted: at least {}", n, kSimplex));
  for (const FlipDatum& one : data_) tried_.push_back(one.command);
}

std::optional<FlipCommand> ConeLearner::next() {
  std::vector<std::size_t> order(data_.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return normalized_error(data_[a].landing, target_) < normalized_error(data_[b].landing, target_);
  });
  for (int round = 0; round < 2; ++round, searched_.clear())
    for (std::size_t j = 2; j < order.size(); ++j)
      for (std::size_t i = 1; i < j; ++i) {
        const std::array<std::size_t, 3> which{order[0], std::min(order[i], order[j]),
                                               std::max(order[i], order[j])};
        if (!searched_.insert(which).second) continue;
        const std::array<FlipDatum, 3> simplex{data_[order[0]], data_[order[i]], data_[order[j]]};
        const auto command = cone_search(model_, simplex[0], simplex, target_, range_, tried_);
        if (!command) continue;
        tried_.push_back(*command);
        return command;
      }
  return {};
}

void ConeLearner::observe(std::span<const FlipTrial> trials) {
  if (const auto mean = mean_of(trials)) {
    require_finite({&*mean, 1});
    data_.push_back(*mean);
  }
  for (const FlipTrial& one : trials)  // somebody else may have chosen it
    if (std::find(tried_.begin(), tried_.end(), one.command) == tried_.end()) tried_.push_back(one.command);
}

DetachVector shifted(const DetachVector& d, double shift) {
  // The paper's (sin θ, −cos θ) with its θ from hanging is (cos θ, sin θ) with θ from +x.
  const double c = std::cos(d[2]), s = std::sin(d[2]), w = d[5] * shift;
  return {d[0] + shift * c, d[1] + shift * s, d[2], d[3] - w * s, d[4] + w * c, d[5]};
}

std::vector<FlipDatum> transferred(std::span<const FlipDatum> data, double shift) {
  if (shift == 0) return {data.begin(), data.end()};
  std::vector<FlipDatum> out;
  for (FlipDatum one : data) {
    one.detach = shifted(one.detach, shift);
    const auto landing = fly_flip(one.detach);
    if (!landing) continue;
    one.landing = *landing;
    out.push_back(one);
  }
  return out;
}

TransferLearner::TransferLearner(std::span<const FlipDatum> past, double shift, const FlipTarget& target,
                                 const CommandRange& range)
    : past_(transferred(past, shift)), target_(target), range_(range) {
  validate(target_);
  if (past_.size() < 4)
    throw std::invalid_argument("transfer: fewer than four throws of the old bar can be transferred");
  sort_by_error(past_, target_);
}

/// The nearest command of the past that has not been executed yet.
std::optional<FlipCommand> TransferLearner::nearest_left() {
  for (const FlipDatum& one : past_)
    if (std::find(tried_.begin(), tried_.end(), one.command) == tried_.end()) return one.command;
  return {};
}

std::optional<FlipCommand> TransferLearner::next() {
  std::optional<FlipCommand> command;
  if (after_) {
    command = after_->next();
  } else if (!own_.empty()) {
    const FlipDatum& third = own_.size() == 1 ? past_[2] : past_[3];
    const std::array<FlipDatum, 3> simplex{past_[0], past_[1], third};
    command = cone_search(ForwardModel::detach, own_.back(), simplex, target_, range_, tried_);
  }
  if (!command) command = nearest_left();
  if (command) tried_.push_back(*command);
  return command;
}

void TransferLearner::observe(std::span<const FlipTrial> trials) {
  if (after_) return after_->observe(trials);
  if (const auto mean = mean_of(trials)) {
    require_finite({&*mean, 1});
    own_.push_back(*mean);
  }
  if (different(own_) == kSimplex)
    after_ = std::make_unique<ConeLearner>(ForwardModel::detach, own_, target_, range_, tried_);
}

}  // namespace unhand::planners::flip
