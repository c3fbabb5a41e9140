// fit, and what its cards foretell.
#include <fmt/format.h>

#include "tests/apps/cli.hpp"

namespace unhand::cli {
namespace {

// A hand that is logged no longer than the object is held: the throw cannot be simulated, and that is said.
TEST_F(Cli, FitSaysWhichThrowsItLeavesOut) {
  write_changed("short.h5", [](datasets::Throw& one) {
    if (one.id != "001") return;
    const std::size_t rows = one.hand->time.rows / 3;
    for (datasets::Series* s : {&one.hand->time, &one.hand->pose, &one.hand->twist, &one.hand->acceleration})
      s->rows = rows, s->data.resize(rows * s->cols);
  });
  const Answer answer = run("fit short.h5 --model sliding_pivot --json f.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("fitted to 7 of 8 train throws"));
  EXPECT_THAT(answer.err, HasSubstr("without 1 of the train throws"));
  EXPECT_THAT(answer.err, HasSubstr(": 001\n"));
  const std::string why = "the pads still press on the object where the hand's motion ends";
  EXPECT_THAT(answer.out,
              HasSubstr("1 train throws could not be simulated from the start and took no part: " + why +
                        " (1 throws)"));
  json fitted = read_json(folder / "f.json");
  for (const auto& one : fitted["throws"]) {
    if (one["id"] == "001")
      EXPECT_EQ(one["why_not"], why);
    else
      EXPECT_TRUE(one["why_not"].is_null()) << one["id"];
  }
}

// A mass declared 5 % too small leaves flights in their noise; the wrench in the closed hand knows better.
TEST_F(Cli, AWrenchThatDoesNotFollowInTheFirmGraspIsTold) {
  ASSERT_EQ(run("generate quick12 --seed 4 --effect sensor.mass.ratio=1.05 --out heavy.h5").code, 0);
  const Answer answer = run("fit heavy.h5 --model limit_surface_disc");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err,
              HasSubstr("in the firm grasp, where no friction acts, the model does not follow ft."));
}

// σ is of what is not known, not of what the model has wrong: the card knows how far off that was.
TEST_F(Cli, PredictSaysWhereTheCardWasMissedByFarMoreThanItsSigmas) {
  ASSERT_EQ(run("fit " + quick + " --model limit_surface_disc --card c.json").code, 0);
  const std::string predict = "predict " + quick + " --card ";
  EXPECT_THAT(run(predict + "c.json").err, Not(HasSubstr("missed by far more")));
  json card = read_json(folder / "c.json");
  card["errors"]["test"]["landing_theta_deg"]["mae"] = 25.0;
  std::ofstream(folder / "off.json") << card;
  const Answer off = run(predict + "off.json");
  ASSERT_EQ(off.code, 0) << off.err;
  EXPECT_THAT(off.err, HasSubstr("missed by far more than the sigmas here"));
  EXPECT_THAT(off.err, HasSubstr("landing theta [deg] 25 ("));
  EXPECT_THAT(off.err, Not(HasSubstr("landing x [m]")));
}

// A fit converges whatever the model lacks; its intervals know nothing of that.
TEST_F(Cli, FitWarnsOfWhatTheModelLacksInReportJsonAndCard) {
  ASSERT_EQ(run("generate quick12 --seed 3 --effect flight.quadratic_drag=0.3 --out windy.h5").code, 0);
  for (const bool windy : {true, false}) {
    const std::string log = windy ? "windy.h5" : quick;
    const Answer answer =
        run("fit " + log + " --model limit_surface_disc --report r --json f.json --card c.json");
    ASSERT_EQ(answer.code, 0) << answer.err;
    const Answer predicted = run("predict " + quick + " --card c.json");
    const std::string report = content(folder / "r/report.md");
    json fitted = read_json(folder / "f.json");
    EXPECT_EQ(fitted["warnings"].empty(), !windy) << fitted["warnings"];
    EXPECT_EQ(fitted["warnings"].dump().find("mocap.x (flight) is off by") != std::string::npos, windy);
    for (const auto& warning : fitted["warnings"]) {
      EXPECT_THAT(answer.err, HasSubstr("unhand: " + warning.get<std::string>() + "\n"));
      EXPECT_THAT(report, HasSubstr("\n\nwarning: " + warning.get<std::string>() + "\n\n"));
      EXPECT_THAT(predicted.err, HasSubstr("unhand: c.json: " + warning.get<std::string>() + "\n"));
    }
    EXPECT_FALSE(fitted["notes"].empty());
    for (const auto& note : fitted["notes"]) {
      EXPECT_THAT(answer.out, HasSubstr("\nnote: " + note.get<std::string>() + "\n"));
      EXPECT_THAT(report, HasSubstr("\n\nnote: " + note.get<std::string>() + "\n\n"));
    }
  }
}

// One landing that was read half a metre off is one reading: the model and the other throws are well.
TEST_F(Cli, FitSaysThatAWildReadingIsOfOneThrow) {
  write_changed("wild.h5", [](datasets::Throw& one) {
    if (one.id == "001") one.landing->pose(0, 0) += 0.5;
  });
  const Answer answer = run("fit wild.h5 --model limit_surface_disc");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err, HasSubstr("landing.x (landing) is off by"));
  EXPECT_THAT(answer.err, HasSubstr("nearly all of it in one throw"));
  EXPECT_THAT(answer.err, Not(HasSubstr("something is missing")));
  EXPECT_THAT(answer.err, Not(HasSubstr("Another unit")));
}

// A held-out landing that was written down wrongly bends no fit, but the errors that the card tells.
TEST_F(Cli, FitNamesHeldOutThrowsThatErrAsNoOther) {
  std::string id;
  write_changed("wild.h5", [&id](datasets::Throw& one) {
    if (!id.empty() || one.split == datasets::Split::train) return;
    id = one.id, one.landing->pose(0, 0) += 0.5;
  });
  const Answer answer = run("fit wild.h5 --model limit_surface_disc");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err, HasSubstr("landing x [m] errs as in no other throw in " + id + ", held out (-0.5"));
  EXPECT_THAT(run("fit " + quick + " --model limit_surface_disc").err, Not(HasSubstr("errs as in no other")));
}

