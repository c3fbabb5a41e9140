#include "experiment/throw_setup.hpp"

#include <algorithm>
#include <cmath>

#include "experiment/doubtful_force.hpp"
#include "experiment/sample_window.hpp"

namespace unhand::experiment {

using dynamics::Dual;
using dynamics::Pose;
using dynamics::value_of;
using dynamics::Vec2;

namespace {

template <class Table>
void append(std::vector<dynamics::Effect>& out, const Table& table) {
  for (const auto& entry : table) out.push_back(entry.effect);
}

template <class S>
Pose<S> tracked_pose(const Pose<S>& com, const S& com_error) {
  const Vec2<S> d = dynamics::rotate(com.theta, Vec2<S>{-com_error, S(0)});
  return {com.x + d.x, com.z + d.z, com.theta};
}

}  // namespace

std::vector<dynamics::Effect> known_effects() {
  std::vector<dynamics::Effect> out;
  append(out, contact::friction_effects());
  append(out, release::lateness_effects());
  append(out, flight::air_effects());
  append(out, dynamics::gravity_effects());
  append(out, sensor_effects());
  return out;
}

template <class S>
ThrowSetup<S>::ThrowSetup(const dynamics::Values<S>& values) {
  dynamics::apply_effects(contact::friction_effects(), values, friction);
  dynamics::apply_effects(release::lateness_effects(), values, late);
  dynamics::apply_effects(dynamics::gravity_effects(), values, gravity);
  dynamics::apply_effects(flight::air_effects(), values, air);
  dynamics::apply_effects(sensor_effects(), values, sensing);
}

template <class S>
void FeltForce<S>::wrap(std::unique_ptr<contact::NormalForce> outer) {
  force_ = outer.get();
  owned_.push_back(std::move(outer));
}
template <class S>
void FeltForce<S>::doubt(const contact::NormalForceSummary& ramp, const S& deviation) {
  if (!dynamics::is_zero(deviation) && DoubtfulForce::applies_to(ramp))
    wrap(std::make_unique<DoubtfulForce>(*force_, ramp, Dual(deviation)));
}
template <class S>
void FeltForce<S>::correct(const ThrowSetup<S>& setup, double opening_start) {
  if (!dynamics::is_zero(setup.sensing.normal_force_bias))
    wrap(std::make_unique<contact::BiasedForce>(*force_, Dual(setup.sensing.normal_force_bias),
                                                opening_start));
  if (!dynamics::is_zero(setup.sensing.ft_time_offset))
    wrap(std::make_unique<release::DelayedForce>(*force_, Dual(-setup.sensing.ft_time_offset)));
}
template <class S>
void FeltForce<S>::act(const ThrowSetup<S>& setup) {
  if (!dynamics::is_zero(setup.late.opening_delay))
    wrap(std::make_unique<release::DelayedForce>(*force_, Dual(setup.late.opening_delay)));
  if (!dynamics::is_zero(setup.friction.adhesion))
    wrap(std::make_unique<contact::AdhesiveForce>(*force_, Dual(setup.friction.adhesion),
                                                  Dual(setup.friction.parting_time)));
}

template <class S>
flight::FlightProblem<S> flight_from(const release::DetachState<S>& detach, const Vec2<S>& gravity,
                                     double declared_drag, double landing_height,
                                     const ThrowSetup<S>& setup) {
  flight::FlightProblem<S> flight{detach.pose, detach.twist, gravity};
  flight.drag_k = declared_drag + setup.air.extra_drag;
  // A tracker that tells the landing's place tells its height, too: at this true height it reads the declared
  // one.
  flight.landing_height = landing_height / (1.0 + setup.sensing.landing_share * setup.sensing.length_scale);
  flight.tracked = {-setup.sensing.com_offset, S(0)};
  flight.lift_km = setup.air.lift;
  flight.wind = setup.air.wind;
  return flight;
}

template <class S>
ThrowReader<S>::ThrowReader(const release::ReleaseProblem<S>& problem,
                            const release::ReleaseResult<S>& result, const flight::FlightProblem<S>& flight,
                            const ThrowSetup<S>& setup, int pads)
    : problem_(problem), result_(result), flight_(flight), setup_(setup), pads_(pads) {}

template <class S>
void ThrowReader<S>::fly(double longest, const dynamics::IntegratorOptions& options) {
  in_air_ = !flight::is_ballistic(flight_);
  if (in_air_) flown_ = flight::record_flight(flight_, longest, options);
}

template <class S>
dynamics::Wrench<S> ThrowReader<S>::wrench(double stamp) const {
  const auto& s = setup_.sensing;
  const S t = stamp - s.ft_time_offset;
  dynamics::Wrench<S> out{s.bias_fx, s.bias_fz, s.bias_tau};
  if (value_of(t) >= value_of(result_.detach.time) - kAtSample || result_.trajectory.empty()) return out;
  const S held = value_of(t) < first() ? S(first()) : t;
  auto sample = sample_release(problem_, result_, held);
  // Where slip sets in at this very instant, its direction exists only as the limit from the right.
  if (!std::isfinite(value_of(sample.wrench.fx) + value_of(sample.wrench.fz) + value_of(sample.wrench.tau)))
    sample = sample_release(problem_, result_, S(held + kAtSample));
  const double share = 1.0 / pads_;
  const Vec2<S> f = dynamics::rotate(S(-sample.hand.pose.theta), sample.wrench.force());
  out.fx += share * f.x;
  out.fz += share * f.z;
  out.tau += share * sample.wrench.tau;
  return out;
}

template <class S>
Pose<S> ThrowReader<S>::mocap(double stamp) const {
  const auto& s = setup_.sensing;
  const S t = stamp - s.mocap_time_offset;
  const Pose<S> pose = tracked_pose(com(t), s.com_offset);
  const S scale = 1.0 + s.length_scale;
  return {scale * pose.x, scale * pose.z, pose.theta};
}

template <class S>
S ThrowReader<S>::landing_x(const S& x) const {
  return (1.0 + setup_.sensing.landing_share * setup_.sensing.length_scale) * x;
}

template <class S>
double ThrowReader<S>::first() const {
  return value_of(result_.trajectory.pieces.front().t0);
}

template <class S>
Pose<S> ThrowReader<S>::com(const S& t) const {
  if (value_of(t) >= value_of(result_.detach.time)) return flying(t - result_.detach.time);
  const bool held = !result_.trajectory.empty();  // not free from the start
  if (held && value_of(t) >= first()) return sample_release(problem_, result_, t).pose;
  // Before the simulation starts: held, in the hand's motion continued backwards.
  contact::Scene<S> scene;
  scene.hand = problem_.hand.at({problem_.start, problem_.hand.end()}, t).pose;
  return contact::object_pose(
      scene,
      held ? contact::Relative<S>::from(result_.trajectory.pieces.front().nodes[0]) : result_.relative);
}

/// `since` [s] after the detach; flights in air were integrated once, over the whole series.
template <class S>
Pose<S> ThrowReader<S>::flying(const S& since) const {
  if (!in_air_) return flight::ballistic(flight_.pose, flight_.twist, flight_.gravity, since).pose;
  return flight::sample_flight(flown_, since);
}

template struct ThrowSetup<double>;
template struct ThrowSetup<Dual>;
template class FeltForce<double>;
template class FeltForce<Dual>;
template class ThrowReader<double>;
template class ThrowReader<Dual>;
template flight::FlightProblem<double> flight_from(const release::DetachState<double>&, const Vec2<double>&,
                                                   double, double, const ThrowSetup<double>&);
template flight::FlightProblem<Dual> flight_from(const release::DetachState<Dual>&, const Vec2<Dual>&, double,
                                                 double, const ThrowSetup<Dual>&);

}  // namespace unhand::experiment
