// Throws planned and learnt, and new objects.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <regex>

#include "tests/apps/cli.hpp"
#include "tests/planners/ur5.hpp"

namespace unhand::cli {
namespace {

TEST_F(Cli, PlansAThrowIntoABox) {
  const Answer answer =
      run("plan throw --target 1.3,0,-0.2 --samples 600 --draws 50 --json plan.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("no acceleration"));
  auto plan = nlohmann::json::parse(content(folder / "plan.json"));
  EXPECT_EQ(plan["schema"], "plan-throw");
  EXPECT_EQ(plan["qdd_rad_s2"].size(), 7u);
  EXPECT_EQ(plan["predicted"]["planned"]["landed"], 50);
  // The arm swings out of the plane: without its acceleration landings go astray across as well.
  auto& carried = plan["predicted"]["no acceleration"];
  double square = 0;
  for (const char* part : {"mean_m", "std_m", "mean_across_m", "std_across_m"})
    square += std::pow(carried[part].get<double>(), 2);
  EXPECT_NEAR(carried["rms_m"].get<double>(), std::sqrt(square), 1e-12);
  EXPECT_GT(std::abs(carried["mean_across_m"].get<double>()), 0.01);
  EXPECT_LE(carried["rms_m"], plan["window_landings"]["no_acceleration"]["largest_miss_m"]);
  // It is aimed so that a release in the middle of the window lands in the middle.
  const auto window = plan["window_landings"]["no_acceleration"]["across_m"].get<std::vector<double>>();
  const auto [low, high] = std::minmax_element(window.begin(), window.end());
  const double middle = window[window.size() / 2];
  const auto landings = columns_of(content(folder / "out/landings.csv"));
  for (std::size_t i = 0; i < landings.at("motion").size(); ++i) {
    if (landings.at("motion")[i] != "no acceleration") continue;
    EXPECT_GE(std::stod(landings.at("across_m")[i]), *low - middle - 1e-4);
    EXPECT_LE(std::stod(landings.at("across_m")[i]), *high - middle + 1e-4);
  }
  EXPECT_GT(std::abs(middle), 1e-3);
  double beside = 0;
  for (std::size_t i = 0; i < landings.at("motion").size(); ++i)
    if (landings.at("motion")[i] == "no acceleration") beside += std::stod(landings.at("across_m")[i]) / 50;
  EXPECT_NEAR(carried["mean_across_m"].get<double>(), beside, 1e-6);
  for (const char* limit : {"position", "velocity", "acceleration", "jerk", "torque"})
    EXPECT_LE(plan["limits"][limit]["fraction"], 1 + 1e-9) << limit;
  EXPECT_THAT(content(folder / "out/trajectory.csv"), testing::StartsWith("time_s,q1_rad,"));
  for (const char* file : {"tube.png", "motion.pdf", "landings.png", "landings.csv"})
    EXPECT_TRUE(fs::exists(folder / "out" / file)) << file;

  expect_refusal("plan throw --target 1.3,0", 2, "--target: '1.3,0' is not 3 numbers with ',' between");
  expect_refusal("plan throw --target 1e300,0,0", 2, "--target: 1e+300 m is not in [-1000, 1000] m");
  expect_refusal("plan throw --target 1.3,0,0 --box 0x1", 2, "--box: '0x1' has no area");
  expect_refusal("plan throw --target 1.3,0,0 --arm kuka", 2,
                 "'kuka' is not panda, a .toml file or a .urdf file");
  expect_refusal("plan throw --target 9,0,0 --samples 200 --json a.json", 1,
                 "no_throw: none of 200 configurations reaches the box");
  EXPECT_EQ(run("plan throw --target 1.3,0,-6").code, 0);  // from far above, where flights come down fast
  expect_refusal("plan throw --target 0,0,-0.2 --json a.json", 1, "flies through the arm's own column");
  expect_refusal("plan throw --target 1.3,0,0 --arm none.toml", 3, "none.toml: no such file");
  expect_refusal("plan throw --target 1.3,0,0 --card none.json", 3, "none.json");
}

/// Three joints in a vertical plane, and a camera beside the hand.
constexpr const char* kPlanarArm = R"(<robot name="three joints">
  <link name="base"/><link name="hand"/><link name="camera"/>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="3"/>
    <inertia ixx="0.05" iyy="0.05" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
    <inertia ixx="0.03" iyy="0.03" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="palm"><inertial><origin xyz="0 0 0.05"/><mass value="1"/>
    <inertia ixx="0.004" iyy="0.004" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" velocity="3" effort="200"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" velocity="3.5" effort="150"/></joint>
  <joint name="wrist" type="revolute"><parent link="lower"/><child link="palm"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" velocity="5" effort="50"/></joint>
  <joint name="flange" type="fixed"><parent link="palm"/><child link="hand"/><origin xyz="0 0 0.1"/></joint>
  <joint name="mount" type="fixed"><parent link="palm"/><child link="camera"/><origin xyz="0.1 0 0.1"/></joint>
</robot>)";

// A URDF file tells neither which end throws nor how fast joints may speed up.
TEST_F(Cli, PlansAThrowOfAnArmFromUrdf) {
  std::ofstream(folder / "arm.urdf") << kPlanarArm;
  const std::string plan = "plan throw --target 1.3,0,-0.2 --samples 600 --draws 50 --arm arm.urdf";
  expect_refusal(plan, 3, "the tip is 'camera' or 'hand'");
  expect_refusal(plan + " --tip hand", 2, "--acceleration: joint 'shoulder' of arm.urdf has no limit");
  expect_refusal(plan + " --tip hand --acceleration 15", 2, "--jerk: joint 'shoulder'");
  expect_refusal("plan throw --target 1.3,0,-0.2 --tip hand", 2, "--tip: 'panda' is no .urdf file");
  const Answer answer = run(plan + " --tip hand --acceleration 15 --jerk 5000 --planar --json plan.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  auto told = nlohmann::json::parse(content(folder / "plan.json"));
  EXPECT_EQ(told["predicted"]["planned"]["landed"], 50);
  EXPECT_NE(told["q0_rad"][0], 0.0) << "the shoulder is no turntable: it is searched like the others";
  EXPECT_LE(told["limits"]["acceleration"]["fraction"], 1 + 1e-9);
}

/// A card of a pivot whose gripper is known, with scatter of the grasp; friction to `mu_sigma`.
void write_pivot_card(const fs::path& file, double grip_force, double mu_sigma, double dead_time = 0.02) {
  std::ofstream(file) << fmt::format(
      R"({{"schema": "model-card", "schema_version": 1, "model": "sliding_pivot", "library_version": "0",
      "log": {{"file": "made by a test"}}, "parameters": {{"mu": {{"value": 0.5, "sigma": {}, "unit": "-"}},
      "length": {{"value": 0.007, "sigma": 1e-4, "unit": "m"}},
      "grip_force": {{"value": {}, "unit": "N"}}, "dead_time": {{"value": {}, "sigma": 0.003, "unit": "s"}},
      "opening_time": {{"value": 0.06, "sigma": 0.004, "unit": "s"}}, "shape": {{"value": 1.5, "unit": "-"}}}},
      "own_spreads": {{"grasp_offset": {{"sigma": 0.003, "unit": "m"}},
                       "grasp_angle": {{"sigma": 0.01, "unit": "rad"}}}}}})",
      mu_sigma, grip_force, dead_time);
}

// The middle of a UR5's ranges is no pose to rest in; its file or --home tells one.
TEST_F(Cli, AThrowBeginsWhereTheArmCanRest) {
  std::ofstream(folder / "ur5.toml") << planners::kUr5;
  std::ofstream(folder / "bent.toml") << "home_rad = [0.1, -1.5, 1.5, 0, -1.5, 0]\n" << planners::kUr5;
  const std::string plan = "plan throw --target 0.9,0.3,0 --samples 300 --draws 20 --report out --arm ";
  expect_refusal(plan + "ur5.toml", 1,
                 "no_rest: at rest at (0, 0, 0, 0, 0, 0) deg the arm's lowest joint or what it throws is at "
                 "-0.005 m; accepted: above its base, > 0 m (this pose is the middle of its joints' ranges; "
                 "--home gives another)");
  expect_refusal(plan + "bent.toml --home 0,0,0,0,0,0", 1, "(this pose is --home; --home gives another)");
  expect_refusal(plan + "ur5.toml --home 0,-90,90", 2, "--home: '0,-90,90' is not 6 numbers with ','");
  expect_refusal(plan + "ur5.toml --home 0,-400,90,0,-90,0", 2,
                 "--home: -400 deg of joint 'shoulder' is not in [-360, 360] deg");
  const auto begins_at = [&](const std::string& options) {
    const Answer answer = run(plan + options);
    EXPECT_EQ(answer.code, 0) << answer.err;
    const auto motion = columns_of(content(folder / "out/trajectory.csv"));
    std::vector<double> out;
    for (int i = 1; i <= 6; ++i) out.push_back(std::stod(motion.at(fmt::format("q{}_rad", i)).front()));
    return out;
  };
  EXPECT_EQ(begins_at("bent.toml"), (std::vector{0.1, -1.5, 1.5, 0.0, -1.5, 0.0}));
  const auto given = begins_at("bent.toml --home 0,-90,90,0,-90,30");
  for (const auto& [i, degrees] : {std::pair{0, 0}, {1, -90}, {2, 90}, {5, 30}})
    EXPECT_NEAR(given[static_cast<std::size_t>(i)], degrees * std::numbers::pi / 180, 1e-8);
}

