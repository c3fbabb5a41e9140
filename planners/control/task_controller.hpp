// Computed torque in the joints and in the task, with and without adaptation, [DarkoD46] Eq. 31, 34, 35, 36.
//
// What is not known is a body in the hand: ten parameters π̃ of the last link beyond the model, estimated as π̂
// from 0. Neither law measures an acceleration or inverts an estimated mass matrix.
#pragma once

#include <optional>

#include "planners/control/regressor.hpp"

namespace unhand::planners::control {

/// π̂' = R_p (Y_rᵀ s + γ Y_fᵀ R_t (τ_f − Y_f π̂)): s the velocity error, and the second term the prediction
/// error. Eq. 34 and 36 print Y(q, q̇, q̈) there; its acceleration is avoided by filtering both sides of τ = Y
/// π through λ/(p + λ), Y_f = λ Y_p − λ/(p + λ) (λ Y_p − Y_h) with the regressors of momentum and of its
/// rest.
struct Adaptation {
  LinkParameters gain =
      LinkParameters::Zero();  ///< R_p, diagonal: per entry of π̂, >= 0; zeros: no adaptation
  double prediction{};         ///< γ [-], >= 0
  double torque_weight{1};     ///< R_t = weight · 1 [1/(N m)², in the units of gain], > 0
  double filter{50};           ///< λ [1/s], > 0
};

/// Motion of the joints.
struct JointReference {
  JointVector<double> q, qd, qdd;  ///< rad, rad/s, rad/s²
};

/// Gains of the law in the joints.
struct JointGains {
  JointVector<double> stiffness;  ///< k_p [N m/rad], diagonal, > 0
  JointVector<double> damping;    ///< k_v [N m s/rad], diagonal, > 0
};

/// Motion of the tip with its orientation kept.
struct TaskReference {
  Eigen::Vector3d position, velocity, acceleration;  ///< m, m/s, m/s²
  Eigen::Matrix3d orientation;                       ///< axes of the tip as columns
};

/// Gains of the law in the task.
struct TaskGains {
  double stiffness{};           ///< k_ξ of the position [N/m], > 0
  double rotational{};          ///< k_ξ of the orientation [N m/rad], > 0
  JointVector<double> damping;  ///< k_v [N m s/rad], diagonal, > 0
  double posture{2};            ///< ȧ_d = posture (q_rest − q) moves in the null space [1/s], >= 0
  JointVector<double> rest;     ///< q_rest [rad]
};

/// Quantities of a step that a monitor asks for.
struct ControlStep {
  JointVector<double> torque;          ///< τ [N m], before limits
  JointVector<double> velocity_error;  ///< s = β − q̇ in the task, ė in the joints [rad/s]
  Eigen::Matrix<double, 6, 1> error =  ///< e_ξ: position [m] and rotation vector [rad]; 0 in the joints
      Eigen::Matrix<double, 6, 1>::Zero();
  Regressor<double> regressor;  ///< Y_r of the torque's law, by which the estimate adapts
};

/// Two laws with one estimate of the unknown body. All throw std::invalid_argument for vectors that have not
/// one number for each joint.
class AdaptiveController {
 public:
  /// `model`: the chain as it is known, without the unknown body; friction is compensated as the model has
  /// it.
  AdaptiveController(const Chain& model, const Adaptation& adaptation);

  /// Torques of Eq. 31, e = q_d − q: τ = M̂ q̈_d + Ĉ q̇ + ĝ + k_v ė + k_p e. With the true parameters M ë + k_v
  /// ė + k_p e = 0; else Y_r π̃ is on the right, with Y_r(q, q̇, q̇, q̈_d) = Y(q, q̇, q̈_d) of Eq. 34.
  ControlStep joint_law(const JointReference& reference, const JointGains& gains,
                        const JointVector<double>& q, const JointVector<double>& qd) const;
  /// Torques of Eq. 35: impedance in the task, posture in its null space.
  ControlStep task_law(const TaskReference& reference, const TaskGains& gains, const JointVector<double>& q,
                       const JointVector<double>& qd) const;

  /// Advances estimate and filters by dt [s] from a law's step, with the torque applied (after limits) until
  /// the next step: the estimate by Euler's rule as a controller does, the filters with an error of O(λ²
  /// dt²). Throws std::invalid_argument for a step that no law has made.
  void adapt(const ControlStep& step, const JointVector<double>& applied, const JointVector<double>& q,
             const JointVector<double>& qd, double dt);

  LinkParameters estimate = LinkParameters::Zero();  ///< π̂

 private:
  Chain model_;
  Adaptation adaptation_;
  /// Columns of the unknown body, and a torque [N m].
  struct Filtered {
    Regressor<double> regressor;
    JointVector<double> torque;
  };
  using Prediction = Filtered;  // Y_f, and τ_f less what the model has of it
  /// Advances the filters to now, and holds the torque for the dt [s] to come.
  Prediction predict(const JointVector<double>& applied, const JointVector<double>& q,
                     const JointVector<double>& qd, double dt);
  struct Held {
    Filtered input;  ///< at the last step: λ Y_p − Y_h, and λ p − h of the model
    JointVector<double> applied;
    double dt;
  };
  Filtered filtered_;         ///< λ/(p + λ) of these, and of the torque
  std::optional<Held> held_;  ///< empty before the first step
};

/// ½ sᵀ M s + ½ k |e_p|² + ½ k_r |e_r|² + ½ π̃ᵀ R_p⁻¹ π̃ over the adapted parameters, M of the true chain. If α
/// were dβ/dt it would fall as −sᵀ k_v s − γ |Y_f π̃|²_R_t under the task law without noise, limits and
/// friction left over. α as printed is not where the null space turns: even then V rises at times within a
/// motion, and is lower only after the repetitions than before them (docs/adaptive-control.md).
double lyapunov(const Chain& truth, const TaskGains& gains, const Adaptation& adaptation,
                const ControlStep& step, const JointVector<double>& q, const LinkParameters& error);
/// The same under the joint law, ½ ėᵀ M ė + ½ eᵀ k_p e + ½ π̃ᵀ R_p⁻¹ π̃ with e = `off`. Eq. 31 has Ĉ q̇ where
/// Slotine and Li have Ĉ q̇_d: the rate is −ėᵀ k_v ė + ½ ėᵀ Ṁ ė − γ |Y_f π̃|²_R_t, and V may rise where k_v is
/// small against ½ Ṁ.
double lyapunov(const Chain& truth, const JointGains& gains, const Adaptation& adaptation,
                const ControlStep& step, const JointVector<double>& q, const JointVector<double>& off,
                const LinkParameters& error);

/// The quintic of least jerk between two states in `duration` [s], [FlashHogan1985]: position, velocity,
/// acceleration at t, held beyond the ends.
struct MinimumJerk {
  Eigen::Vector3d from, from_velocity, to, to_velocity;  ///< m, m/s
  double duration{};                                     ///< s, > 0
  /// The motion at t [s], with the orientation given. Throws std::invalid_argument for another duration.
  TaskReference at(double t, const Eigen::Matrix3d& orientation) const;
};

}  // namespace unhand::planners::control
