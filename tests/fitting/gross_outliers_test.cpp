// Groups that err as no other does, by inner products that are written down.
#include "fitting/gross_outliers.hpp"

#include <gtest/gtest.h>

#include <random>

namespace unhand::fitting {
namespace {

/// 24 groups of 100 samples: one effect of size 3 that group k shows k + 1 times, and white noise; what group
/// k adds besides, `more(k)` per sample in χ², is of no effect.
template <class More>
std::vector<GroupFooting> groups(const More& more) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::vector<GroupFooting> out;
  for (std::size_t k = 0; k < 24; ++k) {
    Eigen::MatrixXd columns(100, 2);  // of the effect; the residual
    for (Eigen::Index i = 0; i < 100; ++i) {
      columns(i, 0) = static_cast<double>(k + 1) * normal(random);
      columns(i, 1) = normal(random) + std::sqrt(more(k)) * normal(random) - 3 * columns(i, 0);
    }
    out.push_back({k, k % 4 != 0, 100, columns.transpose() * columns});
  }
  return out;
}

TEST(GrossOutliers, AreThoseThatTheEffectsDoNotExplain) {
  EXPECT_TRUE(gross_outliers(groups([](std::size_t) { return 0.0; }), 3).empty())
      << "group 23 shows the effect 500 times as strongly as group 0";
  for (const std::size_t wild : {8U, 9U}) {  // held out, train
    const auto found = gross_outliers(groups([&](std::size_t k) { return k == wild ? 400.0 : 0; }), 3);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found.front().group, wild);
    EXPECT_NEAR(found.front().times, 400, 120);
    EXPECT_GT(found.front().apart, 150);
  }
}

TEST(GrossOutliers, AreMoreThanTenTimesOff) {
  EXPECT_TRUE(gross_outliers(groups([](std::size_t k) { return k == 9 ? 4.0 : 0; }), 3).empty());
}

TEST(GrossOutliers, AreFew) {
  EXPECT_EQ(gross_outliers(groups([](std::size_t k) { return k < 3 ? 400.0 : 0; }), 3).size(), 3U);
  EXPECT_TRUE(gross_outliers(groups([](std::size_t k) { return k < 4 ? 400.0 : 0; }), 3).empty());
}

TEST(GrossOutliers, AreNoneWhereAllErrByDegrees) {
  EXPECT_TRUE(gross_outliers(groups([](std::size_t k) { return std::exp(0.3 * static_cast<double>(k)); }), 3)
                  .empty());
}

// A log's groups have numbers of their own, and say nothing by how many samples they have.
TEST(GrossOutliers, AreNamedByTheirNumber) {
  auto of = groups([](std::size_t k) { return k == 9 ? 400.0 : 0; });
  for (auto& one : of) one.group += 100;
  of[5].n *= 30, of[5].gram *= 30;  // thirty times the samples, and what they add up to
  const auto found = gross_outliers(of, 3);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found.front().group, 109U);
}

// One that shows the opposite of the effect as strongly as a fifth of all others together does not speak for
// them.
TEST(GrossOutliers, DoNotBendWhatTheOthersShow) {
  auto of = groups([](std::size_t) { return 0.0; });
  const double opposite = 103;  // of the effect's size, 3, to −100
  auto& gram = of[22].gram;
  gram(1, 1) += 2 * opposite * gram(0, 1) + opposite * opposite * gram(0, 0);
  gram(0, 1) += opposite * gram(0, 0), gram(1, 0) = gram(0, 1);
  const auto found = gross_outliers(of, 3);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found.front().group, 22U);
  EXPECT_NEAR(found.front().times, opposite * opposite * 23 * 23, 0.3 * opposite * opposite * 23 * 23);
}

// A held-out group that is set aside may need one of train in its place: of two, none can be spared.
TEST(GrossOutliers, AreNoneWhereTrainGroupsAreTooFewToReplaceThem) {
  auto of = groups([](std::size_t k) { return k == 8 ? 400.0 : 0; });
  EXPECT_EQ(gross_outliers(of, 3).size(), 1U);
  for (std::size_t k = 0; k < of.size(); ++k) of[k].train = k == 1 || k == 2;
  EXPECT_TRUE(gross_outliers(of, 3).empty());
}

TEST(GrossOutliers, StayWhereAnAnswerLeavesThem) {
  const auto of = groups([](std::size_t k) { return k == 9 ? 400.0 : 0; });
  const auto wild = gross_outliers(of, 3);
  auto explained = of;
  const Eigen::VectorXd size = Eigen::VectorXd::Constant(1, 3);
  for (auto& one : explained) one.gram = Eigen::MatrixXd::Constant(1, 1, one.n * one.misfit(size));
  EXPECT_EQ(still_gross(wild, explained, 3), wild);
  explained[9].gram.setConstant(100);
  EXPECT_TRUE(still_gross(wild, explained, 3).empty());
}

}  // namespace
}  // namespace unhand::fitting
