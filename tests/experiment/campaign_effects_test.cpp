// Effects in synthetic campaigns: each changes what it should, by as much as a closed form says, and nothing
// else.
#include "experiment/campaign_effects.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "dynamics/parallel.hpp"
#include "tests/support/perfect_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;
using namespace unhand::testing_support;
using dynamics::Effect;
using dynamics::Vec2;

bool is_sensor(const Effect& effect) { return effect.id.starts_with("sensor."); }

void expect_same_truth(const ThrowTruth& a, const ThrowTruth& b, const std::string& what) {
  EXPECT_EQ(a.detach_time, b.detach_time) << what;
  EXPECT_EQ(a.detach_pose.x, b.detach_pose.x) << what;
  EXPECT_EQ(a.detach_twist.omega, b.detach_twist.omega) << what;
  EXPECT_EQ(a.slip, b.slip) << what;
  EXPECT_EQ(a.pivot, b.pivot) << what;
  EXPECT_EQ(a.landing_time, b.landing_time) << what;
  EXPECT_EQ(a.landing_pose.x, b.landing_pose.x) << what;
  EXPECT_EQ(a.landing_pose.theta, b.landing_pose.theta) << what;
}

TEST(CampaignEffects, NeutralValuesGiveTheLogWithoutEffects) {
  const auto plain = generate_throw(perfect(), kSeed, kThrow);
  EffectSettings all;
  for (const Effect& effect : known_effects())
    for (const auto& p : effect.parameters) all[effect.full_name(p)] = p.neutral;
  const CampaignDesign design = perfect(all);
  const auto made = generate_throw(design, kSeed, kThrow);
  EXPECT_TRUE(plain.record == made.record);
  expect_same_truth(plain.truth, made.truth, "neutral");
  EXPECT_TRUE(campaign_header(perfect(), kSeed) == campaign_header(design, kSeed));
}

TEST(CampaignEffects, AnyNumberOfThreadsMakesTheSameLog) {
  CampaignDesign design = random_campaign(5);
  design.effects = {{"release.hand_tracking_lag.tau", 0.003}, {"flight.quadratic_drag.k", 0.05}};
  const auto make = [&](int threads) {
    std::vector<datasets::Throw> out(12);
    dynamics::parallel_for(out.size(), threads, [&](std::size_t i) {
      out[i] = generate_throw(design, 5, 4 * static_cast<int>(i)).record;
    });
    return out;
  };
  EXPECT_TRUE(make(1) == make(3));
}

TEST(CampaignEffects, SensorsLeaveTheTruthAlone) {
  const auto plain = generate_throw(perfect(), kSeed, kThrow);
  for (const Effect& effect : known_effects()) {
    const CampaignDesign design = perfect(typical(effect));
    const auto made = generate_throw(design, kSeed, kThrow);
    EXPECT_TRUE(plain.record.hand == made.record.hand) << effect.id << ": the hand is logged as commanded";
    if (!is_sensor(effect)) {
      EXPECT_TRUE(campaign_header(perfect(), kSeed) == campaign_header(design, kSeed)) << effect.id;
      EXPECT_EQ(plain.record.ft->normal_force.data, made.record.ft->normal_force.data) << effect.id;
      continue;
    }
    expect_same_truth(plain.truth, made.truth, effect.id);
    EXPECT_TRUE(!(plain.record == made.record) ||
                !(campaign_header(perfect(), kSeed) == campaign_header(design, kSeed)))
        << effect.id;
  }
}

