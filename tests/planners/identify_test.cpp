// Identification: what is put into a simulated log comes back within its intervals, as bodies can have it.
#include "planners/elastic/identify.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <random>

#include "planners/arm/chain_file.hpp"

namespace unhand::planners::elastic {
namespace {

Chain arm() { return read_toml_chain(std::filesystem::path(UNHAND_ELASTIC_ARMS) / "bsa3_chain.toml"); }

/// Noise on the torques of three joints.
struct TorqueNoise {
  const char* name;
  std::array<double, 3> sigma;  ///< N m
  double stays;                 ///< from one sample to the next, AR(1)
};
class Identify : public testing::TestWithParam<TorqueNoise> {};
INSTANTIATE_TEST_SUITE_P(, Identify,
                         testing::Values(TorqueNoise{"Equal", {0.05, 0.05, 0.05}, 0},
                                         TorqueNoise{"ByJoint", {0.2, 0.05, 0.01}, 0},
                                         TorqueNoise{"Filtered", {0.05, 0.05, 0.05}, 0.8}),
                         [](const auto& one) { return one.param.name; });

TEST_P(Identify, InertiaComesBackWithinItsIntervals) {
  const Chain prior = arm();
  ExcitationOptions design;
  design.trials = 100;
  const DesignedExcitation excitation = design_excitation(prior, design);
  EXPECT_LT(excitation.condition, 0.7 * excitation.first_condition);
  Chain truth = prior;  // other masses and centres than the drawing says
  for (int i = 0; i < 3; ++i) {
    truth.joints[i].link.mass *= 1.1 + 0.1 * i;
    truth.joints[i].link.com[0] *= 0.9;
    truth.joints[i].link.com[1] += 0.01;
  }
  const Eigen::VectorXd parameters = control::parameters_of(truth);
  int inside = 0, all = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::vector<MotionSample> log;
    std::array<double, 3> noise{};
    for (int k = 0; k < 400; ++k) {
      MotionSample s{JointVector<double>(3), JointVector<double>(3), JointVector<double>(3),
                     JointVector<double>(3)};
      excitation.motion.at(excitation.motion.period * k / 400, s.q, s.qd, s.qdd);
      for (int i = 0; i < 3; ++i) {
        EXPECT_LE(std::abs(s.qd[i]), prior.joints[i].limits.velocity);
        EXPECT_GE(s.q[i], prior.joints[i].limits.lower);
        EXPECT_LE(s.q[i], prior.joints[i].limits.upper);
      }
      s.torque = inverse_dynamics<double>(truth, s.q, s.qd, s.qdd);
      for (int i = 0; i < 3; ++i) {
        const auto joint = static_cast<std::size_t>(i);
        noise[joint] = GetParam().stays * noise[joint] + std::sqrt(1 - GetParam().stays * GetParam().stays) *
                                                             GetParam().sigma[joint] * normal(random);
        s.torque[i] += noise[joint];
      }
      log.push_back(s);
    }
    const IdentifiedInertia found = identify_inertia(prior, log);
    const auto& sigma = GetParam().sigma;
    const double rms = std::sqrt((sigma[0] * sigma[0] + sigma[1] * sigma[1] + sigma[2] * sigma[2]) / 3);
    EXPECT_NEAR(found.torque_noise, rms, 0.25 * rms);  // of 1200 residuals; less where they stay
    const Eigen::VectorXd miss =
        (found.combinations.transpose() * parameters - found.estimate).cwiseQuotient(found.sigma).cwiseAbs();
    for (const double one : miss) inside += one < 1.96, ++all;
    for (const Joint& joint : found.feasible.joints) EXPECT_TRUE(is_feasible(joint.link)) << joint.name;
    EXPECT_LT(found.feasible_misfit, 3);
    if (seed > 1) continue;
    // The bodies found move as the true ones do, elsewhere too.
    const JointVector<double> q{{1, 0.5, -0.7}}, qd{{2, -1, 3}}, qdd{{5, -3, 10}};
    const Eigen::VectorXd a = inverse_dynamics<double>(found.feasible, q, qd, qdd),
                          b = inverse_dynamics<double>(truth, q, qd, qdd);
    EXPECT_LT((a - b).norm(), 0.03 * b.norm());
  }
  // 95 % of some 160 intervals, three of the binomial's sigmas; some more where the correlation is estimated.
  EXPECT_NEAR(static_cast<double>(inside) / all, 0.95,
              3 * std::sqrt(0.95 * 0.05 / all) + (GetParam().stays > 0 ? 0.03 : 0));
}

/// Of so many samples, torques of joints whose noises stay from one to the next, each as it does: the errors
/// of the combinations found in their sigmas, their mean square over logs, and that of what bodies miss them
/// by.
double squared_errors(int samples, const std::array<double, 3>& sigma, const std::array<double, 3>& stays,
                      int logs) {
  const Chain truth = arm();
  ExcitationOptions design;
  design.trials = 20;
  const DesignedExcitation excitation = design_excitation(truth, design);
  const Eigen::VectorXd parameters = control::parameters_of(truth);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  double squares = 0, all = 0;
  for (int n = 0; n < logs; ++n) {
    std::vector<MotionSample> log;
    JointVector<double> noise(3);
    for (int k = 0; k < samples; ++k) {
      MotionSample s{JointVector<double>(3), JointVector<double>(3), JointVector<double>(3),
                     JointVector<double>(3)};
      excitation.motion.at(excitation.motion.period * k / samples, s.q, s.qd, s.qdd);
      for (int i = 0; i < 3; ++i) {
        const auto j = static_cast<std::size_t>(i);
        const double anew = sigma[j] * normal(random);
        noise[i] = k == 0 ? anew : stays[j] * noise[i] + std::sqrt(1 - stays[j] * stays[j]) * anew;
      }
      s.torque = inverse_dynamics<double>(truth, s.q, s.qd, s.qdd) + noise;
      log.push_back(s);
    }
    const IdentifiedInertia found = identify_inertia(truth, log);
    squares += (found.combinations.transpose() * parameters - found.estimate)
                   .cwiseQuotient(found.sigma)
                   .squaredNorm();
    all += static_cast<double>(found.estimate.size());
    const double beside =
        std::sqrt((found.combinations.transpose() * control::parameters_of(found.feasible) - found.estimate)
                      .cwiseQuotient(found.sigma)
                      .squaredNorm() /
                  static_cast<double>(found.estimate.size()));
    EXPECT_NEAR(found.feasible_misfit, beside, 1e-6 + 1e-3 * beside) << "in sigmas, of all combinations";
  }
  return squares / all;
}

// Errors are as large as their sigmas say where joints differ in how long their noise stays, and in short
// logs.
TEST(IdentifyInertia, SigmasHoldWhereNoiseStays) {
  EXPECT_NEAR(squared_errors(200, {0.05, 0.05, 0.05}, {0, 0.6, 0.95}, 40), 0.9, 0.4);
  EXPECT_NEAR(squared_errors(30, {0.05, 0.05, 0.05}, {0.7, 0.7, 0.7}, 120), 1.2, 0.5);
}

TEST(IdentifyInertia, RefusesSamplesOfAnotherArm) {
  const Chain prior = arm();
  const JointVector<double> all = JointVector<double>::Zero(3), two = JointVector<double>::Zero(2);
  std::vector<MotionSample> log(20, MotionSample{all, all, all, all});
  log[3].torque = two;
  EXPECT_THROW(identify_inertia(prior, log), std::invalid_argument);
  log[3] = {all, two, all, all};
  EXPECT_THROW(identify_inertia(prior, log), std::invalid_argument);
  log[3] = {all, all, all, JointVector<double>::Constant(3, NAN)};
  EXPECT_THROW(identify_inertia(prior, log), std::invalid_argument);
  for (const double period : {0.0, static_cast<double>(NAN), static_cast<double>(INFINITY)})
    EXPECT_THROW(design_excitation(prior, {.period = period}), std::invalid_argument) << period;
}

TEST(IdentifySpring, ComesBackWithinItsIntervals) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<SpringSample> log;
  for (int k = 0; k < 500; ++k) {  // the motor swings against the held link
    const double t = 0.004 * k, w = 6;
    SpringSample s{0.3 * std::sin(w * t), 0.3 * w * std::cos(w * t), -0.3 * w * w * std::sin(w * t), 0};
    s.deflection += 0.1 * std::sin(2.7 * t);
    s.rate += 0.27 * std::cos(2.7 * t);
    s.acceleration -= 0.729 * std::sin(2.7 * t);
    s.torque = 8.0 * s.deflection + 0.02 * s.rate + 0.05 * s.acceleration + 0.02 * normal(random);
    log.push_back(s);
  }
  const IdentifiedSpring found = identify_spring(log);
  EXPECT_NEAR(found.stiffness, 8.0, 3 * found.stiffness_sigma);
  EXPECT_NEAR(found.damping, 0.02, 3 * found.damping_sigma);
  EXPECT_NEAR(found.inertia, 0.05, 3 * found.inertia_sigma);
  EXPECT_LT(found.stiffness_sigma, 0.05);
  EXPECT_THROW(identify_spring({}), std::invalid_argument);
  log[7].torque = NAN;
  EXPECT_THROW(identify_spring(log), std::invalid_argument);
}

