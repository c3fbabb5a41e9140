// Synthetic campaigns: reproducible, in the schema, and what the sensors show is the physics that made it.
#include "experiment/synthetic_campaign.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>

#include "contact/sliding_pivot.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;
using datasets::ThrowLog;
constexpr double kDegree = std::numbers::pi / 180;
constexpr std::uint64_t kSeed = 7;

/// NaN is unequal to itself: lost mocap samples become zeros, so that logs compare with ==.
ThrowLog comparable(ThrowLog log) {
  for (auto& t : log.throws)
    for (double& x : t.mocap->pose.data)
      if (std::isnan(x)) x = 0;
  return log;
}

CampaignDesign perfect_quick12() {
  CampaignDesign design = campaign_design("quick12");
  design.sensors = design.sensors.perfect();
  return design;
}

dynamics::Window window_at(const PlanarArmHand& hand, double t) {
  dynamics::Window w{hand.begin(), hand.end()};
  for (const double jump : hand.jumps())
    (jump <= t ? w.begin : w.end) = jump <= t ? jump : std::min(w.end, jump);
  return w;
}

/// Linear between the samples.
double at(const datasets::Series& time, const datasets::Series& values, std::size_t column, double t) {
  const auto next = std::upper_bound(time.data.begin(), time.data.end(), t);
  const std::size_t i = static_cast<std::size_t>(std::distance(time.data.begin(), next)) - 1;
  const double u = (t - time(i)) / (time(i + 1) - time(i));
  return (1 - u) * values(i, column) + u * values(i + 1, column);
}

TEST(SyntheticCampaign, SameSeedSameLogDifferentSeedAnother) {
  const CampaignDesign design = campaign_design("quick12");
  const ThrowLog log = generate_campaign(design, kSeed);
  EXPECT_EQ(log.throws.size(), 12u);
  EXPECT_TRUE(comparable(log) == comparable(generate_campaign(design, kSeed)));
  const ThrowLog other = generate_campaign(design, kSeed + 1);
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    EXPECT_NE(log.throws[i].hand->pose.data, other.throws[i].hand->pose.data) << i;
    EXPECT_NE(log.throws[i].landing->pose.data, other.throws[i].landing->pose.data) << i;
    if (i == 0) continue;
    EXPECT_NE(log.throws[i].ft->normal_force.data, log.throws[i - 1].ft->normal_force.data) << i;
  }
}

TEST(SyntheticCampaign, ThrowsDoNotDependOnTheirOrder) {
  const CampaignDesign design = campaign_design("quick12");
  const ThrowLog log = generate_campaign(design, kSeed);
  ThrowLog backwards = campaign_header(design, kSeed);
  for (int i = design.throws(); i-- > 0;)
    backwards.throws.insert(backwards.throws.begin(), generate_throw(design, kSeed, i).record);
  EXPECT_TRUE(comparable(log) == comparable(backwards));
}

TEST(SyntheticCampaign, NoiseChangesNothingButItsChannel) {
  const CampaignDesign design = campaign_design("quick12"), quiet = perfect_quick12();
  CampaignDesign other = design;
  other.sensors.wrench_sigma = {};
  for (const int i : {0, 5, 11}) {
    const auto loud = generate_throw(design, kSeed, i), clean = generate_throw(quiet, kSeed, i),
               mixed = generate_throw(other, kSeed, i);
    EXPECT_EQ(loud.truth.landing_pose.x, clean.truth.landing_pose.x);
    EXPECT_EQ(loud.truth.detach_time, clean.truth.detach_time);
    EXPECT_TRUE(loud.record.hand == mixed.record.hand);
    EXPECT_TRUE(loud.record.landing == mixed.record.landing);
    EXPECT_EQ(loud.record.ft->normal_force.data, mixed.record.ft->normal_force.data);
    EXPECT_EQ(mixed.record.ft->wrench.sigma, std::vector<double>{}) << "no noise is none declared";
  }
}

