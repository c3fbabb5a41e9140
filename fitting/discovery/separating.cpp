#include "fitting/discovery/separating.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <map>
#include <optional>

#include "dynamics/parallel.hpp"
#include "fitting/discovery/footprint_columns.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

constexpr double kRepetitions = 10;

FootprintColumns columns_of(const Stage& stage, const std::string& other) {
  FootprintColumns out(stage.problem, stage.fit);
  if (is_law(other))
    out.add_law(other.substr(kLaw.size()));
  else
    out.add_effects({other});
  return out;
}

/// Between what `accepted` does and the nearest that the candidates of `columns` can do.
double correlation_in(const FootprintColumns& columns, const Eigen::MatrixXd& gram, const Stage& stage,
                      const AcceptedEffect& accepted) {
  const Footprints f{columns.candidates(), columns.fitted(), gram, 0};
  const Eigen::VectorXd contribution = contribution_of(stage.fit, find_effect(accepted.id));
  double out = 0;
  for (const Candidate& candidate : f.candidates)
    out = std::max(out, correlation(f, contribution, candidate));
  return out;
}

/// The motion `speed` times as fast, about the pose at which the gripper is told to open. Wrenches and poses
/// that were seen before the motion now begins, or after it ends, are dropped.
CampaignThrow at_speed(const CampaignThrow& thrown, double speed) {
  CampaignThrow out = thrown;
  const double origin = thrown.prepared.open_command;
  const auto warped = [&](double t) { return origin + (t - origin) / speed; };
  const auto& path = thrown.prepared.hand.path();
  auto breaks = path.breaks();
  for (double& t : breaks) t = warped(t);
  auto pieces = path.pieces();
  for (auto& piece : pieces) {
    double factor = 1;
    for (auto& power : piece) {
      for (double& c : power) c *= factor;
      factor *= speed;
    }
  }
  auto jumps = thrown.prepared.hand.jumps();
  for (double& t : jumps) t = warped(t);
  out.prepared.hand = release::PolynomialHand(release::PolynomialHand::Polynomial(breaks, pieces), jumps);
  out.prepared.start = warped(thrown.prepared.start);
  std::erase_if(out.observed.all, [&](const auto& o) {
    return phase_of(o, thrown.opening, HUGE_VAL) != Phase::landing &&
           (o.time < out.prepared.start || (is_wrench(o.channel) && o.time > out.prepared.hand.end()));
  });
  return out;
}

/// Held and let go by the same gripper, but another object.
CampaignThrow with_object(const CampaignThrow& thrown, const CampaignThrow& of) {
  CampaignThrow out = thrown;
  out.prepared.object = of.prepared.object;
  out.prepared.body = of.prepared.body;
  out.prepared.drag_k = of.prepared.drag_k;
  out.prepared.grasp.com_offset = of.prepared.grasp.com_offset;
  return out;
}

struct Sensor {
  const char* name;
  Channel first;
  int channels;
  double rate;                  ///< [1/s]; 0: once, at the landing
  std::array<double, 3> sigma;  ///< of a common one
};
constexpr Sensor kSensors[] = {
    {"the pads' wrench (F/T)", Channel::wrench_fx, 3, 500, {0.02, 0.02, 2e-4}},
    {"motion capture", Channel::mocap_x, 3, 240, {2e-4, 2e-4, 3.5e-3}},
    {"the landing's place and time", Channel::landing_x, 3, 0, {1e-3, 9e-3, 1e-3}}};

bool has(const CampaignThrow& thrown, Channel channel) {
  return std::any_of(thrown.observed.all.begin(), thrown.observed.all.end(),
                     [&](const auto& o) { return o.channel == channel; });
}

CampaignThrow with_sensor(const CampaignThrow& thrown, const Sensor& sensor) {
  CampaignThrow out = thrown;
  const double begin = thrown.prepared.start, release = thrown.release_or(thrown.opening + 0.05);
  const double end = sensor.first == Channel::wrench_fx ? release : release + 0.3;
  const auto add = [&](double t) {
    for (int c = 0; c < sensor.channels; ++c)
      out.observed.all.push_back({static_cast<Channel>(static_cast<int>(sensor.first) + c), t, 0,
                                  sensor.sigma[static_cast<std::size_t>(c)]});
  };
  if (sensor.rate == 0) {
    add(end);
    return out;
  }
  for (double t = begin + 0.5 / sensor.rate; t < end; t += 1 / sensor.rate) add(t);
  return out;
}

