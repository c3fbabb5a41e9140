// A throw log of your own, written and read back. docs/log-format.md says what each part means.
#include <cstdio>

#include "datasets/throw_log.hpp"
#include "experiment/synthetic_campaign.hpp"

using namespace unhand;
using namespace unhand::datasets;

/// Rows of `cols` numbers with their declared noise (1 sigma, one per column).
Series table(std::size_t cols, std::vector<double> sigma = {}) { return {0, cols, {}, std::move(sigma)}; }

void add(Series& to, std::initializer_list<double> row) {
  to.data.insert(to.data.end(), row);
  ++to.rows;
}

int main() {
  // In place of your instruments: twelve simulated throws.
  const ThrowLog lab = experiment::generate_campaign(experiment::campaign_design("quick12"), 1);

  ThrowLog log;
  log.title = "a bar with a weight at two places, thrown twelve times";
  log.source = "an example: simulated, not a measurement";
  log.gravity = 9.81;        // m/s^2
  log.landing_height = 0.0;  // m
  for (const auto& [name, measured] : lab.objects) {
    Object& bar = log.objects[name];
    bar.mass = measured.mass;              // kg, weighed
    bar.inertia = measured.inertia;        // kg m^2, about the centre of mass
    bar.com_offset = measured.com_offset;  // m, from the middle between the pads
  }
  Gripper& gripper = log.gripper.emplace();
  gripper.n_pads = 2;
  gripper.pad_radius = lab.gripper->pad_radius;                      // m
  gripper.opening_command_time = lab.gripper->opening_command_time;  // s, on the robot's clock

  for (const Throw& seen : lab.throws) {
    Throw& one = log.throws.emplace_back();
    one.id = seen.id;
    one.object = seen.object;
    one.condition = seen.condition;    // what is the same in all its repetitions
    one.repetition = seen.repetition;  // 1, 2, ...
    one.split = seen.split;            // some throws are held out: Split::test
    one.hand = {table(1), table(3, {1e-6, 1e-6, 1e-6}), table(3, {1e-6, 1e-6, 1e-6}),
                table(3, {1e-6, 1e-6, 1e-6})};
    for (std::size_t k = 0; k < seen.hand->time.rows; ++k) {
      const HandLog& hand = *seen.hand;
      add(one.hand->time, {hand.time(k)});                                           // s
      add(one.hand->pose, {hand.pose(k, 0), hand.pose(k, 1), hand.pose(k, 2)});      // m, m, rad
      add(one.hand->twist, {hand.twist(k, 0), hand.twist(k, 1), hand.twist(k, 2)});  // m/s, m/s, rad/s
      add(one.hand->acceleration,                                                    // m/s^2, m/s^2, rad/s^2
          {hand.acceleration(k, 0), hand.acceleration(k, 1), hand.acceleration(k, 2)});
    }
    one.hand_jump_times = seen.hand_jump_times;  // s, where the commanded acceleration jumps
    one.ft = {table(1), table(3, {0.02, 0.02, 2e-4}), table(1, {0.05})};
    for (std::size_t k = 0; k < seen.ft->time.rows; ++k) {
      const FtLog& ft = *seen.ft;
      add(one.ft->time, {ft.time(k)});
      add(one.ft->wrench,
          {ft.wrench(k, 0), ft.wrench(k, 1), ft.wrench(k, 2)});  // N, N, N m: one pad on the object
      add(one.ft->normal_force, {ft.normal_force(k, 0)});        // N, of that pad
    }
    one.mocap = {table(1), table(3, {2e-4, 2e-4, 3.5e-3}), {}};
    for (std::size_t k = 0; k < seen.mocap->time.rows; ++k) {
      const MocapLog& mocap = *seen.mocap;
      add(one.mocap->time, {mocap.time(k)});
      add(one.mocap->pose, {mocap.pose(k, 0), mocap.pose(k, 1), mocap.pose(k, 2)});  // of the centre of mass
      one.mocap->valid.push_back(mocap.is_valid(k));                                 // 0: the tracker lost it
    }
    one.landing = {table(1, {1e-3}), table(2, {1e-3, 9e-3})};
    add(one.landing->time, {seen.landing->time(0)});
    add(one.landing->pose, {seen.landing->pose(0, 0), seen.landing->pose(0, 1)});  // x [m], theta [rad]
  }

  write_throw_log("throws.h5", log);  // checks first; throws LogError with path and reason
  std::printf("throws.h5: %zu throws\n", read_throw_log("throws.h5").throws.size());
}
