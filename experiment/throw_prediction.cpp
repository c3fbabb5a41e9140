#include "experiment/throw_prediction.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "contact/patch.hpp"
#include "contact/registry.hpp"

namespace unhand::experiment {

using dynamics::Dual;
using dynamics::Pose;
using dynamics::value_of;
using dynamics::Values;
using dynamics::Vec2;

namespace {

/// The logged normal force or a profile, with the effects on it.
template <class S>
FeltForce<S> felt_force(const PreparedThrow& prepared, const ThrowSetup<S>& setup, const Values<S>& values) {
  if (prepared.normal_force) {
    FeltForce<S> force(*prepared.normal_force);
    force.doubt(prepared.force_fit, values.get("force_deviation", 0));
    // The smoothing fades the bias out over the measured ramp, not from the command on.
    const double start = prepared.force_fit.opening_start;
    force.correct(setup, std::isfinite(start) ? start : prepared.open_command);
    force.act(setup);
    return force;
  }
  FeltForce<S> force(std::make_unique<contact::ProfileNormalForce>(contact::OpeningProfile<Dual>{
      prepared.open_command, Dual(values.get("grip_force", 20)),
      Dual(values.get("dead_time", 0.01) + values.get("dead_time_deviation", 0)),
      Dual(values.get("opening_time", 0.05)), Dual(values.get("shape", 1))}));
  force.act(setup);
  return force;
}

/// Simulates the release and hands `use` what went into it and what came out.
template <class S, class Use>
auto with_release(const PreparedThrow& prepared, const ThrowModel& model, const Values<S>& values,
                  bool record, const Use& use) {
  ThrowSetup<S> setup(values);
  setup.friction.reference_force = model.reference_force;
  const FeltForce<S> force = felt_force(prepared, setup, values);

  std::unique_ptr<release::LaggedHand> lagged;
  if (!dynamics::is_zero(setup.late.tracking_lag))
    lagged = std::make_unique<release::LaggedHand>(prepared.hand, Dual(setup.late.tracking_lag));
  const release::HandMotion& hand = lagged ? static_cast<const release::HandMotion&>(*lagged) : prepared.hand;

  contact::ContactParameters<Dual> parameters;
  parameters.patch =
      contact::Patch<Dual>::of_length(Dual(values.get("mu", 0.5) * (1.0 + values.get("mu_deviation", 0))),
                                      Dual(values.get("length", contact::kFingerLength)), model.pads);
  parameters.open_command = prepared.open_command;
  parameters.delay = Dual(values.get("delay", 0.05) + values.get("delay_deviation", 0));
  parameters.variation = contact::constant(setup.friction);
  for (const auto& p : contact::law_parameters(model.contact_model))
    parameters.law_values.emplace(p.name, Dual(values.get(p.name, p.start)));
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
       prepared.grasp.angle + values.get("grasp_angle", 0), values.get("grasp_across", 0)},
      prepared.start,
      {},
      S(0)};
  release::ReleaseOptions options{model.integrator, false};
  options.integrator.record = record;
  return use(setup, problem, release::simulate_release(problem, options));
}

}  // namespace

template <class S>
ThrowPrediction<S> predict_channels(const PreparedThrow& prepared, const Observations& observed,
                                    const ThrowModel& model, const Values<S>& values) {
  const auto read = [&](const ThrowSetup<S>& setup, const release::ReleaseProblem<S>& problem,
                        const release::ReleaseResult<S>& result) {
    ThrowPrediction<S> out;
    out.release = result.outcome;
    out.detach = result.detach;
    for (const auto& event : result.events) out.modes.push_back(event.mode_after);
    out.slips_at_start = result.slips_at_start;
    if (out.release != release::ReleaseOutcome::detached) return out;

    const auto flight =
        flight_from(result.detach, problem.gravity, prepared.drag_k, prepared.landing_height, setup);
    const auto flown = flight::fly(flight, model.integrator);
    out.flight = flown.outcome;
    out.landing = flown.landing;
    if (!out.landed()) return out;

    double last = value_of(result.detach.time);
    for (const auto& o : observed.all) last = std::max(last, o.time);
    ThrowReader<S> reader(problem, result, flight, setup, model.pads);
    reader.fly(last - value_of(result.detach.time) + 0.1, model.integrator);
    out.channels.reserve(observed.all.size());
    dynamics::Wrench<S> wrench;
    Pose<S> pose;
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
          out.channels.push_back(setup.sensing.normal_force_bias);
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
          out.channels.push_back(reader.landing_x(out.landing.pose.x));
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
  };
  return with_release(prepared, model, values, !observed.all.empty(), read);
}

bool grip_holds(const PreparedThrow& prepared, const ThrowModel& model, const Values<double>& values) {
  const auto read = [&](const auto&, const auto&, const release::ReleaseResult<double>& result) {
    return !result.slips_at_start &&
           std::none_of(result.events.begin(), result.events.end(), [&](const auto& event) {
             return event.mode_after != event.mode_before && event.t < prepared.open_command - kClockRounding;
           });
  };
  return with_release(prepared, model, values, false, read);
}

void visit_release(const PreparedThrow& prepared, const ThrowModel& model, const Values<double>& values,
                   const UseOfRelease& use) {
  const auto hand_over = [&](const auto&, const auto& problem, const auto& result) { use(problem, result); };
  with_release(prepared, model, values, true, hand_over);
}

template ThrowPrediction<double> predict_channels(const PreparedThrow&, const Observations&,
                                                  const ThrowModel&, const Values<double>&);
template ThrowPrediction<Dual> predict_channels(const PreparedThrow&, const Observations&, const ThrowModel&,
                                                const Values<Dual>&);

}  // namespace unhand::experiment
