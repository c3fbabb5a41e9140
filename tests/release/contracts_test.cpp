// What a release says of a law or of a normal force that does not keep its contract.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "contact/contact_model_from.hpp"
#include "contact/gripper_delay.hpp"
#include "release/naive_release.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand {
namespace {

using dynamics::Dual;
using testing::HasSubstr;

/// Viscous friction without modes but one, whose answers about them are its parameters.
class Odd final : public contact::ContactModelFrom<Odd> {
 public:
  int modes{1}, guards_of_it{0}, first{0};
  std::string_view name() const override { return "odd"; }
  int mode_count() const override { return modes; }
  std::string_view mode_name(int) const override { return "creep"; }
  dynamics::FlowKind kind(int) const override { return dynamics::FlowKind::smooth; }
  int guard_count(int) const override { return guards_of_it; }
  dynamics::Guard guard(int, int) const override { return {"never", dynamics::Crossing::rising}; }
  bool is_homogeneous(int) const override { return false; }
  template <class S>
  contact::Wrench<S> wrench_(int, const contact::Scene<S>& s, const contact::Relative<S>& y) const {
    return {-s.normal_force * y.slip.x, -s.normal_force * y.slip.z, -s.normal_force * y.spin};
  }
  template <class S>
  void rate_(int mode, const contact::Scene<S>& s, const contact::Relative<S>& y,
             dynamics::State<S, 6>& dy) const {
    dy = contact::relative_rate(s, y, wrench_(mode, s, y));
  }
  template <class S>
  void guards_(const contact::Phase&, const contact::SceneSource&, const S&, const contact::Relative<S>&,
               S* g) const {
    std::fill(g, g + guards_of_it, S(-1));
  }
  template <class S>
  contact::Entry<S, 6> on_guard_(const contact::Phase& from, int, const contact::SceneSource&, const S& t,
                                 const contact::Relative<S>& y) const {
    return {from.mode, t, y.state(), S(0)};
  }
  template <class S>
  contact::Entry<S, 6> membership_(int, const contact::Window&, const contact::SceneSource&, const S& t,
                                   const contact::Relative<S>& y) const {
    return {first, t, y.state(), S(0)};
  }
};

/// 40 N up to `drop` [s] and `rest` [N] from there on, while the pads count as parted at `release` [s].
class Claimed final : public contact::NormalForce {
 public:
  Claimed(double drop, double release, double rest = 0) : drop_(drop), release_(release), rest_(rest) {}
  double at(const contact::Window& w, double t) const override {
    return std::min(std::max(t, w.begin + 1e-10), w.end - 1e-10) < drop_ ? 40 : rest_;
  }
  Dual at(const contact::Window& w, const Dual& t) const override { return Dual(at(w, t.a)); }
  void kinks(std::vector<double>& out) const override { out.insert(out.end(), {drop_}); }
  void kinks(std::vector<Dual>& out) const override { out.insert(out.end(), {Dual(drop_)}); }
  double release_time() const override { return release_; }