TEST(CampaignEffects, BiasesShowAsThemselves) {
  const auto plain = generate_throw(perfect(), kSeed, kThrow).record;
  const auto made = generate_throw(perfect({{"sensor.ft_bias.fx", 0.3},
                                            {"sensor.ft_bias.fz", -0.2},
                                            {"sensor.ft_bias.tau", 0.01},
                                            {"sensor.normal_force_bias.bias", -0.5}}),
                                   kSeed, kThrow)
                        .record;
  for (std::size_t k = 0; k < plain.ft->time.rows; ++k) {  // differences of numbers below 100: rounding
    EXPECT_NEAR(made.ft->wrench(k, 0) - plain.ft->wrench(k, 0), 0.3, 1e-13);
    EXPECT_NEAR(made.ft->wrench(k, 1) - plain.ft->wrench(k, 1), -0.2, 1e-13);
    EXPECT_NEAR(made.ft->wrench(k, 2) - plain.ft->wrench(k, 2), 0.01, 1e-13);
    EXPECT_NEAR(made.ft->normal_force(k) - plain.ft->normal_force(k), -0.5, 1e-13);
  }
  EXPECT_EQ(made.ft->normal_force(plain.ft->time.rows - 1), -0.5) << "after the release, below zero";
  EXPECT_TRUE(plain.mocap == made.mocap);
  EXPECT_TRUE(plain.landing == made.landing);
}

TEST(CampaignEffects, TheTrackerIsLateAndOffInScale) {
  const auto plain = generate_throw(perfect(), kSeed, kThrow).record;
  const auto made = generate_throw(
      perfect({{"sensor.mocap_time_offset.offset", 0.004}, {"sensor.length_scale.scale", 1.01}}), kSeed,
      kThrow);
  const auto &a = *plain.mocap, &b = *made.record.mocap;
  ASSERT_EQ(a.time.rows, b.time.rows);
  for (std::size_t k = 0; k < a.time.rows; ++k) {
    EXPECT_NEAR(b.time(k) - a.time(k), 0.004, 1e-15);
    for (std::size_t c : {0u, 1u}) EXPECT_NEAR(b.pose(k, c), 1.01 * a.pose(k, c), 1e-13);
    EXPECT_NEAR(b.pose(k, 2), a.pose(k, 2), 1e-13);
  }
  EXPECT_TRUE(plain.ft == made.record.ft);
  EXPECT_TRUE(plain.landing == made.record.landing);
  const auto tracked =
      generate_throw(perfect({{"sensor.length_scale.scale", 1.01}, {"sensor.length_scale.landing_share", 1}}),
                     kSeed, kThrow);
  EXPECT_NEAR(tracked.record.landing->pose(0, 0), 1.01 * plain.landing->pose(0, 0), 1e-15);
}

TEST(CampaignEffects, TheForceSensorIsLateWithAllItReads) {
  const double late = 0.0015;
  const auto plain = generate_throw(perfect(), kSeed, kThrow).record;
  const auto made = generate_throw(perfect({{"sensor.ft_time_offset.offset", late}}), kSeed, kThrow).record;
  const auto &a = *plain.ft, &b = *made.ft;
  ASSERT_EQ(a.time.rows, b.time.rows);
  EXPECT_EQ(a.normal_force.data, b.normal_force.data);
  for (std::size_t k = 0; k < a.time.rows; ++k) {
    EXPECT_NEAR(b.time(k) - a.time(k), late, 1e-15);
    for (std::size_t c : {0u, 1u, 2u}) EXPECT_NEAR(b.wrench(k, c), a.wrench(k, c), 1e-9);  // t + late - late
  }
  EXPECT_TRUE(plain.mocap == made.mocap);
  EXPECT_TRUE(plain.landing == made.landing);
}

TEST(CampaignEffects, DeclarationsAreOffAndTheTrackerFollowsTheDeclaredCoM) {
  const double offset = 0.004;
  const CampaignDesign design = perfect(
      {{"sensor.mass.ratio", 1.1}, {"sensor.inertia.ratio", 0.8}, {"sensor.com_offset.offset", offset}});
  const auto header = campaign_header(design, kSeed);
  for (const auto& object : design.objects) {
    const auto& declared = header.objects.at(object.name);
    EXPECT_NEAR(1.1 * declared.mass, object.body.mass, 1e-15);
    EXPECT_NEAR(0.8 * declared.inertia->front(), object.body.inertia, 1e-15);
    EXPECT_NEAR(*declared.com_offset + offset, object.com_offset, 1e-15);
  }
  const auto plain = generate_throw(perfect(), kSeed, kThrow).record,
             made = generate_throw(design, kSeed, kThrow).record;
  EXPECT_TRUE(plain.ft == made.ft);
  const auto &a = *plain.mocap, &b = *made.mocap;
  for (std::size_t k = 0; k < std::min(a.time.rows, b.time.rows); ++k) {
    EXPECT_NEAR(b.pose(k, 0), a.pose(k, 0) - offset * std::cos(a.pose(k, 2)), 1e-13);
    EXPECT_NEAR(b.pose(k, 1), a.pose(k, 1) - offset * std::sin(a.pose(k, 2)), 1e-13);
    EXPECT_NEAR(b.pose(k, 2), a.pose(k, 2), 1e-13);
  }
}

