// The built command, as a user meets it: exit codes, messages, files.
#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "datasets/slip_log.hpp"
#include "datasets/throw_log.hpp"

namespace unhand {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
namespace fs = std::filesystem;

struct Answer {
  int code{};
  std::string out, err;
};

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

json read_json(const fs::path& file) { return json::parse(content(file)); }

/// Every test has a folder of its own; a tiny campaign is made once for all.
class Cli : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared = fs::temp_directory_path() / ("unhand_cli_" + std::to_string(getpid()));
    fs::create_directory(shared);
    ASSERT_EQ(run_in(shared, "generate quick12 --seed 3 --out quick.h5").code, 0);
    write_flights(shared / "flights.h5");
  }
  static void TearDownTestSuite() { fs::remove_all(shared); }

  void SetUp() override {
    folder = shared / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::create_directory(folder);
    quick = (shared / "quick.h5").string();
    flights = (shared / "flights.h5").string();
  }

  static Answer run_in(const fs::path& where, const std::string& arguments,
                       const std::string& environment = "") {
    const fs::path out = shared / "stdout.txt", err = shared / "stderr.txt";
    const std::string command = "cd '" + where.string() + "' && " + environment + " '" UNHAND_BINARY "' " +
                                arguments + " >'" + out.string() + "' 2>'" + err.string() + "' </dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content(out), content(err)};
  }
  Answer run(const std::string& arguments, const std::string& environment = "") const {
    return run_in(folder, arguments, environment);
  }

  std::set<std::string> files() const {
    std::set<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      names.insert(fs::relative(entry.path(), folder).string());
    return names;
  }

  /// One line on stderr, nothing on stdout, nothing written.
  void expect_refusal(const std::string& arguments, int code, const std::string& reason) {
    const auto before = files();
    const Answer answer = run(arguments);
    EXPECT_EQ(answer.code, code) << arguments << "\n" << answer.err;
    EXPECT_THAT(answer.err, HasSubstr(reason)) << arguments;
    EXPECT_THAT(answer.out, IsEmpty()) << arguments;
    EXPECT_EQ(files(), before) << arguments;
    if (code == 3) {
      EXPECT_EQ(std::count(answer.err.begin(), answer.err.end(), '\n'), 1) << answer.err;
    }
  }

  /// Cubes that fall without air, tracked without noise.
  static void write_flights(const fs::path& file) {
    datasets::ThrowLog log;
    log.dimension = 3;
    log.title = "falling cubes";
    log.source = "made by a test";
    log.objects["cube"].mass = 0.4;
    log.objects["cube"].inertia = std::vector<double>{1e-3, 1e-3, 1e-3};
    for (int n = 0; n < 5; ++n) {
      datasets::Throw one;
      one.id = "toss-" + std::to_string(n);
      one.object = "cube";
      one.condition = "toss";
      one.repetition = n;
      one.split = n == 4 ? datasets::Split::test : datasets::Split::train;
      datasets::MocapLog& mocap = one.mocap.emplace();
      mocap.time = {40, 1, {}, {}};
      mocap.pose = {40, 7, {}, {}};
      for (int i = 0; i < 40; ++i) {
        const double t = 0.01 * i, half = 0.5 * (1 + n) * t;
        mocap.time.data.push_back(t);
        for (const double value : {0.3 * n + 1.1 * t, 0.2 * t, 1 + 0.5 * t - 0.5 * 9.81 * t * t,
                                   std::cos(half), 0.0, 0.0, std::sin(half)})
          mocap.pose.data.push_back(value);
      }
      log.throws.push_back(std::move(one));
    }
    datasets::write_throw_log(file, log);
  }

  static inline fs::path shared;
  fs::path folder;
  std::string quick, flights;
};

TEST_F(Cli, HelpHasAnExampleEverywhere) {
  EXPECT_EQ(run("--help").code, 0);
  EXPECT_THAT(run("--version").out, HasSubstr("unhand "));
  for (const std::string command :
       {"generate", "import", "inspect", "compare", "fit", "predict", "validate-sku"}) {
    const Answer answer = run(command + " --help");
    EXPECT_EQ(answer.code, 0) << command;
    for (const char* word : {"Example", "--json", "--threads"})
      EXPECT_THAT(answer.out, HasSubstr(word)) << command;
  }
}

