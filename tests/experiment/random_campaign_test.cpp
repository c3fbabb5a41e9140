// Campaigns and effects that are drawn at random, and effects by name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "datasets/summary.hpp"
#include "tests/support/perfect_campaign.hpp"

namespace {

using namespace unhand;
using namespace unhand::experiment;
using namespace unhand::testing_support;
using dynamics::Effect;

// What the samples of a moving hand scatter by is their noise, of any campaign.
TEST(RandomCampaign, ItsSamplesScatterAsDeclared) {
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    const CampaignDesign design = random_campaign(seed);
    const auto summary = datasets::summarise(generate_campaign(design, seed));
    for (const auto& noise : summary.noise)
      for (std::size_t j = 0; j < noise.too_small.size(); ++j)
        EXPECT_FALSE(noise.too_small[j])
            << seed << " " << noise.dataset << " " << j << ": " << noise.ratio[j];
  }
}

TEST(CampaignEffects, AreReadByName) {
  using testing::HasSubstr, testing::ThrowsMessage;
  EXPECT_EQ(parse_effect("contact.stribeck=1.25"),
            std::pair(std::string("contact.stribeck.mu_s/mu_k"), 1.25));
  EXPECT_EQ(parse_effect("contact.stribeck.v_s=1e-2"), std::pair(std::string("contact.stribeck.v_s"), 0.01));
  EXPECT_EQ(parse_effect("flight.quadratic_drag[jar]=0.1"),
            std::pair(std::string("flight.quadratic_drag.k[jar]"), 0.1));
  const auto expect_refused = [](const char* text, const char* why) {
    EXPECT_THAT([&] { parse_effect(text); }, ThrowsMessage<std::invalid_argument>(HasSubstr(why)));
  };
  expect_refused("contact.stribek=1", "did you mean 'contact.stribeck'?");
  expect_refused("stribeck=1", "did you mean 'contact.stribeck'?");
  expect_refused("flight.quadratic_drag=-1", "k = -1 is not in [0, 10] 1/m");
  expect_refused("sensor.mass=nan", "is not in [0.1, 6]");
  expect_refused("sensor.mass=1kg", "not a number");
  expect_refused("sensor.mass[jar=1", "in brackets");

  const OwnEffects jar({{"flight.quadratic_drag.k", 0.1}, {"flight.quadratic_drag.k[jar]", 0.2}}, "jar");
  EXPECT_EQ(jar.values().get("flight.quadratic_drag.k", 0), 0.2);
  const OwnEffects box({{"flight.quadratic_drag.k", 0.1}, {"flight.quadratic_drag.k[jar]", 0.2}}, "box");
  EXPECT_EQ(box.values().get("flight.quadratic_drag.k", 0), 0.1);
}
TEST(CampaignEffects, RandomOnesAreFromTheCatalogueAndOfTypicalSize) {
  std::set<std::string> ids, without_ft;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    CampaignDesign design = perfect();
    for (auto& object : design.objects) object.drag_k = kDrag;
    const auto effects = random_effect(design, seed);
    EXPECT_EQ(effects, random_effect(design, seed));
    for (const Effect& effect : known_effects())
      for (const auto& p : effect.parameters)
        for (const auto& [name, value] : effects) {
          if (without_object(name) != effect.full_name(p)) continue;
          ids.insert(effect.id);
          if (!p.is_shape()) {
            EXPECT_GE(std::abs(value - p.neutral), 0.499 * p.typical) << name;
            EXPECT_LE(std::abs(value - p.neutral),
                      (effect.id == "contact.viscous" ? 50.001 : 10.001) * p.typical)
                << name;
          }
        }
    design.sensors.ft = false;
    for (const auto& [name, value] : random_effect(design, seed)) without_ft.insert(name);
  }
  EXPECT_EQ(ids.size(), known_effects().size());
  for (const auto& name : without_ft) EXPECT_FALSE(name.starts_with("sensor.ft_bias")) << name;
}

TEST(RandomCampaign, IsHeldLandsAndKeepsItsPromises) {
  std::set<std::string> names;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const CampaignDesign design = random_campaign(seed);
    EXPECT_GE(design.throws(), 48);
    EXPECT_LE(design.throws(), 60);
    ASSERT_EQ(design.objects.size(), 2u);
    for (const auto& object : design.objects) names.insert(object.name);
    EXPECT_GE(design.opening.grip_force, 20);
    EXPECT_LE(design.opening.grip_force, 40);
    EXPECT_NEAR(*design.declared_pad_radius / design.patch.radius, 1, 0.1);
    double farthest = 0;
    for (int i = 0; i < design.throws(); i += design.repetitions) {
      const auto [record, truth] =
          generate_throw(design, seed, i);  // throws if it is not held or never lands
      farthest = std::max(farthest, truth.landing_pose.x);
      EXPECT_LT(truth.detach_time, design.follow_through);
    }
    EXPECT_GT(farthest, 1.2);
    EXPECT_LT(farthest, 3);
  }
  EXPECT_EQ(names.size(), 5u);
}

TEST(RandomCampaign, SensorsCanBeLeftOut) {
  CampaignDesign design = random_campaign(3);
  const auto full = generate_throw(design, 3, 0).record;
  design.sensors.ft = design.sensors.mocap = false;
  const auto few = generate_throw(design, 3, 0).record;
  EXPECT_FALSE(few.ft || few.mocap);
  EXPECT_TRUE(few.grasp_angle.has_value());
  EXPECT_FALSE(full.grasp_angle.has_value());
  EXPECT_TRUE(full.landing == few.landing);
  design.sensors.ft = true;
  design.sensors.wrench = design.sensors.landing = false;
  const auto deaf = generate_throw(design, 3, 0).record;
  EXPECT_EQ(deaf.ft->normal_force.data, full.ft->normal_force.data)
      << "its noise is that of the whole sensor";
  for (const double x : deaf.ft->wrench.data) EXPECT_EQ(x, 0);
  EXPECT_FALSE(deaf.landing);
  datasets::ThrowLog log = campaign_header(design, 3);
  log.throws = {deaf};
  EXPECT_NO_THROW(datasets::validate(log));
}

}  // namespace