TEST(SyntheticCampaign, KeepsTheRulesAndRoundTrips) {
  const ThrowLog log = generate_campaign(campaign_design("quick12"), kSeed);
  EXPECT_NO_THROW(datasets::validate(log));
  EXPECT_THAT(log.title, testing::HasSubstr("synthetic"));
  EXPECT_THAT(log.source, testing::HasSubstr("synthetic"));
  const auto file = std::filesystem::temp_directory_path() / "unhand_synthetic_campaign_test.h5";
  datasets::write_throw_log(file, log);
  const ThrowLog back = datasets::read_throw_log(file);
  std::filesystem::remove(file);
  EXPECT_TRUE(comparable(log) == comparable(back));
}

TEST(SyntheticCampaign, SplitsWholeConditionsOfEachObject) {
  const CampaignDesign design = campaign_design("batch180");
  std::map<std::string, std::set<datasets::Split>> splits;
  std::map<std::string, int> repetitions, train;
  const ThrowLog log = generate_campaign(design, kSeed);
  for (const auto& t : log.throws) {
    splits[t.condition].insert(t.split);
    ++repetitions[t.condition];
    train[t.object] += t.split == datasets::Split::train;
  }
  EXPECT_EQ(splits.size(), 36u);
  for (const auto& [condition, seen] : splits) EXPECT_EQ(seen.size(), 1u) << condition;
  for (const auto& [condition, n] : repetitions) EXPECT_EQ(n, 5) << condition;
  for (const auto& [object, n] : train) EXPECT_EQ(n, 45) << object;
}

TEST(SyntheticCampaign, HeldObjectIsCarriedByTheHand) {
  const CampaignDesign design = perfect_quick12();
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    const double offset = design.objects[i / (design.throws() / 2)].com_offset;
    const PlanarArmHand hand = throw_motion(design.arm, truth.motion);
    const auto& mocap = *record.mocap;
    int held = 0;
    for (std::size_t k = 0; k < mocap.time.rows; ++k) {
      const double t = mocap.time(k);
      if (t > truth.motion.switch_time) break;  // from there on it may slip
      const auto pose = hand.at(window_at(hand, t), t).pose;
      const double angle = pose.theta + truth.grasp_angle;
      // the object's pose is made from the hand's: rounding only
      EXPECT_NEAR(mocap.pose(k, 0), pose.x + offset * std::cos(angle), 1e-14) << i << " at " << t;
      EXPECT_NEAR(mocap.pose(k, 1), pose.z + offset * std::sin(angle), 1e-14) << i << " at " << t;
      EXPECT_NEAR(mocap.pose(k, 2), angle, 1e-14) << i << " at " << t;
      ++held;
    }
    EXPECT_GE(held, 15) << "70 ms at 240 Hz";
  }
}

TEST(SyntheticCampaign, HandLogIsTheMotionWithTheLaterAccelerationAtAJump) {
  const CampaignDesign design = perfect_quick12();
  const auto [record, truth] = generate_throw(design, kSeed, 3);
  const auto& log = *record.hand;
  EXPECT_EQ(log.time.rows, 351u);  // −50 … 300 ms
  EXPECT_EQ(record.hand_jump_times, (std::vector<double>{design.switch_time, design.follow_through}));
  const PlanarArmHand hand = throw_motion(design.arm, truth.motion);
  bool at_jump = false;
  for (std::size_t k = 0; k < log.time.rows; ++k) {
    const auto state = hand.at(window_at(hand, log.time(k)), log.time(k));
    EXPECT_EQ(log.pose(k, 0), state.pose.x);
    EXPECT_EQ(log.twist(k, 1), state.twist.vz);
    EXPECT_EQ(log.acceleration(k, 0), state.acceleration.ax) << log.time(k);
    at_jump = at_jump || log.time(k) == design.switch_time;
  }
  EXPECT_TRUE(at_jump) << "a multiple of 1 ms must be the double that the decimal number is";
}

