#include "crosscheck/distributed_patch.hpp"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace unhand::crosscheck {

using dynamics::Pose;
using dynamics::Vec2;
using release::ReleaseOutcome;
using release::ReleaseProblem;

namespace {

constexpr int kNewtonBudget = 100;  ///< iterations per step

void require(bool holds, const char* name, double value, const char* range) {
  if (!holds)
    throw std::invalid_argument(fmt::format("distributed patch: {} = {} is not in {}", name, value, range));
}

void validate(const DistributedPatch& patch, const PatchOptions& options) {
  require(patch.mu >= 0 && patch.mu <= 10, "mu", patch.mu, "[0, 10]");
  require(patch.radius > 0 && patch.radius <= 1, "radius", patch.radius, "(0, 1] m");
  require(!patch.points.empty(), "number of points", 0, "[1, ...)");
  require(patch.pads >= 1, "pads", patch.pads, "[1, ...)");
  require(patch.softness >= 0 && patch.softness <= 1, "softness", patch.softness, "[0, 1]");
  require(patch.reference_force > 0, "reference_force", patch.reference_force, "(0, ...) N");
  require(options.step > 0 && options.step <= 1e-3, "step", options.step, "(0, 1e-3] s");
  require(options.elastic_slip > 0, "elastic_slip", options.elastic_slip, "(0, ...) m");
  require(options.loss_time >= 0, "loss_time", options.loss_time, "[0, ...) s");
}

/// The steps of the coarser run: every kink of hand and force is a step's end.
std::vector<double> coarse_times(const ReleaseProblem<double>& problem, double end, double step) {
  std::vector<double> ends = problem.hand.jumps();
  problem.normal_force.kinks(ends);
  ends.push_back(end);
  std::sort(ends.begin(), ends.end());
  std::vector<double> times{problem.start};
  for (const double to : ends) {
    const double from = times.back();
    if (!(to > from) || to > end) continue;
    const int steps = std::max(1, static_cast<int>(std::ceil((to - from) / step)));
    for (int k = 1; k <= steps; ++k) times.push_back(k == steps ? to : from + (to - from) * k / steps);
  }
  return times;
}

/// The normal force at the start, or the largest at a kink after it [N].
double greatest_force(const ReleaseProblem<double>& problem) {
  double out = problem.normal_force.at({problem.start, problem.hand.end()}, problem.start);
  for (const double t : problem.normal_force.kinks()) {
    if (t <= problem.start || t >= problem.hand.end()) continue;
    out = std::max({out, problem.normal_force.at({problem.start, t}, t),
                    problem.normal_force.at({t, problem.hand.end()}, t)});
  }
  return out;
}

/// One run at given times. Twists are (v_x, v_z, ω) of the CoM in the world.
class Run {
 public:
  Run(const ReleaseProblem<double>& problem, const DistributedPatch& patch, const PatchOptions& options)
      : problem_(problem), patch_(patch), options_(options), count_(patch.points.size()) {
    for (auto* each : {&stretch_x_, &stretch_z_, &offset_x_, &offset_z_, &drive_x_, &drive_z_})
      each->resize(count_);
    for (const auto& point : patch.points) load_.push_back(point.load);
    const double t = problem.start;
    const auto hand = problem.hand.at({t, t + options.step}, t);
    const double theta = hand.pose.theta + problem.grasp.angle;
    const Vec2<double> r =
        dynamics::rotate(theta, Vec2<double>{problem.grasp.com_offset, problem.grasp.across});
    pose_ = {hand.pose.x + r.x, hand.pose.z + r.z, theta};
    const double omega = hand.twist.omega + problem.spin;
    twist_ = {hand.twist.vx + problem.slip.x - omega * r.z, hand.twist.vz + problem.slip.z + omega * r.x,
              omega};
    stiffness_ = patch.pads * std::max(patch.mu * greatest_force(problem), 1e-12) / options.elastic_slip;
    mass_ = {problem.body.mass, problem.body.mass, problem.body.inertia};
  }

