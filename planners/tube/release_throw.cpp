#include "planners/tube/release_throw.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "contact/registry.hpp"
#include "flight/fly.hpp"
#include "planners/tube/card_pads.hpp"
#include "planners/tube/held_motion.hpp"
#include "planners/tube/require.hpp"
#include "planners/tube/throw_once.hpp"
#include "release/simulate_release.hpp"

namespace unhand::planners {

using dynamics::Dual;
using dynamics::independent;

const char* name_of(Unknown unknown) {
  switch (unknown) {
    case kMu:
      return "mu";
    case kDeadTime:
      return "dead_time";
    case kOpeningTime:
      return "opening_time";
    case kComOffset:
      return "com_offset";
    case kGraspAngle:
      return "grasp_angle";
    case kLength:
      return "length";
    case kShape:
      return "shape";
    case kMass:
      return "mass";
    case kInertia:
      return "inertia";
    case kUnknowns:
      break;
  }
  return "unknown";
}

double most_of(int unknown) {
  return unknown == kMu ? contact::kMostMu : unknown == kLength ? contact::kUniformDisc : HUGE_VAL;
}

bool has_sign(int unknown) { return unknown == kComOffset || unknown == kGraspAngle; }

std::array<Uncertain, kUnknowns> unknowns_of(const ReleaseThrow& p) {
  const Uncertain& com = p.object.com_offset;
  return {p.card.mu,
          p.card.dead_time,
          p.card.opening_time,
          {com.value, std::hypot(com.sigma, p.card.grasp_offset)},
          {p.object.angle, p.card.grasp_angle},
          {p.card.length, p.card.length_sigma},
          {p.card.shape, p.card.shape_sigma},
          {p.object.mass, p.object.mass_sigma},
          {p.object.inertia, p.object.inertia_sigma}};
}

template <class S>
std::optional<Thrown<S>> throw_once(const ReleaseThrow& p, const release::HandMotion& hand,
                                    const std::array<S, kUnknowns>& draw) {
  const auto law = contact::make_contact_model(p.card.model, pads_of(p.card, draw[kMu], draw[kLength]));
  const contact::ProfileNormalForce pressed(contact::OpeningProfile<S>{
      0.0, S(p.card.grip_force), draw[kDeadTime], draw[kOpeningTime], draw[kShape]});
  std::optional<contact::AdhesiveForce> adhesive;
  if (p.card.friction.adhesion > 0)
    adhesive.emplace(pressed, Dual(p.card.friction.adhesion), Dual(p.card.friction.parting_time));
  const contact::NormalForce& force =
      adhesive ? static_cast<const contact::NormalForce&>(*adhesive) : pressed;
  const dynamics::Vec2<S> gravity{S(0.0), S(-p.medium.gravity)};
  if (!(force.release_time() < hand.end())) return {};
  const auto let_go = release::simulate_release<S>({hand,
                                                    force,
                                                    *law,
                                                    {draw[kMass], draw[kInertia]},
                                                    gravity,
                                                    {draw[kComOffset], draw[kGraspAngle]},
                                                    hand.begin(),
                                                    {},
                                                    S(0.0)});
  if (let_go.outcome != release::ReleaseOutcome::detached) return {};
  flight::FlightProblem<S> flight{let_go.detach.pose, let_go.detach.twist, gravity};
  flight.drag_k = S(p.medium.drag_k);
  flight.landing_height = S(p.target.z());
  const auto flown = flight::fly(flight);
  if (flown.outcome != flight::FlightOutcome::landed) return {};
  const auto& twist = let_go.detach.twist;
  return Thrown<S>{
      flown.landing.pose.x, let_go.detach.time, dynamics::value_of(let_go.relative.angle - draw[kGraspAngle]),
      std::hypot(dynamics::value_of(twist.vx), dynamics::value_of(twist.vz)), let_go.slips_at_start};
}

template std::optional<Thrown<double>> throw_once(const ReleaseThrow&, const release::HandMotion&,
                                                  const std::array<double, kUnknowns>&);
template std::optional<Thrown<Dual>> throw_once(const ReleaseThrow&, const release::HandMotion&,
                                                const std::array<Dual, kUnknowns>&);

PlanarHand hand_of(const ReleaseThrow& p, const JointVector<Dual>& qd, const JointVector<Dual>& qdd) {
  const ThrowPlane plane(forward_kinematics(p.chain, p.start.q).p, p.target);
  return {p.chain, plane, p.start.q, qd, qdd, p.hold};
}
PlanarHand hand_of(const ReleaseThrow& p) { return hand_of(p, p.start.qd.cast<Dual>(), p.qdd.cast<Dual>()); }

Draw nominal_draw(const ReleaseThrow& problem) {
  validate(problem);
  Draw out{};
  const auto unknowns = unknowns_of(problem);
  for (int k = 0; k < kUnknowns; ++k) out[k] = unknowns[k].value;
  return out;
}

std::optional<ReleaseLanding> release_landing(const ReleaseThrow& problem, const Draw& draw) {
  validate(problem);
  const auto thrown = throw_once<double>(problem, hand_of(problem), draw);
  if (!thrown) return {};
  return ReleaseLanding{thrown->miss, thrown->detach_time, thrown->angle, thrown->speed};
}

std::optional<ReleaseLanding> rigid_landing(const ReleaseThrow& problem, double com_offset, double delay) {
  validate(problem);
  if (!(delay >= 0 && delay <= problem.hold))
    throw std::invalid_argument(fmt::format("delay {} is not in [0, {}] s", delay, problem.hold));
  const PlanarHand motion = hand_of(problem);
  const auto hand = motion.at({0, problem.hold}, delay);
  const double angle = hand.pose.theta + problem.object.angle, omega = hand.twist.omega;
  const dynamics::Vec2<double> r = rotate(angle, dynamics::Vec2<double>{com_offset, 0});
  flight::FlightProblem<double> flight{{hand.pose.x + r.x, hand.pose.z + r.z, angle},
                                       {hand.twist.vx - omega * r.z, hand.twist.vz + omega * r.x, omega},
                                       {0, -problem.medium.gravity}};
  flight.drag_k = problem.medium.drag_k;
  flight.landing_height = problem.target.z();
  const auto flown = flight::fly(flight);
  if (flown.outcome != flight::FlightOutcome::landed) return {};
  return ReleaseLanding{flown.landing.pose.x, delay, 0, std::hypot(flight.twist.vx, flight.twist.vz)};
}

std::optional<ReleaseSpread> release_spread(const ReleaseThrow& problem) {
  validate(problem);
  const auto unknowns = unknowns_of(problem);
  const PlanarHand hand = hand_of(problem);
  ReleaseSpread out;
  for (int first = 0; first < kUnknowns; first += dynamics::kDualSize) {
    const int end = std::min<int>(kUnknowns, first + dynamics::kDualSize);
    std::array<Dual, kUnknowns> draw;
    for (int k = 0; k < kUnknowns; ++k)
      draw[k] = k >= first && k < end ? independent(unknowns[k].value, k - first) : Dual(unknowns[k].value);
    const auto thrown = throw_once<Dual>(problem, hand, draw);
    if (!thrown) return {};
    out.miss = thrown->miss.a;
    for (int k = first; k < end; ++k) {
      out.gradient[k] = thrown->miss.v[k - first];
      out.spread = std::hypot(out.spread, out.gradient[k] * unknowns[k].sigma);
    }
  }
  return out;
}

void summarise(Landings& out) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const auto n = static_cast<double>(out.miss.size());
  out.mean = n > 0 ? 0 : kNone;
  for (const double x : out.miss) out.mean += x / n;
  double square = n > 1 ? 0 : kNone;
  for (const double x : out.miss) square += (x - out.mean) * (x - out.mean) / (n - 1);
  out.std = std::sqrt(square);
}

Draw Draws::next() {
  constexpr int kAttempts = 1000;
  Draw out{};
  for (int k = 0; k < kUnknowns; ++k) {
    const Uncertain& one = unknowns_[k];
    out[k] = one.value;
    for (int attempt = 0; one.sigma != 0 && attempt < kAttempts; ++attempt) {
      const double x = one.value + one.sigma * normal_(random_);
      if (!(has_sign(k) || x >= 0) || x > most_of(k)) continue;
      out[k] = x;
      break;
    }
  }
  return out;
}

Landings draw_landings(const ReleaseThrow& problem, int count, std::uint64_t seed, const HeldMotion* before) {
  validate(problem);
  require(count >= 1, "draw_landings", "count", count, "[1, inf)");
  Draws draws(problem, seed);
  const PlanarHand hand = hand_of(problem);
  Landings out;
  for (int i = 0; i < count; ++i) {
    const Draw draw = draws.next();
    const bool held = before == nullptr || before->holds(draw);
    const auto thrown = held ? throw_once<double>(problem, hand, draw) : std::nullopt;
    if (thrown && !thrown->slips_at_start)
      out.miss.push_back(thrown->miss);
    else
      ++out.lost;
  }
  summarise(out);
  return out;
}

}  // namespace unhand::planners