/// Where the CoM of a throw without air is at `time` [s], from its state at the detach.
dynamics::Pose<double> flown_to(const CampaignDesign& design, const ThrowTruth& truth, double time) {
  return flight::ballistic(truth.detach_pose, truth.detach_twist, dynamics::level_gravity(design.gravity),
                           time - truth.detach_time)
      .pose;
}

// The landing is logged where the declared CoM, not the true one, passes the height: it lies behind the true
// one on the object's axis, whichever way up the object falls.
TEST(CampaignEffects, TheLandingIsThatOfTheDeclaredCoM) {
  for (const double offset : {-0.006, 0.004})
    for (const int index : {0, kThrow}) {
      const CampaignDesign design = perfect({{"sensor.com_offset.offset", offset}});
      const auto [record, truth] = generate_throw(design, kSeed, index);
      const auto com = flown_to(design, truth, record.landing->time(0));
      EXPECT_GT(std::abs(std::sin(com.theta)), 0.1) << "else the offset leaves the time alone";
      // The landing's time is a root found to rounding: times some 4 m/s and 10 rad/s.
      EXPECT_NEAR(com.z - offset * std::sin(com.theta), design.landing_height, 1e-9) << offset;
      EXPECT_NEAR(record.landing->pose(0, 0), com.x - offset * std::cos(com.theta), 1e-9) << offset;
      EXPECT_NEAR(record.landing->pose(0, 1), com.theta, 1e-9) << offset;
    }
}

// A tracker that reads everything a hundredth too long and also tells the landing finds its height a
// hundredth too low; one that does not tell it leaves the landing where it is.
TEST(CampaignEffects, ATrackersScaleMovesTheHeightOfTheLandingThatItTells) {
  constexpr double kHeight = 0.2, kScale = 0.01;
  for (const double share : {0.0, 0.5, 1.0})
    for (const int index : {0, kThrow}) {
      CampaignDesign design =
          perfect({{"sensor.length_scale.scale", 1 + kScale}, {"sensor.length_scale.landing_share", share}});
      design.landing_height = kHeight;
      const auto [record, truth] = generate_throw(design, kSeed, index);
      const auto com = flown_to(design, truth, record.landing->time(0));
      // in closed form, but for the rounding of times of half a second at some 4 m/s
      EXPECT_NEAR((1 + share * kScale) * com.z, kHeight, 1e-10) << share;
      EXPECT_NEAR(record.landing->pose(0, 0), (1 + share * kScale) * com.x, 1e-10) << share;
    }
}

TEST(CampaignEffects, TheForceComesLaterThanItsSensorSays) {
  const auto plain = generate_throw(perfect(), kSeed, kThrow);
  for (const double delay : {-0.003, 0.004}) {
    const auto made = generate_throw(perfect({{"release.opening_delay.delay", delay}}), kSeed, kThrow);
    EXPECT_NEAR(made.truth.detach_time, plain.truth.detach_time + delay, 1e-12);
    EXPECT_EQ(plain.record.ft->normal_force.data, made.record.ft->normal_force.data);
  }
  const auto stuck = generate_throw(
      perfect({{"contact.adhesion.f_adh", 0.5}, {"contact.adhesion.parting_time", 0.003}}), kSeed, kThrow);
  EXPECT_NEAR(stuck.truth.detach_time, plain.truth.detach_time + 0.003, 1e-12);
  EXPECT_EQ(plain.record.ft->normal_force.data, stuck.record.ft->normal_force.data);
}

