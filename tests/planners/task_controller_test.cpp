// Computed torque in the joints and in the task, adaptive and plain: perfect models track, adaptation learns
// the load, V ends below its start.
#include "planners/control/task_controller.hpp"

#include <gtest/gtest.h>

#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "planners/arm/panda.hpp"
#include "planners/control/throw_study.hpp"

namespace unhand::planners::control {
namespace {

TEST(MinimumJerk, MeetsItsEndsAndIsItsOwnDerivative) {
  const MinimumJerk course{{0.1, 0.2, 0.3}, {0.1, 0, -0.2}, {0.5, -0.1, 0.6}, {1, 0.5, 0.7}, 0.8};
  const Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  EXPECT_LE((course.at(0, R).position - course.from).norm(), 1e-15);
  EXPECT_LE((course.at(0.8, R).position - course.to).norm(), 1e-14);
  EXPECT_LE((course.at(0.8, R).velocity - course.to_velocity).norm(), 1e-13);
  EXPECT_LE(course.at(0, R).acceleration.norm() + course.at(0.8, R).acceleration.norm(), 1e-12);
  double best_velocity = 1, best_acceleration = 1;
  for (double h = 1e-1; h > 1e-7; h /= 10) {  // central differences
    const TaskReference a = course.at(0.4 + h, R), b = course.at(0.4 - h, R), m = course.at(0.4, R);
    best_velocity = std::min(best_velocity, ((a.position - b.position) / (2 * h) - m.velocity).norm());
    best_acceleration =
        std::min(best_acceleration, ((a.velocity - b.velocity) / (2 * h) - m.acceleration).norm());
  }
  EXPECT_LT(best_velocity, 1e-9);  // h² against rounding/h
  EXPECT_LT(best_acceleration, 1e-8);
}

/// A Panda with an unknown load, somewhere on its way along a reference.
struct OnItsWay {
  Chain known = panda(), truth;
  LinkParameters load;
  JointGains gains{JointVector<double>(7), JointVector<double>(7)};
  JointReference reference{JointVector<double>(7), JointVector<double>(7), JointVector<double>(7)};
  JointVector<double> q = JointVector<double>(7), qd = q;