// In flight nothing but gravity acts: z is a parabola, x and θ are straight lines, and they end where the
// landing is.
TEST(SyntheticCampaign, FlightIsAParabolaToTheLanding) {
  const CampaignDesign design = perfect_quick12();
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    const auto& mocap = *record.mocap;
    std::size_t first = 0;
    while (mocap.time(first) < truth.detach_time) ++first;
    const std::size_t last = mocap.time.rows - 1;
    ASSERT_GT(last, first + 50);
    const auto v = [&](std::size_t k, std::size_t c) {
      const double h = 1 / design.sensors.mocap_rate;
      return (mocap.pose(k + 1, c) - mocap.pose(k, c)) / h;
    };
    for (std::size_t k = first; k + 2 <= last; ++k) {
      const double h = 1 / design.sensors.mocap_rate;
      // the quotient divides rounding of 1e-16 of a metre and of a second twice by 4 ms
      EXPECT_NEAR(v(k + 1, 0), v(k, 0), 1e-12);
      EXPECT_NEAR(v(k + 1, 2), v(k, 2), 1e-12);
      EXPECT_NEAR((v(k + 1, 1) - v(k, 1)) / h, -design.gravity, 1e-9);
    }
    const double t = record.landing->time(0) - mocap.time(last), h = 1 / design.sensors.mocap_rate;
    EXPECT_GE(t, 0);
    EXPECT_LT(t, h);
    const double vz = v(last - 1, 1) - 0.5 * design.gravity * h;
    EXPECT_NEAR(mocap.pose(last, 1) + t * (vz - 0.5 * design.gravity * t), design.landing_height, 1e-12);
    EXPECT_NEAR(record.landing->pose(0, 0), mocap.pose(last, 0) + t * v(last - 1, 0), 1e-12);
    EXPECT_NEAR(record.landing->pose(0, 1), mocap.pose(last, 2) + t * v(last - 1, 2), 1e-12);
  }
}

// m a = 2 f + m g and I α = 2 τ + torque of the force about the CoM, where a and α are the second differences
// of the tracked pose and f, τ what the sensor behind one of the two pads reports. Nothing here goes through
// the simulator.
TEST(SyntheticCampaign, ForcesOfBothPadsAndGravityAreNewtons) {
  CampaignDesign design = perfect_quick12();
  design.sensors.mocap_rate = design.sensors.ft_rate = 4000;
  double worst_force = 0, worst_torque = 0;
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    const auto& body = design.objects[i / (design.throws() / 2)].body;
    const PlanarArmHand hand = throw_motion(design.arm, truth.motion);
    const auto& mocap = *record.mocap;
    const auto& ft = *record.ft;
    const double h = 1 / design.sensors.mocap_rate;
    int checked = 0;
    for (std::size_t k = 1; k + 1 < mocap.time.rows && mocap.time(k) + 2 * h < truth.detach_time; ++k) {
      const double t = mocap.time(k);
      if (std::abs(t - truth.motion.switch_time) < 2 * h)
        continue;  // the acceleration jumps inside the difference
      const auto second = [&](std::size_t c) {
        return (mocap.pose(k + 1, c) - 2 * mocap.pose(k, c) + mocap.pose(k - 1, c)) / (h * h);
      };
      const auto pose = hand.at(window_at(hand, t), t).pose;
      const auto force = dynamics::rotate(
          pose.theta,
          dynamics::Vec2<double>{2 * at(ft.time, ft.wrench, 0, t), 2 * at(ft.time, ft.wrench, 1, t)});
      const double rx = mocap.pose(k, 0) - pose.x, rz = mocap.pose(k, 1) - pose.z;
      const double torque = 2 * at(ft.time, ft.wrench, 2, t) + rz * force.x - rx * force.z;
      const double error_x = body.mass * second(0) - force.x;
      const double error_z = body.mass * (second(1) + design.gravity) - force.z;
      const double error_torque = body.inertia * second(2) - torque;
      worst_force = std::max({worst_force, std::abs(error_x), std::abs(error_z)});
      worst_torque = std::max(worst_torque, std::abs(error_torque));
      ++checked;
    }
    EXPECT_GT(checked, 500) << i;
  }
  std::printf("Newton: worst force %.2g N, worst torque %.2g N m\n", worst_force, worst_torque);
  // Second differences over 0.25 ms: h²/12 of the jerk's slope, and the dense output's 1e-9 over h²; the
  // forces are some newtons, the torques some tenths of a newton metre.
  EXPECT_LT(worst_force, 0.02);
  EXPECT_LT(worst_torque, 0.002);
}

