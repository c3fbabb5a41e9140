// Help, refusals and the commands that make and show logs.
#include <signal.h>
#include <sys/inotify.h>
#include <sys/stat.h>

#include <regex>

#include "apps/progress.hpp"
#include "tests/apps/cli.hpp"

namespace unhand::cli {
namespace {

/// The commands that a help lists, each behind `before`.
std::vector<std::string> commands_in(const std::string& help, const std::string& before) {
  std::vector<std::string> out;
  std::istringstream lines(help);
  bool listed = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty()) listed = false;
    if (listed && line.starts_with("  ") && line[2] != ' ')
      out.push_back(before + line.substr(2, line.find(' ', 2) - 2));
    if (line == "Subcommands:") listed = true;
  }
  return out;
}

TEST(Progress, IsNotShownInAPipe) {  // as stderr is under a test
  testing::internal::CaptureStderr();
  {
    apps::Progress known("fit", 4);
    const apps::Progress unknown("discover", 0);
    for (int i = 0; i < 4; ++i) known.step();
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // a second is when time is told
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST_F(Cli, HelpHasAnExampleEverywhere) {
  EXPECT_THAT(run("--version").out, HasSubstr("unhand "));
  const Answer all = run("--help");
  EXPECT_EQ(all.code, 0);
  std::vector<std::string> commands = commands_in(all.out, "");
  EXPECT_GE(commands.size(), 11u);
  for (const char* known : {"generate", "import", "inspect", "compare", "fit", "predict", "discover", "plan",
                            "validate-sku", "figure", "crosscheck"})
    EXPECT_THAT(commands, testing::Contains(known));
  for (std::size_t i = 0; i < commands.size(); ++i) {
    const std::string command = commands[i];
    const Answer answer = run(command + " --help");
    EXPECT_EQ(answer.code, 0) << command;
    const auto inner = commands_in(answer.out, command + " ");
    commands.insert(commands.end(), inner.begin(), inner.end());
    EXPECT_THAT(answer.out, HasSubstr("Example")) << command;
    if (!inner.empty()) continue;
    EXPECT_THAT(answer.out, HasSubstr("--json")) << command;
    EXPECT_THAT(answer.out, HasSubstr("--threads")) << command;
  }
  EXPECT_GE(commands.size(), 16u) << "with the planners";
}

TEST_F(Cli, WrongUsage) {
  expect_refusal("", 2, "unhand: A subcommand is required\n");
  expect_refusal("juggle", 2, "there is no command 'juggle'");
  expect_refusal("discovr log.h5", 2, "there is no command 'discovr'; did you mean 'discover'?");
  expect_refusal("plan dance", 2, "there is no command 'dance'");
  expect_refusal("compare a.h5 --modles projectile", 2, "no option '--modles'; did you mean '--models'?");
  expect_refusal("plan throw --target=1,0,0 --smaples=3", 2, "did you mean '--samples'?");
  expect_refusal("fit a.h5 --model limit_surfce", 2, "did you mean 'limit_surface'?");
  expect_refusal("fit a.h5 --model convex_quatric", 2, "did you mean 'convex_quartic'?");
  expect_refusal("fit a.h5 --model projectile", 2, "'projectile' cannot be fitted (there are: ");
  expect_refusal("discover a.h5 --model projectle", 2,
                 "--model: there is no 'projectle'; did you mean 'projectile'?");
  expect_refusal("crosscheck a.h5 --engine bulet", 2, "did you mean 'bullet'?");
  expect_refusal("compare", 2, "unhand: LOG is required\n");
  expect_refusal("inspect " + quick + " -z", 2, "unhand: The following argument was not expected: -z\n");
  expect_refusal("inspect " + quick + " --threads -1", 2,
                 "unhand: --threads: -1 is not a number from 0 to 1024");
  expect_refusal("inspect " + quick + " --threads 1e3", 2, "unhand: --threads: 1e3 is not a whole number\n");
  expect_refusal("generate nonsense --out a.h5", 2, "batch180");
  expect_refusal("generate quick12 --out a.h5 --effect flight.winds=1", 2, "did you mean 'flight.wind'?");
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
  expect_refusal("generate quick12 --out a.h5 --effect flight.wind=1 --effect flight.wind=2", 2,
                 "given twice");
  expect_refusal("generate quick12 --out ''", 2, "--out: '' names no file");
  expect_refusal("figure mae --out ''", 2, "--out: '' names no file");
  expect_refusal("figure mae --log '' --out out", 2, "--log: '' names no file");
  expect_refusal("compare " + quick + " --models limit_surface --json ''", 2, "--json: '' names no file");
  expect_refusal("compare " + quick + " --models limit_surface --report ''", 2, "--report: '' names no file");
  expect_refusal("fit " + quick + " --model limit_surface --card ''", 2, "--card: '' names no file");
  expect_refusal("import phyphox a --mass 0.2 --out a.h5 --into ''", 2, "--into: '' names no file");
  expect_refusal("compare " + quick + " --rtol nan", 2, "finite");
  expect_refusal("compare " + quick + " --naive-step 1e-3", 2,
                 "--naive-step: of limit_surface_naive, which --models does not name");
  expect_refusal("compare " + flights + " --rtol 1e-6", 2, "--rtol: only throws from a hand");
  expect_refusal("crosscheck " + quick + " --pads point --rings 2", 2, "--rings: of --pads pins");
  expect_refusal("plan elastic --nodes 5", 2, "--nodes: of a table of throws to a target");
  expect_refusal("plan elastic --target 2.2 --elevation 30", 2, "--elevation: of the fastest throw");
}

TEST_F(Cli, SeveralEffectsAndSensorsMayBeSaidAtOnce) {
  const std::string one = "contact.viscous=1", two = "flight.wind=0.5";
  ASSERT_EQ(run("generate quick12 --effect " + one + " --effect " + two +
                " --without mocap --without landing --out a.h5")
                .code,
            0);
  ASSERT_EQ(run("generate --effect " + one + " " + two + " quick12 --without mocap,landing --out b.h5").code,
            0);
  ASSERT_EQ(run("generate quick12 --effect " + one + "," + two + " --without mocap,landing --out c.h5").code,
            0);
  EXPECT_EQ(content(folder / "a.h5"), content(folder / "b.h5"));
  EXPECT_EQ(content(folder / "a.h5"), content(folder / "c.h5"));
}

TEST_F(Cli, TheFigureOfMeanErrorsHasWhatCompareSays) {
  ASSERT_EQ(run("figure mae --log " + quick + " --models sliding_pivot --out f").code, 0);
  ASSERT_EQ(run("compare " + quick + " --models sliding_pivot --json c.json").code, 0);
  json of = read_json(folder / "c.json")["models"]["sliding_pivot"]["test"];
  std::istringstream data(content(folder / "f/mae.dat"));
  std::vector<std::vector<double>> rows;  // line, MAE, quartiles, STD, n; one of each quantity
  for (std::string line; std::getline(data, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream numbers(line);
    rows.emplace_back();
    for (double x = 0; numbers >> x;) rows.back().push_back(x);
  }
  ASSERT_EQ(rows.size(), 4u);
  const std::vector<std::pair<const char*, double>> quantities{
      {"detach_vx_m_s", 100}, {"detach_omega_deg_s", 1}, {"landing_x_m", 100}, {"landing_theta_deg", 1}};
  for (std::size_t q = 0; q < 4; ++q) {
    const auto& [key, scale] = quantities[q];  // the figure has cm
    ASSERT_EQ(rows[q].size(), 6u) << key;      // 1e-4: the two have tolerances of their own
    EXPECT_NEAR(rows[q][1], scale * of[key]["mae"].get<double>(), 1e-4 * rows[q][1]) << key;
    EXPECT_NEAR(rows[q][4], scale * of[key]["std"].get<double>(), 1e-4 * rows[q][4]) << key;
    EXPECT_EQ(rows[q][5], of[key]["n"].get<double>()) << key;
    EXPECT_LE(rows[q][2], rows[q][3]) << key;
  }
  EXPECT_THAT(content(folder / "f/mae.gp"), HasSubstr(" ± "));
}

// A block without rows keeps its place: gnuplot's index would draw the next one in it.
TEST_F(Cli, AFigureWithoutLandingsDrawsTheOthersWhereTheyBelong) {
  ASSERT_EQ(run("generate quick12 --seed 3 --without landing --out blind.h5").code, 0);
  ASSERT_EQ(run("figure mae --log blind.h5 --models sliding_pivot --out f").code, 0);
  std::istringstream data(content(folder / "f/mae.dat"));
  int blocks = 1, blank = 0;
  bool rows = false;
  for (std::string line; std::getline(data, line);) {
    if (line.empty()) {
      if (++blank == 2) {
        EXPECT_TRUE(rows) << "block " << blocks;
        ++blocks, rows = false;
      }
      continue;
    }
    blank = 0;
    rows = rows || line.front() != '#';
  }
  EXPECT_GT(blocks, 1);
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
  expect_refusal("compare slips.h5 --json a.json", 2, "slips.h5 is a slip-log, whose surfaces are compared");
  expect_refusal("figure all --log slips.h5 --out f", 3, "`unhand compare LOG --fit --report DIR` draws");
  expect_refusal(
      "figure all --log " + flights + " --out f", 3,
      "free flights, and these figures are of releases from a hand in the plane: `unhand discover");
  expect_refusal("compare " + flights + " --models sliding_pivot", 3, "free flights");
  expect_refusal("compare " + quick + " --models projectile", 3, "projectile");
  expect_refusal("import cube-tosses none.csv --out a.h5", 3, "none.csv: ");
  EXPECT_EQ(run("inspect none.h5").err, "unhand: none.h5: no such file\n");
  EXPECT_EQ(run("import cube-tosses none.csv --out a.h5").err, "unhand: none.csv: no such file\n");
  EXPECT_EQ(run("plan throw --target 1.3,0,0 --arm none.urdf").err, "unhand: none.urdf: no such file\n");
  const Answer slip = run("inspect slips.h5 --json slips.json");
  EXPECT_EQ(slip.code, 0) << slip.err;
  EXPECT_EQ(read_json(folder / "slips.json")["surfaces"]["felt"]["slips"], 1);
}

TEST_F(Cli, AFileOfAnotherKindIsToldFromADamagedOne) {
  std::ofstream(folder / "card.json")
      << R"({"schema": "model-card", "schema_version": 1, "model": "limit_surface"})";
  std::ofstream(folder / "fit.json") << R"({"schema": "fit"})";
  for (const char* command : {"inspect card.json", "compare card.json", "predict card.json --card card.json",
                              "validate-sku card.json --card card.json --log card.json"})
    EXPECT_THAT(run(command).err, testing::ContainsRegex("card.json: .*")) << command;
  expect_refusal("inspect card.json", 3, "card.json: is not an HDF5 file; it is a model card (JSON)");
  expect_refusal("compare fit.json", 3, "fit.json: is not an HDF5 file; it is JSON of schema 'fit'");
  for (const std::string& command :
       {"predict " + quick + " --card " + quick, "plan throw --target 1.3,0,-0.2 --card " + quick})
    expect_refusal(command, 3, "quick.h5: is not a model card (JSON); it is an HDF5 file");
  std::ofstream(folder / "bar.toml") << "name = 'bar'\n";
  expect_refusal("predict " + quick + " --card bar.toml", 3, "bar.toml: is not a model card (JSON)");
  expect_refusal("validate-sku card.json --card card.json", 3,
                 "card.json: is not a TOML file; it is a model card (JSON)");
  expect_refusal("validate-sku " + quick + " --card card.json", 3, "is not a TOML file; it is an HDF5 file");
  expect_refusal("import cube-tosses " + quick + " --out o.h5", 3,
                 "line 1: is not UTF-8 text; it is an HDF5 file");
  expect_refusal("import planar-pushes " + quick + " --out o.h5", 3,
                 "line 1: is not UTF-8 text; it is an HDF5 file");
}

TEST_F(Cli, AnOptionGivenTwiceIsSaidToBe) {
  expect_refusal("compare " + quick + " --json a.json --json b.json", 2,
                 "--json: given 2 times, and one is taken");
}

TEST_F(Cli, UnknownNamesBringTheNearest) {
  expect_refusal("generate quick --out a.h5", 2, "no campaign is called 'quick'; did you mean 'quick12'?");
  expect_refusal("generate quick12 --out a.h5 --effect wnid=1", 2, "did you mean 'flight.wind'?");
  expect_refusal("generate quick12 --out a.h5 --effect stribeck.v_s=1", 2,
                 "did you mean 'contact.stribeck.v_s'?");
  expect_refusal("fit " + quick + " --model limit_surface --effects quadratic_drag", 2,
                 "did you mean 'flight.quadratic_drag'?");
  expect_refusal("figure landing_errors --log " + quick, 2,
                 "no figure is called 'landing_errors'; did you mean 'landing-errors'?");
  expect_refusal("figure alll --log " + quick, 2, "did you mean 'all'?");
  expect_refusal("figure modes --throw 1 --log " + quick, 2, "no throw '1'; did you mean '001'?");
  expect_refusal("import cube-toses a.csv --out a.h5", 2, "did you mean 'cube-tosses'?");
}

TEST_F(Cli, TheFirstParameterOfAnEffectIsNamedInTheHelp) {
  EXPECT_THAT(std::regex_replace(run("generate --help").out, std::regex("\\s+"), " "),
              HasSubstr("ID=value (sets the effect's first parameter)"));
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

/// Starts the command in a folder, ends it with a signal once `due`, and says how it ended: waitpid's status.
template <class Due>
int interrupted(const fs::path& where, const std::string& arguments, int number, Due&& due) {
  const pid_t child = fork();
  if (child == 0) {
    setpgid(0, 0);
    signal(number, SIG_DFL);  // a shell ignores it in what runs in the background
    const std::string command = "cd '" + where.string() + "' && exec '" UNHAND_BINARY "' " + arguments +
                                " >/dev/null 2>&1 </dev/null";
    execl("/bin/sh", "sh", "-c", command.c_str(), static_cast<char*>(nullptr));
    _exit(127);
  }
  int status = -1;
  while (!due())
    if (waitpid(child, &status, WNOHANG) == child) return status;  // too late
  kill(child, number);
  waitpid(child, &status, 0);
  return status;
}

TEST_F(Cli, AnInterruptionLeavesNothingUnfinished) {
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    std::set<std::string> seen;
    const int status = interrupted(folder, "figure all --log '" + quick + "' --out f", number, [&] {
      std::error_code gone;  // files come and go
      for (fs::recursive_directory_iterator at(folder, gone), end; !gone && at != end; at.increment(gone))
        seen.insert(at->path().extension().string());
      return seen.contains(".gp");
    });
    EXPECT_TRUE(WIFSIGNALED(status)) << status;
    EXPECT_EQ(WTERMSIG(status), number);
    EXPECT_THAT(files(), IsEmpty()) << number;
  }
}

TEST_F(Cli, ALogIsMadeBesideItsPlaceUnderOneName) {
  const int watch = inotify_init1(IN_NONBLOCK);
  ASSERT_GE(inotify_add_watch(watch, folder.c_str(), IN_CREATE), 0);
  ASSERT_EQ(run("generate quick12 --out a.h5").code, 0);
  alignas(inotify_event) char events[4096];
  const ssize_t n = read(watch, events, sizeof events);
  close(watch);
  std::vector<std::string> created;
  for (ssize_t at = 0; at < n;) {
    const auto* event = reinterpret_cast<const inotify_event*>(events + at);
    created.emplace_back(event->name);
    at += static_cast<ssize_t>(sizeof(inotify_event) + event->len);
  }
  EXPECT_THAT(created, testing::ElementsAre(testing::MatchesRegex("\\.a\\.h5\\.part-[0-9]+-[0-9]+")));
}

// A limit on the size of files stands for a full disk.
TEST_F(Cli, AFullDiskIsAnErrorLikeAnyOther) {
  const auto expect = [&](const std::string& arguments, const std::string& file) {
    const Answer answer = run(arguments, "ulimit -f 40;");
    EXPECT_EQ(answer.code, 1) << arguments;
    EXPECT_EQ(answer.err, "unhand: " + file + ": cannot be written: File too large\n");
    EXPECT_THAT(answer.out, IsEmpty()) << arguments;
    EXPECT_THAT(files(), IsEmpty()) << arguments;
  };
  expect("generate batch180 --out a.h5", "a.h5");
  expect("figure mae --log '" + quick + "' --models sliding_pivot --out f", "f/mae.png");
}

TEST_F(Cli, ADashIsNoFile) {
  expect_refusal("compare " + quick + " --models gripper_delay --json -", 2, "'-' names no file");
  expect_refusal("generate quick12 --out -", 2, "'-' names no file");
  const Answer answer = run("inspect " + quick + " --json -");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_EQ(json::parse(answer.out)["throws"], 12);
  EXPECT_THAT(files(), IsEmpty());
}

TEST_F(Cli, AnEffectWithoutConsequenceIsSaid) {
  const Answer idle = run("generate quick12 --seed 3 --effect flight.wind=3 --out a.h5");
  ASSERT_EQ(idle.code, 0) << idle.err;
  EXPECT_THAT(
      idle.err,
      HasSubstr("flight.wind changes nothing in this campaign: it acts through flight.quadratic_drag"));
  const Answer blown =
      run("generate quick12 --seed 3 --effect flight.wind=3 --effect flight.quadratic_drag=0.1 --out a.h5");
  EXPECT_THAT(blown.err, IsEmpty());
}

TEST_F(Cli, NoOutputTakesThePlaceOfSomethingElse) {
  ASSERT_EQ(run("generate quick12 --seed 3 --out log.h5").code, 0);
  ASSERT_EQ(run("compare log.h5 --models gripper_delay --write-cards cards").code, 0);
  std::ofstream(folder / "in.csv") << "a log of a robot";
  fs::create_directories(folder / "taken/report.md");
  fs::create_symlink("nowhere/at-all", folder / "astray");
  fs::create_symlink("log.h5", folder / "same.h5");
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  const std::string log = content(folder / "log.h5"), card = content(folder / "cards/gripper_delay.json");
  const std::string compare = "compare log.h5 --models gripper_delay ";
  for (const char* file : {"log.h5", "./log.h5", "same.h5", "cards/../log.h5"})
    expect_refusal(std::string("inspect log.h5 --json ") + file, 2, "is read");
  expect_refusal("fit log.h5 --model gripper_delay --card log.h5", 2, "is read");
  // Told before anything is read, let alone worked out: what is no log at all would end in 3.
  std::ofstream(folder / "notes.txt") << "no log\n";
  for (const char* what :
       {"fit notes.txt --model gripper_delay --card notes.txt",
        "fit notes.txt --model gripper_delay --json notes.txt", "discover notes.txt --card notes.txt",
        "compare notes.txt --json notes.txt", "predict log.h5 --card notes.txt --json notes.txt",
        "crosscheck notes.txt --engine cvode --json notes.txt",
        "plan throw --target 1.3,0,-0.2 --card notes.txt --json notes.txt"})
    expect_refusal(what, 2, "is read");
  expect_refusal("predict log.h5 --card cards/gripper_delay.json --csv cards/gripper_delay.json", 2,
                 "is read");
  expect_refusal("inspect log.h5 --json pipe", 1, "no regular file");
  expect_refusal("inspect log.h5 --json astray", 1, "leads nowhere");
  expect_refusal(compare + "--json r --report r/sub", 2, "one output is to be a file");
  expect_refusal(compare + "--json r.json --report taken", 1, "it is a directory");
  EXPECT_EQ(content(folder / "log.h5"), log);
  EXPECT_EQ(content(folder / "cards/gripper_delay.json"), card);
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));

  // A link to a file stays one: what it leads to is replaced.
  std::ofstream(folder / "old.json") << "old";
  fs::create_symlink("old.json", folder / "link.json");
  ASSERT_EQ(run("inspect log.h5 --json link.json").code, 0);
  EXPECT_TRUE(fs::is_symlink(folder / "link.json"));
  EXPECT_EQ(read_json(folder / "old.json")["schema"], "inspect");
}

// What a directory will hold is known at the end only: nothing is in place by then.
TEST_F(Cli, AReportReplacesNeitherItsCardNorALog) {
  const std::string compare = "compare '" + quick + "' --models gripper_delay ";
  ASSERT_EQ(run(compare + "--write-cards cards").code, 0);
  fs::create_directory(folder / "out");
  fs::copy_file(folder / "cards/gripper_delay.json", folder / "out/compare.json");
  std::ofstream(folder / "a.json") << "the old one";
  const std::string card = content(folder / "out/compare.json");
  expect_refusal(compare + "--card out/compare.json --json a.json --report out", 2,
                 "out/compare.json is read: it cannot be an output too");
  EXPECT_EQ(content(folder / "out/compare.json"), card);
  EXPECT_EQ(content(folder / "a.json"), "the old one");

  fs::create_directory(folder / "logs");
  fs::copy_file(quick, folder / "logs/report.md");
  expect_refusal(compare + "--json a.json --report logs", 2,
                 "logs/report.md is an HDF5 file, which only a log may replace");
  EXPECT_EQ(content(folder / "logs/report.md"), content(quick));
  EXPECT_EQ(content(folder / "a.json"), "the old one");
}

// Before anything is read: what is no log at all would end in 3.
TEST_F(Cli, NoOutputReplacesAMeasurementOrAnotherOutput) {
  ASSERT_EQ(run("generate quick12 --seed 3 --out kept.h5").code, 0);
  const std::string kept = content(folder / "kept.h5");
  std::ofstream(folder / "text.h5") << "no log\n";
  std::ofstream(folder / "userblock.mat", std::ios::binary) << std::string(512, ' ') << kept;
  for (const char* file : {"kept.h5", "userblock.mat"})
    for (const std::string one :
         {"inspect text.h5 --json ", "compare text.h5 --json ", "fit text.h5 --model sliding_pivot --card ",
          "predict text.h5 --card text.h5 --csv ", "discover text.h5 --card ",
          "generate quick12 --out new.h5 --truth ", "import cube-tosses text.h5 --out new.h5 --json ",
          "plan throw --target 1.3,0,-0.2 --json ", "validate-sku text.h5 --card text.h5 --json ",
          "crosscheck text.h5 --engine cvode --json ", "figure mae --log text.h5 --out f --json "})
      expect_refusal(one + file, 2, std::string(file) + " is an HDF5 file, which only a log may replace");
  expect_refusal("inspect --json kept.h5 '" + quick + "'", 2, "write --json=FILE, or kept.h5 before it");
  EXPECT_EQ(content(folder / "kept.h5"), kept);

  fs::create_directory(folder / "sub");
  fs::create_directory_symlink("sub", folder / "link");
  for (const std::string one :
       {"fit text.h5 --model sliding_pivot --card a --json ./a", "discover text.h5 --json ./a --card a",
        "discover text.h5 --json a --card sub/../a", "predict text.h5 --card c --json sub/a --csv link/a",
        "generate quick12 --out a --json ./a", "generate quick12 --out a --truth ./a",
        "import cube-tosses text.h5 --out a --json ./a", "compare text.h5 --report sub --write-cards link/",
        "validate-sku text.h5 --card text.h5 --json sub --report link/"})
    expect_refusal(one, 2, "two outputs are to be ");
}

TEST_F(Cli, WhatAKilledRunLeftIsClearedByTheNextOfThatName) {
  const pid_t dead = fork();
  if (dead == 0) _exit(0);
  waitpid(dead, nullptr, 0);
  const auto part = [&](const std::string& name, pid_t process) {
    return folder / ("." + name + ".part-" + std::to_string(process) + "-0");
  };
  for (const auto& left : {part("a.json", dead), part("b.json", dead), part("a.json", getpid())})
    std::ofstream(left) << "half of it";
  ASSERT_EQ(run("inspect " + quick + " --json a.json").code, 0);
  EXPECT_FALSE(fs::exists(part("a.json", dead)));
  EXPECT_TRUE(fs::exists(part("b.json", dead))) << "of another name";
  EXPECT_TRUE(fs::exists(part("a.json", getpid()))) << "of a process that lives";
}

TEST_F(Cli, ExitCodesDoNotDependOnStderr) {
  for (const char* nowhere : {"2>&-", "2>/dev/full"}) {
    const auto code = [&](const std::string& arguments) {
      const int status = std::system(("'" UNHAND_BINARY "' " + arguments + " >/dev/null " + nowhere).c_str());
      return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    };
    EXPECT_EQ(code("inspect " + (folder / "none.h5").string()), 3) << nowhere;
    EXPECT_EQ(code("generate quick12 --out /none/a.h5"), 1) << nowhere;
    EXPECT_EQ(code("generate nonsense --out a.h5"), 2) << nowhere;
    EXPECT_EQ(code("inspect '" + quick + "'"), 0) << nowhere;
  }
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
  json truth = read_json(folder / "a.json");
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
  json seen = read_json(folder / "a.json");
  EXPECT_EQ(seen["schema"], "inspect");
  EXPECT_EQ(seen["throws"], 12);
  EXPECT_EQ(json::parse(run("inspect " + quick + " --json").out), seen);
}

TEST_F(Cli, TheNameOfALogNeedNotBeUtf8) {
  fs::copy_file(quick, folder / "w\xfcrfe.h5");
  const std::string log = "w\xfcrfe.h5", seen = "w\uFFFDrfe.h5";
  ASSERT_EQ(run("inspect " + log + " --json a.json").code, 0);
  EXPECT_EQ(read_json(folder / "a.json")["log"], seen);
  ASSERT_EQ(run("fit " + log + " --model gripper_delay --card card.json --json fit.json").code, 0);
  EXPECT_EQ(read_json(folder / "fit.json")["log"], seen);
  EXPECT_EQ(read_json(folder / "card.json")["log"]["file"], seen);
}

TEST_F(Cli, InspectSaysWhatIsTakenForANoiseThatIsNotDeclared) {
  EXPECT_THAT(run("inspect " + quick).out, Not(HasSubstr("note:")));
  write_changed("unsure.h5", [](datasets::Throw& one) { one.landing->pose.sigma.clear(); });
  EXPECT_THAT(run("inspect unsure.h5").out,
              HasSubstr("note: landing/pose declares no sigma in 12 throws: taken are "));
}

TEST_F(Cli, InspectHoldsTheDeclaredNoiseAgainstTheScatter) {
  const Answer honest = run("inspect " + quick + " --json honest.json");
  EXPECT_THAT(honest.out, Not(HasSubstr("declared too small")));
  EXPECT_THAT(honest.out, Not(HasSubstr("\n*: more than is declared")));
  const json seen = read_json(folder / "honest.json")["noise"]["hand/acceleration"];
  for (const double scatter : seen["scatter"])  // beside a brake that jumps along x and z
    EXPECT_NEAR(scatter, 1e-6, 1e-7);
  write_changed("rare.h5", [](datasets::Throw& one) {  // 50 Hz: what is left of an opening is motion
    const datasets::FtLog all = *one.ft;
    datasets::FtLog& rare = *one.ft;
    for (auto* series : {&rare.time, &rare.wrench, &rare.normal_force})
      series->data.clear(), series->rows = 0;
    for (std::size_t i = 0; i < all.time.rows; i += 20)
      for (const auto& [to, from] : {std::pair(&rare.time, &all.time),
                                     {&rare.wrench, &all.wrench},
                                     {&rare.normal_force, &all.normal_force}}) {
        for (std::size_t c = 0; c < from->cols; ++c) to->data.push_back((*from)(i, c));
        ++to->rows;
      }
  });
  EXPECT_THAT(run("inspect rare.h5").out, HasSubstr("\n*: more than is declared, but mostly motion"));
  write_changed("bold.h5", [](datasets::Throw& one) {
    for (double& sigma : one.ft->normal_force.sigma) sigma *= 0.5;
    one.mocap->pose.sigma.assign(3, 0.0);
  });
  const Answer answer = run("inspect bold.h5 --json bold.json");
  EXPECT_THAT(answer.out, HasSubstr("declared too small: ft/normal_force: "));
  EXPECT_THAT(answer.out, HasSubstr("(f_N "));
  EXPECT_THAT(answer.out,
              HasSubstr("note: mocap/pose declares a sigma of 0 in 12 throws: treated as undeclared"));
  json noise = read_json(folder / "bold.json")["noise"];
  EXPECT_EQ(noise["ft/normal_force"]["declared_too_small"], json::array({true}));
  // of 4200 samples: to 1.7 %
  EXPECT_NEAR(noise["ft/normal_force"]["scatter"][0], 0.05, 0.0025);
  EXPECT_NEAR(noise["ft/normal_force"]["scatter_over_declared"][0], 2, 0.1);
  EXPECT_EQ(noise["ft/wrench"]["declared_too_small"], json::array({false, false, false}));
  EXPECT_EQ(noise["mocap/pose"]["declared_zero"], 12);
}

TEST_F(Cli, FigureDrawsWhatIsAskedFor) {
  const Answer answer = run("figure all --log " + quick + " --models sliding_pivot,limit_surface --out f");
  ASSERT_EQ(answer.code, 0) << answer.err;
  for (const char* name :
       {"landing_errors", "conditions", "mae", "modes", "wrench", "pivot", "phase", "flight"})
    for (const char* ending : {".png", ".pdf", ".dat", ".gp"})
      EXPECT_TRUE(fs::exists(folder / "f" / (std::string(name) + ending))) << name << ending;
  const std::string help = std::regex_replace(run("figure --help").out, std::regex("\\s+"), " ");
  EXPECT_THAT(help, HasSubstr("with _ in the place of - in NAME"));
  expect_refusal("figure portrait --log " + quick + " --out g", 2, "landing-errors");
  EXPECT_THAT(content(folder / "f/mae.gp"), HasSubstr("over the 4 held-out throws"));
  for (const char* name : {"modes", "wrench", "pivot", "phase", "flight"})
    EXPECT_THAT(content(folder / "f" / (std::string(name) + ".gp")), HasSubstr("throw 001")) << name;
  const Answer mixed = run("figure modes --log " + quick + " --models gripper_delay,limit_surface --out m");
  EXPECT_EQ(mixed.code, 0) << mixed.err;
  EXPECT_THAT(mixed.err, HasSubstr("without modes, left out of the figures of one release: gripper_delay\n"));
  expect_refusal("figure modes --models gripper_delay --log " + quick + " --out g", 2, "no modes to draw");
  expect_refusal("figure modes --throw 999 --log " + quick + " --out g", 2, "no throw '999' (there are: 001");
  expect_refusal("figure modes --models limit_surfac --log " + quick + " --out g", 2,
                 "did you mean 'limit_surface'?");
  expect_refusal("figure modes --models wishful --log " + quick + " --out g", 2, "wishful");
  expect_refusal("figure modes --log none.h5 --out g", 3, "none.h5");
}

TEST_F(Cli, FigureAllDrawsWhatTheLogHasDataFor) {
  write_changed("aloft.h5", [](datasets::Throw& one) { one.landing.reset(); });
  const Answer answer = run("figure all --log aloft.h5 --models sliding_pivot --out f --json f.json");
  EXPECT_EQ(answer.code, 0) << answer.err;
  for (const char* name : {"mae", "modes", "wrench", "pivot", "phase", "flight"})
    EXPECT_TRUE(fs::exists(folder / "f" / (std::string(name) + ".png"))) << name;
  for (const char* name : {"landing-errors", "conditions"})
    EXPECT_THAT(answer.err,
                HasSubstr(std::string("unhand: left out ") + name + ": aloft.h5: no landing was measured\n"));
  EXPECT_EQ(read_json(folder / "f.json")["left_out"].size(), 2u);
  write_changed("blind.h5", [](datasets::Throw& one) { one.ft.reset(); });
  expect_refusal("figure all --log blind.h5 --models sliding_pivot --out g", 1, "no figure can be drawn");
}

TEST_F(Cli, FigureTakesParametersFromCards) {
  ASSERT_EQ(run("generate quick12 --seed 3 --without ft --out blind.h5").code, 0);
  ASSERT_EQ(run("fit blind.h5 --model limit_surface --card card.json").code, 0);
  const Answer refused = run("figure modes --log blind.h5 --out f");
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, HasSubstr("give a card (--card)"));
  EXPECT_THAT(refused.err, Not(HasSubstr("--fit")));
  const Answer drawn = run("figure all --log blind.h5 --card card.json --throw 005 --out f");
  ASSERT_EQ(drawn.code, 0) << drawn.err;
  EXPECT_THAT(content(folder / "f/modes.dat"), HasSubstr("limit_surface"));
  EXPECT_THAT(content(folder / "f/modes.dat"), Not(HasSubstr("sliding_pivot"))) << "only the card's model";
  // The flight is the one that the card predicts: to the noise of the tracker at its start.
  std::ifstream flight(folder / "f/flight.dat");
  std::vector<double> row(10);
  for (std::string line; row[0] == 0 && std::getline(flight, line);)
    if (!line.empty() && line.front() != '#') {
      std::istringstream in(line);
      for (double& x : row) in >> x;
    }
  EXPECT_LT(std::abs(row[7]), 20) << "mm";
  EXPECT_NEAR(row[7], 1e3 * (row[1] - row[4]), 1e-6) << "predicted - measured, as everywhere";
  EXPECT_GT(row[0], 0);
  expect_refusal("figure modes --log blind.h5 --card card.json --models sliding_pivot --out g", 2,
                 "not among --models");
}

