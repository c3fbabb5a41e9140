// Model cards: round trip, what is refused, and how files are replaced.
#include "datasets/model_card.hpp"

#include <gmock/gmock.h>

#include <array>
#include <bit>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/support/refusal.hpp"
#include "tests/support/scratch.hpp"

namespace unhand::datasets {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

ModelCard small_card() {
  ModelCard card;
  card.model = "sliding_pivot";
  card.parameters["mu"] = {0.61, 0.01, "-"};
  card.parameters["length"] = {0.0071, {}, "m"};
  card.log = {"campaign.h5", "a campaign", "fnv1a64:0123456789abcdef", {"aluminium", "glass"}};
  card.split = "train";
  card.valid_range["grip_force"] = {45, 55, "N"};
  card.warnings = {"something is missing"};
  card.library_version = "0.1.0";
  return card;
}

/// The error of a text that must be refused.
std::string refusal(const std::string& text) {
  return support::refusal<CardError>([&] { parse_model_card(text, "c.json"); });
}

/// The small card with one thing changed.
template <class Change>
std::string refusal_after(Change&& change) {
  auto json = nlohmann::json::parse(to_json(small_card()));
  change(json);
  return refusal(json.dump());
}

TEST(ModelCard, ComesBackAsItWas) { EXPECT_EQ(parse_model_card(to_json(small_card())), small_card()); }

TEST(ModelCard, AnEndOfAnIntervalMayBeOpen) {
  const double open = std::numeric_limits<double>::infinity();
  for (const auto& interval : {std::array{0.6, 0.63}, std::array{0.6, open}, std::array{-open, open}}) {
    ModelCard card = small_card();
    card.parameters["mu"].degrees_of_freedom = 12.5;
    card.parameters["mu"].interval95 = interval;
    EXPECT_EQ(parse_model_card(to_json(card)), card);
  }
  auto json = nlohmann::json::parse(to_json(small_card()));
  EXPECT_FALSE(json["parameters"]["mu"].contains("low95"));
  EXPECT_THAT(refusal_after([](auto& j) { j["parameters"]["mu"]["low95"] = 0.7; }),
              HasSubstr("/parameters/mu/low95: 0.7 lies above the value"));
  EXPECT_THAT(refusal_after([](auto& j) { j["parameters"]["mu"]["degrees_of_freedom"] = 0; }),
              HasSubstr("/parameters/mu/degrees_of_freedom: 0 is below 1"));
}

TEST(ModelCard, OneErrorHasNoStandardDeviation) {
  ModelCard card = small_card();
  card.errors["test"] = {{"landing_x_m", {1, 0.012, 0, -0.012}}, {"landing_theta_deg", {2, 1.5, 0.5, 0.5}}};
  auto json = nlohmann::json::parse(to_json(card));
  EXPECT_TRUE(json["errors"]["test"]["landing_x_m"]["std"].is_null());
  EXPECT_EQ(json["errors"]["test"]["landing_theta_deg"]["std"], 0.5);
  EXPECT_EQ(parse_model_card(json.dump()), card);
  auto without = json;
  without["errors"]["test"]["landing_theta_deg"]["std"] = nullptr;
  EXPECT_THAT(refusal(without.dump()), HasSubstr("/errors/test/landing_theta_deg/std: is missing"));
}

TEST(ModelCard, LeavesOutWhatIsNotKnown) {
  ModelCard card = small_card();
  card.log.checksum.reset();
  card.log.surfaces.clear();
  card.split.reset();
  card.valid_range.clear();
  card.warnings.clear();
  auto json = nlohmann::json::parse(to_json(card));
  EXPECT_FALSE(json.contains("split"));
  EXPECT_FALSE(json.contains("valid_range"));
  EXPECT_FALSE(json.contains("warnings"));
  EXPECT_FALSE(json["log"].contains("checksum"));
  EXPECT_FALSE(json["log"].contains("surfaces"));
  EXPECT_FALSE(json["parameters"]["length"].contains("sigma"));
  EXPECT_EQ(json["schema"], "model-card");
  EXPECT_EQ(json["schema_version"], 1);
  EXPECT_EQ(parse_model_card(to_json(card)), card);
}

TEST(ModelCard, KeepsEveryBitOfADouble) {
  std::mt19937_64 bits(20250101);
  std::vector<double> values{0.0,
                             -0.0,
                             0.1,
                             1.0 / 3,
                             std::numeric_limits<double>::denorm_min(),
                             std::numeric_limits<double>::min(),
                             std::numeric_limits<double>::max(),
                             1e22,
                             3.0};
  while (values.size() < 2000) {
    const auto value = std::bit_cast<double>(bits());
    if (std::isfinite(value)) values.push_back(value);
  }
  ModelCard card = small_card();
  for (const double value : values) {
    card.parameters["mu"].value = value;
    const double back = parse_model_card(to_json(card)).parameters.at("mu").value;
    EXPECT_EQ(std::bit_cast<std::uint64_t>(back), std::bit_cast<std::uint64_t>(value)) << value;
  }
}

TEST(ModelCard, KeepsKeysItDoesNotKnow) {
  auto json = nlohmann::json::parse(to_json(small_card()));
  json["notes"] = {1, 2, {{"deep", true}}};
  json["log"]["operator"] = "someone";
  json["parameters"]["mu"]["prior"] = 0.5;
  json["valid_range"]["grip_force"]["method"] = "seen";
  ModelCard card = parse_model_card(json.dump());
  EXPECT_EQ(nlohmann::json::parse(to_json(card)), json);

  card.parameters.erase("mu");  // and what was unknown about it goes too
  json["parameters"].erase("mu");
  EXPECT_EQ(nlohmann::json::parse(to_json(card)), json);
}

/// The small card with one more key, whose value is this text.
std::string card_with(const std::string& value) {
  std::string text = to_json(small_card());
  return text.insert(text.rfind('}'), ", \"notes\": " + value);
}

TEST(ModelCard, RefusesANumberThatNoDoubleHolds) {
  EXPECT_THAT(refusal(card_with("88e881")), HasSubstr("c.json: /: number overflow parsing '88e881'"));
}

TEST(ModelCard, RefusesNestingWithoutEnd) {
  // copies of nested values recurse, which would end with the stack
  const auto nested = [](std::size_t depth) {
    return card_with(std::string(depth, '[') + std::string(depth, ']'));
  };
  EXPECT_EQ(refusal(nested(20)), "accepted");
  for (const std::size_t depth : {100u, 1000000u})
    EXPECT_THAT(refusal(nested(depth)), HasSubstr("c.json: /: objects and arrays are nested deeper than 64"));
}

TEST(ModelCard, NamesThePlaceOfAMistake) {
  using Json = nlohmann::json;
  EXPECT_THAT(refusal_after([](Json& j) { j["schema"] = "throw-log"; }),
              HasSubstr("c.json: /schema: is 'throw-log'"));
  EXPECT_THAT(refusal_after([](Json& j) { j["schema_version"] = 2; }), HasSubstr("/schema_version: 2"));
  EXPECT_THAT(refusal_after([](Json& j) { j.erase("model"); }), HasSubstr("/model: is missing"));
  EXPECT_THAT(refusal_after([](Json& j) { j["parameters"]["mu"].erase("value"); }),
              HasSubstr("/parameters/mu/value: is missing"));
  EXPECT_THAT(refusal_after([](Json& j) { j["parameters"]["mu"]["value"] = "0.6"; }),
              HasSubstr("/parameters/mu/value: \"0.6\" is not a number"));
  EXPECT_THAT(refusal_after([](Json& j) { j["parameters"]["mu"]["sigma"] = -1; }),
              HasSubstr("/parameters/mu/sigma"));
  EXPECT_THAT(refusal_after([](Json& j) { j["parameters"]["mu"] = 0.6; }),
              HasSubstr("/parameters/mu: is number"));
  EXPECT_THAT(refusal_after([](Json& j) { j["parameters"]["a/b"] = 1; }), HasSubstr("/parameters/a~1b"));
  EXPECT_THAT(refusal_after([](Json& j) { j["valid_range"]["grip_force"]["low"] = 60; }),
              HasSubstr("/valid_range/grip_force/low"));
  EXPECT_THAT(refusal_after([](Json& j) {
                j["libary_version"] = j["library_version"];
                j.erase("library_version");
              }),
              HasSubstr("is 'libary_version' meant?"));
  EXPECT_THAT(refusal("[1]"), HasSubstr("is array, not an object"));
}

TEST(ModelCard, RefusesCovariancesThatAreNone) {
  using Json = nlohmann::json;
  const auto with = [](const Json& matrix) {
    return refusal_after([&](Json& j) {
      j["parameters"]["length"]["sigma"] = 1e-3;
      j["parameters"]["opening_time"] = {{"value", 0.05}, {"sigma", 0.002}, {"unit", "s"}};
      j["covariance"] = {{"names", {"mu", "length", "opening_time"}}, {"matrix", matrix}};
    });
  };
  const double m = 1e-4, l = 1e-6, t = 4e-6, ml = 1e-5, mt = 2e-5,
               lt = 2e-6;  // variances; products of sigmas
  EXPECT_EQ(with({{m, 0.9 * ml, 0}, {0.9 * ml, l, 0}, {0, 0, t}}), "accepted");
  EXPECT_EQ(with({{m, -ml, 0}, {-ml, l, 0}, {0, 0, t * (1 + 1e-9)}}), "accepted") << "one is the other's";
  EXPECT_THAT(with({{m, 5 * ml, 0}, {5 * ml, l, 0}, {0, 0, t}}),
              HasSubstr("c.json: /covariance/matrix: has the covariance 5e-05 of mu and length; accepted"));
  EXPECT_THAT(with({{m, 0, 0}, {0, 1.1 * l, 0}, {0, 0, t}}),
              HasSubstr("of length, whose sigma is 0.001: accepted is its square, 1e-06"));
  // Each pair may be, all three may not: two that go along with the first, but not with each other.
  EXPECT_THAT(with({{m, 0.9 * ml, 0.9 * mt}, {0.9 * ml, l, -0.9 * lt}, {0.9 * mt, -0.9 * lt, t}}),
              HasSubstr("is no covariance: the least eigenvalue of its correlations is -0.8"));
}

TEST(ModelCard, CountsLinesAndColumnsOfBrokenJson) {
  EXPECT_THAT(refusal("{\n  \"schema\": ,\n}"), HasSubstr("c.json: line 2, column 13: syntax error"));
  EXPECT_THAT(refusal(""), HasSubstr("line 1, column 1"));
  const std::string whole = to_json(small_card());
  EXPECT_THAT(refusal(whole.substr(0, whole.size() / 2)), HasSubstr("syntax error"));
}

TEST(ModelCard, RefusesToWriteWhatCannotBeReadAgain) {
  ModelCard card = small_card();
  card.parameters["mu"].value = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(to_json(card), CardError);
  card = small_card();
  card.model.clear();
  EXPECT_THROW(to_json(card), CardError);
  card = small_card();
  card.log.title = "\xff\xfe";
  EXPECT_THROW(to_json(card), CardError);
}

TEST(ModelCard, FilesAreReplacedAtOnce) {
  const support::Scratch scratch;
  const fs::path folder = scratch.path();
  const fs::path file = folder / "card.json";
  write_model_card(file, small_card());
  ModelCard other = small_card();
  other.model = "limit_surface";
  write_model_card(file, other);
  EXPECT_EQ(read_model_card(file), other);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 1);
  EXPECT_THROW(write_model_card(folder / "none" / "card.json", other), CardError);
  EXPECT_THROW(write_model_card(folder, other), CardError);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 1);
  EXPECT_THROW(read_model_card(folder), CardError);
  EXPECT_THROW(read_model_card(folder / "none.json"), CardError);
}

}  // namespace
}  // namespace unhand::datasets
