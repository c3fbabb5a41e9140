// The loop on synthetic campaigns whose missing effect is known.
#include "fitting/discover.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "experiment/campaign_effects.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "fitting/footprints.hpp"

namespace unhand::fitting {
namespace {

/// 24 throws of two bars, six conditions each, two repetitions.
datasets::ThrowLog campaign(const experiment::EffectSettings& effects, std::uint64_t seed = 3) {
  experiment::CampaignDesign design = experiment::campaign_design("batch180");
  design.name = "loop";
  design.postures.resize(2);
  design.release_accelerations.resize(3);
  design.repetitions = 2;
  design.effects = effects;
  return experiment::generate_campaign(design, seed);
}

Discovery found_in(const datasets::ThrowLog& log, std::vector<std::string> forget = {}) {
  DiscoverOptions options;
  options.campaign.model = "limit_surface_disc";
  options.campaign.integrator.tolerances = {1e-5, 1e-8};
  options.forget = std::move(forget);
  options.refits = 3;
  return discover(log, "synthetic", options);
}

const AcceptedEffect* named(const Discovery& found, const std::string& id) {
  for (const auto& effect : found.effects)
    if (effect.id == id) return &effect;
  return nullptr;
}

TEST(Discovery, NothingIsFoundWhereNothingIsMissing) {
  const Discovery found = found_in(campaign({}));
  EXPECT_EQ(found.verdict, Verdict::no_missing_effect);
  EXPECT_TRUE(found.effects.empty());
  EXPECT_FALSE(found.unexplained.has_value());
}

TEST(Discovery, DragIsFoundWithItsSize) {
  constexpr double kDrag = 0.05;  // 1/m: a few centimetres over a throw of two metres
  const Discovery found = found_in(campaign({{"flight.quadratic_drag.k", kDrag}}));
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  EXPECT_EQ(found.effects.front().id, "flight.quadratic_drag");
  EXPECT_EQ(found.first.phase, Phase::flight) << "drag acts in flight, and first there";
  for (const auto& p : found.effects.front().parameters)
    EXPECT_NEAR(p.value, kDrag, std::max(4 * p.sigma, 1e-4)) << p.name;
  EXPECT_LT(found.after_test.trajectory_rms, 0.5 * found.before_test.trajectory_rms);
}

TEST(Discovery, AClockThatIsLateIsFoundAlreadyInTheGrasp) {
  constexpr double kOffset = 0.004;
  const Discovery found = found_in(campaign({{"sensor.mocap_time_offset.offset", kOffset}}));
  ASSERT_EQ(found.verdict, Verdict::effect_found);
  EXPECT_EQ(found.first.phase, Phase::grasped);
  const AcceptedEffect* effect = named(found, "sensor.mocap_time_offset");
  ASSERT_NE(effect, nullptr) << found.effects.front().id;
  EXPECT_NEAR(effect->parameters.front().value, kOffset,
              std::max(4 * effect->parameters.front().sigma, 2e-5));
}

TEST(Discovery, AnEffectThatTheCatalogueForgetsIsUnexplainedOrDoesNotGoByItsName) {
  const Discovery found = found_in(campaign({{"flight.magnus_lift.k_m", 0.03}}), {"flight.magnus_lift"});
  EXPECT_EQ(named(found, "flight.magnus_lift"), nullptr);
  EXPECT_NE(found.verdict, Verdict::no_missing_effect);
  EXPECT_EQ(found.first.phase, Phase::flight);
}

TEST(Footprints, TheStepOfTheTrueEffectIsItsSizeToFirstOrder) {
  constexpr double kTilt = 0.01;
  CampaignOptions options;
  options.integrator.tolerances = {1e-5, 1e-8};
  const CampaignProblem problem(campaign({{"flight.gravity_tilt.angle", kTilt}}), "synthetic", options);
  const FitResult base = fit(problem);
  const Footprints f = footprints(problem, base, {"flight.gravity_tilt", "flight.wind"}, {}, 0);
  for (const Score& score : scores(f)) {
    if (f.candidates[score.candidate].id == "flight.gravity_tilt") {
      EXPECT_NEAR(score.step.front(), kTilt, 0.1 * kTilt);
    } else {
      EXPECT_FALSE(score.visible) << "no drag is declared, so wind leaves no footprint";
    }
  }
}

}  // namespace
}  // namespace unhand::fitting
