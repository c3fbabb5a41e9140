// Predictions with the true parameters see exactly what the generator makes, with every effect.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/perfect_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;
using namespace unhand::testing_support;
using dynamics::Effect;

/// The worst residual of each channel, over a throw predicted with the parameters that made it.
struct Worst {
  std::array<double, kChannelCount> of{};
  int observations{};
  bool landing_timed{};
};

/// `told`: the prediction knows the effects.
Worst consistency(const CampaignDesign& design, int index, bool exact_inputs, bool told) {
  datasets::ThrowLog log = campaign_header(design, kSeed);
  const auto [record, truth] = generate_throw(design, kSeed, index);
  log.throws = {record};
  PreparedThrow prepared = prepare(log, log.throws[0], "(in memory)");
  Observations observed = observe(log, log.throws[0], prepared);
  if (exact_inputs) {  // neither spline: the commanded hand itself, and the profile by its parameters
    prepared.hand = polynomial_hand(throw_motion(design.arm, truth.motion));
    prepared.normal_force.reset();
  }
  const OwnEffects effects(told ? design.effects : EffectSettings{}, record.object);
  std::vector<std::string> names = effects.names();
  std::vector<double> numbers = effects.numbers();
  const auto add = [&](const char* name, double value) {
    names.emplace_back(name);
    numbers.push_back(value);
  };
  add("mu", truth.patch.mu);
  add("length", truth.patch.length());
  add("grip_force", truth.opening.grip_force);
  add("dead_time", truth.opening.dead_time);
  add("opening_time", truth.opening.opening_time);
  add("shape", truth.opening.shape);
  add("grasp_angle", truth.grasp_angle - prepared.grasp.angle);
  add("grasp_offset", truth.grasp_offset);
  add("grasp_across", truth.grasp_across);
  const ThrowModel model{design.contact_model, truth.patch.pads, design.reference_force(), design.integrator};
  const auto predicted =
      predict_channels(prepared, observed, model, dynamics::Values<double>(names, numbers));
  Worst worst;
  if (predicted.channels.size() != observed.all.size()) return worst;
  for (std::size_t i = 0; i < observed.all.size(); ++i) {
    double& w = worst.of[static_cast<std::size_t>(observed.all[i].channel)];
    w = std::max(w, std::abs(predicted.channels[i] - observed.all[i].value));
    worst.landing_timed |= observed.all[i].channel == Channel::landing_time;
  }
  worst.observations = static_cast<int>(observed.all.size());
  return worst;
}

CampaignDesign with_everything(const std::string& law, const EffectSettings& effects) {
  CampaignDesign design = perfect(effects);
  design.contact_model = law;
  for (auto& object : design.objects) object.drag_k = kDrag;
  design.variation.grasp_offset = design.variation.grasp_across = 0.3e-3;
  design.sensors.landing_time_sigma = 1e-15;      // declared, or the landing's time is no observation
  design.integrator.tolerances = {1e-11, 1e-13};  // what differs is not what the integrators leave
  return design;
}

/// By id, `size` typical steps from neutral.
std::vector<std::pair<std::string, EffectSettings>> every_effect(double size) {
  std::vector<std::pair<std::string, EffectSettings>> out{{"none", {}}};
  for (const Effect& effect : known_effects()) out.emplace_back(effect.id, typical(effect, size));
  return out;
}

// Hand and force given exactly, prediction and generator integrate the same equations with the same steps:
// what is left are the quintics of the hand (1e-12 m) and rounding, which slip multiplies by a thousand, and
// which compliant pads of 4e4 to 2e5 N/m turn into forces of 1e-7 N at most.
TEST(GeneratorAndPrediction, AgreeOnEveryChannelForEveryEffect) {
  const std::array<double, kChannelCount> tolerance{1e-7,  1e-7,  1e-9,  1e-12, 1e-10,
                                                    1e-10, 1e-10, 1e-10, 1e-10, 1e-10};
  for (const std::string law : {"limit_surface_disc", "sliding_pivot"})
    for (const double size : {1.0, 5.0})
      for (const auto& [id, effects] : every_effect(size))
        for (const int index : {2, kThrow}) {
          const Worst worst = consistency(with_everything(law, effects), index, true, true);
          EXPECT_GT(worst.observations, 800) << law << ", " << id;
          EXPECT_TRUE(worst.landing_timed) << law << ", " << id;
          for (std::size_t c = 0; c < kChannelCount; ++c)
            EXPECT_LE(worst.of[c], tolerance[c])
                << law << ", " << id << ", throw " << index << ": " << to_string(static_cast<Channel>(c));
        }
}

// The same through the smoothing of the logged hand and normal force, in units of the noise that the
// campaign's sensors would have. Without knowing the effect the prediction is off.
TEST(GeneratorAndPrediction, AgreeThroughTheSmoothedLogOnlyIfTheEffectIsKnown) {
  const SensorSuite noise;
  const auto &w = noise.wrench_sigma, &m = noise.mocap_sigma;
  const std::array<double, kChannelCount> sigma{w[0],
                                                w[1],
                                                w[2],
                                                noise.normal_force_sigma,
                                                m[0],
                                                m[1],
                                                m[2],
                                                noise.landing_sigma[0],
                                                noise.landing_sigma[1],
                                                noise.landing_time_sigma};
  const auto largest = [&](const Worst& worst) {
    double most = 0;
    for (std::size_t c = 0; c < kChannelCount; ++c) most = std::max(most, worst.of[c] / sigma[c]);
    return most;
  };
  for (const auto& [id, effects] : every_effect(5)) {
    CampaignDesign design = with_everything("limit_surface_disc", effects);
    design.opening.shape = 1;  // other ramps are only smoothed to below the noise where a bias is on them
    const Worst told = consistency(design, kThrow, false, true);
    EXPECT_GT(told.observations, 800) << id;
    EXPECT_LE(largest(told), 2e-3) << id;
    if (id != "none") {
      EXPECT_GE(largest(consistency(design, kThrow, false, false)), 0.05) << id;
    }
  }
}

// What begins to slip as the pads open, or a rounding of the clock before that, was held.
TEST(GripHolds, UntilTheGripperIsToldToOpen) {
  const CampaignDesign design = perfect();
  datasets::ThrowLog log = campaign_header(design, kSeed);
  log.throws = {generate_throw(design, kSeed, kThrow).record};
  PreparedThrow prepared = prepare(log, log.throws[0], "(in memory)");
  const ThrowModel model{design.contact_model, log.gripper->n_pads, design.reference_force(),
                         design.integrator};
  const std::vector<std::string> names{"mu", "length"};
  const std::vector<double> numbers{0.5, 0.007};
  const dynamics::Values<double> values(names, numbers);
  EXPECT_TRUE(grip_holds(prepared, model, values));
  double slips = 0;
  visit_release(prepared, model, values, [&](const auto&, const auto& release) {
    for (const auto& event : release.events)
      if (slips == 0 && event.mode_after != event.mode_before) slips = event.t;
  });
  ASSERT_GT(slips, 0);
  prepared.open_command = std::nextafter(slips, 1.0);
  EXPECT_TRUE(grip_holds(prepared, model, values));
  prepared.open_command = slips + 1e-3;
  EXPECT_FALSE(grip_holds(prepared, model, values));
}

}  // namespace