  /// False if the iteration spends its budget.
  bool step(double from, double to) {
    const dynamics::Window window{from, to};
    const auto hand = problem_.hand.at(window, to);
    const double h = to - from, g = h + options_.loss_time, normal = problem_.normal_force.at(window, to);
    const double limit = patch_.pads * patch_.mu * normal;
    const double a = patch_.radius *
                     (patch_.softness > 0 ? std::pow(normal / patch_.reference_force, patch_.softness) : 1);
    const double c = std::cos(hand.pose.theta), s = std::sin(hand.pose.theta);
    // Lever of the hand from the CoM at the end of the step, as the old twist says: explicit here keeps the
    // step convex.
    const double hx = hand.pose.x - (pose_.x + h * twist_[0]), hz = hand.pose.z - (pose_.z + h * twist_[1]);
    const double omega = hand.twist.omega;
    for (std::size_t i = 0; i < count_; ++i) {
      const Vec2<double>& p = patch_.points[i].position;
      const double x = a * (c * p.x - s * p.z), z = a * (s * p.x + c * p.z);  // from the hand
      offset_x_[i] = hx + x, offset_z_[i] = hz + z;
      drive_x_[i] = c * stretch_x_[i] - s * stretch_z_[i] - g * (hand.twist.vx - omega * z);
      drive_z_[i] = s * stretch_x_[i] + c * stretch_z_[i] - g * (hand.twist.vz + omega * x);
    }
    const Eigen::Vector3d before = twist_;
    const Eigen::Vector3d weight{problem_.body.mass * problem_.gravity.x,
                                 problem_.body.mass * problem_.gravity.z, 0};
    // The start: as before, or carried by the hand, whichever is lower.
    Potential here = potential(twist_, before, weight, h, g, limit);
    const Eigen::Vector3d carried{hand.twist.vx + omega * hz, hand.twist.vz - omega * hx, omega};
    if (const Potential other = potential(carried, before, weight, h, g, limit); other.value < here.value)
      twist_ = carried, here = other;
    bool solved = false;
    for (int k = 0; k < kNewtonBudget && !solved; ++k) {
      const Eigen::Vector3d direction = -here.hessian.ldlt().solve(here.gradient);
      const double slope = here.gradient.dot(direction);
      // the gradient is a wrench in N: to 1e-12 of what the limit and the weight make it
      if (here.gradient.norm() <= 1e-12 * (limit + weight.norm() + (mass_.cwiseProduct(before) / h).norm()) ||
          std::abs(slope) <= 1e-28) {
        solved = true;
        break;
      }
      double reach = 1;
      Potential there = potential(twist_ + direction, before, weight, h, g, limit);
      for (int halving = 0;
           halving < 40 && there.value > here.value + 1e-4 * reach * slope + 1e-12 * std::abs(here.value);
           ++halving) {
        reach *= 0.5;
        there = potential(twist_ + reach * direction, before, weight, h, g, limit);
      }
      const double moved = reach * direction.norm();
      twist_ += reach * direction;
      here = there;
      if (moved <= 1e-14 * (1 + twist_.norm())) solved = true;
    }
    pose_ = {pose_.x + h * twist_[0], pose_.z + h * twist_[1], pose_.theta + h * twist_[2]};
    const double most = limit / stiffness_;
    // The bristles as the new twist leaves them, in the hand's frame.
    for (std::size_t i = 0; i < count_; ++i) {
      const double ex = drive_x_[i] + g * (twist_[0] - twist_[2] * offset_z_[i]);
      const double ez = drive_z_[i] + g * (twist_[1] + twist_[2] * offset_x_[i]);
      // e = s₀ + g v, and the bristle itself goes to s₀ + h v
      const double x = stretch_x_[i] + h / g * (c * ex + s * ez - stretch_x_[i]);
      const double z = stretch_z_[i] + h / g * (c * ez - s * ex - stretch_z_[i]);
      const double size = std::hypot(x, z), kept = size > most ? most / size : 1.0;
      stretch_x_[i] = kept * x, stretch_z_[i] = kept * z;
    }
    return solved;
  }

  release::DetachState<double> state(double t) const { return {t, pose_, {twist_[0], twist_[1], twist_[2]}}; }

 private:
  struct Potential {
    double value{};
    Eigen::Vector3d gradient;
    Eigen::Matrix3d hessian;
  };

