// Learning to throw-flip: each model is exact where its assumption holds.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "planners/flip/session.hpp"

namespace unhand::planners::flip {
namespace {

const CommandRange kRange{{-0.5, 0.8, 1}, {0.5, 1.0, 41}};
const Bar kBar{0.242, 1.6e-3, 0.12};

/// Detach states linear in the command, or landings that are.
struct LinearPlant {
  bool linear_landing{};
  double shift{};  ///< of the centre of mass, against the bar that the numbers are of

  FlipTrial operator()(const TrialRequest& request) const {
    const auto f = kRange.fractions(request.command);
    const double p = f[0] - 0.5, s = f[1] - 0.5, d = f[2] - 0.5;
    FlipTrial out;
    out.command = request.command;
    out.detach = {0.75 + 0.05 * s - 0.05 * p,        0.55 + 0.1 * p,
                  -0.2 + 0.4 * p + 0.1 * d,          1.1 + 0.6 * s - 0.5 * p - 0.2 * d,
                  1.3 + 0.5 * s + 0.6 * p - 0.1 * d, 6 + 3 * s + 5 * d};
    out.detach = shifted(out.detach, shift);
    out.landing = linear_landing
                      ? FlipPose{1.3 + 0.4 * s - 0.2 * p - 0.05 * d, 3.5 + 1.5 * s + 0.8 * p + 3 * d}
                      : *fly_flip(out.detach);
    return out;
  }
};

/// The landing of a command that lies on a point of the mesh that the search looks at.
FlipTarget target_on_mesh(const LinearPlant& plant, std::vector<FlipDatum> data, double a, double b,
                          const FlipPose& near) {
  FlipTarget by{near};
  std::stable_sort(data.begin(), data.end(), [&](const FlipDatum& x, const FlipDatum& y) {
    return normalized_error(x.landing, by) < normalized_error(y.landing, by);
  });
  const auto u0 = kRange.fractions(data[0].command), u1 = kRange.fractions(data[1].command),
             u2 = kRange.fractions(data[2].command);
  std::array<double, 3> f{};
  for (std::size_t i = 0; i < 3; ++i) f[i] = u0[i] + a * (u1[i] - u0[i]) + b * (u2[i] - u0[i]);
  return {plant({"", 0, kRange.at(f[0], f[1], f[2]), kBar}).landing};
}

TEST(FlipError, IsInUnitsOfTheTolerances) {
  const FlipTarget t{{1.2, std::numbers::pi}};
  EXPECT_NEAR(normalized_error({1.25, std::numbers::pi}, t), 1, 1e-12);
  EXPECT_NEAR(normalized_error({1.2, 1.25 * std::numbers::pi}, t), 1, 1e-12);
  EXPECT_TRUE(hits({1.249, 1.24 * std::numbers::pi}, t));
  EXPECT_FALSE(hits({1.251, std::numbers::pi}, t));
  EXPECT_FALSE(hits({1.2, 3 * std::numbers::pi}, t));  // a flip more is not a hit
}

TEST(FlipSupport, IsASimplexWithinTheRange) {
  const auto u = support_simplex(kRange);
  ASSERT_EQ(u.size(), 4u);
  Eigen::Matrix3d edges;
  const auto first = kRange.fractions(u[0]);
  for (Eigen::Index i = 0; i < 3; ++i) {
    const auto f = kRange.fractions(u[static_cast<std::size_t>(i) + 1]);
    for (Eigen::Index k = 0; k < 3; ++k)
      edges(i, k) = f[static_cast<std::size_t>(k)] - first[static_cast<std::size_t>(k)];
    EXPECT_TRUE(kRange.holds(u[static_cast<std::size_t>(i)]));
  }
  EXPECT_GT(std::abs(edges.determinant()), 0.1);
}

TEST(ConeLearner, IsExactInOneStepWhereItsModelHolds) {
  for (const bool landing : {true, false}) {
    const LinearPlant plant{landing};
    const auto support = gather(plant, "support", support_simplex(kRange), 1, kBar).data;
    const FlipTarget target = target_on_mesh(plant, support, 0.3, 0.25, support[3].landing);
    ConeLearner learner(landing ? ForwardModel::landing : ForwardModel::detach, support, target, kRange);
    const LearningPath path = learn(learner, target, support, kBar, plant, {1, 1});
    EXPECT_LT(path.first(), 1e-9) << landing;
    EXPECT_EQ(path.reached(1), 1);
  }
}

// Flight is curved in the command: model 1 misses in one step where model 2 does not.
TEST(ConeLearner, Model1MissesOnTheCurvedFlight) {
  const LinearPlant plant{false};
  const auto support = gather(plant, "support", support_simplex(kRange), 1, kBar).data;
  const FlipTarget target = target_on_mesh(plant, support, 0.6, 0.5, support[3].landing);
  ConeLearner learner(ForwardModel::landing, support, target, kRange);
  EXPECT_GT(learn(learner, target, support, kBar, plant, {1, 1}).first(), 0.05);
}

TEST(ConeLearner, NeverTriesACommandTwiceAndStaysInRange) {
  const LinearPlant plant{false};
  const auto support = gather(plant, "support", support_simplex(kRange), 1, kBar).data;
  const FlipTarget far{{4.0, 30}};  // out of reach: the error must stagnate
  ConeLearner learner(ForwardModel::detach, support, far, kRange);
  const LearningPath path = learn(learner, far, support, kBar, plant, {25, 1});
  for (std::size_t i = 0; i < path.iterations.size(); ++i) {
    EXPECT_TRUE(kRange.holds(path.iterations[i].command));
    for (std::size_t k = 0; k < i; ++k)
      EXPECT_FALSE(path.iterations[i].command == path.iterations[k].command);
  }
  EXPECT_GT(path.iterations.size(), 5u);
}

TEST(ConeLearner, ReSelectionTakesOtherNeighbours) {
  // The nearest three lie on a line: their plane is none, and the next triple must be taken.
  std::vector<FlipDatum> data;
  const LinearPlant plant{true};
  for (const double s : {0.3, 0.5, 0.7}) {
    const FlipCommand u = kRange.at(0.5, s, 0.5);
    data.push_back({u, {}, plant({"", 0, u, kBar}).landing, 1});
  }
  const FlipCommand aside = kRange.at(0.5, 0.5, 1.0);
  data.push_back({aside, {}, plant({"", 0, aside, kBar}).landing, 1});
  const FlipTarget target{{1.31, 3.9}};
  ConeLearner learner(ForwardModel::landing, data, target, kRange);
  const auto u = learner.next();
  ASSERT_TRUE(u);
  EXPECT_GT(std::abs(kRange.fractions(*u)[2] - 0.5), 0.05);  // off the line
}

/// Three commands on a line: they span no plane.
std::vector<FlipDatum> on_a_line() {
  std::vector<FlipCommand> line;
  for (const double s : {0.3, 0.5, 0.7}) line.push_back(kRange.at(0.5, s, 0.5));
  return gather(LinearPlant{}, "support", line, 1, kBar).data;
}

TEST(ConeLearner, GivesUpWithoutNeighbours) {
  ConeLearner learner(ForwardModel::detach, on_a_line(), {{1.2, 3}}, kRange);
  EXPECT_FALSE(learner.next());
  const LearningPath path = learn(learner, {{1.2, 3}}, {}, kBar, LinearPlant{}, {3, 1});
  EXPECT_TRUE(path.gave_up);
  EXPECT_TRUE(std::isinf(path.minimum()));
}

TEST(ConeLearner, RefusesWhatItCannotSearch) {
  const auto support = gather(LinearPlant{}, "support", support_simplex(kRange), 1, kBar).data;
  const auto made = [&](std::vector<FlipDatum> data, const FlipTarget& target) {
    ConeLearner(ForwardModel::detach, std::move(data), target, kRange);
  };
  EXPECT_NO_THROW(made(support, {{1.2, 3}}));
  EXPECT_THROW(made({}, {{1.2, 3}}), std::invalid_argument);
  EXPECT_THROW(made({support[0], support[1], support[0]}, {{1.2, 3}}), std::invalid_argument);
  auto odd = support;
  odd[1].landing.x = NAN;
  EXPECT_THROW(made(odd, {{1.2, 3}}), std::invalid_argument);
  for (const FlipTarget& target :
       {FlipTarget{{NAN, 3}}, {{1.2, INFINITY}}, {{1.2, 3}, 0}, {{1.2, 3}, 1, NAN}})
    EXPECT_THROW(made(support, target), std::invalid_argument);
}

TEST(FlipFlight, RefusesWhatIsNoState) {
  EXPECT_THROW(fly_flip({NAN, 0.5, 0, 1, 1, 6}), std::invalid_argument);
  EXPECT_THROW(fly_flip({0.7, 0.5, 0, 1, INFINITY, 6}), std::invalid_argument);
}

TEST(Transfer, ShiftIsARigidBodys) {
  const DetachVector d{0.7, 0.5, 0.4, 1.0, 1.2, 7.0};
  const double h = 0.06;
  const DetachVector moved = shifted(d, h), back = shifted(moved, -h);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(back[i], d[i], 1e-15);
  // v' = v + ω × r, and the angle as the paper counts it: from hanging, the shift is (sin, −cos).
  const double hanging = d[2] + kFromHanging;
  EXPECT_NEAR(moved[0] - d[0], h * std::sin(hanging), 1e-15);
  EXPECT_NEAR(moved[1] - d[1], -h * std::cos(hanging), 1e-15);
  EXPECT_NEAR(moved[3] - d[3], d[5] * h * std::cos(hanging), 1e-14);
  EXPECT_NEAR(moved[4] - d[4], d[5] * h * std::sin(hanging), 1e-14);
}

// A bar that is the same lands where it was seen to, not where its measured detach would bring it.
TEST(Transfer, WithoutAShiftDataAreAsMeasured) {
  const FlipDatum seen{{0.1, 0.8, 50}, {0.7, 0.5, 0.4, 1.0, 1.2, 7.0}, {1.1, 3.1}, 3};
  const std::vector<FlipDatum> same = transferred(std::array{seen}, 0),
                               moved = transferred(std::array{seen}, 1e-6);
  ASSERT_EQ(same.size(), 1u);
  ASSERT_EQ(moved.size(), 1u);
  EXPECT_EQ(same[0].landing.x, seen.landing.x);
  EXPECT_EQ(same[0].landing.angle, seen.landing.angle);
  EXPECT_NEAR(moved[0].landing.x, fly_flip(seen.detach)->x, 1e-5);
  EXPECT_GT(std::abs(moved[0].landing.x - seen.landing.x), 0.01);
}

TEST(Transfer, IsExactInItsFirstTwoIterationsWhereItsAssumptionHolds) {
  const LinearPlant old{false, 0.0}, now{false, 0.06};
  const auto past = gather(old, "population", population_grid(kRange), 1, kBar).data;
  const auto as_now = transferred(past, 0.06);
  ASSERT_EQ(as_now.size(), past.size());
  const FlipTarget target = target_on_mesh(now, as_now, 0.4, 0.3, {1.35, 4.0});
  TransferLearner learner(past, 0.06, target, kRange);
  const Bar bar{kBar.mass, kBar.inertia, 0.18};
  const LearningPath path = learn(learner, target, as_now, bar, now, {4, 1, true});
  ASSERT_EQ(path.iterations.size(), 4u);
  EXPECT_NEAR(path.iterations[0].error, path.initial, 1e-9);  // the nearest command of the past
  EXPECT_LT(path.iterations[1].error, 0.15);                  // linear: only the mesh's spacing is left
  EXPECT_LT(path.minimum(), 0.1);
}

// The third iteration begins from the second, in the plane of the best, the next and the fourth of the past.
TEST(Transfer, ItsThirdIterationLooksIntoAnotherPlane) {
  const LinearPlant old{false, 0.0}, now{false, 0.06};
  const auto past = gather(old, "population", population_grid(kRange), 1, kBar).data;
  const auto between = [](const FlipCommand& from, const FlipCommand& to) {
    const auto a = kRange.fractions(from), b = kRange.fractions(to);
    return Eigen::Vector3d(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
  };
  int planes = 0;
  for (const FlipTarget& target :
       {FlipTarget{{1.35, 4.0}}, {{1.2, 3.5}}, {{1.5, 4.5}}, {{1.25, 4.4}}, {{1.4, 3.2}}, {{1.3, 5}}}) {
    auto as_now = transferred(past, 0.06);
    std::stable_sort(as_now.begin(), as_now.end(), [&](const FlipDatum& a, const FlipDatum& b) {
      return normalized_error(a.landing, target) < normalized_error(b.landing, target);
    });
    const auto normal = [&](std::size_t third) {
      return Eigen::Vector3d(between(as_now[0].command, as_now[1].command)
                                 .cross(between(as_now[0].command, as_now[third].command)));
    };
    if (normal(2).norm() < 1e-3 || normal(3).norm() < 1e-3 ||
        normal(2).normalized().cross(normal(3).normalized()).norm() < 1e-3)
      continue;  // on a line, or in one plane
    TransferLearner learner(past, 0.06, target, kRange);
    const LearningPath path =
        learn(learner, target, transferred(past, 0.06), {kBar.mass, kBar.inertia, 0.18}, now, {3, 1, true});
    ASSERT_EQ(path.iterations.size(), 3u);
    ++planes;
    const Eigen::Vector3d second = between(path.iterations[0].command, path.iterations[1].command),
                          third = between(path.iterations[1].command, path.iterations[2].command);
    EXPECT_NEAR(second.dot(normal(2)), 0, 1e-9) << target.pose.x;
    EXPECT_NEAR(third.dot(normal(3)), 0, 1e-9) << target.pose.x;
  }
  EXPECT_GE(planes, 1);
}

// The nearest of the past differ in one parameter only, so that its three opening commands span no plane.
TEST(Transfer, GoesOnWhereItsCommandsLieOnALine) {
  const LinearPlant plant{false};
  std::vector<FlipCommand> past;
  for (const double speed : {0.4, 0.5, 0.6, 0.7}) past.push_back(kRange.at(0.5, speed, 0.5));
  past.push_back(kRange.at(0.9, 0.1, 0.1));
  past.push_back(kRange.at(0.1, 0.9, 0.9));
  const auto data = gather(plant, "population", past, 1, kBar).data;
  const FlipTarget target{plant({"", 0, kRange.at(0.5, 0.55, 0.52), kBar}).landing};
  TransferLearner learner(data, 0.0, target, kRange);
  const LearningPath path = learn(learner, target, data, kBar, plant, {9, 1});
  EXPECT_FALSE(path.gave_up);
  ASSERT_EQ(path.iterations.size(), 9u);
  for (std::size_t i = 0; i < 9; ++i)
    for (std::size_t k = 0; k < i; ++k)
      EXPECT_FALSE(path.iterations[i].command == path.iterations[k].command) << i << " " << k;
}

// The nearest command of the past does not let the bar go; three others that do lie so that their mesh comes
// back to it, whose prediction is the target itself.
TEST(Transfer, DoesNotRepeatACommandThatNeverLanded) {
  const LinearPlant plant{false};
  const auto thrown = [&](double a, double b, double c) {
    FlipTrial out = plant({"", 0, kRange.at(a, b, c), kBar});
    out.outcome = FlipOutcome::landed;
    return out;
  };
  const std::vector<FlipCommand> past{kRange.at(0.5, 0.5, 0.5), kRange.at(0.9, 0.1, 0.1),
                                      kRange.at(0.1, 0.9, 0.9), kRange.at(0.9, 0.9, 0.5)};
  const auto data = gather(plant, "population", past, 1, kBar).data;
  TransferLearner learner(data, 0.0, {thrown(0.5, 0.5, 0.5).landing}, kRange);
  const auto first = learner.next();
  ASSERT_TRUE(first);
  ASSERT_TRUE(*first == past[0]);
  FlipTrial failed;
  failed.command = *first;
  failed.outcome = FlipOutcome::not_let_go;
  learner.observe(std::span(&failed, 1));
  // past[0] is half way between the first two.
  for (const FlipTrial& one : {thrown(0.4, 0.5, 0.5), thrown(0.6, 0.5, 0.5), thrown(0.4, 0.7, 0.5)}) {
    ASSERT_TRUE(learner.next());
    learner.observe(std::span(&one, 1));
  }
  const auto again = learner.next();
  ASSERT_TRUE(again);
  const auto f = kRange.fractions(*again);
  EXPECT_GT(std::hypot(f[0] - 0.5, f[1] - 0.5, f[2] - 0.5), 1e-3);
}

TEST(Transfer, NeedsFourThrows) {
  const std::vector<FlipDatum> few(3);
  EXPECT_THROW(TransferLearner(few, 0.06, {{1.2, 3}}, kRange), std::invalid_argument);
}

TEST(Path, CountsIterationsToTheThreshold) {
  LearningPath path;
  path.initial = 3;
  path.iterations.resize(3);
  path.iterations[0].error = 4;
  path.iterations[1].error = 0.5, path.iterations[1].hits = 2;
  path.iterations[2].error = 0.7, path.iterations[2].hits = 3;
  EXPECT_EQ(path.reached(2), 2);
  EXPECT_EQ(path.reached(3), 3);
  EXPECT_EQ(path.reached(4), 0);
  EXPECT_EQ(path.first(), 4);
  EXPECT_EQ(path.minimum(), 0.5);
  EXPECT_EQ(path.lowest(1), 3);
  path.initial = 0.2;
  EXPECT_EQ(path.minimum(), 0.2);
  path.initial_is_seen = false;  // a landing that was only predicted is no success
  EXPECT_EQ(path.minimum(), 0.5);
  EXPECT_EQ(path.lowest(1), 4);
}

// Throws that never land have no landing to take the mean of.
TEST(FlipError, MeansAreOfWhatLanded) {
  std::vector<FlipTrial> trials(3);
  for (std::size_t k = 0; k < 3; ++k) {
    trials[k].outcome = FlipOutcome::landed;
    trials[k].landing = {1.0 + 0.1 * static_cast<double>(k), 3.0};
    trials[k].detach[5] = static_cast<double>(k);
  }
  trials[1].outcome = FlipOutcome::never_lands;
  const auto mean = mean_of(trials);
  ASSERT_TRUE(mean);
  EXPECT_EQ(mean->throws, 2);
  EXPECT_DOUBLE_EQ(mean->landing.x, 1.1);
  EXPECT_DOUBLE_EQ(mean->detach[5], 1);
  EXPECT_FALSE(mean_of(std::span(trials).subspan(1, 1)));
}

// Every throw of a path and of a grid has an index of its own, and a throw that lands elsewhere is no hit.
TEST(Path, EveryThrowIsAnotherOne) {
  const LinearPlant plant{false};
  std::vector<int> asked;
  const Thrower thrower = [&](const TrialRequest& request) {
    asked.push_back(request.index);
    FlipTrial out = plant(request);
    out.landing.x += request.index % 2 == 0 ? 0 : 1;  // every other one goes astray
    return out;
  };
  const auto support = gather(plant, "support", support_simplex(kRange), 1, kBar).data;
  const FlipTarget target = target_on_mesh(plant, support, 0.3, 0.25, support[3].landing);
  ConeLearner learner(ForwardModel::detach, support, target, kRange);
  const LearningPath path = learn(learner, target, support, kBar, thrower, {2, 2});
  EXPECT_EQ(asked, (std::vector{0, 1, 2, 3}));
  ASSERT_FALSE(path.iterations.empty());
  EXPECT_EQ(path.iterations[0].hits, 1);
  asked.clear();
  gather(thrower, "support", support_simplex(kRange), 2, kBar);
  EXPECT_EQ(asked, (std::vector{0, 1, 2, 3, 4, 5, 6, 7}));
}

}  // namespace
}  // namespace unhand::planners::flip