// Its shoulder, elbow and first wrist joint throw in the plane of the target, with a card or without.
TEST_F(Cli, AUr5ThrowsInThePlaneOfItsTarget) {
  std::ofstream(folder / "ur5.toml") << planners::kUr5;
  write_pivot_card(folder / "card.json", 80, 0.03);
  const std::string plan =
      "plan throw --target 0.9,0.3,0 --samples 300 --draws 20 --arm ur5.toml --json p.json ";
  for (const std::string how : {"--planar", "--card card.json"}) {
    const Answer answer = run(plan + "--home 0,-90,90,0,-90,0 " + how);
    ASSERT_EQ(answer.code, 0) << answer.err;
    json told = read_json(folder / "p.json");
    for (const std::size_t held : {0u, 4u, 5u}) {
      EXPECT_EQ(told["qd0_rad_s"][held], 0) << how;
      EXPECT_NEAR(told["qdd_rad_s2"][held].get<double>(), 0, 1e-6) << how;
    }
    for (const json& across : told["window_landings"]["planned"]["across_m"])
      EXPECT_NEAR(across.get<double>(), 0, 1e-6) << how;
  }
  std::string stiff = planners::kUr5;  // its tool cannot be turned into the plane
  const auto wrist = stiff.find("lower_rad", stiff.find("wrist_2"));
  stiff.replace(wrist, stiff.find("velocity", wrist) - wrist, "lower_rad = -1\nupper_rad = 1\n");
  std::ofstream(folder / "ur5.toml") << stiff;
  const std::string bent = plan + "--home 0,-90,90,0,-50,0 ";
  expect_refusal(bent + "--planar", 1, "no_plane: ur5.toml cannot throw in the vertical plane of the target");
  expect_refusal(bent + "--planar", 1, "plan it without --planar");
  expect_refusal(bent + "--card card.json", 1, "plan it without --card");
}

// One landing has a mean and a distance, and no spread.
TEST_F(Cli, OneDrawHasNoSpread) {
  write_pivot_card(folder / "card.json", 80, 0.03);
  for (const std::string how : {"", "--card card.json"}) {
    const Answer answer =
        run("plan throw --target 1.3,0,-0.2 --samples 100 --draws 1 --json p.json --report out " + how);
    ASSERT_EQ(answer.code, 0) << answer.err;
    json told = read_json(folder / "p.json");
    for (auto& [name, one] : told["predicted"].items()) {
      EXPECT_TRUE(one["std_m"].is_null()) << name;
      EXPECT_TRUE(one["std_across_m"].is_null()) << name;
      EXPECT_NEAR(one["rms_m"].get<double>(),
                  std::hypot(one["mean_m"].get<double>(), one["mean_across_m"].get<double>()), 1e-12);
      EXPECT_THAT(answer.out, testing::ContainsRegex(fmt::format(
                                  "{} +1 +[0-9.]+ % +[-+0-9.]+ +- +[-+0-9.]+ +- +[0-9.]+", name)));
    }
  }
}

/// The last row of a block of a figure's data.
std::string last_row(const std::string& data, const std::string& title) {
  std::istringstream lines(data.substr(data.find(title)));
  std::string line, row;
  std::getline(lines, line);
  while (std::getline(lines, line) && !line.empty()) row = line;
  return row;
}

