// Logs of slips: round trip, units, and what is refused.
#include "datasets/slip_log.hpp"

#include "hdf5_tools.hpp"
#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

SlipLog sample() {
  SlipLog log;
  Surface& patch = log.surfaces["patch"];
  patch.mass = 1.518;
  patch.characteristic_length = 0.05;
  patch.description = "full contact on wood";
  patch.licence = "Apache-2.0";
  patch.slips = {{"1", Split::train, clock_of(25, 100), wavy(25, 3, 5, {0.1, 0.1, 0.01}), wavy(25, 3, 0.02)},
                 {"2", Split::test, clock_of(9, 33), wavy(9, 3, 4), wavy(9, 3, 0.03)}};
  log.surfaces["feet"] = patch;
  log.surfaces["feet"].licence.reset();
  return log;
}

TEST(SlipLog, RoundTrip) {
  const Scratch scratch;
  write_slip_log(scratch / "s.h5", sample());
  EXPECT_EQ(read_slip_log(scratch / "s.h5"), sample());
  EXPECT_EQ(read_schema_name(scratch / "s.h5"), "slip-log");
}

TEST(SlipLog, ConvertsUnits) {
  const Scratch scratch;
  write_slip_log(scratch / "s.h5", sample());
  Editor(scratch / "s.h5").text("/surfaces/feet/slips/1/twist", "units", "mm/s,mm/s,deg/s");
  const Slip slip = read_slip_log(scratch / "s.h5").surfaces.at("feet").slips.at(0);
  EXPECT_EQ(slip.twist(3, 0), sample().surfaces.at("feet").slips[0].twist(3, 0) / 1000);
}

TEST(SlipLog, FrictionTakesWorkUnlessASignIsReversed) {
  Surface patch = sample().surfaces.at("patch");
  for (Slip& slip : patch.slips) slip.twist = slip.wrench;
  EXPECT_EQ(dissipation(patch), 1);
  for (Slip& slip : patch.slips)
    for (double& v : slip.twist.data) v = -v;
  EXPECT_EQ(dissipation(patch), -1);
  patch.slips.clear();
  EXPECT_EQ(dissipation(patch), 0);
}

struct SpoiledSlip {
  const char* name;
  Spoil spoil;
  const char *path, *reason;
};
void PrintTo(const SpoiledSlip& c, std::ostream* out) { *out << c.name; }
class Slips : public testing::TestWithParam<SpoiledSlip> {};

void expect_refused(const Spoil& spoil, const std::string& path, const std::string& reason) {
  const Scratch scratch;
  const std::string file = scratch / "s.h5";
  write_slip_log(file, sample());
  { spoil(Editor(file)); }
  expect_error([&] { read_slip_log(file); }, file, path, reason);
}

TEST_P(Slips, IsRefused) { expect_refused(GetParam().spoil, GetParam().path, GetParam().reason); }