  explicit OnItsWay(std::mt19937_64& random) {
    truth = with_payload(known, {0.9, {0.03, -0.02, 0.09}, symmetric(2e-3, 3e-3, 2.5e-3, 0, 0, 0)});
    load = parameters_of(truth.joints.back().link) - parameters_of(known.joints.back().link);
    std::uniform_real_distribution<double> one(-1, 1);
    for (int i = 0; i < 7; ++i) {
      q[i] = 2 * one(random), qd[i] = 2 * one(random);
      reference.q[i] = q[i] + 0.2 * one(random), reference.qd[i] = qd[i] + 0.3 * one(random);
      reference.qdd[i] = 5 * one(random);
      gains.stiffness[i] = 20 + 10 * one(random), gains.damping[i] = 5 + 2 * one(random);
    }
  }
  JointVector<double> acceleration(const ControlStep& step) const {
    return forward_dynamics<double>(truth, q, qd, step.torque - friction_torque<double>(truth, qd));
  }
};

// M ë + k_v ė + k_p e = Y(q, q̇, q̈_d) (π − π̂): Y times the load is what it adds to the inverse dynamics.
TEST(JointLaw, LeavesASpringADamperAndTheUnknownLoad) {
  std::mt19937_64 random(1);
  for (int k = 0; k < 50; ++k) {
    const OnItsWay at(random);
    const auto& r = at.reference;
    const JointVector<double> lacks = inverse_dynamics<double>(at.truth, at.q, at.qd, r.qdd) -
                                      inverse_dynamics<double>(at.known, at.q, at.qd, r.qdd);
    for (const double learnt : {0.0, 0.4, 1.0}) {
      AdaptiveController controller(at.known, {});
      controller.estimate = learnt * at.load;
      const ControlStep step = controller.joint_law(r, at.gains, at.q, at.qd);
      const JointVector<double> left = mass_matrix<double>(at.truth, at.q) * (r.qdd - at.acceleration(step)) +
                                       at.gains.damping.cwiseProduct(r.qd - at.qd) +
                                       at.gains.stiffness.cwiseProduct(r.q - at.q);
      EXPECT_LE((left - (1 - learnt) * lacks).norm(), 1e-9) << k << ' ' << learnt;  // solves of 100 N m
    }
  }
}

// A law that was asked in between, for another state, changes nothing of what a step teaches.
TEST(JointLaw, TeachesByTheStepThatIsGiven) {
  std::mt19937_64 random(7);
  const OnItsWay at(random), elsewhere(random);
  AdaptiveController alone(at.known, StudyOptions::default_adaptation()), asked = alone;
  const ControlStep step = alone.joint_law(at.reference, at.gains, at.q, at.qd);
  asked.joint_law(elsewhere.reference, elsewhere.gains, elsewhere.q, elsewhere.qd);
  alone.adapt(step, step.torque, at.q, at.qd, 1e-3);
  asked.adapt(step, step.torque, at.q, at.qd, 1e-3);
  EXPECT_EQ(asked.estimate, alone.estimate);
  EXPECT_GT(alone.estimate.norm(), 0);
  ControlStep of_no_law;
  of_no_law.velocity_error = step.velocity_error;
  EXPECT_THROW(alone.adapt(of_no_law, step.torque, at.q, at.qd, 1e-3), std::invalid_argument);
}

// A load that is known exactly stays known, to the second order of the step: the torque is held between
// steps, and the momentum that it makes is not. (A filter of the first order learned 16 g of arm as load.)
TEST(Prediction, TeachesNothingWhereNothingIsUnknown) {
  std::mt19937_64 random(4);
  const OnItsWay start(random);
  Adaptation adaptation = StudyOptions::default_adaptation();
  adaptation.filter = 200;
  const auto learned = [&](double dt) {  // [kg], at most, over a second
    OnItsWay at = start;
    AdaptiveController controller(at.known, adaptation);
    controller.estimate = at.load;
    double most = 0;
    for (double t = 0; t < 1; t += dt) {
      JointReference r = at.reference;  // sways about where it starts
      for (int i = 0; i < 7; ++i) {
        const double w = 3 + 0.5 * i, a = 0.5, s = std::sin(w * t), c = std::cos(w * t);
        r.q[i] = start.q[i] + a * s * s * s, r.qd[i] = 3 * a * w * s * s * c;
        r.qdd[i] = 3 * a * w * w * s * (2 * c * c - s * s);
      }
      if (t == 0) at.qd = r.qd;  // from rest, where the filters begin
      ControlStep step = controller.joint_law(r, at.gains, at.q, at.qd);
      step.velocity_error.setZero();  // teaches by the prediction alone
      controller.adapt(step, step.torque, at.q, at.qd, dt);
      most = std::max(most, std::abs(controller.estimate[0] - at.load[0]));
      constexpr int kSubsteps = 4;  // Heun's
      for (int k = 0; k < kSubsteps; ++k) {
        const double h = dt / kSubsteps;
        OnItsWay next = at;
        const JointVector<double> a = at.acceleration(step);
        next.q = at.q + h * at.qd, next.qd = at.qd + h * a;
        const JointVector<double> b = next.acceleration(step);
        at.q += 0.5 * h * (at.qd + next.qd), at.qd += 0.5 * h * (a + b);
      }
    }
    return most;
  };
  const double coarse = learned(2e-3), fine = learned(1e-3);
  EXPECT_LT(fine, 0.02);
  EXPECT_GT(coarse / fine, 3);  // 4 of the second order, 2 of the first
}

// With the update, V' = −ėᵀ k_v ė + ½ ėᵀ Ṁ ė, whatever is not known of the load.
TEST(JointLaw, LyapunovFunctionFallsByTheDampingButForTheMassThatChanges) {
  std::mt19937_64 random(2);
  Adaptation adaptation = StudyOptions::default_adaptation();
  adaptation.prediction = 0;
  for (int k = 0; k < 20; ++k) {
    const OnItsWay at(random);
    AdaptiveController controller(at.known, adaptation);
    controller.estimate = 0.3 * at.load;
    const ControlStep step = controller.joint_law(at.reference, at.gains, at.q, at.qd);
    AdaptiveController later = controller;
    later.adapt(step, step.torque, at.q, at.qd, 1);  // Euler's rule over 1 s: the rate
    const LinkParameters learns = later.estimate - controller.estimate;
    const JointVector<double> qdd = at.acceleration(step);
    const auto V = [&](double t) {
      ControlStep then = step;
      then.velocity_error = at.reference.qd + t * at.reference.qdd - at.qd - t * qdd;
      const JointVector<double> q = at.q + t * at.qd + 0.5 * t * t * qdd;
      const JointVector<double> off =
          at.reference.q + t * at.reference.qd + 0.5 * t * t * at.reference.qdd - q;
      return lyapunov(at.truth, at.gains, adaptation, then, q, off,
                      at.load - controller.estimate - t * learns);
    };
    const JointVector<double> s = step.velocity_error;
    double best = 1;
    for (double h = 1e-1; h > 1e-7; h /= 10) {  // central differences: h² against rounding/h
      const JointMatrix<double> M_rate = (mass_matrix<double>(at.truth, at.q + h * at.qd) -
                                          mass_matrix<double>(at.truth, at.q - h * at.qd)) /
                                         (2 * h);
      const double due = -s.dot(at.gains.damping.cwiseProduct(s)) + 0.5 * s.dot(M_rate * s);
      best = std::min(best, std::abs((V(h) - V(-h)) / (2 * h) - due));
    }
    EXPECT_LE(best, 1e-7) << k;  // of some W
  }
}

// Eq. 35 with the true parameters: M (α − q̈) + C s + k_v s + Jᵀ k_ξ e_ξ = 0, and Y_r times what is not known
// of the load else. α and β are formed here from differences of the Jacobian and its pseudo-inverse.
TEST(TaskLaw, LeavesASpringADamperAndTheUnknownLoad) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> one(-1, 1);
  for (int k = 0; k < 50; ++k) {
    const OnItsWay at(random);
    const auto tip = forward_kinematics<double>(at.known, at.q);
    const Eigen::Vector3d off = 0.02 * Eigen::Vector3d(one(random), one(random), one(random)),
                          turned = 0.2 * Eigen::Vector3d(one(random), one(random), one(random)),
                          velocity(one(random), one(random), one(random)),
                          acceleration = 3 * Eigen::Vector3d(one(random), one(random), one(random));
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(turned.norm(), turned.normalized()).toRotationMatrix();
    TaskGains gains;
    gains.stiffness = 40, gains.rotational = 8, gains.damping = at.gains.damping;
    gains.rest = at.q + 0.3 * JointVector<double>::Random(7);

    using Matrix = Eigen::MatrixXd;
    const auto J_at = [&](const JointVector<double>& q) { return Matrix(jacobian<double>(at.known, q)); };
    const double h = 1e-6;
    const Matrix J = J_at(at.q), J_rate = (J_at(at.q + h * at.qd) - J_at(at.q - h * at.qd)) / (2 * h),
                 inverse = J.completeOrthogonalDecomposition().pseudoInverse(),
                 null = Matrix::Identity(7, 7) - inverse * J;
    Eigen::VectorXd rate(6), wanted(6), pull(6);
    rate << velocity, Eigen::Vector3d::Zero();
    wanted << acceleration, Eigen::Vector3d::Zero();
    pull << gains.stiffness * off, gains.rotational * turned;
    const Eigen::VectorXd beta = inverse * rate + gains.posture * null * (gains.rest - at.q),
                          alpha = inverse * (wanted - J_rate * at.qd) - gains.posture * null * at.qd;
    const JointVector<double> s = beta - at.qd;
    const Matrix C = coriolis_matrix<double>(at.truth, at.q, at.qd),
                 C_known = coriolis_matrix<double>(at.known, at.q, at.qd),
                 M = mass_matrix<double>(at.truth, at.q), M_known = mass_matrix<double>(at.known, at.q);
    const Eigen::VectorXd lacks = (M - M_known) * alpha + (C - C_known) * beta +
                                  gravity_torque<double>(at.truth, at.q) -
                                  gravity_torque<double>(at.known, at.q);
    for (const double learnt : {0.0, 0.4, 1.0}) {
      AdaptiveController controller(at.known, {});
      controller.estimate = learnt * at.load;
      const ControlStep step =
          controller.task_law({tip.p + off, velocity, acceleration, turn * tip.R}, gains, at.q, at.qd);
      EXPECT_LE((step.velocity_error - s).norm(), 1e-8) << k;
      const Eigen::VectorXd left =
          M * (alpha - at.acceleration(step)) + C * s + gains.damping.cwiseProduct(s) + J.transpose() * pull;
      // Differences of the Jacobian near singular poses
      EXPECT_LE((left - (1 - learnt) * lacks).norm(), 1e-6 * (1 + alpha.norm())) << k << ' ' << learnt;
    }
  }
}

/// A robot without noise, whose friction is the model's.
StudyOptions ideal() {
  StudyOptions o;
  o.angle_noise = o.rate_noise = o.torque_noise = o.friction_error = o.release_jitter = o.grasp_offset = 0;
  return o;
}

TEST(ThrowStudy, WithoutAnUnknownLoadEvenLowGainsTrack) {
  const Payload feather{"feather", 1e-6, 0.05};
  StudyOptions once = ideal();
  once.repetitions = 0;
  const StudyThrow run = run_throw({"plain", 30, 10, false}, feather, once, 1);
  ASSERT_TRUE(run.lands);
  // What is left is the zero-order hold of 1 ms: half of it, at 1.3 m/s and 10 m/s².
  EXPECT_LT(run.release_position_error, 1e-3);
  EXPECT_LT(run.release_velocity_error, 2e-2);
}

TEST(ThrowStudy, AdaptationLearnsTheLoadAndTracksFiveTimesBetter) {
  for (const Payload& payload : reported_payloads()) {
    const StudyThrow adaptive = run_throw({"adaptive", 30, 10, true}, payload, ideal(), 1, true);
    StudyOptions once = ideal();
    once.repetitions = 0;  // nothing is learned from more
    const StudyThrow plain = run_throw({"plain", 30, 10, false}, payload, once, 1);
    EXPECT_NEAR(adaptive.estimate[0], payload.mass, 0.15 * payload.mass) << payload.name;
    EXPECT_LT(adaptive.rms_error.back(), 0.2 * plain.rms_error.back()) << payload.name;
    // V after the repetitions is below V at their start; within a period the printed α is not the rate of β,
    // and V may rise.
    EXPECT_LT(adaptive.history.back().lyapunov, adaptive.history.front().lyapunov) << payload.name;
    EXPECT_LT(adaptive.use.torque, 1);
  }
}

TEST(ThrowStudy, TheLawInTheJointsLearnsTheLoadToo) {
  const Payload tube = reported_payloads().back();
  const StudyThrow adaptive = run_throw(joint_controller(), tube, ideal(), 1, true);
  StudyOptions once = ideal();
  once.repetitions = 0;
  ControllerChoice plain = joint_controller();
  plain.adaptive = false;
  EXPECT_NEAR(adaptive.estimate[0], tube.mass, 0.15 * tube.mass);
  EXPECT_LT(adaptive.rms_error.back(), 0.2 * run_throw(plain, tube, once, 1).rms_error.back());
  EXPECT_LT(adaptive.history.back().lyapunov, adaptive.history.front().lyapunov);
  // Without a load it follows the same course: what is left is the zero-order hold of 1 ms.
  const StudyThrow free = run_throw(plain, {"feather", 1e-6, 0.05}, once, 1);
  EXPECT_LT(free.release_position_error, 1e-3);
  EXPECT_LT(free.release_velocity_error, 2e-2);
}

TEST(ThrowStudy, IsRepeatable) {
  const Payload tube = reported_payloads().back();
  StudyOptions o;
  o.repetitions = 0;
  const ControllerChoice high{"plain", 300, 40, false};
  EXPECT_EQ(run_throw(high, tube, o, 7).miss, run_throw(high, tube, o, 7).miss);
  EXPECT_NE(run_throw(high, tube, o, 7).miss, run_throw(high, tube, o, 8).miss);
  o.repetitions = -1;
  EXPECT_THROW(run_throw(high, tube, o, 7), std::invalid_argument);
}

// V' = −sᵀ k_v s + sᵀ M (β' − α) under Eq. 35 with the update: α as printed is not β', and nothing else is in
// the way. C of the Christoffel symbols leaves no Ṁ, and J β is what the task asks for.
TEST(TaskLaw, LyapunovFunctionFallsByTheDampingButForTheNullSpaceThatTurns) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> one(-1, 1);
  Adaptation adaptation = StudyOptions::default_adaptation();
  adaptation.prediction = 0;
  for (int k = 0; k < 20; ++k) {
    const OnItsWay at(random);
    const auto tip = forward_kinematics<double>(at.known, at.q);
    const Eigen::Vector3d off = 0.05 * Eigen::Vector3d(one(random), one(random), one(random)),
                          turned = 0.3 * Eigen::Vector3d(one(random), one(random), one(random)),
                          velocity(one(random), one(random), one(random)),
                          acceleration = 3 * Eigen::Vector3d(one(random), one(random), one(random));
    const Eigen::Matrix3d orientation =
        Eigen::AngleAxisd(turned.norm(), turned.normalized()).toRotationMatrix() * tip.R;
    TaskGains gains;
    gains.stiffness = 40, gains.rotational = 8, gains.damping = at.gains.damping;
    gains.rest = at.q + JointVector<double>::Constant(7, 0.2);
    AdaptiveController controller(at.known, adaptation);
    controller.estimate = 0.3 * at.load;
    const auto law_at = [&](double t, const JointVector<double>& q, const JointVector<double>& qd) {
      return controller.task_law({tip.p + off + t * velocity + 0.5 * t * t * acceleration,
                                  velocity + t * acceleration, acceleration, orientation},
                                 gains, q, qd);
    };
    const ControlStep step = law_at(0, at.q, at.qd);
    AdaptiveController later = controller;
    later.adapt(step, step.torque, at.q, at.qd, 1);  // Euler's rule over 1 s: the rate
    const LinkParameters learns = later.estimate - controller.estimate;
    const JointVector<double> qdd = at.acceleration(step), s = step.velocity_error;
    // α of Eq. 35, with J⁺ from an orthogonal decomposition.
    const Eigen::MatrixXd J = jacobian<double>(at.known, at.q);
    const auto inverse = J.completeOrthogonalDecomposition();
    const TipMotion<double> moves = tip_motion<double>(at.known, at.q, at.qd, JointVector<double>::Zero(7));
    Eigen::VectorXd wanted(6);
    wanted << acceleration - moves.acceleration, -moves.alpha;
    const Eigen::VectorXd along_null = at.qd - Eigen::VectorXd(inverse.solve(J * at.qd)),
                          alpha = Eigen::VectorXd(inverse.solve(wanted)) - gains.posture * along_null;
    const auto then = [&](double t) {
      const JointVector<double> q = at.q + t * at.qd + 0.5 * t * t * qdd, qd = at.qd + t * qdd;
      return std::pair{law_at(t, q, qd), std::pair{q, qd}};
    };
    const auto V = [&](double t) {
      const auto [now, state] = then(t);
      return lyapunov(at.truth, gains, adaptation, now, state.first,
                      at.load - controller.estimate - t * learns);
    };
    const auto beta = [&](double t) {
      const auto [now, state] = then(t);
      return Eigen::VectorXd(now.velocity_error + state.second);
    };
    double best = 1;
    for (double h = 1e-2; h > 1e-7; h /= 10) {  // central differences: h² against rounding/h
      const Eigen::VectorXd beta_rate = (beta(h) - beta(-h)) / (2 * h);
      const double due = -s.dot(at.gains.damping.cwiseProduct(s)) +
                         s.dot(mass_matrix<double>(at.truth, at.q) * (beta_rate - alpha));
      best = std::min(best, std::abs((V(h) - V(-h)) / (2 * h) - due) / (1 + std::abs(due)));
    }
    EXPECT_LE(best, 1e-6) << k;
  }
}

