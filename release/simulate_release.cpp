#include "release/simulate_release.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "release/giving_release.hpp"

namespace unhand::release {

using contact::Relative;
using contact::Scene;
using dynamics::convert;
using dynamics::Entry;
using dynamics::Phase;
using dynamics::State;
using dynamics::value_of;
using dynamics::Wrench;

const char* to_string(ReleaseOutcome outcome) {
  switch (outcome) {
    case ReleaseOutcome::detached:
      return "detached";
    case ReleaseOutcome::never_separated:
      return "never_separated";
    case ReleaseOutcome::not_solved:
      return "not_solved";
  }
  return "unknown";
}

namespace {

/// The share of a tiny slip by which one step may be wrong.
constexpr double kSlipShare = 1e-2;

/// The release as a hybrid system: the modes of the contact model, and one more in which the object is free.
template <class P>
class ReleaseSystem final : public dynamics::HybridSystemFrom<ReleaseSystem<P>, 6>,
                            public contact::SceneSource {
 public:
  explicit ReleaseSystem(const ReleaseProblem<P>& problem)
      : problem_(problem), contact_(problem.contact), free_(contact_.mode_count()) {
    contact_.separation(problem.normal_force, separation_);
    if (!contact_.needs_hold()) return;
    hold_at_start(hold_dual_);
    hold_at_start(hold_);
  }

  int free_mode() const { return free_; }
  double separation() const { return value_of(separation_); }
  /// How the object is held at the start, for pads that give.
  template <class S>
  const contact::Hold<S>& hold() const {
    if constexpr (std::is_same_v<S, double>)
      return hold_;
    else
      return hold_dual_;
  }

  Scene<double> scene(const Window& window, double t) const override { return scene_(window, t); }
  Scene<Dual> scene(const Window& window, const Dual& t) const override { return scene_(window, t); }

  dynamics::FlowKind kind(int mode) const override {
    return mode == free_ ? dynamics::FlowKind::finished : contact_.kind(mode);
  }
  std::string_view mode_name(int mode) const override {
    return mode == free_ ? "free" : contact_.mode_name(mode);
  }
  int guard_count(int mode) const override { return contact_.guard_count(mode); }
  dynamics::Guard guard(int mode, int index) const override { return contact_.guard(mode, index); }
  bool is_paced(int mode) const override { return contact_.is_homogeneous(mode); }
  double pace(const Phase&, double, const State<double, 6>& y) const override { return slip_size(y); }
  Dual pace(const Phase&, const Dual&, const State<Dual, 6>& y) const override { return slip_size(y); }

  void error_scale(const Phase& p, const dynamics::Tolerances& tolerances, const State<double, 6>& y0,
                   const State<double, 6>& y1, State<double, 6>& scale) const override {
    dynamics::HybridSystem<6>::error_scale(p, tolerances, y0, y1, scale);
    if (!contact_.is_homogeneous(p.mode)) return;
    // While a slip is tiny its direction forgets what it was wrong by, so the absolute tolerance holds for it
    // as for the rest of the state, but no more than a share of the slip itself, so that its direction stays
    // one.
    const double length = contact_.spin_length(), speed = std::max(slip_size(y0), slip_size(y1));
    const double slip = std::min(tolerances.absolute, kSlipShare * speed) + tolerances.relative * speed;
    scale[3] = scale[4] = slip;
    if (length > 0) scale[5] = slip / length;
  }

  template <class S>
  void time_events_(std::vector<S>& out) const {
    out.clear();
    problem_.normal_force.kinks(out);
    for (const double t : problem_.hand.jumps()) out.push_back(S(t));
    if (std::isfinite(separation())) out.push_back(convert<S>(separation_));
    std::sort(out.begin(), out.end(), [](const S& a, const S& b) { return value_of(a) < value_of(b); });
    // The separation may be one of the kinks; of two events at one instant the one with derivatives stays.
    for (std::size_t i = 1; i < out.size();) {
      if (value_of(out[i]) - value_of(out[i - 1]) < 1e-12)
        out.erase(out.begin() + static_cast<std::ptrdiff_t>(i) - 1);
      else
        ++i;
    }
  }
  template <class S>
  void flow_(const Phase& p, const S& t, const State<S, 6>& y, State<S, 6>& dy) const {
    contact_.rate(p.mode, scene_(p.window, t), Relative<S>::from(y), dy);
  }
  template <class S>
  void guards_(const Phase& p, const S& t, const State<S, 6>& y, S* g) const {
    contact_.guards(p, *this, t, Relative<S>::from(y), g);
  }
  template <class S>
  Entry<S, 6> on_guard_(const Phase& p, int guard, const S& t, const State<S, 6>& y) const {
    return contact_.on_guard(p, guard, *this, t, Relative<S>::from(y));
  }
  template <class S>
  Entry<S, 6> on_time_(int mode, const Window& window, const S& t, const State<S, 6>& y) const {
    if (value_of(t) >= separation() - 1e-12) return {free_, t, y, S(0)};
    return contact_.membership(mode, window, *this, t, Relative<S>::from(y));
  }

 private:
  /// The last scene is kept: a step, the guards at its end and the phase that follows ask for the same
  /// instant.
  const Scene<double>& scene_(const Window& window, double t) const {
    if (t != scene_time_ || window.begin != scene_window_.begin || window.end != scene_window_.end) {
      last_scene_ = scene_at(window, t);
      scene_time_ = t;
      scene_window_ = window;
    }
    return last_scene_;
  }
  Scene<Dual> scene_(const Window& window, const Dual& t) const { return scene_at(window, t); }

  template <class S>
  Scene<S> scene_at(const Window& window, const S& t) const {
    const HandState<S> hand = problem_.hand.at(window, t);
    const auto& [m, I] = problem_.body;
    return {{convert<S>(m), convert<S>(I)},
            {convert<S>(problem_.gravity.x), convert<S>(problem_.gravity.z)},
            hand.pose,
            hand.twist,
            hand.acceleration,
            problem_.normal_force.at(window, t),
            &hold<S>()};
  }

  /// As the object is held at the start, by the wrench that makes it follow the hand.
  template <class S>
  void hold_at_start(contact::Hold<S>& hold) const {
    const auto& [offset, angle] = problem_.grasp;
    hold = {{convert<S>(offset), S(0)}, convert<S>(angle), {}};
    const S start(problem_.start);
    const Scene<S> scene = scene_(Window{problem_.start, problem_.hand.end()}, start);
    const Wrench<S> wrench =
        contact::sticking_wrench(scene, Relative<S>{hold.arm, hold.angle, {S(0), S(0)}, S(0)});
    const dynamics::Vec2<S> force = dynamics::rotate(S(-scene.hand.theta), wrench.force());
    hold.wrench = {force.x, force.z, wrench.tau};
  }

  /// |(v_r, L ω_r)|
  template <class S>
  S slip_size(const State<S, 6>& y) const {
    using std::sqrt;
    const S spin = contact_.spin_length() * y[5];
    return sqrt(y[3] * y[3] + y[4] * y[4] + spin * spin);
  }

  const ReleaseProblem<P>& problem_;
  const contact::ContactModel& contact_;
  int free_;
  contact::Hold<double> hold_;
  contact::Hold<Dual> hold_dual_;
  P separation_{};
  mutable Scene<double> last_scene_{};
  mutable double scene_time_{std::numeric_limits<double>::quiet_NaN()};  // none yet
  mutable Window scene_window_;
};

template <class S>
void validate(const ReleaseProblem<S>& problem) {
  const auto require = [](bool ok, const char* name, double value, const char* range) {
    if (!ok) throw std::invalid_argument(fmt::format("release: {} = {} is not in {}", name, value, range));
  };
  const double m = value_of(problem.body.mass), I = value_of(problem.body.inertia);
  require(m > 0 && m <= 1e4, "mass", m, "(0, 1e4] kg");
  require(I > 0 && I <= 1e6, "inertia", I, "(0, 1e6] kg m²");
  require(std::isfinite(value_of(problem.gravity.x)), "gravity x", value_of(problem.gravity.x),
          "finite m/s²");
  require(std::isfinite(value_of(problem.gravity.z)), "gravity z", value_of(problem.gravity.z),
          "finite m/s²");
  require(std::abs(value_of(problem.grasp.com_offset)) <= 100, "com_offset",
          value_of(problem.grasp.com_offset), "[-100, 100] m");
  require(std::isfinite(value_of(problem.grasp.angle)), "grasp angle", value_of(problem.grasp.angle),
          "finite rad");
  require(std::isfinite(value_of(problem.slip.x)), "slip x", value_of(problem.slip.x), "finite m/s");
  require(std::isfinite(value_of(problem.slip.z)), "slip z", value_of(problem.slip.z), "finite m/s");
  require(std::isfinite(value_of(problem.spin)), "spin", value_of(problem.spin), "finite rad/s");
  if (!(problem.start >= problem.hand.begin() && problem.start < problem.hand.end()))
    throw std::invalid_argument(
        fmt::format("release: start = {} is not in [{}, {}) s, where the hand's motion is known",
                    problem.start, problem.hand.begin(), problem.hand.end()));
}

double mechanical_energy(const ReleaseProblem<double>& problem, const dynamics::Pose<double>& p,
                         const dynamics::Twist<double>& v) {
  const auto& [m, I] = problem.body;
  return 0.5 * m * dot(v.linear(), v.linear()) + 0.5 * I * v.omega * v.omega -
         m * dot(problem.gravity, p.position());
}

/// The contact model, if its pads give at every point.
const contact::GivesAtPoints* giving(const contact::ContactModel& model) {
  const auto* points = dynamic_cast<const contact::GivesAtPoints*>(&model);
  return points && points->gives_at_points() ? points : nullptr;
}

/// The wrench on the object about the patch, in the world, at `fraction` of a recorded piece.
template <class S>
Wrench<S> wrench_at(const contact::ContactModel& model, const dynamics::TrajectoryPiece<S, 6>& piece,
                    const S& fraction, const Scene<S>& scene) {
  if (giving(model)) return wrench_of_motion(piece, fraction, scene);
  return model.wrench(piece.phase.mode, scene, Relative<S>::from(piece.at_fraction(fraction)));
}

/// Four-point Gauss-Legendre quadrature of the powers over every recorded step, in panels of at most 2 ms: a
/// shaken hand changes them faster than the state.
EnergyLedger book(const ReleaseProblem<double>& problem, const ReleaseSystem<double>& system,
                  const ReleaseResult<double>& result) {
  constexpr double kNode[4] = {0.0694318442029737, 0.3300094782075719, 0.6699905217924281,
                               0.9305681557970263};
  constexpr double kWeight[4] = {0.1739274225687269, 0.3260725774312731, 0.3260725774312731,
                                 0.1739274225687269};
  constexpr double kPanel = 2e-3;  // s
  EnergyLedger ledger;
  for (const auto& piece : result.trajectory.pieces) {
    const double length = piece.t1 - piece.t0;
    const int panels = std::max(1, static_cast<int>(std::ceil(length / kPanel)));
    for (int k = 0; k < 4 * panels; ++k) {
      const double fraction = (k / 4 + kNode[k % 4]) / panels;
      const Scene<double> scene = system.scene(piece.phase.window, piece.t0 + fraction * length);
      const auto y = Relative<double>::from(piece.at_fraction(fraction));
      const Wrench<double> f = wrench_at(problem.contact, piece, fraction, scene);
      const double weight = kWeight[k % 4] * length / panels;
      ledger.hand_work +=
          weight * (dot(f.force(), scene.hand_twist.linear()) + f.tau * scene.hand_twist.omega);
      ledger.torsional_friction += weight * f.tau * y.spin;
      const double linear = dot(f.force(), y.slip);
      (linear > 0 && problem.contact.may_feed_energy(piece.phase.mode) ? ledger.nonphysical_work
                                                                       : ledger.linear_friction) +=
          weight * linear;
    }
  }
  const auto& first = result.trajectory.pieces.front();
  const Scene<double> scene = system.scene(first.phase.window, first.t0);
  const auto y = Relative<double>::from(first.nodes[0]);
  ledger.mechanical_change = mechanical_energy(problem, result.detach.pose, result.detach.twist) -
                             mechanical_energy(problem, object_pose(scene, y), object_twist(scene, y));
  ledger.residual = ledger.mechanical_change - ledger.hand_work - ledger.linear_friction -
                    ledger.torsional_friction - ledger.nonphysical_work;
  return ledger;
}

}  // namespace

template <class S>
ReleaseResult<S> simulate_release(const ReleaseProblem<S>& problem, const ReleaseOptions& options) {
  validate(problem);
  const ReleaseSystem<S> system(problem);
  const auto& [offset, angle] = problem.grasp;
  const Relative<S> held{{offset, S(0)}, angle, problem.slip, problem.spin};
  std::vector<double> times;
  system.time_events(times);
  const auto next = std::upper_bound(times.begin(), times.end(), problem.start);
  const Window first{problem.start,
                     next == times.end() ? problem.hand.end() : std::min(*next, problem.hand.end())};

  ReleaseResult<S> result;
  Entry<S, 6> entry{system.free_mode(), S(problem.start), held.state(), S(0)};
  if (problem.start < system.separation())
    entry = problem.contact.membership(-1, first, system, S(problem.start), held);
  result.slips_at_start = entry.mode != 0 && entry.mode != system.free_mode();

  dynamics::IntegratorOptions integrator = options.integrator;
  integrator.record = integrator.record || options.ledger;
  if (const auto* pads = giving(problem.contact); pads && problem.start < system.separation()) {
    std::vector<S> events;
    system.time_events(events);
    const GivingStart<S> start{held, system.template hold<S>(), std::move(events), system.separation(),
                               system.free_mode()};
    const bool slips = result.slips_at_start;
    result = simulate_giving_release(problem, *pads, system, start, {integrator, options.ledger});
    result.slips_at_start = slips;
    if constexpr (std::is_same_v<S, double>)
      if (options.ledger && !result.trajectory.empty()) result.ledger = book(problem, system, result);
    return result;
  }
  // A release at the very end of the log still counts: the horizon lies one instant after.
  const double horizon = std::max(
      problem.hand.end(), std::isfinite(system.separation()) && system.separation() <= problem.hand.end()
                              ? std::nextafter(system.separation(), 1e300) + 1e-9
                              : 0.0);
  dynamics::Solution<S, 6> solution = dynamics::integrate<S, 6>(system, entry, S(horizon), integrator);

  result.integration = solution.outcome;
  result.events = std::move(solution.events);
  result.trajectory = std::move(solution.trajectory);
  result.statistics = solution.statistics;
  if (entry.lead != S(0) || result.slips_at_start)
    result.events.insert(result.events.begin(), {dynamics::EventKind::time, -1, 0, entry.mode,
                                                 S(problem.start), entry.event_state()});
  switch (solution.outcome) {
    case dynamics::Outcome::finished:
      result.outcome = ReleaseOutcome::detached;
      break;
    case dynamics::Outcome::horizon:
      result.outcome = ReleaseOutcome::never_separated;
      break;
    default:
      result.outcome = ReleaseOutcome::not_solved;
  }
  const double at = value_of(solution.t);
  const auto after = std::lower_bound(times.begin(), times.end(), at - 1e-12);
  const Window last{after == times.begin() ? problem.start : *std::prev(after), at};
  const Scene<S> scene = problem.start < system.separation() ? [&] {
    if constexpr (std::is_same_v<S, double>) return system.scene(last, at);
    else return system.scene(last, solution.t);
  }() : system.scene(first, solution.t);
  result.relative = Relative<S>::from(solution.y);
  result.detach = {solution.t, object_pose(scene, result.relative), object_twist(scene, result.relative)};
  if constexpr (std::is_same_v<S, double>)
    if (options.ledger && !result.trajectory.empty()) result.ledger = book(problem, system, result);
  return result;
}

template <class S>
std::vector<ModeEvent> mode_events(const ReleaseProblem<S>& problem, const ReleaseResult<S>& result) {
  const ReleaseSystem<S> system(problem);
  std::vector<ModeEvent> out;
  for (const auto& event : result.events) {
    std::string cause = event.index < 0 ? "start" : "time";
    if (event.kind == dynamics::EventKind::guard) cause = system.guard(event.mode_before, event.index).name;
    if (event.kind == dynamics::EventKind::limit) cause = "limit";
    out.push_back({value_of(event.t), cause, std::string(system.mode_name(event.mode_after))});
  }
  return out;
}

template <class S>
ReleaseSample<S> sample_release(const ReleaseProblem<S>& problem, const ReleaseResult<S>& result,
                                const S& t) {
  const ReleaseSystem<S> system(problem);
  const auto& piece = result.trajectory.piece_at(value_of(t));
  const S length = piece.t1 - piece.t0;
  const S fraction = value_of(length) > 0 ? S((t - piece.t0) / length) : S(1);
  const auto y = Relative<S>::from(piece.at_fraction(fraction));
  const Scene<S> scene = system.scene(piece.phase.window, t);
  return {system.mode_name(piece.phase.mode),
          object_pose(scene, y),
          object_twist(scene, y),
          wrench_at(problem.contact, piece, fraction, scene),
          {scene.hand, scene.hand_twist, scene.hand_acceleration},
          scene.normal_force,
          y};
}

template ReleaseResult<double> simulate_release(const ReleaseProblem<double>&, const ReleaseOptions&);
template ReleaseResult<Dual> simulate_release(const ReleaseProblem<Dual>&, const ReleaseOptions&);
template std::vector<ModeEvent> mode_events(const ReleaseProblem<double>&, const ReleaseResult<double>&);
template std::vector<ModeEvent> mode_events(const ReleaseProblem<Dual>&, const ReleaseResult<Dual>&);
template ReleaseSample<double> sample_release(const ReleaseProblem<double>&, const ReleaseResult<double>&,
                                              const double&);
template ReleaseSample<Dual> sample_release(const ReleaseProblem<Dual>&, const ReleaseResult<Dual>&,
                                            const Dual&);

}  // namespace unhand::release
