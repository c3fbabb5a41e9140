// What a recorded release says: its events in words, a sample of it, its energy.
#include "release/release_system.hpp"

namespace unhand::release {
namespace {

double mechanical_energy(const ReleaseProblem<double>& problem, const dynamics::Pose<double>& p,
                         const dynamics::Twist<double>& v) {
  const auto& [m, I] = problem.body;
  return 0.5 * m * dot(v.linear(), v.linear()) + 0.5 * I * v.omega * v.omega -
         m * dot(problem.gravity, p.position());
}

}  // namespace

// Four-point Gauss-Legendre quadrature of the powers over every recorded step, in panels of at most 2 ms: a
// shaken hand changes them faster than the state.
EnergyLedger energy_ledger(const ReleaseProblem<double>& problem, const ReleaseResult<double>& result) {
  constexpr double kNode[4] = {0.0694318442029737, 0.3300094782075719, 0.6699905217924281,
                               0.9305681557970263};
  constexpr double kWeight[4] = {0.1739274225687269, 0.3260725774312731, 0.3260725774312731,
                                 0.1739274225687269};
  constexpr double kPanel = 2e-3;  // s
  const ReleaseSystem<double> system(problem);
  EnergyLedger ledger;
  for (const auto& piece : result.trajectory.pieces) {
    const double length = piece.t1 - piece.t0;
    const int panels = std::max(1, static_cast<int>(std::ceil(length / kPanel)));
    for (int k = 0; k < 4 * panels; ++k) {
      const double fraction = (k / 4 + kNode[k % 4]) / panels;
      const Scene<double> scene = system.scene(piece.phase.window, piece.t0 + fraction * length);
      const auto y = Relative<double>::from(piece.at_fraction(fraction));
      const Wrench<double> f = wrench_at(problem.contact, piece, fraction, scene, y);
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
          wrench_at(problem.contact, piece, fraction, scene, y),
          {scene.hand, scene.hand_twist, scene.hand_acceleration},
          scene.normal_force,
          y};
}

template std::vector<ModeEvent> mode_events(const ReleaseProblem<double>&, const ReleaseResult<double>&);
template std::vector<ModeEvent> mode_events(const ReleaseProblem<Dual>&, const ReleaseResult<Dual>&);
template ReleaseSample<double> sample_release(const ReleaseProblem<double>&, const ReleaseResult<double>&,
                                              const double&);
template ReleaseSample<Dual> sample_release(const ReleaseProblem<Dual>&, const ReleaseResult<Dual>&,
                                            const Dual&);

}  // namespace unhand::release