// What is declared too small is told where it shows.
TEST_F(Cli, FitSaysThatNoiseIsDeclaredTooSmall) {
  write_changed("sure.h5", [](datasets::Throw& one) {
    for (double& sigma : one.mocap->pose.sigma) sigma *= 0.3;
  });
  EXPECT_THAT(
      run("fit sure.h5 --model limit_surface_disc").err,
      HasSubstr(
          "noise is declared too small, which chi2 takes for misfit: mocap/pose scatters by more than it "
          "declares, x 3."));
}

TEST_F(Cli, FitThenPredict) {
  const Answer answer =
      run("fit " + quick + " --model limit_surface_disc --card c.json --json f.json --report r");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err, IsEmpty());
  for (const char* words : {"95 % interval", "chi2/sample", "no outlier throws", "pads are taken as rigid"})
    EXPECT_THAT(answer.out, HasSubstr(words));
  for (const char* timing : {"Jacobian", "derivatives by"}) {
    EXPECT_THAT(answer.out, Not(HasSubstr(timing)));
    EXPECT_THAT(content(folder / "r/report.md"), HasSubstr(timing));
  }
  EXPECT_THAT(files(),
              testing::IsSupersetOf({"c.json", "f.json", "r/fit.json", "r/report.md", "r/throws.csv"}));
  json fitted = read_json(folder / "f.json"), card = read_json(folder / "c.json");
  EXPECT_EQ(fitted["schema"], "fit");
  EXPECT_EQ(fitted["schema_version"], 1);
  EXPECT_EQ(fitted["outcome"], "converged");
  EXPECT_NEAR(fitted["parameters"]["mu"]["value"].get<double>(), 0.5, 0.03);  // 3 sigma of eight throws' mu
  EXPECT_TRUE(fitted["cross_validation"].is_null());                          // there is a test split
  for (const char* split : {"train", "test"})
    for (const char* quantity : {"detach_vx_m_s", "detach_omega_deg_s", "landing_x_m", "landing_theta_deg"})
      EXPECT_EQ(card["errors"][split][quantity]["mae"], fitted[split][quantity]["mae"]) << split << quantity;
  EXPECT_LT(card["errors"]["test"]["landing_x_m"]["mae"].get<double>(), 0.01);
  EXPECT_EQ(card["log"]["checksum"], fitted["checksum"]);
  EXPECT_TRUE(card["valid_range"].contains("release_speed"));

  const Answer predicted = run("predict " + quick + " --card c.json --json p.json --csv p.csv");
  ASSERT_EQ(predicted.code, 0) << predicted.err;
  EXPECT_THAT(predicted.out, HasSubstr("±"));
  EXPECT_THAT(predicted.out, HasSubstr("campaign quick12; synthetic: simulated by unhand"));
  EXPECT_THAT(read_json(folder / "p.json")["source"], StartsWith("synthetic: "));
  EXPECT_THAT(content(folder / "p.csv"), HasSubstr("sigma_landing_x_m"));
  json throws = read_json(folder / "p.json")["throws"];
  ASSERT_EQ(throws.size(), 12u);
  double mae = 0;
  int n = 0;
  std::set<std::string> conditions;
  for (const auto& one : throws) {
    for (const auto& reason : one["outside_valid_range"])
      conditions.insert(reason.get<std::string>().substr(0, reason.get<std::string>().find(' ')));
    EXPECT_GT(one["sigma"]["landing_x_m"].get<double>(), 0);
    // The campaign's landing sensor has 1 mm and 0.5 deg.
    const auto of = [&](const char* what, const char* quantity) { return one[what][quantity].get<double>(); };
    EXPECT_NEAR(of("sigma_measured", "landing_x_m"), std::hypot(of("sigma", "landing_x_m"), 0.001), 1e-12);
    EXPECT_NEAR(of("sigma_measured", "landing_theta_deg"), std::hypot(of("sigma", "landing_theta_deg"), 0.5),
                1e-9);
    const bool outside = !one["outside_valid_range"].empty();
    if (one["split"] == "train") {
      EXPECT_FALSE(outside);
    } else {
      mae += std::abs(one["error"]["landing_x_m"].get<double>());
      ++n;
    }
  }
  // The CSV and the table say what the JSON does.
  const auto csv = columns_of(content(folder / "p.csv"));
  for (std::size_t k = 0; k < 12; ++k) {
    json& one = throws[k];
    ASSERT_EQ(csv.at("throw")[k], one["id"]);
    const auto same = [&](const std::string& column, const json& value) {
      EXPECT_NEAR(std::stod(csv.at(column)[k]), value.get<double>(),
                  1e-9 * (1 + std::abs(value.get<double>())))
          << column;
    };
    for (const auto& [key, value] : one["detach"].items())
      if (csv.count("detach_" + key) > 0) same("detach_" + key, value);
    same("landing_theta_deg", one["landing"]["theta_deg"]);
    for (const auto& [key, value] : one["sigma"].items())
      if (key != "flight_time_s") same("sigma_" + key, value);
    for (const auto& [key, value] : one["sigma_measured"].items()) same("sigma_measured_" + key, value);
    EXPECT_THAT(predicted.out,
                HasSubstr(fmt::format("{:.2f} ± ", one["landing"]["theta_deg"].get<double>())));
  }
  card["valid_range"]["shape"] = {{"low", 5}, {"high", 6}, {"unit", "-"}};
  std::ofstream(folder / "narrow.json") << card;
  EXPECT_THAT(run("predict " + quick + " --card narrow.json").err,
              testing::ContainsRegex("shape is [0-9.]+, outside \\[5, 6\\]"));
  EXPECT_NEAR(mae / n, fitted["test"]["landing_x_m"]["mae"].get<double>(), 1e-12);  // summed in another order
  EXPECT_EQ(static_cast<std::size_t>(std::count(predicted.err.begin(), predicted.err.end(), '\n')),
            conditions.size());  // a line each, not one per throw
  for (const auto& condition : conditions)
    EXPECT_THAT(predicted.err,
                HasSubstr("of 12 throws are outside of the card's valid range in " + condition));
  ASSERT_EQ(run("compare " + quick + " --models limit_surface_disc --card c.json --json k.json").code, 0);
  json compared = read_json(folder / "k.json")["models"]["limit_surface_disc"];
  EXPECT_TRUE(compared["estimate"]["from_card"]);
  EXPECT_NEAR(compared["test"]["landing_x_m"]["mae"].get<double>(), mae / n, 1e-5);  // another rtol

  json foreign = card;
  foreign["effects"] = {"flight.sorcery"};
  std::ofstream(folder / "bad.json") << foreign.dump();
  expect_refusal("predict " + quick + " --card bad.json", 3, "bad.json: /effects/0");
  foreign = card;
  foreign["model"] = "convex_quartic";
  std::ofstream(folder / "bad.json") << foreign.dump();
  expect_refusal("predict " + quick + " --card bad.json", 3, "bad.json: /model");
}