// γ R_t is all that weighs the prediction: twice the one teaches as twice the other.
TEST(Prediction, ItsGainAndItsWeightAreOneFactor) {
  std::mt19937_64 random(8);
  const OnItsWay at(random);
  const auto learned = [&](double gain, double weight) {
    Adaptation adaptation = StudyOptions::default_adaptation();
    adaptation.prediction = gain, adaptation.torque_weight = weight;
    AdaptiveController controller(at.known, adaptation);
    ControlStep step = controller.joint_law(at.reference, at.gains, at.q, at.qd);
    step.velocity_error.setZero();
    for (int k = 0; k < 3; ++k) controller.adapt(step, step.torque, at.q + 1e-3 * k * at.qd, at.qd, 1e-3);
    return controller.estimate;
  };
  const LinkParameters once = learned(0.3, 1);
  EXPECT_GT(once.norm(), 0);
  EXPECT_LE((learned(0.3, 2) - learned(0.6, 1)).norm(), 1e-12 * once.norm());
  EXPECT_GT((learned(0.3, 2) - once).norm(), 0.1 * once.norm());
}

TEST(ThrowStudy, DispersionIsOfASample) {
  std::vector<StudyThrow> throws(4);
  throws[0].miss = {0.03, 0.01}, throws[0].hit = throws[0].lands = true,
  throws[0].use = {0.8, 0.2, 0.3, 0.1, 0.4};
  throws[1].miss = {-0.01, 0.01}, throws[1].lands = true, throws[1].use = {0.5, 0.6, 0.9, 0, 0.7};
  throws[2].miss = {0.01, 0.04}, throws[2].hit = throws[2].lands = true;
  throws[3].miss = {9, 9};  // never came down
  const Dispersion d = dispersion_of(throws);
  EXPECT_EQ(d.throws, 4);
  EXPECT_EQ(d.hits, 2);
  EXPECT_EQ(d.lost, 1);
  EXPECT_NEAR((d.mean - Eigen::Vector2d(0.01, 0.02)).norm(), 0, 1e-15);
  EXPECT_NEAR(d.std.x(), 0.02, 1e-12);                  // (4 + 4 + 0)/2 cm²
  EXPECT_NEAR(d.std.y(), std::sqrt(3.0) / 100, 1e-12);  // (1 + 1 + 4)/2
  EXPECT_NEAR(d.rms, std::sqrt((11e-4 + 18e-4) / 3), 1e-12);
  EXPECT_EQ(d.use.position, 0.8);
  EXPECT_EQ(d.use.velocity, 0.6);
  EXPECT_EQ(d.use.acceleration, 0.9);
  EXPECT_EQ(d.use.jerk, 0.1);
  EXPECT_EQ(d.use.torque, 0.7);
}

