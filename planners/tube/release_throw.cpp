#include "planners/tube/release_throw.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>

#include "contact/registry.hpp"
#include "datasets/near_miss.hpp"
#include "flight/fly.hpp"
#include "planners/tube/card_pads.hpp"
#include "planners/tube/held_motion.hpp"
#include "planners/tube/planar_hand.hpp"
#include "planners/tube/require.hpp"
#include "release/naive_release.hpp"
#include "release/simulate_release.hpp"

namespace unhand::planners {

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

const char* to_string(NumberSource source) {
  switch (source) {
    case NumberSource::assumed:
      return "assumed";
    case NumberSource::parameter:
      return "card";
    case NumberSource::range:
      return "card's range";
    case NumberSource::widened:
      return "assumed and card";
  }
  return "?";
}

namespace {

using datasets::CardError;

/// The numbers of a card, each into its place.
class CardReader {
 public:
  CardReader(const datasets::ModelCard& card, const std::string& file, ReleaseCard& out)
      : card_(card), file_(file), out_(out) {}

  void take(const char* name, const char* unit, double least, bool open, double most, double& value,
            double* sigma = nullptr) {
    known_.emplace_back(name);
    const auto found = card_.parameters.find(name);
    if (found == card_.parameters.end()) return;
    const std::string path = fmt::format("/parameters/{}", name);
    const datasets::CardParameter& told = found->second;
    if (told.unit != unit)
      throw CardError(file_, path + "/unit", fmt::format("is '{}', not '{}'", told.unit, unit));
    require(path + "/value", told.value, least, open, most);
    value = told.value;
    auto& origin = out_.origins[name] = {NumberSource::parameter, NumberSource::assumed};
    if (sigma == nullptr && told.sigma.value_or(0) > 0) out_.passed_over.emplace_back(name);
    if (sigma == nullptr || !told.sigma) return;
    *sigma = *told.sigma;
    origin.sigma = NumberSource::parameter;
  }

  /// The same, else from the valid range. `least_sigma` of what that tells.
  void take_or_range(const char* name, const char* unit, bool positive, double& value, double& sigma,
                     double least_share, double least_sigma) {
    take(name, unit, 0, positive, HUGE_VAL, value, &sigma);
    if (card_.parameters.contains(name)) return;
    const auto seen = datasets::middle_of_range(card_, file_, name, unit);
    if (!seen) return;
    require(fmt::format("/valid_range/{}", name), seen->value, 0, positive, HUGE_VAL);
    value = seen->value;
    sigma = std::max({*seen->sigma, least_share * seen->value, least_sigma});
    out_.origins[name] = {NumberSource::range, NumberSource::range};
  }

  /// σ of a spread from throw to throw, which comes on top of `base`; 0 where the card has none.
  double spread(const char* name, const char* unit, const char* adds_to, double base) {
    spreads_.emplace_back(name);
    const auto found = card_.own_spreads.find(name);
    if (found == card_.own_spreads.end()) return 0;
    if (found->second.unit != unit)
      throw CardError(file_, fmt::format("/own_spreads/{}/unit", name),
                      fmt::format("is '{}', not '{}'", found->second.unit, unit));
    NumberOrigin& origin = out_.origins[adds_to];
    if (origin.sigma == NumberSource::assumed)
      origin.sigma = base > 0 ? NumberSource::widened : NumberSource::parameter;
    if (found->second.sigma > 0 && adds_to != std::string_view(name)) origin.with.emplace_back(name);
    return found->second.sigma;
  }

  /// What the card's effects make of friction.
  contact::FrictionVariation<double> friction() {
    std::vector<std::string> names;
    std::vector<double> values;
    for (const std::string& id : card_.effects)
      if (const dynamics::Effect* effect = taken_effect(id))
        for (const auto& p : effect->parameters) {
          names.push_back(effect->full_name(p));
          values.push_back(p.neutral);
          take(names.back().c_str(), p.unit.c_str(), p.least.value_or(p.low), false, p.high, values.back());
        }
    contact::FrictionVariation<double> out;
    dynamics::apply_effects(contact::friction_effects(),
                            dynamics::Values<double>(std::span<const std::string>(names), values), out);
    take("reference_force", "N", 0, true, HUGE_VAL, out.reference_force);
    try {
      contact::validate(contact::constant(out));
    } catch (const std::invalid_argument& error) {
      throw CardError(file_, "/parameters", error.what());
    }
    return out;
  }

