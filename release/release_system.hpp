// The release as the integrator sees it, and as a recorded release is read. Internal to release.
#pragma once

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "dynamics/require_finite.hpp"
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

/// Throws std::invalid_argument for a normal force that still presses after its own release, where the hand's
/// motion goes on after it.
inline void require_released(const contact::NormalForce& force, double end) {
  const double release = force.release_time(), first = release + contact::kSameInstant;
  if (!(first <= end)) return;
  const Window after{release, end};
  for (const double t : {first, 0.5 * (first + end), end})
    if (const double f = force.at(after, t); f != 0)
      throw std::invalid_argument(
          fmt::format("release: normal force = {} N at {} s is not 0 N, though its release_time() is {} s", f,
                      t, release));
}

/// True if time, pose and twist are.
template <class S>
bool is_finite(const DetachState<S>& detach) {
  const auto& [t, pose, twist] = detach;
  for (const S& x : {t, pose.x, pose.z, pose.theta, twist.vx, twist.vz, twist.omega})
    if (!std::isfinite(value_of(x))) return false;
  return true;
}

/// The share of a tiny slip by which one step may be wrong.
inline constexpr double kSlipShare = 1e-2;

/// The release as a hybrid system: the modes of the contact model, and one more in which the object is free.
template <class P>
class ReleaseSystem final : public dynamics::HybridSystemFrom<ReleaseSystem<P>, 6>,
                            public contact::SceneSource {
 public:
  /// Throws std::logic_error for a law without modes.
  explicit ReleaseSystem(const ReleaseProblem<P>& problem)
      : problem_(problem), contact_(problem.contact), free_(contact_.mode_count()) {
    if (free_ < 1)
      throw std::logic_error(
          fmt::format("contact model \"{}\": {} modes are not in [1, inf)", contact_.name(), free_));
    contact_.separation(problem.normal_force, separation_);
    if (!contact_.needs_hold()) return;
    hold_at_start(hold_.dual);
    hold_at_start(hold_.value);
  }

  int free_mode() const { return free_; }
  double separation() const { return value_of(separation_); }
  /// How the object is held at the start, for pads that give.
  template <class S>
  const contact::Hold<S>& hold() const {
    return hold_.of<S>();
  }

  Scene<double> scene(const Window& window, double t) const override { return scene_(window, t); }
  Scene<Dual> scene(const Window& window, const Dual& t) const override { return scene_(window, t); }

  dynamics::FlowKind kind(int mode) const override {
    return mode == free_ ? dynamics::FlowKind::finished : contact_.kind(mode);
  }
  std::string_view mode_name(int mode) const override {
    return mode == free_ ? "free" : contact_.mode_name(mode);
  }
  int guard_count(int mode) const override {
    const int count = mode == free_ ? 0 : contact_.guard_count(mode);
    if (count < 0 || count > dynamics::kMaxGuards)
      throw std::logic_error(fmt::format("contact model \"{}\": {} guards of mode \"{}\" are not in [0, {}]",
                                         contact_.name(), count, contact_.mode_name(mode),
                                         dynamics::kMaxGuards));
    return count;
  }
  dynamics::Guard guard(int mode, int index) const override { return contact_.guard(mode, index); }
  bool is_paced(int mode) const override { return contact_.is_homogeneous(mode); }
  State<double, 6> pace_weights() const override { return {0, 0, 0, 1, 1, contact_.spin_length()}; }

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
    // Of events at one instant one stays. A jump of the hand rather than a kink, since no parameter moves
    // what jumps, and where the force only kinks the flow is continuous, so that the kink's own derivatives
    // do not count. The separation rather than either: its derivatives are the detach's.
    constexpr double kOneInstant = 1e-12;
    const std::vector<double> jumps = problem_.hand.jumps();
    std::erase_if(out, [&](const S& t) {
      return std::any_of(jumps.begin(), jumps.end(),
                         [&](double jump) { return std::abs(value_of(t) - jump) < kOneInstant; });
    });
    for (const double t : jumps) out.push_back(S(t));
    const auto earlier = [](const S& a, const S& b) { return value_of(a) < value_of(b); };
    std::stable_sort(out.begin(), out.end(), earlier);
    for (std::size_t i = 1; i < out.size();) {
      if (value_of(out[i]) - value_of(out[i - 1]) < kOneInstant)
        out.erase(out.begin() + static_cast<std::ptrdiff_t>(i) - 1);
      else
        ++i;
    }
    if (!std::isfinite(separation())) return;
    std::erase_if(out, [&](const S& t) { return std::abs(value_of(t) - separation()) < kOneInstant; });
    out.insert(std::upper_bound(out.begin(), out.end(), S(separation()), earlier), convert<S>(separation_));
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
    return of_the_law(contact_.on_guard(p, guard, *this, t, Relative<S>::from(y)));
  }
  template <class S>
  Entry<S, 6> on_time_(int mode, const Window& window, const S& t, const State<S, 6>& y) const {
    if (value_of(t) >= separation() - 1e-12) return {free_, t, y, S(0)};
    return of_the_law(contact_.membership(mode, window, *this, t, Relative<S>::from(y)));
  }
  /// The mode in which the start is.
  Entry<P, 6> begin(const Window& window, const Relative<P>& y) const {
    return of_the_law(contact_.membership(-1, window, *this, P(problem_.start), y));
  }

 private:
  /// A law's answer, which has to be a mode of its own: when the object is free its separation says.
  template <class S>
  Entry<S, 6> of_the_law(const Entry<S, 6>& entry) const {
    if (entry.mode < 0 || entry.mode >= free_)
      throw std::logic_error(
          fmt::format("contact model \"{}\": mode {} is not in [0, {}], the modes that it says to have",
                      contact_.name(), entry.mode, free_ - 1));
    return entry;
  }

  /// The last scenes are kept: a step, the guards at its end and the phase that follows ask for the same
  /// instants, and an implicit step for those of its stages again and again.
  const Scene<double>& scene_(const Window& window, double t) const {
    for (const Kept& kept : kept_)
      if (t == kept.time && window.begin == kept.window.begin && window.end == kept.window.end)
        return kept.scene;
    Kept& kept = kept_[next_kept_];
    next_kept_ = (next_kept_ + 1) % kept_.size();
    kept.scene = scene_at(window, t);
    kept.time = t;
    kept.window = window;
    return kept.scene;
  }
  Scene<Dual> scene_(const Window& window, const Dual& t) const { return scene_at(window, t); }

  template <class S>
  Scene<S> scene_at(const Window& window, const S& t) const {
    const HandState<S> hand = problem_.hand.at(window, t);
    const auto& [m, I] = problem_.body;
    S force = problem_.normal_force.at(window, t);
    if (value_of(t) > window.end && !(value_of(force) >= 0))
      force = S(0);  // a stepper that looks beyond the phase
    if (value_of(force) < 0)
      throw std::invalid_argument(fmt::format("release: normal force = {} N at {} s is not in [0, inf) N",
                                              value_of(force), value_of(t)));
    return {{convert<S>(m), convert<S>(I)},
            {convert<S>(problem_.gravity.x), convert<S>(problem_.gravity.z)},
            hand.pose,
            hand.twist,
            hand.acceleration,
            force,
            &hold<S>()};
  }

  /// As the object is held at the start, by the wrench that makes it follow the hand.
  template <class S>
  void hold_at_start(contact::Hold<S>& hold) const {
    const auto& [offset, angle, across] = problem_.grasp;
    hold = {{convert<S>(offset), convert<S>(across)}, convert<S>(angle), {}};
    const S start(problem_.start);
    const Scene<S> scene = scene_(Window{problem_.start, problem_.hand.end()}, start);
    const Wrench<S> wrench =
        contact::sticking_wrench(scene, Relative<S>{hold.arm, hold.angle, {S(0), S(0)}, S(0)});
    const dynamics::Vec2<S> force = dynamics::rotate(S(-scene.hand.theta), wrench.force());
    hold.wrench = {force.x, force.z, wrench.tau};
  }

  /// |(v_r, L ω_r)|
  double slip_size(const State<double, 6>& y) const {
    const double spin = contact_.spin_length() * y[5];
    return std::sqrt(y[3] * y[3] + y[4] * y[4] + spin * spin);
  }

  const ReleaseProblem<P>& problem_;
  const contact::ContactModel& contact_;
  int free_;
  dynamics::OfBoth<contact::Hold> hold_;
  P separation_{};
  struct Kept {
    double time{std::numeric_limits<double>::quiet_NaN()};  // none yet
    Window window;
    Scene<double> scene;
  };
  mutable std::array<Kept, 8> kept_;
  mutable std::size_t next_kept_{};
};

/// The contact model, if its pads give at every point.
inline const contact::GivesAtPoints* giving(const contact::ContactModel& model) {
  const auto* points = dynamic_cast<const contact::GivesAtPoints*>(&model);
  return points && points->gives_at_points() ? points : nullptr;
}

/// The wrench on the object about the patch, in the world, at `fraction` of a recorded piece, where the state
/// is y.
template <class S>
Wrench<S> wrench_at(const contact::ContactModel& model, const dynamics::TrajectoryPiece<S, 6>& piece,
                    const S& fraction, const Scene<S>& scene, const Relative<S>& y) {
  if (giving(model)) return wrench_of_motion(piece, fraction, scene, y);
  return model.wrench(piece.phase.mode, scene, y);
}

/// The energy of a recorded release.
EnergyLedger energy_ledger(const ReleaseProblem<double>&, const ReleaseResult<double>&);

}  // namespace unhand::release
