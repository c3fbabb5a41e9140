// What is written comes back bit for bit; other units, types and strings come back as the same SI values.
#include <lzf.h>

#include <numbers>

#include "datasets/extended_log.hpp"
#include "hdf5_tools.hpp"
#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

void expect_same(const ThrowLog& a, const ThrowLog& b) {
  ThrowLog rest_a = a, rest_b = b;
  ASSERT_EQ(a.throws.size(), b.throws.size());
  for (std::size_t k = 0; k < a.throws.size(); ++k) {  // poses by their bits, those of lost samples, too
    ASSERT_EQ(a.throws[k].mocap.has_value(), b.throws[k].mocap.has_value());
    if (!a.throws[k].mocap) continue;
    EXPECT_TRUE(same_bits(a.throws[k].mocap->pose, b.throws[k].mocap->pose)) << a.throws[k].id;
    rest_a.throws[k].mocap->pose = rest_b.throws[k].mocap->pose = {};
  }
  EXPECT_EQ(rest_a, rest_b);
}

TEST(RoundTrip, PlanarWithEveryField) {
  const Scratch scratch;
  const ThrowLog log = planar_log();
  write_throw_log(scratch / "a.h5", log);
  const ThrowLog back = read_throw_log(scratch / "a.h5");
  expect_same(log, back);
  EXPECT_TRUE(std::isnan(back.throws[0].mocap->pose(7, 0)));
  EXPECT_EQ(log, back) << "a lost sample's NaN is equal to it";
  ThrowLog other = back;
  other.throws[0].mocap->pose(7, 0) = 0;
  EXPECT_FALSE(other == back);
  EXPECT_EQ(read_schema_name(scratch / "a.h5"), "throw-log");
}

TEST(RoundTrip, SpatialWithAndWithoutOrientation) { expect_same(spatial_log(), reread(spatial_log())); }

TEST(RoundTrip, OnlyWhatIsRequired) {
  ThrowLog log;
  log.objects["ball"].mass = 0.1;
  Throw toss;
  toss.id = "only";
  toss.object = "ball";
  toss.mocap = MocapLog{clock_of(1, 1), wavy(1, 3, 1), {}};
  log.throws = {toss};
  const ThrowLog back = reread(log);
  EXPECT_EQ(log, back);
  EXPECT_FALSE(back.gripper || back.licence || back.throws[0].hand || back.throws[0].detach_time);
  EXPECT_TRUE(back.throws[0].mocap->is_valid(0));
}

/// The log, `later` [s] by its clock, written out instant by instant.
ThrowLog later_by(ThrowLog log, double later) {
  if (log.gripper && log.gripper->opening_command_time) *log.gripper->opening_command_time += later;
  for (Throw& toss : log.throws) {
    const auto shift = [&](Series& time) {
      for (double& t : time.data) t += later;
    };
    if (toss.hand) shift(toss.hand->time);
    if (toss.ft) shift(toss.ft->time);
    if (toss.mocap) shift(toss.mocap->time);
    if (toss.landing) shift(toss.landing->time);
    if (toss.imu) shift(toss.imu->time);
    if (toss.detach_time) *toss.detach_time += later;
    if (toss.free_flight) toss.free_flight->first += later, toss.free_flight->second += later;
    for (double& t : toss.hand_jump_times) t += later;
  }
  return log;
}

