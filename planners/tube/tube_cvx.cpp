#include "planners/tube/tube_cvx.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <optional>

#include "planners/arm/kinematics.hpp"
#include "planners/tube/require.hpp"

namespace unhand::planners {

using Eigen::Vector2d, Eigen::Vector3d;

namespace {

void check(const TubeProblem& p) {
  require_joints(p.chain, "tube", "q", p.start.q);
  require_joints(p.chain, "tube", "qd", p.start.qd);
  require(p.window > 0 && p.window <= 1, "tube", "window", p.window, "(0, 1] s");
  for (const double x : p.target) require(std::isfinite(x), "tube", "target", x, "(-inf, inf) m");
  require_distinct(p.chain, "tube, held", p.held);
}

/// What is known at the window's end before q̈ is: kinematics, and the flow map without acceleration.
struct End {
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxJoints> J;  ///< of the tip's position
  Vector2d along;
  flight::PlaneState<double> state;  ///< (r, z, ṙ, ż) with q̇₀ [LiuBillard2024]: r = −|e| for e the level
                                     ///< part of E → B
  std::optional<flight::FlowMap> flow;
};
End end_of(const TubeProblem& p) {
  const JointVector<double> q = p.start.q + p.window * p.start.qd;
  const auto frames = frames_of(p.chain, q);
  End out;
  out.J = jacobian(p.chain, frames).topRows<3>();
  const Vector3d velocity = out.J * p.start.qd;
  const Vector3d e = p.target - frames.tip.p;
  out.along = e.head<2>().normalized();
  // Eq. 2h: ṙ is the level speed, whatever its direction; aligned it is the velocity along e.
  out.state = {-e.head<2>().norm(), -e.z(), velocity.head<2>().norm(), velocity.z()};
  out.flow = flight::flow_map(out.state, p.medium);
  return out;
}

/// Eq. 2k and 2l of a step from the acceleration `at`, one by one; names are made where they are asked for.
template <class Add>
void add_limits(const TubeProblem& p, const QpVector& at, Add&& add) {
  const double T = p.window;
  for (int i = 0; i < p.chain.size(); ++i) {
    const JointLimits& limits = p.chain.joints[i].limits;
    const std::string& joint = p.chain.joints[i].name;
    QpVector unit = QpVector::Zero(p.chain.size());
    for (const double side : {1.0, -1.0}) {
      unit[i] = side;
      const char* relation = side > 0 ? ">=" : "<=";
      if (std::isfinite(limits.velocity))
        add(
            [&] {
              return fmt::format("the velocity limit of {} ({} {:.4g} rad/s)", joint, relation,
                                 -side * limits.velocity);
            },
            QpVector(T * unit), -limits.velocity - side * (p.start.qd[i] + T * at[i]));
      if (std::isfinite(limits.acceleration))
        add(
            [&] {
              return fmt::format("the acceleration limit of {} ({} {:.4g} rad/s^2)", joint, relation,
                                 -side * limits.acceleration);
            },
            unit, -limits.acceleration - side * at[i]);
    }
  }
}

struct TubeProgram {
  QuadraticProgram qp;             ///< unknowns q̈
  std::vector<std::string> names;  ///< of its constraints
};

TubeProgram program_of(const TubeProblem& p, const End& end) {
  const int n = p.chain.size();
  const double T = p.window;
  TubeProgram out;
  out.qp.H = QpMatrix::Zero(n, n);
  out.qp.c = QpVector::Zero(n);
  for (int i = 0; i < n; ++i) {
    const double most = p.chain.joints[i].limits.acceleration;
    out.qp.H(i, i) = std::isfinite(most) ? 1 / (most * most) : 1;
  }
  const auto add = [&](std::string name, const QpVector& a, double b, bool equality) {
    out.qp.constraints.push_back({a, b, equality});
    out.names.push_back(std::move(name));
  };
  const QpVector ahead = end.J.topRows<2>().transpose() * end.along, up = end.J.row(2).transpose(),
                 across = end.J.topRows<2>().transpose() * Vector2d(-end.along.y(), end.along.x());
  add("the throw's direction", T * across, -across.dot(p.start.qd), true);
  const auto& gradient = end.flow->gradient;
  QpVector row = gradient[2] * ahead + gradient[3] * up;
  for (const int i : p.held) row[i] = 0;
  const double now = gradient[2] * end.state.r_rate + gradient[3] * end.state.z_rate;
  add("the landing", T * row, now - row.dot(p.start.qd) - end.flow->landing, true);
  add_limits(p, QpVector::Zero(n),
             [&](const auto& name, const QpVector& a, double b) { add(name(), a, b, false); });
  return out;
}

}  // namespace

TubeSolution solve_tube(const TubeProblem& problem) {
  check(problem);
  TubeSolution out;
  const int n = problem.chain.size();
  out.qdd = JointVector<double>::Zero(n);
  for (int i = 0; i < n; ++i) {
    const Joint& joint = problem.chain.joints[i];
    const double q = problem.start.q[i] + problem.window * problem.start.qd[i];
    if (q < joint.limits.lower || q > joint.limits.upper) {
      out.outcome = TubeOutcome::infeasible;
      out.reason = fmt::format("at the end of the window {} is at {:.4g} rad, outside [{}, {}]", joint.name,
                               q, joint.limits.lower, joint.limits.upper);
      return out;
    }
  }
  const End end = end_of(problem);
  if (!end.flow) {
    out.outcome = TubeOutcome::never_reaches;
    out.reason = "thrown at the end of the window, the object does not rise to the target's height";
    return out;
  }
  const TubeProgram program = program_of(problem, end);
  const QpSolution solution = solve(program.qp);
  out.qdd = solution.x;
  if (solution.outcome != QpOutcome::solved) {
    out.outcome = TubeOutcome::infeasible;
    std::vector<std::string> names;
    for (const int k : solution.conflict) names.push_back(program.names[k]);
    out.reason = names.empty() ? fmt::format("the program is {}", to_string(solution.outcome))
                               : fmt::format("cannot hold together: {}", fmt::join(names, ", "));
  }
  return out;
}

namespace {

/// Of the target, forward and across.
template <class S>
struct Miss {
  S forward{}, across{};
};
/// Where an object that leaves at t lands. Empty if it never gets to the target's height.
template <class S>
std::optional<Miss<S>> miss_at(const TubeProblem& p, const Vector2d& along, const JointVector<S>& qdd,
                               double t) {
  using std::sqrt;
  const int n = p.chain.size();
  JointVector<S> q(n), qd(n);
  for (int i = 0; i < n; ++i) {
    q[i] = p.start.q[i] + t * p.start.qd[i] + (0.5 * t * t) * qdd[i];
    qd[i] = p.start.qd[i] + t * qdd[i];
  }
  const TipMotion<S> tip = tip_motion<S>(p.chain, q, qd, JointVector<S>::Zero(n));
  const Vector3<S>& v = tip.velocity;
  const S square = v[0] * v[0] + v[1] * v[1];
  if (!(dynamics::value_of(square) > 0)) return {};
  const S speed = sqrt(square);
  const auto landing =
      flight::landing_of<S>({S(0.0), S(tip.frame.p[2] - p.target.z()), speed, v[2]}, p.medium);
  if (!landing) return {};
  const S x = tip.frame.p[0] + landing->r * v[0] / speed - p.target.x(),
          y = tip.frame.p[1] + landing->r * v[1] / speed - p.target.y();
  return Miss<S>{along.x() * x + along.y() * y, along.x() * y - along.y() * x};
}

Vector2d forward_of(const TubeProblem& p) {
  return (p.target - forward_kinematics(p.chain, p.start.q).p).head<2>().normalized();
}

}  // namespace

std::vector<LandingAt> landings_over_window(const TubeProblem& problem, const JointVector<double>& qdd,
                                            int samples) {
  check(problem);
  require_joints(problem.chain, "tube", "qdd", qdd);
  require(samples >= 1, "tube", "samples", samples, "[1, inf)");
  const Vector2d along = forward_of(problem);
  std::vector<LandingAt> out;
  for (int k = 0; k < samples; ++k) {
    LandingAt at;
    at.time = problem.window * k / std::max(1, samples - 1);
    if (const auto miss = miss_at(problem, along, qdd, at.time)) {
      at.lands = true;
      at.forward = miss->forward, at.across = miss->across;
      at.x = along.x() * at.forward - along.y() * at.across;
      at.y = along.y() * at.forward + along.x() * at.across;
    }
    out.push_back(at);
  }
  return out;
}

namespace {

constexpr double kEase = 1e-6;  ///< (1 mm)²: the weight of an acceleration at its limit
constexpr int kInstants = 4;    ///< of the window
constexpr int kSteps = 6;       ///< of Gauss-Newton, at most

/// Σ_k miss² + ease, and its Gauss-Newton model where `model` is given.
double refine_cost(const TubeProblem& p, const Vector2d& along, const JointVector<double>& qdd,
                   QuadraticProgram* model = nullptr) {
  const int n = p.chain.size();
  double cost = 0;
  if (model != nullptr) model->H = QpMatrix::Zero(n, n), model->c = QpVector::Zero(n);
  const auto add = [&](const Dual& r) {
    cost += r.a * r.a;
    for (int i = 0; model != nullptr && i < n; ++i) {
      model->c[i] += r.a * r.v[i];
      for (int j = 0; j < n; ++j) model->H(i, j) += r.v[i] * r.v[j];
    }
  };
  JointVector<Dual> seeded(n);
  for (int i = 0; i < n; ++i) seeded[i] = dynamics::independent(qdd[i], i);
  for (int k = 1; k <= kInstants; ++k) {
    const double t = p.window * k / kInstants;
    if (model == nullptr) {
      const auto miss = miss_at(p, along, qdd, t);
      if (!miss) return JointLimits::kNone;
      cost += miss->forward * miss->forward + miss->across * miss->across;
    } else {
      const auto miss = miss_at(p, along, seeded, t);
      if (!miss) return JointLimits::kNone;
      Dual forward = miss->forward;
      for (const int i : p.held) forward.v[i] = 0;
      add(forward);
      add(miss->across);
    }
  }
  for (int i = 0; i < n; ++i) {
    const double most = p.chain.joints[i].limits.acceleration,
                 weight = std::isfinite(most) ? kEase / (most * most) : kEase;
    cost += weight * qdd[i] * qdd[i];
    if (model != nullptr) model->H(i, i) += weight, model->c[i] += weight * qdd[i];
  }
  return cost;
}

}  // namespace

JointVector<double> refine_tube(const TubeProblem& problem, const JointVector<double>& start) {
  check(problem);
  require_joints(problem.chain, "tube", "qdd", start);
  const Vector2d along = forward_of(problem);
  JointVector<double> at = start;
  double cost = refine_cost(problem, along, at);
  QuadraticProgram step;
  for (int iteration = 0; iteration < kSteps && std::isfinite(cost); ++iteration) {
    refine_cost(problem, along, at, &step);
    step.constraints.clear();
    add_limits(problem, at, [&](const auto&, const QpVector& a, double b) {
      step.constraints.push_back({a, b, false});
    });
    const QpSolution solution = solve(step);
    if (solution.outcome != QpOutcome::solved) break;
    double share = 1, tried = cost;
    for (; share > 0.1; share *= 0.5) {
      tried = refine_cost(problem, along, at + share * solution.x);
      if (tried < cost) break;
    }
    if (!(tried < cost)) break;
    at += share * solution.x;
    const bool enough = tried > 0.999 * cost;
    cost = tried;
    if (enough) break;
  }
  return at;
}

}  // namespace unhand::planners