const std::string first = "/surfaces/feet/slips/1";
const SpoiledSlip cases[] = {
    {"schema", [](const Editor& f) { f.text("/", "schema", "throw-log"); }, "/@schema",
     "'throw-log', expected 'slip-log'"},
    {"version", [](const Editor& f) { f.integer("/", "schema_version", 7); }, "/@schema_version",
     "version 7"},
    {"surfaces", [](const Editor& f) { f.rename("/surfaces", "/surface"); }, "/surface",
     "did you mean 'surfaces'"},
    {"length", [](const Editor& f) { f.remove_attribute("/surfaces/feet", "characteristic_length"); },
     "/surfaces/feet@characteristic_length", "missing"},
    {"mass", [](const Editor& f) { f.real("/surfaces/feet", "mass", -1); }, "/surfaces/feet@mass", "> 0"},
    {"slips", [](const Editor& f) { f.remove("/surfaces/feet/slips"); }, "/surfaces/feet/slips", "missing"},
    {"none",
     [](const Editor& f) {
       f.remove(first);
       f.remove("/surfaces/feet/slips/2");
     },
     "/surfaces/feet/slips", "is empty"},
    {"wrench", [](const Editor& f) { f.rename(first + "/wrench", first + "/wrnech"); },
     "/surfaces/feet/slips/1/wrnech", "did you mean 'wrench'"},
    {"no_twist", [](const Editor& f) { f.remove(first + "/twist"); }, "/surfaces/feet/slips/1/twist",
     "missing"},
    {"nan", [](const Editor& f) { f.poke(first + "/twist", 4, std::nan("")); },
     "/surfaces/feet/slips/1/twist", "row 1, column vy: NaN"},
    {"time", [](const Editor& f) { f.poke(first + "/time", 4, 0); }, "/surfaces/feet/slips/1/time",
     "strictly increasing"},
    {"unit", [](const Editor& f) { f.text(first + "/wrench", "units", "N"); },
     "/surfaces/feet/slips/1/wrench@units", "column tau is torque"},
    {"two_columns",
     [](const Editor& f) {
       f.doubles(first + "/wrench", {25, 2}, std::vector<double>(50), "N,N");
     },
     "/surfaces/feet/slips/1/wrench", "wrong shape (25,2), expected (N,3)"},
    {"fewer_rows",
     [](const Editor& f) {
       f.doubles(first + "/twist", {24, 3}, std::vector<double>(72), "m/s,m/s,rad/s");
     },
     "/surfaces/feet/slips/1/twist", "24 rows, but the time beside it has 25"},
    {"split", [](const Editor& f) { f.text(first, "split", "Train"); }, "/surfaces/feet/slips/1@split",
     "'Train'"},
};
const auto name_of_spoiled = [](const auto& case_info) { return std::string(case_info.param.name); };
INSTANTIATE_TEST_SUITE_P(Rejection, Slips, testing::ValuesIn(cases), name_of_spoiled);

TEST(SlipLog, EverythingButTheLicenceIsRequired) {
  const std::pair<std::string, std::vector<std::string>> attributes[] = {
      {"/", {"schema", "schema_version"}},
      {"/surfaces/feet", {"mass", "characteristic_length", "description"}},
      {first, {"split"}},
      {first + "/time", {"units"}},
      {first + "/wrench", {"units"}},
      {first + "/twist", {"units"}}};
  for (const auto& [owner, names] : attributes)
    for (const std::string& name : names)
      expect_refused([&](const Editor& f) { f.remove_attribute(owner, name); }, owner + "@" + name,
                     "required attribute is missing");
  for (const std::string dataset : {"time", "wrench", "twist"})
    expect_refused([&](const Editor& f) { f.remove(first + "/" + dataset); }, first + "/" + dataset,
                   "required dataset is missing");
  ASSERT_FALSE(sample().surfaces.at("feet").licence);
}

TEST(SlipLog, EveryNumberIsFinite) {
  const std::pair<std::string, std::vector<std::string>> datasets[] = {
      {"time", {"t"}}, {"wrench", {"fx", "fy", "tau"}}, {"twist", {"vx", "vy", "omega"}}};
  for (const auto& [name, columns] : datasets)
    for (std::size_t c = 0; c < columns.size(); ++c)
      for (const double value : {std::nan(""), HUGE_VAL})
        expect_refused([&](const Editor& f) { f.poke(first + "/" + name, 2 * columns.size() + c, value); },
                       first + "/" + name,
                       "row 2, column " + columns[c] + (std::isnan(value) ? ": NaN" : ": Inf"));
}

TEST(SlipLog, WritingRefusesABadLog) {
  const Scratch scratch;
  SlipLog log = sample();
  log.surfaces["feet"].slips[1].id = "1";
  expect_error([&] { write_slip_log(scratch / "s.h5", log); }, scratch / "s.h5", first, "used twice");
  EXPECT_EQ(scratch.files(), 0U);
}

}  // namespace
}  // namespace unhand::datasets::test
