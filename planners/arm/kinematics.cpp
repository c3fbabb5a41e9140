#include "planners/arm/kinematics.hpp"

namespace unhand::planners {

template ChainFrames<double> frames_of(const Chain&, const JointVector<double>&);
template ChainFrames<Dual> frames_of(const Chain&, const JointVector<Dual>&);
template Jacobian<double> jacobian(const Chain&, const ChainFrames<double>&);
template Jacobian<Dual> jacobian(const Chain&, const ChainFrames<Dual>&);
template Jacobian<double> jacobian(const Chain&, const JointVector<double>&);
template Jacobian<Dual> jacobian(const Chain&, const JointVector<Dual>&);
template TipMotion<double> tip_motion(const Chain&, const JointVector<double>&, const JointVector<double>&,
                                      const JointVector<double>&);
template TipMotion<Dual> tip_motion(const Chain&, const JointVector<Dual>&, const JointVector<Dual>&,
                                    const JointVector<Dual>&);

}  // namespace unhand::planners
