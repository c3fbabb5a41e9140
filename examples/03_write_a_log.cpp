// A throw log of your own, written and read back. docs/log-format.md says what each part means.
#include <cmath>
#include <cstdio>

#include "datasets/throw_log.hpp"

using namespace unhand::datasets;

/// Rows of `cols` numbers with their declared noise (1 sigma, one per column).
Series table(std::size_t cols, std::vector<double> sigma = {}) { return {0, cols, {}, std::move(sigma)}; }

void add(Series& to, std::initializer_list<double> row) {
  to.data.insert(to.data.end(), row);
  ++to.rows;
}

int main() {
  ThrowLog log;
  log.title = "a bottle, thrown once";
  log.source = "an example: made-up numbers, not a measurement";
  log.gravity = 9.81;
  log.landing_height = 0.0;
  Object& bottle = log.objects["bottle"];
  bottle.mass = 0.31;
  bottle.inertia = {1.9e-3};
  bottle.com_offset = 0.05;
  log.gripper.emplace().opening_command_time = 0.10;

  Throw one;
  one.id = "001";
  one.object = "bottle";
  one.condition = "slow";
  one.split = Split::train;
  one.hand = {table(1), table(3, {1e-4, 1e-4, 1e-4}), table(3, {1e-3, 1e-3, 1e-3}),
              table(3, {0.1, 0.1, 0.1})};
  one.ft = {table(1), table(3, {0.02, 0.02, 2e-4}), table(1, {0.05})};
  for (int k = 0; k <= 250; ++k) {
    const double t = 1e-3 * k;  // s
    add(one.hand->time, {t});
    add(one.hand->pose, {0.5 + 1.5 * t, 0.8 + 1.5 * t, 0.3});
    add(one.hand->twist, {1.5, 1.5, 0.0});
    add(one.hand->acceleration, {0.0, 0.0, 0.0});
    add(one.ft->time, {t});
    add(one.ft->wrench, {0.0, t < 0.15 ? 1.5 : 0.0, 0.0});  // one pad on the object, in the hand frame
    add(one.ft->normal_force, {40 * std::fmax(0.0, 1 - std::fmax(0.0, t - 0.11) / 0.04)});
  }
  one.grasp_angle = 0.0;
  one.landing = {table(1, {1e-3}), table(2, {1e-3, 9e-3})};
  add(one.landing->time, {0.70});
  add(one.landing->pose, {1.55, 0.3});
  log.throws.push_back(one);

  write_throw_log("throws.h5", log);  // checks first; throws LogError with path and reason
  std::printf("throws.h5: %zu throw\n", read_throw_log("throws.h5").throws.size());
}
