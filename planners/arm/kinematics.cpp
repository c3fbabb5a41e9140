#include "planners/arm/kinematics.hpp"

#include <algorithm>

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

double lowest_height(const Chain& chain, const ChainFrames<double>& frames) {
  double out = frames.tip.p.z();
  for (int i = 2; i < chain.size(); ++i) out = std::min(out, frames.links[i].p.z());
  return out;
}

}  // namespace unhand::planners