  /// Notes an effect on friction and gives its descriptor; null for those of sensors, of what a log measured
  /// or declared, whose parameters are passed over.
  const dynamics::Effect* taken_effect(const std::string& id) {
    for (const auto& one : contact::friction_effects())
      if (one.effect.id == id) {
        out_.effects.push_back(id);
        return &one.effect;
      }
    if (!id.starts_with("sensor."))
      throw CardError(file_, "/effects",
                      fmt::format("plans of throws take effects on friction, and pass over those of sensors; "
                                  "this card has {}",
                                  id));
    for (const auto& [name, ignored] : card_.parameters)
      if (name.starts_with(id + ".")) known_.push_back(name);
    return nullptr;
  }

  /// A spread that is right on any card of the model and moves nothing here.
  void pass_over_spread(const char* name) { spreads_.emplace_back(name); }

  void reject_unknown() const {
    for (const auto& [name, ignored] : card_.parameters)
      if (std::find(known_.begin(), known_.end(), name) == known_.end())
        throw CardError(file_, "/parameters/" + name,
                        fmt::format("is not what plans of throws take of a card of {}: {}", card_.model,
                                    fmt::join(known_, ", ")));
    for (const auto& [name, ignored] : card_.own_spreads)
      if (std::find(spreads_.begin(), spreads_.end(), name) == spreads_.end())
        throw CardError(
            file_, "/own_spreads/" + name,
            fmt::format("is not what plans of throws take of a card: {}", fmt::join(spreads_, ", ")));
  }

  /// The card's covariance of two parameters; 0 where it does not tell.
  double covariance(const char* a, const char* b) const {
    if (!card_.covariance) return 0;
    const auto& names = card_.covariance->names;
    const auto i = static_cast<std::size_t>(std::find(names.begin(), names.end(), a) - names.begin()),
               j = static_cast<std::size_t>(std::find(names.begin(), names.end(), b) - names.begin());
    return i < names.size() && j < names.size() ? card_.covariance->matrix[i * names.size() + j] : 0;
  }

 private:
  void require(const std::string& path, double value, double least, bool open, double most) const {
    if (!std::isfinite(value) || value < least || (open && value == least) || value > most)
      throw CardError(file_, path,
                      fmt::format("is {}; accepted: {}{}, {}{}", value, open ? '(' : '[', least, most,
                                  std::isfinite(most) ? ']' : ')'));
  }

