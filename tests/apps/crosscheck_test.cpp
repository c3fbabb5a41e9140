// crosscheck: other engines on a log's throws.
#include <fmt/format.h>

#include <array>
#include <tuple>

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
void write_fitted_card(const fs::path& file, const std::string& model, const std::string& parameters,
                       double mu = 0.5, int pads = 2) {
  std::ofstream(file) << R"({"schema": "model-card", "schema_version": 1, "model": ")" << model
                      << R"(", "library_version": "0", "log": {"file": "made by a test"}, "parameters": {
    "mu": {"value": )" << mu
                      << R"(, "sigma": 0.01, "unit": "-"}, "length": {"value": 0.007, "unit": "m"},
    "pads": {"value": )"
                      << pads << R"(, "unit": "-"}, "reference_force": {"value": 50, "unit": "N"})"
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

/// The tiny campaign without its repetitions, so that Bullet's small steps take a second or two.
void write_once_each(const fs::path& from, const fs::path& to) {
  auto log = datasets::read_throw_log(from);
  std::erase_if(log.throws, [](const auto& one) { return one.repetition != 1; });
  datasets::write_throw_log(to, log);
}

bool without_bullet(const Answer& answer) {
  return answer.code == 1 && answer.err.find("built without Bullet") != std::string::npos;
}

// Bullet is what it asks without --engine, at steps of 1 and 0.1 ms.
TEST_F(Cli, CrosscheckWithBulletThrowsAlikeAndTheBetterTheSmallerItsSteps) {
  write_once_each(quick, folder / "six.h5");
  const Answer answer = run("crosscheck six.h5 --json b.json");
  if (without_bullet(answer)) GTEST_SKIP() << answer.err;
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("Bullet, step 0.1 ms"));
  ASSERT_EQ(run("crosscheck six.h5 --engine cvode --models limit_surface_disc --json c.json").code, 0);
  json bullet = read_json(folder / "b.json"), cvode = read_json(folder / "c.json");
  EXPECT_EQ(bullet["engine"], "bullet");
  ASSERT_EQ(bullet["settings"].size(), 2u);
  json& models = cvode["settings"][0]["throws"];  // the exact disc on the same throws
  ASSERT_EQ(models.size(), 6u);
  std::array<double, 2> speed_off{}, spin_off{}, landing_off{};  // mean absolute differences
  for (std::size_t k = 0; k < 2; ++k) {
    json& setting = bullet["settings"][k];
    EXPECT_EQ(setting["setting"]["step_s"].get<double>(), k == 0 ? 1e-3 : 1e-4);
    ASSERT_EQ(setting["models"].size(), 3u);
    for (json* against : {&setting["models"]["limit_surface_disc"], &setting["models"]["limit_surface"],
                          &setting["models"]["sliding_pivot"], &setting["measured"]})
      for (const auto& [quantity, difference] : against->items()) {
        EXPECT_EQ(difference["n"], 6) << quantity;
        EXPECT_TRUE(difference["mae"].is_number() && difference["max"].is_number()) << quantity;
      }
    ASSERT_EQ(setting["throws"].size(), 6u);
    for (std::size_t i = 0; i < 6; ++i) {
      json &a = setting["throws"][i], &b = models[i];
      ASSERT_EQ(a["id"], b["id"]);
      ASSERT_TRUE(a["landed"].get<bool>()) << a["id"];
      const auto of = [&](json& one, const char* key) { return one[key].get<double>(); };
      const auto off = [&](const char* key) { return std::abs(of(a, key) - of(b, key)); };
      const double speed = std::hypot(of(b, "detach_vx_m_s"), of(b, "detach_vz_m_s"));
      const double v = std::hypot(off("detach_vx_m_s"), off("detach_vz_m_s"));
      // Its one row of friction at a contact lets a held object creep (docs/crosscheck.md): up to 9 % of the
      // speed and a quarter of the spin at 1 ms.
      EXPECT_LT(v, 0.15 * speed) << a["id"];
      EXPECT_LT(off("detach_omega_deg_s"), 0.4 * std::abs(of(b, "detach_omega_deg_s"))) << a["id"];
      // They part at the same place within centimetres and fly for some 0.6 s: what differs at the landing
      // is what differed at the detach.
      EXPECT_LT(off("landing_x_m"), 1.0 * v + 0.01) << a["id"];
      EXPECT_LT(off("landing_theta_deg"), 1.0 * off("detach_omega_deg_s") + 5) << a["id"];
      speed_off[k] += v / 6;
      spin_off[k] += off("detach_omega_deg_s") / 6;
      landing_off[k] += off("landing_x_m") / 6;
    }
    json& disc = setting["models"]["limit_surface_disc"];
    EXPECT_NEAR(disc["landing_x_m"]["mae"].get<double>(), landing_off[k], 1e-6);  // its own tolerance
    EXPECT_NEAR(disc["detach_omega_deg_s"]["mae"].get<double>(), spin_off[k], 1e-3);
  }
  EXPECT_LT(speed_off[1], 0.8 * speed_off[0]);  // by a factor of 1.6 to 3 over ten times smaller steps
  EXPECT_LT(spin_off[1], 0.8 * spin_off[0]);
  EXPECT_LT(landing_off[1], 0.8 * landing_off[0]);
  EXPECT_GT(landing_off[1], 1e-4) << "another engine is not the model itself";
}