/// Plain control of a throw without repetitions.
StudyThrow throw_once_with(const StudyOptions& options, double mass = 1e-6, std::uint64_t seed = 1) {
  StudyOptions once = options;
  once.repetitions = 0;
  return run_throw({"plain", 30, 10, false}, {"object", mass, 0.05}, once, seed);
}

// Each cause of scatter by itself moves the landing, and without any there is none.
TEST(ThrowStudy, EveryNoiseScatters) {
  const Eigen::Vector2d exact = throw_once_with(ideal(), 0.2).miss;
  EXPECT_EQ(throw_once_with(ideal(), 0.2, 2).miss, exact) << "seeds are of noise alone";
  for (const auto& [name, noise, sigma] : {std::tuple{"angle", &StudyOptions::angle_noise, 2e-4},
                                           {"rate", &StudyOptions::rate_noise, 5e-3},
                                           {"torque", &StudyOptions::torque_noise, 0.05},
                                           {"friction", &StudyOptions::friction_error, 0.1},
                                           {"grasp", &StudyOptions::grasp_offset, 3e-3},
                                           {"release", &StudyOptions::release_jitter, 2e-3}}) {
    StudyOptions noisy = ideal();
    noisy.*noise = sigma;
    const Eigen::Vector2d one = throw_once_with(noisy, 0.2, 1).miss,
                          other = throw_once_with(noisy, 0.2, 2).miss;
    EXPECT_GT((one - other).norm(), 1e-5) << name;
    EXPECT_LT((one - exact).norm(), 0.05) << name;
  }
}