TEST_F(Cli, WrongUsage) {
  EXPECT_EQ(run("").code, 2);
  EXPECT_EQ(run("juggle").code, 2);
  EXPECT_EQ(run("compare").code, 2);
  EXPECT_EQ(run("inspect " + quick + " --threads -1").code, 2);
  expect_refusal("generate nonsense --out a.h5", 2, "batch180");
  expect_refusal("generate quick12 --out a.h5 --effect flight.winds=1", 2, "did you mean flight.wind?");
  expect_refusal("generate quick12 --out a.h5 --effect breeze=1", 2, "contact.stribeck");
  expect_refusal("generate quick12 --out a.h5 --effect flight.wind=31", 2,
                 "w_x = 31 is not in [-30, 30] m/s");
  expect_refusal("generate quick12 --out a.h5 --effect flight.wind.w_y=1", 2, "flight.wind has w_x, w_z");
  expect_refusal("generate quick12 --out a.h5 --effect flight.wind=strong", 2, "not a number");
  expect_refusal("generate quick12 --out a.h5 --effect flight.wind", 2, "ID=value");
  expect_refusal("generate quick12 --out a.h5 --effect flight.quadratic_drag[jar]=0.1", 2, "bar-com100");
  expect_refusal("generate quick12 --out a.h5 --effect sensor.mass[jar]=1.1", 2, "all objects share it");
  expect_refusal("import nonsense in.csv --out a.h5", 2, "cube-tosses");
  expect_refusal("compare " + quick + " --models sliding_pivot,wishful", 2, "wishful");
  expect_refusal("compare " + quick + " --models sliding_pivot,sliding_pivot", 2, "twice");
  expect_refusal("compare " + quick + " --rtol 7", 2, "rtol");
}

TEST_F(Cli, BadInput) {
  std::ofstream(folder / "text.h5") << "this is no HDF5";
  std::ofstream(folder / "empty.h5");
  const std::string whole = content(quick);
  std::ofstream(folder / "half.h5", std::ios::binary) << whole.substr(0, whole.size() / 2);
  datasets::SlipLog slips;
  slips.surfaces["felt"] = {1.0, 0.05, "felt", {}, {}};
  slips.surfaces["felt"].slips.push_back({"001",
                                          datasets::Split::train,
                                          {2, 1, {0, 0.1}, {}},
                                          {2, 3, {1, 0, 0, 1, 0, 0}, {}},
                                          {2, 3, {1, 0, 0, 1, 0, 0}, {}}});
  datasets::write_slip_log(folder / "slips.h5", slips);
  for (const std::string file : {"none.h5", "text.h5", "empty.h5", "half.h5"}) {
    expect_refusal("inspect " + file + " --json a.json", 3, file + ": ");
    expect_refusal("compare " + file + " --json a.json --report r", 3, file + ": ");
  }
  expect_refusal("compare slips.h5 --json a.json", 3, "slips.h5: /@schema: is a slip-log");
  expect_refusal("compare " + flights + " --models sliding_pivot", 3, "free flights");
  expect_refusal("compare " + quick + " --models projectile", 3, "projectile");
  expect_refusal("import cube-tosses none.csv --out a.h5", 3, "none.csv: ");
  const Answer slip = run("inspect slips.h5 --json slips.json");
  EXPECT_EQ(slip.code, 0) << slip.err;
  EXPECT_EQ(read_json(folder / "slips.json")["surfaces"]["felt"]["slips"], 1);
}

TEST_F(Cli, UnwritableOutputs) {
  std::ofstream(folder / "file") << "in the way";
  fs::create_directory(folder / "folder");
  const std::string models = " --models gripper_delay";
  expect_refusal("generate quick12 --out none/a.h5", 1, "none/a.h5: cannot be written");
  expect_refusal("generate quick12 --out folder", 1, "it is a directory");
  expect_refusal("inspect " + quick + " --json none/a.json", 1, "cannot be written");
  expect_refusal("compare " + quick + models + " --json none/a.json --report r", 1, "cannot be written");
  expect_refusal("compare " + quick + models + " --json a.json --report file/r", 1, "cannot be written");
  expect_refusal("compare " + quick + models + " --json a.json --write-cards file", 1, "cannot be written");
}

TEST_F(Cli, GenerateIsRepeatable) {
  ASSERT_EQ(run("generate quick12 --seed 3 --threads 1 --out a.h5 --json a.json").code, 0);
  EXPECT_EQ(content(folder / "a.h5"), content(quick));
  ASSERT_EQ(run("generate quick12 --seed 4 --out a.h5").code, 0);  // replaced
  EXPECT_NE(content(folder / "a.h5"), content(quick));
  EXPECT_EQ(read_json(folder / "a.json")["throws"], 12);
  EXPECT_THAT(files(), testing::ElementsAre("a.h5", "a.json"));
}

