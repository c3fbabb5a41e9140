#include "planners/control/task_controller.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/quintic.hpp"

namespace unhand::planners::control {
namespace {

using Joints = JointVector<double>;

/// C(q, a) b of the Christoffel symbols; symmetric in a and b.
Joints coriolis_between(const Chain& chain, const Joints& q, const Joints& a, const Joints& b) {
  return 0.5 * (coriolis_torque<double>(chain, q, a + b) - coriolis_torque<double>(chain, q, a) -
                coriolis_torque<double>(chain, q, b));
}

Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& R) {
  const Eigen::AngleAxisd turn(R);
  return turn.angle() * turn.axis();
}

/// ½ π̃ᵀ R_p⁻¹ π̃ over the adapted parameters.
double estimate_energy(const Adaptation& adaptation, const LinkParameters& error) {
  double out = 0;
  for (int i = 0; i < kLinkParameters; ++i)
    if (adaptation.gain[i] > 0) out += 0.5 * error[i] * error[i] / adaptation.gain[i];
  return out;
}

}  // namespace

AdaptiveController::AdaptiveController(const Chain& model, const Adaptation& adaptation)
    : model_(model), adaptation_(adaptation) {
  const auto refuse = [](const char* name, double value, const char* accepted) {
    throw std::invalid_argument(fmt::format("adaptation: {} = {}; accepted: {}", name, value, accepted));
  };
  if (!(adaptation.gain.minCoeff() >= 0)) refuse("gain", adaptation.gain.minCoeff(), ">= 0");
  if (!(adaptation.prediction >= 0)) refuse("prediction", adaptation.prediction, ">= 0");
  if (!(adaptation.torque_weight > 0)) refuse("torque_weight", adaptation.torque_weight, "> 0");
  if (!(adaptation.filter > 0)) refuse("filter", adaptation.filter, "> 0");
}

ControlStep AdaptiveController::joint_law(const JointReference& r, const JointGains& gains, const Joints& q,
                                          const Joints& qd) const {
  require_sizes(model_, "joint law", q, qd, r.q, r.qd, r.qdd, gains.stiffness, gains.damping);
  ControlStep out;
  out.velocity_error = r.qd - qd;
  out.regressor = torque_regressor<double>(model_, q, qd, r.qdd, kGravity, model_.size() - 1);  // q̇_r = q̇
  out.torque = inverse_dynamics<double>(model_, q, qd, r.qdd) + out.regressor * estimate +
               friction_torque<double>(model_, qd) + gains.damping.cwiseProduct(out.velocity_error) +
               gains.stiffness.cwiseProduct(r.q - q);
  return out;
}

ControlStep AdaptiveController::task_law(const TaskReference& r, const TaskGains& gains, const Joints& q,
                                         const Joints& qd) const {
  require_sizes(model_, "task law", q, qd, gains.damping, gains.rest);
  const int n = model_.size(), last = n - 1;
  const TipMotion<double> tip = tip_motion<double>(model_, q, qd, Joints::Zero(n));
  const Jacobian<double> J = jacobian<double>(model_, q);
  ControlStep out;
  out.error << r.position - tip.frame.p, rotation_vector(r.orientation * tip.frame.R.transpose());
  Eigen::Matrix<double, 6, 1> rate, acceleration, drift;
  rate << r.velocity, Eigen::Vector3d::Zero();
  acceleration << r.acceleration, Eigen::Vector3d::Zero();
  drift << tip.acceleration, tip.alpha;  // J̇ q̇
  // J⁺ = Jᵀ (J Jᵀ)⁻¹ and N = 1 − J⁺ J, applied.
  const JointMatrix<double> JJt = J * J.transpose();
  const auto reach = [&](const Eigen::Matrix<double, 6, 1>& x) {
    return Joints(J.transpose() * solve_positive<double>(JJt, x));
  };
  const auto null = [&](const Joints& x) { return Joints(x - reach(J * x)); };
  const Joints beta = reach(rate) + null(gains.posture * (gains.rest - q));
  const Joints alpha = reach(acceleration - drift) - gains.posture * null(qd);
  out.velocity_error = beta - qd;
  out.regressor = slotine_li_regressor<double>(model_, q, qd, beta, alpha, kGravity, last);
  const Joints nominal =
      inverse_dynamics<double>(model_, q, Joints::Zero(n), alpha) + coriolis_between(model_, q, qd, beta);
  Eigen::Matrix<double, 6, 1> pull = gains.stiffness * out.error;
  pull.tail<3>() = gains.rotational * out.error.tail<3>();
  out.torque = nominal + out.regressor * estimate + friction_torque<double>(model_, qd) +
               gains.damping.cwiseProduct(out.velocity_error) + J.transpose() * pull;
  return out;
}