// A box that is a little larger than twice the miss is hit, one that is a little smaller either way is not.
TEST(ThrowStudy, HitsTheBoxThatHoldsItsLanding) {
  StudyOptions o;
  const Eigen::Vector2d miss = throw_once_with(o, 0.2, 3).miss.cwiseAbs();
  ASSERT_GT(miss.minCoeff(), 1e-5);
  o.box = 2.02 * miss;
  EXPECT_TRUE(throw_once_with(o, 0.2, 3).hit);
  o.box = {1.98 * miss.x(), 2.02 * miss.y()};
  EXPECT_FALSE(throw_once_with(o, 0.2, 3).hit);
  o.box = {2.02 * miss.x(), 1.98 * miss.y()};
  EXPECT_FALSE(throw_once_with(o, 0.2, 3).hit);
  o.landing_height = 5;  // it never rises there
  const StudyThrow lost = throw_once_with(o, 0.2, 3);
  EXPECT_FALSE(lost.lands);
  EXPECT_FALSE(lost.hit);
}

// A release between two steps of the controller is one in between: landings of a tracked course do not jump.
TEST(ThrowStudy, ReleasesBetweenTheStepsOfItsController) {
  StudyOptions o = ideal();
  const Eigen::Vector2d on = throw_once_with(o).miss;
  for (const double beyond : {0.3e-3, 0.6e-3, 0.95e-3}) {
    o.throw_time = StudyOptions{}.throw_time + beyond;
    EXPECT_LT((throw_once_with(o).miss - on).norm(), 2e-4) << beyond;
  }
}

