// Kinematics and dynamics of serial chains: KDL as the oracle, derivatives, energy, symmetry.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <kdl/chainjnttojacdotsolver.hpp>
#include <kdl/chainjnttojacsolver.hpp>
#include <numbers>
#include <random>
#include <stdexcept>

#include "planners/arm/dynamics.hpp"
#include "planners/arm/panda.hpp"
#include "tests/planners/kdl_chain.hpp"

namespace unhand::planners {
namespace {

using Joints = JointVector<double>;

/// A body that is neither symmetric nor centred, seen from the flange.
Inertia odd_payload() { return {0.9, {0.03, -0.02, 0.09}, symmetric(2e-3, 3e-3, 2.5e-3, 1e-4, -2e-4, 3e-4)}; }

/// Arms of 1 to 8 joints with frames and links at random, and the Panda with and without a load.
std::vector<Chain> arms() {
  std::vector<Chain> out{panda(), with_payload(panda(), odd_payload())};
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> length(-0.5, 0.5), mass(0.1, 5), width(0.02, 0.2);
  std::normal_distribution<double> normal;
  for (const int n : {1, 3, 8}) {
    Chain arm{"random", {}, {}};
    const auto frame = [&] {
      Eigen::Quaterniond turned;
      for (int k = 0; k < 4; ++k) turned.coeffs()[k] = normal(random);
      Transform<double> there{turned.normalized().toRotationMatrix(), {}};
      for (int k = 0; k < 3; ++k) there.p[k] = length(random);
      return there;
    };
    for (int i = 0; i < n; ++i) {
      const double a = width(random), b = width(random), c = width(random), m = mass(random);
      const Eigen::Matrix3d box = m / 12 * symmetric(b * b + c * c, a * a + c * c, a * a + b * b, 0, 0, 0);
      arm.joints.push_back({"joint", frame(), seen_from(frame(), {m, {0, 0, 0}, box}), {}, {}});
    }
    arm.tip = frame();
    out.push_back(arm);
  }
  return out;
}

struct RandomState {
  Joints q, qd, qdd;
};
RandomState state_of(int n, std::mt19937_64& random) {
  std::uniform_real_distribution<double> angle(-3, 3), rate(-2.5, 2.5), acceleration(-15, 15);
  RandomState s{Joints(n), Joints(n), Joints(n)};
  for (int i = 0; i < n; ++i) s.q[i] = angle(random), s.qd[i] = rate(random), s.qdd[i] = acceleration(random);
  return s;
}

KDL::JntArray kdl(const Joints& q) {
  KDL::JntArray out(static_cast<unsigned>(q.size()));
  out.data = q;
  return out;
}

/// Lengths of 1 m, torques of 100 N m, sums of some hundred terms: rounding stays below 1e-12 of the largest.
void expect_near(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, const char* what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  EXPECT_LE((a - b).cwiseAbs().maxCoeff(), 1e-12 * (1 + b.cwiseAbs().maxCoeff())) << what << '\n'
                                                                                  << a << "\n\n"
                                                                                  << b;
}

TEST(Chain, AgreesWithKdl) {
  std::mt19937_64 random(1);
  for (const Chain& arm : arms()) {
    const KDL::Chain oracle = kdl_chain(arm);
    KDL::ChainFkSolverPos_recursive position(oracle);
    KDL::ChainJntToJacSolver jac(oracle);
    KDL::ChainJntToJacDotSolver jac_dot(oracle);
    KDL::ChainDynParam dynamics(oracle, KDL::Vector(kGravity[0], kGravity[1], kGravity[2]));
    KDL::ChainIdSolver_RNE inverse(oracle, KDL::Vector(kGravity[0], kGravity[1], kGravity[2]));
    for (int k = 0; k < 100; ++k) {
      const auto [q, qd, qdd] = state_of(arm.size(), random);
      const auto n = static_cast<unsigned>(arm.size());
      KDL::Frame frame;
      ASSERT_GE(position.JntToCart(kdl(q), frame), 0);
      const Transform<double> tip = forward_kinematics(arm, q);
      for (int r = 0; r < 3; ++r) {
        EXPECT_NEAR(tip.p[r], frame.p[r], 1e-14);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(tip.R(r, c), frame.M(r, c), 1e-14);
      }
      KDL::Jacobian J(n), J_dot(n);
      ASSERT_GE(jac.JntToJac(kdl(q), J), 0);
      expect_near(jacobian(arm, q), J.data, "Jacobian");
      ASSERT_GE(jac_dot.JntToJacDot(KDL::JntArrayVel(kdl(q), kdl(qd)), J_dot), 0);
      const auto moving = tip_motion(arm, q, qd, qdd);
      const Eigen::VectorXd twist = J.data * qd, rate = J.data * qdd + J_dot.data * qd;
      expect_near(moving.velocity, twist.head<3>(), "velocity");
      expect_near(moving.omega, twist.tail<3>(), "angular velocity");
      expect_near(moving.acceleration, rate.head<3>(), "acceleration");
      expect_near(moving.alpha, rate.tail<3>(), "angular acceleration");

      KDL::JntSpaceInertiaMatrix M(n);
      KDL::JntArray c(n), g(n), tau(n);
      ASSERT_GE(dynamics.JntToMass(kdl(q), M), 0);
      ASSERT_GE(dynamics.JntToCoriolis(kdl(q), kdl(qd), c), 0);
      ASSERT_GE(dynamics.JntToGravity(kdl(q), g), 0);
      ASSERT_GE(inverse.CartToJnt(kdl(q), kdl(qd), kdl(qdd), KDL::Wrenches(n + 1), tau), 0);
      expect_near(mass_matrix(arm, q), M.data, "mass matrix");
      expect_near(coriolis_torque(arm, q, qd), c.data, "Coriolis");
      expect_near(gravity_torque(arm, q), g.data, "gravity");
      expect_near(inverse_dynamics(arm, q, qd, qdd), tau.data, "inverse dynamics");
    }
  }
}

TEST(Chain, ForwardUndoesInverseDynamics) {
  std::mt19937_64 random(2);
  for (const Chain& arm : arms())
    for (int k = 0; k < 50; ++k) {
      const auto [q, qd, qdd] = state_of(arm.size(), random);
      const Joints tau = inverse_dynamics(arm, q, qd, qdd), back = forward_dynamics(arm, q, qd, tau);
      // The wrist's inertia is some 1e-3 of the shoulder's.
      EXPECT_LE((back - qdd).norm(), 1e-10 * qdd.norm());
    }
}

/// q + q̇ ε: derivatives along the motion.
JointVector<Dual> along(const Joints& value, const Joints& rate) {
  JointVector<Dual> out(value.size());
  for (int i = 0; i < value.size(); ++i) {
    out[i] = Dual(value[i]);
    out[i].v[0] = rate[i];
  }
  return out;
}

TEST(Chain, JacobianIsTheDerivativeOfThePosition) {
  std::mt19937_64 random(3);
  for (const Chain& arm : arms()) {
    const auto [q, qd, qdd] = state_of(arm.size(), random);
    JointVector<dynamics::DualOf<3>> seeded(arm.size());  // another scalar than the two compiled ones
    for (int first = 0; first < arm.size(); first += 3) {
      for (int i = 0; i < arm.size(); ++i) {
        seeded[i] = dynamics::DualOf<3>(q[i]);
        if (i >= first && i < first + 3) seeded[i].v[i - first] = 1;
      }
      const auto tip = forward_kinematics(arm, seeded);
      const auto J = jacobian(arm, q);
      for (int i = first; i < std::min(first + 3, arm.size()); ++i)
        for (int r = 0; r < 3; ++r) EXPECT_NEAR(J(r, i), tip.p[r].v[i - first], 1e-14);
    }
  }
}

TEST(Chain, MassRateMinusTwiceCoriolisIsSkew) {
  std::mt19937_64 random(5);
  for (const Chain& arm : arms())
    for (int k = 0; k < 20; ++k) {
      const auto [q, qd, qdd] = state_of(arm.size(), random);
      const auto M = mass_matrix(arm, along(q, qd));
      const JointMatrix<double> C = coriolis_matrix(arm, q, qd);
      Eigen::MatrixXd N(arm.size(), arm.size());
      for (int i = 0; i < arm.size(); ++i)
        for (int j = 0; j < arm.size(); ++j) N(i, j) = M(i, j).v[0] - 2 * C(i, j);
      expect_near(N + N.transpose(), Eigen::MatrixXd::Zero(arm.size(), arm.size()), "skew");
      expect_near(C * qd, coriolis_torque(arm, q, qd), "C q̇");
    }
}

TEST(Chain, PowerOfTheTorquesIsTheRateOfEnergy) {
  std::mt19937_64 random(6);
  for (const Chain& arm : arms())
    for (int k = 0; k < 20; ++k) {
      const auto [q, qd, qdd] = state_of(arm.size(), random);
      const auto energy = energy_of(arm, along(q, qd), along(qd, qdd));
      const double power = inverse_dynamics(arm, q, qd, qdd).dot(qd);
      EXPECT_NEAR(energy.kinetic.v[0] + energy.potential.v[0], power, 1e-11 * (1 + std::abs(power)));
      const Joints M_qd = mass_matrix(arm, q) * qd;
      EXPECT_NEAR(energy.kinetic.a, 0.5 * qd.dot(M_qd), 1e-12 * (1 + energy.kinetic.a));
    }
}

TEST(Chain, APayloadPullsThroughItsJacobian) {
  std::mt19937_64 random(7);
  const Chain bare = panda(), loaded = with_payload(bare, odd_payload());
  const Inertia body = odd_payload();
  Chain to_com = with_tool(bare, {Eigen::Matrix3d::Identity(), body.com});
  const auto [q, qd, qdd] = state_of(7, random);
  const Eigen::VectorXd pull = jacobian(to_com, q).topRows<3>().transpose() * (-body.mass * kGravity);
  expect_near(gravity_torque(loaded, q) - gravity_torque(bare, q), pull, "payload");
  // Nothing else moves: the load's kinetic energy is what is added.
  const auto m = tip_motion(to_com, q, qd, qdd);
  const Eigen::Vector3d own = m.frame.R.transpose() * m.omega;
  EXPECT_NEAR(energy_of(loaded, q, qd).kinetic - energy_of(bare, q, qd).kinetic,
              0.5 * body.mass * m.velocity.squaredNorm() + 0.5 * own.dot(body.about_com * own), 1e-12);
}

TEST(Panda, StandsAsPublished) {
  const Chain arm = panda();
  // All joints at zero: upright, the elbow's 0.0825 m cancels, the flange points down 0.088 m ahead.
  const auto tip = forward_kinematics<double>(arm, Joints::Zero(7));
  expect_near(tip.p, Eigen::Vector3d(0.088, 0, 0.333 + 0.316 + 0.384 - 0.107), "flange");
  expect_near(tip.R, Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix(), "its axes");
  // The usual ready pose, q = (0, −π/4, 0, −3π/4, 0, π/2, π/4), by the planar geometry of joints 2, 4 and 6.
  constexpr double pi = std::numbers::pi, half = std::numbers::sqrt2 / 2;
  const Joints ready{{0, -pi / 4, 0, -3 * pi / 4, 0, pi / 2, pi / 4}};
  const auto at = forward_kinematics(arm, ready);
  const double x = half * (-0.316 + 0.0825),
               z = 0.333 + half * (0.316 + 0.0825);  // up to the elbow, 45° back
  // The forearm points to +x: 0.384 m ahead, 0.0825 m up from it; then 0.088 m ahead and 0.107 m down.
  expect_near(at.p, Eigen::Vector3d(x + 0.384 + 0.088, 0, z + 0.0825 - 0.107), "ready pose");
  for (const Joint& joint : arm.joints) EXPECT_TRUE(is_feasible(joint.link)) << joint.name;
}

TEST(Panda, FrictionTakesEnergy) {
  const Chain arm = panda();
  for (const double rate : {-2.0, -0.1, -1e-3, 1e-3, 0.1, 2.0}) {
    const Joints tau = friction_torque<double>(arm, Joints::Constant(7, rate));
    for (int i = 0; i < 7; ++i) EXPECT_GT(tau[i] * rate, 0) << i;
  }
  EXPECT_EQ(friction_torque<double>(arm, Joints::Zero(7)).norm(), 0);
}

TEST(Chain, RefusesWhatIsNoArm) {
  const auto refused = [](Chain arm, const char* why) {
    EXPECT_THAT([&] { validate(arm); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr(why)));
  };
  Chain arm = panda();
  arm.joints[2].limits.velocity = 0;
  refused(arm, "joint 'panda_joint3': velocity limit 0 is not > 0");
  arm = panda();
  arm.joints[3].limits.upper = -4;
  refused(arm, "limits [-3.0718, -4] rad are empty");
  arm = panda();
  arm.joints[6].link.about_com(0, 0) = 0.1;  // a plate thinner than nothing
  refused(arm, "joint 'panda_joint7': no body of 0.735522 kg can have its inertia");
  arm = panda();
  arm.joints[1].origin.R(0, 0) = -1;
  refused(arm, "joint 'panda_joint2': its origin is no frame");
  arm.joints.clear();
  refused(arm, "has 0 joints; accepted: 1 to 8");
  EXPECT_THROW(with_payload(panda(), {}), std::invalid_argument);
}

TEST(Chain, RefusesVectorsOfAnotherSize) {
  const Chain arm = panda();
  const Joints all = Joints::Zero(7), three = Joints::Zero(3), none(0);
  EXPECT_THROW(forward_kinematics(arm, three), std::invalid_argument);
  EXPECT_THROW(jacobian(arm, none), std::invalid_argument);
  EXPECT_THROW(tip_motion(arm, all, all, three), std::invalid_argument);
  EXPECT_THROW(mass_matrix(arm, none), std::invalid_argument);
  EXPECT_THROW(inverse_dynamics(arm, all, three, all), std::invalid_argument);
  EXPECT_THROW(forward_dynamics(arm, all, three, all), std::invalid_argument);
  EXPECT_THROW(friction_torque(arm, three), std::invalid_argument);
  EXPECT_THROW(energy_of(arm, all, three), std::invalid_argument);
}

// Of a gripper's block at some depth below the flange: its weight, and its inertia about an axis across it.
TEST(Chain, AGripperIsABlockAsLongAsItself) {
  const double length = 0.2, mass = 0.8, width = 0.1;
  const Chain bare = panda(), arm = with_gripper(bare, length, mass), light = with_gripper(bare, length, 0);
  std::mt19937_64 random(3);
  for (int k = 0; k < 20; ++k) {
    const RandomState s = state_of(7, random);
    const Transform<double> flange = forward_kinematics(bare, s.q);
    expect_near(forward_kinematics(arm, s.q).p, flange.p + length * flange.R.col(2), "pads");
    const Eigen::Vector3d middle = flange.p + 0.5 * length * flange.R.col(2);
    const auto without = energy_of<double>(light, s.q, s.qd), with = energy_of<double>(arm, s.q, s.qd);
    EXPECT_NEAR(with.potential - without.potential, mass * 9.81 * middle.z(),
                1e-12 * std::abs(with.potential));
    const auto tip = tip_motion<double>(with_tool(bare, {Eigen::Matrix3d::Identity(), {0, 0, length / 2}}),
                                        s.q, s.qd, Joints::Zero(7));
    const double along = tip.omega.dot(flange.R.col(2)), across = tip.omega.squaredNorm() - along * along,
                 turning = 0.5 * mass * (length * length + width * width) / 12 * across;
    // What it has about its own axis is of the order of its width squared.
    EXPECT_NEAR(with.kinetic - without.kinetic, 0.5 * mass * tip.velocity.squaredNorm() + turning,
                0.5 * mass * width * width / 3 * along * along + 1e-12 * with.kinetic);
  }
}

}  // namespace
}  // namespace unhand::planners
