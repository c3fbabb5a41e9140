// compare and fit on a log of slips: what they write is what the library says of these slips.
#include <regex>

#include "contact/convex_quartic.hpp"
#include "datasets/model_card.hpp"
#include "fitting/slips/compare_surfaces.hpp"
#include "tests/apps/cli.hpp"
#include "tests/fitting/slip_simulator.hpp"

namespace unhand::cli {
namespace {

/// Simulated slips as a log has them: one row each, with the torque and the spin in SI.
datasets::Surface logged(const fitting::SlipSamples& slips) {
  const double length = slips.characteristic_length;
  datasets::Surface out{1.0, length, "simulated", {}, {}};
  for (const auto& [w, u, slip, speed] : slips.samples) {
    std::string id = std::to_string(1000 + slip);  // in order of id
    out.slips.push_back({std::move(id),
                         datasets::Split::train,
                         {1, 1, {0}, {}},
                         {1, 3, {w[0], w[1], w[2] * length}, {}},
                         {1, 3, {u[0], u[1], u[2] / length}, {}}});
  }
  return out;
}

// Names of surfaces are text of whoever made the log.
TEST_F(Cli, SurfacesMayHaveAnyName) {
  datasets::SlipLog log;
  const Eigen::Matrix3d along = Eigen::Vector3d(1 / 16.0, 1 / 9.0, 1 / 25.0).asDiagonal();
  const auto slips = logged(fitting::test::simulate(fitting::test::ellipsoid(along), 12, 0.1, 0.1, 21));
  const std::string names[] = {"John's felt", "a'; system('touch called'); b='", "felt",
                               "Über `touch called`"};
  for (const auto& name : names) log.surfaces[name] = slips;
  datasets::write_slip_log(folder / "slips.h5", log);
  const Answer answer = run("compare slips.h5 --models ellipsoid --fit --report r");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const std::string report = content(folder / "r/report.md");
  std::set<std::string> sections;
  for (const auto& file : files()) {
    EXPECT_NE(fs::path(file).filename(), "called") << "a name ran as a command";
    if (file.starts_with("r/section_") && file.ends_with(".png")) sections.insert(file.substr(2));
  }
  EXPECT_EQ(sections.size(), 4u);
  EXPECT_TRUE(sections.contains("section_felt.png"));
  for (const auto& picture : sections) EXPECT_THAT(report, HasSubstr("](" + picture + ")"));
  for (const auto& name : names)
    EXPECT_THAT(report, HasSubstr(std::regex_replace(name, std::regex("`"), "\\`")))
        << "as Markdown shows it";
}

TEST_F(Cli, SlipsAreComparedByFitting) {
  datasets::SlipLog log;
  const Eigen::Matrix3d along = Eigen::Vector3d(1 / 16.0, 1 / 9.0, 1 / 25.0).asDiagonal();
  log.surfaces["felt"] = logged(fitting::test::simulate(fitting::test::ellipsoid(along), 12, 0.1, 0.1, 21));
  datasets::write_slip_log(folder / "slips.h5", log);
  expect_refusal("compare slips.h5", 2, "slips.h5 is a slip-log");
  expect_refusal("compare slips.h5 --models ellipsoid", 2, "add --fit");
  expect_refusal("compare slips.h5 --models sliding_pivot", 3,
                 "which sliding_pivot does not predict; there are ellipsoid, ");
  const Answer folds = run("fit slips.h5 --model ellipsoid --kfold 100 --json f.json");
  EXPECT_EQ(folds.code, 0) << folds.err;
  EXPECT_THAT(folds.err, HasSubstr("unhand: --kfold 100: 12 folds, as many as a surface has slips\n"));
  EXPECT_EQ(read_json(folder / "f.json")["folds"], 12);
}

// Slips declare no noise: what is left of them is an angle and a correlation, and no chi2.
TEST_F(Cli, WhatIsLeftOfSlipsHasItsOwnUnits) {
  datasets::SlipLog log;
  const auto truth = fitting::test::quartic(contact::ConvexQuartic::isotropic_blend(2.8), 4.0);
  log.surfaces["felt"] = logged(fitting::test::simulate(truth, 60, 0.05, 0.03, 22));
  datasets::write_slip_log(folder / "slips.h5", log);
  const Answer answer =
      run("discover slips.h5 --model ellipsoid --forget contact.law:convex_quartic --forget "
          "contact.law:ellipsoid_full --json d.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json found = read_json(folder / "d.json");
  ASSERT_EQ(found["verdict"], "unexplained");
  EXPECT_TRUE(found["unexplained"]["chi2_per_dof"].is_null());
  EXPECT_GT(found["unexplained"]["correlation"], 0.15);
  EXPECT_TRUE(found["first_misfit"]["chi2_per_sample"].is_null());
  EXPECT_EQ(found["misfit"][0]["unit"], "deg");
}

// The wrench that the surface applies to the object, in place of the one that the object applies.
TEST_F(Cli, SlipsWithAReversedSignAreRefused) {
  datasets::SlipLog log;
  const Eigen::Matrix3d along = Eigen::Vector3d(1 / 16.0, 1 / 9.0, 1 / 25.0).asDiagonal();
  log.surfaces["felt"] = logged(fitting::test::simulate(fitting::test::ellipsoid(along), 12, 0.1, 0.1, 21));
  for (auto& slip : log.surfaces["felt"].slips)
    for (double& v : slip.wrench.data) v = -v;
  datasets::write_slip_log(folder / "slips.h5", log);
  const std::string reason = "slips.h5: /surfaces/felt: friction would drive the object";
  expect_refusal("compare slips.h5 --fit --json c.json", 3, reason);
  expect_refusal("fit slips.h5 --model ellipsoid --card c.json", 3, reason);
  expect_refusal("discover slips.h5 --json c.json", 3, reason);
  EXPECT_THAT(run("inspect slips.h5").out, HasSubstr("doubtful: /surfaces/felt: friction would drive"));
}

// An ellipsoid of 4 N, 3 N and 5 N times its length, from noisy slips.
TEST_F(Cli, FitsTheSurfaceThatSlipsWereDrawnFrom) {
  datasets::SlipLog log;
  const Eigen::Matrix3d along = Eigen::Vector3d(1 / 16.0, 1 / 9.0, 1 / 25.0).asDiagonal();
  const auto slips = fitting::test::simulate(fitting::test::ellipsoid(along), 60, 0.03, 0.03, 23);
  log.surfaces["felt"] = logged(slips);
  datasets::write_slip_log(folder / "slips.h5", log);
  const Answer answer =
      run("fit slips.h5 --model ellipsoid_full --json f.json --card card.json --report out");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json surface = read_json(folder / "f.json")["surfaces"]["felt"];
  EXPECT_EQ(surface["n"], 60);
  // Levels that scatter by 3 % leave a radius of 60 slips some 1 %.
  EXPECT_NEAR(surface["least_force_N"].get<double>(), 3, 0.1);
  EXPECT_NEAR(surface["largest_force_N"].get<double>(), 4, 0.13);
  EXPECT_NEAR(surface["torque_N_m"].get<double>(), 5 * slips.characteristic_length,
              0.2 * slips.characteristic_length);
  EXPECT_NEAR(surface["sigma_direction_rad"].get<double>(), 0.03, 4 * 0.03 / std::sqrt(2 * 120.0));
  EXPECT_NEAR(surface["sigma_level"].get<double>(), 0.03, 4 * 0.03 / std::sqrt(2 * 60.0));

  const auto card = datasets::parse_model_card(content(folder / "card.json"));
  EXPECT_EQ(card.model, "ellipsoid_full");
  EXPECT_EQ(card.parameters.at("A_xx[felt]").value, surface["coefficients"][0]);
  EXPECT_EQ(card.parameters.at("A_xx[felt]").unit, "1/N^2");
  const auto& error = card.errors.at("cross_validation").at("direction_error_deg[felt]");
  EXPECT_EQ(error.n, 60);
  EXPECT_EQ(error.mae, surface["cv_direction_error_deg"]);
  // Two components of 0.03 rad: √(π/2) 0.03 = 2.15 deg in the mean, of 60 slips to 7 %, and what a fit adds.
  EXPECT_NEAR(error.mae, 2.15, 0.6);
  EXPECT_THAT(content(folder / "out/report.md"), HasSubstr("| felt"));
}

TEST_F(Cli, CompareSlipsSaysWhatTheSurfacesErrOf) {
  using fitting::SurfaceModel;
  const Eigen::Matrix3d along = Eigen::Vector3d(1 / 16.0, 1 / 9.0, 1 / 25.0).asDiagonal();
  Eigen::Matrix3d turned = along;
  turned(0, 1) = turned(1, 0) = 0.04;
  datasets::SlipLog log;
  log.surfaces["felt"] = logged(fitting::test::simulate(fitting::test::ellipsoid(along), 30, 0.15, 0.1, 21));
  log.surfaces["glass"] =
      logged(fitting::test::simulate(fitting::test::ellipsoid(turned), 30, 0.03, 0.03, 22));
  datasets::write_slip_log(folder / "slips.h5", log);
  const Answer answer = run("compare slips.h5 --models ellipsoid,ellipsoid_full --fit --json c.json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  json compared = read_json(folder / "c.json");
  EXPECT_EQ(compared["schema"], "compare");
  EXPECT_EQ(compared["schema_version"], 1);
  EXPECT_EQ(compared["log"], "slips.h5");
  ASSERT_EQ(compared["models"].size(), 2u);

  std::vector<fitting::SlipSamples> surfaces;
  for (const auto& [name, surface] : log.surfaces) surfaces.push_back(fitting::slip_samples(name, surface));
  const std::vector<SurfaceModel> models{SurfaceModel::ellipsoid, SurfaceModel::ellipsoid_full};
  const auto scores = fitting::compare_surfaces(surfaces, models);
  for (std::size_t k = 0; k < models.size(); ++k) {
    json& model = compared["models"][to_string(models[k])];
    ASSERT_EQ(model["surfaces"].size(), surfaces.size());
    double error = 0, null = 0;
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
      json& surface = model["surfaces"][surfaces[i].surface];
      EXPECT_EQ(surface["cv_direction_error_deg"].get<double>(), scores[i][k].mean_deg);
      EXPECT_EQ(surface["null_control_deg"].get<double>(), scores[i][k].null_control_deg);
      error += surface["cv_direction_error_deg"].get<double>() / 2;
      null += surface["null_control_deg"].get<double>() / 2;
    }
    EXPECT_NEAR(model["mean_cv_direction_error_deg"].get<double>(), error, 1e-12);  // rounding of a sum
    EXPECT_NEAR(model["mean_null_control_deg"].get<double>(), null, 1e-12);
  }
  // Two components of 0.15 rad are 10.8° in the mean, of 0.03 rad 2.2°; 30 slips scatter by a tenth, and a
  // fit adds its own. An ellipsoid along the axes misses the other surface by more than that.
  const auto error_of = [&](const char* model, const char* surface) {
    return compared["models"][model]["surfaces"][surface]["cv_direction_error_deg"].get<double>();
  };
  EXPECT_NEAR(error_of("ellipsoid", "felt"), 10.8, 3);
  EXPECT_NEAR(error_of("ellipsoid_full", "glass"), 2.2, 1);
  EXPECT_GT(error_of("ellipsoid", "glass"), 2 * error_of("ellipsoid_full", "glass"));
}

}  // namespace
}  // namespace unhand::cli