// Seconds since 1970: in memory they count from the first full second, in files they stay what they were.
TEST(RoundTrip, AClockFarFromZero) {
  ThrowLog log = planar_log();
  for (const double epoch : {1.7e9, -3e6}) {
    const ThrowLog far = later_by(log, epoch);
    const ThrowLog back = reread(far);
    EXPECT_NEAR(back.clock_origin, epoch, 10);
    EXPECT_EQ(back.clock_origin, std::floor(back.clock_origin));
    const double shift = back.clock_origin - epoch;
    EXPECT_NEAR(*back.gripper->opening_command_time + shift, *log.gripper->opening_command_time, 2.4e-7);
    for (std::size_t k = 0; k < log.throws.size(); ++k) {
      const auto near = [&](double now, double before) { EXPECT_NEAR(now + shift, before, 2.4e-7) << k; };
      const Throw &a = back.throws[k], &b = log.throws[k];
      ASSERT_EQ(a.id, b.id);
      if (b.ft)
        for (std::size_t i = 0; i < b.ft->time.rows; ++i) near(a.ft->time(i), b.ft->time(i));
      if (b.hand)
        for (std::size_t i = 0; i < b.hand->time.rows; ++i) near(a.hand->time(i), b.hand->time(i));
      if (b.mocap)
        for (std::size_t i = 0; i < b.mocap->time.rows; ++i) near(a.mocap->time(i), b.mocap->time(i));
      if (b.landing) near(a.landing->time(0), b.landing->time(0));
      if (b.detach_time) near(*a.detach_time, *b.detach_time);
      if (b.free_flight)
        near(a.free_flight->first, b.free_flight->first), near(a.free_flight->second, b.free_flight->second);
      for (std::size_t i = 0; i < b.hand_jump_times.size(); ++i)
        near(a.hand_jump_times[i], b.hand_jump_times[i]);
    }
    expect_same(reread(back), back);
    ThrowLog as_in_file = back;
    for (Throw& toss : as_in_file.throws) move_clock(toss, -back.clock_origin);
    EXPECT_EQ(as_in_file.throws[0].hand->time, far.throws[0].hand->time) << "bit for bit";
  }
}

TEST(RoundTrip, ExtremeDoublesKeepTheirBits) {
  ThrowLog log = planar_log();
  using limits = std::numeric_limits<double>;
  log.throws[0].hand->twist.data.assign(
      {-0.0, limits::denorm_min(), limits::max(), limits::lowest(), limits::epsilon()});
  log.throws[0].hand->twist.data.resize(120, 1.0 / 3);
  EXPECT_TRUE(same_bits(reread(log).throws[0].hand->twist, log.throws[0].hand->twist));
}

TEST(RoundTrip, MoreRowsThanOneChunk) {
  ThrowLog log = planar_log();
  log.throws[0].ft = FtLog{clock_of(10000, 1000), wavy(10000, 3, 3), wavy(10000, 1, 9)};
  expect_same(log, reread(log));
}

TEST(RoundTrip, ThrowsAreSortedById) {
  ThrowLog log = planar_log();
  std::swap(log.throws[0], log.throws[1]);
  expect_same(planar_log(), reread(log));
}

TEST(RoundTrip, TheSameLogGivesTheSameBytes) {
  const Scratch scratch;
  write_throw_log(scratch / "a.h5", planar_log());
  write_throw_log(scratch / "b.h5", planar_log());
  EXPECT_EQ(bytes_of(scratch / "a.h5"), bytes_of(scratch / "b.h5"));
}

