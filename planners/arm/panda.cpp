#include "planners/arm/panda.hpp"

#include <fmt/format.h>

#include <numbers>

namespace unhand::planners {
namespace {

struct Row {
  double a, quarter_turns, d;                                 // m, α/(π/2), m
  double lower, upper, velocity, acceleration, jerk, torque;  // rad, …, N m
  double mass, com[3], inertia[6];                            // kg, m, kg m² (xx, yy, zz, xy, xz, yz)
  double friction[3];                                         // φ₁ [N m], φ₂ [s/rad], φ₃ [rad/s]
};

constexpr Row rows[]{
    {0,
     0,
     0.333,
     -2.8973,
     2.8973,
     2.1750,
     15,
     7500,
     87,
     4.970684,
     {3.875e-3, 2.081e-3, -4.762e-2},
     {7.0337e-1, 7.0661e-1, 9.1170e-3, -1.3900e-4, 6.7720e-3, 1.9169e-2},
     {0.54615, 5.1181, 0.039533}},
    {0,
     -1,
     0,
     -1.7628,
     1.7628,
     2.1750,
     7.5,
     3750,
     87,
     0.646926,
     {-3.141e-3, -2.872e-2, 3.495e-3},
     {7.9620e-3, 2.8110e-2, 2.5995e-2, -3.9250e-3, 1.0254e-2, 7.0400e-4},
     {0.87224, 9.0657, 0.025882}},
    {0,
     1,
     0.316,
     -2.8973,
     2.8973,
     2.1750,
     10,
     5000,
     87,
     3.228604,
     {2.7518e-2, 3.9252e-2, -6.6502e-2},
     {3.7242e-2, 3.6155e-2, 1.0830e-2, -4.7610e-3, -1.1396e-2, -1.2805e-2},
     {0.64068, 10.136, -0.04607}},
    {0.0825,
     1,
     0,
     -3.0718,
     -0.0698,
     2.1750,
     12.5,
     6250,
     87,
     3.587895,
     {-5.317e-2, 1.04419e-1, 2.7454e-2},
     {2.5853e-2, 1.9552e-2, 2.8323e-2, 7.7960e-3, -1.3320e-3, 8.6410e-3},
     {1.2794, 5.5903, 0.036194}},
    {-0.0825,
     -1,
     0.384,
     -2.8973,
     2.8973,
     2.6100,
     15,
     7500,
     12,
     1.225946,
     {-1.1953e-2, 4.1065e-2, -3.8437e-2},
     {3.5549e-2, 2.9474e-2, 8.6270e-3, -2.1170e-3, -4.0370e-3, 2.2900e-4},
     {0.83904, 8.3469, 0.026226}},
    {0,
     1,
     0,
     -0.0175,
     3.7525,
     2.6100,
     20,
     10000,
     12,
     1.666555,
     {6.0149e-2, -1.4117e-2, -1.0517e-2},
     {1.9640e-3, 4.3540e-3, 5.4330e-3, 1.0900e-4, -1.1580e-3, 3.4100e-4},
     {0.30301, 17.133, -0.021047}},
    {0.088,
     1,
     0,
     -2.8973,
     2.8973,
     2.6100,
     20,
     10000,
     12,
     7.35522e-1,
     {1.0517e-2, -4.252e-3, 6.1597e-2},
     {1.2516e-2, 1.0027e-2, 4.8150e-3, -4.2800e-4, -1.1960e-3, -7.4100e-4},
     {0.56489, 10.336, 0.0035526}},
};

}  // namespace

Chain panda() {
  Chain out{"panda", {}, modified_dh(0, 0, 0.107)};
  for (const Row& r : rows) {
    const auto& c = r.com;
    const auto& i = r.inertia;
    const auto& f = r.friction;
    out.joints.push_back({fmt::format("panda_joint{}", out.joints.size() + 1),
                          modified_dh(r.a, r.quarter_turns * std::numbers::pi / 2, r.d),
                          {r.mass, {c[0], c[1], c[2]}, symmetric(i[0], i[1], i[2], i[3], i[4], i[5])},
                          {r.lower, r.upper, r.velocity, r.acceleration, r.jerk, r.torque},
                          {f[0], f[1], f[2]}});
  }
  validate(out);
  return out;
}

JointVector<double> panda_ready() {
  constexpr double pi = std::numbers::pi;
  return JointVector<double>{{0, -pi / 4, 0, -3 * pi / 4, 0, pi / 2, pi / 4}};
}

}  // namespace unhand::planners