// Held, the object turns with the true hand: τ θ' + θ = θ_log + grasp angle.
TEST(CampaignEffects, TheHandLags) {
  const double tau = 0.006;
  CampaignDesign design = perfect({{"release.hand_tracking_lag.tau", tau}});
  design.sensors.mocap_rate = 4000;
  const auto [record, truth] = generate_throw(design, kSeed, 2);
  const PlanarArmHand hand = throw_motion(design.arm, truth.motion);
  const auto& mocap = *record.mocap;
  int checked = 0;
  for (std::size_t k = 1; k + 1 < mocap.time.rows && mocap.time(k + 1) < truth.motion.switch_time; ++k) {
    const double t = mocap.time(k), rate = (mocap.pose(k + 1, 2) - mocap.pose(k - 1, 2)) /
                                           (mocap.time(k + 1) - mocap.time(k - 1));
    const double logged = hand.at({hand.begin(), truth.motion.switch_time}, t).pose.theta;
    // h²/6 of the third derivative, some 100 rad/s³, times τ
    EXPECT_NEAR(tau * rate + mocap.pose(k, 2), logged + truth.grasp_angle, 1e-8) << t;
    ++checked;
  }
  EXPECT_GT(checked, 200);
}

TEST(CampaignEffects, GravityIsTilted) {
  const double angle = 0.02;
  CampaignDesign design = perfect({{"flight.gravity_tilt.angle", angle}}), level = perfect();
  const auto [record, truth] = generate_throw(design, kSeed, kThrow);
  const auto& mocap = *record.mocap;
  const double h = 1 / design.sensors.mocap_rate;
  std::size_t first = 0;
  while (mocap.time(first) < truth.detach_time) ++first;
  const auto second = [&](std::size_t k, std::size_t c) {
    return (mocap.pose(k + 1, c) - 2 * mocap.pose(k, c) + mocap.pose(k - 1, c)) / (h * h);
  };
  for (std::size_t k = first + 1; k + 1 < mocap.time.rows; ++k) {  // rounding of 1e-16 m over h²
    EXPECT_NEAR(second(k, 0), design.gravity * std::sin(angle), 1e-9);
    EXPECT_NEAR(second(k, 1), -design.gravity * std::cos(angle), 1e-9);
  }
  // In the grasp nothing moves otherwise, so both pads together carry the difference.
  const auto plain = generate_throw(level, kSeed, kThrow).record;
  const PlanarArmHand hand = throw_motion(design.arm, truth.motion);
  const double mass = design.objects[1].body.mass;
  for (std::size_t k = 0; record.ft->time(k) < 0; ++k) {
    const double t = record.ft->time(k);
    const Vec2<double> d{2 * (record.ft->wrench(k, 0) - plain.ft->wrench(k, 0)),
                         2 * (record.ft->wrench(k, 1) - plain.ft->wrench(k, 1))};
    const auto world = dynamics::rotate(hand.at({hand.begin(), truth.motion.switch_time}, t).pose.theta, d);
    EXPECT_NEAR(world.x, -mass * design.gravity * std::sin(angle), 1e-12);
    EXPECT_NEAR(world.z, mass * design.gravity * (std::cos(angle) - 1), 1e-12);
  }
}

/// How the landing x changes to first order under a small acceleration a(v) along the flight:
/// δx = ∫ (T − t) a_x dt, δz alike, and a lower flight lands δz/v_z later.
double shift(const CampaignDesign& design, const ThrowTruth& t,
             const std::function<Vec2<double>(Vec2<double>)>& acceleration) {
  const double longest = t.landing_time - t.detach_time, n = 2000;
  double dx = 0, dz = 0;
  for (double i = 0; i < n; ++i) {  // midpoint rule
    const double s = (i + 0.5) / n * longest;
    const auto a = acceleration({t.detach_twist.vx, t.detach_twist.vz - design.gravity * s});
    dx += (longest - s) * a.x * longest / n;
    dz += (longest - s) * a.z * longest / n;
  }
  return dx - dz * t.detach_twist.vx / (t.detach_twist.vz - design.gravity * longest);
}

