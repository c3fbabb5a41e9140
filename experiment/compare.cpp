#include "experiment/compare.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>

#include "dynamics/parallel.hpp"
#include "dynamics/pooled_scatter.hpp"
#include "experiment/glitches.hpp"
#include "experiment/unit_check.hpp"

namespace unhand::experiment {

ErrorStatistics statistics_of(const std::vector<double>& errors) {
  ErrorStatistics out;
  out.n = static_cast<int>(errors.size());
  if (errors.empty()) return out;
  const double n = static_cast<double>(errors.size());
  for (const double e : errors) {
    out.mae += std::abs(e) / n;
    out.bias += e / n;
  }
  for (const double e : errors) out.std += (std::abs(e) - out.mae) * (std::abs(e) - out.mae);
  out.std = errors.size() > 1 ? std::sqrt(out.std / (n - 1)) : 0.0;
  return out;
}

void judge_detach(const PreparedThrow& prepared, ThrowComparison& comparison) {
  const Prediction& prediction = comparison.prediction;
  const auto& measured = prepared.measured;
  if (prediction.release != release::ReleaseOutcome::detached || !measured.detach_twist) return;
  comparison.error[0] = prediction.detach.twist.vx - measured.detach_twist->vx;
  comparison.error[1] = (prediction.detach.twist.omega - measured.detach_twist->omega) * kDegrees;
}

ThrowComparison judge(const PreparedThrow& prepared, const Prediction& prediction) {
  ThrowComparison out{prepared.id, prepared.object, prepared.condition, prepared.split, prediction, {}};
  const MeasuredOutcome& measured = prepared.measured;
  judge_detach(prepared, out);
  if (prediction.landed()) {
    if (measured.landing_x) out.error[2] = prediction.landing.pose.x - *measured.landing_x;
    if (measured.landing_theta)
      out.error[3] = (prediction.landing.pose.theta - *measured.landing_theta) * kDegrees;
  }
  return out;
}

namespace {

template <class Keep>
ErrorStatistics collect(const std::vector<ThrowComparison>& throws, int quantity, Keep&& keep) {
  if (quantity < 0 || quantity >= kQuantityCount)
    throw std::invalid_argument(fmt::format("quantity {} is not in [0, {})", quantity, kQuantityCount));
  std::vector<double> errors;
  for (const auto& t : throws)
    if (keep(t) && t.error[quantity]) errors.push_back(*t.error[quantity]);
  return statistics_of(errors);
}

RepetitionScatter scatter_of(const std::vector<PreparedThrow>& throws) {
  const auto pooled = [&](auto measured) {
    std::map<std::string, std::vector<double>> repetitions;
    for (const auto& t : throws)
      if (const std::optional<double> value = measured(t.measured))
        repetitions[t.experiment()].push_back(*value);
    dynamics::PooledScatter out;
    for (const auto& [experiment, values] : repetitions) out.add(values);
    return out;
  };
  const auto sigma = [](const dynamics::PooledScatter& of) {
    return of.freedom() > 0 ? std::optional(of.sigma()) : std::nullopt;
  };
  const auto x = pooled([](const MeasuredOutcome& m) { return m.landing_x; });
  const auto theta = pooled([](const MeasuredOutcome& m) {
    return m.landing_theta ? std::optional(*m.landing_theta * kDegrees) : std::nullopt;
  });
  return {std::max(x.groups(), theta.groups()), sigma(x), sigma(theta)};
}

template <class Throw>
std::vector<ThrownCondition> labelled_conditions(const std::vector<Throw>& throws) {
  std::vector<ThrownCondition> out;
  for (const auto& t : throws) {
    const auto known = std::find_if(out.begin(), out.end(), [&](const ThrownCondition& c) {
      return c.object == t.object && c.condition == t.condition;
    });
    const bool held_out = t.split == datasets::Split::test;
    if (known == out.end())
      out.push_back({t.object, t.condition, {}, held_out});
    else
      known->held_out |= held_out;
  }
  for (ThrownCondition& one : out) {
    const auto sharing = std::count_if(
        out.begin(), out.end(), [&](const ThrownCondition& c) { return c.condition == one.condition; });
    one.label = sharing > 1 ? one.object + ", " + one.condition : one.condition;
  }
  return out;
}

}  // namespace

std::vector<ThrownCondition> conditions_of(const std::vector<ThrowComparison>& throws) {
  return labelled_conditions(throws);
}

ErrorStatistics ModelComparison::statistics(int quantity, datasets::Split split) const {
  return collect(throws, quantity, [&](const ThrowComparison& t) { return t.split == split; });
}
ErrorStatistics ModelComparison::of_condition(int quantity, const ThrownCondition& of) const {
  return collect(throws, quantity, [&](const ThrowComparison& t) {
    return t.object == of.object && t.condition == of.condition &&
           (!of.held_out || t.split == datasets::Split::test);
  });
}

std::vector<PreparedThrow> prepare_all(const datasets::ThrowLog& log, const std::string& file, int threads,
                                       bool check_units) {
  datasets::validate(log, file);
  datasets::ThrowLog clean = log;
  mark_glitches(clean);
  if (check_units) require_units(clean, file);
  std::vector<std::optional<PreparedThrow>> prepared(clean.throws.size());
  dynamics::parallel_for(clean.throws.size(), threads,
                         [&](std::size_t i) { prepared[i] = prepare(clean, clean.throws[i], file); });
  std::vector<PreparedThrow> out;
  out.reserve(prepared.size());
  for (auto& p : prepared) out.push_back(std::move(*p));
  return out;
}

Comparison compare(const datasets::ThrowLog& log, const std::vector<PreparedThrow>& prepared,
                   const CompareOptions& options) {
  Comparison out;
  double force_chi2 = 0, forces = 0;
  for (const auto& t : prepared) {
    out.worst_hand_chi2 = std::max(out.worst_hand_chi2, t.hand_fit.chi2_per_dof);
    if (t.normal_force) force_chi2 += t.force_fit.chi2_per_dof, forces += 1;
  }
  if (forces > 0) out.mean_force_chi2 = force_chi2 / forces;
  out.conditions = labelled_conditions(prepared);
  out.repetitions = scatter_of(prepared);

  for (const auto& model : options.models) {
    ModelComparison result;
    result.model = model;
    if (const auto card = options.parameters.find(model); card != options.parameters.end()) {
      result.estimate.parameters = card->second;
      result.estimate.method = "from the card";
      result.from_card = true;
    } else {
      result.estimate = estimate_friction(log, prepared, model);
      require_patch(result.estimate, model);
    }
    result.estimate.parameters.naive = options.naive;
    std::vector<Prediction> predictions(prepared.size());
    std::vector<double> seconds(prepared.size());
    // The first throw pays for tables and pages that the others find: its time is not taken.
    if (!prepared.empty()) predict(prepared[0], model, result.estimate.parameters, options.integrator);
    dynamics::parallel_for(prepared.size(), options.threads, [&](std::size_t i) {
      const auto begin = std::chrono::steady_clock::now();
      predictions[i] = predict(prepared[i], model, result.estimate.parameters, options.integrator);
      seconds[i] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    });
    for (std::size_t i = 0; i < prepared.size(); ++i) {
      result.throws.push_back(judge(prepared[i], predictions[i]));
      if (!predictions[i].landed()) ++result.failed;
      result.microseconds_per_throw += 1e6 * seconds[i] / static_cast<double>(prepared.size());
    }
    out.models.push_back(std::move(result));
  }
  return out;
}

}  // namespace unhand::experiment