// A swing at one frequency shows K − B ω² and D, and neither K nor B.
TEST(IdentifySpring, IsNotToldByASwingAtOneFrequency) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (const double noise : {0.0, 1e-3, 0.02}) {
    std::vector<SpringSample> log;
    for (int k = 0; k < 500; ++k) {
      const double t = 0.004 * k, w = 6;
      SpringSample s{0.3 * std::sin(w * t), 0.3 * w * std::cos(w * t), -0.3 * w * w * std::sin(w * t), 0};
      s.torque = 8.0 * s.deflection + 0.02 * s.rate + 0.05 * s.acceleration + noise * normal(random);
      log.push_back(s);
    }
    EXPECT_THROW(identify_spring(log), std::invalid_argument) << noise;
  }
}

// Between the samples that the condition number looks at, too.
TEST(Excitation, KeepsTheLimitsEverywhere) {
  const Chain chain = arm();
  for (const auto& [harmonics, samples] : {std::pair(3, 10), std::pair(15, 60), std::pair(29, 60)}) {
    const auto found = design_excitation(chain, {.harmonics = harmonics, .samples = samples, .trials = 5});
    JointVector<double> q(3), qd(3), qdd(3);
    for (int k = 0; k < 5000; ++k) {
      found.motion.at(found.motion.period * k / 5000, q, qd, qdd);
      for (int i = 0; i < 3; ++i) {
        const JointLimits& l = chain.joints[static_cast<std::size_t>(i)].limits;
        EXPECT_LE(std::abs(qd[i]), l.velocity) << harmonics;
        EXPECT_TRUE(q[i] >= l.lower && q[i] <= l.upper) << harmonics << " " << q[i];
      }
    }
  }
}

