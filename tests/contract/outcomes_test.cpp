// Every release has an answer that says what it is: expected endings are outcomes, wrong input is refused by
// name.
#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>

#include "release/naive_release.hpp"
#include "tests/contract/every_model.hpp"
#include "tests/support/refusal.hpp"

namespace unhand {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

class Outcomes : public EveryModel {};
UNHAND_EVERY_MODEL(Outcomes);

class WithoutFriction : public EveryModel {};
UNHAND_EVERY_MODEL_WITH_FRICTION(WithoutFriction);

TEST_P(WithoutFriction, TheObjectIsFreeAtOnce) {
  std::mt19937_64 random(51);
  for (int i = 0; i < 20; ++i) {
    const auto thrown = support::random_throw(random, i % 2);
    auto p = support::parameters_of(thrown);
    p.patch.mu = 0;
    const auto model = make(p);
    const auto problem = support::problem_of(thrown, *model);
    const auto result =
        simulate_release(problem, {.integrator = {.tolerances = {1e-10, 1e-12}, .record = true}});
    ASSERT_EQ(result.outcome, release::ReleaseOutcome::detached) << describe(thrown);
    EXPECT_TRUE(result.slips_at_start);
    const auto hand = thrown.hand.at({}, 0);
    const double theta = hand.pose.theta + thrown.grasp.angle, t = result.detach.time;
    const auto r = dynamics::rotate(theta, dynamics::Vec2<double>{thrown.grasp.com_offset, 0});
    const auto v = dynamics::twist_at_com(hand.twist, r);
    EXPECT_NEAR(sample_release(problem, result, problem.start).pose.x, hand.pose.x + r.x, 1e-15);
    EXPECT_DOUBLE_EQ(t, thrown.force.release_time());
    // free flight from the first instant; 1e-9: the tolerance over a tenth of a second and lengths of a metre
    EXPECT_NEAR(result.detach.twist.vx, v.vx, 1e-9) << describe(thrown);
    EXPECT_NEAR(result.detach.twist.vz, v.vz - 9.81 * t, 1e-9);
    EXPECT_NEAR(result.detach.twist.omega, v.omega, 2e-8);
    EXPECT_NEAR(result.detach.pose.x, hand.pose.x + r.x + v.vx * t, 1e-9);
    EXPECT_NEAR(result.detach.pose.z, hand.pose.z + r.z + v.vz * t - 0.5 * 9.81 * t * t, 1e-9);
    EXPECT_NEAR(result.detach.pose.theta, theta + v.omega * t, 1e-9);
  }
}

TEST_P(Outcomes, PadsThatNeverPart) {
  const auto hand = support::still_hand(0.2);
  const support::ConstantForce force(5);
  contact::ContactParameters<double> p;
  p.patch = {0.5, 0.01, 2.0 / 3, 2};
  p.open_command = 0.15;
  p.delay = 0.1;
  for (const double mass : {0.1, 3.0}) {  // held; falling through
    const auto model = make(p);
    const release::ReleaseProblem<double> problem{hand,      force, *model, {mass, 1e-3}, {0, -9.81},
                                                  {0.02, 0}, 0.0,   {},     0.0};
    const auto result = simulate_release(problem);
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated);
    EXPECT_EQ(result.integration, dynamics::Outcome::horizon);
    EXPECT_EQ(result.slips_at_start, !carried() && mass > 1);
    EXPECT_DOUBLE_EQ(result.detach.time, 0.2);
    EXPECT_TRUE(std::isfinite(result.detach.pose.z));
  }
}

/// Whatever the clock: pads that part after the hand's motion ends, on clocks before 0 and after.
TEST_P(Outcomes, PadsThatPartTooLateHaveNotParted) {
  for (const double begin : {-10.0, -0.1, 0.0, 100.0}) {
    const auto hand =
        release::PolynomialHand::segments(begin, {0, 1, 0}, {1, 0, 2}, {{begin + 0.2, {3, 1, 5}, {}}});
    const contact::ProfileNormalForce force(
        contact::OpeningProfile<double>{begin + 0.15, 20, 0.0, 0.08, 1.0});
    contact::ContactParameters<double> p;
    p.patch = {0.5, 0.01, 2.0 / 3, 2};
    p.open_command = begin + 0.15;
    p.delay = 0.08;
    const auto model = make(p);
    const auto result = simulate_release(release::ReleaseProblem<double>{
        hand, force, *model, {0.1, 1e-3}, {0, -9.81}, {0.02, 0}, begin, {}, 0.0});
    EXPECT_EQ(result.outcome, release::ReleaseOutcome::never_separated) << begin;
    EXPECT_DOUBLE_EQ(result.detach.time, begin + 0.2);
  }
}

