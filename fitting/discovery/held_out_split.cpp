#include "fitting/discovery/held_out_split.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/median.hpp"

namespace unhand::fitting {

using datasets::Split;
using datasets::Throw;

namespace {

/// ln of the grip's force; vx, vz, omega, theta, ax, az and alpha of the hand when the gripper opens.
constexpr std::size_t kFeatures = 8;
using Features = std::array<double, kFeatures>;

Features features_of(const datasets::ThrowLog& log, const Throw& one) {
  Features out{};
  if (one.ft && !one.ft->normal_force.empty()) {
    const auto& force = one.ft->normal_force.data;
    out[0] = std::log(std::max(*std::max_element(force.begin(), force.end()), 1e-6));
  }
  if (!one.hand || one.hand->time.rows == 0) return out;
  const auto& hand = *one.hand;
  const double opening =
      log.gripper && log.gripper->opening_command_time ? *log.gripper->opening_command_time : HUGE_VAL;
  const auto after = std::upper_bound(hand.time.data.begin(), hand.time.data.end(), opening);
  const auto i = static_cast<std::size_t>(std::max<std::ptrdiff_t>(after - hand.time.data.begin(), 1) - 1);
  for (std::size_t c = 0; c < 3; ++c) {
    out[1 + c] = hand.twist(i, c);
    out[5 + c] = hand.acceleration(i, c);
  }
  out[4] = hand.pose(i, 2);
  return out;
}

struct LogCondition {
  std::string object, name;
  Features is{};    ///< the median throw's, of unit variance over the conditions
  double side = 1;  ///< 1: train, −1: held out
};

/// In the order in which the log first has them.
std::vector<LogCondition> log_conditions(const datasets::ThrowLog& log) {
  std::vector<LogCondition> out;
  std::map<std::pair<std::string, std::string>, std::vector<Features>> seen;
  for (const auto& one : log.throws) {
    auto& all = seen[{one.object, one.condition}];
    if (all.empty()) out.push_back({one.object, one.condition, {}, 1});
    all.push_back(features_of(log, one));
  }
  const auto n = static_cast<double>(out.size());
  for (std::size_t k = 0; k < kFeatures; ++k) {
    double mean = 0, square = 0;
    for (auto& c : out) {
      std::vector<double> values;
      for (const auto& f : seen[{c.object, c.name}]) values.push_back(f[k]);
      c.is[k] = dynamics::median(values);
      mean += c.is[k] / n;
    }
    for (const auto& c : out) square += (c.is[k] - mean) * (c.is[k] - mean) / n;
    const double sigma = std::sqrt(square), none = 1e-3 * (std::abs(mean) + 1e-3);  // noise
    for (auto& c : out) c.is[k] = sigma > none ? (c.is[k] - mean) / sigma : 0;
  }
  return out;
}

/// How alike two conditions are, feature by feature; twice that if they are of one object. Over train less
/// held-out conditions, the double sum of it is how unlike the distributions of each feature are (the maximum
/// mean discrepancy: Gretton et al., A kernel two-sample test, JMLR 13, 2012).
double likeness(const LogCondition& a, const LogCondition& b) {
  constexpr double kWidth = 0.3;  // of the standard deviation: levels of a factor lie farther apart
  double out = 0;
  for (std::size_t k = 0; k < kFeatures; ++k) {
    const double apart = (a.is[k] - b.is[k]) / kWidth;
    out += std::exp(-0.5 * apart * apart);
  }
  return a.object == b.object ? 2 * out : out;
}

/// Exchanges a held-out condition with one of train of the same object, the best exchange first, while that
/// makes the sides more alike.
void balance(std::vector<LogCondition>& conditions) {
  constexpr std::size_t kMost = 1000;  // of more, every other one will do
  const std::size_t n = conditions.size();
  if (n > kMost) return;
  std::vector<double> alike(n * n), surplus(n, 0.0);  // surplus: train less held-out conditions like this one
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      alike[i * n + j] = likeness(conditions[i], conditions[j]);
      surplus[i] += conditions[j].side * alike[i * n + j];
    }
  constexpr double kGains = 1e-6;
  for (std::size_t exchange = 0; exchange < n; ++exchange) {
    std::pair<std::size_t, std::size_t> best{};
    double most = kGains;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = i + 1; j < n; ++j) {
        const LogCondition &a = conditions[i], &b = conditions[j];
        if (a.object != b.object || a.side == b.side) continue;
        const double gain = a.side * surplus[i] + b.side * surplus[j] -
                            (alike[i * n + i] + alike[j * n + j] - 2 * alike[i * n + j]);
        if (gain > most) most = gain, best = {i, j};
      }
    const auto [i, j] = best;
    if (i == j) return;
    std::swap(conditions[i].side, conditions[j].side);
    for (std::size_t k = 0; k < n; ++k)
      surplus[k] += 2 * (conditions[i].side * alike[i * n + k] + conditions[j].side * alike[j * n + k]);
  }
}

}  // namespace

bool has_both_splits(const datasets::ThrowLog& log) {
  bool train = false, test = false;
  for (const auto& t : log.throws) (t.split == Split::train ? train : test) = true;
  return train && test;
}

datasets::ThrowLog with_held_out(datasets::ThrowLog log) {
  if (has_both_splits(log)) return log;
  auto conditions = log_conditions(log);
  std::map<std::string, int> of_object;
  int most = 0;
  for (auto& c : conditions) {
    int& n = of_object[c.object];
    c.side = n % 2 == 0 ? 1 : -1;
    most = std::max(most, ++n);
  }
  balance(conditions);
  std::map<std::string, int> repetition;
  for (auto& t : log.throws) {
    const auto own = std::find_if(conditions.begin(), conditions.end(), [&](const LogCondition& c) {
      return c.object == t.object && c.name == t.condition;
    });
    const bool by_repetition = of_object[t.object] == 1 && most > 1;
    const bool held_out = by_repetition ? repetition[t.object]++ % 2 == 1 : own->side < 0;
    t.split = held_out ? Split::test : Split::train;
  }
  return log;
}

}  // namespace unhand::fitting
