// How far a number may be off where conditions, or sensors, disagree: one unknown, by least squares that
// leave out a part.
#include "fitting/discovery/discrepancy.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "fitting/normal_equations.hpp"
#include "tests/fitting/loop_campaign.hpp"

namespace unhand::fitting {
namespace {

/// What samples say of the one unknown: x = gradient/information lies off the fit's value.
struct Witness {
  double information{}, gradient{};
  double off() const { return gradient / information; }
  double variance() const { return 1 / information; }
  Witness operator+(const Witness& w) const { return {information + w.information, gradient + w.gradient}; }
  Witness operator-(const Witness& w) const { return {information - w.information, gradient - w.gradient}; }
};

using IsTaken = std::function<bool(const experiment::Observation&, Phase)>;

/// Flights of one bar under six conditions, of which only the drag is fitted.
class DiscrepancyOfOneUnknown : public testing::Test {
 protected:
  static constexpr double kDetach = 0.13;  // s, about

  void fit_drag(const std::vector<double>& draughts, double landing_moved = 0, double camera_noise = 1) {
    datasets::ThrowLog log = support::loop_campaign({{"flight.quadratic_drag.k", 0.1}});
    std::erase_if(log.throws, [&](const auto& one) { return one.object != log.throws.back().object; });
    std::map<std::string, double> accelerations;  // m/s² along x, by condition
    for (auto& one : log.throws) {
      one.split = datasets::Split::train;
      const double a =
          accelerations.try_emplace(one.condition, draughts[accelerations.size() % draughts.size()])
              .first->second;
      const auto moved = [&](double t) { return t > kDetach ? 0.5 * a * std::pow(t - kDetach, 2) : 0; };
      for (std::size_t i = 0; i < one.mocap->time.rows; ++i)
        one.mocap->pose(i, 0) += moved(one.mocap->time(i));
      for (double& sigma : one.mocap->pose.sigma) sigma *= camera_noise;
      one.landing->pose(0, 0) += moved(one.landing->time(0)) + landing_moved;
    }
    CampaignOptions options;
    options.effects = {"flight.quadratic_drag"};
    options.integrator.tolerances = {1e-5, 1e-8};
    options.check_units = false;
    problem.emplace(log, "synthetic", options);
    FitOptions as_loop;
    as_loop.weigh = Weigh::variances;
    for (const Unknown& u : problem->campaign())
      if (!u.name.starts_with("flight.")) as_loop.fixed.push_back(u.name);
    result = fit(*problem, as_loop);
    ASSERT_TRUE(result.is_answer()) << result.message;
    for (std::size_t k = 0; k < result.campaign.size(); ++k)
      if (result.campaign[k].unknown.name.starts_with("flight.")) drag = k;
    result.campaign[drag].sigma = 1e-6;  // of itself the fit would be sure
  }

  /// Of one throw, by orthogonal projection of what its own unknowns can do.
  Witness says(std::size_t i, const IsTaken& is_taken) const {
    const CampaignThrow& thrown = problem->throws()[i];
    const std::vector<double>& own = result.throws[i].own;
    Linearisation l = problem->linearise(thrown, result.values(), own, DerivativesBy::all);
    Weighting weighting;
    std::copy(result.group_weight.begin(), result.group_weight.end(), weighting.group.begin());
    weigh(l, thrown.observed, thrown, weighting);
    const auto n = static_cast<Eigen::Index>(own.size()), rows = l.residual.size();
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows + n, n);
    Eigen::MatrixXd b = Eigen::MatrixXd::Zero(rows + n, 2);
    for (Eigen::Index j = 0; j < rows; ++j) {
      const auto& o = thrown.observed.all[static_cast<std::size_t>(j)];
      if (!is_taken(o, phase_of(o, thrown.opening, thrown.release_or(l.detach)))) continue;
      A.row(j) = l.own.row(j);
      b(j, 0) = l.campaign(j, static_cast<Eigen::Index>(drag)), b(j, 1) = l.residual[j];
    }
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto at = static_cast<std::size_t>(k);
      A(rows + k, k) = 1 / result.own_spread[at];
      b(rows + k, 1) = own[at] / result.own_spread[at];
    }
    const Eigen::MatrixXd left = b - A * A.householderQr().solve(b);
    const double weight = result.throws[i].weight;
    return {weight * left.col(0).squaredNorm(), weight * left.col(0).dot(left.col(1))};
  }
  Witness all_say(const IsTaken& is_taken) const {
    Witness out;
    for (std::size_t i = 0; i < result.throws.size(); ++i) out = out + says(i, is_taken);
    return out;
  }
  static bool any(const experiment::Observation&, Phase) { return true; }
  static bool is_camera(const experiment::Observation& o) { return is_tracked(o.channel); }