/// What h5py's compression="lzf" leaves: the values and a pattern that LZF makes smaller.
TEST(RoundTrip, ReadsWhatIsCompressedWithLzf) {
  const Scratch scratch;
  ThrowLog log = planar_log();
  Series& pose = log.throws[0].mocap->pose;
  for (std::size_t k = 0; k < pose.data.size(); ++k) pose.data[k] = 0.25 * static_cast<double>(k % 6);
  write_throw_log(scratch / "a.h5", log);
  const std::size_t size = pose.data.size() * sizeof(double);
  std::vector<char> packed(size);
  packed.resize(lzf_compress(pose.data.data(), static_cast<unsigned>(size), packed.data(),
                             static_cast<unsigned>(size - 1)));
  ASSERT_GT(packed.size(), 0u);
  const auto pack = [&](unsigned chunk, const std::vector<char>& bytes) {
    Editor(scratch / "a.h5")
        .filtered("/throws/001/mocap/pose", {pose.rows, pose.cols}, 32000, {4, LZF_VERSION, chunk}, bytes,
                  "m,m,rad");
    const std::vector<double> sigma = pose.sigma;
    if (!sigma.empty()) Editor(scratch / "a.h5").reals("/throws/001/mocap/pose", "sigma", sigma);
  };
  pack(static_cast<unsigned>(size), packed);
  const ThrowLog read = read_throw_log(scratch / "a.h5");
  EXPECT_EQ(read.throws[0].mocap->pose.data, pose.data);

  for (const unsigned wrong : {0u, 8u}) {
    SCOPED_TRACE(wrong);
    pack(wrong, packed);
    EXPECT_THROW(read_throw_log(scratch / "a.h5"), LogError);
  }
  packed.resize(packed.size() / 2);
  pack(static_cast<unsigned>(size), packed);
  EXPECT_THROW(read_throw_log(scratch / "a.h5"), LogError);
}

TEST(RoundTrip, WritesWithChunksGzipShuffleAndChecksum) {
  const Scratch scratch;
  write_throw_log(scratch / "a.h5", planar_log());
  const Editor f(scratch / "a.h5");
  const hid_t set = H5Dopen2(f.file, "/throws/001/mocap/pose", 0), list = H5Dget_create_plist(set);
  EXPECT_EQ(H5Pget_layout(list), H5D_CHUNKED);
  std::vector<H5Z_filter_t> filters;
  for (unsigned i = 0; i < unsigned(H5Pget_nfilters(list)); ++i) {
    std::size_t n = 0;
    unsigned flags = 0;
    filters.push_back(H5Pget_filter2(list, i, &flags, &n, nullptr, 0, nullptr, nullptr));
  }
  EXPECT_THAT(filters, testing::ElementsAre(H5Z_FILTER_SHUFFLE, H5Z_FILTER_DEFLATE, H5Z_FILTER_FLETCHER32));
  H5Pclose(list);
  H5Dclose(set);
}

// Every conversion is to the nearest double: 21 mm is 0.021 m.
TEST(Reading, ConvertsUnitsAndNoise) {
  const Scratch scratch;
  const std::string file = scratch / "a.h5";
  write_throw_log(file, planar_log());
  {
    const Editor f(file);
    f.doubles("/throws/001/landing/pose", {1, 2}, {21, 180}, "mm,deg");
    f.reals("/throws/001/landing/pose", "sigma", {1, 0.5});
    f.doubles("/throws/001/landing/time", {1}, {412}, "ms");
    f.real("/throws/001/landing/time", "sigma", 2);
    std::vector<double> wrench(150, 3);
    f.doubles("/throws/001/ft/wrench", {50, 3}, wrench, "mN, kN, N mm");
    f.real("/throws/001/ft/wrench", "sigma", 1);
  }
  const Throw toss = read_throw_log(file).throws[0];
  EXPECT_EQ(toss.landing->pose(0, 0), 0.021);
  EXPECT_DOUBLE_EQ(toss.landing->pose(0, 1), std::numbers::pi);
  EXPECT_EQ(toss.landing->pose.sigma[0], 0.001);
  EXPECT_DOUBLE_EQ(toss.landing->pose.sigma[1], std::numbers::pi / 360);
  EXPECT_EQ(toss.landing->time(0), 0.412);
  EXPECT_EQ(toss.landing->time.sigma, std::vector<double>{0.002});
  EXPECT_EQ(toss.ft->wrench(9, 0), 0.003);
  EXPECT_EQ(toss.ft->wrench(9, 1), 3000);
  EXPECT_EQ(toss.ft->wrench(9, 2), 0.003);
  EXPECT_THAT(toss.ft->wrench.sigma, testing::ElementsAre(0.001, 1000, 0.001));
}