TEST_F(Cli, InspectTellsOfWhatIsImpossibleAndTheRestRefusesIt) {
  EXPECT_EQ(json::parse(run("inspect " + quick + " --json").out)["doubtful"], json::array());
  auto log = datasets::read_throw_log(quick);
  log.gripper->pad_radius = 10.6;  // mm
  datasets::write_throw_log(folder / "mm.h5", log);
  const Answer answer = run("inspect mm.h5");
  EXPECT_EQ(answer.code, 0);
  EXPECT_THAT(answer.out, HasSubstr("doubtful: /gripper@pad_radius: pad_radius is 10.6 m"));
  json seen = json::parse(run("inspect mm.h5 --json").out);
  ASSERT_EQ(seen["doubtful"].size(), 1u);
  EXPECT_EQ(seen["doubtful"][0]["path"], "/gripper@pad_radius");
  expect_refusal("compare mm.h5 --json a.json", 3, "mm.h5: /gripper@pad_radius");
}

TEST_F(Cli, InspectTellsUnitsAndWhatIsDeclaredInJson) {
  auto log = datasets::read_throw_log(quick);
  log.objects.begin()->second.com_offset.reset();
  datasets::write_throw_log(folder / "log.h5", log);
  ASSERT_EQ(run("inspect log.h5 --json i.json").code, 0);
  json seen = read_json(folder / "i.json");
  EXPECT_EQ(seen["software"]["name"], "unhand");
  EXPECT_EQ(seen["log"], "log.h5");
  EXPECT_EQ(seen["log_schema"], "throw-log");
  for (const auto& [dataset, noise] : seen["noise"].items()) {
    json& one = seen["datasets"][dataset];
    EXPECT_EQ(one["units"].size(), one["columns"].size()) << dataset;
    EXPECT_EQ(one["throws"], noise["throws"]) << dataset;
    EXPECT_FALSE(one["units"].empty()) << dataset;
  }
  EXPECT_EQ(seen["datasets"]["ft/wrench"]["columns"], json({"fx", "fz", "tau"}));
  EXPECT_EQ(seen["datasets"]["ft/wrench"]["units"], json({"N", "N", "N m"}));
  for (const auto& [name, object] : log.objects) {
    json& one = seen["declared_objects"][name];
    EXPECT_EQ(one["mass_kg"], object.mass);
    EXPECT_EQ(one["inertia_kg_m2"], *object.inertia);
    EXPECT_EQ(one["com_offset_m"], object.com_offset ? json(*object.com_offset) : json(nullptr));
  }
  EXPECT_EQ(seen["gripper"]["n_pads"], log.gripper->n_pads);
  EXPECT_EQ(seen["gripper"]["pad_radius_m"], *log.gripper->pad_radius);
  EXPECT_THAT(run("inspect '" + flights + "' --json").out, HasSubstr("\"gripper\": null"));
}