TEST_F(Cli, CrosscheckWithBulletTakesItsPadsAndRows) {
  write_once_each(quick, folder / "six.h5");
  const auto landings = [&](const std::string& how) {
    const Answer answer =
        run("crosscheck six.h5 --models limit_surface_disc --steps 1e-3 --json b.json " + how);
    if (without_bullet(answer)) return std::vector<double>{};
    EXPECT_EQ(answer.code, 0) << answer.err;
    json checked = read_json(folder / "b.json");
    EXPECT_EQ(checked["settings"].size(), 1u);
    const auto out = landings_of(checked["settings"][0]["throws"]);
    EXPECT_EQ(out.size(), 6u) << how;
    return out;
  };
  const auto plain = landings("");
  if (plain.empty()) GTEST_SKIP() << "built without Bullet";
  EXPECT_EQ(landings("--engine bullet --pads pins --friction along --rings 3"), plain);  // the defaults
  EXPECT_EQ(landings("--threads 1"), plain);
  json along = read_json(folder / "b.json");
  ASSERT_EQ(landings("--friction across").size(), 6u);
  json across = read_json(folder / "b.json");
  const auto landing_of = [](json& checked) {
    return checked["settings"][0]["models"]["limit_surface_disc"]["landing_x_m"]["mae"].get<double>();
  };
  // A second row holds what one lets creep, and creep is most of the difference at this step.
  EXPECT_LT(landing_of(across), 0.5 * landing_of(along));
  EXPECT_NE(landings("--pads point"), plain);
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
    EXPECT_EQ(checked["parameters"]["from"], "card.json");
    json by_card = read_json(folder / "p.json")["throws"];
    for (std::size_t i = 0; i < 12; ++i) {
      json &one = checked["settings"][0]["throws"][i], &other = by_card[i];
      ASSERT_EQ(one["id"], other["id"]);
      for (const auto& [mine, where, its] : {std::tuple{"detach_vx_m_s", "detach", "vx_m_s"},
                                             {"detach_vz_m_s", "detach", "vz_m_s"},
                                             {"detach_omega_deg_s", "detach", "omega_deg_s"},
                                             {"landing_theta_deg", "landing", "theta_deg"}})
        EXPECT_NEAR(one[mine].get<double>(), other[where][its].get<double>(), 1e-2) << mine;
    }
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
    // Differences are engine minus model, and minus measured, of the throws.
    json setting = read_json(folder / "c.json")["settings"][0],
         by_card = read_json(folder / "p.json")["throws"];
    for (const char* key : {"landing_x_m", "landing_theta_deg"}) {
      double bias = 0, worst = 0, measured = 0;
      for (std::size_t i = 0; i < 12; ++i) {
        const double is = setting["throws"][i][key],
                     model = by_card[i]["landing"][std::string(key).substr(8)];
        bias += (is - model) / 12, worst = std::max(worst, std::abs(is - model));
        measured += std::abs(is - by_card[i]["measured"][key].get<double>()) / 12;
      }
      json& told = setting["models"]["limit_surface"][key];
      EXPECT_NEAR(told["bias"].get<double>(), bias, 1e-4 + 0.05 * worst) << key;  // predict's tolerance
      EXPECT_NEAR(told["max"].get<double>(), worst, 1e-4 + 0.05 * worst) << key;
      EXPECT_NEAR(setting["measured"][key]["mae"].get<double>(), measured, 1e-6 * (1 + measured)) << key;
      if (engine == "patch") {
        EXPECT_GT(worst, 1e-3) << key;
      }
    }
    // The same equations; or points of a disc, of whose limit surface the ellipsoid is some per cent away.
    for (std::size_t i = 0; i < 12; ++i)
      EXPECT_NEAR(landings[i], predicted[i], engine == "cvode" ? 1e-5 : 0.02) << engine;
  }
  write_fitted_card(folder / "silent.json", "limit_surface", "");
  expect_refusal("crosscheck bare.h5 --engine cvode --card silent.json", 3,
                 "/parameters/grip_force: is missing: throws without a measured normal force");
}