TEST(Reading, AcceptsOtherWidthsAndStringKinds) {
  const Scratch scratch;
  const std::string file = scratch / "a.h5";
  write_throw_log(file, planar_log());
  {
    const Editor f(file);
    const std::vector<float> single(120, 0.25F);
    f.dataset("/throws/001/hand/twist", H5T_IEEE_F32BE, {40, 3}, nullptr, "m/s,m/s,rad/s");
    f.dataset("/throws/001/hand/acceleration", H5T_NATIVE_FLOAT, {40, 3}, single.data(),
              "m/s^2,m/s^2,rad/s^2");
    const short version = 1;
    f.attribute("/", "schema_version", H5T_NATIVE_SHORT, &version, {1});
    f.fixed_text("/", "title", "padded with blanks", H5T_STR_SPACEPAD, 40);
    f.fixed_text("/", "source", "padded with nothing", H5T_STR_NULLPAD, 40);
    f.fixed_text("/throws/001", "object", "bar", H5T_STR_NULLPAD, 3);
    f.integer("/", "gravity", 10);
    const std::vector<long long> valid(30, 1);
    f.dataset("/throws/002/mocap/valid", H5T_NATIVE_LLONG, {30}, valid.data(), "1");
    for (std::size_t j = 0; j < 3; ++j) f.poke("/throws/002/mocap/pose", 21 + j, 0);
  }
  const ThrowLog log = read_throw_log(file);
  EXPECT_EQ(log.throws[0].hand->acceleration(39, 2), 0.25);
  EXPECT_EQ(log.throws[0].hand->twist(0, 0), 0);
  EXPECT_EQ(log.title, "padded with blanks");
  EXPECT_EQ(log.source, "padded with nothing");
  EXPECT_EQ(log.throws[0].object, "bar");
  EXPECT_EQ(log.gravity, 10);
}

/// An enumeration of single bytes; what h5py writes for numpy's bool is FALSE = 0 and TRUE = 1.
struct Enumeration {
  hid_t type = H5Tenum_create(H5T_NATIVE_SCHAR);
  Enumeration(const char* zero, const char* unity) {
    const signed char values[] = {0, 1};
    H5Tenum_insert(type, zero, &values[0]);
    H5Tenum_insert(type, unity, &values[1]);
  }
  ~Enumeration() { H5Tclose(type); }
  Enumeration(const Enumeration&) = delete;
  Enumeration& operator=(const Enumeration&) = delete;
};

TEST(Reading, AcceptsBooleansAsFlags) {
  const Scratch scratch;
  const std::string file = scratch / "a.h5";
  write_throw_log(file, planar_log());
  const std::string path = "/throws/002/mocap/valid";
  std::vector<signed char> valid(30, 1);
  valid[7] = 0;
  const auto with = [&](const Enumeration& of) {
    const Editor f(file);
    f.dataset(path, of.type, {30}, valid.data(), "1");
  };
  with({"FALSE", "TRUE"});
  Flags expected(30, 1);
  expected[7] = 0;
  EXPECT_EQ(read_throw_log(file).throws[1].mocap->valid, expected);
  for (const auto& [zero, unity] : {std::pair{"LOST", "SEEN"}, {"TRUE", "FALSE"}}) {
    with({zero, unity});
    EXPECT_THAT([&] { read_throw_log(file); },
                testing::ThrowsMessage<LogError>(testing::HasSubstr("an enumeration, expected integers")));
  }
}

TEST(Reading, IgnoresWhatItDoesNotKnow) {
  const Scratch scratch;
  const std::string file = scratch / "a.h5";
  write_throw_log(file, planar_log());
  {
    const Editor f(file);
    f.group("/camera");
    f.text("/", "operator", "somebody");
    f.group("/throws/001/audio");
    f.doubles("/throws/001/hand/torque", {2}, {1, 2}, "furlong");
    f.real("/objects/bar", "colour", 3);
  }
  const std::string before = bytes_of(file);
  expect_same(planar_log(), read_throw_log(file));
  EXPECT_EQ(bytes_of(file), before);
}