TEST(SyntheticCampaign, NormalForceIsTheOpeningAndBoundsTheFriction) {
  const CampaignDesign design = perfect_quick12();
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    const auto& [open, grip, dead, opening, shape] = truth.opening;
    EXPECT_NEAR(truth.detach_time, open + dead + opening, 1e-12);
    const auto& ft = *record.ft;
    for (std::size_t k = 0; k < ft.time.rows; ++k) {
      const double s = std::clamp((ft.time(k) - open - dead) / opening, 0.0, 1.0);
      EXPECT_NEAR(ft.normal_force(k), grip * std::pow(1 - s, shape), 1e-10 * grip) << ft.time(k);
      // the force of one pad: μ f_N; the stop at the surface is found to the tolerance of the integrator
      const double force = std::hypot(ft.wrench(k, 0), ft.wrench(k, 1));
      EXPECT_LE(force, truth.patch.mu * ft.normal_force(k) * (1 + 1e-6) + 1e-12) << ft.time(k);
      EXPECT_LE(std::abs(ft.wrench(k, 2)),
                truth.patch.length() * truth.patch.mu * ft.normal_force(k) * (1 + 1e-6) + 1e-12)
          << ft.time(k);
    }
  }
}

// Residuals against the noise-free twin of the campaign, in units of the declared σ: mean 0, mean square 1.
TEST(SyntheticCampaign, NoiseIsAsDeclared) {
  const CampaignDesign design = campaign_design("quick12"), quiet = perfect_quick12();
  struct Moments {
    double n = 0, sum = 0, squares = 0, cubes = 0, fourths = 0;
    void add(double x) { ++n, sum += x, squares += x * x, cubes += x * x * x, fourths += x * x * x * x; }
  };
  std::map<std::string, Moments> moments;
  double lost = 0, all = 0, below = 0, after = 0;
  const auto compare = [&](const std::string& name, const datasets::Series& a, const datasets::Series& b,
                           const datasets::MocapLog* mask = nullptr) {
    ASSERT_EQ(a.sigma.size(), a.cols) << name;
    ASSERT_EQ(a.rows, b.rows) << name;
    for (std::size_t k = 0; k < a.rows; ++k)
      for (std::size_t c = 0; c < a.cols; ++c)
        if (!mask || mask->is_valid(k)) moments[name].add((a(k, c) - b(k, c)) / a.sigma[c]);
  };
  for (int i = 0; i < design.throws(); ++i) {
    const auto loud = generate_throw(design, kSeed, i), clean = generate_throw(quiet, kSeed, i);
    const auto &a = loud.record, &b = clean.record;
    compare("hand/pose", a.hand->pose, b.hand->pose);
    compare("hand/acceleration", a.hand->acceleration, b.hand->acceleration);
    compare("ft/wrench", a.ft->wrench, b.ft->wrench);
    compare("ft/normal_force", a.ft->normal_force, b.ft->normal_force);
    compare("mocap/pose", a.mocap->pose, b.mocap->pose, &*a.mocap);
    for (std::size_t k = 0; k < a.mocap->time.rows; ++k) {
      ++all;
      lost += !a.mocap->is_valid(k);
      EXPECT_EQ(a.mocap->is_valid(k), !std::isnan(a.mocap->pose(k, 0)));
    }
    for (std::size_t k = 0; k < a.ft->time.rows; ++k)
      if (a.ft->time(k) > loud.truth.detach_time) ++after, below += a.ft->normal_force(k) < 0;
  }
  for (const auto& [name, m] : moments) {
    // five standard deviations of each mean: those of x, x², x³, x⁴ are 1, √2, √15, √96 over √n
    const double five = 5 / std::sqrt(m.n);
    EXPECT_NEAR(m.sum / m.n, 0.0, five) << name;
    EXPECT_NEAR(m.squares / m.n, 1.0, std::sqrt(2.0) * five) << name;
    EXPECT_NEAR(m.cubes / m.n, 0.0, std::sqrt(15.0) * five) << name;
    EXPECT_NEAR(m.fourths / m.n, 3.0, std::sqrt(96.0) * five) << name;
  }
  EXPECT_NEAR(lost / all, 0.005, 5 * std::sqrt(0.005 / all));
  EXPECT_NEAR(below / after, 0.5, 5 * 0.5 / std::sqrt(after));
}

