// What throws may be asked for: sizes, ranges, finiteness.
#include <tuple>
#include <utility>

#include "contact/patch.hpp"
#include "contact/registry.hpp"
#include "planners/tube/nominal_throw.hpp"
#include "planners/tube/release_throw.hpp"
#include "planners/tube/require.hpp"

namespace unhand::planners {
namespace {

bool is_positive(double x) { return x > 0 && std::isfinite(x); }
bool is_not_negative(double x) { return x >= 0 && std::isfinite(x); }

void require_medium(const char* of, const flight::Medium& medium) {
  require(is_positive(medium.gravity), of, "gravity", medium.gravity, "(0, inf) m/s²");
  require(is_not_negative(medium.drag_k), of, "drag_k", medium.drag_k, "[0, inf) 1/m");
}

}  // namespace

void validate(const ReleaseThrow& p) {
  constexpr const char* kOf = "release throw";
  validate(p.chain);
  require_joints(p.chain, kOf, "q", p.start.q);
  require_joints(p.chain, kOf, "qd", p.start.qd);
  require_joints(p.chain, kOf, "qdd", p.qdd);
  for (const double x : p.target) require(std::isfinite(x), kOf, "target", x, "(-inf, inf) m");
  require(is_positive(p.hold), kOf, "hold", p.hold, "(0, inf) s");
  const ReleaseCard& c = p.card;
  if (!contact::follows_pads(c.model))
    throw std::invalid_argument(
        fmt::format("{}: model = {} does not follow the pads, whose opening plans are of", kOf, c.model));
  require(c.mu.value >= 0 && c.mu.value <= contact::kMostMu, kOf, "mu", c.mu.value,
          fmt::format("[0, {}]", contact::kMostMu).c_str());
  require(is_positive(c.length), kOf, "length", c.length, "(0, inf) m");
  require(c.pads >= 1, kOf, "pads", c.pads, "[1, inf)");
  require(is_positive(c.grip_force), kOf, "grip_force", c.grip_force, "(0, inf) N");
  require(is_not_negative(c.dead_time.value), kOf, "dead_time", c.dead_time.value, "[0, inf) s");
  require(is_positive(c.opening_time.value), kOf, "opening_time", c.opening_time.value, "(0, inf) s");
  require(is_positive(c.shape), kOf, "shape", c.shape, "(0, inf)");
  const HeldObject& o = p.object;
  require(is_positive(o.mass), kOf, "mass", o.mass, "(0, inf) kg");
  require(is_positive(o.inertia), kOf, "inertia", o.inertia, "(0, inf) kg m²");
  require(std::isfinite(o.com_offset.value), kOf, "com_offset", o.com_offset.value, "(-inf, inf) m");
  require(std::isfinite(o.angle), kOf, "angle of the object", o.angle, "(-inf, inf) rad");
  for (const auto& [name, sigma] : {std::pair{"sigma of mu", c.mu.sigma},
                                    {"sigma of dead_time", c.dead_time.sigma},
                                    {"sigma of opening_time", c.opening_time.sigma},
                                    {"sigma of com_offset", o.com_offset.sigma},
                                    {"sigma of length", c.length_sigma},
                                    {"sigma of shape", c.shape_sigma},
                                    {"sigma of mass", o.mass_sigma},
                                    {"sigma of inertia", o.inertia_sigma},
                                    {"grasp_offset", c.grasp_offset},
                                    {"grasp_angle", c.grasp_angle}})
    require(is_not_negative(sigma), kOf, name, sigma, "[0, inf)");
  require_medium(kOf, p.medium);
}

void validate(const NominalOptions& options, const Chain& chain) {
  constexpr const char* kOf = "throw search";
  require(options.window > 0 && options.window <= 1, kOf, "window", options.window, "(0, 1] s");
  require_medium(kOf, options.medium);
  for (const auto& [name, count, least] : {std::tuple{"samples", options.samples, 1},
                                           {"refined", options.refined, 0},
                                           {"candidates", options.candidates, 1},
                                           {"threads", options.threads, 0}})
    require(count >= least, kOf, name, count, least == 1 ? "[1, inf)" : "[0, inf)");
  std::vector<int> fixed;
  for (const auto& [joint, angle] : options.fixed) {
    fixed.push_back(joint);
    require(std::isfinite(angle), kOf, "angle of a fixed joint", angle, "(-inf, inf) rad");
  }
  require_distinct(chain, "throw search, fixed", fixed);
}

}  // namespace unhand::planners
