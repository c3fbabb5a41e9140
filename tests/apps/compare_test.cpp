// compare, its report and its cards; predict with them.
#include <fmt/format.h>

#include <iomanip>

#include "tests/apps/cli.hpp"

namespace unhand::cli {
namespace {

TEST_F(Cli, CompareReleases) {
  const std::string models = "compare " + quick + " --models sliding_pivot,limit_surface,gripper_delay ";
  ASSERT_EQ(run(models + "--threads 1 --json one.json").code, 0);
  const Answer answer = run(models + "--threads 2 --json two.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("landing theta [deg]"));
  EXPECT_THAT(answer.out, HasSubstr("campaign quick12; synthetic: simulated by unhand"));
  EXPECT_THAT(answer.err, IsEmpty());
  json one = read_json(folder / "one.json");
  EXPECT_EQ(timeless(one), timeless(read_json(folder / "two.json")));
  EXPECT_EQ(one["schema"], "compare");
  EXPECT_EQ(one["schema_version"], 1);
  EXPECT_TRUE(one.contains("log"));
  EXPECT_THAT(one["source"], StartsWith("synthetic: "));
  ASSERT_EQ(one["models"].size(), 3u);
  for (const auto& [name, model] : one["models"].items()) {
    EXPECT_FALSE(model["parameters"].empty()) << name;
    EXPECT_GT(model["microseconds_per_throw"], 0) << name;
    EXPECT_EQ(model["train"]["n"].get<int>() + model["test"]["n"].get<int>(), 12) << name;
    for (const char* split : {"train", "test"})
      for (const char* quantity : {"detach_vx_m_s", "detach_omega_deg_s", "landing_x_m", "landing_theta_deg"})
        for (const char* statistic : {"mae", "std", "bias"})
          EXPECT_TRUE(model[split][quantity][statistic].is_number())
              << name << split << quantity << statistic;
  }
}

TEST_F(Cli, TheErrorOfOneThrowHasNoStandardDeviation) {
  int k = 0;
  write_changed("one.h5", [&](datasets::Throw& one) {
    one.split = k++ == 0 ? datasets::Split::test : datasets::Split::train;
  });
  ASSERT_EQ(run("compare one.h5 --models limit_surface_disc --json one.json").code, 0);
  auto model = read_json(folder / "one.json")["models"]["limit_surface_disc"];
  EXPECT_TRUE(model["test"]["landing_x_m"]["std"].is_null());
  EXPECT_TRUE(model["test"]["landing_x_m"]["mae"].is_number());
  EXPECT_TRUE(model["train"]["landing_x_m"]["std"].is_number());
}

// Motion capture and grasp_angle are optional, by throw.
TEST_F(Cli, ThrowsWithoutAGraspAreLeftOut) {
  int k = 0;
  write_changed("half.h5", [&](datasets::Throw& one) {
    if (k++ % 2 == 1) one.mocap.reset(), one.grasp_angle.reset();
  });
  const Answer answer = run("compare half.h5 --models sliding_pivot,gripper_delay --json a.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err, HasSubstr("left out 6 of 12 throws, which do not show the grasp"));
  json model = read_json(folder / "a.json")["models"]["sliding_pivot"];
  EXPECT_EQ(model["train"]["n"].get<int>() + model["test"]["n"].get<int>(), 6);
  write_changed("none.h5", [](datasets::Throw& one) { one.mocap.reset(), one.grasp_angle.reset(); });
  expect_refusal("compare none.h5 --json b.json", 3, "@grasp_angle: missing");
  EXPECT_THAT(run("inspect half.h5").out, HasSubstr("note: 6 of 12 throws do not show the grasp"));
}

// One throw whose hand was not recorded takes no other with it.
TEST_F(Cli, ThrowsWithoutAHandAreLeftOutWhereOthersHaveOne) {
  int k = 0;
  write_changed("one.h5", [&](datasets::Throw& one) {
    if (k++ == 2) one.hand.reset();
  });
  const Answer answer = run("compare one.h5 --models sliding_pivot --json a.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err,
              HasSubstr("left out 1 of 12 throws, which have no hand, which the others have: 003"));
  json model = read_json(folder / "a.json")["models"]["sliding_pivot"];
  EXPECT_EQ(model["train"]["n"].get<int>() + model["test"]["n"].get<int>(), 11);
  EXPECT_EQ(run("fit one.h5 --model gripper_delay --card c.json").code, 0);
  EXPECT_THAT(run("inspect one.h5").out,
              HasSubstr("note: 1 of 12 throws have no hand and are held at first"));
}

// Neither does one without the sensor, and all models are judged by the same throws.
TEST_F(Cli, ThrowsWithoutANormalForceAreLeftOutOfModelsThatFollowIt) {
  int k = 0;
  write_changed("one.h5", [&](datasets::Throw& one) {
    if (k++ == 2) one.ft.reset();
  });
  const std::string told = "left out 1 of 12 throws, which have no normal force, which the others have: 003";
  const auto throws_of = [&](const std::string& options, const char* model) {
    const Answer answer = run("compare one.h5 " + options + " --json a.json");
    EXPECT_EQ(answer.code, 0) << answer.err;
    EXPECT_EQ(
        answer.err.find(told) != std::string::npos,
        options.find("limit_surface") != std::string::npos && options.find("--fit") == std::string::npos)
        << options;
    const json of = read_json(folder / "a.json")["models"][model];
    return of["train"]["n"].get<int>() + of["test"]["n"].get<int>();
  };
  EXPECT_EQ(throws_of("--models limit_surface,gripper_delay", "limit_surface"), 11);
  EXPECT_EQ(throws_of("--models limit_surface,gripper_delay", "gripper_delay"), 11);
  EXPECT_EQ(throws_of("--models gripper_delay", "gripper_delay"), 12);
  EXPECT_EQ(throws_of("--models limit_surface --fit", "limit_surface"), 12);
  EXPECT_THAT(run("crosscheck one.h5 --engine cvode --models limit_surface").err, HasSubstr(told));
}

TEST_F(Cli, BlanksAroundNamesMeanNothing) {
  auto log = datasets::read_throw_log(quick);
  const std::string first = log.throws.front().condition;
  std::erase_if(log.throws, [&](const auto& one) { return one.condition != first; });
  datasets::write_throw_log(folder / "one.h5", log);
  const Answer answer = run("compare one.h5 --models ' gripper_delay, limit_surface' --json a.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_EQ(read_json(folder / "a.json")["models"].size(), 2u);
  EXPECT_THAT(answer.out, HasSubstr(" 1 condition; "));
}

// Parameters come from train throws: without any, that is what is said, not how few samples there are.
TEST_F(Cli, NoTrainThrowsIsSaid) {
  write_changed("test.h5", [](datasets::Throw& one) { one.split = datasets::Split::test; });
  const Answer answer = run("compare test.h5");
  EXPECT_EQ(answer.code, 1);
  EXPECT_THAT(answer.err, HasSubstr("gripper_delay: not compared: none of the log's 12 throws has the split "
                                    "'train', and parameters are estimated from no others"));
  EXPECT_THAT(answer.err, Not(HasSubstr("samples")));
  expect_refusal("compare test.h5 --fit --models limit_surface --json a.json", 1,
                 "limit_surface: none of the log's 12 throws has the split 'train'");
  expect_refusal("fit test.h5 --model limit_surface --card c.json", 1,
                 "none of its 12 throws has the split 'train'");
}

// Wrenches without torque do not tell how large the pads are; the delay needs no pads.
TEST_F(Cli, AModelThatTheLogDoesNotDetermineStopsNoOther) {
  write_changed("straight.h5", [](datasets::Throw& one) {
    for (std::size_t i = 0; i < one.ft->wrench.rows; ++i) one.ft->wrench(i, 2) *= 1e-3;
  });
  const Answer answer = run("compare straight.h5 --models limit_surface,gripper_delay --json a.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err, HasSubstr("limit_surface: not compared: the log does not determine"));
  json found = read_json(folder / "a.json");
  EXPECT_EQ(found["models"].size(), 1u);
  EXPECT_TRUE(found["models"].contains("gripper_delay"));
  EXPECT_TRUE(found["not_compared"].contains("limit_surface"));
  expect_refusal("compare straight.h5 --models limit_surface --json b.json", 1, "does not determine");
}

// A landing measured with a ruler has no angle: one that is declared as unknown is not judged by.
TEST_F(Cli, ALandingOfUnknownAngleTellsItsPlaceAlone) {
  write_changed("ruler.h5", [](datasets::Throw& one) {
    one.landing->pose(0, 1) = 0;
    one.landing->pose.sigma = {1e-3, 4};
  });
  EXPECT_THAT(run("inspect ruler.h5").out, Not(HasSubstr("doubtful")));
  ASSERT_EQ(run("fit ruler.h5 --model limit_surface_disc --json f.json --card c.json").code, 0);
  json fitted = read_json(folder / "f.json");
  EXPECT_EQ(fitted["test"]["landing_theta_deg"]["n"], 0);
  EXPECT_LT(fitted["test"]["landing_x_m"]["mae"].get<double>(), 0.01);
  EXPECT_NEAR(fitted["parameters"]["mu"]["value"].get<double>(), 0.5, 0.03);  // 3 sigma of eight throws' mu
  ASSERT_EQ(run("predict ruler.h5 --card c.json --json p.json").code, 0);
  json predicted = read_json(folder / "p.json");
  for (const auto& one : predicted["throws"]) {
    EXPECT_TRUE(one["error"].contains("landing_x_m"));
    EXPECT_FALSE(one["error"].contains("landing_theta_deg"));
  }
  const Answer compared = run("compare ruler.h5 --models limit_surface_disc");
  EXPECT_EQ(compared.code, 0) << compared.err;
}

// Without a force sensor motion capture tells the delay, to compare and to fit it.
TEST_F(Cli, ADelayNeedsNoForceSensor) {
  write_changed("tracked.h5", [](datasets::Throw& one) { one.ft.reset(); });
  const Answer compared = run("compare tracked.h5 --models gripper_delay");
  EXPECT_EQ(compared.code, 0) << compared.err;
  EXPECT_THAT(compared.out, HasSubstr("as motion capture sees them"));
  const Answer fitted = run("fit tracked.h5 --model gripper_delay");
  EXPECT_EQ(fitted.code, 0) << fitted.err;
}

// A log of hands and landings stops every model: a line per reason with the models, and the advice once.
TEST_F(Cli, CompareSaysOnceWhyNoModelIsCompared) {
  write_changed("bare.h5", [](datasets::Throw& one) {
    one.grasp_angle = 0;
    one.ft.reset(), one.mocap.reset();
  });
  const Answer answer = run("compare bare.h5");
  EXPECT_EQ(answer.code, 1);
  std::istringstream lines(answer.err);
  int told = 0, advised = 0;
  for (std::string line; std::getline(lines, line);) {
    ++told;
    advised += line.find("--fit") != std::string::npos;
    EXPECT_LT(line.size(), 250u) << line;
  }
  EXPECT_EQ(told, 5) << answer.err;  // two reasons, what helps against each, the outcome
  EXPECT_EQ(advised, 1) << answer.err;
  EXPECT_THAT(answer.err,
              HasSubstr("limit_surface, limit_surface_disc, limit_surface_quartic: not compared: the log "
                        "determines no friction"));
  EXPECT_THAT(answer.err, HasSubstr("gripper_delay: not compared: the log shows no detach"));
}

// What a gripper still holds does not fly, even if nobody logged the hand.
TEST_F(Cli, ThrowsWithoutAHandAreNoFlightsBeforeTheyAreLetGo) {
  write_changed("carried.h5", [](datasets::Throw& one) { one.hand.reset(); });
  expect_refusal("compare carried.h5 --json a.json", 3, "@free_flight: missing");
  expect_refusal("compare carried.h5 --json a.json", 3, "declare free_flight");
  const Answer shown = run("inspect carried.h5");
  EXPECT_THAT(shown.out, HasSubstr("0 free flights"));
  EXPECT_THAT(shown.out, HasSubstr("note: 12 of 12 throws have no hand and are held at first"));
  write_changed("free.h5", [](datasets::Throw& one) {
    one.hand.reset();
    one.free_flight = {0.2, one.landing->time(0)};
  });
  const Answer answer = run("compare free.h5 --json b.json");
  EXPECT_EQ(answer.code, 0) << answer.err;
}

TEST_F(Cli, NoTestThrowsNoNumbers) {
  write_all_train("train.h5");
  const Answer answer = run("compare train.h5 --models gripper_delay --json a.json --report r");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json test = read_json(folder / "a.json")["models"]["gripper_delay"]["test"];
  EXPECT_EQ(test["n"], 0);
  EXPECT_TRUE(test["landing_x_m"]["mae"].is_null());
  for (const auto& text : {answer.out, content(folder / "a.json"), content(folder / "r/report.md"),
                           content(folder / "r/throws.csv"), content(folder / "r/conditions.dat")}) {
    EXPECT_THAT(text, Not(HasSubstr("nan")));
    EXPECT_THAT(text, Not(HasSubstr("NaN")));
  }
}

TEST_F(Cli, ReportIsComplete) {
  const Answer answer = run("compare " + quick + " --models sliding_pivot,gripper_delay --report new/report");
  ASSERT_EQ(answer.code, 0) << answer.err;
  for (const std::string name : {"landing_errors", "conditions"})
    for (const char* ending : {".png", ".pdf", ".gp", ".dat"})
      EXPECT_GT(fs::file_size(folder / "new/report" / (name + ending)), 0u) << name << ending;
  EXPECT_EQ(read_json(folder / "new/report/compare.json")["schema"], "compare");
  const std::string csv = content(folder / "new/report/throws.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 2 * 12);
  EXPECT_EQ(files().size(), 2u + 8 + 3);  // two folders
  // Again over the old one, which keeps what is not ours.
  std::ofstream(folder / "new/report/mine.txt") << "mine";
  ASSERT_EQ(run("compare " + quick + " --models gripper_delay --report new/report/").code, 0);
  EXPECT_EQ(content(folder / "new/report/mine.txt"), "mine");
  EXPECT_EQ(files().size(), 2u + 8 + 3 + 1);
}

TEST_F(Cli, ReportsShowNamesAsTheyAreAndWhereDataComeFrom) {
  const std::string name = "a<b>*c*|.h5";
  fs::copy_file(quick, folder / name);
  ASSERT_EQ(run("compare '" + name + "' --models gripper_delay --report r").code, 0);
  EXPECT_THAT(content(folder / "r/report.md"), HasSubstr("a&lt;b>\\*c\\*\\|.h5: "));
  const std::string origin = datasets::read_throw_log(quick).source;
  ASSERT_THAT(origin, HasSubstr("synthetic"));
  EXPECT_THAT(content(folder / "r/landing_errors.gp"), HasSubstr(origin));
  ASSERT_EQ(run("fit " + quick + " --model limit_surface_disc --report f").code, 0);
  EXPECT_THAT(content(folder / "f/landing_errors.gp"), HasSubstr(origin));
}

TEST_F(Cli, ErrorsSayOfHowManyThrowsTheyAre) {
  bool first = true;
  write_changed("some.h5", [&](datasets::Throw& one) {
    if (one.split == datasets::Split::test && std::exchange(first, false)) one.landing.reset();
  });
  const Answer answer = run("compare some.h5 --models gripper_delay --report r --json a.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json test = read_json(folder / "a.json")["models"]["gripper_delay"]["test"];
  const int n = test["landing_x_m"]["n"];
  ASSERT_LT(n, test["n"].get<int>());
  EXPECT_THAT(answer.out, HasSubstr("(of " + std::to_string(n) + ")"));
  // A figure of conditions tells which are held out.
  EXPECT_THAT(content(folder / "r/conditions.gp"), HasSubstr("'* "));
}

TEST_F(Cli, MissingGnuplotIsSaid) {
  fs::create_directory(folder / "bin");
  const Answer answer = run("compare " + quick + " --models gripper_delay --report r --json a.json",
                            "PATH='" + (folder / "bin").string() + "'");
  EXPECT_EQ(answer.code, 1);
  EXPECT_THAT(answer.err, HasSubstr("gnuplot-nox"));
  EXPECT_THAT(files(), testing::ElementsAre("bin"));
}

TEST_F(Cli, BrokenGnuplotLeavesNothing) {
  fs::create_directory(folder / "bin");
  std::ofstream(folder / "bin/gnuplot") << "#!/bin/sh\necho 'no terminal for you' >&2\nexit 1\n";
  std::ofstream(folder / "a.json") << "the old one";
  fs::permissions(folder / "bin/gnuplot", fs::perms::owner_all);
  const Answer answer =
      run("compare " + quick + " --models gripper_delay --report r --json a.json --write-cards c",
          "PATH='" + (folder / "bin").string() + "':$PATH");
  EXPECT_EQ(answer.code, 1);
  EXPECT_THAT(answer.err, HasSubstr("no terminal for you"));
  EXPECT_THAT(files(), testing::ElementsAre("a.json", "bin", "bin/gnuplot"));
  EXPECT_EQ(content(folder / "a.json"), "the old one");
}

TEST_F(Cli, CardsCarryAnEstimate) {
  ASSERT_EQ(
      run("compare " + quick + " --models sliding_pivot,gripper_delay --write-cards cards --json a.json")
          .code,
      0);
  EXPECT_THAT(files(), testing::ElementsAre("a.json", "cards", "cards/gripper_delay.json",
                                            "cards/sliding_pivot.json"));
  for (const std::string model : {"sliding_pivot", "gripper_delay"}) {
    const Answer answer =
        run("predict " + quick + " --card cards/" + model + ".json --json p.json --csv p.csv --threads 2");
    ASSERT_EQ(answer.code, 0) << answer.err;
    json predicted = read_json(folder / "p.json");
    EXPECT_EQ(predicted["schema"], "predict");
    EXPECT_EQ(predicted["throws"].size(), 12u);
    EXPECT_TRUE(predicted["throws"][0]["landing"]["x_m"].is_number());
    ASSERT_EQ(
        run("compare " + quick + " --models " + model + " --card cards/" + model + ".json --json b.json")
            .code,
        0);
    json again = timeless(read_json(folder / "b.json"))["models"][model];
    json first = timeless(read_json(folder / "a.json"))["models"][model];
    EXPECT_EQ(again["test"], first["test"]);
    EXPECT_EQ(again["train"], first["train"]);
    EXPECT_TRUE(again["estimate"]["from_card"]);
  }
}

// A clock that counts from 1970 rounds times to 2.4e-7 s, and nothing else may come of it.
TEST_F(Cli, AClockFarFromZeroChangesNothing) {
  constexpr double kEpoch = 1.7e9;
  auto log = datasets::read_throw_log(quick);
  for (auto& one : log.throws) datasets::move_clock(one, -kEpoch);
  if (log.gripper && log.gripper->opening_command_time) *log.gripper->opening_command_time += kEpoch;
  datasets::write_throw_log(folder / "far.h5", log);
  const std::string models = " --models limit_surface_disc,sliding_pivot,gripper_delay ";
  ASSERT_EQ(run("compare " + quick + models + "--write-cards cards --json near.json").code, 0);
  ASSERT_EQ(run("compare far.h5" + models + "--json far.json --report r").code, 0);
  json near = read_json(folder / "near.json"), far = read_json(folder / "far.json");
  for (const auto& [name, model] : near["models"].items()) {
    EXPECT_EQ(far["models"][name]["failed"], model["failed"]) << name;
    for (const auto& [quantity, value] : model["test"].items()) {
      if (!value.is_object()) continue;
      const double mae = value["mae"];
      EXPECT_NEAR(far["models"][name]["test"][quantity]["mae"].get<double>(), mae, 1e-3 * mae + 1e-5)
          << name << ' ' << quantity;
    }
  }
  EXPECT_NEAR(std::stod(columns_of(content(folder / "r/throws.csv")).at("detach_time_s").front()), kEpoch,
              100);
  const std::string card = " --card cards/limit_surface_disc.json --json p.json";
  ASSERT_EQ(run("predict " + quick + card).code, 0);
  json before = read_json(folder / "p.json");
  ASSERT_EQ(run("predict far.h5" + card).code, 0);
  json after = read_json(folder / "p.json");
  for (std::size_t k = 0; k < before["throws"].size(); ++k) {
    json &a = before["throws"][k], &b = after["throws"][k];
    EXPECT_NEAR(b["detach"]["time_s"].get<double>() - kEpoch, a["detach"]["time_s"].get<double>(), 1e-6);
    EXPECT_NEAR(b["measured"]["detach_time_s"].get<double>() - kEpoch,
                a["measured"]["detach_time_s"].get<double>(), 1e-6);
    EXPECT_NEAR(b["landing"]["x_m"].get<double>(), a["landing"]["x_m"].get<double>(), 1e-5);
  }
}

// The delay that is printed is the one that is predicted with, however the throws' delays are distributed.
TEST_F(Cli, GripperDelayPredictsWithTheMeanOfTheLog) {
  auto log = datasets::read_throw_log(quick);
  log.gripper->opening_command_time = 0.1;
  for (std::size_t k = 1; k < log.throws.size(); k += 2)
    for (double& t : log.throws[k].ft->time.data) t += 0.06;
  datasets::write_throw_log(folder / "late.h5", log);
  ASSERT_EQ(run("compare late.h5 --models gripper_delay --write-cards cards --json c.json").code, 0);
  ASSERT_EQ(run("predict late.h5 --card cards/gripper_delay.json --json p.json").code, 0);
  const double delay = read_json(folder / "c.json")["models"]["gripper_delay"]["parameters"]["delay"];
  json predicted = read_json(folder / "p.json");
  double mean = 0;
  int train = 0;
  for (const auto& one : predicted["throws"]) {
    EXPECT_NEAR(one["detach"]["time_s"].get<double>(), 0.1 + delay, 1e-9);
    if (one["split"] == "train") mean += one["measured"]["detach_time_s"].get<double>() - 0.1, ++train;
  }
  EXPECT_NEAR(delay, mean / train, 1e-9);
}

/// Of pads whose friction cannot carry the bar the commands say so, and go on.
TEST_F(Cli, AGripThatCannotHoldIsSaid) {
  const std::string says = "unhand: limit_surface: in 12 of 12 throws the grip cannot hold the object";
  ASSERT_EQ(run("compare " + quick + " --models limit_surface --write-cards . --json firm.json").code, 0);
  json card = read_json(folder / "limit_surface.json");
  EXPECT_EQ(read_json(folder / "firm.json")["models"]["limit_surface"]["slips_at_start"], 0);
  card["parameters"]["mu"]["value"] = 0.05;
  std::ofstream(folder / "weak.json") << card.dump();
  const Answer predicted = run("predict " + quick + " --card weak.json --json p.json");
  EXPECT_THAT(predicted.err, HasSubstr(says));
  EXPECT_THAT(predicted.err, HasSubstr("and 1 more"));  // of six conditions
  EXPECT_EQ(read_json(folder / "p.json")["slips_at_start"], 12);
  EXPECT_TRUE(read_json(folder / "p.json")["throws"][0]["slips_at_start"]);
  const Answer compared = run("compare " + quick + " --models limit_surface --card weak.json --json c.json");
  EXPECT_THAT(compared.err, HasSubstr(says));
  EXPECT_EQ(read_json(folder / "c.json")["models"]["limit_surface"]["slips_at_start"], 12);
  EXPECT_EQ(run("figure modes --log " + quick + " --models limit_surface --card weak.json --out f").code, 0);
}

TEST_F(Cli, BadCards) {
  ASSERT_EQ(run("compare " + quick + " --models sliding_pivot --write-cards .").code, 0);
  json good = read_json(folder / "sliding_pivot.json");
  const auto expect = [&](const json& card, const std::string& reason) {
    std::ofstream(folder / "bad.json") << card.dump();
    expect_refusal("predict " + quick + " --card bad.json --json p.json", 3, "bad.json: " + reason);
  };
  json bad = good;
  bad["model"] = "wishful";
  expect(bad, "/model");
  bad = good;
  bad["parameters"].erase("mu");
  expect(bad, "/parameters/mu");
  bad = good;
  bad["parameters"]["mu"]["value"] = -1;
  expect(bad, "/parameters/mu/value");
  bad = good;
  bad["parameters"]["length"]["unit"] = "mm";
  expect(bad, "/parameters/length/unit");
  bad = good;
  bad["parameters"]["luck"] = bad["parameters"]["mu"];
  expect(bad, "/parameters/luck");
  std::ofstream(folder / "bad.json") << "{\"schema\": }";
  expect_refusal("predict " + quick + " --card bad.json", 3, "bad.json: line 1, column 12");
  expect_refusal("predict " + quick + " --card none.json", 3, "none.json");
  expect_refusal("compare " + quick + " --models gripper_delay --card sliding_pivot.json", 2,
                 "sliding_pivot");
}

TEST_F(Cli, FreeFlights) {
  const Answer answer = run("compare " + flights + " --json a.json --report r --threads 1");
  ASSERT_EQ(answer.code, 0) << answer.err;
  ASSERT_EQ(run("compare " + flights + " --models projectile --json b.json --threads 2").code, 0);
  json one = read_json(folder / "a.json");
  EXPECT_EQ(timeless(one), timeless(read_json(folder / "b.json")));
  json& model = one["models"]["projectile"];
  EXPECT_EQ(model["train"]["n"], 4);
  EXPECT_EQ(model["test"]["n"], 1);
  EXPECT_THAT(answer.out, HasSubstr("0.00 ± - ")) << "a single error has no spread";
  EXPECT_LT(model["test"]["trajectory_rms_m"], 1e-6);  // the motion is the model's, rounded
  EXPECT_GT(fs::file_size(folder / "r/residuals_projectile.png"), 0u);
}

// What was not tracked has no error, in the loop as in the comparison.
TEST_F(Cli, FlightsWithoutOrientationHaveNoErrorOfIt) {
  write_unoriented_flights("ff.h5");
  const Answer found = run("discover ff.h5 --json d.json --card c.json");
  ASSERT_EQ(found.code, 0) << found.err;
  const Answer compared = run("compare ff.h5 --card c.json --json x.json");
  ASSERT_EQ(compared.code, 0) << compared.err;
  json d = read_json(folder / "d.json")["error"], x = read_json(folder / "x.json");
  for (json* split : {&d["before"], &d["after"], &x["base"], &x["with_card"]})
    for (const char* half : {"train", "test"}) {
      json& errors = (*split)[half];
      EXPECT_TRUE(errors["end_orientation_mae_deg"].is_null()) << errors;
      EXPECT_TRUE(errors["end_orientation_median_deg"].is_null()) << errors;
      EXPECT_TRUE(errors["end_position_mae_m"].is_number()) << errors;
    }
  const double millimetres = 1e3 * x["base"]["test"]["end_position_median_m"].get<double>();
  EXPECT_THAT(compared.out, testing::ContainsRegex("end position median .mm. +[0-9.e-]+ +" +
                                                   fmt::format("{:.4g}", millimetres)));
  for (const Answer* one : {&found, &compared})
    for (const char* name : {"MAE", "median"})
      EXPECT_THAT(one->out,
                  testing::ContainsRegex(std::string("end orientation ") + name + " .deg. +- +- +- +-"));
}

TEST_F(Cli, ACardOfFlightsIsShownInAFigure) {
  std::ofstream(folder / "card.json")
      << R"({"schema": "model-card", "schema_version": 1, "model": "projectile",
    "log": {"file": "flights.h5", "title": "flights"},
    "parameters": {"sensor.length_scale.scale": {"value": 1.02, "sigma": 0.001, "unit": "-"}},
    "effects": ["sensor.length_scale"], "errors": {}, "split": "train", "library_version": "0"})";
  const Answer answer = run("compare " + flights + " --card card.json --json a.json --report r");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json errors = read_json(folder / "a.json");  // the motion has no such scale
  EXPECT_GT(errors["with_card"]["test"]["trajectory_rms_m"], errors["base"]["test"]["trajectory_rms_m"]);
  EXPECT_GT(fs::file_size(folder / "r/residual.png"), 0u);
  std::ifstream report(folder / "r/report.md");
  EXPECT_THAT(std::string(std::istreambuf_iterator<char>(report), {}), testing::HasSubstr("(residual.png)"));
}

// The statistics are those of the throws in the report's CSV; heading and bias table say the same.
TEST_F(Cli, CompareSumsUpItsThrows) {
  const Answer answer =
      run("compare " + quick + " --models sliding_pivot,limit_surface --json c.json --report r");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("12 throws (8 train, 4 test)"));
  EXPECT_THAT(run("inspect " + quick).out, HasSubstr("12 throws (8 train, 4 test)"));
  const json models = read_json(folder / "c.json")["models"];
  const auto csv = columns_of(content(folder / "r/throws.csv"));
  const std::string report = content(folder / "r/report.md");
  for (const auto& [model, told] : models.items())
    for (const char* split : {"train", "test"})
      for (const char* quantity :
           {"detach_vx_m_s", "detach_omega_deg_s", "landing_x_m", "landing_theta_deg"}) {
        double n = 0, sum = 0, absolute = 0, squares = 0;
        for (std::size_t k = 0; k < csv.at("model").size(); ++k) {
          if (csv.at("model")[k] != model || csv.at("split")[k] != split) continue;
          const double error = std::stod(csv.at(std::string("error_") + quantity)[k]);
          ++n, sum += error, absolute += std::abs(error), squares += error * error;
        }
        const json& one = told[split][quantity];
        const double mae = absolute / n;
        EXPECT_EQ(one["n"].get<double>(), n);
        EXPECT_NEAR(one["mae"].get<double>(), mae, 1e-9 * mae) << model << split << quantity;
        EXPECT_NEAR(one["bias"].get<double>(), sum / n, 1e-9 * mae);
        EXPECT_NEAR(one["std"].get<double>(), std::sqrt((squares - n * mae * mae) / (n - 1)), 1e-6 * mae);
        if (std::string(quantity) == "landing_x_m") {
          std::ostringstream bias;
          bias << std::showpos << std::fixed << std::setprecision(4) << sum / n;
          EXPECT_THAT(report.substr(report.find("## Bias")), HasSubstr(bias.str()));
        }
      }
}

// Some throws of each split never come down to a table as high as half of them fly.
TEST_F(Cli, CompareCountsWhatDoesNotLandBySplit) {
  auto log = datasets::read_throw_log(quick);
  for (auto& one : log.throws) one.landing.reset();
  const std::vector<double> peaks = peaks_of(log);
  for (auto& one : log.throws) one.split = datasets::Split::train;
  const auto sorted = [&] {
    auto out = peaks;
    std::sort(out.begin(), out.end());
    return out;
  }();
  log.landing_height = 0.5 * (sorted[3] + sorted[4]);  // four do not reach it: one of the test, three others
  int low = 0, high = 0;
  for (std::size_t k = 0; k < log.throws.size(); ++k) {
    int& of = peaks[k] < log.landing_height ? low : high;
    if (of++ < (peaks[k] < log.landing_height ? 1 : 2)) log.throws[k].split = datasets::Split::test;
  }
  datasets::write_throw_log(folder / "high.h5", log);
  const Answer answer = run("compare high.h5 --models limit_surface_disc --json c.json --report r");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json model = read_json(folder / "c.json")["models"]["limit_surface_disc"];
  std::map<std::string, int> failed;
  std::istringstream lines(content(folder / "r/throws.csv"));
  for (std::string line; std::getline(lines, line);)
    for (const std::string split : {"train", "test"})
      failed[split] += line.find("," + split + ",limit_surface_disc,never_reaches,") != std::string::npos;
  EXPECT_EQ(failed["train"], 3);
  EXPECT_EQ(failed["test"], 1);
  for (const char* split : {"train", "test"}) {
    EXPECT_EQ(model[split]["failed"], failed[split]) << split;
    EXPECT_THAT(answer.out, testing::ContainsRegex(fmt::format("limit_surface_disc +{} +{} +{} ", split,
                                                               model[split]["n"].get<int>(), failed[split])));
  }
  EXPECT_EQ(model["failed"], 4);
}

// Of throws of one condition the mean landing is not known otherwise: each takes one off the number of them.
TEST_F(Cli, TheScatterOfRepetitionsIsThatOfTheLogsLandings) {
  const auto log = datasets::read_throw_log(quick);
  std::map<std::string, std::vector<const datasets::Throw*>> conditions;
  for (const auto& one : log.throws) conditions[one.condition].push_back(&one);
  double squares[2]{}, freedom = 0;
  for (const auto& [name, throws] : conditions) {
    freedom += static_cast<double>(throws.size()) - 1;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      double mean = 0;
      for (const auto* one : throws) mean += one->landing->pose(0, axis) / static_cast<double>(throws.size());
      for (const auto* one : throws) squares[axis] += std::pow(one->landing->pose(0, axis) - mean, 2);
    }
  }
  const double x = std::sqrt(squares[0] / freedom),
               theta = std::sqrt(squares[1] / freedom) * 180 / std::numbers::pi;
  const Answer answer = run("compare " + quick + " --models sliding_pivot --json c.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json scatter = read_json(folder / "c.json")["repetition_scatter"];
  EXPECT_EQ(scatter["conditions"], conditions.size());
  EXPECT_NEAR(scatter["landing_x_m"].get<double>(), x, 1e-9);
  EXPECT_NEAR(scatter["landing_theta_deg"].get<double>(), theta, 1e-7);
  EXPECT_THAT(answer.out, HasSubstr(fmt::format("landing x {:.4f} m, landing theta {:.2f} deg", x, theta)));
}

}  // namespace
}  // namespace unhand::cli
