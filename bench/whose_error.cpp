// Which part of a landing error is the contact model, which its parameters, and which the integration:
//   build/release/bench/whose_error [THROWS]
// Random throws with a lever of 6 to 16 cm. The truth is a distributed patch: uniform, or with a property
// that the models do not know. Synthetic: every throw is made here.
#include <fmt/core.h>

#include <cstdlib>
#include <vector>

#include "apps/table.hpp"
#include "bench/reduced_models.hpp"
#include "dynamics/parallel.hpp"
#include "tests/support/random_throw.hpp"

namespace {

using namespace unhand;

/// What the truth has and the models do not know.
struct World {
  const char* title;
  double pressure_exponent, softness, mu_factor, radius_factor;
  bool same_torque;  ///< the models know the torque limit at the grip
};
constexpr World kWorlds[] = {{"uniform patch, all known", 0, 0, 1, 1, true},
                             {"Hertz pressure, torque limit known", 0.5, 0, 1, 1, true},
                             {"pressed at the rim (s = -0.4), torque limit known", -0.4, 0, 1, 1, true},
                             {"soft: radius ~ f_N^(1/3)", 0, 1.0 / 3, 1, 1, true},
                             {"20 % more friction than known", 0, 0, 1.2, 1, true},
                             {"20 % less friction than known", 0, 0, 1 / 1.2, 1, true},
                             {"radius 20 % larger than known", 0, 0, 1, 1.2, false}};

struct Model {
  const char* title;
  const char* name;
  double step;  ///< of the sign law [s]
};
constexpr Model kModels[] = {{"exact disc", "limit_surface_disc", 0},
                             {"ellipsoid", "limit_surface", 0},
                             {"sliding pivot", "sliding_pivot", 0},
                             {"sign law 0.1 ms", nullptr, 1e-4},
                             {"sign law 1 ms", nullptr, 1e-3}};
constexpr std::size_t kCount = std::size(kModels);

struct Errors {
  bool known{};
  double x[kCount]{}, theta[kCount]{};
};

Errors errors_of(const support::RandomThrow& drawn, const World& world, int rings) {
  const bench::Throw thrown{drawn.hand, drawn.force, drawn.body, drawn.grasp};
  const contact::Patch<double>& told = drawn.patch;
  const double f0 = drawn.force.profile().grip_force.a;
  const double c = contact::torque_factor(world.pressure_exponent);
  const double radius =
      told.radius * world.radius_factor * (world.same_torque ? told.torque_factor / c : 1.0);
  const auto truth = with_points(
      thrown, {told.mu * world.mu_factor, radius, crosscheck::disc_points(rings, world.pressure_exponent),
               told.pads, world.softness, f0});
  Errors out;
  if (!truth) return out;
  contact::ContactParameters<double> parameters;
  parameters.patch = told;
  for (std::size_t m = 0; m < kCount; ++m) {
    const auto& model = kModels[m];
    const auto landed =
        model.name ? with_model(thrown, model.name, parameters) : naively(thrown, told, model.step);
    if (!landed) return out;
    out.x[m] = landed->x - truth->x;
    out.theta[m] = (landed->theta - truth->theta) * 180 / 3.14159265358979;
  }
  out.known = true;
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  const std::size_t count = argc > 1 ? static_cast<std::size_t>(std::atoi(argv[1])) : 60;
  std::mt19937_64 random(2025);
  std::vector<support::RandomThrow> drawn;
  while (drawn.size() < count) {
    auto one = support::random_throw(random, 0);
    if (one.grasp.com_offset > 0.06) drawn.push_back(one);
  }
  apps::Table table{{"truth"}, {}, 1};
  for (const auto& model : kModels) table.header.push_back(model.title);
  for (const World& world : kWorlds) {
    std::vector<Errors> all(count);
    dynamics::parallel_for(count, 0, [&](std::size_t i) { all[i] = errors_of(drawn[i], world, 8); });
    std::vector<std::string> row{world.title};
    for (std::size_t m = 0; m < kCount; ++m) {
      double x = 0, theta = 0, n = 0;
      for (const auto& one : all)
        if (one.known) x += std::abs(one.x[m]), theta += std::abs(one.theta[m]), n += 1;
      row.push_back(fmt::format("{:.2f} / {:.2f}", 100 * x / n, theta / n));
    }
    table.rows.push_back(row);
  }
  fmt::print(
      "{} throws; mean absolute landing error [cm / deg] against the distributed patch (192 points)\n\n{}",
      count, table.text());
}