 private:
  double drop_, release_, rest_;
};

template <class S>
release::ReleaseProblem<S> problem(const release::HandMotion& hand, const contact::NormalForce& force,
                                   const contact::ContactModel& law) {
  return {hand, force, law, {S(0.4), S(1e-3)}, {S(0), S(-9.81)}, {S(0.05), S(0)}, 0.0, {}, S(0)};
}

template <class Error>
std::string message(const contact::NormalForce& force, const contact::ContactModel& law) {
  const auto hand = support::still_hand(0.2);
  try {
    release::simulate_release(problem<double>(hand, force, law));
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Contracts, OfModes) {
  const Claimed force(0.1, 0.1);
  EXPECT_EQ(message<std::exception>(force, Odd{}), "");
  Odd law;
  for (const int mode : {-1, 1, 5}) {
    law.first = mode;
    EXPECT_THAT(message<std::logic_error>(force, law),
                HasSubstr("\"odd\": mode " + std::to_string(mode) + " is not in [0, 0]"));
  }
  law = {};
  law.modes = 0;
  EXPECT_THAT(message<std::logic_error>(force, law), HasSubstr("\"odd\": 0 modes"));
}

TEST(Contracts, OfGuards) {
  const Claimed force(0.1, 0.1);
  Odd law;
  law.guards_of_it = dynamics::kMaxGuards;
  EXPECT_EQ(message<std::exception>(force, law), "");
  law.guards_of_it = 9;
  EXPECT_THAT(message<std::logic_error>(force, law),
              HasSubstr("\"odd\": 9 guards of mode \"creep\" are not in [0, 8]"));
}

TEST(Contracts, OfTheReleaseOfTheForce) {
  const Odd law;
  EXPECT_EQ(message<std::exception>(Claimed(0.1, 0.1), law), "");
  EXPECT_EQ(message<std::exception>(Claimed(0.05, 0.1), law), "") << "it may be zero before";
  EXPECT_THAT(message<std::invalid_argument>(Claimed(0.1, 0.05), law),
              HasSubstr("is not 0 N, though its release_time() is 0.05 s"));
  EXPECT_THAT(message<std::invalid_argument>(Claimed(0.1, 0.1, 1e-6), law), HasSubstr("is not 0 N"));
  EXPECT_THAT(message<std::invalid_argument>(Claimed(0.1, 0.1, NAN), law), HasSubstr("is not 0 N"));
  EXPECT_EQ(message<std::exception>(Claimed(0.5, 0.4), law), "") << "after the hand's motion nobody looks";
}

TEST(Contracts, ANaiveReleaseAsksForTheSame) {
  const auto hand = support::still_hand(0.2);
  const Odd law;
  const auto thrown_with = [&](const contact::NormalForce& force) {
    release::simulate_release_naive(problem<double>(hand, force, law), contact::Patch<double>{0.5, 0.01});
  };
  EXPECT_NO_THROW(thrown_with(Claimed(0.1, 0.1)));
  EXPECT_THROW(thrown_with(Claimed(0.1, 0.05)), std::invalid_argument);
  EXPECT_THROW(thrown_with(Claimed(0.05, 0.1, -10)), std::invalid_argument) << "negative before the release";
}

TEST(Contracts, AReleaseBeforeTheStartIsAtTheStart) {
  const auto hand = support::still_hand(0.2);
  const Claimed force(-5, -5);
  const Odd law;
  const auto result = release::simulate_release(problem<double>(hand, force, law));
  EXPECT_EQ(result.outcome, release::ReleaseOutcome::detached);
  EXPECT_EQ(result.detach.time, 0);
  EXPECT_TRUE(result.events.empty());
}

TEST(Contracts, AJumpAtTheInstantOfTheSeparationLeavesItsDerivative) {
  // 0.1 + 0.7 is one rounding below 0.8, where the hand's acceleration jumps.
  ASSERT_LT(0.1 + 0.7, 0.8);
  for (const double jump : {0.8, std::nextafter(0.1 + 0.7, 0), 0.1 + 0.7}) {
    const auto hand = release::PolynomialHand::segments(0, {0, 0, 0}, {0, 0, 0},
                                                        {{jump, {2, 1, 3}, {}}, {1, {-5, 0, 0}, {}}});
    const support::ConstantForce force(10);
    const contact::GripperDelay law(0.1, Dual(0.7, 0));
    const auto result = release::simulate_release(problem<Dual>(hand, force, law));
    ASSERT_EQ(result.outcome, release::ReleaseOutcome::detached);
    EXPECT_NEAR(result.detach.time.a, 0.8, 1e-12);
    EXPECT_EQ(result.detach.time.v[0], 1) << jump;
  }
}

TEST(Contracts, AJumpAtTheInstantOfAKinkKeepsItsOwnDerivative) {
  // 0.1 + 0.2 is one rounding above 0.3. The force begins to fall there, where the hand's acceleration jumps:
  // the jump stays where it is whatever moves the kink.
  ASSERT_GT(0.1 + 0.2, 0.3);
  contact::ContactParameters<double> pads;
  pads.patch = {0.05, 0.004};
  const auto law = contact::make_contact_model("limit_surface", pads);
  for (const double jump : {0.3, 0.1 + 0.2, std::nextafter(0.1 + 0.2, 1)}) {
    const auto hand = release::PolynomialHand::segments(0, {0.5, 0.9, 0.8}, {1.8, 1.8, 2.0},
                                                        {{jump, {3, 3, 0}, {}}, {0.6, {-28, -28, 0}, {}}});
    const auto spin = [&](auto dead_time) {
      using S = decltype(dead_time);
      const contact::ProfileNormalForce force(
          contact::OpeningProfile<S>{0.1, S(60), dead_time, S(0.07), S(1)});
      const release::ReleaseProblem<S> thrown{
          hand, force, *law, {S(0.246), S(2.4e-3)}, {S(0), S(-9.81)}, {S(0.1), S(-0.7)}, 0.0, {}, S(0)};
      return release::simulate_release(thrown, {.integrator = {.tolerances = {1e-10, 1e-12}}})
          .detach.twist.omega;
    };
    const double exact = spin(Dual(0.2, 0)).v[0], h = 1e-5;
    const double difference = (spin(0.2 + h) - spin(0.2 - h)) / (2 * h);
    EXPECT_NEAR(exact, difference, 1e-3 * std::abs(difference)) << jump;
  }
}

TEST(Contracts, LedgersAreOfValues) {
  const auto hand = support::still_hand(0.2);
  const Claimed force(0.1, 0.1);
  const Odd law;
  release::ReleaseOptions options;
  options.ledger = true;
  EXPECT_LT(release::simulate_release(problem<double>(hand, force, law), options).ledger.linear_friction, 0);
  EXPECT_THROW(release::simulate_release(problem<Dual>(hand, force, law), options), std::invalid_argument);
}

TEST(Contracts, SamplesAreOfRecordedInstants) {
  const auto hand = support::still_hand(0.2);
  const Claimed force(0.1, 0.1);
  const Odd law;
  const auto p = problem<double>(hand, force, law);
  release::ReleaseOptions options;
  options.integrator.record = true;
  const auto result = release::simulate_release(p, options);
  EXPECT_NO_THROW(release::sample_release(p, result, 0.05));
  for (const double t : {-0.01, 0.15, static_cast<double>(NAN)})
    EXPECT_THROW(release::sample_release(p, result, t), std::out_of_range) << t;
}

TEST(Contracts, ASamplesDerivativeByTimeIsItsMotion) {
  const auto hand = release::PolynomialHand::segments(0, {0.5, 0.9, 0.8}, {1.8, 1.8, 2.0},
                                                      {{0.2, {3, -2, 40}, {50, 0, 0}}});
  const Claimed force(0.1, 0.1);
  const Odd law;
  auto p = problem<Dual>(hand, force, law);
  p.slip = {Dual(0.1), Dual(-0.2)};
  p.spin = Dual(3);
  release::ReleaseOptions options;
  options.integrator = support::tight(1e-9, 1e-11);
  options.integrator.record = true;
  const auto result = release::simulate_release(p, options);
  for (const double t : {0.013, 0.05, 0.087}) {
    const auto at = release::sample_release(p, result, Dual(t, 0));
    EXPECT_NEAR(at.pose.x.v[0], at.twist.vx.a, 1e-6) << t;
    EXPECT_NEAR(at.pose.z.v[0], at.twist.vz.a, 1e-6) << t;
    EXPECT_NEAR(at.pose.theta.v[0], at.twist.omega.a, 1e-6) << t;
    // Newton's law for the rate of the twist
    EXPECT_NEAR(at.twist.vx.v[0], at.wrench.fx.a / 0.4, 1e-4) << t;
    EXPECT_NEAR(at.twist.vz.v[0], at.wrench.fz.a / 0.4 - 9.81, 1e-4) << t;
  }
}

TEST(Contracts, AReleaseAtTheEndOfTheHandsMotionCounts) {
  const auto hand = support::still_hand(0.1);
  const Odd law;
  const auto at_the_end = release::simulate_release(problem<double>(hand, Claimed(0.1, 0.1), law));
  EXPECT_EQ(at_the_end.outcome, release::ReleaseOutcome::detached);
  EXPECT_EQ(at_the_end.detach.time, 0.1);
  const auto later = release::simulate_release(problem<double>(hand, Claimed(0.1001, 0.1001), law));
  EXPECT_EQ(later.outcome, release::ReleaseOutcome::never_separated);
}

TEST(Contracts, ErrorsSayWhatIsNotFinite) {
  const auto hand = support::still_hand(0.2);
  const Claimed force(0.1, 0.1);
  const Odd law;
  auto p = problem<double>(hand, force, law);
  p.grasp.angle = NAN;
  EXPECT_EQ(support::refusal([&] { release::simulate_release(p); }),
            "release: grasp angle = nan rad is not finite");
}

}  // namespace
template class contact::ContactModelFrom<Odd>;
}  // namespace unhand
