// A ramp whose end is uncertain: it moves as a least-squares fit of its samples would move it.
#include "experiment/doubtful_force.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "contact/friction_effects.hpp"

namespace unhand::experiment {
namespace {

using dynamics::Dual;
using dynamics::independent;
using dynamics::Window;

constexpr double kStart = 0.035, kLength = 0.07, kGrip = 60, kSigma = 1e-4;

contact::ProfileNormalForce ramp(double shape) {
  return contact::ProfileNormalForce(contact::OpeningProfile<double>{0.025, kGrip, 0.01, kLength, shape});
}
contact::NormalForceSummary summary(double shape) {
  contact::NormalForceSummary out;
  out.opening_start = out.ramp_start = kStart;
  out.release_time = kStart + kLength;
  out.release_sigma = kSigma;
  out.shape = shape;
  return out;
}

TEST(DoubtfulForce, IsTheBaseWithoutDeviation) {
  const auto base = ramp(2);
  const DoubtfulForce same(base, summary(2), Dual(0.0));
  const Window all{0, 0.2};
  for (double t = 0; t < 0.15; t += 0.0037) EXPECT_NEAR(same.at(all, t), base.at(all, t), 1e-12 * kGrip) << t;
  EXPECT_NEAR(same.release_time(), base.release_time(), 1e-15);
}

TEST(DoubtfulForce, EndsWhereItSays) {
  const auto base = ramp(1.5);
  const DoubtfulForce later(base, summary(1.5), Dual(3.0));
  EXPECT_NEAR(later.release_time(), kStart + kLength + 3 * kSigma, 1e-15);
  EXPECT_EQ(later.kinks().back(), later.release_time());
  const Window all{0, 0.2};
  EXPECT_EQ(later.at(all, later.release_time() + 1e-6), 0);
  EXPECT_GT(later.at(all, base.release_time()), 0);
  EXPECT_THROW(DoubtfulForce(base, summary(1.5), Dual(1000.0)), std::invalid_argument);
}

TEST(DoubtfulForce, NothingButTheReleaseWouldFitBetter) {
  // d f/d(release) along the family is orthogonal to what the samples fix: shape and start.
  constexpr int kSamples = 20000;
  constexpr double kStep = 1e-3;
  for (const double shape : {1.0, 1.25, 2.0, 3.0}) {
    const auto base = ramp(shape);
    const DoubtfulForce above(base, summary(shape), Dual(kStep)), below(base, summary(shape), Dual(-kStep));
    const Window all{0, 0.2};
    double dd = 0, pp = 0, ss = 0, dp = 0, ds = 0, ps = 0;
    for (int k = 0; k < kSamples; ++k) {
      const double u = (k + 0.5) / kSamples, t = kStart + kLength * (1 - u), f = kGrip * std::pow(u, shape);
      const double d = (above.at(all, t) - below.at(all, t)) / (2 * kStep * kSigma), p = f * std::log(u),
                   s = f * shape / kLength;
      dd += d * d, pp += p * p, ss += s * s, dp += d * p, ds += d * s, ps += p * s;
    }
    // Sums for integrals: off by 1/kSamples of the integrands' variation, which is steep at u = 0 for p = 1.
    EXPECT_LT(std::abs(dp) / std::sqrt(dd * pp), 5e-3) << shape;
    EXPECT_LT(std::abs(ds) / std::sqrt(dd * ss), 5e-3) << shape;
    EXPECT_GT(std::abs(ps) / std::sqrt(pp * ss), 0.5);  // while these two go together
  }
}

TEST(DoubtfulForce, ExactDerivatives) {
  const auto base = ramp(2);
  const Window all{0, 0.2};
  for (const double z : {-2.0, 0.5}) {
    const DoubtfulForce force(base, summary(2), independent(z, 4));
    for (const double t : {0.036, 0.06, 0.09, 0.104}) {
      const double exact = force.at(all, Dual(t)).v[4];
      double best = 1;
      for (double h = 1e-1; h > 1e-7; h /= 10) {
        const double above = DoubtfulForce(base, summary(2), Dual(z + h)).at(all, t),
                     below = DoubtfulForce(base, summary(2), Dual(z - h)).at(all, t);
        best = std::min(best, std::abs((above - below) / (2 * h) - exact));
      }
      EXPECT_LT(best, 1e-9 * kGrip) << z << " at " << t;  // truncation h^2 meets rounding 1e-16/h
    }
    std::vector<Dual> kinks;
    force.kinks(kinks);
    EXPECT_NEAR(kinks.back().v[4], kSigma, 1e-15);
  }
}

TEST(DoubtfulForce, AWideReleaseMovesAsFarAsARampCan) {
  for (const double shape : {0.5, 1.0, 2.0}) {
    const auto base = ramp(shape);
    auto wide = summary(shape);
    for (const double sigma : {kLength / 15, kLength / 5, kLength, 100 * kLength}) {
      wide.release_sigma = sigma;
      ASSERT_TRUE(DoubtfulForce::applies_to(wide));
      std::vector<Dual> kinks;
      DoubtfulForce(base, wide, independent(0.0, 4)).kinks(kinks);
      EXPECT_NEAR(kinks.back().v[4], sigma, 1e-12 * sigma);  // what a prediction's sigma is made of
      double before = 0;
      for (const double z : {-6.0, -1.0, 1.0, 6.0}) {
        const DoubtfulForce moved(base, wide, Dual(z));
        const double end = moved.release_time(), start = moved.kinks().front();
        EXPECT_GE(end, before);
        before = end;
        EXPECT_LE(std::abs(end - kStart - kLength), 0.2 * kLength * (1 + 1e-12));
        for (double u = 0.01; u < 1; u += 0.01) {
          const double f = moved.at(Window{start, end}, end - (end - start) * u);
          EXPECT_TRUE(f > 0 && f < 1.0001 * kGrip) << f << " N at " << u << ", z " << z;
        }
      }
    }
  }
}

TEST(DoubtfulForce, ItsEndMovesTheBiasThatFadesTillThere) {
  constexpr double kStep = 1e-4;
  const auto base = ramp(1.5);
  const Window all{0, 0.2};
  const auto force = [&](const Dual& deviation, const auto& t) {
    const DoubtfulForce doubtful(base, summary(1.5), deviation);
    return contact::BiasedForce(doubtful, Dual(5.0), kStart).at(all, t);
  };
  for (const double t : {0.04, 0.06, 0.08}) {
    const double difference = (force(Dual(kStep), t) - force(Dual(-kStep), t)) / (2 * kStep);
    EXPECT_NEAR(force(independent(0.0, 0), Dual(t)).v[0], difference, 1e-6 * std::abs(difference)) << t;
  }
}

}  // namespace
}  // namespace unhand::experiment
