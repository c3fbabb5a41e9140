#include "experiment/friction_estimate.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "contact/contact_model.hpp"
#include "contact/convex_quartic.hpp"
#include "contact/gripper_delay.hpp"
#include "contact/limit_surface_shapes.hpp"
#include "contact/patch.hpp"
#include "contact/registry.hpp"
#include "dynamics/median.hpp"
#include "experiment/observations.hpp"
#include "experiment/sample_window.hpp"
#include "experiment/seen_delay.hpp"

namespace unhand::experiment {

using dynamics::Dual;

namespace {

/// One pad's wrench while it slips, over its normal force: force, force, torque.
struct SlipSample {
  std::array<double, 3> ratio{}, sigma{};  ///< -, -, m; 1 σ
};

/// What one pad carries at t [s] of an object that does not move in the hand, in the hand frame.
std::array<double, 3> held_wrench(const PreparedThrow& prepared, const std::vector<double>& jumps, int pads,
                                  double t) {
  const auto hand = prepared.hand.at(window_at(prepared.hand.begin(), prepared.hand.end(), jumps, t), t);
  contact::Scene<double> scene;
  scene.hand = hand.pose, scene.hand_twist = hand.twist, scene.hand_acceleration = hand.acceleration;
  scene.body = prepared.body, scene.gravity = prepared.gravity;
  const auto wrench = contact::sticking_wrench(
      scene, contact::Relative<double>{{prepared.grasp.com_offset, 0}, prepared.grasp.angle, {}, 0});
  const auto force = dynamics::rotate(-hand.pose.theta, wrench.force());
  return {force.x / pads, force.z / pads, wrench.tau / pads};
}

/// A wrench sample of one pad. A channel that is dead has an infinite σ, and the sample does not say whether
/// it slips.
struct PadSample {
  double time{};
  std::array<double, 3> wrench{}, sigma{HUGE_VAL, HUGE_VAL, HUGE_VAL};  ///< N, N, N m
};

std::vector<PadSample> pad_samples(const datasets::ThrowLog& log, const datasets::Throw& logged,
                                   const PreparedThrow& prepared) {
  ObservationOptions wrenches;
  wrenches.normal_force = wrenches.mocap = wrenches.landing = false;
  wrenches.settling -= kClockRounding;  // a sample at its very end counts
  std::vector<PadSample> out;
  for (const Observation& o : observe(log, logged, prepared, wrenches).all) {
    if (out.empty() || out.back().time != o.time) out.push_back({o.time});
    const auto c = static_cast<std::size_t>(o.channel) - static_cast<std::size_t>(Channel::wrench_fx);
    out.back().wrench[c] = o.value, out.back().sigma[c] = o.sigma;
  }
  return out;
}

/// Whether a pad does not carry what would hold the object still: by 5 σ, and by a fifth of it, which no
/// error of an inertia or of a clock is.
bool evidently_slips(const PadSample& sample, const std::array<double, 3>& held) {
  constexpr double kSigmas = 5, kShare = 0.2;
  double beyond = 0, missing = 0, whole = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const double off = sample.wrench[c] - held[c], unit = c < 2 ? 1.0 : contact::kFingerLength;
    beyond += std::pow(off / sample.sigma[c], 2);
    missing += std::pow(off / unit, 2);
    whole += std::pow(held[c] / unit, 2);
  }
  return beyond > kSigmas * kSigmas && missing > kShare * kShare * whole;
}

/// The last slip of every train throw: back from the release for as long as the pads evidently slip.
std::vector<SlipSample> slipping_samples(const datasets::ThrowLog& log,
                                         const std::vector<PreparedThrow>& throws) {
  const int pads = log.gripper ? log.gripper->n_pads : 2;
  std::vector<SlipSample> out;
  for (std::size_t i = 0; i < throws.size(); ++i) {
    const PreparedThrow& prepared = throws[i];
    const datasets::Throw& logged = log.throws[i];
    if (prepared.split != datasets::Split::train || !logged.ft || !prepared.normal_force) continue;
    const double release = prepared.normal_force->release_time();
    if (!std::isfinite(release)) continue;
    const std::vector<double> jumps = prepared.hand.jumps();
    const auto samples = pad_samples(log, logged, prepared);
    for (auto s = samples.rbegin(); s != samples.rend() && s->time > prepared.open_command - kClockRounding;
         ++s) {
      if (s->time >= release) continue;
      const double f = prepared.normal_force->at({prepared.start, release}, s->time);
      if (f < 8 * prepared.force_fit.sigma) continue;
      // A dead channel is no zero: what is left does not say where on the surface the wrench lies.
      if (!std::all_of(s->sigma.begin(), s->sigma.end(), [](double x) { return std::isfinite(x); })) continue;
      if (!evidently_slips(*s, held_wrench(prepared, jumps, pads, s->time))) break;
      SlipSample& slip = out.emplace_back();
      for (std::size_t c = 0; c < 3; ++c) slip.ratio[c] = s->wrench[c] / f, slip.sigma[c] = s->sigma[c] / f;
    }
  }
  return out;
}

/// What a fit of the surface to the samples ends with.
struct SurfaceFit {
  double mu{}, length{};                              ///< -, m
  double scatter{};                                   ///< robust 1 σ of gauge − 1 [-]
  double mu_sigma{HUGE_VAL}, length_sigma{HUGE_VAL};  ///< 1 σ, as shares of the values [-]
};

/// What is fitted to the samples.
enum class Fitted {
  both,  ///< μ and L
  mu     ///< μ, of pads whose L is known
};

/// Gauss-Newton on (ln μ, ln L), every gauge weighted with its own noise and with 1/max(1, |r|/k), the step
/// damped.
void solve(const contact::WrenchGauge& gauge, const std::vector<SlipSample>& samples, Fitted what,
           SurfaceFit& fit) {
  std::vector<double> off(samples.size()), whitened(samples.size());
  std::vector<Dual> r(samples.size());
  std::vector<double> sigma(samples.size());
  for (int iteration = 0; iteration < 60; ++iteration) {
    const Dual mu(fit.mu, 0), length(fit.length, 1);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const auto& s = samples[i].ratio;
      const Dual fx(s[0], 2), fz(s[1], 3), tau(s[2], 4);
      r[i] = gauge(contact::Vec3<Dual>{fx / mu, fz / mu, tau / (mu * length)}) - 1.0;
      double square = 1e-12;
      for (int c = 0; c < 3; ++c)
        square += std::pow(r[i].v[2 + c] * samples[i].sigma[static_cast<std::size_t>(c)], 2);
      sigma[i] = std::sqrt(square);
      off[i] = std::abs(r[i].a), whitened[i] = off[i] / sigma[i];
    }
    fit.scatter = 1.4826 * dynamics::median(off);
    const double scale = std::max(1.4826 * dynamics::median(whitened), 1e-9), k = 1.345 * scale;
    double H[2][2] = {}, b[2] = {};
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double w = 1 / (sigma[i] * sigma[i] * std::max(1.0, whitened[i] / k));
      const double J[2] = {fit.mu * r[i].v[0], what == Fitted::mu ? 0 : fit.length * r[i].v[1]};
      for (int p = 0; p < 2; ++p) {
        b[p] -= w * J[p] * r[i].a;
        for (int q = 0; q < 2; ++q) H[p][q] += w * J[p] * J[q];
      }
    }
    for (int p = 0; p < 2; ++p) H[p][p] *= 1 + 1e-9;
    if (what == Fitted::mu) H[1][1] = H[0][0];  // nothing is asked of L: its step is zero
    const double det = H[0][0] * H[1][1] - H[0][1] * H[1][0];
    if (!(det > 0)) break;
    fit.mu_sigma = scale * std::sqrt(H[1][1] / det);
    fit.length_sigma = what == Fitted::mu ? 0 : scale * std::sqrt(H[0][0] / det);
    const double d0 = std::clamp((b[0] * H[1][1] - b[1] * H[0][1]) / det, -0.5, 0.5);
    const double d1 = std::clamp((b[1] * H[0][0] - b[0] * H[1][0]) / det, -0.5, 0.5);
    fit.mu *= std::exp(d0);
    fit.length *= std::exp(d1);
    if (std::abs(d0) + std::abs(d1) < 1e-10) break;
  }
}