TEST_F(Cli, GenerateTellsTheTruthOnlyWhenAsked) {
  ASSERT_EQ(run("generate quick12 --seed 3 --out a.h5 --effect sensor.ft_bias.fz=0 --truth a.json").code, 0);
  EXPECT_EQ(content(folder / "a.h5"), content(quick)) << "a neutral effect is none";
  ASSERT_EQ(run("generate quick12 --seed 3 --out a.h5 --effect flight.quadratic_drag=0.1 --effect "
                "flight.quadratic_drag[bar-com160]=0.2 --without ft --without landing --truth a.json")
                .code,
            0);
  EXPECT_EQ(content(folder / "a.h5").find("quadratic_drag"), std::string::npos);
  const json truth = read_json(folder / "a.json");
  EXPECT_EQ(truth["schema"], "truth");
  EXPECT_EQ(truth["effects"]["flight.quadratic_drag.k"]["value"], 0.1);
  EXPECT_EQ(truth["effects"]["flight.quadratic_drag.k[bar-com160]"]["value"], 0.2);
  EXPECT_EQ(truth["effects"].size(), 2u);
  EXPECT_EQ(truth["throws"].size(), 12u);
  EXPECT_GT(truth["throws"]["001"]["landing"]["time"], truth["throws"]["001"]["detach"]["time"]);
  const Answer log = run("inspect a.h5");
  EXPECT_THAT(log.out, HasSubstr("mocap"));
  EXPECT_THAT(log.out, testing::Not(HasSubstr("ft/wrench")));
  EXPECT_THAT(log.out, HasSubstr("0 with a landing"));
  ASSERT_EQ(run("generate random --seed 2 --effect random --out a.h5 --truth a.json").code, 0);
  EXPECT_GE(read_json(folder / "a.json")["effects"].size(), 1u);
}

