// A throw that lands where it should although friction, gripper and grasp are known only so well: the Panda
// throws a bar, held beside its centre of mass, into a box.
#include <cmath>
#include <cstdio>
#include <utility>

#include "planners/arm/panda.hpp"
#include "planners/tube/planar_joints.hpp"
#include "planners/tube/robust_throw.hpp"

using namespace unhand::planners;

int main() {
  const Chain arm = with_gripper(panda(), 0.15, 0.9);  // m, kg: its tip is the middle of the pads
  const TargetBox box{{1.3, 0, -0.2}};                 // m

  ReleaseCard card;  // or release_card(datasets::read_model_card("card.json"), "card.json")
  card.model = "limit_surface_disc";
  card.mu = {0.5, 0.03};                               // 1 sigma
  card.length = 0.007;                                 // m
  card.grip_force = 40;                                // N, of one pad
  card.dead_time = {0.020, 0.003};                     // s
  card.opening_time = {0.060, 0.004};                  // s
  const HeldObject bar{0.246, 2.4e-3, {0.10, 0.003}};  // kg, kg m2, m from the pads

  // A throw in the vertical plane of the target, along states that all land there.
  PlanOptions options;
  options.home = panda_ready();
  const auto held = planar_joints(arm, options.home, box.middle);
  if (!held) return 1;
  options.search.fixed = *held;
  options.search.window = std::fmax(0.1, window_for(card));
  const Chain to_bar = with_tool(arm, {Eigen::Matrix3d::Identity(), {0, 0, bar.com_offset.value}});
  const auto tube = plan_throw(to_bar, box, options);
  if (!tube.plan) {
    std::printf("%s: %s\n", to_string(tube.outcome), tube.reason.c_str());
    return 1;
  }

  // The bar turns in the pads before it is free: of the throws nearby, the one whose landing minds least.
  ReleaseThrow release{arm, tube.plan->nominal.state, tube.plan->qdd, box.middle};
  release.hold = options.search.window + 1e-6;
  release.card = card;
  release.object = bar;
  const auto before = draw_landings(release, 300, 1);
  const auto robust = plan_robust_throw(release, options.home);
  if (!robust) {
    std::printf("no motion to the robust throw stays within the limits\n");
    return 1;
  }
  release.start = robust->choice.start;
  release.qdd = robust->choice.qdd;
  const auto after = draw_landings(release, 300, 1);
  for (const auto& [name, drawn] : {std::pair{"tube acceleration", before}, {"robust", after}})
    std::printf("%-18s lands %+.3f m from the middle, spread %.3f m (1 sigma of %zu draws)\n", name,
                drawn.mean, drawn.std, drawn.miss.size());
  std::printf("its motion takes %.2f s, from rest to rest\n", robust->motion.end() - robust->motion.begin);
  return std::abs(after.mean) < 0.075 && after.std < before.std ? 0 : 1;
}
