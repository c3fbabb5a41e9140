// The dynamics of a chain as a linear function of its inertial parameters, τ = Y(q, q̇, q̈) π.
//
// π has ten entries per link: mass m [kg], first moment m c [kg m], and the inertia about the link's origin,
// xx, yy, zz, xy, xz, yz [kg m²]. All functions are templated on their scalar.
#pragma once

#include "planners/arm/dynamics.hpp"

namespace unhand::planners::control {

/// m [kg], m c [kg m], and I about the frame's origin: xx, yy, zz, xy, xz, yz [kg m²].
inline constexpr int kLinkParameters = 10;

/// One row per joint, ten columns per link.
template <class S>
using Regressor =
    Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kLinkParameters * kMaxJoints>;
/// Of one link.
using LinkParameters = Eigen::Matrix<double, kLinkParameters, 1>;

/// The parameters of a body, seen from the link's frame.
LinkParameters parameters_of(const Inertia& body);
/// The body that has these parameters; mass > 0.
Inertia inertia_from(const LinkParameters& parameters);
/// Those of all links, one below the other.
Eigen::VectorXd parameters_of(const Chain& chain);

/// Y(q, q̇, q̈) with inverse_dynamics(q, q̇, q̈) = Y π [Khalil2002]; the columns of the links from `first` on.
template <class S>
Regressor<S> torque_regressor(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                              const JointVector<S>& qdd, const Eigen::Vector3d& gravity = kGravity,
                              int first = 0);

/// Y_r(q, q̇, q̇_r, q̈_r) of Slotine and Li, M q̈_r + C(q, q̇) q̇_r + g = Y_r π [SlotineLi1987], with the C of the
/// Christoffel symbols, for which Ṁ − 2 C is skew. C(q, a) b is symmetric in a and b, so that C(q, q̇) q̇_r = ½
/// (c(q̇ + q̇_r) − c(q̇) − c(q̇_r)) with the quadratic c(x) = C(q, x) x, exactly.
template <class S>
Regressor<S> slotine_li_regressor(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                                  const JointVector<S>& qd_r, const JointVector<S>& qdd_r,
                                  const Eigen::Vector3d& gravity = kGravity, int first = 0) {
  const JointVector<S> none = JointVector<S>::Zero(chain.size());
  const Eigen::Vector3d weightless = Eigen::Vector3d::Zero();
  const auto c = [&](const JointVector<S>& rate) {
    return torque_regressor<S>(chain, q, rate, none, weightless, first);
  };
  return torque_regressor<S>(chain, q, none, qdd_r, gravity, first) +
         0.5 * (c(JointVector<S>(qd + qd_r)) - c(qd) - c(qd_r));
}

/// The regressor of the momentum M(q) q̇.
template <class S>
Regressor<S> momentum_regressor(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                                int first = 0) {
  return torque_regressor<S>(chain, q, JointVector<S>::Zero(chain.size()), qd, Eigen::Vector3d::Zero(),
                             first);
}

/// The regressor of h = g − Cᵀ q̇, which the momentum's rate leaves of the torques: d/dt (M q̇) + h = τ. No
/// acceleration is in it: Cᵀ q̇ = Ṁ q̇ − C q̇.
Regressor<double> momentum_rest_regressor(const Chain& chain, const JointVector<double>& q,
                                          const JointVector<double>& qd,
                                          const Eigen::Vector3d& gravity = kGravity, int first = 0);

// ---------------------------------------------------------------- the same, spelled out

template <class S>
Regressor<S> torque_regressor(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                              const JointVector<S>& qdd, const Eigen::Vector3d& gravity, int first) {
  require_sizes(chain, "torque regressor", q, qd, qdd);
  const int n = chain.size();
  Regressor<S> out = Regressor<S>::Zero(n, kLinkParameters * (n - first));
  std::array<Matrix3<S>, kMaxJoints> R;
  Vector3<S> w = Vector3<S>::Zero(), alpha = Vector3<S>::Zero(), a = (-gravity).cast<S>();
  for (int i = 0; i < n; ++i) {
    const Vector3<double>& p = chain.joints[i].origin.p;
    R[i] = joint_rotation(chain.joints[i].origin.R, q[i]);
    const Vector3<S> origin = a + cross(alpha, p) + cross(w, cross(w, p));
    a = R[i].transpose() * origin;
    w = (R[i].transpose() * w).eval();
    const Vector3<S> turn(w[1] * qd[i], -w[0] * qd[i], qdd[i]);
    alpha = (R[i].transpose() * alpha).eval() + turn;
    w[2] += qd[i];
    if (i < first) continue;
    // force = m a + (α× + ω×ω×) m c;  torque = m c × a + I α + ω × I ω
    Eigen::Matrix<S, 3, kLinkParameters> force = Eigen::Matrix<S, 3, kLinkParameters>::Zero(), torque = force;
    force.col(0) = a;
    for (int k = 0; k < 3; ++k) {
      Vector3<S> unit = Vector3<S>::Zero();
      unit[k] = S(1.0);
      force.col(1 + k) = cross(alpha, unit) + cross(w, cross(w, unit));
      torque.col(1 + k) = cross(unit, a);
    }
    const auto inertial = [](const Vector3<S>& x) {  // I x = L(x) (xx, yy, zz, xy, xz, yz)
      const S o(0.0);
      Eigen::Matrix<S, 3, 6> L;
      L << x[0], o, o, x[1], x[2], o,  //
          o, x[1], o, x[0], o, x[2],   //
          o, o, x[2], o, x[0], x[1];
      return L;
    };
    const Eigen::Matrix<S, 3, 6> La = inertial(alpha), Lw = inertial(w);
    for (int k = 0; k < 6; ++k) torque.col(4 + k) = La.col(k) + cross(w, Vector3<S>(Lw.col(k)));
    const int column = kLinkParameters * (i - first);
    for (int j = i;; --j) {  // down the chain
      out.block(j, column, 1, kLinkParameters) = torque.row(2);
      if (j == 0) break;
      force = (R[j] * force).eval();
      torque = (R[j] * torque).eval();
      const Vector3<S> arm = chain.joints[j].origin.p.template cast<S>();
      for (int k = 0; k < kLinkParameters; ++k) torque.col(k) += cross(arm, Vector3<S>(force.col(k)));
    }
  }
  return out;
}

extern template Regressor<double> torque_regressor(const Chain&, const JointVector<double>&,
                                                   const JointVector<double>&, const JointVector<double>&,
                                                   const Eigen::Vector3d&, int);

}  // namespace unhand::planners::control