  /// Φ(V) = (V − V₀)ᵀ M (V − V₀)/(2h) − m g·V + Σ ψ_i,  ψ_i = K w_i |e|²/(2g) up to the yield, linear beyond
  /// it, with e = s + g v, g = h + T. Without a branch, so that the compiler takes several points at once.
  Potential potential(const Eigen::Vector3d& twist, const Eigen::Vector3d& before,
                      const Eigen::Vector3d& weight, double h, double g, double limit) const {
    const double vx = g * twist[0], vz = g * twist[1], turn = g * twist[2], most = limit / stiffness_;
    double energy = 0, fx = 0, fz = 0, tau = 0, xx = 0, xz = 0, zz = 0, xt = 0, zt = 0, tt = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double x = offset_x_[i], z = offset_z_[i];
      const double sx = drive_x_[i] + vx - turn * z, sz = drive_z_[i] + vz + turn * x;
      const double size = std::sqrt(sx * sx + sz * sz), held = std::min(size, most);
      const double k = load_[i] * (size > most ? most / size : 1.0);  // secant stiffness, in units of K
      const double bent = size > most ? k / (size * size) : 0.0;      // by how much less along the stretch
      energy += load_[i] * held * (size - 0.5 * held);
      const double px = k * sx, pz = k * sz;
      fx += px, fz += pz, tau += x * pz - z * px;
      const double axx = k - bent * sx * sx, axz = -bent * sx * sz, azz = k - bent * sz * sz;
      const double ax = x * axz - z * axx, az = x * azz - z * axz;
      xx += axx, xz += axz, zz += azz, xt += ax, zt += az, tt += x * az - z * ax;
    }
    const Eigen::Vector3d change = twist - before, momentum = mass_.cwiseProduct(change) / h;
    Potential out{0.5 * change.dot(momentum) - weight.dot(twist) + stiffness_ * energy / g,
                  momentum - weight + stiffness_ * Eigen::Vector3d(fx, fz, tau), Eigen::Matrix3d()};
    out.hessian << xx, xz, xt, xz, zz, zt, xt, zt, tt;
    out.hessian = stiffness_ * g * out.hessian + Eigen::Matrix3d((mass_ / h).asDiagonal());
    return out;
  }

  const ReleaseProblem<double>& problem_;
  const DistributedPatch& patch_;
  const PatchOptions& options_;
  Pose<double> pose_;
  Eigen::Vector3d twist_, mass_;
  double stiffness_{};
  std::size_t count_;
  std::vector<double> load_;
  std::vector<double> stretch_x_, stretch_z_;  // in the hand's frame
  std::vector<double> offset_x_, offset_z_, drive_x_,
      drive_z_;  // from the CoM; the stretch without the twist
};

}  // namespace

std::vector<PatchPoint> disc_points(int rings, double pressure_exponent) {
  require(rings >= 1 && rings <= 1000, "rings", rings, "[1, 1000]");
  require(pressure_exponent > -1 && pressure_exponent <= 1000, "pressure_exponent", pressure_exponent,
          "(-1, 1000]");
  std::vector<PatchPoint> out;
  const double n = rings;
  for (int j = 1; j <= rings; ++j) {
    const double u = ((j - 1.0) * (j - 1.0) + 1.0 * j * j) / (2 * n * n);
    const double rho = std::sqrt(1 - std::pow(1 - u, 1 / (pressure_exponent + 1)));
    const int count = 3 * (2 * j - 1);
    for (int k = 0; k < count; ++k) {
      // each ring is turned by another part of a step, so that no direction is marked
      const double angle = 2 * std::numbers::pi * (k + std::fmod(j * std::numbers::phi, 1.0)) / count;
      out.push_back({{rho * std::cos(angle), rho * std::sin(angle)}, 1 / (3 * n * n)});
    }
  }
  return out;
}

PatchResult simulate_distributed_patch(const ReleaseProblem<double>& problem, const DistributedPatch& patch,
                                       const PatchOptions& options) {
  release::validate(problem);
  validate(patch, options);
  const double release = problem.normal_force.release_time();
  const bool parts = release <= problem.hand.end();
  const double end = parts ? release : problem.hand.end();
  require(problem.start < end, "start", problem.start, fmt::format("(..., {}) s", end).c_str());
  const auto times = coarse_times(problem, end, options.step);

  PatchResult result;
  Run coarse(problem, patch, options), fine(problem, patch, options);
  for (std::size_t k = 1; k < times.size(); ++k) {
    const double middle = 0.5 * (times[k - 1] + times[k]);
    if (!coarse.step(times[k - 1], times[k]) || !fine.step(times[k - 1], middle) ||
        !fine.step(middle, times[k])) {
      result.outcome = ReleaseOutcome::not_solved;
      return result;
    }
  }
  const auto a = coarse.state(end), b = fine.state(end);
  const auto limit = [](double coarser, double finer) { return 2 * finer - coarser; };
  result.detach = {
      end,
      {limit(a.pose.x, b.pose.x), limit(a.pose.z, b.pose.z), limit(a.pose.theta, b.pose.theta)},
      {limit(a.twist.vx, b.twist.vx), limit(a.twist.vz, b.twist.vz), limit(a.twist.omega, b.twist.omega)}};
  result.time_error = std::max({std::abs(b.twist.vx - a.twist.vx), std::abs(b.twist.vz - a.twist.vz),
                                std::abs(b.twist.omega - a.twist.omega)});
  result.outcome = parts ? ReleaseOutcome::detached : ReleaseOutcome::never_separated;
  return result;
}

}  // namespace unhand::crosscheck
