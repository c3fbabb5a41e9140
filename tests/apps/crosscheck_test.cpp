// crosscheck: other engines on a log's throws.
#include "tests/apps/cli.hpp"

namespace unhand::cli {
namespace {

TEST_F(Cli, CrosscheckWithCvodeFindsTheSameLandings) {
  const std::string models = "limit_surface,sliding_pivot";
  const Answer answer = run("crosscheck " + quick + " --engine cvode --models " + models + " --json c.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("CVODE"));
  json checked = read_json(folder / "c.json");
  EXPECT_EQ(checked["schema"], "crosscheck");
  EXPECT_EQ(checked["engine"], "cvode");
  ASSERT_EQ(checked["settings"].size(), 2u);  // one a model
  for (json& setting : checked["settings"]) {
    ASSERT_EQ(setting["models"].size(), 1u);
    EXPECT_EQ(setting["throws"].size(), 12u);
    json& model = setting["models"].front();
    EXPECT_EQ(model["other_number_of_events"], 0);
    // Two integrators of the same equations, at 1e-9 and 1e-10: landings within a micrometre of each other.
    json& landing = model["landing_x_m"];
    ASSERT_TRUE(landing["mae"].is_number()) << model.dump();
    EXPECT_LT(landing["mae"].get<double>(), 1e-6);
  }
}

TEST_F(Cli, CrosscheckWithPointsComesNearTheExactDisc) {
  const Answer answer =
      run("crosscheck " + quick + " --engine patch --rings 4 --models limit_surface_disc --json p.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json checked = read_json(folder / "p.json");
  ASSERT_EQ(checked["settings"].size(), 1u);
  json& landing = checked["settings"][0]["models"]["limit_surface_disc"]["landing_x_m"];
  // 48 points with bristles know no limit surface; the map of tests/truth says millimetres.
  EXPECT_LT(landing["mae"].get<double>(), 5e-3);
  EXPECT_GT(landing["mae"].get<double>(), 0);
}

/// A fitted card, as far as it goes. It says that throws do not differ, so that predict takes every grasp as
/// prepared.
void write_fitted_card(const fs::path& file, const std::string& model, const std::string& parameters) {
  std::ofstream(file) << R"({"schema": "model-card", "schema_version": 1, "model": ")" << model
                      << R"(", "library_version": "0", "log": {"file": "made by a test"}, "parameters": {
    "mu": {"value": 0.5, "sigma": 0.01, "unit": "-"}, "length": {"value": 0.007, "unit": "m"},
    "pads": {"value": 2, "unit": "-"}, "reference_force": {"value": 50, "unit": "N"})"
                      << parameters << R"(}, "own_spreads": {"mu_deviation": {"sigma": 1e-9, "unit": "-"},
    "grasp_angle": {"sigma": 1e-9, "unit": "rad"}, "grasp_offset": {"sigma": 1e-9, "unit": "m"},
    "dead_time_deviation": {"sigma": 1e-9, "unit": "s"}, "force_deviation": {"sigma": 1e-9, "unit": "-"}}})";
}

/// Landings of a crosscheck's only engine, or of a prediction.
std::vector<double> landings_of(json throws) {
  std::vector<double> out;
  for (json& one : throws)
    if (one.contains("landing_x_m"))
      out.push_back(one["landing_x_m"]);
    else if (one["landing"].is_object())
      out.push_back(one["landing"]["x_m"]);
  return out;
}

