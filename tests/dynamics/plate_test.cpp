// A block with dry friction on a plate shaken sinusoidally: where it never sticks, where it always does, and
// that a stuck block does not creep.
#include "tests/dynamics/every_method.hpp"

namespace unhand::dynamics {
namespace {

class Plate : public EveryMethod {
 protected:
  static Solution<double, 2> shake(double rho, double t_end, const IntegratorOptions& options) {
    return integrate<double, 2>(plate(Dual(rho)), Entry<double, 2>{2, 0.0, {0.0, 0.0}, 0.0}, t_end, options);
  }
  /// Whether the block sticks once the start is forgotten.
  static bool sticks(double rho) {
    auto o = options();
    o.guard_interval = 0.05;  // the shaking has a period of 2π
    const auto end = shake(rho, 400.0, o);
    EXPECT_EQ(end.outcome, Outcome::horizon) << rho;
    return sticks_late(end);
  }
};
UNHAND_EVERY_METHOD(Plate);

TEST_P(Plate, TheThresholdOfNeverSticking) {
  const double threshold = 1 / std::sqrt(1 + 0.25 * M_PI * M_PI);
  // The transient near the threshold is slow: 300 time units leave less than 2e-4 of it.
  EXPECT_FALSE(sticks(threshold - 2e-4));
  EXPECT_TRUE(sticks(threshold + 2e-4));
}

TEST_P(Plate, StickSlipUpToOneAndAlwaysStickAbove) {
  for (const double rho : {0.6, 0.8, 0.95, 0.999}) EXPECT_TRUE(sticks(rho)) << rho;
  const auto slips = shake(0.999, 20.0, options());
  EXPECT_GE(slips.events.size(), 10u);  // out of stick and back in, twice a period
  const auto holds = shake(1.001, 20.0, options());
  EXPECT_EQ(holds.events.size(), 0u);
  EXPECT_EQ(holds.mode, 2);
}

TEST_P(Plate, TheFirstSlipIsTheClosedForm) {
  // Slip back starts at asin ρ; its speed is cos s − cos s0 − ... = 0 at the end: cos t − cos t0 + ρ (t − t0)
  // = 0.
  for (const double rho : {0.6, 0.7, 0.8, 0.9, 0.99}) {
    const auto end = shake(rho, 3.9, options());
    ASSERT_GE(end.events.size(), 2u) << rho;
    const double begin = end.events[0].t, stop = end.events[1].t;
    EXPECT_EQ(end.events[0].mode_after, 1);
    EXPECT_NEAR(begin, std::asin(rho), 1e-9) << rho;
    EXPECT_NEAR(std::cos(stop) - std::cos(begin) + rho * (stop - begin), 0, 1e-9) << rho;
  }
}

TEST_P(Plate, AStuckBlockDoesNotCreep) {
  auto o = options();
  const auto slid = shake(0.8, 2 * M_PI, o);
  const auto stick = std::find_if(slid.events.rbegin(), slid.events.rend(),
                                  [](const auto& event) { return event.mode_after == 2; });
  ASSERT_NE(stick, slid.events.rend());
  // Ten seconds of stick, held by a grip that suffices now: not one bit moves.
  const auto held = integrate<double, 2>(plate(Dual(1.5)), Entry<double, 2>{2, stick->t, stick->y, 0.0},
                                         stick->t + 10.0, o);
  EXPECT_EQ(held.y[0], stick->y[0]);
  EXPECT_EQ(held.y[1], 0.0);
}

class PlateDerivative : public Plate {};
UNHAND_EVERY_METHOD_WITH_DERIVATIVES(PlateDerivative);

TEST_P(PlateDerivative, OfTheSlipInTheGrip) {
  auto slide = [](Dual rho) {
    return integrate<Dual, 2>(plate(rho), Entry<Dual, 2>{2, Dual(0), {Dual(0), Dual(0)}, Dual(0)}, Dual(9.0),
                              options());
  };
  const auto end = slide(independent(0.7, 0));
  const auto up = slide(Dual(0.7 + 1e-4)), down = slide(Dual(0.7 - 1e-4));
  ASSERT_EQ(end.events.size(), up.events.size());
  ASSERT_EQ(end.events.size(), down.events.size());
  EXPECT_GE(end.events.size(), 4u);  // two full regimes of slip
  for (int i = 0; i < 2; ++i)
    EXPECT_NEAR(end.y[i].v[0], (up.y[i].a - down.y[i].a) / 2e-4,
                1e-6);  // 1e-8 x third derivative; noise 1e-11/1e-4
}

}  // namespace
}  // namespace unhand::dynamics
