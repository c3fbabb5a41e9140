// The derivatives of predicted channels and outcomes, and what is read before the simulation starts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "experiment/outcome_slopes.hpp"
#include "tests/support/perfect_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;
using namespace unhand::testing_support;
using dynamics::Dual;

/// A throw of perfect sensors, by a profile of the normal force.
struct Thrown {
  CampaignDesign design = [] {
    CampaignDesign out = perfect();
    for (auto& object : out.objects) object.drag_k = kDrag;
    out.sensors.landing_time_sigma = 1e-15;  // declared, or the landing's time is no observation
    return out;
  }();
  datasets::ThrowLog log = campaign_header(design, kSeed);
  ThrowTruth truth;
  PreparedThrow prepared = [&] {
    auto made = generate_throw(design, kSeed, kThrow);
    truth = made.truth;
    log.throws = {made.record};
    PreparedThrow out = prepare(log, log.throws[0], "(in memory)");
    out.hand = polynomial_hand(throw_motion(design.arm, truth.motion));
    out.normal_force.reset();
    return out;
  }();
  ThrowModel model{"limit_surface_disc", truth.patch.pads, design.reference_force(), [] {
                     dynamics::IntegratorOptions out;
                     out.tolerances = {1e-11, 1e-13};
                     out.method = dynamics::Method::radau;  // for both scalars: they take the same steps
                     return out;
                   }()};
  const std::vector<std::string> names{"mu",
                                       "grip_force",
                                       "opening_time",
                                       "grasp_angle",
                                       "sensor.ft_time_offset.offset",
                                       "sensor.mocap_time_offset.offset",
                                       "sensor.length_scale.scale",
                                       "sensor.com_offset.offset",
                                       "sensor.mass.ratio",
                                       "sensor.ft_bias.tau",
                                       "flight.quadratic_drag.k",
                                       "flight.wind.w_x"};
  std::vector<double> values{truth.patch.mu,
                             truth.opening.grip_force,
                             truth.opening.opening_time,
                             0.01,
                             4e-4,
                             -7e-4,
                             1.01,
                             2e-3,
                             1.03,
                             1e-3,
                             0.02,
                             0.8};

  template <class S>
  ThrowPrediction<S> predict(const Observations& observed, const std::vector<S>& x) const {
    return predict_channels(prepared, observed, model, dynamics::Values<S>(names, std::span<const S>(x)));
  }
};

/// A dozen samples of each channel, none of them near a switch of the wrench.
Observations some_of(const Observations& all) {
  Observations out;
  std::array<std::vector<Observation>, kChannelCount> by_channel;
  for (const Observation& o : all.all) by_channel[static_cast<std::size_t>(o.channel)].push_back(o);
  for (const auto& of : by_channel)
    for (std::size_t i = 0; i < of.size(); i += std::max<std::size_t>(1, of.size() / 12))
      out.all.push_back(of[i]);
  return out;
}

TEST(PredictionDerivatives, OfEveryChannelAreCentralDifferences) {
  const Thrown thrown;
  const Observations observed = some_of(observe(thrown.log, thrown.log.throws[0], thrown.prepared));
  ASSERT_GT(observed.all.size(), 60u);
  const std::size_t count = observed.all.size();
  for (std::size_t k = 0; k < thrown.names.size(); ++k) {
    std::vector<Dual> seeded(thrown.values.begin(), thrown.values.end());
    seeded[k] = dynamics::independent(thrown.values[k], 0);
    const auto exact = thrown.predict(observed, seeded);
    ASSERT_EQ(exact.channels.size(), count);
    std::vector<double> best(count, std::numeric_limits<double>::infinity());
    const double scale = std::max(std::abs(thrown.values[k]), 1e-3);
    for (const double relative : {1e-3, 1e-4, 1e-5}) {
      const double h = relative * scale;
      auto above = thrown.values, below = thrown.values;
      above[k] += h, below[k] -= h;
      const auto a = thrown.predict(observed, above), b = thrown.predict(observed, below);
      for (std::size_t i = 0; i < count; ++i)
        best[i] =
            std::min(best[i], std::abs((a.channels[i] - b.channels[i]) / (2 * h) - exact.channels[i].v[0]));
    }
    std::array<double, kChannelCount> most{};  // what the parameter does to a channel
    for (std::size_t i = 0; i < count; ++i) {
      double& m = most[static_cast<std::size_t>(observed.all[i].channel)];
      m = std::max(m, std::abs(exact.channels[i].v[0]));
    }
    int off = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const auto c = static_cast<std::size_t>(observed.all[i].channel);
      off += !(best[i] <= 1e-4 * most[c] + 1e-7);
    }
    EXPECT_LE(off, 1) << thrown.names[k] << ": a sample beside a switch of mode has none";
  }
}