// Seen from the reference that is due then, a release that comes early or late is not worse tracked.
TEST(ThrowStudy, ErrorsAtTheReleaseAreThoseOfTracking) {
  StudyOptions o = ideal();
  o.release_jitter = 0.02;
  double farthest = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const StudyThrow run = throw_once_with(o, 1e-6, seed);
    EXPECT_LT(run.release_position_error, 1e-3) << seed;
    EXPECT_LT(run.release_velocity_error, 3e-2) << seed;
    farthest = std::max(farthest, run.miss.norm());
  }
  EXPECT_GT(farthest, 0.01);
}

// What is asked for may be more than the joints have.
TEST(ThrowStudy, TellsTheTorqueThatWasAskedFor) {
  StudyOptions fast = ideal();
  fast.repetitions = 0;
  fast.throw_time = 0.1;
  EXPECT_GT(run_throw({"stiff", 3000, 400, false}, {"object", 2.5, 0.05}, fast, 1).use.torque, 1);
}

// Whatever the controller and the load, no joint of the simulated arm leaves its limits at any step: neither
// in what it practises nor in the throw and the brake of the empty hand.
TEST(ThrowStudy, StaysWithinTheLimitsOfTheArm) {
  auto controllers = reported_controllers();
  controllers.push_back(joint_controller());
  for (const ControllerChoice& controller : controllers)
    for (const Payload& payload : reported_payloads()) {
      StudyOptions once;
      once.repetitions = 1;
      const JointUse use = run_throw(controller, payload, once, 1).use;
      for (const double share : {use.position, use.velocity, use.acceleration, use.jerk, use.torque})
        EXPECT_TRUE(share > 0.1 && share < 0.95) << controller.name << ", " << payload.name << ": " << share;
      EXPECT_GT(use.acceleration, 0.7) << "it could be thrown faster";
    }
}

