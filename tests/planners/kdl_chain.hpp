// A chain as the Orocos Kinematics and Dynamics Library sees it: the oracle of the arm's tests.
#pragma once

#include <kdl/chain.hpp>

#include "planners/arm/chain.hpp"

namespace unhand::planners {

inline KDL::Frame kdl_frame(const Transform<double>& at) {
  const auto& R = at.R;
  return {KDL::Rotation(R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1), R(2, 2)),
          KDL::Vector(at.p[0], at.p[1], at.p[2])};
}

/// A KDL segment turns about its start and then goes on to its end, in whose frame its inertia is given: so a
/// joint's origin is the end of the segment before.
inline KDL::Chain kdl_chain(const Chain& chain) {
  KDL::Chain out;
  out.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::None), kdl_frame(chain.joints.front().origin)));
  for (int i = 0; i < chain.size(); ++i) {
    const Transform<double>& end = i + 1 < chain.size() ? chain.joints[i + 1].origin : chain.tip;
    const Inertia body = seen_from(inverse(end), chain.joints[i].link);
    const auto& c = body.com;
    const auto& I = body.about_com;
    const KDL::RotationalInertia inertia(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
    out.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::RotZ), kdl_frame(end),
                                KDL::RigidBodyInertia(body.mass, KDL::Vector(c[0], c[1], c[2]), inertia)));
  }
  return out;
}

}  // namespace unhand::planners