TEST_P(Outcomes, SlippingAtTheStartIsReported) {
  std::mt19937_64 random(52);
  for (int i = 0; i < 20; ++i) {
    const auto thrown = support::random_throw(random, 0);
    auto p = support::parameters_of(thrown);
    p.patch.mu = 1e-3;
    EXPECT_EQ(simulate_release(support::problem_of(thrown, *make(p))).slips_at_start, !carried())
        << describe(thrown);
    p.patch = {10, 1, 2.0 / 3, 2};
    EXPECT_FALSE(simulate_release(support::problem_of(thrown, *make(p))).slips_at_start) << describe(thrown);
  }
}

// ---------------------------------------------------------------- wrong input

/// Runs `action`, which must throw std::invalid_argument with all of `words` in its message.
void expect_refused(const std::vector<std::string>& words, const std::function<void()>& action) {
  const std::string message = support::refusal(action);
  for (const auto& word : words) EXPECT_THAT(message, testing::HasSubstr(word));
}

TEST_P(Outcomes, WrongPatchesAreRefused) {
  const auto with = [&](auto&& change) {
    return [&, change] {
      contact::ContactParameters<double> p;
      p.patch = {0.5, 0.01, 2.0 / 3, 2};
      p.open_command = p.delay = 0;
      change(p);
      make(p);
    };
  };
  if (!carried()) {
    for (const double mu : {-0.1, 10.1, kNaN, kInfinity})
      expect_refused({"mu", "[0, 10]"}, with([=](auto& p) { p.patch.mu = mu; }));
    for (const double radius : {0.0, -1.0, 1.1, kNaN})
      expect_refused({"radius", "[1e-12, 1] m"}, with([=](auto& p) { p.patch.radius = radius; }));
    for (const double c : {0.0, 1.1, kNaN})
      expect_refused({"torque_factor", "(0, 1]"}, with([=](auto& p) { p.patch.torque_factor = c; }));
    expect_refused({"pads"}, with([](auto& p) { p.patch.pads = 0; }));
  } else {
    for (const double t : {kNaN, kInfinity})
      expect_refused({"open_command"}, with([=](auto& p) { p.open_command = t; }));
    for (const double t : {-0.1, 10.1})
      expect_refused({"gripper delay: delay"}, with([=](auto& p) { p.delay = t; }));
    expect_refused({"needs delay [s]", "not given"}, with([](auto& p) { p.delay = kNaN; }));
  }
}

TEST_P(Outcomes, WrongProblemsAreRefused) {
  std::mt19937_64 random(53);
  const auto thrown = support::random_throw(random, 0);
  const auto model = make(support::parameters_of(thrown));
  const auto with = [&](auto&& change) {
    return [&, change] {
      auto problem = support::problem_of(thrown, *model);
      change(problem);
      simulate_release(problem);
    };
  };
  for (const double x : {0.0, -1.0, 2e4, kNaN, kInfinity})
    expect_refused({"mass", "(0, 1e4] kg"}, with([=](auto& p) { p.body.mass = x; }));
  for (const double x : {0.0, -1.0, 2e6, kNaN, kInfinity})
    expect_refused({"inertia", "(0, 1e6] kg"}, with([=](auto& p) { p.body.inertia = x; }));
  for (const double x : {kNaN, kInfinity}) {
    expect_refused({"gravity x", "finite"}, with([=](auto& p) { p.gravity.x = x; }));
    expect_refused({"gravity z", "finite"}, with([=](auto& p) { p.gravity.z = x; }));
    expect_refused({"grasp angle", "finite"}, with([=](auto& p) { p.grasp.angle = x; }));
    expect_refused({"slip", "finite"}, with([=](auto& p) { p.slip.x = x; }));
    expect_refused({"slip", "finite"}, with([=](auto& p) { p.slip.z = x; }));
    expect_refused({"spin", "finite"}, with([=](auto& p) { p.spin = x; }));
  }
  for (const double x : {101.0, kNaN})
    expect_refused({"com_offset", "[-100, 100] m"}, with([=](auto& p) { p.grasp.com_offset = x; }));
  for (const double x : {-0.1, 10.0})
    expect_refused({"start", "where the hand's motion is known"}, with([=](auto& p) { p.start = x; }));
  // Pads that pull.
  const support::ConstantForce pull(-60);
  const auto given = support::problem_of(thrown, *model);
  expect_refused({"normal force = -60 N at", "[0, inf) N"}, [&] {
    simulate_release(release::ReleaseProblem<double>{given.hand, pull, *model, given.body, given.gravity,
                                                     given.grasp, given.start, given.slip, given.spin});
  });
  // seconds since 1970: a step of 1 µs would be of four ulps
  for (const double x : {1.7e9, kNaN})
    expect_refused({"start", "[-1e6, 1e6] s"}, with([=](auto& p) { p.start = x; }));
}