// The shares are those of the course: joint by joint from its tip's, by kinematics alone.
TEST(ThrowStudy, SharesOfLimitsAreThoseOfTheJoints) {
  StudyOptions once = ideal();
  once.repetitions = 1;
  const auto use = [&](double slower) {
    StudyOptions o = once;
    o.velocity /= slower;
    o.throw_time *= slower, o.brake_time *= slower, o.return_time *= slower;
    return run_throw({"stiff", 300, 40, false}, {"feather", 1e-6, 0.05}, o, 1).use;
  };
  const JointUse full = use(1), half = use(2);  // the same way, in twice the time
  EXPECT_NEAR(half.position, full.position, 1e-3);
  EXPECT_NEAR(half.velocity, full.velocity / 2, 0.01 * full.velocity);
  EXPECT_NEAR(half.acceleration, full.acceleration / 4, 0.02 * full.acceleration);
}

// Another way round: a throw aside misses there as a throw ahead does ahead.
TEST(ThrowStudy, ThrowsToTheSideAsItThrowsAhead) {
  const StudyOptions ahead = ideal();
  const Eigen::Vector2d a = throw_once_with(ahead, 0.4).miss;
  EXPECT_LT(a.x(), -0.03);  // the load pulls it short
  for (const double turn : {-0.7, 0.7, 1.2, std::numbers::pi / 2}) {
    StudyOptions aside = ahead;
    for (Eigen::Vector3d StudyOptions::*one :
         {&StudyOptions::start, &StudyOptions::release, &StudyOptions::velocity})
      aside.*one = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()) * (ahead.*one);
    const Eigen::Vector2d b = Eigen::Rotation2Dd(-turn) * throw_once_with(aside, 0.4).miss;
    EXPECT_LT((b - a).norm(), 0.1 * std::abs(a.x())) << turn;  // the hand is not turned along
  }
  StudyOptions behind = ahead;  // where joint 1 does not turn
  behind.start = {-0.6, -0.01, ahead.start.z()};
  EXPECT_THROW(throw_once_with(behind, 0.4), std::invalid_argument);
}

