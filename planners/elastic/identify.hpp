// Identification of an arm's inertial parameters and of its spring from logs, [DarkoD46] section 4.3.
#pragma once

#include <vector>

#include "planners/control/regressor.hpp"

namespace unhand::planners::elastic {

/// A periodic motion of all joints: q_i(t) = c_i + Σ_k (a_ik sin kωt + b_ik cos kωt).
struct Excitation {
  double period{};               ///< s
  JointVector<double> centre;    ///< rad
  Eigen::MatrixXd sine, cosine;  ///< one row per joint, one column per harmonic [rad]

  /// Angles, rates and accelerations at t [s].
  void at(double t, JointVector<double>& q, JointVector<double>& qd, JointVector<double>& qdd) const;
};

/// What motion is looked for, and how long.
struct ExcitationOptions {
  double period{4};  ///< s, in (0, inf)
  int harmonics{3};  ///< 1 to 100
  int samples{60};   ///< instants per period that the condition number looks at, >= 10
  int trials{300};   ///< of a random search that narrows around the best, >= 1
  unsigned seed{1};  ///< of the random search
};
/// A motion, and how well it shows the parameters.
struct DesignedExcitation {
  Excitation motion;                      ///< the best of the trials
  double first_condition{}, condition{};  ///< of the regressor's identifiable part: first trial, best [-]
};
/// The motion within the limits of angle and speed whose regressor has the smallest condition number among
/// the trials.
DesignedExcitation design_excitation(const Chain& chain, const ExcitationOptions& options = {});

/// One line of a log.
struct MotionSample {
  JointVector<double> q, qd, qdd, torque;  ///< rad, rad/s, rad/s², N m, less friction and rotors' inertia
};

/// What a log determines: combinations βᵀ = πᵀ V of the parameters, orthonormal columns V.
struct IdentifiedInertia {
  Eigen::MatrixXd combinations;     ///< V
  Eigen::VectorXd estimate, sigma;  ///< of β, with its standard deviation
  double torque_noise{};            ///< 1 σ of the residual [N m]
  double condition{};               ///< of the regressor [-]
  Chain feasible;                   ///< the chain with inertias that bodies can have, nearest to the estimate
  double feasible_misfit{};  ///< √(mean ((β_feasible − estimate)/σ)²): of order one if the log is consistent
                             ///< with bodies
};
/// Least squares for the identifiable combinations, weighted with each joint's own noise, which may stay from
/// sample to sample as of a filtered torque (AR(1); samples in order, evenly spaced). Then bodies for them:
/// each link's pseudo-inertia is J = U Uᵀ with an upper triangular U of positive diagonal (log-Cholesky,
/// [RuckerWensing2022]), so that no estimate is unphysical; what the log does not determine stays near
/// `prior`. Throws std::invalid_argument for fewer equations (one per sample and joint) than twice the
/// parameters, that is fewer than 20 samples, for samples that have not one finite number for each joint, or
/// a prior with no mass.
IdentifiedInertia identify_inertia(const Chain& prior, const std::vector<MotionSample>& log);

/// One line of a log in a coupled mode, the link held: deflection θ − ψ, θ̇, θ̈ and the motor's torque.
struct SpringSample {
  double deflection{}, rate{}, acceleration{}, torque{};  ///< rad, rad/s, rad/s², N m
};
/// What a log says of a spring.
struct IdentifiedSpring {
  double stiffness{}, damping{}, inertia{};                    ///< N m/rad, N m s/rad, kg m²
  double stiffness_sigma{}, damping_sigma{}, inertia_sigma{};  ///< 1 σ
};
/// τ = B θ̈ + D θ̇ + K (θ − ψ), by least squares. Throws std::invalid_argument for fewer than ten samples, for
/// some that are not finite, and for a motion that does not tell the three terms apart, as a swing at one
/// frequency.
IdentifiedSpring identify_spring(const std::vector<SpringSample>& log);

}  // namespace unhand::planners::elastic