AdaptiveController::Prediction AdaptiveController::predict(const Joints& applied, const Joints& q,
                                                           const Joints& qd, double dt) {
  const int last = model_.size() - 1;
  const double l = adaptation_.filter;
  const Regressor<double> momentum = momentum_regressor<double>(model_, q, qd, last);
  // The known links: the same columns times their parameters, without forming them.
  const Joints own = mass_matrix<double>(model_, q) * qd;
  const Joints rest =  // h = g − Cᵀ q̇
      gravity_torque<double>(model_, q) - coriolis_matrix<double>(model_, q, qd).transpose() * qd;
  // Of Y_f, λ Y_p − Y_h; of τ_f − Y_f π of the model, λ p − h, and the torque beside it.
  const Filtered input{l * momentum - momentum_rest_regressor(model_, q, qd, kGravity, last),
                       l * own - rest - friction_torque<double>(model_, qd)};
  if (!held_) {
    filtered_ = {input.regressor, input.torque + applied};
  } else {
    // The torque was held since the last step; what goes with the motion is taken at both of its ends: with
    // one of them alone λ dt/2 of the arm's whole momentum rate would be learned as load.
    const double keep = std::exp(-l * held_->dt), mean = 0.5 * (1 - keep);
    filtered_.regressor = keep * filtered_.regressor + mean * (held_->input.regressor + input.regressor);
    filtered_.torque =
        keep * filtered_.torque + mean * (held_->input.torque + input.torque) + (1 - keep) * held_->applied;
  }
  held_ = {input, applied, dt};
  return {l * momentum - filtered_.regressor, filtered_.torque - l * own};
}

void AdaptiveController::adapt(const ControlStep& step, const Joints& applied, const Joints& q,
                               const Joints& qd, double dt) {
  require_sizes(model_, "adaptation", step.velocity_error, applied, q, qd);
  if (step.regressor.rows() != model_.size() || step.regressor.cols() != estimate.size())
    throw std::invalid_argument("adaptation: the step has no regressor: it is of no law of this arm");
  if (!(dt >= 0 && std::isfinite(dt)))
    throw std::invalid_argument(fmt::format("adaptation: dt = {} is not in [0, inf) s", dt));
  if (adaptation_.gain.maxCoeff() == 0) return;
  LinkParameters rate = step.regressor.transpose() * step.velocity_error;
  if (adaptation_.prediction > 0) {
    const Prediction seen = predict(applied, q, qd, dt);
    rate += adaptation_.prediction * adaptation_.torque_weight *
            (seen.regressor.transpose() * (seen.torque - seen.regressor * estimate));
  }
  estimate += dt * adaptation_.gain.cwiseProduct(rate);
}

double lyapunov(const Chain& truth, const TaskGains& gains, const Adaptation& adaptation,
                const ControlStep& step, const Joints& q, const LinkParameters& error) {
  const Joints& s = step.velocity_error;
  return 0.5 * s.dot(mass_matrix<double>(truth, q) * s) +
         0.5 * gains.stiffness * step.error.head<3>().squaredNorm() +
         0.5 * gains.rotational * step.error.tail<3>().squaredNorm() + estimate_energy(adaptation, error);
}

double lyapunov(const Chain& truth, const JointGains& gains, const Adaptation& adaptation,
                const ControlStep& step, const Joints& q, const Joints& off, const LinkParameters& error) {
  require_sizes(truth, "Lyapunov function", q, off, step.velocity_error, gains.stiffness);
  const Joints& s = step.velocity_error;
  return 0.5 * s.dot(mass_matrix<double>(truth, q) * s) + 0.5 * off.dot(gains.stiffness.cwiseProduct(off)) +
         estimate_energy(adaptation, error);
}

TaskReference MinimumJerk::at(double t, const Eigen::Matrix3d& orientation) const {
  if (!(duration > 0 && std::isfinite(duration)))
    throw std::invalid_argument(fmt::format("minimum jerk: duration = {} is not in (0, inf) s", duration));
  const double T = duration, s = std::clamp(t / T, 0.0, 1.0);
  // In s = t/T, with accelerations zero at both ends.
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const auto c = dynamics::quintic_between<Eigen::Vector3d>({from, from_velocity * T, zero},
                                                            {to, to_velocity * T, zero}, 1);
  TaskReference out;
  out.position = c[0] + s * (c[1] + s * s * (c[3] + s * (c[4] + s * c[5])));
  out.velocity = (c[1] + s * s * (3 * c[3] + s * (4 * c[4] + s * 5 * c[5]))) / T;
  out.acceleration = s * (6 * c[3] + s * (12 * c[4] + s * 20 * c[5])) / (T * T);
  out.orientation = orientation;
  return out;
}

}  // namespace unhand::planners::control
