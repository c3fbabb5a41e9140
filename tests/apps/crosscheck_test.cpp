// crosscheck: other engines on a log's throws.
#include "tests/apps/cli.hpp"

namespace unhand::cli {
namespace {

TEST_F(Cli, CrosscheckWithCvodeFindsTheSameLandings) {
  const std::string models = "limit_surface,sliding_pivot";
  const Answer answer = run("crosscheck " + quick + " --engine cvode --models " + models + " --json c.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("CVODE"));
  const json checked = read_json(folder / "c.json");
  EXPECT_EQ(checked["schema"], "crosscheck");
  EXPECT_EQ(checked["engine"], "cvode");
  ASSERT_EQ(checked["settings"].size(), 2u);  // one a model
  for (const json& setting : checked["settings"]) {
    ASSERT_EQ(setting["models"].size(), 1u);
    EXPECT_EQ(setting["throws"].size(), 12u);
    const json& model = setting["models"].front();
    EXPECT_EQ(model["other_number_of_events"], 0);
    // Two integrators of the same equations, at 1e-9 and 1e-10: landings within a micrometre of each other.
    const json& landing = model["landing_x_m"];
    ASSERT_TRUE(landing["mae"].is_number()) << model.dump();
    EXPECT_LT(landing["mae"].get<double>(), 1e-6);
  }
}

TEST_F(Cli, CrosscheckWithPointsComesNearTheExactDisc) {
  const Answer answer =
      run("crosscheck " + quick + " --engine patch --rings 4 --models limit_surface_disc --json p.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json checked = read_json(folder / "p.json");
  ASSERT_EQ(checked["settings"].size(), 1u);
  const json& landing = checked["settings"][0]["models"]["limit_surface_disc"]["landing_x_m"];
  // 48 points with bristles know no limit surface; the map of tests/truth says millimetres.
  EXPECT_LT(landing["mae"].get<double>(), 5e-3);
  EXPECT_GT(landing["mae"].get<double>(), 0);
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
