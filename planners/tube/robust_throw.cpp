#include "planners/tube/robust_throw.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace unhand::planners {

double window_for(const ReleaseCard& card) {
  return card.dead_time.value + card.opening_time.value +
         4 * std::hypot(card.dead_time.sigma, card.opening_time.sigma);
}

std::optional<RobustThrow> plan_robust_throw(const ReleaseThrow& problem, const PlanOptions& options) {
  validate(problem);
  InsensitiveOptions insensitive;
  for (int i = 0; i < problem.chain.size(); ++i)
    if (std::abs(problem.start.qd[i]) > 1e-9) insensitive.joints.push_back(i);
  RobustThrow out;
  out.choice = make_insensitive(problem, insensitive);
  const JointVector<double> home = options.home.size() == 0 ? middle_of(problem.chain) : options.home;
  MotionOptions motion = options.motion;
  motion.window = problem.hold;
  for (const double share : {0.9, 0.65, 0.45, 0.3}) {
    motion.acceleration_share = out.acceleration_share = std::min(share, options.motion.acceleration_share);
    auto moved = throw_motion(problem.chain, home, out.choice.start, out.choice.qdd, motion);
    if (!moved) continue;
    out.limits = check_limits(problem.chain, *moved, options.check_step);
    if (!out.limits.within()) continue;
    out.motion = std::move(*moved);
    return out;
  }
  return {};
}

}  // namespace unhand::planners