/// A hand with one more jump, other ends, or a pose that is NaN from an instant on.
class SpoiltHand final : public release::HandMotion {
 public:
  explicit SpoiltHand(const release::HandMotion& hand)
      : first(hand.begin()), last(hand.end()), jump(hand.jumps()), hand_(hand) {}
  double first, last;
  std::vector<double> jump;
  double lost_after = kInfinity;  // s

  release::HandState<double> at(const release::Window& w, double t) const override { return at_(w, t); }
  release::HandState<dynamics::Dual> at(const release::Window& w, const dynamics::Dual& t) const override {
    return at_(w, t);
  }
  std::vector<double> jumps() const override { return jump; }
  double begin() const override { return first; }
  double end() const override { return last; }

 private:
  template <class S>
  release::HandState<S> at_(const release::Window& w, const S& t) const {
    auto h = hand_.at(w, t);
    if (dynamics::value_of(t) > lost_after) h.pose.x = S(kNaN);
    return h;
  }
  const release::HandMotion& hand_;
};

/// A force with one more kink, or another release.
class SpoiltForce final : public contact::NormalForce {
 public:
  explicit SpoiltForce(const contact::NormalForce& force) : release(force.release_time()), force_(force) {}
  double release;
  std::vector<double> more;

  double at(const contact::Window& w, double t) const override { return force_.at(w, t); }
  dynamics::Dual at(const contact::Window& w, const dynamics::Dual& t) const override {
    return force_.at(w, t);
  }
  void kinks(std::vector<double>& out) const override { kinks_(out); }
  void kinks(std::vector<dynamics::Dual>& out) const override { kinks_(out); }
  double release_time() const override { return release; }

 private:
  template <class S>
  void kinks_(std::vector<S>& out) const {
    for (const double t : more) out.push_back(S(t));
    force_.kinks(out);
  }
  const contact::NormalForce& force_;
};

class Spoilt : public EveryModel {
 protected:
  release::ReleaseProblem<double> problem() const {
    const auto given = support::problem_of(thrown, *model);
    return {hand, force, *model, given.body, given.gravity, given.grasp, given.start, given.slip, given.spin};
  }
  void expect_both_refuse(const std::vector<std::string>& words) const {
    expect_refused(words, [&] { simulate_release(problem()); });
    expect_refused(words, [&] { simulate_release_naive(problem(), thrown.patch); });
  }

  std::mt19937_64 random{55};
  const support::RandomThrow thrown = support::random_throw(random, 0);
  const std::unique_ptr<contact::ContactModel> model = make(support::parameters_of(thrown));
  SpoiltHand hand{thrown.hand};
  SpoiltForce force{thrown.force};
};
UNHAND_EVERY_MODEL(Spoilt);

TEST_P(Spoilt, InstantsThatAreNoneAreRefused) {
  ASSERT_EQ(simulate_release(problem()).outcome, release::ReleaseOutcome::detached);
  for (const double t : {kNaN, -kInfinity}) {
    force.release = t;
    expect_both_refuse({"release time of the normal force", std::to_string(t), "(-inf, inf] s"});
  }
  force.release = thrown.force.release_time();
  for (const double t : {kNaN, kInfinity}) {
    force.more = {t};
    expect_both_refuse({"kink of the normal force", std::to_string(t), "s is not finite"});
    force.more = {};
    hand.jump = {t};
    expect_both_refuse({"jump of the hand's motion", std::to_string(t), "s is not finite"});
    hand.jump = {};
    hand.last = t;
    expect_both_refuse({"end of the hand's motion", std::to_string(t), "s is not finite"});
    hand.last = thrown.hand.end();
    hand.first = -t;
    expect_both_refuse({"begin of the hand's motion", std::to_string(-t), "s is not finite"});
    hand.first = thrown.hand.begin();
  }
}

TEST_P(Spoilt, ClocksThatBeginFarAwayAreRefused) {
  auto far = problem();
  far.start = 1e7;
  expect_refused({"start = 10000000", "[-1e6, 1e6] s"}, [&] { simulate_release(far); });
  expect_refused({"start = 10000000", "[-1e6, 1e6] s"}, [&] { simulate_release_naive(far, thrown.patch); });
}