/// A throw of this log, or of an experiment that could be made.
struct Trial {
  std::string what;  ///< the experiment, in words
  CampaignThrow thrown;
  std::vector<double> own;
  double weight;
  int experiment;  ///< trials of one number are one experiment; −1: this log
  std::optional<Eigen::MatrixXd> gram;
};

/// The log's throws, and every experiment that is thought of.
std::vector<Trial> trials_of(const Stage& stage) {
  const auto& throws = stage.problem.throws();
  std::vector<Trial> out;
  std::map<std::string, std::size_t> conditions, objects;
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < throws.size(); ++i) {
    if (!stage.fit.throws[i].used) continue;
    used.push_back(i);
    out.push_back({"", throws[i], stage.fit.throws[i].own, 1, -1, {}});
    conditions.try_emplace(throws[i].prepared.experiment(), i);
    objects.try_emplace(throws[i].prepared.object, i);
  }
  int count = 0;
  const std::vector<double> none(stage.problem.own().size(), 0.0);
  for (const auto& [name, i] : conditions) {
    for (const double speed : {0.5, 0.8, 1.25})
      out.push_back(
          {fmt::format("{:.0f} throws of {} with the hand {:.2f} times as fast", kRepetitions, name, speed),
           at_speed(throws[i], speed),
           none,
           kRepetitions,
           count++,
           {}});
    for (const auto& [object, of] : objects)
      if (object != throws[i].prepared.object)
        out.push_back({fmt::format("{:.0f} throws of {} moved as {}", kRepetitions, object, name),
                       with_object(throws[i], throws[of]),
                       none,
                       kRepetitions,
                       count++,
                       {}});
  }
  for (const Sensor& sensor : kSensors) {
    for (const std::size_t i : used)
      if (!has(throws[i], sensor.first))
        out.push_back({fmt::format("add {} to the throws of this log", sensor.name),
                       with_sensor(throws[i], sensor),
                       stage.fit.throws[i].own,
                       1,
                       count,
                       {}});
    ++count;
  }
  return out;
}

}  // namespace

std::vector<SeparatingExperiment> separating_experiments(const Stage& stage, const AcceptedEffect& accepted,
                                                         const std::string& other,
                                                         const DiscoverOptions& options) {
  std::vector<SeparatingExperiment> out;
  if (is_law(accepted.id)) return out;
  const FootprintColumns columns = columns_of(stage, other);
  if (columns.candidates().empty()) return out;
  std::vector<Trial> trials = trials_of(stage);
  dynamics::parallel_for(trials.size(), options.fit.threads, [&](std::size_t k) {
    try {
      auto gram = columns.gram(trials[k].thrown, trials[k].own);
      if (gram.complete) trials[k].gram = std::move(gram.products);
    } catch (const std::invalid_argument&) {  // an experiment that is outside the physics
    }
  });
  Eigen::MatrixXd now;
  std::map<int, std::pair<std::string, Eigen::MatrixXd>> after;
  for (const Trial& trial : trials) {
    if (!trial.gram) continue;
    if (trial.experiment < 0) {
      if (now.size() == 0)
        now = *trial.gram;
      else
        now += *trial.gram;
      continue;
    }
    const auto [at, first] = after.try_emplace(trial.experiment, trial.what, trial.weight * *trial.gram);
    if (!first) at->second.second += trial.weight * *trial.gram;
  }
  if (now.size() == 0) return out;
  const double before = correlation_in(columns, now, stage, accepted);
  for (const auto& [number, experiment] : after) {
    const double left = correlation_in(columns, now + experiment.second, stage, accepted);
    out.push_back({other, experiment.first, before, left, left < options.equivalent});
  }
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.after < b.after; });
  constexpr std::size_t kShown = 3;
  if (out.size() > kShown) out.resize(kShown);
  return out;
}

}  // namespace unhand::fitting
