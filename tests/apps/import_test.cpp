// import: a lab's own files and phones.
#include "tests/apps/cli.hpp"
#include "tests/apps/lab_files.hpp"
#include "tests/datasets/hdf5_tools.hpp"

namespace unhand::cli {
namespace {

TEST_F(Cli, ImportsTheFilesOfALab) {
  write_lab_files(folder);
  const std::string hand =
      "hand-csv hand/slow_01.csv hand/slow_02.csv --columns "
      "time=t,x=X,z=Z,theta=pitch,vx=VX,vz=VZ,omega=Q,ax=AX,az=AZ,alpha=DQ --units "
      "time=ms,x=mm,z=mm,theta=deg,vx=m/s,vz=m/s,omega=deg/s,ax=m/s^2,az=m/s^2,alpha=deg/s^2 ";
  const std::string ft =
      "ft-csv ft/slow_01.csv ft/slow_02.csv --columns time=t,fx=-Fx,fz=-Fz,tau=Ty,normal=Fy ";
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
  EXPECT_EQ(log.title, "imported from hand-csv, ft-csv, motive-csv");
  for (const char* format : {"hand-csv", "ft-csv", "motive-csv"})
    EXPECT_THAT(log.source, HasSubstr(format)) << "all that was merged";
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

  {  // what the layout does not know stays
    const datasets::test::Editor f((folder / "full.h5").string());
    f.text("/", "operator", "somebody");
    f.doubles("/throws/slow_01/ft/temperature", {1}, {20}, "K");
  }
  expect_refusal("import " + ft + "--into full.h5", 3,
                 "full.h5: /throws/slow_01/ft: is there already: --replace");
  EXPECT_EQ(run("import " + ft + "--into full.h5 --replace").code, 0);
  {
    const datasets::test::Editor f((folder / "full.h5").string());
    EXPECT_GT(H5Aexists(f.file, "operator"), 0);
    EXPECT_GT(H5Lexists(f.file, "/throws/slow_01/ft/temperature", H5P_DEFAULT), 0);
  }
  expect_refusal("import " + ft + "--into none.h5", 3, "none.h5");

  // Throws of a second object: split among themselves, and then filled like the others.
  std::string hand_of_jar = hand, ft_of_jar = ft;
  for (const char* name : {"slow_01", "slow_02"})
    for (const char* kind : {"hand", "ft"}) {
      const std::string to = std::string(kind) + "/jar-" + name + ".csv";
      std::filesystem::copy_file(folder / kind / (std::string(name) + ".csv"), folder / to);
      std::string& step = kind[0] == 'h' ? hand_of_jar : ft_of_jar;
      step.replace(step.find(std::string(kind) + "/slow"), 12 + std::string(kind).size(), to);
    }
  const std::string another = "--into full.h5 --mass 0.4 --object jar --test-every 2 --out both.h5";
  const Answer both = run("import " + hand_of_jar + another);
  ASSERT_EQ(both.code, 0) << both.err;
  EXPECT_THAT(both.out, HasSubstr("4 throws (2 train, 2 test)"));
  ASSERT_EQ(run("import " + ft_of_jar + "--into both.h5").code, 0);
  const auto grown = datasets::read_throw_log(folder / "both.h5");
  ASSERT_EQ(grown.throws.size(), 4u);
  EXPECT_EQ(grown.objects.at("jar").mass, 0.4);
  for (const auto& throw_of : grown.throws) {
    EXPECT_EQ(throw_of.object == "jar", throw_of.id.starts_with("jar-")) << throw_of.id;
    EXPECT_TRUE(throw_of.hand && throw_of.ft) << throw_of.id;
  }
  expect_refusal("import " + hand_of_jar + "--into full.h5 --mass 0.4 --object bar --out no.h5", 3,
                 "full.h5: /objects/bar: is there already with other declarations");
  expect_refusal("import " + ft + "--into full.h5 --throw slow_01", 2, "--throw goes with one input");
  expect_refusal("import " + ft + "--into full.h5 --gravity 9.8", 2, "--gravity is for a new log");
  expect_refusal("import " + ft + "--into full.h5 --test-every 2", 2,
                 "--test-every is for throws that full.h5 does not have");
  expect_refusal("import " + ft + "--into full.h5 --sku bar.toml", 3, "there is already a throw 'slow_01'");
  expect_refusal("import " + ft + "--into full.h5 --sku bar.toml --replace", 2, "without a new object");
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

// A campaign of plain CSV files alone is as good as one of Motive's.
TEST_F(Cli, ImportsATrackFromAnyCsv) {
  write_lab_files(folder);
  fs::create_directories(folder / "mocap");
  for (const std::string name : {"slow_01", "slow_02"}) {
    std::ofstream track(folder / "mocap" / (name + ".csv"));
    track << "t (s),X (mm),Z (mm),pitch (deg)\n";
    for (int k = 0; k < 240; ++k) {
      const double t = k / 240.0, fall = std::max(0.0, t - 0.15);
      track << t << ',';
      if (k == 20)
        track << ",,\n";
      else
        track << 500 + 1500 * t << ',' << 800 + 1500 * t - 500 * 9.81 * fall * fall << ','
              << (0.26 + 4 * fall) * 180 / std::numbers::pi << '\n';
    }
  }
  const std::string hand =
      "hand-csv hand/slow_01.csv hand/slow_02.csv --columns "
      "time=t,x=X,z=Z,theta=pitch,vx=VX,vz=VZ,omega=Q,ax=AX,az=AZ,alpha=DQ --units "
      "time=ms,x=mm,z=mm,theta=deg,vx=m/s,vz=m/s,omega=deg/s,ax=m/s^2,az=m/s^2,alpha=deg/s^2 ";
  const std::string mocap =
      "mocap-csv mocap/slow_01.csv mocap/slow_02.csv --columns time=t,x=X,z=Z,theta=pitch --sigma "
      "x=0.2,z=0.2,theta=0.2 --landing ";
  ASSERT_EQ(run("import " + hand + "--sku bar.toml --opening-time 0.1 --test-every 2 --out log.h5").code, 0);
  ASSERT_EQ(run("import ft-csv ft/slow_01.csv ft/slow_02.csv --columns "
                "time=t,fx=-Fx,fz=-Fz,tau=Ty,normal=Fy --into log.h5")
                .code,
            0);
  const Answer answer = run("import " + mocap + "--into log.h5 --json a.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out, HasSubstr("throw slow_01, 240 samples, 0 to 0.995833 s, 1 lost, lands at"));
  EXPECT_EQ(read_json(folder / "a.json")["files"][0]["lost"], 1);
  const auto log = datasets::read_throw_log(folder / "log.h5");
  const datasets::Throw& one = log.throws[0];
  EXPECT_FALSE(one.mocap->is_valid(20));
  EXPECT_NEAR(one.mocap->pose(0, 2), 0.26, 1e-6);
  EXPECT_NEAR(one.landing->pose(0, 0), 0.5 + 1.5 * one.landing->time(0), 1e-5);
  EXPECT_EQ(run("compare log.h5 --models gripper_delay").code, 0);

  EXPECT_EQ(run("import " + mocap + "--mass 0.25 --out flights.h5 --test-every 2").code, 0);  // no hand
  EXPECT_EQ(datasets::read_throw_log(folder / "flights.h5").dimension, 2);
  expect_refusal("import " + mocap + "--into log.h5 --heading 3", 2, "--heading is not for mocap-csv");
  expect_refusal("import " + mocap + "--into '" + flights + "' --out a.h5", 3,
                 "/@dimension: is 3, and mocap-csv is for planar logs");
  expect_refusal("import mocap-csv mocap/slow_01.csv --mass 1 --out a.h5 --columns time=t,x=X", 2,
                 "'z' is missing (needed: time, x, z, theta)");
  expect_refusal(
      "import mocap-csv mocap/slow_01.csv --mass 1 --out a.h5 --columns time=t,x=X,z=Y,theta=pitch", 3,
      "mocap/slow_01.csv: line 1: there is no column 'Y' for z");
}

// A planar log of a throw that was seen from the side is its shadow.
TEST_F(Cli, AHeadingThatTheTrackContradictsIsRefused) {
  write_lab_files(folder);
  const std::string motive =
      "import motive-csv takes/slow_01.csv takes/slow_02.csv --dimension 2 --mass 1 --out a.h5 --test-every "
      "2 ";
  expect_refusal(
      motive + "--heading 70", 3,
      "takes/slow_01.csv: rigid body bar, columns Position: the body flies 1.32 m along a heading of 0.0 "
      "deg, 70.0 deg from --heading 70: up to 15 deg are accepted");
  expect_refusal(motive + "--heading 70", 3, "--heading 0.0? --trust-heading takes it as it is");
  const auto notes = [&](const std::string& heading) {
    const Answer answer = run(motive + "--json a.json --heading " + heading);
    EXPECT_EQ(answer.code, 0) << answer.err;
    EXPECT_EQ(read_json(folder / "a.json")["notes"].empty(), answer.err.empty());
    return answer.err;
  };
  EXPECT_EQ(notes("0"), "");
  EXPECT_EQ(notes("2"), "");
  EXPECT_THAT(notes("10"), HasSubstr("10.0 deg from --heading 10; x is too short by 1.5 %: --heading 0.0?"));
  EXPECT_THAT(notes("180"), HasSubstr("it goes backwards"));
  EXPECT_THAT(notes("70 --trust-heading"), HasSubstr("x is too short by 65.8 %: --heading 0.0?"));
  EXPECT_THAT(notes("70 --gravity 25"), HasSubstr("no free flight is seen of 0.1 s or longer: --heading "
                                                  "is not checked; --free-flight T0,T1 says where it is"));
  EXPECT_EQ(read_json(folder / "a.json")["files"][0]["run_m"], nullptr);
  const std::string one = "import motive-csv takes/slow_01.csv --dimension 2 --mass 1 --out a.h5 ";
  EXPECT_THAT(run(one + "--free-flight 2,3").err, HasSubstr("in --free-flight (fewer than two frames)"));
  expect_refusal(one + "--free-flight 0.4,0.8 --heading 70", 3, "the body flies 0.60 m");
}

// Fewer throws than are held out of: discover would have nothing to judge by.
TEST_F(Cli, SaysThatNothingIsHeldOut) {
  write_lab_files(folder);
  const std::string motive = "import motive-csv takes/slow_01.csv takes/slow_02.csv --mass 1 --out a.h5 ";
  EXPECT_THAT(
      run(motive).err,
      HasSubstr("no throw is held out: --test-every 5 holds out one in 5 throws of a condition, and no "
                "condition has more than 2 throws"));
  EXPECT_THAT(run(motive).err, HasSubstr("need some: --test-every 2, or more throws"));
  EXPECT_THAT(run(motive + "--test-conditions slow").err, HasSubstr("all throws are held out"));
  EXPECT_EQ(run(motive + "--test-every 2").err, "");
}

TEST_F(Cli, ImportsTossesOfAnotherCube) {
  std::ofstream tosses(folder / "t.csv");
  tosses << "toss,k,t_s,x_m,y_m,z_m,qw,qx,qy,qz,vx,vy,vz,wx_body,wy_body,wz_body,before_first_contact\n";
  for (int toss = 0; toss < 5; ++toss)
    for (int k = 0; k < 12; ++k) {
      const double t = 0.01 * k;
      tosses << toss << ',' << k << ',' << t << ',' << t << ",0," << 0.6 + t - 4.905 * t * t
             << ",1,0,0,0,0,0,0,0,0,0," << (k < 11) << '\n';
    }
  tosses.close();
  const std::string what = "import cube-tosses t.csv --out cubes.h5 ";
  ASSERT_EQ(run(what + "--cube-side 0.06 --cube-mass 0.1").code, 0);
  const auto log = datasets::read_throw_log(folder / "cubes.h5");
  const datasets::Object& cube = log.objects.at("cube");
  EXPECT_EQ(cube.mass, 0.1);
  EXPECT_NEAR(log.landing_height, 0.06 * std::sqrt(0.75), 1e-12);
  for (const double inertia : *cube.inertia) EXPECT_NEAR(inertia, 0.1 * 0.06 * 0.06 / 6, 1e-15);
  EXPECT_THAT(log.source, testing::Not(HasSubstr("DAIRLab")));
  EXPECT_EQ(run(what + "--cube-side 0.06 --cube-mass 0.1 --cube-inertia 7e-5").code, 0);
  EXPECT_EQ(datasets::read_throw_log(folder / "cubes.h5").objects.at("cube").inertia->at(1), 7e-5);
  expect_refusal("import cube-tosses t.csv --out a.h5 --cube-side 0.06", 2, "--cube-side and --cube-mass");
  expect_refusal("import phyphox t.csv --mass 1 --out a.h5 --cube-side 0.06", 2, "are not for phyphox");
}

TEST_F(Cli, AnotherBlockThatIsPushedIsDeclaredWhole) {
  const std::string what = "import planar-pushes p.txt --out a.h5 ";
  expect_refusal(what + "--block-mass 1", 2, "--block-outline and --block-mass");
  expect_refusal(what + "--block-mass 1 --block-outline 0,0,0.1", 2, "not pairs X,Y");
  expect_refusal(what + "--block-mass 1 --block-outline 0,0,0,0.1,0.1,0", 2, "counter-clockwise at corner 2");
  expect_refusal("import cube-tosses t.csv --out a.h5 --block-mass 1", 2, "are not for cube-tosses");
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
  EXPECT_THAT(answer.err, HasSubstr("no throw is held out"));
  EXPECT_THAT(answer.err, Not(HasSubstr("outside of falls")));
  const Answer elsewhere = run("import phyphox fall_1.csv --mass 0.2 --out a.h5 --gravity 3.7");
  EXPECT_THAT(elsewhere.err, HasSubstr("fall_1.csv: outside of falls the phone reads 9.8 m/s^2 (median), and "
                                       "held still it would read 3.7"));
  expect_refusal("discover falls.h5 --model free_fall", 1,
                 "no throw has the split 'test', of 1: effects are found on train");
}

}  // namespace
}  // namespace unhand::cli