TEST(SyntheticCampaign, TheLawCanBeChosen) {
  CampaignDesign design = campaign_design("quick12");
  design.contact_model = "sliding_pivot";
  const auto named = generate_throw(design, kSeed, 11);
  EXPECT_EQ(named.truth.contact_model, "sliding_pivot");
  design.contact_factory = [](const contact::Patch<double>& patch, const contact::OpeningProfile<double>&) {
    return std::make_unique<contact::SlidingPivot>(patch);
  };
  const auto made = generate_throw(design, kSeed, 11);
  EXPECT_EQ(named.truth.landing_pose.x, made.truth.landing_pose.x);
  design.contact_factory = {};
  design.contact_model = "gripper_delay";
  const auto carried = generate_throw(design, kSeed, 11);
  EXPECT_EQ(carried.truth.pivot, 0.0);
  EXPECT_GT(std::abs(carried.truth.landing_pose.theta - named.truth.landing_pose.theta), 5 * kDegree);
  design.contact_model = "glue";
  EXPECT_THROW(generate_throw(design, kSeed, 0), std::invalid_argument);
}

std::string failure(const CampaignDesign& design) {
  try {
    generate_campaign(design, kSeed);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

TEST(SyntheticCampaign, AFailedThrowIsAnErrorThatNamesIt) {
  using testing::AllOf, testing::HasSubstr;
  const auto names_it =
      AllOf(HasSubstr("campaign quick12, seed 7, throw 001 (bar-com100/pitch-22/acc+8, repetition 1)"),
            HasSubstr("opening time"), HasSubstr("grip force"), HasSubstr("mu 0."));
  CampaignDesign high = campaign_design("quick12");
  high.landing_height = 5;
  EXPECT_THAT(failure(high), AllOf(names_it, HasSubstr("never reaches the landing height")));
  CampaignDesign slow = campaign_design("quick12");
  slow.opening.opening_time = 1;
  EXPECT_THAT(failure(slow), AllOf(names_it, HasSubstr("never_separated")));
  CampaignDesign weak = campaign_design("quick12");
  weak.opening.grip_force = 3;
  EXPECT_THAT(failure(weak), AllOf(names_it, HasSubstr("the grip does not hold")));
  CampaignDesign far = campaign_design("quick12");
  far.postures[0].hand.x = 2;
  EXPECT_THAT(failure(far), AllOf(names_it, HasSubstr("out of reach")));
}

TEST(SyntheticCampaign, RefusesWhatMakesNoSense) {
  using testing::AllOf, testing::HasSubstr;
  try {
    campaign_design("batch-180");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("batch-180"), HasSubstr("batch180"), HasSubstr("quick12")));
  }
  EXPECT_THROW(loaded_bar("too far", 0.3), std::invalid_argument);
  EXPECT_THROW(generate_throw(campaign_design("quick12"), 1, 12), std::out_of_range);
  EXPECT_THROW(generate_throw(campaign_design("quick12"), 1, -1), std::out_of_range);
  CampaignDesign design = campaign_design("quick12");
  design.sensors.mocap_dropout = 1;
  EXPECT_THROW(generate_campaign(design, 1), std::invalid_argument);
  design = campaign_design("quick12");
  design.sensors.mocap_sigma[1] = -1;
  EXPECT_THROW(generate_campaign(design, 1), std::invalid_argument);
  design = campaign_design("quick12");
  design.objects.clear();
  EXPECT_THROW(generate_campaign(design, 1), std::invalid_argument);
}