TEST_F(Cli, DrawsTheFlightsOfAThrowWithTheirDrag) {
  const Answer answer =
      run("plan throw --target 1.3,0,-0.2 --samples 100 --drag 0.1 --json plan.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const auto landings =
      nlohmann::json::parse(content(folder / "plan.json"))["window_landings"]["no_acceleration"]["forward_m"];
  const std::string data = content(folder / "out/tube.dat");
  EXPECT_NEAR(std::stod(last_row(data, "flight from 0.000 s, no")), landings.front().get<double>(), 1e-6);
  EXPECT_NEAR(std::stod(last_row(data, "flight from 0.100 s, no")), landings.back().get<double>(), 1e-6);
}

// The object weighs on the arm and flies through the air.
TEST_F(Cli, PlansAThrowWithTheMassAndTheDragOfItsSku) {
  const auto bar = [&](const std::string& file, const std::string& mass, const std::string& more) {
    std::ofstream(folder / file) << "name='bar'\nsurface='paper'\ncom_offset_m=0.1\ninertia_kg_m2=0.0012\n"
                                 << "mass_kg=" << mass << "\n"
                                 << more;
  };
  bar("bar.toml", "0.246", "");
  bar("heavy.toml", "8", "");
  bar("blunt.toml", "0.246", "drag_k_per_m=0.1\n");
  const std::string plan = "plan throw --target 1.3,0,-0.2 --samples 600 --draws 20 --planar --json p.json ";
  const auto planned = [&](const std::string& options) {
    const Answer answer = run(plan + options);
    EXPECT_EQ(answer.code, 0) << answer.err;
    return std::pair{nlohmann::json::parse(content(folder / "p.json")), answer};
  };
  const auto light = planned("--sku bar.toml").first;
  expect_refusal(plan + "--sku heavy.toml", 1, "torque of panda_joint");
  const auto [blunt, told] = planned("--sku blunt.toml");
  EXPECT_EQ(blunt["drag_k_per_m"], 0.1);
  EXPECT_THAT(told.out, HasSubstr("a drag of 0.1 1/m (SKU)"));
  EXPECT_EQ(blunt["qd0_rad_s"], planned("--sku bar.toml --drag 0.1").first["qd0_rad_s"]);
  EXPECT_NE(blunt["qd0_rad_s"], light["qd0_rad_s"]);
  const auto [other, noted] = planned("--sku blunt.toml --drag 0.05");
  EXPECT_EQ(other["drag_k_per_m"], 0.05);
  EXPECT_THAT(noted.err, HasSubstr("--drag 0.05 is taken, not drag_k_per_m = 0.1 of blunt.toml"));
}

// An object 10 cm from the pads is where one in the middle of 10 cm longer pads is: one and the same plan.
TEST_F(Cli, AnObjectWeighsWhereItHangs) {
  const auto planned = [&](const std::string& gripper, const std::string& com_offset) {
    std::ofstream(folder / "block.toml") << "name='block'\nsurface='paper'\nmass_kg=1.5\n"
                                            "inertia_kg_m2=0.02\ncom_offset_m="
                                         << com_offset << "\n";
    const Answer answer =
        run("plan throw --target 1.3,0,-0.2 --samples 100 --draws 20 --gripper-mass 0 --sku "
            "block.toml --json p.json --gripper " +
            gripper);
    EXPECT_EQ(answer.code, 0) << answer.err;
    return read_json(folder / "p.json");
  };
  const json hanging = planned("0.15", "0.1"), reaching = planned("0.25", "0.0");
  EXPECT_EQ(hanging["qd0_rad_s"], reaching["qd0_rad_s"]);
  for (const char* limit : {"velocity", "jerk", "torque"})
    EXPECT_NEAR(hanging["limits"][limit]["fraction"].get<double>(),
                reaching["limits"][limit]["fraction"].get<double>(), 1e-9)
        << limit;
  EXPECT_GT(hanging["limits"]["torque"]["fraction"], 0.5);
}

TEST_F(Cli, PlansAThrowWithACard) {
  ASSERT_EQ(run("compare " + quick + " --models sliding_pivot --write-cards cards").code, 0);
  std::ofstream(folder / "bar.toml") << "name='bar'\nsurface='paper'\nmass_kg=0.246\ncom_offset_m=0.14\n"
                                        "inertia_kg_m2=0.0024\n";
  const Answer answer =
      run("plan throw --target 1.3,0,-0.2 --samples 600 --draws 40 --card cards/sliding_pivot.json --sku "
          "bar.toml --json plan.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("insensitive motion"));
  EXPECT_THAT(answer.out, Not(HasSubstr("without a card")));
  EXPECT_THAT(content(folder / "out/tube.gp"), HasSubstr("landings that the card predicts"));
  const Answer rigid = run("plan throw --target 1.3,0,-0.2 --samples 600 --draws 40 --sku bar.toml");
  EXPECT_THAT(rigid.out, HasSubstr("note: without a card the object is taken as carried rigidly"));
  EXPECT_THAT(rigid.out, HasSubstr("this one hangs 14 cm from the pads"));
  auto plan = nlohmann::json::parse(content(folder / "plan.json"));
  EXPECT_LT(plan["predicted"]["insensitive motion"]["rms_m"],
            plan["predicted"]["tube acceleration"]["rms_m"]);
  EXPECT_TRUE(plan["release"]["contact_model"]["miss_m"].is_number());
  // Where each number is from: the card's log measured its gripper.
  const auto& numbers = plan["release"]["numbers"];
  auto range = nlohmann::json::parse(content(folder / "cards/sliding_pivot.json"))["valid_range"];
  for (const char* name : {"grip_force", "dead_time", "opening_time", "shape"}) {
    EXPECT_EQ(numbers[name]["from"], "card's range") << name;
    EXPECT_DOUBLE_EQ(numbers[name]["value"],
                     0.5 * (range[name]["low"].get<double>() + range[name]["high"].get<double>()));
  }
  EXPECT_EQ(numbers["mu"]["from"], "card; sigma: assumed and card, with grip_force");
  EXPECT_GT(numbers["mu"]["sigma"], 0);
  EXPECT_TRUE(numbers["grip_force"]["sigma"].is_null()) << "it is not known exactly";
  EXPECT_EQ(numbers["grip_force"]["sigma_in"], "mu");
  EXPECT_EQ(numbers["pads"]["sigma"], 0);
  EXPECT_THAT(answer.out, testing::ContainsRegex("grip_force \\[N\\] +[0-9.]+ +in mu "));
  EXPECT_EQ(read_json(folder / "out/plan.json"), plan);
  for (const char* words : {"# A throw into a box", "| grip_force [N] |", "![tube](tube.png)"})
    EXPECT_THAT(content(folder / "out/report.md"), HasSubstr(words));
  EXPECT_EQ(numbers["mass"]["from"], "SKU; sigma: assumed");
  EXPECT_DOUBLE_EQ(numbers["mass"]["sigma"], 0.01 * 0.246);
  EXPECT_THAT(answer.out, HasSubstr("card's range"));
  EXPECT_THAT(answer.out, HasSubstr("Beyond the card: surface 'paper'"));
  EXPECT_THAT(plan["release"]["outside_valid_range"].dump(), HasSubstr("release_speed"));
  EXPECT_THAT(answer.out, HasSubstr("assumed"));
}

// A load that the controller does not know pulls a soft arm off its path; adaptation learns it beforehand.
TEST_F(Cli, AdaptationThrowsUnknownObjectsWhereItShould) {
  const Answer answer = run("plan control --seeds 3 --repetitions 2 --json c.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  std::map<std::string, std::map<std::string, json>> cells;
  json found = read_json(folder / "c.json");
  for (const auto& cell : found["cells"]) cells[cell["object"]][cell["controller"]] = cell;
  ASSERT_EQ(cells.size(), 3u);
  for (auto& [object, by] : cells) {
    json &adaptive = by.at("adaptive, 30 N/m"), &soft = by.at("plain, 30 N/m"),
         &stiff = by.at("plain, 300 N/m");
    json& joints = by.at("adaptive, in the joints");
    for (json cell : {adaptive, soft, stiff, joints}) {
      EXPECT_EQ(cell["throws"], 3);
      ASSERT_EQ(cell["limits"].size(), 5u);
      for (const auto& [limit, share] : cell["limits"].items())
        EXPECT_TRUE(share > 0 && share < 1) << object << ": " << limit << " " << share;
      // rms² is the square of the mean and the spread about it, on both axes.
      double square = 0;
      for (int axis = 0; axis < 2; ++axis)
        square += std::pow(cell["mean_m"][axis].get<double>(), 2) +
                  2.0 / 3.0 * std::pow(cell["std_m"][axis].get<double>(), 2);
      EXPECT_NEAR(cell["rms_m"].get<double>(), std::sqrt(square), 1e-9) << object;
    }
    EXPECT_EQ(adaptive["hits"], 3) << object;
    EXPECT_LT(soft["mean_m"][0], -0.01) << object << " is heavy: the arm lags, and the throw falls short";
    const auto error = [](json cell) { return cell["release_position_error_m"].get<double>(); };
    EXPECT_LT(10 * error(adaptive), error(soft)) << object;
    EXPECT_LT(5 * error(joints), error(soft)) << object;
    EXPECT_LT(5 * error(stiff), error(soft)) << object << ": ten times the stiffness, a tenth of the lag";
  }
  const auto lag = [&](const char* object) {
    return cells.at(object).at("plain, 30 N/m")["release_position_error_m"].get<double>();
  };
  EXPECT_LT(lag("box"), lag("ball"));  // 221 g, 427 g
  EXPECT_THAT(content(folder / "out/landings.md"), HasSubstr("ball, 427 g"));
  EXPECT_EQ(read_json(folder / "out/control.json"), found);
}

/// The rows of a figure's data by the title of their block.
std::map<std::string, std::vector<std::vector<double>>> blocks_of(const fs::path& file) {
  std::map<std::string, std::vector<std::vector<double>>> out;
  std::istringstream lines(content(file));
  std::string title;
  for (std::string line; std::getline(lines, line);) {
    std::smatch found;
    if (std::regex_match(line, found, std::regex("# [0-9]+: \"(.*)\""))) title = found[1];
    if (line.empty() || line.front() == '#') continue;
    std::istringstream in(line);
    auto& row = out[title].emplace_back();
    for (double x{}; in >> x;) row.push_back(x);
  }
  return out;
}

std::vector<double> numbers_of(const std::vector<std::string>& cells) {
  std::vector<double> out;
  for (const std::string& cell : cells) out.push_back(std::stod(cell));
  return out;
}

/// Trajectories whose angles are the integrals of their rates, with deflections that are those of the spring.
void expect_trajectories(const std::string& csv, const std::string& of) {
  auto all = columns_of(csv);
  const auto value = [&](const char* name, std::size_t k) { return std::stod(all.at(name).at(k)); };
  const auto& run = all.at(of);
  ASSERT_GT(run.size(), 100u);
  for (std::size_t k = 0; k < run.size(); ++k) {
    EXPECT_NEAR(value("deflection_rad", k), value("motor_rad", k) - value("spring_end_rad", k), 1e-7);
    if (k == 0 || run[k] != run[k - 1] || all.at("mode")[k] != all.at("mode")[k - 1]) continue;
    const double dt = value("time_s", k) - value("time_s", k - 1);
    EXPECT_LE(dt, 0.02);
    for (const auto& [angle, rate] : {std::pair{"q1_rad", "qd1_rad_s"},
                                      {"q2_rad", "qd2_rad_s"},
                                      {"q3_rad", "qd3_rad_s"},
                                      {"motor_rad", "motor_rad_s"},
                                      {"tip_x_m", "tip_vx_m_s"},
                                      {"tip_z_m", "tip_vz_m_s"}})
      EXPECT_NEAR(value(angle, k) - value(angle, k - 1), 0.5 * dt * (value(rate, k) + value(rate, k - 1)),
                  2e-4)
          << angle << " at " << value("time_s", k);
  }
}

// What the motors put in and no loss takes is in the arm: the spring lends it, and throws with it are faster.
TEST_F(Cli, AClutchedSpringThrowsFaster) {
  const Answer answer =
      run("plan elastic --starts 1 --intervals 8 --longest 0.4 --elevation 20 --json e.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json drives = read_json(folder / "e.json")["drives"];
  for (auto& [name, drive] : drives.items()) {
    ASSERT_FALSE(drive["basins"].empty()) << name;
    for (auto& basin : drive["basins"]) {
      json& energy = basin["energy_J"];
      const auto joules = [&](const char* what) { return energy[what].get<double>(); };
      EXPECT_NEAR(joules("gain"),
                  joules("motors") - joules("damping") - joules("friction") - joules("impacts"), 1e-9)
          << name;
      EXPECT_GE(joules("damping"), 0) << name;
      EXPECT_GE(joules("friction"), 0) << name;
      for (const auto& [limit, use] : basin["limits"].items()) EXPECT_LE(use, 1) << name << ' ' << limit;
      EXPECT_NEAR(basin["resimulated_speed_m_s"].get<double>(), basin["speed_m_s"].get<double>(),
                  0.01 * basin["speed_m_s"].get<double>())
          << name;
      EXPECT_LE(basin["duration_s"], 0.4 + 1e-6) << name;
    }
  }
  const auto fastest = [&](const char* drive) {
    return drives[drive]["basins"][0]["speed_m_s"].get<double>();
  };
  EXPECT_GT(fastest("SEA"), 1.2 * fastest("rigid"));
  EXPECT_THAT(content(folder / "out/speeds.md"), HasSubstr("SEA"));
  for (const std::string& told : {answer.out, content(folder / "out/speeds.md")})
    EXPECT_THAT(told, HasSubstr("as reported on hardware [DarkoD46] 4.3: 4.1 m/s"));
  EXPECT_EQ(read_json(folder / "out/plan.json"), read_json(folder / "e.json"));
  const std::string csv = content(folder / "out/trajectory.csv");
  expect_trajectories(csv, "drive");
  const auto columns = columns_of(csv);
  EXPECT_THAT(columns.at("mode"), testing::IsSupersetOf({"BRK", "SEA"}));
  const double vx = std::stod(columns.at("tip_vx_m_s").back()),
               vz = std::stod(columns.at("tip_vz_m_s").back());
  EXPECT_NEAR(std::hypot(vx, vz), drives["rigid"]["basins"].back()["resimulated_speed_m_s"].get<double>(),
              1e-6);

  EXPECT_NEAR(std::atan2(vz, vx), std::numbers::pi / 9, 0.01) << "as asked for";

  // What the drawn motions use of the limits is what is told: 8 N m/rad, and limits as
  // docs/elastic-throwing.md has them.
  const auto drawn = blocks_of(folder / "out/speed.dat");
  for (auto& [name, drive] : drives.items()) {
    double speed = 0, torque[2]{}, deflection = 0;
    for (const auto& row : drawn.at(name)) {
      speed = std::max(speed, std::abs(row[3]) / 4.5);
      torque[0] = std::max({torque[0], std::abs(row[7]) / 20, std::abs(row[8]) / 8});
      torque[1] = std::max(torque[1], std::abs(row[9]) / 5);
      deflection = std::max(deflection, std::abs(row[2]) / 0.4);
      EXPECT_NEAR(row[10], 4 * row[2] * row[2], 1e-12) << "J, of 8 N m/rad";
    }
    json& limits = drive["basins"][0]["limits"];
    EXPECT_NEAR(limits["motor_speed"].get<double>(), speed, 1e-9) << name;
    EXPECT_NEAR(limits["torque"].get<double>(), torque[0], 1e-9) << name;
    EXPECT_NEAR(limits["motor_torque"].get<double>(), torque[1], 1e-9) << name;
    if (name != "rigid") {
      EXPECT_NEAR(limits["deflection"].get<double>(), deflection, 1e-9) << name;
    }
    EXPECT_EQ(limits["brake"].get<double>() > 0, name == "BRK -> SEA");
    EXPECT_NEAR(drawn.at(name).back()[1], drive["basins"][0]["resimulated_speed_m_s"].get<double>(), 1e-9);
  }
  double torque2 = 0;
  for (std::size_t k = 0; k < columns.at("drive").size(); ++k)
    if (columns.at("drive")[k] == "BRK -> SEA" && columns.at("basin")[k] == "1")
      torque2 = std::max(torque2, std::abs(std::stod(columns.at("torque2_N_m")[k])));
  double of_figure = 0;
  for (const auto& row : drawn.at("BRK -> SEA")) of_figure = std::max(of_figure, std::abs(row[8]));
  EXPECT_NEAR(torque2, of_figure, 0.02 * of_figure);

  expect_refusal("plan elastic --arm none.toml", 3, "none.toml: no such file");
}

TEST_F(Cli, ElasticThrowsReachTheirTargets) {
  const Answer answer = run(
      "plan elastic --target 2.2 --starts 2 --intervals 8 --nodes 4 --checks 7 --json e.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("7 land in the box of 0.5 m"));
  json found = read_json(folder / "e.json");
  ASSERT_EQ(found["nodes"].size(), 4u);
  // The run's last row, thrown without drag to 0.5 m below the shoulder, lands where the node says.
  const std::string csv = content(folder / "out/trajectory.csv");
  expect_trajectories(csv, "target_m");
  const auto columns = columns_of(csv);
  const auto last = [&](const char* name) { return std::stod(columns.at(name).back()); };
  const double up = last("tip_vz_m_s"),
               time = (up + std::sqrt(up * up + 2 * 9.81 * (last("tip_z_m") + 0.5))) / 9.81;
  EXPECT_NEAR(found["nodes"][3]["resimulated_miss_m"].get<double>(),
              last("tip_x_m") + time * last("tip_vx_m_s") - 2.6, 1e-6);
  for (const auto& node : found["nodes"]) {
    EXPECT_TRUE(node["confirmed"]);
    EXPECT_LE(std::abs(node["resimulated_miss_m"].get<double>()), 5e-3);
  }
  EXPECT_EQ(read_json(folder / "out/plan.json"), found);
  EXPECT_NEAR(found["nodes"][0]["target_m"].get<double>(), 1.8, 1e-12);
  for (const auto& node : found["nodes"])
    EXPECT_THAT(answer.out,
                HasSubstr(fmt::format("{:+.2f}", 1e3 * node["resimulated_miss_m"].get<double>())));
  // The dense check, of which the figure has every target.
  const auto checks = blocks_of(folder / "out/table.dat").at("dense check");
  ASSERT_EQ(checks.size(), 7u);
  EXPECT_EQ(found["check"]["targets"], 7);
  double worst = 0, use = 0;
  for (const auto& row : checks) worst = std::max(worst, std::abs(row[1]) / 1e3), use = std::max(use, row[2]);
  EXPECT_NEAR(found["check"]["worst_miss_m"].get<double>(), worst, 1e-12);
  EXPECT_NEAR(found["check"]["largest_limit_use"].get<double>(), use, 1e-12);
  EXPECT_EQ(found["check"]["hits"], 7);
  EXPECT_NEAR(checks.front()[0], 1.8, 1e-12);
  EXPECT_NEAR(checks.back()[0], 2.6, 1e-12);

  const Answer far = run("plan elastic --target 9 --starts 1 --intervals 4 --json f.json");
  EXPECT_EQ(far.code, 1);
  EXPECT_THAT(far.err,
              HasSubstr("--target 9: no throw was found to a target at 9 m, 0.5 m below the shoulder"));
  EXPECT_THAT(far.err, testing::ContainsRegex("found throws to targets from [0-9.]+ to [2-8][.][0-9]+ m"));
  EXPECT_THAT(far.err, Not(HasSubstr("make_table")));
}

// What no run confirms is not to be made, and not an answer.
TEST_F(Cli, ElasticThrowsThatNoRunConfirmsAreNoAnswer) {
  const fs::path arms = fs::path(UNHAND_SOURCE_DIR) / "planners/elastic";
  std::string arm = content(arms / "bsa3.toml");
  for (const auto& [from, to] :
       {std::pair<std::string, std::string>{"motor_speed_rad_s = 4.5", "motor_speed_rad_s = 0.2"},
        {"damping_n_m_s_rad = 0.02", "damping_n_m_s_rad = 5"}})
    arm.replace(arm.find(from), from.size(), to);
  std::ofstream(folder / "slow.toml") << arm;
  std::ofstream(folder / "bsa3_chain.toml") << content(arms / "bsa3_chain.toml");
  const Answer fastest = run("plan elastic --arm slow.toml --starts 1 --intervals 8 --json e.json");
  EXPECT_EQ(fastest.code, 1);
  json drives = read_json(folder / "e.json")["drives"];
  const std::string told = fastest.err.substr(0, fastest.err.find(" is confirmed by its run"));
  for (auto& [name, drive] : drives.items()) {
    bool confirmed = false;
    for (json& basin : drive["basins"]) confirmed |= basin["confirmed"].get<bool>();
    EXPECT_EQ(told.find(name) == std::string::npos, confirmed) << name << ": " << told;
  }
  EXPECT_THAT(told, HasSubstr("no throw of BRK -> SEA"));
  EXPECT_THAT(fastest.out, HasSubstr("not confirmed"));

  const Answer table = run(
      "plan elastic --target 2.2 --longest 10 --starts 1 --intervals 4 --nodes 4 --checks 2 --json t.json");
  EXPECT_EQ(table.code, 1);
  EXPECT_THAT(table.err, HasSubstr("no node of the table is confirmed by its run"));
  json written = read_json(folder / "t.json");
  ASSERT_FALSE(written["nodes"].empty());
  for (const json& node : written["nodes"]) EXPECT_FALSE(node["confirmed"]);
}

TEST_F(Cli, AnElasticWristThrowsFaster) {
  const Answer answer =
      run("plan wrist --stiffnesses 2 --softest 4 --stiffest 16 --starts 1 --intervals 4 --elevation 30 "
          "--json w.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json wrist = read_json(folder / "w.json");
  ASSERT_EQ(wrist["spring"].size(), 2u);
  for (const auto& spring : wrist["spring"]) {
    const auto speed = spring["speed_m_s"].get<double>();
    EXPECT_NEAR(spring["gain"].get<double>(), speed / wrist["rigid_m_s"].get<double>(), 1e-9);
    EXPECT_GT(spring["gain"], 1.2);
    EXPECT_LE(spring["largest_limit_use"], 1);
    EXPECT_NEAR(spring["unexplained_J"].get<double>(), 0, 1e-6);
    EXPECT_GT(spring["stored_J"], 0);
    EXPECT_NEAR(speed, spring["planned_m_s"].get<double>(), 0.01 * speed);
  }
  EXPECT_TRUE(fs::exists(folder / "out/gain.png"));
  EXPECT_EQ(read_json(folder / "out/plan.json"), wrist);
  const std::string csv = content(folder / "out/trajectory.csv");
  expect_trajectories(csv, "stiffness_n_m_rad");
  const auto columns = columns_of(csv);
  EXPECT_THAT(columns.at("stiffness_n_m_rad"), testing::IsSupersetOf({"inf", "4", "16"}));
  EXPECT_NEAR(
      std::atan2(std::stod(columns.at("tip_vz_m_s").back()), std::stod(columns.at("tip_vx_m_s").back())),
      std::numbers::pi / 6, 0.01)
      << "as asked for";
  const auto drawn = blocks_of(folder / "out/gain.dat").at("spring");
  for (std::size_t k = 0; k < 2; ++k) {
    const double stiffness = k == 0 ? 4 : 16;
    EXPECT_NEAR(drawn[k][2], wrist["spring"][k]["gain"].get<double>(), 1e-9);
    const double planned = wrist["spring"][k]["planned_m_s"], made = wrist["spring"][k]["speed_m_s"];
    EXPECT_THAT(answer.out, HasSubstr(fmt::format("  {:.3f}    {:.3f}  ", made, planned)));
    EXPECT_NE(planned, made) << "between its few nodes the plan is not quite the arm's motion";
    double most = 0;  // J, over the run
    for (std::size_t i = 0; i < columns.at("deflection_rad").size(); ++i)
      if (columns.at("stiffness_n_m_rad")[i] == fmt::to_string(static_cast<int>(stiffness)))
        most = std::max(most, 0.5 * stiffness * std::pow(std::stod(columns.at("deflection_rad")[i]), 2));
    EXPECT_NEAR(wrist["spring"][k]["stored_J"].get<double>(), most, 0.02 * most);
    EXPECT_NEAR(drawn[k][3], wrist["spring"][k]["stored_J"].get<double>(), 1e-9);
  }
  EXPECT_GT(std::abs(drawn[1][1] - drawn[0][1]), 0.1) << "another spring makes another throw";
  const std::size_t best = drawn[1][1] > drawn[0][1];
  EXPECT_THAT(answer.out, HasSubstr(fmt::format("best stiffness {:.2f} N m/rad", drawn[best][0])));
}

TEST_F(Cli, LearnsToThrowFlipAndGoesOnAfterAKill) {
  const std::string what = "plan flip --target 1.2,180 --seed 3 --iterations 2 --repeats 1 --report out ";
  const Answer answer = run(what + "--learner m2 --json flip.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("m2: target 1.20 m, 180 degrees"));
  EXPECT_THAT(answer.out, testing::ContainsRegex(
                              "throws within the tolerances: at least 2 of 3 (first in iteration [12]|in no "
                              "iteration), all 3 (first in iteration [12]|in no iteration)"));
  const std::string path = content(folder / "out/path.gp");
  EXPECT_LT(path.rfind("with labels"), path.find("with linespoints")) << "labels hide no mean";
  auto flip = nlohmann::json::parse(content(folder / "flip.json"));
  EXPECT_EQ(flip["schema"], "plan-flip");
  EXPECT_EQ(flip["iterations"].size(), 2u);
  EXPECT_EQ(flip["iterations"][0]["trials"].size(), 3u);
  EXPECT_EQ(flip["population"].size(), 27u);
  for (const char* file : {"path.png", "progress.png", "population.pdf", "path.md", "session.json"})
    EXPECT_TRUE(fs::exists(folder / "out" / file)) << file;

  // Means, errors, hits and figures are those of the throws.
  const json target = flip["target"];
  const auto off = [&](const json& landing, const char* key, const char* tolerance) {
    return (landing[key].get<double>() - target[key].get<double>()) / target[tolerance].get<double>();
  };
  const auto drawn = blocks_of(folder / "out/path.dat");
  const double degree = std::numbers::pi / 180;
  std::size_t shown = 0;
  json two_thirds;
  for (std::size_t i = 0; i < 2; ++i) {
    const json& one = flip["iterations"][i];
    double x = 0, angle = 0;
    int hits = 0;
    for (const auto& trial : one["trials"]) {
      const json& landing = trial["landing"];
      x += landing["x_m"].get<double>() / 3, angle += landing["angle_rad"].get<double>() / 3;
      hits += std::abs(off(landing, "x_m", "tolerance_x_m")) <= 1 &&
              std::abs(off(landing, "angle_rad", "tolerance_angle_rad")) <= 1;
      EXPECT_NEAR(drawn.at("throws").at(shown)[0], landing["x_m"].get<double>(), 1e-12);
      EXPECT_NEAR(drawn.at("throws").at(shown++)[1], landing["angle_rad"].get<double>() / degree, 1e-9);
    }
    EXPECT_NEAR(one["mean"]["x_m"].get<double>(), x, 1e-12);
    EXPECT_NEAR(one["mean"]["angle_rad"].get<double>(), angle, 1e-12);
    EXPECT_NEAR(one["error"].get<double>(),
                std::hypot(off(one["mean"], "x_m", "tolerance_x_m"),
                           off(one["mean"], "angle_rad", "tolerance_angle_rad")),
                1e-9);
    EXPECT_EQ(one["hits"], hits);
    if (two_thirds.is_null() && hits >= 2) two_thirds = i + 1;
    EXPECT_NEAR(drawn.at("means by iteration")[i][1], angle / degree, 1e-9);
    EXPECT_THAT(answer.out, testing::ContainsRegex(fmt::format(
                                "{} +{:.2f} +{:.4f} .* {:.3f} +{:.0f} ", i + 1,
                                one["trials"][0]["command"]["pitch_rad"].get<double>() / degree,
                                one["trials"][0]["command"]["speed"].get<double>(), x, angle / degree)));
  }
  EXPECT_EQ(flip["first_error"], flip["iterations"][0]["error"]);
  EXPECT_EQ(flip["iterations_to_two_thirds"], two_thirds);
  const auto progress = blocks_of(folder / "out/progress.dat").at("all");
  EXPECT_EQ(progress[0][0], 0);
  EXPECT_NEAR(progress[0][1], flip["initial_error"].get<double>(), 1e-9);
  double drawn_angles = 0, angles = 0;
  for (const auto& [title, rows] : blocks_of(folder / "out/population.dat"))
    for (const auto& row : rows) drawn_angles += row[1];
  for (const auto& trial : flip["population"])
    if (trial.contains("landing")) angles += trial["landing"]["angle_rad"].get<double>() / degree;
  EXPECT_NEAR(drawn_angles, angles, 1e-6);

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

  expect_refusal(
      what + "--learner m1", 2,
      "--report: out holds the throws of a run with --learner m2 and not m1: give the same to go on");
  expect_refusal("plan flip --target 1.3,190 --seed 3 --iterations 2 --repeats 1 --report out --learner m2",
                 2, "a run with --target 1.2,180 and not 1.3,190: ");
  expect_refusal(what + "--learner m2 --com-offset 0.1 --throws 4", 2,
                 "--throws 3 and not 4, another bar (--sku");
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
  auto flip = nlohmann::json::parse(content(folder / "flip.json"));
  EXPECT_EQ(flip["bar"]["com_offset_m"], 0.18);
  EXPECT_EQ(flip["known_bar"]["com_offset_m"], 0.12);
  EXPECT_EQ(flip["initial_error_is_seen"], false);

  std::ofstream(folder / "sku.toml") << "name = 'b'\nmass_kg = 0.3\ninertia_kg_m2 = 2e-3\n"
                                        "com_offset_m = 0.15\nsurface = 'printed'\n";
  const Answer sku = run(what + "--learner m4 --sku sku.toml");
  ASSERT_EQ(sku.code, 0) << sku.err;
  EXPECT_THAT(sku.out, HasSubstr("15.0 cm from the pads, known from 12 throws of another one (12.0 cm)"));
  auto learned = nlohmann::json::parse(content(folder / "flip.json"));
  EXPECT_EQ(learned["bar"]["mass_kg"], 0.3);
  // What was learned of the gripper and its pads answers for another object.
  std::ofstream(folder / "card.json") << learned["card"];
  std::ofstream(folder / "light.toml") << "name = 'c'\nmass_kg = 0.2\ninertia_kg_m2 = 1e-3\n"
                                          "com_offset_m = 0.08\nsurface = 'printed'\n";
  const Answer object = run("validate-sku light.toml --card card.json --json sku.json");
  ASSERT_EQ(object.code, 0) << object.err;
  EXPECT_THAT(object.out,
              HasSubstr("Beyond the card: mass is 0.2 kg; the card was fitted at 0.242 kg alone"));
  auto budget = nlohmann::json::parse(content(folder / "sku.json"))["budget"].dump();
  for (const char* of : {"\"mu\"", "\"length\"", "\"dead_time\"", "\"mu_deviation\"", "\"grasp_angle\""})
    EXPECT_THAT(budget, HasSubstr(of));
}

TEST_F(Cli, ThrowFlipRefusesWhatItCannotDo) {
  const std::string other = "plan flip --learner ", aim = other + "m2 --target 1.2,180 ";
  expect_refusal(other + "m2 --target 1.2", 2, "--target: '1.2' is not 2 numbers");
  expect_refusal(other + "m2 --target 5,180", 2, "--target: 5 m, 180 degrees; accepted: ");
  expect_refusal(other + "m2 --target -1,180", 2, "--target: -1 m, 180 degrees; accepted: ");
  expect_refusal(other + "m2 --target 1.2,900", 2, "--target: 1.2 m, 900 degrees; accepted: ");
  expect_refusal(other + "m5 --target 1.2,180", 2, "there is no 'm5' (there are: m1, m2, m3, m4)");
  expect_refusal(aim + "--seed abc", 2, "abc is not a whole number from 0 to");
  expect_refusal(aim + "--seed -1", 2, "-1 is not a whole number from 0 to");
  expect_refusal(aim + "--card card.json", 2, "--card: only --learner m4");
  expect_refusal(aim + "--com-offset 0.9", 1, "lands this bar with none of its commands");
  std::ofstream(folder / "heavy.toml") << "name = 'h'\nmass_kg = 5\ninertia_kg_m2 = 2e-2\n"
                                          "com_offset_m = 0.12\nsurface = 'printed'\n";
  expect_refusal(aim + "--sku heavy.toml", 1,
                 "whose friction is 39.6 N at most against its weight of 49.1 N");
  expect_refusal(aim + "--robot none.toml", 3, "none.toml");
  const auto robot_with = [&](const std::string& from, const std::string& to) {
    std::string text = content(fs::path(UNHAND_SOURCE_DIR) / "planners/flip/robot.toml");
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    std::ofstream(folder / "robot.toml") << text.replace(at, from.size(), to);
  };
  robot_with("window_s = 0.16", "window_s = 0.02");
  expect_refusal(aim + "--robot robot.toml", 1,
                 "it is not free within window_s = 0.02 s after the brake's start");
  robot_with("pose_rad = [0,", "pose_rad = [0.7,");
  expect_refusal(aim + "--robot robot.toml", 3,
                 "from y to the axis of panda_joint2 is 0.700; accepted: 0.000 to");
  std::ofstream(folder / "sku.toml") << "name = 'b'\nmass_kg = 0.3\ninertia_kg_m2 = 4e-7\n"
                                        "com_offset_m = 0.15\nsurface = 'printed'\n";
  expect_refusal(aim + "--sku sku.toml", 3,
                 "sku.toml: object: inertia_kg_m2: 4e-07 is outside [1e-06, 1] kg m^2");
  const Answer far = run(other + "m2 --target 1.8,360 --iterations 1");
  EXPECT_EQ(far.code, 0);
  EXPECT_THAT(far.err, HasSubstr("note: out of reach of the robot as declared"));
}

// What was seen of the bar's own throws is the error before, whoever learns from them.
TEST_F(Cli, ThrowFlipBeginsFromTheMeasuredError) {
  const auto before = [&](const std::string& learner) {
    EXPECT_EQ(
        run("plan flip --target 1.2,180 --seed 3 --iterations 1 --json f.json --learner " + learner).code, 0);
    const auto found = nlohmann::json::parse(content(folder / "f.json"));
    EXPECT_EQ(found["initial_error_is_seen"], true) << learner;
    EXPECT_LE(found["minimum_error"], found["initial_error"]);
    return found["initial_error"].get<double>();
  };
  EXPECT_EQ(before("m4"), before("m2"));
}

// Robot 1 throws two of three into the tolerances at once, and all of them the next time.
TEST_F(Cli, ThrowFlipTellsTwoThirdsFromAll) {
  const Answer answer = run("plan flip --target 1.2,180 --seed 1 --iterations 3 --learner m1 --json f.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json flip = read_json(folder / "f.json");
  int two_thirds = 0, all = 0, iteration = 0;
  for (const auto& one : flip["iterations"]) {
    ++iteration;
    if (two_thirds == 0 && one["hits"] >= 2) two_thirds = iteration;
    if (all == 0 && one["hits"] == 3) all = iteration;
  }
  ASSERT_LT(two_thirds, all) << "or this is no test of it";
  ASSERT_GT(two_thirds, 0);
  EXPECT_EQ(flip["iterations_to_two_thirds"], two_thirds);
  EXPECT_EQ(flip["iterations_to_all"], all);
  EXPECT_THAT(answer.out,
              HasSubstr(fmt::format("at least 2 of 3 first in iteration {}, all 3 first in iteration {}\n",
                                    two_thirds, all)));
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
  json out = read_json(folder / "a.json");
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
  EXPECT_THAT(with_log.out, HasSubstr("synthetic: simulated by unhand"));
  for (const char* column : {"lands at theta [deg]", "1 sigma theta [deg]", "mean shift theta [deg]"})
    EXPECT_THAT(with_log.out, HasSubstr(column));
  json judged = read_json(folder / "b.json");
  EXPECT_EQ(judged["candidates"].size(), 6u);  // the campaign's conditions, three for each of two objects
  EXPECT_EQ(judged["measured"]["n"], 6);
  // The tables say what the JSON does, in cm; what an input brings adds up in squares where nothing
  // correlates.
  const auto row = [](const std::vector<std::string>& cells) {
    std::string pattern;
    for (const auto& cell : cells) pattern += (pattern.empty() ? "" : " +") + cell;
    return testing::ContainsRegex(pattern);
  };
  double square = 0;
  for (const auto& line : out["budget"]) {
    const auto of = [&](const char* key) { return line[key].get<double>(); };
    square += of("landing_theta_deg") * of("landing_theta_deg");
    EXPECT_THAT(answer.out, row({fmt::format("{:.2f}", 100 * of("landing_x_m")),
                                 fmt::format("{:.2f}", of("landing_theta_deg")),
                                 fmt::format("{:.1f} %", 100 * of("share"))}));
  }
  EXPECT_NEAR(out["linear"]["landing_theta_deg"].get<double>(), std::sqrt(square), 1e-9);
  const Answer narrow =
      run("validate-sku bar.toml --card card.json --samples 200 --json n.json --tolerance 0.005,1");
  json spreads = read_json(folder / "n.json");
  for (const auto& [name, key] : {std::pair{"Monte Carlo", "monte_carlo"}, {"derivatives", "linear"}}) {
    const auto of = [&, &spread = spreads[key]](const char* what) { return spread[what].get<double>(); };
    EXPECT_THAT(narrow.out, row({name, fmt::format("{:.2f}", 100 * of("landing_x_m")),
                                 fmt::format("{:.2f} .*", of("landing_theta_deg")),
                                 fmt::format("{:.1f} %", 100 * of("within"))}));
  }
  EXPECT_NE(spreads["monte_carlo"]["within"], spreads["linear"]["within"]) << "drawn, and of a normal one";
  for (const auto& one : judged["candidates"])
    EXPECT_THAT(with_log.out, row({one["condition"].get<std::string>().substr(0, 20) + ".*",
                                   fmt::format("{:.2f}", 100 * one["sigma_x_m"].get<double>()),
                                   fmt::format("{:.2f}", one["sigma_theta_deg"].get<double>())}));
  const auto condition =
      std::find_if(judged["candidates"].begin(), judged["candidates"].end(),
                   [&](const json& one) { return one["condition"] == judged["condition"]; });
  ASSERT_NE(condition, judged["candidates"].end());
  EXPECT_EQ((*condition)["sigma_theta_deg"], judged["linear"]["landing_theta_deg"]);
  EXPECT_EQ((*condition)["sigma_x_m"], judged["linear"]["landing_x_m"]);
  const json& measured = judged["measured"];
  double mae = 0, bias = 0, z = 0;
  for (const auto& one : measured["throws"]) {
    const auto of = [&](const char* key) { return one[key].get<double>(); };
    mae += std::abs(of("error_theta_deg")) / 6, bias += of("error_x_m") / 6;
    z += (std::pow(of("error_x_m") / of("sigma_x_m"), 2) +
          std::pow(of("error_theta_deg") / of("sigma_theta_deg"), 2)) /
         12;
  }
  EXPECT_NEAR(measured["landing_theta_mae_deg"].get<double>(), mae, 1e-9);
  EXPECT_NEAR(measured["bias_x_m"].get<double>(), bias, 1e-12);
  EXPECT_NEAR(measured["rms_z"].get<double>(), std::sqrt(z), 1e-9);
  EXPECT_THAT(with_log.out, HasSubstr(fmt::format("{:.2f} deg in the mean of the absolute; bias {:+.2f} cm",
                                                  mae, 100 * bias)));

  // The verdict says where it rests on nothing that the card was tried on.
  EXPECT_THAT(answer.out,
              HasSubstr(out["verdict"].get<std::string>() +
                        ", provided that the card also holds for what it was not tried on: surface\n"));
  EXPECT_THAT(out["outside_valid_range"].dump(), HasSubstr("does not name those that it was fitted on"));
  json card = read_json(folder / "card.json");
  const auto outside = [&](const std::string& options) {
    std::ofstream(folder / "tried.json") << card.dump();
    EXPECT_EQ(run("validate-sku bar.toml --card tried.json --samples 200 --json t.json" + options).code, 0);
    return read_json(folder / "t.json")["outside_valid_range"].dump();
  };
  card["log"]["surfaces"] = {"glass", "steel"};
  EXPECT_THAT(outside(""),
              HasSubstr("surface 'printed' is none of those that the card was fitted on: glass"));
  EXPECT_EQ(outside(" --other-surface 0.2"), "[]");  // the spread allows for it
  card["log"]["surfaces"] = {"glass", "printed"};
  EXPECT_EQ(outside(""), "[]");
  card["valid_range"]["mass"] = {{"low", 0.1}, {"high", 0.2}, {"unit", "kg"}};
  EXPECT_THAT(outside(""), HasSubstr("mass is 0.246 kg, outside [0.1, 0.2] kg"));

  const std::string asked = "validate-sku bar.toml --card card.json ";
  expect_refusal(asked + "--tolerance 0.05", 2, "METRES,DEGREES");
  expect_refusal(asked + "--tolerance 0.05,-1", 2, "METRES,DEGREES");
  expect_refusal(asked + "--condition fast", 2, "--log");
  expect_refusal(asked + "--condition fast --log " + quick, 2, "there are");
  expect_refusal("validate-sku none.toml --card card.json", 3, "none.toml");
  expect_refusal("validate-sku bar.toml --card none.json", 3, "none.json");
  std::ofstream(folder / "bare.toml") << "name = 'x'\nmass_kg = 1\nsurface = 'steel'\n";
  expect_refusal("validate-sku bare.toml --card card.json --json c.json", 3, "inertia_kg_m2");

  // An inertia that no body of that mass and size has.
  const auto inertia = [&](const std::string& value) {
    std::ofstream(folder / "odd.toml")
        << "name = 'x'\nmass_kg = 0.246\nsurface = 'steel'\ninertia_kg_m2 = " << value;
    return "validate-sku odd.toml --card card.json --json c.json";
  };
  expect_refusal(inertia("12.1\n"), 3, "odd.toml: inertia_kg_m2: inertia is 12.1 kg m^2 for 0.246 kg");
  expect_refusal(inertia("1e-9\n"), 3, "or its inertia in another unit than kg m^2?");
  expect_refusal(inertia("1.21e-3\ndims_m = [0.04, 0.03, 0.02]\n"), 3,
                 "a body within its dims (a diagonal of 0.0539 m) has 0.0");
  expect_refusal("plan throw --target 1.3,0,-0.2 --sku odd.toml", 3, "odd.toml: inertia_kg_m2");
  expect_refusal("import hand-csv x.csv --sku odd.toml --out o.h5 --columns time=t", 3,
                 "odd.toml: inertia_kg_m2");
}

/// Table, JSON, CSV files and figures of one plan tell of one motion and of one set of landings. `along`: the
/// throw's level direction.
void expect_one_story(const Answer& answer, const json& plan, const fs::path& folder,
                      const std::array<double, 2>& along) {
  const auto close = [](double told, double is) { return std::abs(told - is) <= 1e-5 * (1 + std::abs(is)); };
  // Landings: moments, those in the box, and the table.
  const auto landings = columns_of(content(folder / "landings.csv"));
  const auto forward = numbers_of(landings.at("forward_m")), across = numbers_of(landings.at("across_m"));
  for (const auto& [name, told] : plan["predicted"].items()) {
    double n = 0, sum = 0, beside = 0, squares = 0, squares_beside = 0;
    int hits = 0;
    for (std::size_t i = 0; i < forward.size(); ++i) {
      if (landings.at("motion")[i] != name) continue;
      const double f = forward[i], a = across[i];
      ++n, sum += f, beside += a, squares += f * f, squares_beside += a * a;
      hits += std::abs(along[0] * f - along[1] * a) <= plan["box_m"][0].get<double>() / 2 &&
              std::abs(along[1] * f + along[0] * a) <= plan["box_m"][1].get<double>() / 2;
    }
    const double mean = sum / n, mean_beside = beside / n;
    EXPECT_EQ(told["landed"].get<double>(), n) << name;
    EXPECT_TRUE(close(told["mean_m"], mean) && close(told["mean_across_m"], mean_beside)) << name;
    EXPECT_TRUE(close(told["std_m"], std::sqrt(std::max(0.0, squares - n * mean * mean) / (n - 1)))) << name;
    EXPECT_TRUE(close(told["std_across_m"],
                      std::sqrt(std::max(0.0, squares_beside - n * mean_beside * mean_beside) / (n - 1))))
        << name;
    EXPECT_EQ(told["hits"], hits) << name;
    const double all = n + told["lost"].get<double>();
    EXPECT_THAT(answer.out, HasSubstr(fmt::format("{:.1f} %", 100 * hits / all))) << name;
  }
  // The motion: angles are integrals of rates, rates of accelerations, and at the command they are the
  // plan's.
  const auto rows = columns_of(content(folder / "trajectory.csv"));
  const auto time = numbers_of(rows.at("time_s"));
  EXPECT_LT(time.front(), -0.1);
  EXPECT_GE(time.back(), plan["window_s"].get<double>());
  const double most_velocity[]{2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61};
  double velocity = 0;
  for (int i = 0; i < 7; ++i) {
    const auto column = [&](const char* what, const char* unit) {
      return numbers_of(rows.at(fmt::format("{}{}_{}", what, i + 1, unit)));
    };
    const auto q = column("q", "rad"), qd = column("qd", "rad_s"), qdd = column("qdd", "rad_s2");
    std::size_t at_command = 0;
    for (std::size_t k = 0; k < time.size(); ++k) {
      velocity = std::max(velocity, std::abs(qd[k]) / most_velocity[i]);
      if (time[k] <= 0) at_command = k + 1;
      if (k == 0) continue;
      const double dt = time[k] - time[k - 1];
      ASSERT_NEAR(q[k] - q[k - 1], 0.5 * dt * (qd[k] + qd[k - 1]), 1e-5) << i << ' ' << time[k];
      ASSERT_NEAR(qd[k] - qd[k - 1], 0.5 * dt * (qdd[k] + qdd[k - 1]), 1e-2) << i << ' ' << time[k];
    }
    const double t = time[at_command], rate = plan["qd0_rad_s"][i], held = plan["qdd_rad_s2"][i];
    EXPECT_NEAR(q[at_command], plan["q0_rad"][i].get<double>() + t * (rate + 0.5 * t * held), 1e-6) << i;
    EXPECT_NEAR(qd[at_command], rate + t * held, 1e-5) << i;  // instants are told to a microsecond
    EXPECT_NEAR(qdd[at_command], held, 1e-6) << i;
  }
  EXPECT_NEAR(plan["limits"]["velocity"]["fraction"].get<double>(), velocity, 2e-3);
  std::vector<double> drawn(2, 0.0);
  const auto motion = blocks_of(folder / "motion.dat").at("use of the limits");
  for (const auto& row : motion)
    for (std::size_t k = 1; k < row.size(); ++k)
      drawn[(k - 1) / 7] = std::max(drawn[(k - 1) / 7], std::abs(row[k]));
  EXPECT_NEAR(drawn[0], velocity, 2e-3);
  EXPECT_NEAR(drawn[1], plan["limits"]["acceleration"]["fraction"].get<double>(), 0.02);
  std::string used;
  for (const char* limit : {"position", "velocity", "acceleration", "jerk", "torque"})
    used += fmt::format("{}{} {:.1f} %", used.empty() ? "" : ", ", limit,
                        100 * plan["limits"][limit]["fraction"].get<double>());
  EXPECT_THAT(answer.out, HasSubstr(used));
  // Releases over the window, in the figures too.
  const auto tube = blocks_of(folder / "tube.dat");
  for (const auto& [name, drawn_as] :
       {std::pair{"planned", "planned"}, {"no_acceleration", "no acceleration"}}) {
    const json& window = plan["window_landings"][name];
    double most = 0;
    for (std::size_t k = 0; k < window["time_s"].size(); ++k)
      most = std::max(most,
                      std::hypot(window["forward_m"][k].get<double>(), window["across_m"][k].get<double>()));
    EXPECT_NEAR(window["largest_miss_m"].get<double>(), most, 1e-12);
    const auto& last =
        tube.at(fmt::format("flight from {:.3f} s, {}", plan["window_s"].get<double>(), drawn_as)).back();
    EXPECT_NEAR(last[0], window["forward_m"].back().get<double>(), 1e-5) << name;
    EXPECT_NEAR(last[1], 0, 1e-9) << "at the box's height";
  }
  const double half = std::min(plan["box_m"][0].get<double>() / 2 / std::abs(along[0]),
                               plan["box_m"][1].get<double>() / 2 / std::abs(along[1]));
  EXPECT_NEAR(tube.at("box").back()[0], half, 1e-9);
}

/// The level direction of planar throws to kAskew.
constexpr const char* kAskew = "0.7,-0.9,-0.1";
const std::array<double, 2> kAlong{0.7 / std::hypot(0.7, 0.9), -0.9 / std::hypot(0.7, 0.9)};

// A box that is narrow one way, thrown into askew.
TEST_F(Cli, OutputsOfAPlannedThrowAgree) {
  const std::string plan = std::string("plan throw --target ") + kAskew +
                           " --box 0.03x0.2 --planar --samples 300 --draws 60 --json p.json ";
  const Answer answer = run(plan + "--report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const json told = read_json(folder / "p.json");
  EXPECT_EQ(told["box_m"], json({0.03, 0.2}));
  expect_one_story(answer, told, folder / "out", kAlong);
  EXPECT_LT(told["predicted"]["Tube-CVX"]["hits"].get<int>() +
                told["predicted"]["no acceleration"]["hits"].get<int>(),
            120)
      << "some miss the narrow box";
  // Upward by the slope of the first flight's parabola, from its first three points.
  const auto flight = blocks_of(folder / "out/tube.dat").at("flight from 0.000 s, planned");
  const double slope = (4 * flight[1][1] - 3 * flight[0][1] - flight[2][1]) / (flight[2][0] - flight[0][0]);
  EXPECT_THAT(answer.out,
              HasSubstr(fmt::format(", {:.1f} deg upward", std::atan(slope) * 180 / std::numbers::pi)));
  const auto window = blocks_of(folder / "out/landings.dat");
  const json& forward = told["window_landings"]["tube_cvx"]["forward_m"];
  ASSERT_EQ(window.at("Tube-CVX").size(), forward.size());
  for (std::size_t k = 0; k < forward.size(); ++k) {
    EXPECT_NEAR(window.at("Tube-CVX")[k][0],
                1e3 * told["window_landings"]["tube_cvx"]["time_s"][k].get<double>(), 1e-9);
    EXPECT_NEAR(window.at("Tube-CVX")[k][1], 100 * forward[k].get<double>(), 1e-9);
  }
  // Without refinement what is planned is Tube-CVX's.
  EXPECT_NE(told["qdd_rad_s2"], told["qdd_tube_cvx_rad_s2"]);
  ASSERT_EQ(run(plan + "--tube-cvx").code, 0);
  const json plain = read_json(folder / "p.json");
  EXPECT_EQ(plain["qdd_rad_s2"], plain["qdd_tube_cvx_rad_s2"]);
}

void write_bar(const fs::path& file, double mass, double com_offset) {
  std::ofstream(file) << fmt::format(
      "name='bar'\nsurface='paper'\nmass_kg={}\ncom_offset_m={}\ncom_offset_sigma_m=0.004\ninertia_kg_m2={}"
      "\n",
      mass, com_offset, 0.01 * mass);
}

TEST_F(Cli, OutputsOfAThrowWithACardAgree) {
  write_pivot_card(folder / "card.json", 80, 0.03);
  write_bar(folder / "bar.toml", 0.25, 0.12);
  const std::string plan = std::string("plan throw --target ") + kAskew +
                           " --box 0.015x0.2 --samples 300 --draws 60 --card card.json --json "
                           "p.json ";
  const Answer answer = run(plan + "--sku bar.toml --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json told = read_json(folder / "p.json");
  expect_one_story(answer, told, folder / "out", kAlong);
  EXPECT_NEAR(told["window_s"].get<double>(), std::max(0.1, 0.02 + 0.06 + 4 * std::hypot(0.003, 0.004)),
              1e-12);
  json& release = told["release"];
  // sigma² = Σ (∂x/∂θ σ)² with the sigmas that the table tells; of the grasp both that of SKU and card.
  EXPECT_DOUBLE_EQ(release["numbers"]["com_offset"]["sigma"], 0.005);  // 3, 4, 5
  EXPECT_EQ(told["motion"], "insensitive motion");
  for (const char* when : {"before", "after"}) {
    double square = 0;
    for (const auto& [name, derivative] : release[when]["derivatives"].items())
      if (const json& sigma = release["numbers"][name]["sigma"]; sigma.is_number())
        square += std::pow(derivative.get<double>() * sigma.get<double>(), 2);
    EXPECT_NEAR(release[when]["sigma_m"].get<double>(), std::sqrt(square), 1e-9) << when;
  }
  EXPECT_EQ(release["before"]["miss_m"], release["contact_model"]["miss_m"]);
  EXPECT_LT(release["after"]["sigma_m"], release["before"]["sigma_m"]);
  EXPECT_EQ(release["carried_rigidly"]["detach_time_s"], release["contact_model"]["detach_time_s"]);
  EXPECT_NE(release["carried_rigidly"]["miss_m"], release["contact_model"]["miss_m"]);
  // Landings of the motion that is planned, in both figures.
  const json& predicted = told["predicted"]["insensitive motion"];
  const auto mean = blocks_of(folder / "out/tube.dat").at("landings that the card predicts").front();
  EXPECT_NEAR(mean[0], predicted["mean_m"].get<double>(), 1e-9);
  EXPECT_NEAR(mean[2], predicted["std_m"].get<double>(), 1e-9);
  double shares = 0, middle = 0;
  const auto bins = blocks_of(folder / "out/landings.dat").at("insensitive motion");
  for (const auto& bin : bins) shares += bin[1], middle += bin[0] * bin[1] / 100;
  EXPECT_NEAR(shares, 100, 1e-6);
  EXPECT_NEAR(middle, 100 * predicted["mean_m"].get<double>(), 1);  // cm, of bins
}

// In air, and held at its middle, an object lands where the plan aims; a slow gripper takes a longer window.
TEST_F(Cli, AThrowWithACardKnowsItsAirAndItsGripper) {
  write_pivot_card(folder / "card.json", 80, 0.03, 0.06);
  write_bar(folder / "bar.toml", 0.25, 0.0);
  const std::string plan =
      "plan throw --target 1.1,0,0 --samples 600 --draws 20 --card card.json --json p.json ";
  const Answer answer = run(plan + "--sku bar.toml --drag 0.1");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json told = read_json(folder / "p.json");
  EXPECT_NEAR(told["window_s"].get<double>(), 0.06 + 0.06 + 4 * std::hypot(0.003, 0.004), 1e-12);
  EXPECT_LT(std::abs(told["release"]["contact_model"]["miss_m"].get<double>()), 0.03);
  EXPECT_LT(std::abs(told["predicted"][told["motion"].get<std::string>()]["mean_m"].get<double>()), 0.03);
}

// Where its centre of mass is between the pads, it flies as one that is carried rigidly, in thick air too.
TEST_F(Cli, TheCardsReleaseFliesInTheSameAirAsThePlan) {
  write_pivot_card(folder / "card.json", 80, 0.03);
  write_bar(folder / "bar.toml", 0.25, 0.0);
  const Answer answer =
      run("plan throw --target 1.1,0,0 --samples 600 --draws 20 --drag 0.3 --card card.json "
          "--sku bar.toml --json p.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json told = read_json(folder / "p.json");
  const double due = told["release"]["contact_model"]["detach_time_s"],
               mean = told["predicted"][told["motion"].get<std::string>()]["mean_m"];
  const json& window = told["window_landings"]["planned"];
  int near = 0;
  for (std::size_t k = 0; k < window["time_s"].size(); ++k) {
    if (std::abs(window["time_s"][k].get<double>() - due) > 0.011) continue;
    ++near;
    EXPECT_NEAR(window["forward_m"][k].get<double>(), mean, 0.01);
  }
  EXPECT_GE(near, 3);
}

// The plan turns with its target about the vertical, and what it asks of the card with it.
TEST_F(Cli, TheSpeedsOfARelease) {
  write_pivot_card(folder / "card.json", 80, 0.03);
  json card = read_json(folder / "card.json");
  card["valid_range"]["release_speed"] = {{"low", 50}, {"high", 60}, {"unit", "m/s"}};
  card["valid_range"]["release_omega"] = {{"low", 50}, {"high", 60}, {"unit", "rad/s"}};
  std::ofstream(folder / "tried.json") << card;
  write_bar(folder / "bar.toml", 0.25, 0.1);
  for (const char* target : {"1,0,-0.2", "0,1,-0.2", "-0.6,-0.8,-0.2"}) {
    const Answer answer =
        run("plan throw --samples 100 --draws 20 --card tried.json --sku bar.toml --json "
            "p.json --target=" +
            std::string(target));
    ASSERT_EQ(answer.code, 0) << answer.err;
    json told = read_json(folder / "p.json");
    std::smatch found;
    const std::string outside = told["release"]["outside_valid_range"].dump();
    ASSERT_TRUE(std::regex_search(outside, found, std::regex("release_speed is ([-0-9.e]+) m/s"))) << outside;
    const double speed = std::stod(found[1]);
    ASSERT_TRUE(std::regex_search(outside, found, std::regex("release_omega is ([-0-9.e]+) rad/s")));
    const double omega = std::stod(found[1]);
    EXPECT_NEAR(speed, told["release"]["carried_rigidly"]["speed_m_s"].get<double>(), 0.2 * speed) << target;
    // Joints 2, 4 and 6 pitch the hand forward, back and back: positive is from forward to up.
    const auto rate = [&](std::size_t i) { return told["qd0_rad_s"][i].get<double>(); };
    EXPECT_NEAR(omega, -(rate(1) - rate(3) - rate(5)), 1e-3 * std::abs(omega)) << target;
    EXPECT_GT(std::abs(omega), 0.1);
  }
}

// What a refusal says of the grip is the least that will do.
TEST_F(Cli, TheGripThatIsAskedForHolds) {
  write_bar(folder / "bar.toml", 0.25, 0.1);
  const auto plan = [&](double grip_force) {
    write_pivot_card(folder / "card.json", grip_force, 0.03);
    return run("plan throw --target 1.3,0,-0.2 --samples 100 --draws 20 --card card.json --sku bar.toml");
  };
  const Answer weak = plan(3);
  EXPECT_EQ(weak.code, 1);
  std::smatch found;
  ASSERT_TRUE(std::regex_search(weak.err, found, std::regex("needs at least ([0-9.]+) N per pad")))
      << weak.err;
  const double least = std::stod(found[1]);
  EXPECT_EQ(plan(0.97 * least).code, 1);
  EXPECT_EQ(plan(1.03 * least).code, 0);
}

// A grip that holds the nominal object and hardly more drops draws on the way; twice the object needs about
// twice the grip.
TEST_F(Cli, DrawsThatSlipOnTheWayAreLost) {
  const std::string plan =
      "plan throw --target 1.3,0,-0.2 --samples 300 --draws 100 --card card.json --json p.json ";
  const auto needed = [&](double mass) {
    write_pivot_card(folder / "card.json", 300, 0.03);
    write_bar(folder / "bar.toml", mass, 0.1);
    EXPECT_EQ(run(plan + "--sku bar.toml").code, 0);
    return read_json(folder / "p.json")["release"]["needed_grip_force_N"].get<double>();
  };
  const double heavy = needed(0.4), light = needed(0.2);
  EXPECT_NEAR(heavy / light, 2, 0.4);  // another motion
  int kept = 0;
  for (const double share : {1.2, 0.8}) {  // of what the strong grip's motion needs
    write_pivot_card(folder / "card.json", share * light, 0.08);
    const Answer weak = run(plan + "--sku bar.toml");
    ASSERT_EQ(weak.code, 0) << weak.err;
    json told = read_json(folder / "p.json");
    const json& predicted = told["predicted"][told["motion"].get<std::string>()];
    EXPECT_GT(predicted["lost"], 0);
    EXPECT_EQ(predicted["landed"].get<int>() + predicted["lost"].get<int>(), 100);
    EXPECT_THAT(weak.out, HasSubstr(fmt::format("{:.1f} %", predicted["hits"].get<double>())));
    for (const auto& [name, other] : told["predicted"].items())
      EXPECT_LE(other["hits"], predicted["hits"]) << name;
    if (told["motion"] != "tube acceleration") continue;
    ++kept;
    EXPECT_THAT(weak.err, HasSubstr("that is kept"));
    // Carried rigidly until then, it lands as the window's landings do.
    const json &rigid = told["release"]["carried_rigidly"], &window = told["window_landings"]["planned"];
    for (std::size_t k = 1; k < window["time_s"].size(); ++k) {
      const double before = window["time_s"][k - 1], after = window["time_s"][k], t = rigid["detach_time_s"];
      if (t < before || t > after) continue;
      EXPECT_NEAR(rigid["miss_m"].get<double>(),
                  std::lerp(window["forward_m"][k - 1].get<double>(), window["forward_m"][k].get<double>(),
                            (t - before) / (after - before)),
                  1e-3);
    }
  }
  EXPECT_EQ(kept, 1);
}

// Two robots without repetitions: numbers, table and figures are those of the same throws.
TEST_F(Cli, OutputsOfControlledThrowsAgree) {
  const Answer answer = run("plan control --seeds 2 --repetitions 0 --box 0.012 --json c.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json cells = read_json(folder / "c.json")["cells"];
  ASSERT_EQ(cells.size(), 12u);
  const auto landings = blocks_of(folder / "out/landings.dat");
  EXPECT_NEAR(landings.at("box")[1][0], 0.6, 1e-12);  // cm
  int hit = 0;
  for (json& cell : cells) {
    const auto& rows =
        landings.at(cell["object"].get<std::string>() + ", " + cell["controller"].get<std::string>());
    ASSERT_EQ(rows.size(), 2u);
    int hits = 0;
    double square = 0;
    for (const auto& row : rows) {
      hits += std::abs(row[0]) <= 0.6 && std::abs(row[1]) <= 0.6;
      square += row[0] * row[0] + row[1] * row[1];
    }
    hit += hits;
    EXPECT_EQ(cell["hits"], hits);
    for (int axis = 0; axis < 2; ++axis) {
      EXPECT_NEAR(cell["mean_m"][axis].get<double>(), 0.005 * (rows[0][axis] + rows[1][axis]), 1e-9);
      EXPECT_NEAR(cell["std_m"][axis].get<double>(),
                  0.01 * std::abs(rows[0][axis] - rows[1][axis]) / std::sqrt(2.0), 1e-9);
      EXPECT_GT(cell["std_m"][axis].get<double>(), 0) << "the robots differ";
    }
    EXPECT_NEAR(cell["rms_m"].get<double>(), 0.01 * std::sqrt(square / 2), 1e-9);
    EXPECT_THAT(answer.out, HasSubstr(fmt::format("  {:.1f}  ", 1e3 * cell["rms_m"].get<double>())));
  }
  EXPECT_GT(hit, 0);
  EXPECT_LT(hit, 24);
  // The record of the last object ends at its release, with the errors that are told of it.
  const auto errors = blocks_of(folder / "out/errors.dat");
  for (std::size_t k = 8; k < 12; ++k) {
    const auto& record = errors.at(cells[k]["controller"].get<std::string>());
    EXPECT_LT(record.back()[0], 0.75) << "s: nothing is repeated";
    const auto near = [](double told, double drawn) { return told < 1.6 * drawn && drawn < 1.6 * told; };
    EXPECT_TRUE(near(cells[k]["release_velocity_error_m_s"], record.back()[2])) << cells[k];
    if (cells[k]["controller"] == "plain, 30 N/m") {
      EXPECT_TRUE(near(cells[k]["release_position_error_m"], record.back()[1] / 100)) << cells[k];
    }
  }
}

}  // namespace
}  // namespace unhand::cli
