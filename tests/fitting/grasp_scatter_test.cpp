// Where repetitions are held across the object, by motion capture that was written by hand.
#include "fitting/grasp_scatter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "dynamics/frames.hpp"
#include "fitting/distributions.hpp"
#include "tests/support/small_campaign.hpp"

namespace unhand::fitting {
namespace {

constexpr int kSeen = 16;  // samples of each throw before its opening

/// A campaign of pairs of repetitions whose objects are held `apart` from the mean of the pair, either way,
/// and are seen with an error of ±`error` about that, `alike` samples of one sign following each other.
GraspScatter of_pairs(double apart, double error, int alike) {
  auto design = testing_support::small_design("limit_surface_disc");
  design.sensors.mocap_rate = 240;
  auto log = experiment::generate_campaign(design, 5);
  std::vector<experiment::PreparedThrow> prepared;
  std::map<std::string, int> repetition;
  for (auto& one : log.throws) {
    prepared.push_back(experiment::prepare(log, one, "synthetic"));
    const experiment::PreparedThrow& p = prepared.back();
    const double place = repetition[p.experiment()]++ % 2 == 0 ? apart : -apart;
    int seen = 0;
    one.mocap->valid.assign(one.mocap->time.rows, 0);
    for (std::size_t i = 0; i < one.mocap->time.rows && seen < kSeen; ++i) {
      const double t = one.mocap->time(i);
      if (t < p.hand.begin() || t >= p.open_command) continue;
      const auto hand = p.hand.at(dynamics::Window{p.hand.begin(), p.hand.end()}, t).pose;
      const double across = place + (seen / alike % 2 == 0 ? error : -error);
      const auto at = dynamics::rotate(hand.theta, dynamics::Vec2<double>{0.01, across});
      one.mocap->pose(i, 0) = hand.x + at.x, one.mocap->pose(i, 1) = hand.z + at.z;
      one.mocap->pose(i, 2) = hand.theta;
      one.mocap->valid[i] = 1, ++seen;
    }
    EXPECT_EQ(seen, kSeen);
  }
  for (const auto& [pair, n] : repetition) EXPECT_EQ(n, 2) << pair;
  return grasp_scatter_across(log, prepared);
}

// Two that are m off their mean scatter by 2 m², of which the noise of a mean of sixteen is no scatter.
TEST(GraspScatter, OfPairsIsTwiceTheSquareLessTheNoiseOfAMean) {
  constexpr double kApart = 4e-4, kError = 1e-3;
  const double variance = kError * kError * kSeen / (kSeen - 1);  // of a sample
  const GraspScatter found = of_pairs(kApart, kError, 1);
  EXPECT_EQ(found.throws, 12);
  EXPECT_NEAR(std::pow(found.sigma, 2), 2 * kApart * kApart - variance / kSeen, 1e-10);
  EXPECT_NEAR(found.p_value, chi2_tail(6 * 2 * kApart * kApart / (variance / kSeen), 6), 1e-9);
}

// Errors that stay for four samples: of sixteen, three pairs of neighbours differ and twelve do not, so that
// neighbours correlate by 9/16, and a mean is (1 + 9/16)/(1 − 9/16) times as uncertain.
TEST(GraspScatter, NoiseThatStaysMakesAMeanLessCertain) {
  constexpr double kApart = 6e-4, kError = 1e-3;
  const double of_mean = kError * kError / (kSeen - 1) * 25 / 7;
  EXPECT_NEAR(std::pow(of_pairs(kApart, kError, 4).sigma, 2), 2 * kApart * kApart - of_mean, 1e-10);
  EXPECT_EQ(of_pairs(1e-4, kError, 4).sigma, 0);
}

}  // namespace
}  // namespace unhand::fitting