  /// The variance by which the conditions disagree beyond the noise, beside what is known `before`.
  double of_conditions(const Witness& before = {}) const {
    std::map<std::string, Witness> conditions;
    Witness whole = before;
    for (std::size_t i = 0; i < result.throws.size(); ++i) {
      const Witness one = says(i, any);
      Witness& condition = conditions[problem->throws()[i].prepared.experiment()];
      condition = condition + one, whole = whole + one;
    }
    double shares = 0, squares = 0, excess = 0;
    for (const auto& [name, condition] : conditions) {
      const Witness rest = whole - condition;
      excess += std::pow(rest.off() - whole.off(), 2) - (rest.variance() - whole.variance());
      const double share = condition.information / whole.information;
      shares += share, squares += share * share;
    }
    const double n = shares * shares / squares;
    EXPECT_GT(n, 3) << "of " << conditions.size();
    EXPECT_LT(n, static_cast<double>(conditions.size()) + 1e-9);
    return (1 - 1 / n) * std::pow(student_factor(n - 1) / 1.96, 2) * excess;
  }

  /// The variance by which a kind of sensor disagrees with the rest beyond chance, of a value that is known
  /// to `conditions`.
  double of_sensors(double conditions, const Witness& before = {}) const {
    const Witness whole = all_say(any) + before;
    double most = 0;
    for (const IsTaken& is_left_out :
         {IsTaken([](const auto&, Phase phase) { return phase == Phase::landing; }),
          IsTaken([](const auto&, Phase phase) { return phase == Phase::flight; }),
          IsTaken([](const auto&o, Phase phase) { return phase < Phase::flight && is_camera(o); }),
          IsTaken([](const auto&o, Phase phase) { return phase < Phase::flight && !is_camera(o); })}) {
      const Witness rest =
          all_say([&](const auto& o, Phase phase) { return !is_left_out(o, phase); }) + before;
      if (rest.variance() > 100 * whole.variance()) continue;  // knows nothing of its own
      const double step = rest.off() - whole.off(),
                   by_chance = (rest.variance() - whole.variance()) * conditions / whole.variance();
      if (std::abs(step) > 1.5 * std::sqrt(by_chance)) most = std::max(most, step * step - by_chance);
    }
    return most;
  }

  std::optional<CampaignProblem> problem;
  FitResult result;
  std::size_t drag{};
};

const std::vector<double> kStillAir{0}, kDraughts{0.15, -0.1, 0.05, -0.2, 0.1, -0.02};

TEST_F(DiscrepancyOfOneUnknown, ConditionsThatDisagreeWidenByStudentsFactorOfTheirNumber) {
  fit_drag(kDraughts);
  const double noise = all_say(any).variance(), excess = of_conditions();
  ASSERT_GT(excess, 4 * noise);
  ASSERT_EQ(of_sensors(noise + excess), 0);
  count_discrepancy(*problem, result, 1);
  EXPECT_NEAR(std::pow(result.campaign[drag].sigma, 2), noise + excess, 1e-3 * excess);
  EXPECT_TRUE(result.campaign[drag].allows_for_few);
}

// What was known before pulls the same whichever condition, or sensor, is left out: where it contradicts the
// log, it takes part in every disagreement.
TEST_F(DiscrepancyOfOneUnknown, WhatWasKnownBeforeIsLeftOutWithNoPart) {
  fit_drag(kDraughts);
  const double sigma = std::sqrt(all_say(any).variance()), off = 3 * sigma;
  Unknown& u = result.campaign[drag].unknown;
  u.prior_sigma = sigma, u.start = result.campaign[drag].value - off;
  const Witness before{1 / (sigma * sigma), off / (sigma * sigma)};
  const double noise = sigma * sigma / 2, excess = of_conditions(before);
  ASSERT_GT(excess, 4 * noise);
  count_discrepancy(*problem, result, 1);
  EXPECT_NEAR(std::pow(result.campaign[drag].sigma, 2), noise + excess + of_sensors(noise + excess, before),
              1e-3 * excess);
}

// Landings that are read too far off, and counted as declared, contradict the cameras: the step without them
// counts, less what noise makes of it.
TEST_F(DiscrepancyOfOneUnknown, SensorsThatDisagreeWidenByTheStepWithoutTheOne) {
  fit_drag(kStillAir, 0.01, 8);  // of cameras that hardly know better
  std::fill(result.group_weight.begin(), result.group_weight.end(), 1.0);
  const double conditions = all_say(any).variance() + std::max(0.0, of_conditions()),
               sensors = of_sensors(conditions);
  ASSERT_GT(sensors, conditions);
  count_discrepancy(*problem, result, 1);
  EXPECT_NEAR(std::pow(result.campaign[drag].sigma, 2), conditions + sensors, 1e-3 * sensors);
  EXPECT_FALSE(result.campaign[drag].allows_for_few) << "two sensors know little of how much they differ";
}

}  // namespace
}  // namespace unhand::fitting