/// A card whose friction alone is uncertain.
void write_card_of_mu(const fs::path& file, double mu) {
  std::ofstream(file) << fmt::format(
      R"({{"schema": "model-card", "schema_version": 1, "model": "limit_surface", "library_version": "0",
      "log": {{"file": "made by a test"}}, "parameters": {{"mu": {{"value": {}, "sigma": 0.01, "unit": "-"}},
      "length": {{"value": 0.007, "unit": "m"}}, "pads": {{"value": 2, "unit": "-"}},
      "reference_force": {{"value": 50, "unit": "N"}}}},
      "own_spreads": {{"mu_deviation": {{"sigma": 1e-9, "unit": "-"}},
      "grasp_angle": {{"sigma": 1e-9, "unit": "rad"}}, "grasp_offset": {{"sigma": 1e-9, "unit": "m"}},
      "dead_time_deviation": {{"sigma": 1e-9, "unit": "s"}},
      "force_deviation": {{"sigma": 1e-9, "unit": "-"}}}}}})",
      mu);
}

// To first order an outcome scatters by its derivative with respect to what is uncertain, times the sigma.
TEST_F(Cli, ThePredictedSigmasAreThoseOfTheFriction) {
  const auto predicted = [&](double mu) {
    write_card_of_mu(folder / "card.json", mu);
    EXPECT_EQ(run("predict " + quick + " --card card.json --json p.json").code, 0);
    return read_json(folder / "p.json")["throws"];
  };
  constexpr double kApart = 1e-3;
  json throws = predicted(0.5), more = predicted(0.5 + kApart), less = predicted(0.5 - kApart);
  ASSERT_EQ(throws.size(), 12u);
  for (std::size_t k = 0; k < 12; ++k)
    for (const auto& [name, where, key] : {std::tuple{"detach_vx_m_s", "detach", "vx_m_s"},
                                           {"detach_vz_m_s", "detach", "vz_m_s"},
                                           {"detach_omega_deg_s", "detach", "omega_deg_s"},
                                           {"landing_x_m", "landing", "x_m"},
                                           {"landing_theta_deg", "landing", "theta_deg"},
                                           {"flight_time_s", "landing", "flight_time_s"}}) {
      const double slope =
          (more[k][where][key].get<double>() - less[k][where][key].get<double>()) / (2 * kApart);
      EXPECT_NEAR(throws[k]["sigma"][name].get<double>(), std::abs(0.01 * slope),
                  1e-3 * std::abs(0.01 * slope) + 1e-7)
          << name << " of " << throws[k]["id"];
    }
}

