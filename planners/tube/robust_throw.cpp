#include "planners/tube/robust_throw.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace unhand::planners {

double window_for(const ReleaseCard& card) {
  const double sticking = card.friction.adhesion > 0 ? card.friction.parting_time : 0;
  return card.dead_time.value + card.opening_time.value + sticking +
         4 * std::hypot(card.dead_time.sigma, card.opening_time.sigma);
}

std::optional<RobustThrow> plan_robust_throw(const ReleaseThrow& problem, const JointVector<double>& home,
                                             std::string* reason) {
  validate(problem);
  std::vector<int> joints;
  for (int i = 0; i < problem.chain.size(); ++i)
    if (std::abs(problem.start.qd[i]) > 1e-9) joints.push_back(i);
  RobustThrow out;
  out.choice = make_insensitive(problem, joints);
  if (!out.choice.lost.empty()) {
    if (reason != nullptr)
      *reason =
          fmt::format("a draw of {} within its spread does not land, so that no spread can be minimised",
                      out.choice.lost);
    return {};
  }
  ReleaseThrow chosen = problem;
  chosen.start = out.choice.start;
  chosen.qdd = out.choice.qdd;
  const Chain to_object =
      with_tool(problem.chain, {Eigen::Matrix3d::Identity(), {0, 0, problem.object.com_offset.value}});
  std::string why = "no ramp leads to its acceleration within the limits";
  std::optional<RobustThrow> best;
  for (const double share : {0.9, 0.65, 0.45, 0.3}) {
    auto moved = throw_motion(problem.chain, home, out.choice.start, out.choice.qdd, problem.hold, share);
    if (!moved) continue;
    out.limits = check_limits(problem.chain, *moved);
    out.limits.lowest = std::min(out.limits.lowest, check_limits(to_object, *moved).lowest);
    if (!out.limits.within())
      why = out.limits.worst(problem.chain);
    else if (!(out.limits.lowest > 0))
      why = fmt::format("it would come down to {:.2f} m", out.limits.lowest);
    else
      why = why_not_held(chosen, *moved);
    if (!why.empty()) continue;
    out.dropped = HeldMotion(chosen, *moved).drops(RobustThrow::kDraws, 1);
    out.motion = std::move(*moved);
    if (!best || out.dropped < best->dropped) best = out;
    if (best->dropped == 0) break;
  }
  if (!best && reason != nullptr) *reason = why;
  return best;
}

}  // namespace unhand::planners
