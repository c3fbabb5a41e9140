// Rigid-body dynamics of a serial chain, M(q) q̈ + C(q, q̇) q̇ + g(q) = τ.
//
// All functions are templated on their scalar: double, Dual, or any other dynamics::DualOf. Those of double
// and Dual are compiled once, in dynamics.cpp. They check sizes as those of kinematics.hpp do.
#pragma once

#include "planners/arm/kinematics.hpp"

namespace unhand::planners {

/// m/s², in the base's axes.
inline const Eigen::Vector3d kGravity{0, 0, -9.81};

/// τ [N m] for q, q̇, q̈: the recursive Newton-Euler algorithm [LuhWalkerPaul1980], in the links' own frames;
/// the base accelerates with −gravity instead of the links being pulled. Friction is not in it.
template <class S>
JointVector<S> inverse_dynamics(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                                const JointVector<S>& qdd, const Eigen::Vector3d& gravity = kGravity);

/// M(q) [kg m²], by composite rigid bodies [Featherstone2008]; symmetric and positive definite.
template <class S>
JointMatrix<S> mass_matrix(const Chain& chain, const JointVector<S>& q);

/// C(q, q̇) q̇ + g(q) [N m].
template <class S>
JointVector<S> bias_torque(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                           const Eigen::Vector3d& gravity = kGravity) {
  return inverse_dynamics<S>(chain, q, qd, JointVector<S>::Zero(chain.size()), gravity);
}
/// g(q) [N m].
template <class S>
JointVector<S> gravity_torque(const Chain& chain, const JointVector<S>& q,
                              const Eigen::Vector3d& gravity = kGravity) {
  return bias_torque<S>(chain, q, JointVector<S>::Zero(chain.size()), gravity);
}
/// C(q, q̇) q̇ [N m].
template <class S>
JointVector<S> coriolis_torque(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd) {
  return bias_torque<S>(chain, q, qd, Eigen::Vector3d::Zero());
}
/// C(q, q̇) of the Christoffel symbols [N m s/rad]: Ṁ − 2 C is skew. c(q̇) = C(q, q̇) q̇ is quadratic and
/// C(q, a) b symmetric in a and b, so the column j is ½ (c(q̇ + e_j) − c(q̇) − c(e_j)), exactly.
template <class S>
JointMatrix<S> coriolis_matrix(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd);

/// x of A x = b for a symmetric positive definite A, by Cholesky. NaN where A is not.
template <class S>
JointVector<S> solve_positive(JointMatrix<S> A, JointVector<S> b);

/// q̈ [rad/s²] under the torques τ.
template <class S>
JointVector<S> forward_dynamics(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                                const JointVector<S>& torque, const Eigen::Vector3d& gravity = kGravity) {
  return solve_positive<S>(mass_matrix(chain, q), torque - bias_torque(chain, q, qd, gravity));
}

/// What the joints' friction takes from τ [N m].
template <class S>
JointVector<S> friction_torque(const Chain& chain, const JointVector<S>& qd) {
  using std::exp;
  require_sizes(chain, "friction of the joints", qd);
  JointVector<S> out(chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const JointFriction& f = chain.joints[i].friction;
    out[i] = f.phi1 / (1.0 + exp(-f.phi2 * (qd[i] + f.phi3))) - f.phi1 / (1.0 + std::exp(-f.phi2 * f.phi3));
  }
  return out;
}

/// ½ q̇ᵀ M q̇ and −Σ m g·p [J]; the potential is zero in the base's origin.
template <class S>
struct ChainEnergy {
  S kinetic{}, potential{};  ///< J
};
/// The energies of the chain at (q, q̇).
template <class S>
ChainEnergy<S> energy_of(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                         const Eigen::Vector3d& gravity = kGravity);

// ---------------------------------------------------------------- the same, spelled out

template <class S>
JointVector<S> inverse_dynamics(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                                const JointVector<S>& qdd, const Eigen::Vector3d& gravity) {
  require_sizes(chain, "inverse dynamics", q, qd, qdd);
  const int n = chain.size();
  std::array<Matrix3<S>, kMaxJoints> R;
  std::array<Vector3<S>, kMaxJoints> force, torque;  // of each link's own motion, about its origin
  Vector3<S> w = Vector3<S>::Zero(), alpha = Vector3<S>::Zero(), a = (-gravity).cast<S>();
  for (int i = 0; i < n; ++i) {
    const Joint& joint = chain.joints[i];
    const Vector3<double>& p = joint.origin.p;
    const Vector3<double>& c = joint.link.com;
    R[i] = joint_rotation(joint.origin.R, q[i]);
    const Vector3<S> origin = a + cross(alpha, p) + cross(w, cross(w, p));
    a = R[i].transpose() * origin;
    w = (R[i].transpose() * w).eval();
    const Vector3<S> turn(w[1] * qd[i], -w[0] * qd[i], qdd[i]);  // ω × z q̇ + z q̈
    alpha = (R[i].transpose() * alpha).eval() + turn;
    w[2] += qd[i];
    const Vector3<S> com = a + cross(alpha, c) + cross(w, cross(w, c));
    const Vector3<S> momentum = joint.link.about_com * w;
    force[i] = joint.link.mass * com;
    torque[i] = joint.link.about_com * alpha + cross(w, momentum) + cross(c, force[i]);
  }
  JointVector<S> out(n);
  for (int i = n - 1; i >= 0; --i) {
    out[i] = torque[i][2];
    if (i == 0) break;
    const Vector3<S> f = R[i] * force[i];
    force[i - 1] += f;
    torque[i - 1] += R[i] * torque[i] + cross(chain.joints[i].origin.p, f);
  }
  return out;
}

template <class S>
JointMatrix<S> mass_matrix(const Chain& chain, const JointVector<S>& q) {
  require_sizes(chain, "mass matrix", q);
  const int n = chain.size();
  JointMatrix<S> out(n, n);
  std::array<Matrix3<S>, kMaxJoints> R;
  // What hangs on link i as one body: mass, m c, and the inertia about the link's origin.
  S mass(0.0);
  Vector3<S> first = Vector3<S>::Zero();
  Matrix3<S> second = Matrix3<S>::Zero();
  const auto add_parallel = [&](const auto& m, const auto& a, const auto& b) {  // m (a·b 1 − ½ (a bᵀ + b aᵀ))
    const auto along = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for (int i = 0; i < 3; ++i) {
      second(i, i) += m * along;
      for (int j = 0; j < 3; ++j) second(i, j) -= 0.5 * m * (a[i] * b[j] + a[j] * b[i]);
    }
  };
  for (int i = 0; i < n; ++i) R[i] = joint_rotation(chain.joints[i].origin.R, q[i]);
  for (int i = n - 1; i >= 0; --i) {
    if (i + 1 < n) {  // the bodies beyond, carried from link i + 1 to link i
      const Vector3<double>& p = chain.joints[i + 1].origin.p;
      second = (R[i + 1] * second * R[i + 1].transpose()).eval();
      first = (R[i + 1] * first).eval();
      add_parallel(2.0, p, first);
      add_parallel(mass, p, p);
      for (int k = 0; k < 3; ++k) first[k] += mass * p[k];
    }
    const Inertia& link = chain.joints[i].link;
    mass += link.mass;
    first += (link.mass * link.com).cast<S>();
    second += link.about_com.cast<S>();
    add_parallel(link.mass, link.com, link.com);
    // The wrench about link i's origin that q̈_i = 1 asks for, then carried down the chain.
    Vector3<S> f(-first[1], first[0], S(0.0)), torque = second.col(2);
    out(i, i) = torque[2];
    for (int j = i; j > 0; --j) {
      f = (R[j] * f).eval();
      torque = (R[j] * torque).eval() + cross(chain.joints[j].origin.p, f);
      out(i, j - 1) = out(j - 1, i) = torque[2];
    }
  }
  return out;
}

template <class S>
JointMatrix<S> coriolis_matrix(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd) {
  const int n = chain.size();
  const JointVector<S> at = coriolis_torque(chain, q, qd);  // checks the sizes
  JointMatrix<S> out(n, n);
  for (int j = 0; j < n; ++j) {
    JointVector<S> unit = JointVector<S>::Zero(n);
    unit[j] = S(1.0);
    out.col(j) = 0.5 * (coriolis_torque<S>(chain, q, qd + unit) - at - coriolis_torque(chain, q, unit));
  }
  return out;
}

template <class S>
JointVector<S> solve_positive(JointMatrix<S> A, JointVector<S> b) {
  using std::sqrt;
  const int n = static_cast<int>(b.size());
  for (int j = 0; j < n; ++j) {  // A = L Lᵀ in the lower triangle, and b = L⁻¹ b
    for (int k = 0; k < j; ++k) A(j, j) -= A(j, k) * A(j, k);
    A(j, j) = sqrt(A(j, j));
    for (int i = j + 1; i < n; ++i) {
      for (int k = 0; k < j; ++k) A(i, j) -= A(i, k) * A(j, k);
      A(i, j) /= A(j, j);
    }
    for (int k = 0; k < j; ++k) b[j] -= A(j, k) * b[k];
    b[j] /= A(j, j);
  }
  for (int j = n - 1; j >= 0; --j) {
    for (int i = j + 1; i < n; ++i) b[j] -= A(i, j) * b[i];
    b[j] /= A(j, j);
  }
  return b;
}

template <class S>
ChainEnergy<S> energy_of(const Chain& chain, const JointVector<S>& q, const JointVector<S>& qd,
                         const Eigen::Vector3d& gravity) {
  require_sizes(chain, "energy of a chain", q, qd);
  const ChainFrames<S> frames = frames_of(chain, q);
  ChainEnergy<S> out;
  Vector3<S> v = Vector3<S>::Zero(), w = Vector3<S>::Zero(), at = Vector3<S>::Zero();
  for (int i = 0; i < chain.size(); ++i) {
    const Inertia& link = chain.joints[i].link;
    const Transform<S>& frame = frames.links[i];
    v += cross(w, Vector3<S>(frame.p - at));
    at = frame.p;
    w += qd[i] * frame.R.col(2);
    const Vector3<S> arm = frame.R * link.com, com = v + cross(w, arm), own = frame.R.transpose() * w,
                     momentum = link.about_com * own;
    out.kinetic += 0.5 * (link.mass * com.dot(com) + own.dot(momentum));
    out.potential -= link.mass * gravity.dot(frame.p + arm);
  }
  return out;
}

extern template JointVector<double> inverse_dynamics(const Chain&, const JointVector<double>&,
                                                     const JointVector<double>&, const JointVector<double>&,
                                                     const Eigen::Vector3d&);
extern template JointVector<Dual> inverse_dynamics(const Chain&, const JointVector<Dual>&,
                                                   const JointVector<Dual>&, const JointVector<Dual>&,
                                                   const Eigen::Vector3d&);
extern template JointMatrix<double> mass_matrix(const Chain&, const JointVector<double>&);
extern template JointMatrix<Dual> mass_matrix(const Chain&, const JointVector<Dual>&);
extern template JointMatrix<double> coriolis_matrix(const Chain&, const JointVector<double>&,
                                                    const JointVector<double>&);
extern template JointMatrix<Dual> coriolis_matrix(const Chain&, const JointVector<Dual>&,
                                                  const JointVector<Dual>&);
extern template JointVector<double> solve_positive(JointMatrix<double>, JointVector<double>);
extern template JointVector<Dual> solve_positive(JointMatrix<Dual>, JointVector<Dual>);
extern template ChainEnergy<double> energy_of(const Chain&, const JointVector<double>&,
                                              const JointVector<double>&, const Eigen::Vector3d&);
extern template ChainEnergy<Dual> energy_of(const Chain&, const JointVector<Dual>&, const JointVector<Dual>&,
                                            const Eigen::Vector3d&);

}  // namespace unhand::planners
