// A campaign made again from a fit, and the error that a true model leaves.
#include "fitting/discovery/twin.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "dynamics/third_difference.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

using datasets::Split;
using testing::HasSubstr;
using testing_support::small_design;

constexpr const char* kTwinsLaw = "limit_surface_disc";

const datasets::ThrowLog& twinned_log() {
  static const datasets::ThrowLog log = experiment::generate_campaign(small_design(kTwinsLaw), 11);
  return log;
}
const CampaignProblem& twinned() {
  static const CampaignProblem problem(twinned_log(), "(in memory)", {});
  return problem;
}
const FitResult& twinned_fit() {
  static const FitResult result = fit(twinned());
  return result;
}

TEST(Twin, HasTheSameSamplesAndNewNoise) {
  const auto& log = twinned_log();
  const auto twin = twin_of(log, twinned(), twinned_fit(), 5),
             again = twin_of(log, twinned(), twinned_fit(), 5),
             other = twin_of(log, twinned(), twinned_fit(), 6);
  EXPECT_THAT(twin.title, HasSubstr("synthetic"));
  ASSERT_EQ(twin.throws.size(), log.throws.size());
  EXPECT_NO_THROW(datasets::validate(twin));
  double square = 0, n = 0;
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    const auto &a = log.throws[i], &b = twin.throws[i];
    EXPECT_EQ(a.ft->time.data, b.ft->time.data);
    EXPECT_EQ(a.mocap->time.data, b.mocap->time.data);
    EXPECT_EQ(a.split, b.split);
    EXPECT_EQ(b.ft->wrench.data, again.throws[i].ft->wrench.data);
    EXPECT_NE(b.ft->wrench.data, other.throws[i].ft->wrench.data);
    const double sigma = a.ft->wrench.sigma[0];
    for (std::size_t k = 0; k < a.ft->time.rows; ++k) {
      const double d = (a.ft->wrench(k, 0) - b.ft->wrench(k, 0)) / sigma;
      if (a.ft->time(k) < 0.2) continue;  // after every detach: noise against noise
      square += d * d;
      n += 1;
    }
  }
  EXPECT_NEAR(square / n, 2, 6 * std::sqrt(8 / n));  // each with variance 1; six sigma of a mean square
}

TEST(Twin, AHandWithoutADeclaredNoiseHasThatOfItsScatter) {
  auto log = twinned_log();
  for (auto& one : log.throws) one.hand->acceleration.sigma.clear();
  const CampaignProblem problem(log, "(in memory)", {});
  const auto twin = twin_of(log, problem, twinned_fit(), 5);
  const auto noise = [](const datasets::Series& series) {  // by third differences
    double sum = 0;
    for (std::size_t i = 3; i < series.rows; ++i)
      sum += dynamics::third_difference_variance(series(i - 3, 0), series(i - 2, 0), series(i - 1, 0),
                                                 series(i, 0));
    return std::sqrt(sum / static_cast<double>(series.rows - 3));
  };
  for (std::size_t i = 0; i < twin.throws.size(); ++i) {
    const double was = noise(log.throws[i].hand->acceleration);
    EXPECT_NEAR(noise(twin.throws[i].hand->acceleration), was, 0.3 * was) << twin.throws[i].id;
  }
}

TEST(Twin, FloorOfATrueModelIsItsError) {
  const auto throws = predict_throws(twinned(), twinned_fit(), {false, 0});
  const auto errors = comparison_of(twinned(), twinned_fit(), throws);
  const auto floor = error_floor(twinned_log(), "(in memory)", twinned(), twinned_fit(), {}, 4);
  ASSERT_EQ(floor.twins, 4);
  for (int q = 0; q < experiment::kQuantityCount; ++q) {
    const double mae = errors.statistics(q, Split::test).mae, least = floor.statistics(q, Split::test).mae;
    // Four test throws against sixteen of the twins: half-normal errors scatter by 0.75/sqrt(4).
    EXPECT_LT(mae, 2.2 * least) << q;
    EXPECT_GT(mae, least / 3) << q;
  }
}

}  // namespace
}  // namespace unhand::fitting