  const datasets::ModelCard& card_;
  const std::string& file_;
  ReleaseCard& out_;
  std::vector<std::string> known_, spreads_;
};

}  // namespace

ReleaseCard release_card(const datasets::ModelCard& card, const std::string& file,
                         const ReleaseCard& otherwise) {
  const auto laws = contact::pad_law_names();
  if (std::find(laws.begin(), laws.end(), card.model) == laws.end())
    throw CardError(file, "/model",
                    datasets::unknown_name(fmt::format("'{}' does not say how the pads let go", card.model),
                                           card.model, laws));
  ReleaseCard out = otherwise;
  out.model = card.model;
  out.law_values.clear();
  out.effects.clear();
  out.passed_over.clear();
  CardReader reader(card, file, out);
  reader.take("mu", "-", 0, true, contact::kMostMu, out.mu.value, &out.mu.sigma);
  reader.take("length", "m", 0, true, contact::kUniformDisc, out.length, &out.length_sigma);
  for (const auto& own : contact::law_parameters(card.model)) {
    if (!card.parameters.contains(own.name)) continue;
    double value = own.start;
    reader.take(own.name.c_str(), own.unit.c_str(), own.low, false, own.high, value);
    out.law_values[own.name] = value;
  }
  constexpr int kMostPads = 1000;
  double pads = out.pads;
  reader.take("pads", "-", 0, true, HUGE_VAL, pads);
  if (pads != std::floor(pads) || pads > kMostPads)
    throw CardError(file, "/parameters/pads/value",
                    fmt::format("is {}; accepted: whole numbers from 1 to {}", pads, kMostPads));
  out.pads = static_cast<int>(pads);
  double force_sigma = 0;
  reader.take_or_range("grip_force", "N", true, out.grip_force, force_sigma, kLeastForceSigma, 0);
  reader.take_or_range("dead_time", "s", false, out.dead_time.value, out.dead_time.sigma, 0,
                       kLeastOpeningSigma);
  reader.take_or_range("opening_time", "s", true, out.opening_time.value, out.opening_time.sigma, 0,
                       kLeastOpeningSigma);
  reader.take_or_range("shape", "-", true, out.shape, out.shape_sigma, 0, 0);
  out.friction = reader.friction();
  reader.pass_over_spread("force_deviation");
  // Friction's limits know the product of mu and the force alone, of which a card without a measured force
  // knows more than of either.
  const double mu = out.mu.value, per_newton = mu / out.grip_force;
  const double variance = std::pow(out.mu.sigma, 2) + std::pow(per_newton * force_sigma, 2) +
                          2 * per_newton * reader.covariance("mu", "grip_force");
  if (force_sigma > 0) {
    NumberOrigin& origin = out.origins["mu"];
    if (origin.sigma == NumberSource::assumed) origin.sigma = NumberSource::widened;
    origin.with.emplace_back("grip_force");
    out.origins["grip_force"].counted_in = "mu";
  }
  out.mu.sigma = std::sqrt(std::max(0.0, variance));
  out.mu.sigma = std::hypot(out.mu.sigma, mu * reader.spread("mu_deviation", "-", "mu", out.mu.sigma));
  out.dead_time.sigma = std::hypot(
      out.dead_time.sigma, reader.spread("dead_time_deviation", "s", "dead_time", out.dead_time.sigma));
  out.grasp_offset = reader.spread("grasp_offset", "m", "com_offset", 0);
  out.grasp_angle = reader.spread("grasp_angle", "rad", "grasp_angle", 0);
  reader.reject_unknown();
  return out;
}

namespace {

/// The most that a draw may be.
double most_of(int unknown) {
  return unknown == kMu ? contact::kMostMu : unknown == kLength ? contact::kUniformDisc : HUGE_VAL;
}
/// The others may not be negative.
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
struct Thrown {
  S miss{}, detach_time{};
  double angle{}, speed{};
  bool slips_at_start{};
};

/// Which quantity carries derivatives is the caller's: hand, draw, or none.
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

JointVector<Dual> constant(const JointVector<double>& x) { return x.cast<Dual>(); }

PlanarHand hand_of(const ReleaseThrow& p, const JointVector<Dual>& qd, const JointVector<Dual>& qdd) {
  const ThrowPlane plane(forward_kinematics(p.chain, p.start.q).p, p.target);
  return {p.chain, plane, p.start.q, qd, qdd, p.hold};
}
PlanarHand hand_of(const ReleaseThrow& p) { return hand_of(p, constant(p.start.qd), constant(p.qdd)); }

}  // namespace

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
  out.mean = out.std = 0;
  const auto n = static_cast<double>(out.miss.size());
  for (const double x : out.miss) out.mean += x / n;
  for (const double x : out.miss) out.std += (x - out.mean) * (x - out.mean) / std::max(1.0, n - 1);
  out.std = std::sqrt(out.std);
}

namespace {

/// A draw of the unknown. One that may not be negative, or not above `most`, is drawn again while it is: the
/// last resort is the value.
template <class Normal>
double drawn(const Uncertain& one, bool may_be_negative, double most, Normal&& normal) {
  if (one.sigma == 0) return one.value;
  for (int attempt = 0; attempt < 1000; ++attempt)
    if (const double x = one.value + one.sigma * normal(); (may_be_negative || x >= 0) && x <= most) return x;
  return one.value;
}

}  // namespace