TEST(CampaignEffects, AirMovesTheLandingAsPerturbationTheorySays) {
  const CampaignDesign design = perfect();
  const auto plain = generate_throw(design, kSeed, kThrow).truth;
  const auto moved = [&](CampaignDesign with, const EffectSettings& effects) {
    with.effects = effects;
    return generate_throw(with, kSeed, kThrow).truth.landing_pose.x;
  };
  const double k = 1e-4;  // the second order is this times a flight of some metres
  const double drag = shift(design, plain, [&](Vec2<double> v) { return -k * norm(v) * v; });
  const double dragged = moved(design, {{"flight.quadratic_drag.k", k}}) - plain.landing_pose.x;
  EXPECT_LT(dragged, 0);
  EXPECT_NEAR(dragged / drag, 1, 2e-3);
  const std::string own = "flight.quadratic_drag.k[" + design.objects[0].name + "]";
  EXPECT_EQ(moved(design, {{own, k}}), plain.landing_pose.x) << "the other object's";

  const double km = 1e-4, omega = plain.detach_twist.omega;
  const double lift = shift(design, plain, [&](Vec2<double> v) { return km * omega * dynamics::perp(v); });
  EXPECT_NEAR((moved(design, {{"flight.magnus_lift.k_m", km}}) - plain.landing_pose.x) / lift, 1, 2e-3);

  CampaignDesign thin = design;
  for (auto& object : thin.objects) object.drag_k = k;
  const double still = generate_throw(thin, kSeed, kThrow).truth.landing_pose.x;
  const Vec2<double> wind{-2, 0.5};
  const double blown = shift(design, plain, [&](Vec2<double> v) {
    const Vec2<double> u{v.x - wind.x, v.z - wind.z};
    return -k * norm(u) * u + k * norm(v) * v;
  });
  const double seen = moved(thin, {{"flight.wind.w_x", wind.x}, {"flight.wind.w_z", wind.z}}) - still;
  EXPECT_NEAR(seen / blown, 1, 2e-3);
  EXPECT_EQ(moved(design, {{"flight.wind.w_x", 2}}), plain.landing_pose.x) << "no declared drag, no wind";
}

/// Without drag the flight has a closed form, which must not be taken where an effect bends it:
/// `is_ballistic`.
TEST(CampaignEffects, EachOfTheFlightAloneMovesALandingWithoutDrag) {
  const CampaignDesign calm = perfect();
  for (const auto& object : calm.objects) ASSERT_EQ(object.drag_k, 0);
  const auto plain = generate_throw(calm, kSeed, kThrow).truth;
  int alone = 0;
  for (const Effect& effect : known_effects()) {
    if (!effect.id.starts_with("flight.") || !effect.acts_through.empty()) continue;
    ++alone;
    const auto moved = generate_throw(perfect(typical(effect)), kSeed, kThrow).truth;
    if (!effect.acts_everywhere) {
      EXPECT_EQ(moved.detach_pose.x, plain.detach_pose.x) << effect.id;
    }
    EXPECT_GT(std::hypot(moved.landing_pose.x - plain.landing_pose.x,
                         moved.landing_pose.theta - plain.landing_pose.theta),
              1e-5)
        << effect.id << ": does is_ballistic() know it?";
  }
  EXPECT_GE(alone, 3);
}

TEST(CampaignEffects, FrictionMattersOnlyOnceThePadsOpen) {
  const auto plain = generate_throw(perfect(), kSeed, kThrow);
  for (const Effect& effect : known_effects()) {
    if (!effect.id.starts_with("contact.")) continue;
    const auto made = generate_throw(perfect(typical(effect)), kSeed, kThrow);
    const bool gives = effect.id == "contact.pad_compliance";  // under the load of the firm grasp, too
    for (std::size_t k = 0; !gives && plain.record.ft->time(k) < plain.truth.motion.switch_time; ++k)
      EXPECT_NEAR(made.record.ft->wrench(k, 2), plain.record.ft->wrench(k, 2), 1e-12) << effect.id;
    EXPECT_NE(made.truth.landing_pose.x, plain.truth.landing_pose.x) << effect.id;
  }
}

}  // namespace
