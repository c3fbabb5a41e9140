// What the loop believes, number by number: thresholds at which a misfit, a gain or a lack counts.
#include "fitting/discovery/acceptance.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "fitting/discovery/misfit_rules.hpp"
#include "tests/fitting/loop_campaign.hpp"

namespace unhand::fitting {
namespace {

using experiment::Channel;

FitResult thousand_samples(Channel channel, Phase phase, double per_sample) {
  FitResult out;
  auto& m = out.misfit.emplace_back();
  m.channel = channel, m.phase = phase, m.n = 1000, m.chi2 = 1000 * per_sample;
  return out;
}

// In the firm grasp the cameras see where the object was put; a model that follows that better throws no
// better. The pads' wrenches there are Newton's law.
TEST(Improvement, OfPosesInTheFirmGraspIsNone) {
  const auto of = [](Channel channel, Phase phase) {
    return improvement(thousand_samples(channel, phase, 100), thousand_samples(channel, phase, 1), {}, {});
  };
  EXPECT_EQ(of(Channel::mocap_x, Phase::grasped).matters, 0);
  EXPECT_EQ(of(Channel::mocap_theta, Phase::grasped).where, "");
  EXPECT_GT(of(Channel::mocap_x, Phase::flight).matters, 1);
  EXPECT_GT(of(Channel::wrench_fx, Phase::grasped).matters, 1);
}

// A law of drag that is right to a tenth leaves a hundredth of the drag's chi-square: that is no new effect.
TEST(Improvement, OfAHundredthOfWhatThereWasIsThatOfTheLastEffect) {
  const auto fall = [](double from, double base) {
    const auto air = [](double per_sample) {
      return thousand_samples(Channel::mocap_x, Phase::flight, per_sample);
    };
    return improvement(air(from), air(1), air(base).misfit, {}).matters;
  };
  EXPECT_GT(fall(61, 61), 1);
  EXPECT_LT(fall(61, 6101), 1);
  EXPECT_GT(fall(63, 6101), 1);
}

// Of normal residuals whose variance is v for v_0, n of them: the likelihood is (v_0/v)^(n/2) times as large.
TEST(HeldOut, ThrowsConfirmFromTwentyTimesTheLikelihoodOn) {
  const CampaignProblem problem(support::loop_campaign({}), "synthetic", {});
  const auto confirms = [&](double times) {
    constexpr double kVariance = 2;
    const Stage after{problem, {}, thousand_samples(Channel::mocap_x, Phase::flight, kVariance), {}},
        before{problem,
               {},
               thousand_samples(Channel::mocap_x, Phase::flight, kVariance * std::pow(times, 2 / 1000.0)),
               {}};
    return held_out_confirms(before, after);
  };
  EXPECT_FALSE(confirms(18));
  EXPECT_TRUE(confirms(22));
  EXPECT_FALSE(confirms(1 / 22.0)) << "less likely";
}

// Errors that repetitions share are lacking in the model where they are as large as the scatter, no chance,
// and more than one reading of the sensor tells.
TEST(Lacking, IsWhatRepetitionsShareAndTheSensorCanTell) {
  const auto lacks = [](double shared, double p_value, double resolution) {
    return is_lacking({Outcome::landing_x, {1e-6, shared * shared, p_value}, resolution}, 0.01);
  };
  EXPECT_TRUE(lacks(2e-3, 1e-3, 1.9e-3));
  EXPECT_FALSE(lacks(2e-3, 1e-3, 2.1e-3));
  EXPECT_FALSE(lacks(2e-3, 0.02, 1.9e-3));
  EXPECT_FALSE(lacks(0.9e-3, 1e-3, 0.5e-3)) << "repetitions scatter by 1e-3";
}

// Chance does not strike both halves of the throws: of a hundred samples of noise, 1.25 per sample is one in
// twenty (95 % of chi-square of 100: 124.3).
TEST(Misfit, IsConfirmedWhereTheOtherHalfHasItToo) {
  const auto confirmed = [](double chi2) {
    ChannelMisfit there;
    there.channel = Channel::landing_x, there.phase = Phase::landing, there.n = 100, there.chi2 = chi2;
    return is_confirmed({there}, there);
  };
  EXPECT_TRUE(confirmed(124.5));
  EXPECT_FALSE(confirmed(124.2));
  const auto flight = thousand_samples(Channel::mocap_x, Phase::flight, 9).misfit;
  EXPECT_FALSE(is_confirmed({}, flight.front())) << "no sensor saw it there";
  EXPECT_FALSE(is_confirmed(flight, thousand_samples(Channel::mocap_x, Phase::release, 9).misfit.front()));
}

}  // namespace
}  // namespace unhand::fitting
