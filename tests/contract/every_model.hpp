// A test of every registered contact model, on random throws.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "contact/registry.hpp"
#include "tests/support/simple_scenes.hpp"

namespace unhand {

class EveryModel : public testing::TestWithParam<std::string> {
 protected:
  static std::unique_ptr<contact::ContactModel> make(const contact::ContactParameters<double>& p) {
    return contact::make_contact_model(GetParam(), p);
  }
  static bool carried() { return GetParam() == "gripper_delay"; }
  static bool decoupled() { return GetParam() == "sliding_pivot"; }
  static bool surface() { return !carried() && !decoupled(); }
};

/// The registered models whose contact is subject to friction: all but the one that carries whatever it
/// takes.
inline std::vector<std::string> models_with_friction() {
  auto names = contact::contact_model_names();
  std::erase(names, "gripper_delay");
  return names;
}

#define UNHAND_MODELS(Name, names)                           \
  INSTANTIATE_TEST_SUITE_P(, Name, testing::ValuesIn(names), \
                           [](const auto& model) { return std::string(model.param); })
#define UNHAND_EVERY_MODEL(Name) UNHAND_MODELS(Name, unhand::contact::contact_model_names())
#define UNHAND_EVERY_MODEL_WITH_FRICTION(Name) UNHAND_MODELS(Name, unhand::models_with_friction())

/// The inputs of a random throw, for a failure's message.
inline std::string describe(const support::RandomThrow& t) {
  std::ostringstream out;
  out.precision(17);
  const auto& q = t.force.profile();
  out << "mass " << t.body.mass << " inertia " << t.body.inertia << " com_offset " << t.grasp.com_offset
      << " angle " << t.grasp.angle << " mu " << t.patch.mu << " radius " << t.patch.radius << " open "
      << q.open_command << " grip " << q.grip_force.a << " dead " << q.dead_time.a << " opening "
      << q.opening_time.a << " shape " << q.shape.a << "; hand";
  for (double time : {0.0, 0.02}) {
    const auto h = t.hand.at({}, time);
    out << " [" << h.pose.x << ' ' << h.pose.z << ' ' << h.pose.theta << ' ' << h.twist.vx << ' '
        << h.twist.vz << ' ' << h.twist.omega << ' ' << h.acceleration.ax << ' ' << h.acceleration.az << ' '
        << h.acceleration.alpha << ']';
  }
  return out.str();
}

}  // namespace unhand