TEST(PredictionDerivatives, SlopesOfTheOutcomesAreCentralDifferences) {
  const Thrown thrown;
  const auto slopes = outcome_slopes(thrown.prepared, thrown.model, thrown.names, thrown.values);
  ASSERT_TRUE(slopes);
  ASSERT_EQ(slopes->cols(), static_cast<int>(thrown.names.size()));  // more than one sweep
  for (std::size_t k = 0; k < thrown.names.size(); ++k) {
    const double h = 1e-5 * std::max(std::abs(thrown.values[k]), 1e-3);
    auto above = thrown.values, below = thrown.values;
    above[k] += h, below[k] -= h;
    const auto a = outcomes_of(thrown.predict({}, above)), b = outcomes_of(thrown.predict({}, below));
    for (int i = 0; i < kOutcomeCount; ++i) {
      const double slope = (*slopes)(i, static_cast<int>(k)),
                   difference = (a[static_cast<std::size_t>(i)] - b[static_cast<std::size_t>(i)]) / (2 * h);
      EXPECT_NEAR(slope, difference, 1e-4 * std::abs(slope) + 1e-5) << thrown.names[k] << ", outcome " << i;
    }
  }
}

TEST(PredictionDerivatives, ThereAreNoneWhereNothingLands) {
  Thrown thrown;
  thrown.prepared.landing_height = 1e3;
  EXPECT_FALSE(outcome_slopes(thrown.prepared, thrown.model, thrown.names, thrown.values));
}

/// A tracker whose stamps are early sees the object before the simulation starts: held, as the hand moved.
TEST(Prediction, BeforeItsStartTheObjectIsCarriedByTheHand) {
  Thrown thrown;
  thrown.prepared.start = thrown.prepared.hand.begin() + 0.02;
  const auto& prepared = thrown.prepared;
  const double t = prepared.hand.begin() + 0.005;
  Observations observed;
  for (const Channel channel : {Channel::mocap_x, Channel::mocap_z, Channel::mocap_theta})
    observed.all.push_back({channel, t, 0, 1});
  const std::vector<std::string> names{"mu", "grip_force"};
  const std::vector<double> values{0.5, 60};
  const auto seen =
      predict_channels(prepared, observed, thrown.model, dynamics::Values<double>(names, values)).channels;
  ASSERT_EQ(seen.size(), 3u);
  const auto hand = prepared.hand.at({prepared.hand.begin(), prepared.hand.end()}, t).pose;
  const double theta = hand.theta + prepared.grasp.angle, l = prepared.grasp.com_offset;
  // the quintic of the start continued backwards: it is the arm's motion to 1e-9 m
  EXPECT_NEAR(seen[0], hand.x + l * std::cos(theta), 1e-8);
  EXPECT_NEAR(seen[1], hand.z + l * std::sin(theta), 1e-8);
  EXPECT_NEAR(seen[2], theta, 1e-8);
}

/// A throw's own deviations are its own values.
TEST(Prediction, DeviationsChangeWhatTheyDeviateFrom) {
  const Thrown thrown;
  const auto landing = [&](const char* model, const std::vector<std::string>& names,
                           const std::vector<double>& values) {
    ThrowModel other = thrown.model;
    other.contact_model = model;
    return predict_channels(thrown.prepared, {}, other, dynamics::Values<double>(names, values));
  };
  const auto expect_same = [](const ThrowPrediction<double>& a, const ThrowPrediction<double>& b) {
    ASSERT_TRUE(a.landed() && b.landed());
    EXPECT_NEAR(a.detach.time, b.detach.time, 1e-12);
    EXPECT_NEAR(a.landing.pose.x, b.landing.pose.x, 1e-9);
    EXPECT_NEAR(a.landing.pose.theta, b.landing.pose.theta, 1e-9);
  };
  expect_same(landing("limit_surface_disc", {"mu", "mu_deviation"}, {0.4, 0.1}),
              landing("limit_surface_disc", {"mu"}, {0.44}));
  expect_same(landing("limit_surface_disc", {"dead_time", "dead_time_deviation"}, {0.012, -0.003}),
              landing("limit_surface_disc", {"dead_time"}, {0.009}));
  expect_same(landing("gripper_delay", {"delay", "delay_deviation"}, {0.04, 0.006}),
              landing("gripper_delay", {"delay"}, {0.046}));
}

/// n pads share a wrench evenly; n times the pads with an n-th of the friction are the same grip.
TEST(Prediction, ASensorBehindOneOfMorePadsFeelsItsShare) {
  CampaignDesign two = perfect();
  const auto of_two = generate_throw(two, kSeed, kThrow).record;
  for (const int pads : {1, 4}) {
    CampaignDesign design = two;
    design.patch.mu *= 2.0 / pads, design.patch.pads = pads;
    const auto other = generate_throw(design, kSeed, kThrow).record;
    ASSERT_EQ(other.ft->time.rows, of_two.ft->time.rows);
    for (std::size_t i = 0; i < other.ft->time.rows; ++i)
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(pads * other.ft->wrench(i, c), 2 * of_two.ft->wrench(i, c), 1e-5) << pads << ' ' << i;
  }
}

}  // namespace