Landings draw_landings(const ReleaseThrow& problem, int count, std::uint64_t seed, const HeldMotion* before) {
  validate(problem);
  require(count >= 1, "draw_landings", "count", count, "[1, inf)");
  const auto unknowns = unknowns_of(problem);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const PlanarHand hand = hand_of(problem);
  Landings out;
  for (int i = 0; i < count; ++i) {
    Draw draw{};
    for (int k = 0; k < kUnknowns; ++k)
      draw[k] = drawn(unknowns[k], has_sign(k), most_of(k), [&] { return normal(random); });
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

namespace {

/// The landings at ± √p σ of each unknown, weighed so that their squares add to the mean square.
class Points {
 public:
  explicit Points(const ReleaseThrow& problem) {
    const auto unknowns = unknowns_of(problem);
    int p = 0;
    for (const Uncertain& one : unknowns) p += one.sigma > 0;
    if (p == 0) draws_.push_back(nominal_draw(problem)), moved_.emplace_back("their nominal values");
    for (int k = 0; k < kUnknowns; ++k)
      for (const double side : {-1.0, 1.0}) {
        if (!(unknowns[k].sigma > 0)) continue;
        Draw draw = nominal_draw(problem);
        draw[k] += side * std::sqrt(p) * unknowns[k].sigma;
        if (!has_sign(k)) draw[k] = std::clamp(draw[k], 0.05 * unknowns[k].value, most_of(k));
        draws_.push_back(draw);
        moved_.emplace_back(name_of(static_cast<Unknown>(k)));
      }
  }
  /// The first unknown of which a draw does not land; empty: all do.
  std::string lost(const ReleaseThrow& problem, const PlanarHand& hand) const {
    for (std::size_t i = 0; i < draws_.size(); ++i)
      if (!throw_once<double>(problem, hand, draws_[i])) return moved_[i];
    return "";
  }
  int size() const { return static_cast<int>(draws_.size()); }
  double weight() const { return 1 / std::sqrt(static_cast<double>(draws_.size())); }

  template <class S>
  std::optional<std::vector<S>> residuals(const ReleaseThrow& problem, const PlanarHand& hand) const {
    std::vector<S> out;
    for (const Draw& draw : draws_) {
      std::array<S, kUnknowns> given;
      for (int k = 0; k < kUnknowns; ++k) given[k] = S(draw[k]);
      const auto thrown = throw_once<S>(problem, hand, given);
      if (!thrown) return {};
      out.push_back(S(weight() * thrown->miss));
    }
    return out;
  }

 private:
  std::vector<Draw> draws_;
  std::vector<std::string> moved_;  ///< the unknown that is moved in a draw
};

/// Limits of what a step may change: rows of a quadratic program in (δq̇₀, δq̈).
std::vector<QpConstraint> step_limits(const ReleaseThrow& p, const std::vector<int>& joints) {
  constexpr double kReserve = 0.02;  // of the limits, kept free
  const int m = static_cast<int>(joints.size());
  std::vector<QpConstraint> out;
  for (int i = 0; i < m; ++i) {
    const int joint = joints[i];
    const JointLimits& l = p.chain.joints[joint].limits;
    const double v = (1 - kReserve) * l.velocity, a = (1 - kReserve) * l.acceleration;
    const double qd = p.start.qd[joint], qdd = p.qdd[joint];
    const auto add = [&](double by_rate, double by_acceleration, double now, double most) {
      for (const double side : {1.0, -1.0}) {
        QpConstraint row{QpVector::Zero(2 * m), -most - side * now, false};
        row.a[i] = side * by_rate;
        row.a[m + i] = side * by_acceleration;
        if (std::isfinite(most)) out.push_back(std::move(row));
      }
    };
    add(1, 0, qd, v);
    add(1, p.hold, qd + p.hold * qdd, v);
    add(0, 1, qdd, a);
  }
  return out;
}

double square_sum(const std::vector<double>& r) {
  double sum = 0;
  for (const double x : r) sum += x * x;
  return sum;
}

}  // namespace

InsensitiveResult make_insensitive(const ReleaseThrow& problem, const std::vector<int>& joints) {
  constexpr int kIterations = 15;      // at most
  constexpr double kTolerance = 1e-3;  // relative decrease of the cost at which it is enough
  constexpr std::size_t kMostJoints = dynamics::kDualSize / 2;
  validate(problem);
  if (joints.empty() || joints.size() > kMostJoints)
    throw std::invalid_argument(
        fmt::format("make_insensitive: {} joints named; accepted: 1 to {}", joints.size(), kMostJoints));
  require_distinct(problem.chain, "make_insensitive", joints);
  const int m = static_cast<int>(joints.size()), n = 2 * m;
  const Points points(problem);
  const auto moved = [&](const ThrowState& start, const JointVector<double>& qdd) {
    ReleaseThrow out = problem;
    out.start = start;
    out.qdd = qdd;
    return out;
  };
  const auto cost_of = [&](const ThrowState& start, const JointVector<double>& qdd) {
    const ReleaseThrow p = moved(start, qdd);
    const auto r = points.residuals<double>(p, hand_of(p));
    return r ? square_sum(*r) : std::numeric_limits<double>::infinity();
  };
  InsensitiveResult out{problem.start, problem.qdd, 0, 0, 0};
  double cost = cost_of(out.start, out.qdd), damping = 1e-3;
  out.before = out.after = std::sqrt(cost);
  if (!std::isfinite(cost)) out.lost = points.lost(problem, hand_of(problem));
  for (; std::isfinite(cost) && out.iterations < kIterations; ++out.iterations) {
    const ReleaseThrow at = moved(out.start, out.qdd);
    JointVector<Dual> qd = constant(at.start.qd), qdd = constant(at.qdd);
    for (int i = 0; i < m; ++i) {
      qd[joints[i]].v[i] = 1;
      qdd[joints[i]].v[m + i] = 1;
    }
    const auto residuals = points.residuals<Dual>(at, hand_of(at, qd, qdd));
    if (!residuals) break;
    QuadraticProgram step{QpMatrix::Zero(n, n), QpVector::Zero(n), step_limits(at, joints)};
    for (const Dual& r : *residuals)
      for (int i = 0; i < n; ++i) {
        step.c[i] += r.a * r.v[i];
        for (int j = 0; j < n; ++j) step.H(i, j) += r.v[i] * r.v[j];
      }
    const QpMatrix hessian = step.H;
    double tried = cost;
    for (int attempt = 0; attempt < 6 && !(tried < cost); ++attempt) {
      step.H = hessian;
      for (int i = 0; i < m; ++i) {  // a step of a whole limit costs `damping` square decimetres
        const JointLimits& l = problem.chain.joints[joints[i]].limits;
        step.H(i, i) += damping * 1e-2 / (l.velocity * l.velocity);
        step.H(m + i, m + i) += damping * 1e-2 / (l.acceleration * l.acceleration);
      }
      const QpSolution solution = solve(step);
      if (solution.outcome != QpOutcome::solved) break;
      ThrowState start = at.start;
      JointVector<double> acceleration = at.qdd;
      for (int i = 0; i < m; ++i) {
        start.qd[joints[i]] += solution.x[i];
        acceleration[joints[i]] += solution.x[m + i];
      }
      tried = cost_of(start, acceleration);
      damping *= tried < cost ? 0.3 : 8;
      if (tried < cost) {
        out.start = start;
        out.qdd = acceleration;
      }
    }
    if (!(tried < cost)) break;
    const bool enough = tried > (1 - kTolerance) * cost;
    cost = tried;
    if (enough) break;
  }
  out.after = std::sqrt(cost);
  return out;
}

}  // namespace unhand::planners