// One pad of twice the friction holds as two do, four of half of it as well.
TEST_F(Cli, CrosscheckTakesTheNumberOfPadsFromItsCard) {
  for (const std::string engine : {"cvode", "patch --rings 1"}) {
    std::vector<std::vector<double>> found;
    for (const int pads : {1, 2, 4}) {
      write_fitted_card(folder / "card.json", "limit_surface", "", 1.0 / pads, pads);
      const Answer answer = run("crosscheck " + quick +
                                " --models limit_surface --card card.json --json c.json --engine " + engine);
      ASSERT_EQ(answer.code, 0) << answer.err;
      json checked = read_json(folder / "c.json");
      EXPECT_EQ(checked["parameters"]["pads"], pads);
      found.push_back(landings_of(checked["settings"][0]["throws"]));
      ASSERT_EQ(found.back().size(), found.front().size());
    }
    ASSERT_GT(found.front().size(), 9u) << engine;
    for (std::size_t i = 0; i < found.front().size(); ++i)
      for (const auto& other : found) EXPECT_NEAR(other[i], found.front()[i], 1e-9) << engine;
  }
}

// An engine flies its objects on with the drag that they declare; the text has the numbers of the JSON.
TEST_F(Cli, CrosscheckFliesWithTheDragOfTheObjects) {
  write_once_each(quick, folder / "calm.h5");
  auto log = datasets::read_throw_log(folder / "calm.h5");
  for (auto& [name, object] : log.objects) object.drag_k = 0.3;
  datasets::write_throw_log(folder / "air.h5", log);
  write_fitted_card(folder / "card.json", "limit_surface_disc", "");
  const auto landings = [&](const std::string& file) {
    const Answer answer = run("crosscheck " + file +
                              " --engine patch --models limit_surface_disc --card card.json --json c.json");
    EXPECT_EQ(answer.code, 0) << answer.err;
    json setting = read_json(folder / "c.json")["settings"][0];
    EXPECT_EQ(setting["setting"]["step_s"].get<double>(), 4e-5) << "as docs/crosscheck.md has it";
    json& model = setting["models"]["limit_surface_disc"];
    EXPECT_LT(model["landing_x_m"]["mae"].get<double>(), 5e-3) << file;
    std::string row = "measured";
    for (const char* quantity : {"detach_vx_m_s", "detach_omega_deg_s", "landing_x_m", "landing_theta_deg"})
      row += fmt::format(" +{:.4f}", setting["measured"][quantity]["mae"].get<double>());
    EXPECT_THAT(answer.out, testing::ContainsRegex(row));
    return landings_of(setting["throws"]);
  };
  const auto calm = landings("calm.h5"), air = landings("air.h5");
  ASSERT_EQ(calm.size(), 6u);
  ASSERT_EQ(air.size(), 6u);
  double shorter = 0;
  for (std::size_t i = 0; i < 6; ++i) shorter = std::max(shorter, std::abs(calm[i] - air[i]));
  EXPECT_GT(shorter, 0.03);
}

TEST_F(Cli, CrosscheckSaysThatNothingLands) {
  auto log = datasets::read_throw_log(quick);
  for (auto& one : log.throws) one.landing.reset();
  log.landing_height = 1.5;
  datasets::write_throw_log(folder / "roof.h5", log);
  for (const std::string engine : {"cvode", "patch"})
    expect_refusal("crosscheck roof.h5 --models limit_surface --json c.json --engine " + engine, 1,
                   "roof.h5: " + engine + " brings no throw to a landing");
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