TEST_F(Cli, CrosscheckFollowsTheShapeOfACard) {
  std::vector<std::vector<double>> found;
  for (const std::string kappa : {"0.3", "2.7"}) {
    write_fitted_card(folder / "card.json", "limit_surface_quartic",
                      R"(, "kappa": {"value": )" + kappa + R"(, "unit": "-"})");
    const Answer answer =
        run("crosscheck " + quick +
            " --engine cvode --models limit_surface_quartic --card card.json --json c.json");
    ASSERT_EQ(answer.code, 0) << answer.err;
    ASSERT_EQ(run("predict " + quick + " --card card.json --json p.json").code, 0);
    json checked = read_json(folder / "c.json");
    EXPECT_EQ(checked["parameters"]["kappa"].get<double>(), std::stod(kappa));
    const auto engine = landings_of(checked["settings"][0]["throws"]),
               predicted = landings_of(read_json(folder / "p.json")["throws"]);
    ASSERT_EQ(engine.size(), 12u);
    ASSERT_EQ(predicted.size(), 12u);
    for (std::size_t i = 0; i < 12; ++i) EXPECT_NEAR(engine[i], predicted[i], 1e-5);  // predict's tolerance
    found.push_back(engine);
  }
  double most = 0;
  for (std::size_t i = 0; i < 12; ++i) most = std::max(most, std::abs(found[0][i] - found[1][i]));
  EXPECT_GT(most, 1e-3);
  EXPECT_THAT(run("crosscheck " + quick + " --engine cvode --models limit_surface --card card.json").err,
              HasSubstr("kappa of card.json is of limit_surface_quartic"));
}

TEST_F(Cli, CrosscheckOpensThePadsAsTheCardSays) {
  write_changed("bare.h5", [](datasets::Throw& one) { one.ft.reset(); });
  const std::string opening = R"(, "grip_force": {"value": 50, "unit": "N"},
    "dead_time": {"value": 0.012, "unit": "s"}, "opening_time": {"value": 0.05, "unit": "s"},
    "shape": {"value": 1.2, "unit": "-"})";
  write_fitted_card(folder / "card.json", "limit_surface", opening);
  const std::string check =
      "crosscheck bare.h5 --models limit_surface --card card.json --json c.json --engine ";
  ASSERT_EQ(run("predict bare.h5 --card card.json --json p.json").code, 0);
  const auto predicted = landings_of(read_json(folder / "p.json")["throws"]);
  ASSERT_EQ(predicted.size(), 12u);
  for (const std::string engine : {"cvode", "patch"}) {
    const Answer answer = run(check + engine);
    ASSERT_EQ(answer.code, 0) << answer.err;
    EXPECT_THAT(answer.err, HasSubstr("12 of 12 throws have no normal force"));
    const auto landings = landings_of(read_json(folder / "c.json")["settings"][0]["throws"]);
    ASSERT_EQ(landings.size(), 12u) << engine;
    // The same equations; or points of a disc, of whose limit surface the ellipsoid is some per cent away.
    for (std::size_t i = 0; i < 12; ++i)
      EXPECT_NEAR(landings[i], predicted[i], engine == "cvode" ? 1e-5 : 0.02) << engine;
  }
  write_fitted_card(folder / "silent.json", "limit_surface", "");
  expect_refusal("crosscheck bare.h5 --engine cvode --card silent.json", 3,
                 "/parameters/grip_force: is missing: throws without a measured normal force");
}

TEST_F(Cli, CrosscheckRefuses) {
  expect_refusal("crosscheck " + quick + " --engine ode", 2, "cvode");
  expect_refusal("crosscheck " + quick + " --engine cvode --models wishful", 2, "wishful");
  expect_refusal("crosscheck " + quick + " --engine patch --steps 1", 2, "steps");
  expect_refusal("crosscheck " + quick + " --engine patch --pads point", 2, "--pads: of bullet");
  expect_refusal("crosscheck " + quick + " --engine cvode --steps 1e-3", 2, "--steps: cvode integrates");
  expect_refusal("crosscheck " + quick + " --engine cvode --models gripper_delay", 2, "gripper_delay");
  ASSERT_EQ(run("generate quick12 --seed 3 --without ft --out blind.h5").code, 0);
  expect_refusal("crosscheck blind.h5 --engine cvode", 1, "give a card (--card), as `unhand fit LOG");
  EXPECT_THAT(run("crosscheck blind.h5 --engine cvode").err, Not(HasSubstr("--fit"))) << "which it has not";
  expect_refusal("crosscheck none.h5 --engine cvode", 3, "none.h5");
  expect_refusal("crosscheck " + flights + " --engine cvode", 3, flights);
}

}  // namespace
}  // namespace unhand::cli
