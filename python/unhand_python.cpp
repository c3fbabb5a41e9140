// The Python module `unhand`: releases and flights with NumPy arrays, and the throws of a log made ready for
// them. It is thin: units, frames, signs and errors are those of the C++ functions that it calls, and a name
// that it does not explain is explained there. Fits and discovery are the command's, whose --json is for
// other programs to read.
#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "contact/friction_effects.hpp"
#include "contact/registry.hpp"
#include "datasets/near_miss.hpp"
#include "datasets/throw_log.hpp"
#include "experiment/compare.hpp"
#include "flight/fly.hpp"
#include "release/simulate_release.hpp"

namespace py = pybind11;
using namespace pybind11::literals;

namespace unhand::python {
namespace {

using Two = std::array<double, 2>;
using Three = std::array<double, 3>;
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Hand = std::shared_ptr<release::HandMotion>;
using Force = std::shared_ptr<contact::NormalForce>;
using Law = std::shared_ptr<contact::ContactModel>;

Three three(const dynamics::Pose<double>& p) { return {p.x, p.z, p.theta}; }
Three three(const dynamics::Twist<double>& v) { return {v.vx, v.vz, v.omega}; }
Three three(const dynamics::Acceleration<double>& a) { return {a.ax, a.az, a.alpha}; }
Three three(const dynamics::Wrench<double>& w) { return {w.fx, w.fz, w.tau}; }

py::array_t<double> array_of(const Three& a) {
  return py::array_t<double>(static_cast<py::ssize_t>(a.size()), a.data());
}
template <std::size_t N>
py::array_t<double> array_of(const std::vector<std::array<double, N>>& rows) {
  py::array_t<double> out({rows.size(), N});
  std::copy_n(rows.empty() ? nullptr : rows.front().data(), rows.size() * N, out.mutable_data());
  return out;
}

/// The numbers of an array of shape (N,) or, with columns, (N, columns).
std::span<const double> numbers(const char* name, const Array& a, py::ssize_t columns = 0) {
  if (columns == 0 ? a.ndim() != 1 : a.ndim() != 2 || a.shape(1) != columns) {
    std::vector<py::ssize_t> shape(a.shape(), a.shape() + a.ndim());
    throw std::invalid_argument(fmt::format("{}: shape ({}) is not (N{})", name, fmt::join(shape, ", "),
                                            columns == 0 ? "," : fmt::format(", {}", columns)));
  }
  return {a.data(), static_cast<std::size_t>(a.size())};
}

dynamics::IntegratorOptions recorded(double rtol) {
  dynamics::IntegratorOptions options;
  options.tolerances = {rtol, 0.01 * rtol};
  options.record = true;
  return options;
}

/// A release, with everything that its problem refers to.
struct Release {
  Hand hand;
  Force force;
  Law law;
  release::ReleaseProblem<double> problem;
  release::ReleaseResult<double> result;
};

Release simulate(Hand hand, Force force, Law law, const dynamics::RigidBody<double>& body,
                 const dynamics::Vec2<double>& gravity, const release::Grasp<double>& grasp, double start,
                 double rtol) {
  const release::ReleaseProblem<double> problem{*hand, *force, *law, body, gravity, grasp, start, {}, 0};
  py::gil_scoped_release others_may_run;
  auto result = release::simulate_release(problem, {recorded(rtol), true});
  return {std::move(hand), std::move(force), std::move(law), problem, std::move(result)};
}

/// What a recorded release says at the instants `t`, by name.
py::dict sample(const Release& r, const Array& times) {
  std::vector<std::string_view> mode;
  std::vector<Three> pose, twist, wrench, hand_pose, hand_twist, hand_acceleration;
  std::vector<double> normal_force;
  std::vector<std::array<double, 6>> relative;
  const auto& pieces = r.result.trajectory.pieces;
  for (const double t : numbers("t", times)) {
    if (pieces.empty() || !(t >= pieces.front().t0 && t <= pieces.back().t1))
      throw std::out_of_range(fmt::format("t = {} s is not in [{}, {}] s, the time of the release", t,
                                          r.problem.start,
                                          pieces.empty() ? r.problem.start : pieces.back().t1));
    const auto s = release::sample_release(r.problem, r.result, t);
    mode.push_back(s.mode);
    pose.push_back(three(s.pose));
    twist.push_back(three(s.twist));
    wrench.push_back(three(s.wrench));
    hand_pose.push_back(three(s.hand.pose));
    hand_twist.push_back(three(s.hand.twist));
    hand_acceleration.push_back(three(s.hand.acceleration));
    normal_force.push_back(s.normal_force);
    relative.push_back(s.relative.state());
  }
  return py::dict("mode"_a = py::cast(mode), "pose"_a = array_of(pose), "twist"_a = array_of(twist),
                  "wrench"_a = array_of(wrench), "hand_pose"_a = array_of(hand_pose),
                  "hand_twist"_a = array_of(hand_twist), "hand_acceleration"_a = array_of(hand_acceleration),
                  "normal_force"_a =
                      py::array_t<double>(static_cast<py::ssize_t>(normal_force.size()), normal_force.data()),
                  "relative"_a = array_of(relative));
}

/// The log's answer where the throw has one.
template <class T>
py::object or_none(const std::optional<T>& value) {
  if (!value) return py::none();
  if constexpr (std::is_same_v<T, double>)
    return py::float_(*value);
  else
    return array_of(three(*value));
}

py::dict measured(const experiment::PreparedThrow& t) {
  const auto& m = t.measured;
  return py::dict("detach_time"_a = or_none(m.detach_time), "detach_pose"_a = or_none(m.detach_pose),
                  "detach_twist"_a = or_none(m.detach_twist), "landing_x"_a = or_none(m.landing_x),
                  "landing_theta"_a = or_none(m.landing_theta));
}

/// The departures of friction that `given` names as cards do ("contact.stribeck.v_s"). Adhesion is of the
/// normal force, not of a law.
contact::FrictionVariation<double> variation_of(const std::map<std::string, double>& given,
                                                double reference_force) {
  std::vector<std::string> known, names;
  for (const auto& entry : contact::friction_effects())
    if (entry.effect.id != "contact.adhesion")
      for (const auto& parameter : entry.effect.parameters)
        known.push_back(entry.effect.full_name(parameter));
  std::vector<double> values;
  for (const auto& [name, value] : given) {
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw std::invalid_argument(
          datasets::unknown_name(fmt::format("a law takes no effect '{}'", name), name, known));
    names.push_back(name);
    values.push_back(value);
  }
  contact::FrictionVariation<double> out;
  out.reference_force = reference_force;
  dynamics::apply_effects(contact::friction_effects(), dynamics::Values<double>(names, values), out);
  return out;
}

void add_inputs(py::module_& m) {
  py::class_<release::HandMotion, Hand>(m, "HandMotion", "How the hand moves (release/hand_motion.hpp).")
      .def_property_readonly("begin", &release::HandMotion::begin, "first instant at which it is known [s]")
      .def_property_readonly("end", &release::HandMotion::end, "last instant at which it is known [s]")
      .def_property_readonly("jumps", &release::HandMotion::jumps, "where the acceleration jumps [s]");
  py::class_<contact::NormalForce, Force>(m, "NormalForce",
                                          "The force of one pad over time (contact/normal_force.hpp).")
      .def_property_readonly("release_time", &contact::NormalForce::release_time,
                             "when the pads part [s]; inf: never");
  py::class_<contact::ContactModel, Law>(m, "ContactModel", "A friction law (contact/contact_model.hpp).")
      .def_property_readonly("name",
                             [](const contact::ContactModel& law) { return std::string(law.name()); });

  m.def(
      "hand_segments",
      [](double t_start, const Three& pose, const Three& twist,
         const std::vector<std::tuple<double, Three, Three>>& stretches) -> Hand {
        std::vector<release::HandSegment> segments;
        for (const auto& [t_end, a, j] : stretches)
          segments.push_back({t_end, {a[0], a[1], a[2]}, {j[0], j[1], j[2]}});
        return std::make_shared<release::PolynomialHand>(release::PolynomialHand::segments(
            t_start, {pose[0], pose[1], pose[2]}, {twist[0], twist[1], twist[2]}, segments));
      },
      "t_start"_a, "pose"_a, "twist"_a, "stretches"_a,
      "A hand of stretches (t_end [s], acceleration, jerk) from pose [m, m, rad] and twist at t_start.");
  m.def(
      "hand_series",
      [](const Array& time, const Array& pose, const Array& twist, const Array& acceleration,
         const std::vector<double>& jumps) -> Hand {
        const release::HandSeries series{numbers("time", time), numbers("pose", pose, 3),
                                         numbers("twist", twist, 3),
                                         numbers("acceleration", acceleration, 3)};
        return std::make_shared<release::PolynomialHand>(release::fit_hand_motion(series, jumps).motion);
      },
      "time"_a, "pose"_a, "twist"_a, "acceleration"_a, "jumps"_a = std::vector<double>{},
      "The smooth motion that explains sampled poses, twists and accelerations, (N, 3) each.");
  m.def(
      "opening_profile",
      [](double open_command, double grip_force, double dead_time, double opening_time,
         double shape) -> Force {
        return std::make_shared<contact::ProfileNormalForce>(
            contact::OpeningProfile<double>{open_command, grip_force, dead_time, opening_time, shape});
      },
      py::kw_only(), "open_command"_a, "grip_force"_a, "dead_time"_a = 0.0, "opening_time"_a, "shape"_a = 1.0,
      "One pad's force: grip_force [N] until dead_time [s] after the command, then it falls as (1 - "
      "s)^shape.");
  m.def(
      "force_series",
      [](const Array& time, const Array& force, double sigma) -> Force {
        return std::make_shared<contact::SampledNormalForce>(
            contact::smooth_normal_force(numbers("time", time), numbers("force", force), sigma).force);
      },
      "time"_a, "force"_a, "sigma"_a,
      "One pad's force smoothed from a series (N,) [N] whose noise is sigma (1 sigma).");
  m.def("contact_model_names", &contact::contact_model_names, "The laws that contact_model knows.");
  m.def(
      "contact_model",
      [](const std::string& name, double mu, double radius, double torque_factor, int pads,
         double open_command, double delay, const std::map<std::string, double>& effects,
         double reference_force, const py::kwargs& own) -> Law {
        contact::ContactParameters<double> p;
        p.patch = {mu, radius, torque_factor, pads};
        p.open_command = open_command, p.delay = delay;
        p.variation = variation_of(effects, reference_force);
        for (const auto& [key, value] : own)
          p.law_values.emplace(py::cast<std::string>(key), py::cast<double>(value));
        return contact::make_contact_model(name, p);
      },
      "name"_a, py::kw_only(), "mu"_a = 0.5, "radius"_a = contact::kFingerLength / contact::kUniformDisc,
      "torque_factor"_a = contact::kUniformDisc, "pads"_a = 2, "open_command"_a = contact::kNotGiven,
      "delay"_a = contact::kNotGiven, "effects"_a = std::map<std::string, double>{},
      "reference_force"_a = 0.0,
      "A law by name: friction coefficient [-], pad radius [m], torque factor [-], number of pads; of\n"
      "gripper_delay open_command and delay [s]; effects on the pads by their parameters' full names, as in\n"
      "{'contact.pad_compliance.compliance': 5e-6}, some with reference_force [N]; and the law's own "
      "parameters\n"
      "by name (kappa=0.5 of limit_surface_quartic).");
}

void add_simulation(py::module_& m) {
  py::class_<Release>(m, "Release", "A simulated release (release/simulate_release.hpp).")
      .def_property_readonly(
          "outcome", [](const Release& r) { return release::to_string(r.result.outcome); },
          "\"detached\", \"never_separated\" or \"not_solved\": look at it before the rest")
      .def_property_readonly(
          "slips_at_start", [](const Release& r) { return r.result.slips_at_start; },
          "the grip cannot hold the object even before it opens")
      .def_property_readonly(
          "detach_time", [](const Release& r) { return r.result.detach.time; }, "[s]")
      .def_property_readonly(
          "detach_pose", [](const Release& r) { return array_of(three(r.result.detach.pose)); },
          "of the CoM, in the world [m, m, rad]")
      .def_property_readonly(
          "detach_twist", [](const Release& r) { return array_of(three(r.result.detach.twist)); },
          "of the CoM, in the world [m/s, m/s, rad/s]")
      .def_property_readonly(
          "events",
          [](const Release& r) {
            py::list out;
            for (const auto& e : release::mode_events(r.problem, r.result))
              out.append(py::make_tuple(e.time, e.cause, e.mode));
            return out;
          },
          "(time [s], cause, mode entered), in order")
      .def_property_readonly(
          "energy",
          [](const Release& r) {
            const auto& e = r.result.ledger;
            return py::dict("mechanical_change"_a = e.mechanical_change, "hand_work"_a = e.hand_work,
                            "linear_friction"_a = e.linear_friction,
                            "torsional_friction"_a = e.torsional_friction,
                            "nonphysical_work"_a = e.nonphysical_work, "residual"_a = e.residual);
          },
          "the energy ledger [J]")
      .def("sample", &sample, "t"_a,
           "Arrays by name at the instants t [s], from the start to the detach: mode, pose, twist, wrench "
           "(about\n"
           "the patch, on the object), hand_pose, hand_twist, hand_acceleration, normal_force and relative "
           "(arm,\n"
           "angle, slip, spin: the object against the hand).");
  m.def(
      "simulate_release",
      [](Hand hand, Force force, Law law, double mass, double inertia, double com_offset, double angle,
         double across, const Two& gravity, std::optional<double> start, double rtol) {
        const double begin = start.value_or(hand->begin());
        return simulate(std::move(hand), std::move(force), std::move(law), {mass, inertia},
                        {gravity[0], gravity[1]}, {com_offset, angle, across}, begin, rtol);
      },
      "hand"_a.none(false), "force"_a.none(false), "law"_a.none(false), py::kw_only(), "mass"_a, "inertia"_a,
      "com_offset"_a = 0.0, "angle"_a = 0.0, "across"_a = 0.0, "gravity"_a = Two{0, -9.81},
      "start"_a = py::none(), "rtol"_a = dynamics::Tolerances{}.relative,
      "From the grip to the state at detach: mass [kg], inertia [kg m^2], the grasp (com_offset, across "
      "[m],\n"
      "angle [rad]; release/grasp.hpp), gravity [m/s^2], start [s] (None: the hand's begin).");

  py::class_<flight::FlightResult<double>>(m, "Flight", "A flight to the landing (flight/fly.hpp).")
      .def_property_readonly(
          "outcome", [](const flight::FlightResult<double>& f) { return flight::to_string(f.outcome); },
          "\"landed\", \"never_reaches\" or \"not_solved\": look at it before the rest")
      .def_property_readonly(
          "flight_time", [](const flight::FlightResult<double>& f) { return f.landing.flight_time; }, "[s]")
      .def_property_readonly(
          "pose", [](const flight::FlightResult<double>& f) { return array_of(three(f.landing.pose)); },
          "of the CoM at the landing [m, m, rad], not wrapped")
      .def_property_readonly(
          "twist", [](const flight::FlightResult<double>& f) { return array_of(three(f.landing.twist)); },
          "of the CoM at the landing [m/s, m/s, rad/s]");
  m.def(
      "fly",
      [](const Three& p, const Three& v, const Two& gravity, double landing_height, double drag_k,
         double lift_km, const Two& wind) {
        return flight::fly(flight::FlightProblem<double>{.pose = {p[0], p[1], p[2]},
                                                         .twist = {v[0], v[1], v[2]},
                                                         .gravity = {gravity[0], gravity[1]},
                                                         .drag_k = drag_k,
                                                         .landing_height = landing_height,
                                                         .lift_km = lift_km,
                                                         .wind = {wind[0], wind[1]}});
      },
      "pose"_a, "twist"_a, py::kw_only(), "gravity"_a = Two{0, -9.81}, "landing_height"_a = 0.0,
      "drag_k"_a = 0.0, "lift_km"_a = 0.0, "wind"_a = Two{0, 0},
      "From pose and twist of the CoM to landing_height [m]; drag_k [1/m], lift_km [-], wind [m/s].");
}

void add_logs(py::module_& m) {
  using experiment::PreparedThrow;
  py::class_<PreparedThrow>(m, "Throw",
                            "A logged throw, ready to be simulated (experiment/prepared_throw.hpp).")
      .def_readonly("id", &PreparedThrow::id)
      .def_readonly("object", &PreparedThrow::object)
      .def_readonly("condition", &PreparedThrow::condition)
      .def_property_readonly(
          "split",
          [](const PreparedThrow& t) { return t.split == datasets::Split::train ? "train" : "test"; })
      .def_property_readonly(
          "hand",
          [](const PreparedThrow& t) -> Hand { return std::make_shared<release::PolynomialHand>(t.hand); },
          "smoothed")
      .def_property_readonly(
          "normal_force",
          [](const PreparedThrow& t) -> Force {
            return t.normal_force ? std::make_shared<contact::SampledNormalForce>(*t.normal_force) : nullptr;
          },
          "of one pad, smoothed; None where it was not measured")
      .def_property_readonly(
          "mass", [](const PreparedThrow& t) { return t.body.mass; }, "declared [kg]")
      .def_property_readonly(
          "inertia", [](const PreparedThrow& t) { return t.body.inertia; }, "declared [kg m^2]")
      .def_property_readonly(
          "com_offset", [](const PreparedThrow& t) { return t.grasp.com_offset; }, "[m]")
      .def_property_readonly(
          "angle", [](const PreparedThrow& t) { return t.grasp.angle; }, "of the grasp [rad]")
      .def_property_readonly(
          "across", [](const PreparedThrow& t) { return t.grasp.across; }, "[m]")
      .def_property_readonly(
          "gravity",
          [](const PreparedThrow& t) {
            return Two{t.gravity.x, t.gravity.z};
          },
          "declared [m/s^2]")
      .def_readonly("drag_k", &PreparedThrow::drag_k, "declared [1/m]")
      .def_readonly("landing_height", &PreparedThrow::landing_height, "[m]")
      .def_readonly("start", &PreparedThrow::start, "[s]")
      .def_readonly("open_command", &PreparedThrow::open_command, "when the gripper is told to open [s]")
      .def_property_readonly("measured", &measured, "outcomes by name; None where there is none")
      .def(
          "simulate_release",
          [](const PreparedThrow& t, Law law, double rtol) {
            if (!t.normal_force)
              throw std::invalid_argument(fmt::format(
                  "throw {}: its normal force was not measured; pass one to simulate_release", t.id));
            return simulate(std::make_shared<release::PolynomialHand>(t.hand),
                            std::make_shared<contact::SampledNormalForce>(*t.normal_force), std::move(law),
                            t.body, t.gravity, t.grasp, t.start, rtol);
          },
          py::arg("law").none(false), "rtol"_a = dynamics::Tolerances{}.relative,
          "Its release under a law, as `unhand compare` simulates it.");
  m.def(
      "read_log",
      [](const std::filesystem::path& file, int threads) {
        py::gil_scoped_release others_may_run;
        return experiment::prepare_all(datasets::read_throw_log(file), file.string(), threads);
      },
      "file"_a, "threads"_a = 0, "The throws of a log (docs/log-format.md), hands and forces smoothed.");
}

}  // namespace
}  // namespace unhand::python

PYBIND11_MODULE(unhand, m) {
  m.doc() =
      "The physics of letting go: releases of robot throws, with NumPy arrays.\n\n"
      "SI units and radians. Planar: x forward, z up; a pose is [x, z, theta], a twist [vx, vz, omega], a "
      "wrench\n"
      "[fx, fz, tau]; angles run from +x towards +z. Arguments out of range raise ValueError.";
  unhand::python::add_inputs(m);
  unhand::python::add_simulation(m);
  unhand::python::add_logs(m);
}
