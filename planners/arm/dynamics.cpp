#include "planners/arm/dynamics.hpp"

namespace unhand::planners {

template JointVector<double> inverse_dynamics(const Chain&, const JointVector<double>&,
                                              const JointVector<double>&, const JointVector<double>&,
                                              const Eigen::Vector3d&);
template JointVector<Dual> inverse_dynamics(const Chain&, const JointVector<Dual>&, const JointVector<Dual>&,
                                            const JointVector<Dual>&, const Eigen::Vector3d&);
template JointMatrix<double> mass_matrix(const Chain&, const JointVector<double>&);
template JointMatrix<Dual> mass_matrix(const Chain&, const JointVector<Dual>&);
template JointMatrix<double> coriolis_matrix(const Chain&, const JointVector<double>&,
                                             const JointVector<double>&);
template JointMatrix<Dual> coriolis_matrix(const Chain&, const JointVector<Dual>&, const JointVector<Dual>&);
template JointVector<double> solve_positive(JointMatrix<double>, JointVector<double>);
template JointVector<Dual> solve_positive(JointMatrix<Dual>, JointVector<Dual>);
template ChainEnergy<double> energy_of(const Chain&, const JointVector<double>&, const JointVector<double>&,
                                       const Eigen::Vector3d&);
template ChainEnergy<Dual> energy_of(const Chain&, const JointVector<Dual>&, const JointVector<Dual>&,
                                     const Eigen::Vector3d&);

}  // namespace unhand::planners
