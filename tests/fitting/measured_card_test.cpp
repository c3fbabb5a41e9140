// Cards of free motion against synthetic flights whose missing effect is known.
#include "fitting/measured/measured_card.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/refusal.hpp"
#include "tests/support/spatial_flights.hpp"

namespace unhand::fitting {
namespace {

using unhand::test::spatial_flights;
using unhand::test::SpatialDesign;
using unhand::test::SpatialTruth;

constexpr double kDrag = 0.04;  // 1/m

datasets::ThrowLog dragged() {
  SpatialTruth truth;
  truth.drag = kDrag;
  SpatialDesign design;
  design.flights = 20;
  return spatial_flights(truth, design, 5);
}

datasets::ModelCard card_with(double drag) {
  datasets::ModelCard out;
  out.model = "projectile";
  out.effects = {"flight.quadratic_drag"};
  out.parameters["flight.quadratic_drag.k[body]"] = {drag, 1e-3, "1/m", true};
  return out;
}

double value_of(const NamedErrors& errors, const std::string& name) {
  for (const auto& [key, value] : errors)
    if (key == name) return value;
  return std::nan("");
}

TEST(MeasuredCard, TheTrueEffectLeavesNothingButNoise) {
  const auto found = compare_with_card(card_with(kDrag), "card.json", dragged(), 1);
  EXPECT_EQ(found.train + found.test, 20);
  // 4 flights of 240 numbers with 12 unknowns each: chi2 per degree of freedom scatters by sqrt(2/912) =
  // 0.047
  EXPECT_NEAR(value_of(found.card_test, "chi2_per_dof"), 1, 0.19);
  EXPECT_GT(value_of(found.base_test, "chi2_per_dof"), 1.5);
  EXPECT_LT(value_of(found.card_test, "end_position_mae_m"), value_of(found.base_test, "end_position_mae_m"));
}

TEST(MeasuredCard, AnEffectThatOvershootsIsWorseThanNone) {
  const auto with = compare_with_card(card_with(2 * kDrag + 0.02), "card.json", dragged(), 1);
  EXPECT_GT(value_of(with.card_test, "chi2_per_dof"), value_of(with.base_test, "chi2_per_dof"))
      << "an overshoot by more than the effect itself";
}

TEST(MeasuredCard, NoEffectsAreTheBaseModel) {
  datasets::ModelCard card;
  card.model = "projectile";
  const auto found = compare_with_card(card, "card.json", dragged(), 1);
  EXPECT_EQ(found.card_test, found.base_test);
}

TEST(MeasuredCard, WhatALogOrTheLibraryLacksIsRefusedByName) {
  const auto refusal = [](const datasets::ModelCard& card) {
    return unhand::support::refusal<datasets::CardError>(
        [&] { compare_with_card(card, "card.json", dragged(), 1); });
  };
  auto card = card_with(kDrag);
  card.effects = {"flight.phlogiston"};
  EXPECT_THAT(refusal(card), testing::HasSubstr("flight.phlogiston does not act"));
  card = card_with(kDrag);
  card.parameters = {{"flight.quadratic_drag.k[brick]", {kDrag, 1e-3, "1/m", true}}};
  EXPECT_THAT(refusal(card), testing::HasSubstr("k[body]: is missing"));
  card = card_with(kDrag);
  card.parameters.begin()->second.unit = "1/ft";
  EXPECT_THAT(refusal(card), testing::HasSubstr("is '1/ft', not '1/m'"));
  EXPECT_THAT(refusal(card_with(-1)), testing::HasSubstr("is not in [0, "));
  card = card_with(kDrag);
  card.parameters["mu"] = {0.5, {}, "-", true};
  EXPECT_THAT(refusal(card), testing::HasSubstr("/parameters/mu"));
  card.model = "sliding_pivot";
  EXPECT_THAT(refusal(card), testing::HasSubstr("is neither projectile nor free_fall"));
}

}  // namespace
}  // namespace unhand::fitting