/// On the surface of the law's on which the samples lie best.
void solve(const std::string& model, const std::vector<SlipSample>& samples, Fitted what, SurfaceFit& fit) {
  const SurfaceFit start = fit;
  fit.scatter = HUGE_VAL;
  for (const auto& gauge : contact::wrench_gauges(model)) {
    SurfaceFit own = start;
    solve(gauge, samples, what, own);
    if (own.scatter < fit.scatter) fit = own;
  }
}

/// From the envelope: the largest force and torque ratios that are common.
SurfaceFit envelope(const std::vector<SlipSample>& samples) {
  std::vector<double> force, torque;
  for (const auto& s : samples) {
    force.push_back(std::hypot(s.ratio[0], s.ratio[1]));
    torque.push_back(std::abs(s.ratio[2]));
  }
  std::sort(force.begin(), force.end());
  std::sort(torque.begin(), torque.end());
  const std::size_t top = samples.size() * 9 / 10;
  SurfaceFit out;
  out.mu = std::clamp(force[top], 0.05, 3.0), out.length = std::clamp(torque[top] / out.mu, 1e-4, 0.1);
  return out;
}

/// What a friction coefficient and a length can be, and how well they must be known.
constexpr double kMu[2] = {1e-3, 20}, kLength[2] = {1e-5, 0.2};  // -, m
constexpr double kMostSigma = 0.15;                              // as a share

bool determines_both(const SurfaceFit& fit) {
  return fit.mu >= kMu[0] && fit.mu <= kMu[1] && fit.mu_sigma <= kMostSigma && fit.length >= kLength[0] &&
         fit.length <= kLength[1] && fit.length_sigma <= kMostSigma;
}

constexpr const char* kAdvice = "fit to all that the log holds (--fit), or give a card (--card)";