TEST_F(Cli, Inspect) {
  const Answer answer = run("inspect " + quick + " --json a.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("12 throws"));
  EXPECT_THAT(answer.out, HasSubstr("mocap"));
  EXPECT_THAT(answer.err, IsEmpty());  // no progress bar in a pipe
  const json seen = read_json(folder / "a.json");
  EXPECT_EQ(seen["schema"], "inspect");
  EXPECT_EQ(seen["throws"], 12);
  EXPECT_EQ(json::parse(run("inspect " + quick + " --json").out), seen);
}

/// Without what depends on the clock.
json timeless(json comparison) {
  for (auto& [name, model] : comparison["models"].items()) model.erase("microseconds_per_throw");
  return comparison;
}

TEST_F(Cli, CompareReleases) {
  const std::string models = "compare " + quick + " --models sliding_pivot,limit_surface,gripper_delay ";
  ASSERT_EQ(run(models + "--threads 1 --json one.json").code, 0);
  const Answer answer = run(models + "--threads 2 --json two.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("landing theta [deg]"));
  EXPECT_THAT(answer.err, IsEmpty());
  const json one = read_json(folder / "one.json");
  EXPECT_EQ(timeless(one), timeless(read_json(folder / "two.json")));
  EXPECT_EQ(one["schema"], "compare");
  EXPECT_EQ(one["schema_version"], 1);
  EXPECT_TRUE(one.contains("log"));
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

TEST_F(Cli, NoTestThrowsNoNumbers) {
  auto log = datasets::read_throw_log(quick);
  for (auto& one : log.throws) one.split = datasets::Split::train;
  datasets::write_throw_log(folder / "train.h5", log);
  const Answer answer = run("compare train.h5 --models gripper_delay --json a.json --report r");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json test = read_json(folder / "a.json")["models"]["gripper_delay"]["test"];
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
  fs::permissions(folder / "bin/gnuplot", fs::perms::owner_all);
  const Answer answer =
      run("compare " + quick + " --models gripper_delay --report r --json a.json --write-cards c",
          "PATH='" + (folder / "bin").string() + "':$PATH");
  EXPECT_EQ(answer.code, 1);
  EXPECT_THAT(answer.err, HasSubstr("no terminal for you"));
  EXPECT_THAT(files(), testing::ElementsAre("bin", "bin/gnuplot"));
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
    const json predicted = read_json(folder / "p.json");
    EXPECT_EQ(predicted["schema"], "predict");
    EXPECT_EQ(predicted["throws"].size(), 12u);
    EXPECT_TRUE(predicted["throws"][0]["landing"]["x_m"].is_number());
    ASSERT_EQ(
        run("compare " + quick + " --models " + model + " --card cards/" + model + ".json --json b.json")
            .code,
        0);
    const json again = timeless(read_json(folder / "b.json"))["models"][model];
    const json first = timeless(read_json(folder / "a.json"))["models"][model];
    EXPECT_EQ(again["test"], first["test"]);
    EXPECT_EQ(again["train"], first["train"]);
    EXPECT_TRUE(again["estimate"]["from_card"]);
  }
}

TEST_F(Cli, BadCards) {
  ASSERT_EQ(run("compare " + quick + " --models sliding_pivot --write-cards .").code, 0);
  const json good = read_json(folder / "sliding_pivot.json");
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

TEST_F(Cli, FitThenPredict) {
  const Answer answer =
      run("fit " + quick + " --model limit_surface_disc --card c.json --json f.json --report r");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err, IsEmpty());
  for (const char* words : {"95 % interval", "chi2/sample", "no outlier throws", "Jacobian"})
    EXPECT_THAT(answer.out, HasSubstr(words));
  EXPECT_THAT(files(),
              testing::IsSupersetOf({"c.json", "f.json", "r/fit.json", "r/report.md", "r/throws.csv"}));
  const json fitted = read_json(folder / "f.json"), card = read_json(folder / "c.json");
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
  EXPECT_THAT(content(folder / "p.csv"), HasSubstr("sigma_landing_x_m"));
  const json throws = read_json(folder / "p.json")["throws"];
  ASSERT_EQ(throws.size(), 12u);
  double mae = 0;
  int n = 0;
  for (const auto& one : throws) {
    EXPECT_GT(one["sigma"]["landing_x_m"].get<double>(), 0);
    const bool outside = !one["outside_valid_range"].empty();
    EXPECT_EQ(
        predicted.err.find("throw " + one["id"].get<std::string>() + " lies outside") != std::string::npos,
        outside);
    if (one["split"] == "train") {
      EXPECT_FALSE(outside);
    } else {
      mae += std::abs(one["error"]["landing_x_m"].get<double>());
      ++n;
    }
  }
  EXPECT_NEAR(mae / n, fitted["test"]["landing_x_m"]["mae"].get<double>(), 1e-12);  // summed in another order
  ASSERT_EQ(run("compare " + quick + " --models limit_surface_disc --card c.json --json k.json").code, 0);
  const json compared = read_json(folder / "k.json")["models"]["limit_surface_disc"];
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
  auto log = datasets::read_throw_log(quick);
  for (auto& one : log.throws) one.split = datasets::Split::test;
  datasets::write_throw_log(folder / "test.h5", log);
  expect_refusal("fit test.h5 --model gripper_delay" + card, 1, "no train throws");
  for (auto& one : log.throws) {
    one.split = datasets::Split::train;
    one.hand.reset();
    one.condition = "same";
  }
  datasets::write_throw_log(folder / "handless.h5", log);
  expect_refusal("fit handless.h5 --model gripper_delay" + card, 3, "/hand: missing");
  EXPECT_EQ(content(folder / "c.json"), "the old card");
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
  auto log = datasets::read_throw_log(quick);
  for (auto& one : log.throws) one.split = datasets::Split::train;
  datasets::write_throw_log(folder / "train.h5", log);
  const Answer answer = run("fit train.h5 --model gripper_delay --json f.json --card c.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("cross-validated"));
  const json fitted = read_json(folder / "f.json");
  EXPECT_EQ(fitted["cross_validation"]["folds"], 5);
  EXPECT_EQ(fitted["cross_validation"]["n"], 12);
  EXPECT_TRUE(read_json(folder / "c.json")["errors"].contains("cross_validation"));
}

TEST_F(Cli, CompareFitsTheModels) {
  const Answer answer =
      run("compare " + quick +
          " --models limit_surface,limit_surface_naive,gripper_delay --fit --json a.json --write-cards c");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json models = read_json(folder / "a.json")["models"];
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
  EXPECT_TRUE(read_json(folder / "c/limit_surface.json").contains("covariance"));
}

TEST_F(Cli, FreeFlights) {
  const Answer answer = run("compare " + flights + " --json a.json --report r --threads 1");
  ASSERT_EQ(answer.code, 0) << answer.err;
  ASSERT_EQ(run("compare " + flights + " --models projectile --json b.json --threads 2").code, 0);
  const json one = read_json(folder / "a.json");
  EXPECT_EQ(timeless(one), timeless(read_json(folder / "b.json")));
  const json& model = one["models"]["projectile"];
  EXPECT_EQ(model["train"]["n"], 4);
  EXPECT_EQ(model["test"]["n"], 1);
  EXPECT_LT(model["test"]["trajectory_rms_m"], 1e-6);  // the motion is the model's, rounded
  EXPECT_GT(fs::file_size(folder / "r/residuals_projectile.png"), 0u);
}

/// Files of a lab: a hand, a sensor and a tracker saw the same throw.
void write_lab_files(const fs::path& folder) {
  fs::create_directories(folder / "hand");
  fs::create_directories(folder / "ft");
  fs::create_directories(folder / "takes");
  std::ofstream(folder / "bar.toml")
      << "name = \"bar\"\nmass_kg = 0.25\ninertia_kg_m2 = 2.4e-3\nsurface = \"steel\"\n";
  for (const std::string name : {"slow_01", "slow_02"}) {
    std::ofstream hand(folder / "hand" / (name + ".csv")), ft(folder / "ft" / (name + ".csv"));
    std::ofstream take(folder / "takes" / (name + ".csv"));
    hand << "t,X,Z,pitch,VX,VZ,Q,AX,AZ,DQ\n";
    ft << "t (s),Fx (N),Fz (N),Ty (N mm),Fy (N)\n";
    take << "Format Version,1.23,Take Name," << name
         << ",Rotation Type,Quaternion,Length Units,Millimeters\n\n"
         << ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body\n"
         << ",Name,bar,bar,bar,bar,bar,bar,bar\n,,Rotation,Rotation,Rotation,Rotation,Position,Position,"
            "Position\n"
         << "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z\n";
    for (int k = 0; k < 251; ++k) {
      const double t = 1e-3 * k, force = 40 * std::max(0.0, 1 - std::max(0.0, t - 0.11) / 0.04);
      hand << k << ',' << 500 + 1.5 * k << ',' << 800 + 1.5 * k << ",15,1.5,1.5,0,0,0,0\n";
      ft << t << ",0,-1.2,0," << force << '\n';
    }
    for (int k = 0; k < 240; ++k) {
      const double t = k / 240.0, fall = std::max(0.0, t - 0.15), half = 0.13 + 2 * fall;
      take << k << ',' << t << ",0,0," << std::sin(half) << ',' << std::cos(half) << ',' << 500 + 1500 * t
           << ',' << 800 + 1500 * t - 500 * 9.81 * fall * fall << ",0\n";
    }
  }
}

TEST_F(Cli, ImportsTheFilesOfALab) {
  write_lab_files(folder);
  const std::string hand =
      "hand-csv hand/slow_01.csv hand/slow_02.csv --columns "
      "time=t,x=X,z=Z,theta=pitch,vx=VX,vz=VZ,omega=Q,ax=AX,az=AZ,alpha=DQ --units "
      "time=ms,x=mm,z=mm,theta=deg,vx=m/s,vz=m/s,omega=deg/s,ax=m/s^2,az=m/s^2,alpha=deg/s^2 ";
  const std::string ft =
      "ft-csv ft/slow_01.csv ft/slow_02.csv --columns time=t,fx=-Fx,fz=-Fz,tau=-Ty,normal=Fy ";
  const std::string motive =
      "motive-csv takes/slow_01.csv takes/slow_02.csv --sigma position=2e-4,angle=3e-3 ";
  for (const std::string& step :
       {hand + "--sku bar.toml --opening-time 0.1 --test-every 2 --out log.h5", ft + "--into log.h5",
        motive + "--landing --into log.h5 --out full.h5 --json full.json"}) {
    const Answer answer = run("import " + step);
    ASSERT_EQ(answer.code, 0) << answer.err;
    EXPECT_THAT(answer.out, HasSubstr("2 throws (1 train, 1 test)"));
  }
  EXPECT_EQ(read_json(folder / "full.json")["files"][1]["landing"], true);
  const auto log = datasets::read_throw_log(folder / "full.h5");
  ASSERT_EQ(log.throws.size(), 2u);
  const datasets::Throw& one = log.throws[1];
  EXPECT_EQ(one.condition, "slow");
  EXPECT_EQ(one.split, datasets::Split::test);
  EXPECT_NEAR(one.hand->pose(10, 2), std::acos(-1) / 12, 1e-12);
  EXPECT_EQ(one.ft->wrench(0, 1), 1.2);
  EXPECT_NEAR(one.mocap->pose(0, 2), 0.26, 1e-5);
  EXPECT_NEAR(one.landing->pose(0, 0), 0.5 + 1.5 * one.landing->time(0), 1e-5);
  EXPECT_FALSE(
      datasets::read_throw_log(folder / "log.h5").throws[0].mocap);  // --into alone is left as it was
  EXPECT_EQ(run("compare full.h5 --models gripper_delay").code, 0);

  expect_refusal("import " + ft + "--into full.h5", 3, "full.h5: /throws/slow_01/ft: is there already");
  EXPECT_EQ(run("import " + ft + "--into full.h5 --replace").code, 0);
  expect_refusal("import " + ft + "--into none.h5", 3, "none.h5");
  expect_refusal("import " + ft + "--into full.h5 --throw slow_01", 2, "--throw goes with one input");
  expect_refusal("import " + ft + "--into full.h5 --sku bar.toml", 2, "--sku is for a new log");
  expect_refusal("import " + ft + "--out a.h5", 2, "--sku FILE or --mass KG");
  expect_refusal("import " + ft + "--mass 0.25", 2, "--out is required");
  expect_refusal("import " + ft + "--mass 0.25 --out a.h5 --body bar", 2, "--body is not for ft-csv");
  expect_refusal("import cube-tosses t.csv --out a.h5 --mass 0.25", 2, "--mass is not for cube-tosses");
  expect_refusal("import ft-csv ft/slow_01.csv --mass 1 --out a.h5 --columns fx", 2,
                 "--columns: 'fx' is not NAME=VALUE");
  expect_refusal("import ft-csv ft/slow_01.csv --mass 1 --out a.h5 --columns nromal=Fx", 2,
                 "did you mean 'normal'?");
  expect_refusal("import " + motive + "--body bra --mass 1 --out a.h5", 3, "did you mean 'bar'?");
  expect_refusal("import " + motive + "--mass 1 --out a.h5 --test-conditions fast", 2,
                 "there is no condition 'fast'");
  std::string cut = content(folder / "takes/slow_02.csv");
  std::ofstream(folder / "takes/slow_02.csv") << cut.substr(0, cut.size() - 20);
  expect_refusal("import " + motive + "--mass 1 --out a.h5 --json a.json", 3, "takes/slow_02.csv: line 246");
}

TEST_F(Cli, ImportsPhonesAsFreeFlights) {
  std::ofstream phone(folder / "fall_1.csv");
  phone << "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)\n";
  for (int k = 0; k < 800; ++k) {
    const double t = 0.005 * k;
    phone << t << ",0.1,-0.1," << (t < 1 || t > 1.65 ? 9.8 : t > 1.6 ? 150 : 0.3 * (t - 1)) << '\n';
  }
  phone.close();
  const Answer answer = run("import phyphox fall_1.csv --mass 0.2 --out falls.h5");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("800 samples, 1 free fall"));
  const Answer seen = run("inspect falls.h5");
  EXPECT_EQ(seen.code, 0) << seen.err;
  EXPECT_THAT(seen.out, HasSubstr("imu/specific_force"));
  EXPECT_THAT(seen.out, HasSubstr("1 free flight"));
  expect_refusal("import phyphox fall_1.csv --out a.h5", 2, "--sku FILE or --mass KG");
  expect_refusal("import phyphox fall_1.csv --mass -1 --out a.h5", 2, "-1 is not a number > 0");
  std::ofstream(folder / "still.csv") << "0,0,0,9.8\n0.005,0,0,9.8\n";
  expect_refusal("import phyphox still.csv --mass 0.2 --out a.h5", 3,
                 "still.csv: line 1: holds no free fall");
  expect_refusal("import phyphox fall_1.csv --mass 0.2 --out a.h5 --min-fall 0.8", 3,
                 "lasts 0.600 s, less than 0.8 s");
}

TEST_F(Cli, PlansAThrowIntoABox) {
  const Answer answer =
      run("plan throw --target 1.3,0,-0.2 --samples 600 --draws 50 --json plan.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("no acceleration"));
  const auto plan = nlohmann::json::parse(content(folder / "plan.json"));
  EXPECT_EQ(plan["schema"], "plan-throw");
  EXPECT_EQ(plan["qdd_rad_s2"].size(), 7u);
  EXPECT_EQ(plan["predicted"]["planned"]["landed"], 50);
  for (const char* limit : {"position", "velocity", "acceleration", "jerk", "torque"})
    EXPECT_LE(plan["limits"][limit]["fraction"], 1 + 1e-9) << limit;
  EXPECT_THAT(content(folder / "out/trajectory.csv"), testing::StartsWith("time_s,q1_rad,"));
  for (const char* file : {"tube.png", "motion.pdf", "landings.png", "landings.csv"})
    EXPECT_TRUE(fs::exists(folder / "out" / file)) << file;

  expect_refusal("plan throw --target 1.3,0", 2, "--target: '1.3,0' is not 3 numbers with ',' between");
  expect_refusal("plan throw --target 1.3,0,0 --box 0x1", 2, "--box: '0x1' has no area");
  expect_refusal("plan throw --target 1.3,0,0 --arm kuka", 2,
                 "'kuka' is not panda, a .toml file or a .urdf file");
  expect_refusal("plan throw --target 9,0,0 --samples 200 --json a.json", 1,
                 "no_throw: no configuration reaches the box");
  expect_refusal("plan throw --target 1.3,0,0 --arm none.toml", 3, "none.toml: file: no such file");
  expect_refusal("plan throw --target 1.3,0,0 --card none.json", 3, "none.json");
}

TEST_F(Cli, PlansAThrowWithACard) {
  ASSERT_EQ(run("compare " + quick + " --models sliding_pivot --write-cards cards").code, 0);
  std::ofstream(folder / "bar.toml") << "name='bar'\nsurface='paper'\nmass_kg=0.246\ncom_offset_m=0.14\n"
                                        "inertia_kg_m2=0.0024\n";
  const Answer answer =
      run("plan throw --target 1.3,0,-0.2 --samples 600 --draws 40 --card cards/sliding_pivot.json --sku "
          "bar.toml --json plan.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("insensitive motion"));
  const auto plan = nlohmann::json::parse(content(folder / "plan.json"));
  EXPECT_LT(plan["predicted"]["insensitive motion"]["rms_m"],
            plan["predicted"]["tube acceleration"]["rms_m"]);
  EXPECT_TRUE(plan["release"]["contact_model"]["miss_m"].is_number());
}

TEST_F(Cli, LearnsToThrowFlipAndGoesOnAfterAKill) {
  const std::string what = "plan flip --target 1.2,180 --seed 3 --iterations 2 --repeats 1 --report out ";
  const Answer answer = run(what + "--learner m2 --json flip.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("m2: target 1.20 m, 180 degrees"));
  const auto flip = nlohmann::json::parse(content(folder / "flip.json"));
  EXPECT_EQ(flip["schema"], "plan-flip");
  EXPECT_EQ(flip["iterations"].size(), 2u);
  EXPECT_EQ(flip["iterations"][0]["trials"].size(), 3u);
  EXPECT_EQ(flip["population"].size(), 27u);
  for (const char* file : {"path.png", "progress.png", "population.pdf", "path.md", "session.json"})
    EXPECT_TRUE(fs::exists(folder / "out" / file)) << file;

  // As a kill leaves it: some throws are there, the report is not. The rest comes out as before.
  const auto trials = folder / "out/trials";
  const auto count = [&] { return std::distance(fs::directory_iterator(trials), fs::directory_iterator()); };
  EXPECT_EQ(count(), 27 + 12 + 6);
  fs::remove(folder / "flip.json");
  for (const char* gone : {"path-0001.json", "path-0005.json", "support-0011.json", "population-0020.json"})
    ASSERT_TRUE(fs::remove(trials / gone)) << gone;
  const Answer again = run(what + "--learner m2 --json flip.json");
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("41 throws recalled, 4 thrown now"));
  EXPECT_EQ(nlohmann::json::parse(content(folder / "flip.json")), flip);

  expect_refusal(what + "--learner m1", 3, "session.json: /settings/learner: another session lies there");
  // A throw of another robot, under a name that this run asks for.
  const std::string kept = content(trials / "population-0002.json");
  auto foreign = nlohmann::json::parse(kept);
  foreign["seed"] = 4;
  std::ofstream(trials / "population-0002.json") << foreign;
  expect_refusal(what + "--learner m2", 3, "population-0002.json: /seed: not the throw");
  std::ofstream(trials / "population-0002.json") << content(trials / "population-0001.json");
  expect_refusal(what + "--learner m2", 3, "population-0002.json: /index: not the throw");
  std::ofstream(trials / "population-0002.json") << kept;
  std::ofstream(trials / "path-0002.json") << "{\"command\": {";
  expect_refusal(what + "--learner m2", 3, "path-0002.json");
  // What a kill in the middle of writing leaves is gone after the next run; the parts of live processes stay.
  fs::remove(trials / "path-0002.json");
  const fs::path dead = trials / ".path-0002.json.part-999999999-0", live = folder / ".out.part-1-0";
  std::ofstream(dead) << "{";
  fs::create_directory(folder / ".out.part-999999999-0");
  fs::create_directory(live);
  EXPECT_EQ(run(what + "--learner m2").code, 0);
  EXPECT_FALSE(fs::exists(dead));
  EXPECT_FALSE(fs::exists(folder / ".out.part-999999999-0"));
  EXPECT_TRUE(fs::exists(live));
}

TEST_F(Cli, ThrowFlipTransfersToAnotherBar) {
  const std::string what = "plan flip --target 1.3,180 --seed 3 --iterations 2 --repeats 1 --json flip.json ";
  const Answer shifted = run(what + "--learner m3");
  ASSERT_EQ(shifted.code, 0) << shifted.err;
  EXPECT_THAT(shifted.out,
              HasSubstr("18.0 cm from the pads, known from 27 throws of another one (12.0 cm; the "
                        "paper's shift, as no --com-offset was given)"));
  EXPECT_THAT(shifted.out, HasSubstr("(expected, not seen)"));
  const auto flip = nlohmann::json::parse(content(folder / "flip.json"));
  EXPECT_EQ(flip["bar"]["com_offset_m"], 0.18);
  EXPECT_EQ(flip["known_bar"]["com_offset_m"], 0.12);
  EXPECT_EQ(flip["initial_error_is_seen"], false);

  std::ofstream(folder / "sku.toml") << "name = 'b'\nmass_kg = 0.3\ninertia_kg_m2 = 2e-3\n"
                                        "com_offset_m = 0.15\nsurface = 'printed'\n";
  const Answer sku = run(what + "--learner m4 --sku sku.toml");
  ASSERT_EQ(sku.code, 0) << sku.err;
  EXPECT_THAT(sku.out, HasSubstr("15.0 cm from the pads, known from 12 throws of another one (12.0 cm)"));
  EXPECT_EQ(nlohmann::json::parse(content(folder / "flip.json"))["bar"]["mass_kg"], 0.3);
}

TEST_F(Cli, ThrowFlipRefusesWhatItCannotDo) {
  const std::string other = "plan flip --learner ", aim = other + "m2 --target 1.2,180 ";
  expect_refusal(other + "m2 --target 1.2", 2, "--target: '1.2' is not 2 numbers");
  expect_refusal(other + "m2 --target 5,180", 2, "--target: 5 m, 180 degrees; accepted: ");
  expect_refusal(other + "m2 --target -1,180", 2, "--target: -1 m, 180 degrees; accepted: ");
  expect_refusal(other + "m2 --target 1.2,900", 2, "--target: 1.2 m, 900 degrees; accepted: ");
  expect_refusal(other + "m5 --target 1.2,180", 2, "m5 not in {m1,m2,m3,m4}");
  expect_refusal(aim + "--seed abc", 2, "abc is not a whole number from 0 to");
  expect_refusal(aim + "--seed -1", 2, "-1 is not a whole number from 0 to");
  expect_refusal(aim + "--card card.json", 2, "--card: only --learner m4");
  expect_refusal(aim + "--com-offset 0.9", 1, "lands this bar with none of its commands");
  expect_refusal(aim + "--robot none.toml", 3, "none.toml");
  std::ofstream(folder / "sku.toml") << "name = 'b'\nmass_kg = 0.3\ninertia_kg_m2 = 1e-9\n"
                                        "com_offset_m = 0.15\nsurface = 'printed'\n";
  expect_refusal(aim + "--sku sku.toml", 3,
                 "sku.toml: object: inertia_kg_m2: 1e-09 is outside [1e-06, 1] kg m^2");
  const Answer far = run(other + "m2 --target 1.8,360 --iterations 1");
  EXPECT_EQ(far.code, 0);
  EXPECT_THAT(far.err, HasSubstr("note: out of reach of the robot as declared"));
}

TEST_F(Cli, ValidateSkuAnswersWithABudget) {
  std::ofstream(folder / "bar.toml") << "name = 'bar-com100'\nmass_kg = 0.246\ncom_offset_m = 0.10\n"
                                        "inertia_kg_m2 = 3.3e-3\nsurface = 'printed'\n";
  std::ofstream(folder / "card.json")
      << R"({"schema": "model-card", "schema_version": 1, "model": "sliding_pivot", "library_version": "0",
             "parameters": {"mu": {"value": 0.5, "sigma": 0.005, "unit": "-"},
                            "length": {"value": 0.007, "sigma": 1e-4, "unit": "m"}},
             "covariance": {"names": ["mu", "length"], "matrix": [[2.5e-5, 0], [0, 1e-8]]},
             "log": {"file": "a.h5"}})";
  const Answer answer = run(
      "validate-sku bar.toml --card card.json --samples 200 --json a.json --report out --tolerance 0.1,60");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json out = read_json(folder / "a.json");
  EXPECT_EQ(out["schema"], "validate-sku");
  EXPECT_NEAR(out["tolerance"]["landing_theta_deg"].get<double>(), 60, 1e-12);
  double share = 0;
  for (const auto& line : out["budget"]) share += line["share"].get<double>();
  EXPECT_NEAR(share, 1, 1e-9);
  EXPECT_THAT(answer.out, HasSubstr(out["measurements"][0]["measurement"].get<std::string>()));
  EXPECT_TRUE(out["measured"].is_null());
  for (const char* file : {"report.md", "validate-sku.json", "landings.png", "landings.pdf", "landings.dat",
                           "landings.gp", "budget.png", "budget.pdf"})
    EXPECT_TRUE(fs::exists(folder / "out" / file)) << file;

  const Answer with_log =
      run("validate-sku bar.toml --card card.json --samples 200 --log " + quick + " --json b.json");
  ASSERT_EQ(with_log.code, 0) << with_log.err;
  const json judged = read_json(folder / "b.json");
  EXPECT_EQ(judged["candidates"].size(), 6u);  // the campaign's conditions, three for each of two objects
  EXPECT_EQ(judged["measured"]["n"], 6);

  const std::string asked = "validate-sku bar.toml --card card.json ";
  expect_refusal(asked + "--tolerance 0.05", 2, "METRES,DEGREES");
  expect_refusal(asked + "--tolerance 0.05,-1", 2, "METRES,DEGREES");
  expect_refusal(asked + "--condition fast", 2, "--log");
  expect_refusal(asked + "--condition fast --log " + quick, 2, "there are");
  expect_refusal("validate-sku none.toml --card card.json", 3, "none.toml");
  expect_refusal("validate-sku bar.toml --card none.json", 3, "none.json");
  std::ofstream(folder / "bare.toml") << "name = 'x'\nmass_kg = 1\nsurface = 'steel'\n";
  expect_refusal("validate-sku bare.toml --card card.json --json c.json", 3, "inertia_kg_m2");
}

TEST_F(Cli, FigureDrawsWhatIsAskedFor) {
  const Answer answer = run("figure all --log " + quick + " --models sliding_pivot,limit_surface --out f");
  ASSERT_EQ(answer.code, 0) << answer.err;
  for (const char* name :
       {"landing_errors", "conditions", "mae", "modes", "wrench", "pivot", "phase", "flight"})
    for (const char* ending : {".png", ".pdf", ".dat", ".gp"})
      EXPECT_TRUE(fs::exists(folder / "f" / (std::string(name) + ending))) << name << ending;
  expect_refusal("figure portrait --log " + quick + " --out g", 2, "landing-errors");
  expect_refusal("figure modes --throw 999 --log " + quick + " --out g", 2, "no throw '999'");
  expect_refusal("figure modes --models wishful --log " + quick + " --out g", 2, "wishful");
  expect_refusal("figure modes --log none.h5 --out g", 3, "none.h5");
}

}  // namespace
}  // namespace unhand
