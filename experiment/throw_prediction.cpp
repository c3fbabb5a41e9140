#include "experiment/throw_prediction.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "contact/registry.hpp"

namespace unhand::experiment {

using dynamics::convert;
using dynamics::Dual;
using dynamics::Pose;
using dynamics::value_of;
using dynamics::Values;
using dynamics::Vec2;
using dynamics::Window;

namespace {

template <class Table>
void append(std::vector<dynamics::Effect>& out, const Table& table) {
  for (const auto& entry : table) out.push_back(entry.effect);
}

bool is_active(double x) { return x != 0; }
bool is_active(const Dual& x) { return x.a != 0 || !x.v.isZero(); }

/// Everything that effects may change, each folder's part in its own struct.
template <class S>
struct Setup {
  contact::FrictionVariation<S> friction;
  release::Lateness<S> late;
  dynamics::Gravity<S> gravity;
  flight::Air<S> air;
  Sensing<S> sensing;

  explicit Setup(const Values<S>& values) {
    dynamics::apply_effects(contact::friction_effects(), values, friction);
    dynamics::apply_effects(release::lateness_effects(), values, late);
    dynamics::apply_effects(dynamics::gravity_effects(), values, gravity);
    dynamics::apply_effects(flight::air_effects(), values, air);
    dynamics::apply_effects(sensor_effects(), values, sensing);
  }
};

/// The normal force that the object feels: the logged one or a profile, with the effects on it wrapped
/// around.
template <class S>
class FeltForce {
 public:
  FeltForce(const PreparedThrow& prepared, const Setup<S>& setup, const Values<S>& values) {
    if (prepared.normal_force)
      force_ = &*prepared.normal_force;
    else
      wrap(std::make_unique<contact::ProfileNormalForce>(contact::OpeningProfile<Dual>{
          prepared.open_command, Dual(values.get("grip_force", 20)), Dual(values.get("dead_time", 0.01)),
          Dual(values.get("opening_time", 0.05)), Dual(values.get("shape", 1))}));
    if (is_active(setup.sensing.normal_force_bias))
      wrap(std::make_unique<contact::BiasedForce>(*force_, Dual(setup.sensing.normal_force_bias),
                                                  prepared.open_command));
    if (is_active(setup.late.opening_delay))
      wrap(std::make_unique<release::DelayedForce>(*force_, Dual(setup.late.opening_delay)));
    if (is_active(setup.friction.adhesion))
      wrap(std::make_unique<contact::AdhesiveForce>(*force_, Dual(setup.friction.adhesion),
                                                    Dual(setup.friction.parting_time)));
  }
  const contact::NormalForce& operator*() const { return *force_; }

 private:
  void wrap(std::unique_ptr<contact::NormalForce> outer) {
    force_ = outer.get();
    owned_.push_back(std::move(outer));
  }
  const contact::NormalForce* force_{};
  std::vector<std::unique_ptr<contact::NormalForce>> owned_;
};

template <class S>
Pose<S> tracked_pose(const Pose<S>& com, const S& com_error) {
  const Vec2<S> d = dynamics::rotate(com.theta, Vec2<S>{-com_error, S(0)});
  return {com.x + d.x, com.z + d.z, com.theta};
}

/// Reads the channels of one simulated throw, in the order of their time within the release.
template <class S>
class Reader {
 public:
  Reader(const release::ReleaseProblem<S>& problem, const release::ReleaseResult<S>& result,
         const flight::FlightProblem<S>& flight, const Setup<S>& setup)
      : problem_(problem), result_(result), flight_(flight), setup_(setup) {}

  /// Of one pad, in the hand frame.
  dynamics::Wrench<S> wrench(double t) const {
    const auto& s = setup_.sensing;
    dynamics::Wrench<S> out{s.bias_fx, s.bias_fz, s.bias_tau};
    if (t >= value_of(result_.detach.time) || result_.trajectory.empty()) return out;
    const auto sample = sample_release(problem_, result_, S(std::max(t, first())));
    const double share = 1.0 / pads_;
    const Vec2<S> f = dynamics::rotate(S(-sample.hand.pose.theta), sample.wrench.force());
    out.fx += share * f.x;
    out.fz += share * f.z;
    out.tau += share * sample.wrench.tau;
    return out;
  }

  /// As the tracker reports it at its stamp t.
  Pose<S> mocap(double stamp) const {
    const auto& s = setup_.sensing;
    const S t = stamp - s.mocap_time_offset;
    const Pose<S> pose = tracked_pose(com(t), s.com_offset);
    const S scale = 1.0 + s.length_scale;
    return {scale * pose.x, scale * pose.z, pose.theta};
  }

  void pads(int n) { pads_ = n; }

 private:
  double first() const { return value_of(result_.trajectory.pieces.front().t0); }

  Pose<S> com(const S& t) const {
    if (value_of(t) >= value_of(result_.detach.time)) return flying(t - result_.detach.time);
    if (value_of(t) >= first()) return sample_release(problem_, result_, t).pose;
    // Before the simulation starts: held, in the hand's motion continued backwards.
    const auto& piece = result_.trajectory.pieces.front();
    contact::Scene<S> scene;
    scene.hand = problem_.hand.at(piece.phase.window, t).pose;
    return contact::object_pose(scene, contact::Relative<S>::from(piece.nodes[0]));
  }

  /// `since` [s] after the detach; flights in air are integrated once, over the whole series.
  Pose<S> flying(const S& since) const {
    if (!in_air_) return flight::ballistic(flight_.pose, flight_.twist, flight_.gravity, since).pose;
    return flight::sample_flight(flown_, since);
  }