// The record's errors over the throwing part of a repetition are those that the run sums up.
TEST(ThrowStudy, SumsUpItsRecord) {
  StudyOptions o = ideal();
  o.repetitions = 1;
  const StudyThrow run = run_throw({"plain", 30, 10, false}, {"object", 0.4, 0.05}, o, 1, true);
  ASSERT_EQ(run.rms_error.size(), 2u);
  double squares = 0;
  int counted = 0;
  for (const TrackingSample& s : run.history)
    if (s.t < o.throw_time - 1e-9) squares += s.position_error * s.position_error, ++counted;
  EXPECT_EQ(counted, 50);  // every 10 ms
  EXPECT_NEAR(run.rms_error.front(), std::sqrt(squares / counted), 0.02 * run.rms_error.front());
}

// In the joints, too, a hand that is held harder against turning gives way less to its load.
TEST(ThrowStudy, JointsFeelTheStiffnessAgainstTurning) {
  const auto lag = [](double rotational) {
    StudyOptions once = ideal();
    once.repetitions = 0;
    return run_throw({"joints", 30, rotational, false, true}, {"object", 0.4, 0.05}, once, 1)
        .release_position_error;
  };
  EXPECT_LT(lag(40), 0.7 * lag(10));
}

// What the estimate takes off the load that is not known is no error any more: V falls with the learning.
TEST(ThrowStudy, LyapunovsFunctionFallsAsTheLoadIsLearned) {
  StudyOptions o = ideal();
  const StudyThrow run = run_throw({"adaptive", 30, 10, true}, {"object", 0.4, 0.05}, o, 1, true);
  ASSERT_GT(run.history.back().mass_estimate, 0.8 * 0.4);
  EXPECT_LT(run.history.back().lyapunov, 0.9 * run.history.front().lyapunov) << "what no motion shows stays";
}

}  // namespace
}  // namespace unhand::planners::control
