// Every way in which a file can be wrong is refused, with the file, the path inside it and the reason.
#include <set>
#include <sstream>

#include "hdf5_tools.hpp"
#include "log_samples.hpp"
#include "tests/support/refusal.hpp"

namespace unhand::datasets::test {
namespace {

const double nan = std::numeric_limits<double>::quiet_NaN();
const double inf = std::numeric_limits<double>::infinity();

struct Case {
  const char* name;
  Spoil spoil;
  const char *path, *reason;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

const std::string one = "/throws/001";
const std::string mocap = one + "/mocap", hand = one + "/hand", ft = one + "/ft";
const std::vector<double> zeros(1000, 0.0);

/// Replaces a dataset by one of (2,3) that keeps its values where `keep` says.
void remake(const Editor& f, const std::string& path, const std::function<herr_t(hid_t, hid_t)>& keep) {
  f.remove(path);
  const hsize_t sizes[] = {2, 3};
  const hid_t space = H5Screate_simple(2, sizes, nullptr), creation = H5Pcreate(H5P_DATASET_CREATE);
  must(keep(creation, space) >= 0);
  const hid_t made = H5Dcreate2(f.file, path.c_str(), H5T_NATIVE_DOUBLE, space, 0, creation, 0);
  must(made >= 0);
  H5Dclose(made);
  H5Pclose(creation);
  H5Sclose(space);
  f.text(path, "units", "m,m,rad");
}

const Case planar_cases[] = {
    // the head
    {"no_schema", [](const Editor& f) { f.remove_attribute("/", "schema"); }, "/@schema", "missing"},
    {"schema_misspelt", [](const Editor& f) { f.rename_attribute("/", "schema", "shcema"); }, "/@shcema",
     "did you mean 'schema'"},
    {"other_schema", [](const Editor& f) { f.text("/", "schema", "slip-log"); }, "/@schema",
     "'slip-log', expected 'throw-log'"},
    {"version_2", [](const Editor& f) { f.integer("/", "schema_version", 2); }, "/@schema_version",
     "version 2 is not supported"},
    {"version_text", [](const Editor& f) { f.text("/", "schema_version", "1"); }, "/@schema_version",
     "wrong type: text"},
    {"dimension_4", [](const Editor& f) { f.integer("/", "dimension", 4); }, "/@dimension",
     "4 is not 2 or 3"},
    {"dimension_huge", [](const Editor& f) { f.integer("/", "dimension", 1LL << 40); }, "/@dimension",
     "is not 2 or 3"},
    {"dimension_real", [](const Editor& f) { f.real("/", "dimension", 2); }, "/@dimension",
     "expected an integer"},
    {"no_gravity", [](const Editor& f) { f.remove_attribute("/", "gravity"); }, "/@gravity", "missing"},
    {"gravity_nan", [](const Editor& f) { f.real("/", "gravity", nan); }, "/@gravity", "nan is not finite"},
    {"gravity_text", [](const Editor& f) { f.text("/", "gravity", "9.81"); }, "/@gravity",
     "wrong type: text, expected numbers"},
    {"gravity_list",
     [](const Editor& f) {
       f.reals("/", "gravity", {0, 9.81});
     },
     "/@gravity", "wrong shape: 2 values, expected 1"},
    {"title_number", [](const Editor& f) { f.real("/", "title", 1); }, "/@title", "expected text"},
    {"title_latin1", [](const Editor& f) { f.text("/", "title", "W\xfcrfe"); }, "/@title", "UTF-8"},
    {"licence_misspelt", [](const Editor& f) { f.rename_attribute("/", "licence", "license"); }, "/@license",
     "did you mean 'licence'"},
    {"landing_height_inf", [](const Editor& f) { f.real("/", "landing_height", inf); }, "/@landing_height",
     "is not finite"},
    // groups
    {"no_objects", [](const Editor& f) { f.remove("/objects"); }, "/objects", "required group is missing"},
    {"objects_misspelt", [](const Editor& f) { f.rename("/objects", "/obejcts"); }, "/obejcts",
     "did you mean 'objects'"},
    {"objects_empty",
     [](const Editor& f) {
       f.remove("/objects/bar");
       f.remove("/objects/plain");
     },
     "/objects", "is empty"},
    {"no_throws", [](const Editor& f) { f.remove("/throws"); }, "/throws", "required group is missing"},
    {"throws_empty",
     [](const Editor& f) {
       f.remove("/throws/001");
       f.remove("/throws/002");
     },
     "/throws", "at least one throw"},
    {"throws_a_dataset",
     [](const Editor& f) {
       f.remove("/throws");
       f.doubles("/throws", {2}, {1, 2}, "s");
     },
     "/throws", "is not a group"},
    {"gripper_misspelt", [](const Editor& f) { f.rename("/gripper", "/griper"); }, "/griper",
     "did you mean 'gripper'"},
    {"throw_empty",
     [](const Editor& f) {
       f.remove(mocap);
       f.remove(hand);
       f.remove(ft);
       f.remove(one + "/landing");
       f.remove(one + "/imu");
     },
     "/throws/001", "is empty"},
    {"group_misspelt", [](const Editor& f) { f.rename(mocap, one + "/mocpa"); }, "/throws/001/mocpa",
     "did you mean 'mocap'"},
    {"short_group_swapped", [](const Editor& f) { f.rename(ft, one + "/tf"); }, "/throws/001/tf",
     "did you mean 'ft'"},
    {"short_group_stutters", [](const Editor& f) { f.rename(ft, one + "/ftt"); }, "/throws/001/ftt",
     "did you mean 'ft'"},
    {"group_is_dataset",
     [](const Editor& f) {
       f.remove(hand);
       f.doubles(hand, {1}, {1}, "s");
     },
     "/throws/001/hand", "is not a group"},
    {"link_out_of_the_file",
     [](const Editor& f) {
       f.remove(hand);
       must(H5Lcreate_external("other.h5", "/hand", f.file, hand.c_str(), 0, 0) >= 0);
     },
     "/throws/001/hand", "link out of the file"},
    {"unknown_compression",
     [](const Editor& f) {
       f.filtered(hand + "/pose", {2, 3}, 65000, {}, std::vector<char>(48), "m,m,rad");
     },
     "/throws/001/hand/pose", "the filter 65000"},
    {"values_in_another_file",
     [](const Editor& f) {
       remake(f, hand + "/pose",
              [](hid_t creation, hid_t) { return H5Pset_external(creation, "other.bin", 0, H5F_UNLIMITED); });
     },
     "/throws/001/hand/pose", "in another file"},
    {"virtual_values",
     [](const Editor& f) {
       remake(f, hand + "/pose", [](hid_t creation, hid_t space) {
         return H5Pset_virtual(creation, space, ".", "/throws/001/hand/twist", space);
       });
     },
     "/throws/001/hand/pose", "is virtual"},
    {"dangling_link",
     [](const Editor& f) {
       f.remove(hand + "/pose");
       must(H5Lcreate_soft("/nowhere", f.file, (hand + "/pose").c_str(), 0, 0) >= 0);
     },
     "/throws/001/hand/pose", "cannot be opened"},
    // objects and gripper
    {"no_mass", [](const Editor& f) { f.remove_attribute("/objects/bar", "mass"); }, "/objects/bar@mass",
     "missing"},
    {"mass_misspelt", [](const Editor& f) { f.rename_attribute("/objects/bar", "mass", "msas"); },
     "/objects/bar@msas", "did you mean 'mass'"},
    {"mass_negative", [](const Editor& f) { f.real("/objects/bar", "mass", -0.2); }, "/objects/bar@mass",
     "-0.2 is not finite and > 0"},
    {"mass_zero", [](const Editor& f) { f.real("/objects/bar", "mass", 0); }, "/objects/bar@mass", "> 0"},
    {"inertia_negative", [](const Editor& f) { f.real("/objects/bar", "inertia", -1); },
     "/objects/bar@inertia", "> 0"},
    {"inertia_of_three",
     [](const Editor& f) {
       f.reals("/objects/bar", "inertia", {1, 1, 1});
     },
     "/objects/bar@inertia", "3 values, expected 1"},
    {"dims_of_two",
     [](const Editor& f) {
       f.reals("/objects/bar", "dims", {1, 1});
     },
     "/objects/bar@dims", "2 values, expected 3"},
    {"drag_negative", [](const Editor& f) { f.real("/objects/bar", "drag_k", -0.1); }, "/objects/bar@drag_k",
     ">= 0"},
    {"no_pads", [](const Editor& f) { f.integer("/gripper", "n_pads", 0); }, "/gripper@n_pads",
     "0 is not in 1..1000"},
    {"pads_negative", [](const Editor& f) { f.integer("/gripper", "n_pads", -2); }, "/gripper@n_pads",
     "-2 is not"},
    {"pads_missing", [](const Editor& f) { f.remove_attribute("/gripper", "n_pads"); }, "/gripper@n_pads",
     "missing"},
    // throw attributes
    {"unknown_object", [](const Editor& f) { f.text(one, "object", "brick"); }, "/throws/001@object",
     "no object 'brick' in /objects (known: bar, plain)"},
    {"split", [](const Editor& f) { f.text(one, "split", "validation"); }, "/throws/001@split",
     "'validation' is not 'train' or 'test'"},
    {"no_split", [](const Editor& f) { f.remove_attribute(one, "split"); }, "/throws/001@split", "missing"},
    {"repetition_negative", [](const Editor& f) { f.integer(one, "repetition", -1); },
     "/throws/001@repetition", "-1 is not"},
    {"detach_time_nan", [](const Editor& f) { f.real(one, "detach_time", nan); }, "/throws/001@detach_time",
     "is not finite"},
    {"detach_time_misspelt", [](const Editor& f) { f.rename_attribute(one, "detach_time", "detatch_time"); },
     "/throws/001@detatch_time", "did you mean"},
    {"free_flight_reversed",
     [](const Editor& f) {
       f.reals(one, "free_flight", {0.2, 0.1});
     },
     "/throws/001@free_flight", "not strictly increasing"},
    {"free_flight_of_three",
     [](const Editor& f) {
       f.reals(one, "free_flight", {0, 1, 2});
     },
     "/throws/001@free_flight", "3 values, expected 2"},
    {"jumps_out_of_order",
     [](const Editor& f) {
       f.reals(one, "hand_jump_times", {0.2, 0.2});
     },
     "/throws/001@hand_jump_times", "not strictly increasing"},
    {"attribute_of_two_axes",
     [](const Editor& f) {
       f.attribute(one, "free_flight", H5T_NATIVE_DOUBLE, zeros.data(), {1, 2});
     },
     "/throws/001@free_flight", "wrong shape"},
    // datasets: names and shapes
    {"no_twist", [](const Editor& f) { f.remove(hand + "/twist"); }, "/throws/001/hand/twist",
     "required dataset is missing"},
    {"twist_misspelt", [](const Editor& f) { f.rename(hand + "/twist", hand + "/twsit"); },
     "/throws/001/hand/twsit", "did you mean 'twist'"},
    {"valid_misspelt", [](const Editor& f) { f.rename(mocap + "/valid", mocap + "/vaild"); },
     "/throws/001/mocap/vaild", "did you mean 'valid'"},
    {"twist_a_group",
     [](const Editor& f) {
       f.remove(hand + "/twist");
       f.group(hand + "/twist");
     },
     "/throws/001/hand/twist", "is not a dataset"},
    {"pose_of_two_columns",
     [](const Editor& f) {
       f.doubles(hand + "/pose", {40, 2}, zeros, "m");
     },
     "/throws/001/hand/pose", "wrong shape (40,2), expected (N,3)"},
    {"pose_flat", [](const Editor& f) { f.doubles(hand + "/pose", {120}, zeros, "m"); },
     "/throws/001/hand/pose", "wrong shape (120), expected (N,3)"},
    {"pose_of_three_axes",
     [](const Editor& f) {
       f.doubles(hand + "/pose", {40, 3, 1}, zeros, "m");
     },
     "/throws/001/hand/pose", "3 axes"},
    {"planar_mocap_of_seven",
     [](const Editor& f) {
       f.doubles(mocap + "/pose", {30, 7}, zeros, "m,m,m,1,1,1,1");
     },
     "/throws/001/mocap/pose", "wrong shape (30,7), expected (N,3)"},
    {"time_a_column",
     [](const Editor& f) {
       f.doubles(hand + "/time", {40, 1}, zeros, "s");
     },
     "/throws/001/hand/time", "expected (N)"},
    {"fewer_rows",
     [](const Editor& f) {
       f.doubles(hand + "/twist", {39, 3}, zeros, "m/s,m/s,rad/s");
     },
     "/throws/001/hand/twist", "39 rows, but the time beside it has 40"},
    {"no_rows", [](const Editor& f) { f.dataset(hand + "/time", H5T_NATIVE_DOUBLE, {0}, nullptr, "s"); },
     "/throws/001/hand/time", "is empty"},
    {"valid_too_short",
     [](const Editor& f) {
       const unsigned char v[3] = {1, 1, 1};
       f.dataset(mocap + "/valid", H5T_NATIVE_UCHAR, {3}, v, "1");
     },
     "/throws/001/mocap/valid", "3 rows"},
    {"valid_of_two",
     [](const Editor& f) {
       std::vector<unsigned char> v(30, 2);
       f.dataset(mocap + "/valid", H5T_NATIVE_UCHAR, {30}, v.data(), "1");
     },
     "/throws/001/mocap/valid", "2 is not 0 or 1"},
    {"valid_wide",
     [](const Editor& f) {
       std::vector<int> v(30, 256);
       f.dataset(mocap + "/valid", H5T_NATIVE_INT, {30}, v.data(), "1");
     },
     "/throws/001/mocap/valid", "256 is not 0 or 1"},
    {"valid_real", [](const Editor& f) { f.doubles(mocap + "/valid", {30}, zeros, "1"); },
     "/throws/001/mocap/valid", "expected integers"},
    {"landing_of_two_rows",
     [](const Editor& f) {
       f.doubles(one + "/landing/time", {2}, {0.4, 0.5}, "s");
     },
     "/throws/001/landing/time", "2 rows, expected exactly 1"},
    {"planar_landing_of_three",
     [](const Editor& f) {
       f.doubles(one + "/landing/pose", {1, 3}, {1, 2, 3}, "m");
     },
     "/throws/001/landing/pose", "wrong shape (1,3), expected (N,2)"},
    // datasets: types and sizes
    {"integers",
     [](const Editor& f) {
       std::vector<int> v(120, 1);
       f.dataset(hand + "/pose", H5T_NATIVE_INT, {40, 3}, v.data(), "m,m,rad");
     },
     "/throws/001/hand/pose", "wrong type: integers, expected floating-point"},
    {"strings",
     [](const Editor& f) {
       std::string v(120, 'x');
       f.dataset(hand + "/pose", H5T_C_S1, {40, 3}, v.data(), "m,m,rad");
     },
     "/throws/001/hand/pose", "wrong type: text"},
    {"a_million_million",
     [](const Editor& f) {
       f.dataset(hand + "/time", H5T_NATIVE_DOUBLE, {1000000000000}, nullptr, "s", true);
     },
     "/throws/001/hand/time", "absurd size"},
    {"absurd_product",
     [](const Editor& f) {
       f.dataset(hand + "/pose", H5T_NATIVE_DOUBLE, {40000000, 3}, nullptr, "m,m,rad", true);
     },
     "/throws/001/hand/pose", "absurd size"},
    {"size_overflow",
     [](const Editor& f) {
       f.dataset(hand + "/pose", H5T_NATIVE_DOUBLE, {1ULL << 62, 4}, nullptr, "m", true);
     },
     "/throws/001/hand/pose", "absurd size"},
    // datasets: values
    {"time_repeats", [](const Editor& f) { f.poke(hand + "/time", 5, 0.004); }, "/throws/001/hand/time",
     "not strictly increasing: 0.004 s at row 5"},
    {"time_nan", [](const Editor& f) { f.poke(ft + "/time", 5, nan); }, "/throws/001/ft/time",
     "row 5, column t: NaN"},
    {"twist_nan", [](const Editor& f) { f.poke(hand + "/twist", 7, nan); }, "/throws/001/hand/twist",
     "row 2, column vz: NaN"},
    {"wrench_inf", [](const Editor& f) { f.poke(ft + "/wrench", 2, -inf); }, "/throws/001/ft/wrench",
     "row 0, column tau: Inf"},
    {"mocap_nan_where_valid", [](const Editor& f) { f.poke(mocap + "/pose", 8 * 3 + 2, nan); },
     "/throws/001/mocap/pose", "row 8, column theta: NaN where valid is not 0"},
    {"nan_without_valid", [](const Editor& f) { f.remove(mocap + "/valid"); }, "/throws/001/mocap/pose",
     "row 7"},
    // units and noise
    {"no_units", [](const Editor& f) { f.remove_attribute(hand + "/pose", "units"); },
     "/throws/001/hand/pose@units", "missing"},
    {"units_misspelt", [](const Editor& f) { f.rename_attribute(hand + "/pose", "units", "unit"); },
     "/throws/001/hand/pose@unit", "did you mean 'units'"},
    {"unknown_unit", [](const Editor& f) { f.text(hand + "/pose", "units", "m,furlong,rad"); },
     "/throws/001/hand/pose@units", "unknown unit 'furlong' for column z (known: m, cm, mm"},
    {"unit_of_other_kind", [](const Editor& f) { f.text(hand + "/pose", "units", "m,m,m"); },
     "/throws/001/hand/pose@units", "'m' is a unit of length, but column theta is angle"},
    {"two_units_for_three", [](const Editor& f) { f.text(hand + "/pose", "units", "m,rad"); },
     "/throws/001/hand/pose@units", "2 units for 3 columns"},
    {"units_a_number", [](const Editor& f) { f.real(hand + "/time", "units", 1); },
     "/throws/001/hand/time@units", "expected text"},
    {"flag_unit", [](const Editor& f) { f.text(mocap + "/valid", "units", "s"); },
     "/throws/001/mocap/valid@units", "unknown unit 's' for a flag"},
    {"sigma_negative",
     [](const Editor& f) {
       f.reals(hand + "/pose", "sigma", {1, -1, 1});
     },
     "/throws/001/hand/pose@sigma", "-1 is not a finite noise"},
    {"sigma_nan", [](const Editor& f) { f.real(hand + "/pose", "sigma", nan); },
     "/throws/001/hand/pose@sigma", "nan is not a finite noise"},
    {"sigma_of_two",
     [](const Editor& f) {
       f.reals(hand + "/pose", "sigma", {1, 1});
     },
     "/throws/001/hand/pose@sigma", "2 values for 3 columns"},
    {"sigma_text", [](const Editor& f) { f.text(hand + "/pose", "sigma", "small"); },
     "/throws/001/hand/pose@sigma", "expected numbers"},
    {"sigma_misspelt", [](const Editor& f) { f.rename_attribute(hand + "/pose", "sigma", "simga"); },
     "/throws/001/hand/pose@simga", "did you mean 'sigma'"},
};

const Case spatial_cases[] = {
    {"inertia_of_one", [](const Editor& f) { f.real("/objects/cube", "inertia", 1e-3); },
     "/objects/cube@inertia", "1 values, expected 3"},
    {"pose_of_four",
     [](const Editor& f) {
       f.doubles("/throws/full/mocap/pose", {12, 4}, zeros, "m");
     },
     "/throws/full/mocap/pose", "expected (N,7) or (N,3)"},
    {"quaternion_not_unit", [](const Editor& f) { f.poke("/throws/full/mocap/pose", 2 * 7 + 3, 0.605); },
     "/throws/full/mocap/pose", "row 2: quaternion of norm 1.003"},
    {"quaternion_zero",
     [](const Editor& f) {
       f.doubles("/throws/full/mocap/pose", {12, 7}, zeros, "m,m,m,1,1,1,1");
     },
     "/throws/full/mocap/pose", "quaternion of norm 0"},
    {"quaternion_in_metres", [](const Editor& f) { f.text("/throws/full/mocap/pose", "units", "m"); },
     "/throws/full/mocap/pose@units", "column qw is pure number"},
    {"spatial_landing_of_two",
     [](const Editor& f) {
       f.doubles("/throws/full/landing/pose", {1, 2}, {1, 2}, "m,rad");
     },
     "/throws/full/landing/pose", "expected (N,3)"},
    {"spatial_hand",
     [](const Editor& f) {
       f.group("/throws/full/hand");
       f.doubles("/throws/full/hand/time", {2}, {0, 1}, "s");
     },
     "/throws/full/hand", "planar logs"},
};

class Planar : public testing::TestWithParam<Case> {};
class Spatial : public testing::TestWithParam<Case> {};

void run(const Case& c, const ThrowLog& log) {
  const Scratch scratch;
  const std::string file = scratch / "bad.h5";
  write_throw_log(file, log);
  { c.spoil(Editor(file)); }
  const std::string before = bytes_of(file);
  expect_error([&] { read_throw_log(file); }, file, c.path, c.reason);
  EXPECT_EQ(bytes_of(file), before) << "reading must not touch the file";
}

TEST_P(Planar, IsRefused) { run(GetParam(), planar_log()); }
TEST_P(Spatial, IsRefused) { run(GetParam(), spatial_log()); }
const auto name_of = [](const auto& info) { return std::string(info.param.name); };
INSTANTIATE_TEST_SUITE_P(Rejection, Planar, testing::ValuesIn(planar_cases), name_of);
INSTANTIATE_TEST_SUITE_P(Rejection, Spatial, testing::ValuesIn(spatial_cases), name_of);

/// What a log may do without, spelt out here as in the description of the format; all else is required.
const std::set<std::string> optional_datasets = {"mocap/valid", "imu/angular_rate"};
const std::vector<std::pair<std::string, std::vector<std::string>>>
    required_attributes = {{"/",
                            {"schema", "schema_version", "dimension", "title", "source", "gravity",
                             "landing_height"}},
                           {"/objects/bar", {"mass"}},
                           {"/gripper", {"n_pads"}},
                           {one, {"object", "condition", "repetition", "split"}}},
    optional_attributes = {{"/", {"licence"}},
                           {"/objects/bar", {"inertia", "com_offset", "dims", "surface", "sku", "drag_k"}},
                           {"/gripper", {"pad_radius", "opening_command_time"}},
                           {one, {"detach_time", "grasp_angle", "hand_jump_times", "free_flight"}}};

/// A log with everything that its dimension can have, every sample of it good.
ThrowLog full_log(int dimension) {
  ThrowLog log = dimension == 3 ? spatial_log() : planar_log();
  for (Throw& toss : log.throws) {
    toss.imu = sample_throw("001").imu;
    toss.mocap->valid = Flags(toss.mocap->time.rows, 1);
    if (dimension == 2) toss.mocap->pose = wavy(toss.mocap->time.rows, 3, 0.4);
  }
  return log;
}

/// The group of the throw of full_log() that has this dataset.
std::string throw_with(const LayoutRow& row, int dimension) {
  if (dimension == 2) return one + "/";
  return row.path == "mocap/pose" && row.shape == "(N,3)" ? "/throws/points/" : "/throws/full/";
}

TEST(Rejection, OfEveryDatasetThatIsNotThere) {
  for (const int dimension : {2, 3})
    for (const LayoutRow& row : throw_log_layout(dimension)) {
      const std::string path = throw_with(row, dimension) + row.path;
      const Spoil remove = [&](const Editor& f) { f.remove(path); };
      EXPECT_EQ(row.optional, optional_datasets.contains(row.path)) << row.path;
      if (!optional_datasets.contains(row.path)) {
        run({"missing", remove, path.c_str(), "required dataset is missing"}, full_log(dimension));
        continue;
      }
      const Scratch scratch;
      write_throw_log(scratch / "good.h5", full_log(dimension));
      { remove(Editor(scratch / "good.h5")); }
      EXPECT_NO_THROW(read_throw_log(scratch / "good.h5")) << path;
    }
}

TEST(Rejection, OfEveryColumnThatIsNotFinite) {
  bool infinite = false;  // by turns
  for (const int dimension : {2, 3})
    for (const LayoutRow& row : throw_log_layout(dimension)) {
      if (row.path == "mocap/valid") continue;  // integers
      const std::string path = throw_with(row, dimension) + row.path;
      const std::size_t sample = row.shape[1] == '1' ? 0 : 1;  // the only one, or the second
      std::vector<std::string> columns;
      std::istringstream names(row.columns);
      for (std::string name; std::getline(names, name, ',');) columns.push_back(name);
      for (std::size_t c = 0; c < columns.size(); ++c) {
        infinite = !infinite;
        const std::string reason =
            "row " + std::to_string(sample) + ", column " + columns[c] + (infinite ? ": Inf" : ": NaN");
        run({"not finite",
             [&](const Editor& f) { f.poke(path, sample * columns.size() + c, infinite ? inf : nan); },
             path.c_str(), reason.c_str()},
            full_log(dimension));
      }
    }
}

TEST(Rejection, OfEveryTimeThatStandsStill) {
  for (const int dimension : {2, 3})
    for (const LayoutRow& row : throw_log_layout(dimension)) {
      if (row.columns != "t" || row.shape == "(1)") continue;
      const std::string path = throw_with(row, dimension) + row.path;
      run({"stands still", [&](const Editor& f) { f.poke(path, 1, 0); }, path.c_str(),
           "not strictly increasing: 0 s at row 1"},
          full_log(dimension));
    }
}

TEST(Rejection, OfEveryAttributeThatIsNotThere) {
  for (const auto& [owner, names] : required_attributes)
    for (const std::string& name : names) {
      const std::string path = owner + "@" + name;
      run({"missing", [&](const Editor& f) { f.remove_attribute(owner, name); }, path.c_str(),
           "required attribute is missing"},
          planar_log());
    }
  for (const LayoutRow& row : throw_log_layout(2)) {
    const std::string path = one + "/" + row.path;
    run({"missing", [&](const Editor& f) { f.remove_attribute(path, "units"); }, (path + "@units").c_str(),
         "required attribute is missing"},
        planar_log());
  }
  const Scratch scratch;
  const std::string file = scratch / "good.h5";
  write_throw_log(file, planar_log());
  {
    const Editor editor(file);
    for (const auto& [owner, names] : optional_attributes)
      for (const std::string& name : names) editor.remove_attribute(owner, name);
  }
  EXPECT_NO_THROW(read_throw_log(file));
}

TEST(Rejection, WhatIsNotALogAtAll) {
  const Scratch scratch;
  const auto expect = [&](const std::string& file, const std::string& reason) {
    expect_error([&] { read_throw_log(file); }, file, "", reason);
    expect_error([&] { read_schema_name(file); }, file, "", reason);
  };
  expect(scratch / "missing.h5", "no such file");
  expect(scratch / ".", "is a directory");
  expect("/dev/null", "not a regular file");
  put_bytes(scratch / "empty.h5", "");
  expect(scratch / "empty.h5", "is empty");
  put_bytes(scratch / "text.h5", "time,x,z\n0,1,2\n");
  expect(scratch / "text.h5", "is not an HDF5 file");
}

TEST(Rejection, HDF5PrintsNothingAndKeepsItsPrinter) {
  H5E_auto2_t before = nullptr, after = nullptr;
  void *data_before = nullptr, *data_after = nullptr;
  H5Eget_auto2(H5E_DEFAULT, &before, &data_before);
  testing::internal::CaptureStderr();
  EXPECT_THROW(read_throw_log("/dev/null"), LogError);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  H5Eget_auto2(H5E_DEFAULT, &after, &data_after);
  EXPECT_EQ(before, after);
}

// A name with a line break in it stays on one line of the message.
TEST(Rejection, MessageStaysOnOneLine) {
  const Scratch scratch;
  const std::string file = scratch / "odd.h5";
  write_throw_log(file, planar_log());
  Editor(file).rename("/throws/001/hand/twist", "/throws/001/hand/twi\nst");
  const std::string message = support::refusal<LogError>([&] { read_throw_log(file); });
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_THAT(message, testing::HasSubstr("/throws/001/hand/twi?st: "));
}

}  // namespace
}  // namespace unhand::datasets::test
