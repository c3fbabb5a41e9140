#include "fitting/discovery/estimate_missing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/parallel.hpp"
#include "fitting/discovery/acceptance.hpp"
#include "fitting/discovery/traces.hpp"
#include "fitting/evaluate.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

using Vector3 = std::array<double, 3>;
using State = ResidualTrace::State;

/// How the missing quantity moves one throw against its prediction, on a grid of time.
class Displacement {
 public:
  template <class Missing>
  Displacement(const CampaignProblem& problem, const CampaignThrow& thrown, const StateSeries& states,
               double release, Phase phase, double end, const Missing& missing) {
    const PhaseClock clock = phase_clock(thrown, release, phase);
    const double inf = std::numeric_limits<double>::infinity();
    const auto& body = thrown.prepared.body;
    Vector3 velocity{}, position{}, last{};
    for (double t = clock.origin; t <= end + kStep; t += kStep) {
      Vector3 a{};
      const bool acts = phase == Phase::flight || t < release;
      if (acts) a = missing((t - clock.origin) / clock.scale, states.at(thrown, t));
      if (acts && phase == Phase::release) {  // a pad's wrench in the hand's frame
        const auto hand = thrown.prepared.hand.at(dynamics::Window{-inf, inf}, t);
        const auto f = dynamics::rotate(hand.pose.theta, dynamics::Vec2<double>{a[0], a[1]});
        const State s = states.at(thrown, t);
        const double lever = thrown.prepared.grasp.com_offset, pads = problem.model().pads;
        const double rx = lever * std::cos(s.theta), rz = lever * std::sin(s.theta);
        a = {pads * f.x / body.mass, pads * f.z / body.mass,
             pads * (a[2] + rz * f.x - rx * f.z) / body.inertia};
      }
      if (!time_.empty())
        for (std::size_t c = 0; c < 3; ++c) {
          position[c] += kStep * velocity[c] + kStep * kStep * (2 * last[c] + a[c]) / 6;
          velocity[c] += 0.5 * kStep * (last[c] + a[c]);
        }
      last = a;
      time_.push_back(t);
      at_.push_back(position);
    }
  }
  Vector3 at(double t) const {
    if (time_.empty() || t <= time_.front()) return {};
    const auto k = std::min(static_cast<std::size_t>((t - time_.front()) / kStep), time_.size() - 1);
    return at_[k];
  }

 private:
  static constexpr double kStep = 1e-3;  // [s]
  std::vector<double> time_;
  std::vector<Vector3> at_;
};

/// Sums of the squared errors of predictions, and over how much: in flight [m²], of the landing [σ²].
struct OutcomeSquares {
  double flight{}, samples{}, landing{}, landings{};
};

template <class Missing>
OutcomeSquares squares_with(const CampaignProblem& problem, const CampaignThrow& thrown,
                            const Linearisation& predicted, Phase phase, const Missing& missing) {
  OutcomeSquares out;
  const Eigen::VectorXd& residual = predicted.residual;
  const StateSeries states = states_of(thrown, residual, MotionOf::model);
  if (states.time.empty()) return out;  // where it moved, and how fast, is not known
  const double release = thrown.release_or(predicted.detach), g = -thrown.prepared.gravity.z;
  double end = release;
  for (const auto& o : thrown.observed.all) end = std::max(end, o.time);
  const Displacement moved(problem, thrown, states, release, phase, end, missing);
  for (std::size_t j = 0; j < thrown.observed.all.size(); ++j) {
    const auto& o = thrown.observed.all[j];
    const double error = residual[static_cast<Eigen::Index>(j)] * o.sigma;
    const Phase in = phase_of(o, thrown.opening, release);
    const Vector3 by = moved.at(o.time);
    if (in == Phase::flight && (o.channel == Channel::mocap_x || o.channel == Channel::mocap_z)) {
      const double e = error + by[o.channel == Channel::mocap_x ? 0 : 1];
      out.flight += e * e;
      if (o.channel == Channel::mocap_x) out.samples += 1;
    }
    if (o.channel == Channel::landing_x || o.channel == Channel::landing_theta) {
      State s = states.at(thrown, o.time);
      s.vz -= g * (o.time - states.time.back());
      const double later = s.vz < -0.1 ? -by[1] / s.vz : 0;  // it passes the height that much later
      const double e =
          o.channel == Channel::landing_x ? error + by[0] + s.vx * later : error + by[2] + s.omega * later;
      out.landing += e * e / (o.sigma * o.sigma);
      out.landings += 1;
    }
  }
  return out;
}

}  // namespace

