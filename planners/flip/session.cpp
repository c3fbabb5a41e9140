#include "planners/flip/session.hpp"

#include <algorithm>
#include <limits>

namespace unhand::planners::flip {

Thrower thrower_of(const FlipPlant& plant, std::uint64_t seed) {
  return [&plant, seed](const TrialRequest& request) {
    std::uint64_t stage = 0;
    for (const char c : request.stage) stage = 131 * stage + static_cast<unsigned char>(c);
    return plant.throw_bar(request.command, request.bar,
                           seed_of({seed, stage, static_cast<std::uint64_t>(request.index)}));
  };
}

std::vector<FlipCommand> population_grid(const CommandRange& range) {
  std::vector<FlipCommand> out;
  for (const double pitch : {0.0, 0.5, 1.0})
    for (const double speed : {0.0, 0.5, 1.0})
      for (const double damping : {0.0, 0.5, 1.0}) out.push_back(range.at(pitch, speed, damping));
  return out;
}

std::vector<FlipCommand> support_simplex(const CommandRange& range, double inset) {
  const double a = inset, b = 1 - inset;
  return {range.at(a, a, a), range.at(b, b, a), range.at(b, a, b), range.at(a, b, b)};
}

Gathered gather(const Thrower& thrower, const std::string& stage, std::span<const FlipCommand> commands,
                int repeats, const Bar& bar) {
  Gathered out;
  for (const FlipCommand& u : commands) {
    const std::size_t first = out.trials.size();
    for (int k = 0; k < repeats; ++k)
      out.trials.push_back(thrower({stage, static_cast<int>(out.trials.size()), u, bar}));
    if (const auto mean = mean_of(std::span(out.trials).subspan(first))) out.data.push_back(*mean);
  }
  return out;
}

double LearningPath::first() const {
  return iterations.empty() ? std::numeric_limits<double>::infinity() : iterations.front().error;
}
double LearningPath::lowest(std::size_t count) const {
  double out = initial_is_seen ? initial : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < std::min(count, iterations.size()); ++i)
    out = std::min(out, iterations[i].error);
  return out;
}
int LearningPath::reached(int hits) const {
  for (std::size_t i = 0; i < iterations.size(); ++i)
    if (iterations[i].hits >= hits) return static_cast<int>(i) + 1;
  return 0;
}

LearningPath learn(FlipLearner& learner, const FlipTarget& target, std::span<const FlipDatum> known,
                   const Bar& bar, const Thrower& thrower, const PathOptions& options) {
  LearningPath out;
  out.initial = std::numeric_limits<double>::infinity();
  out.initial_is_seen = !options.transferred;
  for (const FlipDatum& one : known)
    out.initial = std::min(out.initial, normalized_error(one.landing, target));
  for (int i = 0; i < options.iterations; ++i) {
    const auto command = learner.next();
    if (!command) {
      out.gave_up = true;
      break;
    }
    PathIteration now{*command, {}, {}, std::numeric_limits<double>::infinity(), 0};
    for (int k = 0; k < options.throws; ++k) {
      now.trials.push_back(thrower({"path", i * options.throws + k, *command, bar}));
      now.hits += now.trials.back().outcome == FlipOutcome::landed && hits(now.trials.back().landing, target);
    }
    if (const auto mean = mean_of(now.trials)) {
      now.mean = mean->landing;
      now.error = normalized_error(mean->landing, target);
    }
    learner.observe(now.trials);
    out.iterations.push_back(std::move(now));
  }
  return out;
}

}  // namespace unhand::planners::flip