// Times are those of the file's clock, wherever it begins; a drag is what the object declares.
TEST_F(Cli, InspectTellsTheOpeningByTheLogsClock) {
  constexpr double kEpoch = 1.7e9;
  auto log = datasets::read_throw_log(quick);
  for (auto& one : log.throws) datasets::move_clock(one, -kEpoch);
  log.gripper->opening_command_time = kEpoch + 0.125;
  log.objects.begin()->second.drag_k = 0.0625;
  datasets::write_throw_log(folder / "far.h5", log);
  const Answer answer = run("inspect far.h5 --json i.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("told to open at 1700000000.125 s"));
  EXPECT_THAT(answer.out, HasSubstr("drag 0.0625 1/m"));
  const json seen = read_json(folder / "i.json");
  EXPECT_EQ(seen["gripper"]["opening_command_time_s"].get<double>(), kEpoch + 0.125);
  EXPECT_EQ(seen["declared_objects"][log.objects.begin()->first]["drag_k_1_m"], 0.0625);
}

// Three slips to fit to and one held out, at 50 Hz with a pause in each.
TEST_F(Cli, InspectCountsTheSlipsOfASurface) {
  datasets::SlipLog log;
  datasets::Surface& felt = log.surfaces["felt"];
  felt = {0.8, 0.02, "made by a test", {}, {}};
  for (int n = 0; n < 4; ++n) {
    datasets::Slip slip{std::to_string(n),
                        n == 2 ? datasets::Split::test : datasets::Split::train,
                        {11, 1, {}, {}},
                        {11, 3, {}, {}},
                        {11, 3, {}, {}}};
    for (int i = 0; i < 11; ++i) {
      slip.time.data.push_back(0.02 * i + (i > 5 ? 1.0 : 0.0));
      for (const double force : {1.0, 0.0, 0.0}) slip.wrench.data.push_back(force);
      for (const double rate : {0.1, 0.0, 0.0}) slip.twist.data.push_back(rate);
    }
    felt.slips.push_back(std::move(slip));
  }
  datasets::write_slip_log(folder / "slips.h5", log);
  const Answer answer = run("inspect slips.h5 --json i.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json seen = read_json(folder / "i.json")["surfaces"]["felt"];
  EXPECT_EQ(seen["slips"], 4);
  EXPECT_EQ(seen["train"], 3);
  EXPECT_EQ(seen["test"], 1);
  EXPECT_EQ(seen["samples"], 44);
  EXPECT_NEAR(seen["rate_hz"].get<double>(), 50, 1e-6);
  EXPECT_THAT(answer.out, testing::ContainsRegex("felt +0.8 +0.02 +4 +3 +1 +44 +50\n"));
}

TEST_F(Cli, InspectShowsTheColumnsThatTheFileHas) {
  write_unoriented_flights("ff.h5");
  EXPECT_THAT(run("inspect ff.h5").out, testing::ContainsRegex("mocap/pose +x,y,z +m,m,m +5 "));
  EXPECT_THAT(run("inspect '" + flights + "'").out,
              testing::ContainsRegex("mocap/pose +x,y,z,qw,qx,qy,qz +m,m,m,1,1,1,1 +5 "));
}

TEST_F(Cli, ImpossibleTimesAreTold) {
  auto log = datasets::read_throw_log(quick);
  log.gripper->opening_command_time = 10;
  datasets::write_throw_log(folder / "late.h5", log);
  const char* said = "/gripper@opening_command_time: is 10 s, and throw ";
  EXPECT_THAT(run("inspect late.h5").out, HasSubstr(said));
  EXPECT_THAT(run("fit late.h5 --model gripper_delay").err, HasSubstr(said));
  write_changed("landed.h5", [](datasets::Throw& one) { one.landing->time.data = {0}; });
  EXPECT_THAT(run("compare landed.h5 --models gripper_delay").err,
              HasSubstr("/landing/time: is 0 s, not after the gripper's opening at "));
  write_changed("clocks.h5", [](datasets::Throw& one) {
    for (double& t : one.mocap->time.data) t += 10;
  });
  expect_refusal("compare clocks.h5", 3, "they do not overlap");
}

}  // namespace
}  // namespace unhand::cli