 public:
  /// Integrates the flight up to `longest` [s], where the air matters.
  void fly(double longest, const dynamics::IntegratorOptions& options) {
    in_air_ = is_active(flight_.drag_k) || is_active(flight_.lift_km);
    if (in_air_) flown_ = flight::record_flight(flight_, longest, options);
  }

 private:
  const release::ReleaseProblem<S>& problem_;
  const release::ReleaseResult<S>& result_;
  const flight::FlightProblem<S>& flight_;
  const Setup<S>& setup_;
  flight::RecordedFlight<S> flown_;
  bool in_air_{};
  int pads_{2};
};

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
ThrowPrediction<S> predict_channels(const PreparedThrow& prepared, const Observations& observed,
                                    const ThrowModel& model, const Values<S>& values) {
  Setup<S> setup(values);
  setup.friction.reference_force = model.reference_force;
  const FeltForce<S> force(prepared, setup, values);

  std::unique_ptr<release::LaggedHand> lagged;
  if (is_active(setup.late.tracking_lag))
    lagged = std::make_unique<release::LaggedHand>(prepared.hand, Dual(setup.late.tracking_lag));
  const release::HandMotion& hand = lagged ? static_cast<const release::HandMotion&>(*lagged) : prepared.hand;

  contact::ContactParameters<Dual> parameters;
  constexpr double kTorqueFactor = 2.0 / 3.0;  // of a uniform disc; only L = c a enters
  parameters.patch = {Dual(values.get("mu", 0.5) * (1.0 + values.get("mu_deviation", 0))),
                      Dual(values.get("length", 0.007) / kTorqueFactor), Dual(kTorqueFactor), model.pads};
  parameters.open_command = prepared.open_command;
  parameters.delay = Dual(values.get("delay", 0.05) + values.get("delay_deviation", 0));
  parameters.variation = contact::constant(setup.friction);
  const auto contact = contact::make_contact_model(model.contact_model, parameters);

  const Vec2<S> gravity = setup.gravity.at(-prepared.gravity.z);
  const auto& sensing = setup.sensing;
  const release::ReleaseProblem<S> problem{
      hand,
      *force,
      *contact,
      {prepared.body.mass * (1.0 + sensing.mass), prepared.body.inertia * (1.0 + sensing.inertia)},
      gravity,
      {prepared.grasp.com_offset + sensing.com_offset + values.get("grasp_offset", 0),
       prepared.grasp.angle + values.get("grasp_angle", 0)},
      prepared.start,
      {},
      S(0)};
  release::ReleaseOptions options{model.integrator, false};
  options.integrator.record = !observed.all.empty();
  const auto result = release::simulate_release(problem, options);

  ThrowPrediction<S> out;
  out.release = result.outcome;
  out.detach = result.detach;
  for (const auto& event : result.events) out.modes.push_back(event.mode_after);
  if (out.release != release::ReleaseOutcome::detached) return out;

  flight::FlightProblem<S> flight{result.detach.pose, result.detach.twist, gravity};
  flight.drag_k = prepared.drag_k + setup.air.extra_drag;
  flight.landing_height = S(prepared.landing_height);
  flight.tracked = {-sensing.com_offset, S(0)};
  flight.lift_km = setup.air.lift;
  flight.wind = setup.air.wind;
  const auto flown = flight::fly(flight, model.integrator);
  out.flight = flown.outcome;
  out.landing = flown.landing;
  if (!out.landed()) return out;

  double last = value_of(result.detach.time);
  for (const auto& o : observed.all) last = std::max(last, o.time);
  Reader<S> reader(problem, result, flight, setup);
  reader.pads(model.pads);
  reader.fly(last - value_of(result.detach.time) + 0.1, model.integrator);
  out.channels.reserve(observed.all.size());
  dynamics::Wrench<S> wrench;
  Pose<S> pose;
  const S landing_scale = 1.0 + sensing.landing_share * sensing.length_scale;
  double wrench_at = NAN, pose_at = NAN;  // the columns of a sample share one evaluation
  for (const auto& o : observed.all) {
    switch (o.channel) {
      case Channel::wrench_fx:
      case Channel::wrench_fz:
      case Channel::wrench_tau:
        if (o.time != wrench_at) wrench = reader.wrench(o.time);
        wrench_at = o.time;
        out.channels.push_back(o.channel == Channel::wrench_fx   ? wrench.fx
                               : o.channel == Channel::wrench_fz ? wrench.fz
                                                                 : wrench.tau);
        break;
      case Channel::normal_force:
        out.channels.push_back(sensing.normal_force_bias);
        break;
      case Channel::mocap_x:
      case Channel::mocap_z:
      case Channel::mocap_theta:
        if (o.time != pose_at) pose = reader.mocap(o.time);
        pose_at = o.time;
        out.channels.push_back(o.channel == Channel::mocap_x   ? pose.x
                               : o.channel == Channel::mocap_z ? pose.z
                                                               : pose.theta);
        break;
      case Channel::landing_x:
        out.channels.push_back(landing_scale * out.landing.pose.x);
        break;
      case Channel::landing_theta:
        out.channels.push_back(out.landing.pose.theta);
        break;
      case Channel::landing_time:
        out.channels.push_back(result.detach.time + out.landing.flight_time);
        break;
    }
  }
  return out;
}

template ThrowPrediction<double> predict_channels(const PreparedThrow&, const Observations&,
                                                  const ThrowModel&, const Values<double>&);
template ThrowPrediction<Dual> predict_channels(const PreparedThrow&, const Observations&, const ThrowModel&,
                                                const Values<Dual>&);

}  // namespace unhand::experiment
