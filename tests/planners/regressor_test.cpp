// Regressors of the dynamics: KDL as the oracle, skew symmetry, momentum without accelerations.
#include "planners/control/regressor.hpp"

#include <gtest/gtest.h>

#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <random>

#include "planners/arm/panda.hpp"
#include "tests/planners/kdl_chain.hpp"

namespace unhand::planners::control {
namespace {

using Joints = JointVector<double>;

struct RandomState {
  Joints q, qd, qdd, other;
};
RandomState state_of(std::mt19937_64& random) {
  std::uniform_real_distribution<double> one(-1, 1);
  RandomState s{Joints(7), Joints(7), Joints(7), Joints(7)};
  for (int i = 0; i < 7; ++i)
    s.q[i] = 3 * one(random), s.qd[i] = 2 * one(random), s.qdd[i] = 10 * one(random),
    s.other[i] = 2 * one(random);
  return s;
}
Chain loaded() {
  return with_payload(panda(), {0.9, {0.03, -0.02, 0.09}, symmetric(2e-3, 3e-3, 2.5e-3, 1e-4, -2e-4, 3e-4)});
}

/// Sums of some hundred products with torques of up to 100 N m.
constexpr double kRounding = 1e-11;

TEST(Regressor, TimesTheParametersIsKdlsInverseDynamics) {
  const Chain arm = loaded();
  const Eigen::VectorXd parameters = parameters_of(arm);
  const KDL::Chain oracle = kdl_chain(arm);
  KDL::ChainIdSolver_RNE inverse(oracle, KDL::Vector(kGravity[0], kGravity[1], kGravity[2]));
  std::mt19937_64 random(1);
  for (int k = 0; k < 200; ++k) {
    const auto [q, qd, qdd, other] = state_of(random);
    KDL::JntArray a(7), b(7), c(7), tau(7);
    a.data = q, b.data = qd, c.data = qdd;
    ASSERT_GE(inverse.CartToJnt(a, b, c, KDL::Wrenches(8), tau), 0);
    EXPECT_LE((torque_regressor<double>(arm, q, qd, qdd) * parameters - tau.data).norm(),
              kRounding * (1 + tau.data.norm()));
    // Slotine and Li's with the motion's own rates is the same.
    EXPECT_LE((slotine_li_regressor<double>(arm, q, qd, qd, qdd) * parameters - tau.data).norm(),
              kRounding * (1 + tau.data.norm()));
    // The last link's columns alone are the last columns.
    EXPECT_EQ((torque_regressor<double>(arm, q, qd, qdd, kGravity, 6) -
               torque_regressor<double>(arm, q, qd, qdd).rightCols(10))
                  .norm(),
              0);
  }
}

TEST(Regressor, OfSlotineAndLiHasTheSkewSymmetricC) {
  const Chain arm = loaded();
  const Eigen::VectorXd parameters = parameters_of(arm);
  std::mt19937_64 random(2);
  for (int k = 0; k < 50; ++k) {
    const auto [q, qd, qdd, x] = state_of(random);
    const Joints none = Joints::Zero(7);
    const Eigen::Vector3d weightless(0, 0, 0);
    // xᵀ (Ṁ − 2 C) x = 0 with C x from the regressor, and Ṁ from dual numbers along the motion.
    const Joints C_x = slotine_li_regressor<double>(arm, q, qd, x, none, weightless) * parameters;
    using Along = dynamics::DualOf<1>;
    JointVector<Along> moving(7);
    for (int i = 0; i < 7; ++i) {
      moving[i] = Along(q[i]);
      moving[i].v[0] = qd[i];
    }
    const auto M = mass_matrix<Along>(arm, moving);
    double M_rate = 0;
    for (int i = 0; i < 7; ++i)
      for (int j = 0; j < 7; ++j) M_rate += x[i] * M(i, j).v[0] * x[j];
    EXPECT_NEAR(M_rate, 2 * x.dot(C_x), kRounding * (1 + std::abs(M_rate)));
    EXPECT_LE((C_x - coriolis_matrix<double>(arm, q, qd) * x).norm(), kRounding * (1 + C_x.norm()));
  }
}

TEST(Regressor, MomentumAndItsRestNeedNoAcceleration) {
  const Chain arm = loaded();
  const Eigen::VectorXd parameters = parameters_of(arm);
  std::mt19937_64 random(3);
  for (int k = 0; k < 20; ++k) {
    const auto [q, qd, qdd, other] = state_of(random);
    const Joints momentum = momentum_regressor<double>(arm, q, qd) * parameters;
    EXPECT_LE((momentum - mass_matrix<double>(arm, q) * qd).norm(), kRounding * (1 + momentum.norm()));
    // d/dt (M q̇) + h = τ, the rate by dual numbers along (q̇, q̈).
    using Along = dynamics::DualOf<1>;
    JointVector<Along> at(7), rate(7);
    for (int i = 0; i < 7; ++i) {
      at[i] = Along(q[i]), rate[i] = Along(qd[i]);
      at[i].v[0] = qd[i], rate[i].v[0] = qdd[i];
    }
    Joints total = momentum_rest_regressor(arm, q, qd) * parameters;
    const JointVector<Along> p_rate = mass_matrix<Along>(arm, at) * rate;
    for (int i = 0; i < 7; ++i) total[i] += p_rate[i].v[0];
    const Joints tau = inverse_dynamics<double>(arm, q, qd, qdd);
    EXPECT_LE((total - tau).norm(), kRounding * (1 + tau.norm()));
  }
}

TEST(Regressor, ParametersAreTheBodys) {
  const Inertia body = loaded().joints.back().link;
  const Inertia back = inertia_from(parameters_of(body));
  EXPECT_DOUBLE_EQ(back.mass, body.mass);
  EXPECT_LE((back.com - body.com).norm(), 1e-15);
  EXPECT_LE((back.about_com - body.about_com).norm(), 1e-15);
  EXPECT_THROW(inertia_from(LinkParameters::Zero()), std::invalid_argument);
}

}  // namespace
}  // namespace unhand::planners::control