TEST_P(Spoilt, ADetachThatIsNotFiniteIsNone) {
  hand.lost_after = 0.5 * support::parameters_of(thrown).open_command;
  const auto result = simulate_release(problem());
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::not_solved);
  EXPECT_EQ(result.integration, dynamics::Outcome::not_finite);
}

TEST(UnknownModel, IsRefusedWithTheNamesThereAre) {
  auto words = contact::contact_model_names();
  words.push_back("velcro");
  expect_refused(words, [] {
    contact::make_contact_model("velcro", contact::ContactParameters<double>{{0.5, 0.01}, {}, {}, 0, 0});
  });
}

// ---------------------------------------------------------------- extreme throws

TEST_P(Outcomes, ExtremeThrowsHaveAnswers) {
  std::mt19937_64 random(54);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  const auto log_uniform = [&](double a, double b) { return std::exp(uniform(std::log(a), std::log(b))); };
  int unsolved = 0;
  long most_steps = 0;
  for (int i = 0; i < 500; ++i) {
    const double opening = log_uniform(1e-6, 10), mass = log_uniform(1e-3, 100),
                 gyration = log_uniform(1e-3, 0.3);
    std::array<support::SwayingHand::Coordinate, 3> c{};
    if (i % 3 == 1) c[2].v = i % 2 ? 50 : -50;
    if (i % 3 == 2) {
      const double w = uniform(10, 400);
      for (auto& q : c)
        q = {uniform(-1, 1), uniform(-3, 3), uniform(-1, 1), uniform(0, 50) / (w * w), w, uniform(0, 6)};
    }
    const double end = 0.001 + opening + 0.01;
    const support::SwayingHand hand(c, end);
    const contact::ProfileNormalForce force(
        contact::OpeningProfile<double>{0.001, log_uniform(0.1, 300), 0, opening, uniform(0.5, 3)});
    contact::ContactParameters<double> p;
    p.patch = {i % 7 == 0 ? 0.0 : uniform(0, 5), log_uniform(1e-4, 0.1), uniform(0.3, 1), i % 2 + 1};
    p.open_command = 0.001;
    p.delay = opening;
    const auto model = make(p);
    const release::ReleaseProblem<double> problem{hand,
                                                  force,
                                                  *model,
                                                  {mass, mass * gyration * gyration},
                                                  {0, i % 5 == 0 ? 0.0 : -9.81},
                                                  {i % 4 ? uniform(0, 0.3) : 0.0, uniform(-3, 3)},
                                                  0.0,
                                                  {},
                                                  0.0};
    std::ostringstream inputs;
    inputs.precision(17);
    inputs << "throw " << i << " of seed 54: mass " << mass << " gyration " << gyration << " opening "
           << opening << " grip " << force.profile().grip_force.a << " shape " << force.profile().shape.a
           << " mu " << p.patch.mu << " radius " << p.patch.radius << " c " << p.patch.torque_factor
           << " offset " << problem.grasp.com_offset << " angle " << problem.grasp.angle;
    const auto result = simulate_release(problem);
    if (result.outcome != release::ReleaseOutcome::detached) {
      ++unsolved;
      ADD_FAILURE() << to_string(result.outcome) << ", " << to_string(result.integration) << " at "
                    << result.detach.time << " s, " << inputs.str();
    }
    const auto& d = result.detach;
    for (const double x : {d.time, d.pose.x, d.pose.z, d.pose.theta, d.twist.vx, d.twist.vz, d.twist.omega})
      EXPECT_TRUE(std::isfinite(x)) << inputs.str();
    most_steps = std::max(most_steps, result.statistics.steps);
    // The budget is 200'000: ten seconds of a hand that shakes at 400 rad/s are 640 periods of some hundred
    // steps each.
    EXPECT_LT(result.statistics.steps, 100'000) << inputs.str();
  }
  EXPECT_EQ(unsolved, 0);
  RecordProperty("most_steps", std::to_string(most_steps));
}

TEST(NaiveRelease, SmoothingIsNoSpeedBelowZero) {
  std::mt19937_64 random(56);
  const auto thrown = support::random_throw(random, 0);
  const auto model = contact::make_contact_model("limit_surface", support::parameters_of(thrown));
  const auto problem = support::problem_of(thrown, *model);
  for (const double speed : {kNaN, kInfinity, -1e-3})
    expect_refused({"smoothing", "[0, inf) m/s"}, [&] {
      simulate_release_naive(problem, thrown.patch, {1e-3, speed});
    });
}

}  // namespace
}  // namespace unhand