void estimate_delay(const datasets::ThrowLog& log, const std::vector<PreparedThrow>& throws,
                    const std::string& model, FrictionEstimate& out) {
  std::vector<double> delays;
  for (const auto& t : throws)
    if (t.split == datasets::Split::train && t.measured.detach_time)
      delays.push_back(*t.measured.detach_time - t.open_command);
  out.method = "delay: mean of detach minus opening command over the train throws";
  if (delays.empty()) {
    for (std::size_t i = 0; i < throws.size(); ++i)
      if (throws[i].split == datasets::Split::train)
        if (const auto seen = seen_delay(log, log.throws[i], throws[i])) delays.push_back(*seen);
    out.method =
        "delay: that after which carried objects fly as motion capture sees them, mean of the train throws";
  }
  if (delays.empty())
    throw Undetermined(model,
                       "the log shows no detach in any train throw (neither a normal force that ends, nor "
                       "detach_time, nor motion capture from the opening to the landing)",
                       "give a card (--card), or the throws their detach_time");
  double mean = 0, square = 0;
  const auto n = static_cast<double>(delays.size());
  for (const double d : delays) mean += d / n;
  for (const double d : delays) square += (d - mean) * (d - mean) / std::max(1.0, n - 1);
  mean = std::max(mean, 0.0);
  out.parameters.delay =
      square > 0 ? contact::DelayDistribution::normal(mean, std::sqrt(square), std::max(0.1, 2 * mean))
                 : contact::DelayDistribution::number(mean);
}

}  // namespace

void require_patch(const FrictionEstimate& estimate, const std::string& model) {
  if (!contact::follows_pads(model)) return;
  constexpr double kMostScatter = 0.25, kRadiusDoubt = 1.25;
  const auto refuse = [&](const char* what, const std::string& why) {
    throw Undetermined(
        model,
        fmt::format("the log does not determine the {}: {} F/T samples of slipping pads in its "
                    "train throws {}",
                    what, estimate.samples, why),
        kAdvice);
  };
  const auto require = [&](const char* what, double value, double sigma, const double(&range)[2]) {
    if (!(value >= range[0] && value <= range[1]))
      refuse(what, fmt::format("would make it {:.3g}, accepted are {:g} to {:g}", value, range[0], range[1]));
    if (!(sigma <= kMostSigma))
      refuse(what, fmt::format("leave it uncertain by {:.0f} %, accepted are {:.0f} %", 100 * sigma,
                               100 * kMostSigma));
  };
  require("friction coefficient", estimate.parameters.mu, estimate.mu_sigma, kMu);
  require("length of the pads [m]", estimate.parameters.length, estimate.length_sigma, kLength);
  if (!(estimate.scatter <= kMostScatter))
    refuse("friction", fmt::format("scatter by {:.0f} % about its limit surface, accepted are {:.0f} %",
                                   100 * estimate.scatter, 100 * kMostScatter));
  if (estimate.pad_radius && estimate.parameters.length > kRadiusDoubt * *estimate.pad_radius)
    refuse("length of the pads [m]",
           fmt::format("would make it {:.3g}, more than a pad of the declared radius, {:.3g} m, can have",
                       estimate.parameters.length, *estimate.pad_radius));
}

FrictionEstimate estimate_friction(const datasets::ThrowLog& log, const std::vector<PreparedThrow>& throws,
                                   const std::string& model) {
  require_release_model(model);
  FrictionEstimate out;
  if (std::none_of(throws.begin(), throws.end(),
                   [](const PreparedThrow& one) { return one.split == datasets::Split::train; }))
    throw Undetermined(model,
                       fmt::format("none of the log's {} throws has the split 'train', and parameters are "
                                   "estimated from no others",
                                   throws.size()),
                       "give a card (--card), or some throws the split 'train'");
  if (log.gripper) out.parameters.pads = log.gripper->n_pads;
  if (!contact::follows_pads(model)) {
    estimate_delay(log, throws, model, out);
    return out;
  }
  const auto samples = slipping_samples(log, throws);
  out.samples = static_cast<int>(samples.size());
  if (samples.size() < 10)
    throw Undetermined(
        model,
        fmt::format("the log determines no friction: {} F/T samples of evidently slipping pads "
                    "in its train throws, at least 10 are needed",
                    samples.size()),
        kAdvice);
  out.method = "friction: the pad's wrench on the limit surface where it evidently slips, train throws";
  if (log.gripper) out.pad_radius = log.gripper->pad_radius;
  SurfaceFit fit = envelope(samples);
  solve(model, samples, Fitted::both, fit);
  if (out.pad_radius && !determines_both(fit)) {
    fit = envelope(samples);
    fit.length = contact::kUniformDisc * *out.pad_radius;
    solve(model, samples, Fitted::mu, fit);
    out.method += "; the length is that of the declared pad_radius, since those wrenches do not determine it";
  }
  out.parameters.mu = fit.mu;
  out.parameters.length = fit.length;
  out.scatter = fit.scatter;
  out.mu_sigma = fit.mu_sigma, out.length_sigma = fit.length_sigma;
  return out;
}

}  // namespace unhand::experiment