// What ends a throw without a landing is told in words; JSON has its name.
TEST_F(Cli, ThrowsThatDoNotLandAreToldInWords) {
  ASSERT_EQ(run("fit " + quick + " --model limit_surface_disc --card c.json").code, 0);
  auto log = datasets::read_throw_log(quick);
  for (auto& one : log.throws) one.landing.reset();
  std::vector<double> peaks = peaks_of(log);
  std::sort(peaks.begin(), peaks.end());
  log.landing_height = peaks[peaks.size() / 2];
  datasets::write_throw_log(folder / "high.h5", log);
  const Answer answer = run("predict high.h5 --card c.json --json p.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(
      answer.err,
      HasSubstr("of 12 throws, never_reaches: the object never comes down through the landing height"));
  EXPECT_THAT(read_json(folder / "p.json").dump(), HasSubstr("\"never_reaches\""));
  log.landing_height = peaks.back() + 0.3;
  datasets::write_throw_log(folder / "higher.h5", log);
  const std::string words =
      "brings no throw to a landing: the object never comes down through the landing height";
  expect_refusal("predict higher.h5 --card c.json --json q.json", 1, words);
}

// Without a normal force the card tells how the pads open, or prediction says what is missing.
TEST_F(Cli, PredictSaysHowPadsOpenThatNobodyMeasured) {
  ASSERT_EQ(run("generate quick12 --seed 4 --without ft --out bare.h5").code, 0);
  ASSERT_EQ(run("fit bare.h5 --model limit_surface_disc --card bare.json --json f.json").code, 0);
  const Answer answer = run("predict bare.h5 --card bare.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err,
              HasSubstr("12 of 12 throws have no normal force: there the pads open as the card says "
                        "(grip_force "));
  ASSERT_EQ(run("fit " + quick + " --model limit_surface_disc --card c.json").code, 0);
  expect_refusal("predict bare.h5 --card c.json", 3,
                 "c.json: /parameters/grip_force: is missing: throws without a measured normal force");

  // What takes part in an open direction is not called determined, by the fit or by its card.
  json fitted = read_json(folder / "f.json"), card = read_json(folder / "bare.json")["parameters"];
  ASSERT_FALSE(fitted["open_directions"].empty());
  EXPECT_FALSE(fitted["parameters"]["mu"]["determined"].get<bool>());
  for (const auto& [name, parameter] : fitted["parameters"].items()) {
    EXPECT_EQ(card[name].value("determined", true), parameter["determined"].get<bool>()) << name;
    for (const auto& open : fitted["open_directions"])
      if (open["meaning"].get<std::string>().find(name + " ") != std::string::npos) {
        EXPECT_FALSE(parameter["determined"].get<bool>()) << name;
      }
  }
}