TEST(Reading, NormalisesQuaternionsOnce) {
  ThrowLog log = spatial_log();
  Series& pose = log.throws[0].mocap->pose;
  pose(4, 3) = 0.6004;
  const ThrowLog once = reread(log);
  const Series& q = once.throws[0].mocap->pose;
  EXPECT_NEAR(q(4, 3) * q(4, 3) + q(4, 5) * q(4, 5), 1, 4e-16);
  EXPECT_DOUBLE_EQ(q(4, 3) / q(4, 5), 0.6004 / 0.8);
  EXPECT_EQ(q(3, 3), 0.6);  // already unit: untouched
  EXPECT_EQ(reread(once), once);
}

TEST(Reading, LeavesLostOrientationsAsTheyAre) {
  ThrowLog log = spatial_log();
  MocapLog& track = *log.throws[0].mocap;
  track.valid.assign(track.time.rows, 1);
  track.valid[4] = 0;
  for (std::size_t j = 3; j < 7; ++j) track.pose(4, j) = 2;  // of norm 4: what a tracker left there
  const ThrowLog back = reread(log);
  for (std::size_t j = 3; j < 7; ++j) EXPECT_EQ(back.throws[0].mocap->pose(4, j), 2);
}

TEST(ThrowLog, ConditionsAreThoseOfTheSplit) {
  ThrowLog log = planar_log();
  log.throws[0].condition = "a", log.throws[0].split = Split::train;
  log.throws[1].condition = "b", log.throws[1].split = Split::test;
  log.throws.push_back(log.throws[0]);
  using Conditions = std::vector<std::pair<std::string, std::string>>;
  const std::string object = log.throws[0].object;
  EXPECT_EQ(conditions_of(log, Split::train), (Conditions{{object, "a"}}));
  EXPECT_EQ(conditions_of(log, Split::test), (Conditions{{log.throws[1].object, "b"}}));
  EXPECT_EQ(conditions_of(log), (Conditions{{object, "a"}, {log.throws[1].object, "b"}}));
}

// Writing

TEST(Writing, RefusesWhatReadingWouldRefuseAndLeavesNothing) {
  const Scratch scratch;
  const std::string file = scratch / "a.h5";
  const auto expect = [&](auto&& spoil, const std::string& path, const std::string& reason) {
    ThrowLog log = planar_log();
    spoil(log);
    expect_error([&] { write_throw_log(file, log); }, file, path, reason);
    EXPECT_EQ(scratch.files(), 0U);
  };
  expect([](ThrowLog& l) { l.throws[1].hand->twist(3, 1) = std::nan(""); }, "/throws/002/hand/twist",
         "row 3, column vz");
  expect([](ThrowLog& l) { l.throws[1].id = "001"; }, "/throws/001", "used twice");
  expect([](ThrowLog& l) { l.throws[1].mocap->valid[3] = 2; }, "/throws/002/mocap/valid",
         "row 3: 2 is not 0 or 1");
  expect([](ThrowLog& l) { l.title = "half a pair: \xed\xa0\x80"; }, "/@title", "is not UTF-8 text");
  expect([](ThrowLog& l) { l.throws[1].id = "a/b"; }, "/throws", "cannot name a group");
  expect([](ThrowLog& l) { l.throws[1].id = ""; }, "/throws", "cannot name a group");
  expect([](ThrowLog& l) { l.throws.clear(); }, "/throws", "is empty");
  expect([](ThrowLog& l) { l.title = "\xff"; }, "/@title", "UTF-8");
  expect([](ThrowLog& l) { l.title = std::string("a\0b", 3); }, "/@title", "UTF-8");
  expect([](ThrowLog& l) { l.throws[0].hand->pose.data.pop_back(); }, "/throws/001/hand/pose",
         "holds 119 numbers");
  expect([](ThrowLog& l) { l.throws[0].hand->pose.sigma = {1}; }, "/throws/001/hand/pose@sigma",
         "1 values for 3");
  expect([](ThrowLog& l) { l.throws[0].mocap->valid.pop_back(); }, "/throws/001/mocap/valid", "29 rows");
  expect([](ThrowLog& l) { l.throws[0].hand->time = {}; }, "/throws/001/hand/time", "is empty");
  expect([](ThrowLog& l) { l.dimension = 3; }, "/objects/bar@inertia", "1 values, expected 3");
}