std::optional<MissingEstimate> estimate_missing(const Stage& stage, Phase phase,
                                                const DiscoverOptions& options) {
  if (phase == Phase::landing) phase = Phase::flight;
  if (phase == Phase::grasped) return std::nullopt;
  const auto& problem = stage.problem;
  MissingEstimate out;
  out.phase = phase;
  const PhaseTraces seen = traces_of(stage.problem, stage.fit, phase, options.fit.threads);
  if (seen.all.size() < 4) return std::nullopt;
  out.groups = seen.names();
  out.curves = missing_curves(seen.all, seen.how);
  out.candidate = missing_terms(seen.all, seen.how);

  // As a correction, on held-out throws that are predicted from what is known before the throw.
  std::vector<std::size_t> held_out;
  for (std::size_t i = 0; i < problem.throws().size(); ++i)
    if (stage.held_out.throws[i].used) held_out.push_back(i);
  const auto predicted = predict_some(problem, stage.fit, held_out, {false, options.fit.threads});
  constexpr int kTried = 3;
  std::vector<std::array<OutcomeSquares, kTried>> squares(held_out.size());
  dynamics::parallel_for(held_out.size(), options.fit.threads, [&](std::size_t k) {
    const CampaignThrow& thrown = problem.throws()[held_out[k]];
    const auto l = problem.linearise(thrown, stage.fit.values(), predicted[k].own, DerivativesBy::nothing);
    if (!l.solved) return;
    const int group = seen.objects.at(thrown.prepared.object);
    const auto curve = std::find_if(out.curves.begin(), out.curves.end(),
                                    [&](const MissingCurve& c) { return c.group == group; });
    squares[k][0] = squares_with(problem, thrown, l, phase, [](double, const State&) { return Vector3{}; });
    squares[k][1] = squares_with(problem, thrown, l, phase, [&](double t, const State&) {
      return curve == out.curves.end() ? Vector3{} : curve->at(t);
    });
    squares[k][2] = squares_with(problem, thrown, l, phase,
                                 [&](double, const State& s) { return out.candidate.at(s, group); });
  });
  std::array<OutcomeSquares, kTried> sum{};
  for (const auto& of : squares)
    for (std::size_t c = 0; c < kTried; ++c) {
      sum[c].flight += of[c].flight, sum[c].samples += of[c].samples;
      sum[c].landing += of[c].landing, sum[c].landings += of[c].landings;
    }
  // Of the motion in flight where it was seen, of the landing otherwise.
  const bool tracked = sum[0].samples > 0;
  if (!tracked && !(sum[0].landings > 0)) {
    out.correction = Correction::not_judged;
    return out;
  }
  const auto error = [&](std::size_t c) {
    return tracked ? std::sqrt(sum[c].flight / sum[c].samples) : std::sqrt(sum[c].landing / sum[c].landings);
  };
  out.error_before = out.error_after = error(0);
  out.error_unit = tracked ? "m" : "sigma";
  for (std::size_t c = 1; c < kTried; ++c) {
    if (c == 2 && out.candidate.terms.empty()) continue;
    if (!(error(c) < *out.error_after * (out.correction == Correction::withheld ? kCorrects : 1.0))) continue;
    out.error_after = error(c);
    out.correction = c == 1 ? Correction::curve : Correction::candidate;
  }
  return out;
}

}  // namespace unhand::fitting