TEST_F(Cli, FitAnswersOrSaysWhyNot) {
  std::ofstream(folder / "c.json") << "the old card";
  const std::string card = " --card c.json --json f.json";
  expect_refusal("fit " + quick + " --model wishful" + card, 2, "'wishful' cannot be fitted");
  expect_refusal("fit " + quick + " --model limit_surface_naive" + card, 2, "cannot be fitted");
  expect_refusal("fit " + quick + " --model gripper_delay --effects flight.sorcery" + card, 2,
                 "flight.sorcery");
  expect_refusal("fit " + quick + " --model gripper_delay --kfold 1" + card, 2, "at least 2 folds");
  expect_refusal("fit none.h5 --model gripper_delay" + card, 3, "none.h5");
  expect_refusal("fit " + quick + " --model ellipsoid" + card, 3, "slip-logs");
  expect_refusal("fit " + quick + " --model gripper_delay --json f.json --card none/c.json", 1,
                 "cannot be written");
  write_changed("test.h5", [](datasets::Throw& one) { one.split = datasets::Split::test; });
  expect_refusal("fit test.h5 --model gripper_delay" + card, 1, "no train throws");
  write_changed("handless.h5", [](datasets::Throw& one) {
    one.split = datasets::Split::train;
    one.hand.reset();
    one.condition = "same";
  });
  expect_refusal("fit handless.h5 --model gripper_delay" + card, 3, "/hand: missing");
  EXPECT_EQ(content(folder / "c.json"), "the old card");
}

TEST_F(Cli, AnotherUnitIsNamed) {
  constexpr double kDegree = 180 / std::numbers::pi, kGravity = 9.80665;
  write_changed("deg.h5", [](datasets::Throw& one) {
    auto& pose = one.mocap->pose;
    for (std::size_t i = 0; i < pose.rows; ++i) pose(i, 2) *= kDegree;
  });
  ASSERT_EQ(run("compare " + quick + " --models limit_surface_disc --write-cards .").code, 0);
  for (const std::string command :
       {"fit deg.h5 --model limit_surface_disc --card c.json", "compare deg.h5",
        "discover deg.h5 --json d.json", "predict deg.h5 --card limit_surface_disc.json",
        "figure landing-errors --log deg.h5 --out f"})
    expect_refusal(command, 3, "/throws/*/mocap/pose: theta is 57.");
  EXPECT_THAT(run("inspect deg.h5").out, HasSubstr("doubtful: /throws/*/mocap/pose: theta is 57."));

  // Of the normal force only the product with friction is determined: no other channel knows its unit.
  for (const auto& [unit, factor] : {std::pair{"kgf", 1 / kGravity}, {"mN", 1e3}}) {
    write_changed("force.h5", [factor = factor](datasets::Throw& one) {
      auto& force = one.ft->normal_force;
      for (double& f : force.data) f *= factor;
      for (double& s : force.sigma) s *= factor;
    });
    expect_refusal("fit force.h5 --model limit_surface_disc --card c.json", 3, "/throws/*/ft/normal_force: ");
    expect_refusal("compare force.h5 --models limit_surface_disc", 3, unit);
  }
}