// Over many logs the errors are as large as their sigmas say, of all three.
TEST(IdentifySpring, ItsSigmasAreThoseOfItsErrors) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  constexpr int kLogs = 800, kSamples = 14;
  std::array<double, 3> squares{};
  for (int one = 0; one < kLogs; ++one) {
    std::vector<SpringSample> log;
    for (int k = 0; k < kSamples; ++k) {  // whatever deflection, rate and acceleration
      SpringSample s{0.2 * normal(random), 2 * normal(random), 5 * normal(random), 0};
      s.torque = 8.0 * s.deflection + 0.02 * s.rate + 0.05 * s.acceleration + 0.02 * normal(random);
      log.push_back(s);
    }
    const IdentifiedSpring found = identify_spring(log);
    squares[0] += std::pow((found.stiffness - 8.0) / found.stiffness_sigma, 2) / kLogs;
    squares[1] += std::pow((found.damping - 0.02) / found.damping_sigma, 2) / kLogs;
    squares[2] += std::pow((found.inertia - 0.05) / found.inertia_sigma, 2) / kLogs;
  }
  // Student's t of 11 degrees of freedom has the variance 11/9, of which 800 scatter by some 7 %.
  for (const double square : squares) EXPECT_NEAR(square, 11.0 / 9, 0.25);
}

}  // namespace
}  // namespace unhand::planners::elastic