// The parallel axis theorem for the bar and its cylinder about the pads gives m l² + I.
TEST(LoadedBar, InertiaAboutThePads) {
  for (const double offset : {0.10, 0.16}) {
    const ThrownObject object = loaded_bar("bar", offset);
    EXPECT_NEAR(object.body.mass, 0.246, 1e-15);
    const double slot = (0.246 * offset - 0.092 * 0.15) / 0.154;
    const double bar = 0.092 * (0.32 * 0.32 + 0.03 * 0.03) / 12 + 0.092 * 0.15 * 0.15;
    const double load = 0.154 * (3 * 0.01 * 0.01 + 0.06 * 0.06) / 12 + 0.154 * slot * slot;
    EXPECT_NEAR(object.body.inertia + object.body.mass * offset * offset, bar + load, 1e-16);
  }
}

// What the campaign is like: printed, and bounded loosely, so that a change of the design shows.
TEST(SyntheticCampaign, Batch180IsACampaignOfFlips) {
  const CampaignDesign design = campaign_design("batch180");
  ASSERT_EQ(design.throws(), 180);
  struct Range {
    double low = 1e300, high = -1e300;
    void add(double x) { low = std::min(low, x), high = std::max(high, x); }
  } detach, x, turned, spin, pivot, slip, flight;
  for (int i = 0; i < design.throws(); ++i) {
    const auto [record, truth] = generate_throw(design, kSeed, i);
    detach.add(truth.detach_time);
    x.add(truth.landing_pose.x);
    turned.add((truth.landing_pose.theta - truth.detach_pose.theta) / kDegree);
    spin.add(truth.detach_twist.omega / kDegree);
    pivot.add(truth.pivot / kDegree);
    slip.add(truth.slip * 1e3);
    flight.add(truth.landing_time - truth.detach_time);
    EXPECT_LT(truth.detach_time, design.follow_through) << record.id << ": the arm brakes after the release";
    // the noise is 1 mm: the landing is where the truth is
    EXPECT_NEAR(record.landing->pose(0, 0), truth.landing_pose.x, 6e-3);
  }
  std::printf(
      "detach %.4f..%.4f s, flight %.3f..%.3f s, landing x %.3f..%.3f m, turned in flight %.0f..%.0f deg\n",
      detach.low, detach.high, flight.low, flight.high, x.low, x.high, turned.low, turned.high);
  std::printf("spin %.0f..%.0f deg/s, pivot in the hand %.2f..%.2f deg, slip %.2f..%.2f mm\n", spin.low,
              spin.high, pivot.low, pivot.high, slip.low, slip.high);
  EXPECT_GT(detach.low, 0.09);
  EXPECT_LT(detach.high, 0.12);
  EXPECT_GT(x.low, 0.9);
  EXPECT_LT(x.high, 2.4);
  EXPECT_GT(x.high - x.low, 0.8);
  EXPECT_GT(spin.low, 100);
  EXPECT_LT(spin.high, 700);
  EXPECT_LT(pivot.low, -1);
  EXPECT_GT(pivot.high, 10);
  EXPECT_LT(pivot.high, 40);
  EXPECT_GT(slip.high, 2);
  EXPECT_LT(slip.high, 10);
}

}  // namespace