TEST_F(Cli, KilledFitLeavesTheOldCard) {
  std::ofstream(folder / "c.json") << "the old card";
  const std::string fit = "fit " + quick + " --model gripper_delay --card c.json --threads 1";
  for (const char* after : {"0.05", "0.3"}) {
    const std::string command = "cd '" + folder.string() + "' && timeout -s KILL " + after +
                                " '" UNHAND_BINARY "' " + fit + " >/dev/null 2>&1 </dev/null";
    const int status = std::system(command.c_str());
    const std::string now = content(folder / "c.json");
    const bool was_done = WIFEXITED(status) && WEXITSTATUS(status) == 0;  // a fast machine
    if (was_done || now != "the old card") {
      EXPECT_EQ(json::parse(now)["schema"], "model-card");
    }
  }
  ASSERT_EQ(run(fit).code, 0);
  EXPECT_EQ(read_json(folder / "c.json")["model"], "gripper_delay");
}

TEST_F(Cli, FitCrossValidatesWithoutTestThrows) {
  write_all_train("train.h5");
  const Answer answer = run("fit train.h5 --model gripper_delay --json f.json --card c.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("cross-validated"));
  json fitted = read_json(folder / "f.json");
  EXPECT_EQ(fitted["cross_validation"]["folds"], 5);
  EXPECT_EQ(fitted["cross_validation"]["n"], 12);
  EXPECT_TRUE(read_json(folder / "c.json")["errors"].contains("cross_validation"));

  const Answer more = run("fit train.h5 --model gripper_delay --kfold 100 --json f.json");
  ASSERT_EQ(more.code, 0) << more.err;
  EXPECT_THAT(more.err,
              HasSubstr("unhand: --kfold 100: 6 folds, as many as the train throws have conditions\n"));
  EXPECT_EQ(read_json(folder / "f.json")["cross_validation"]["folds"], 6);
}

TEST_F(Cli, CompareFitsTheModels) {
  const Answer answer =
      run("compare " + quick +
          " --models limit_surface,limit_surface_naive,gripper_delay --fit --json a.json --write-cards c");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json models = read_json(folder / "a.json")["models"];
  ASSERT_EQ(models.size(), 3u);
  for (const auto& [name, model] : models.items()) {
    EXPECT_THAT(model["estimate"]["method"].get<std::string>(), HasSubstr("fitted")) << name;
    EXPECT_FALSE(model["parameters"].empty()) << name;
    EXPECT_EQ(model["train"]["n"].get<int>() + model["test"]["n"].get<int>(), 12) << name;
    EXPECT_TRUE(model["test"]["landing_x_m"]["mae"].is_number()) << name;
  }
  for (const char* name : {"mu", "length"})
    EXPECT_EQ(models["limit_surface_naive"]["parameters"][name], models["limit_surface"]["parameters"][name]);
  EXPECT_LT(models["limit_surface"]["test"]["landing_x_m"]["mae"].get<double>(), 0.01);
  json card = read_json(folder / "c/limit_surface.json");
  EXPECT_TRUE(card.contains("covariance"));
  for (const auto& [name, sigma] : models["limit_surface"]["parameter_sigmas"].items())
    EXPECT_EQ(sigma, card["parameters"][name]["sigma"]) << name;
  EXPECT_EQ(models["limit_surface"]["parameter_sigmas"].size(), models["limit_surface"]["parameters"].size());
}

}  // namespace
}  // namespace unhand::cli