/// The text of an attribute; "" where there is none.
std::string text_in(const Editor& f, const std::string& path, const std::string& name) {
  if (H5Aexists_by_name(f.file, path.c_str(), name.c_str(), H5P_DEFAULT) <= 0) return "";
  const hid_t attribute = H5Aopen_by_name(f.file, path.c_str(), name.c_str(), 0, 0);
  const hid_t type = H5Aget_type(attribute);
  std::string out(H5Tget_size(type), '\0');
  must(H5Tis_variable_str(type) == 0 && H5Aread(attribute, type, out.data()) >= 0);
  H5Tclose(type);
  H5Aclose(attribute);
  return out.c_str();
}

TEST(Writing, TakesAlongWhatTheLayoutDoesNotKnow) {
  const Scratch scratch;
  const std::string old = scratch / "old.h5", made = scratch / "made.h5";
  ThrowLog log = planar_log();
  write_throw_log(old, log);
  const std::string throw1 = "/throws/001";
  {
    const Editor f(old);
    f.text("/", "operator", "somebody");
    f.text("/throws", "room", "E2");
    f.real("/objects/bar", "colour", 3);
    f.text("/gripper", "maker", "ours");
    f.group("/lab_notes");
    f.text("/lab_notes", "monday", "rain");
    f.group(throw1 + "/camera");
    f.doubles(throw1 + "/camera/frames", {2}, {1, 2}, "furlong");
    f.doubles(throw1 + "/hand/joints", {2}, {3, 4}, "");
    f.doubles(throw1 + "/mocap/quality", {2}, {5, 6}, "");
    f.text(throw1 + "/mocap/pose", "calibration", "today");
    f.attribute(throw1 + "/ft", "empty", H5T_NATIVE_DOUBLE, "", {0});
    const char* words[] = {"one", "two"};
    const hid_t strings = H5Tcopy(H5T_C_S1);
    H5Tset_size(strings, H5T_VARIABLE);
    f.attribute(throw1, "words", strings, words, {2});
    H5Tclose(strings);
    hobj_ref_t reference{};
    must(H5Rcreate(&reference, f.file, "/lab_notes", H5R_OBJECT, -1) >= 0);
    f.attribute(throw1 + "/mocap/pose", "scale", H5T_STD_REF_OBJ, &reference, {1});
    must(H5Lcreate_soft("/nowhere", f.file, "/soft", 0, 0) >= 0);
    must(H5Lcreate_external("other.h5", "/there", f.file, "/outside", 0, 0) >= 0);
  }
  const std::string before = bytes_of(old);
  const std::map<std::string, std::size_t> ignored{{"/@operator", 1},
                                                   {"/gripper@maker", 1},
                                                   {"/lab_notes", 1},
                                                   {"/objects/*@colour", 1},
                                                   {"/outside", 1},
                                                   {"/soft", 1},
                                                   {"/throws@room", 1},
                                                   {"/throws/*@words", 1},
                                                   {"/throws/*/camera", 1},
                                                   {"/throws/*/ft@empty", 1},
                                                   {"/throws/*/hand/joints", 1},
                                                   {"/throws/*/mocap/pose@calibration", 1},
                                                   {"/throws/*/mocap/pose@scale", 1},
                                                   {"/throws/*/mocap/quality", 1}};
  EXPECT_EQ(ignored_names(old), ignored);
  log = read_throw_log(old);
  log.throws[0].mocap->valid.clear();  // replaced by a track that lost nothing
  for (double& x : log.throws[0].mocap->pose.data) x = 0.5;
  const ExtendedLog extended = to_hdf5_with_extras(log, old);
  put_bytes(made, extended.image);
  EXPECT_EQ(bytes_of(old), before);
  EXPECT_THAT(extended.left_out, testing::ElementsAre(throw1 + "/mocap/pose@scale"));
  expect_same(read_throw_log(made), log);

  const Editor f(made);
  EXPECT_EQ(text_in(f, "/", "operator"), "somebody");
  EXPECT_EQ(text_in(f, "/throws", "room"), "E2");
  EXPECT_EQ(text_in(f, "/gripper", "maker"), "ours");
  EXPECT_EQ(text_in(f, "/lab_notes", "monday"), "rain");
  EXPECT_EQ(text_in(f, throw1 + "/mocap/pose", "calibration"), "today");
  EXPECT_EQ(text_in(f, throw1 + "/camera/frames", "units"), "furlong");
  const auto has_attribute = [&](const std::string& path, const char* name) {
    return H5Aexists_by_name(f.file, path.c_str(), name, H5P_DEFAULT) > 0;
  };
  const auto has = [&](const std::string& path) { return H5Lexists(f.file, path.c_str(), H5P_DEFAULT) > 0; };
  EXPECT_TRUE(has_attribute("/objects/bar", "colour"));
  EXPECT_TRUE(has_attribute(throw1 + "/ft", "empty"));
  EXPECT_FALSE(has_attribute(throw1 + "/mocap/pose", "scale"));
  for (const char* name : {"/hand/joints", "/mocap/quality", "/camera/frames"})
    EXPECT_TRUE(has(throw1 + name));
  EXPECT_FALSE(has(throw1 + "/mocap/valid")) << "known, and no longer there";
  EXPECT_TRUE(has("/soft"));
  EXPECT_TRUE(has("/outside"));
  std::vector<double> joints(2);
  const hid_t set = H5Dopen2(f.file, (throw1 + "/hand/joints").c_str(), 0);
  must(H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, 0, joints.data()) >= 0);
  H5Dclose(set);
  EXPECT_THAT(joints, testing::ElementsAre(3, 4));
  const hid_t words = H5Aopen_by_name(f.file, throw1.c_str(), "words", 0, 0), type = H5Aget_type(words);
  char* both[2] = {};
  must(H5Aread(words, type, both) >= 0);
  EXPECT_STREQ(both[0], "one");
  EXPECT_STREQ(both[1], "two");
  for (char* word : both) H5free_memory(word);
  H5Tclose(type);
  H5Aclose(words);
}

TEST(Writing, AFailureKeepsTheOlderFile) {
  const Scratch scratch;
  const std::string file = scratch / "a.h5";
  write_throw_log(file, planar_log());
  const std::string before = bytes_of(file);
  ThrowLog bad = planar_log();
  bad.gravity = -1;
  EXPECT_THROW(write_throw_log(file, bad), LogError);
  EXPECT_EQ(bytes_of(file), before);
  write_throw_log(file, spatial_log());  // and a success replaces it
  EXPECT_EQ(read_throw_log(file).dimension, 3);
  EXPECT_EQ(scratch.files(), 1U);
}

TEST(Writing, NamesADestinationThatCannotBe) {
  const Scratch scratch;
  const std::string nowhere = scratch / "no/such/folder/a.h5", folder = scratch / ".";
  expect_error([&] { write_throw_log(nowhere, planar_log()); }, nowhere, "/",
               "cannot be written: No such file or directory");
  expect_error([&] { write_throw_log(folder, planar_log()); }, folder, "/", "is a directory");
  EXPECT_EQ(scratch.files(), 0U);
}

}  // namespace
}  // namespace unhand::datasets::test
