#include "planners/control/regressor.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace unhand::planners::control {

LinkParameters parameters_of(const Inertia& body) {
  const Eigen::Vector3d& c = body.com;
  const Eigen::Matrix3d I =
      body.about_com + body.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  LinkParameters out;
  out << body.mass, body.mass * c, I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2);
  return out;
}

Inertia inertia_from(const LinkParameters& p) {
  if (!(p[0] > 0)) throw std::invalid_argument(fmt::format("inertia: mass {} kg; accepted: > 0", p[0]));
  Inertia out;
  out.mass = p[0];
  out.com = p.segment<3>(1) / p[0];
  const Eigen::Vector3d& c = out.com;
  out.about_com = symmetric(p[4], p[5], p[6], p[7], p[8], p[9]) -
                  out.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  return out;
}

Eigen::VectorXd parameters_of(const Chain& chain) {
  Eigen::VectorXd out(kLinkParameters * chain.size());
  for (int i = 0; i < chain.size(); ++i)
    out.segment<kLinkParameters>(kLinkParameters * i) = parameters_of(chain.joints[i].link);
  return out;
}

Regressor<double> momentum_rest_regressor(const Chain& chain, const JointVector<double>& q,
                                          const JointVector<double>& qd, const Eigen::Vector3d& gravity,
                                          int first) {
  using Along = dynamics::DualOf<1>;  // derivative along the motion
  const int n = chain.size();
  JointVector<Along> moving(n), fixed(n);
  for (int i = 0; i < n; ++i) {
    moving[i] = Along(q[i]);
    moving[i].v[0] = qd[i];
    fixed[i] = Along(qd[i]);
  }
  const Regressor<Along> rate = momentum_regressor<Along>(chain, moving, fixed, first);
  const JointVector<double> none = JointVector<double>::Zero(n);
  Regressor<double> out = torque_regressor<double>(chain, q, qd, none, gravity, first);  // C q̇ + g
  for (int i = 0; i < out.rows(); ++i)
    for (int j = 0; j < out.cols(); ++j) out(i, j) -= rate(i, j).v[0];
  return out;
}

template Regressor<double> torque_regressor(const Chain&, const JointVector<double>&,
                                            const JointVector<double>&, const JointVector<double>&,
                                            const Eigen::Vector3d&, int);

}  // namespace unhand::planners::control
