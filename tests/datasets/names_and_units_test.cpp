// Misspelled names, units, and the list of all datasets.
#include "datasets/near_miss.hpp"
#include "datasets/reference.hpp"
#include "datasets/units.hpp"
#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

TEST(NearMiss, DistanceIsAMetricOnSmallChanges) {
  EXPECT_EQ(edit_distance("twist", "twist"), 0);
  EXPECT_EQ(edit_distance("twsit", "twist"), 1);  // neighbours swapped
  EXPECT_EQ(edit_distance("Twist", "twist"), 0);  // case
  EXPECT_EQ(edit_distance("twis", "twist"), 1);
  EXPECT_EQ(edit_distance("", "abc"), 3);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3);
  EXPECT_EQ(edit_distance("sitting", "kitten"), 3);
}

TEST(NearMiss, TellsMisspellingsFromOtherWords) {
  for (const auto& [name, known] :
       std::initializer_list<std::pair<const char*, const char*>>{{"twsit", "twist"},
                                                                  {"Mocap", "mocap"},
                                                                  {"acceleraton", "acceleration"},
                                                                  {"license", "licence"},
                                                                  {"unit", "units"},
                                                                  {"tf", "ft"},
                                                                  {"IMU", "imu"},
                                                                  {"ftt", "ft"},
                                                                  {"fft", "ft"},
                                                                  {"F_T", "ft"},
                                                                  {"imus", "imu"},
                                                                  {"poses", "pose"}}) {
    EXPECT_TRUE(is_near_miss(name, known)) << name << " for " << known;
  }
  for (const auto& [name, known] :
       std::initializer_list<std::pair<const char*, const char*>>{{"twist", "twist"},
                                                                  {"fx", "ft"},
                                                                  {"ft2", "ft"},
                                                                  {"fto", "ft"},
                                                                  {"aft", "ft"},
                                                                  {"sky", "sku"},
                                                                  {"colour", "source"},
                                                                  {"torque", "twist"},
                                                                  {"time_raw", "time"},
                                                                  {"audio", "hand"},
                                                                  {"operator", "objects"},
                                                                  {"name", "mass"}}) {
    EXPECT_FALSE(is_near_miss(name, known)) << name << " for " << known;
  }
}

TEST(NearMiss, PicksTheNearest) {
  const std::string_view known[] = {"detach_time", "detach_times", "grasp_angle"};
  EXPECT_EQ(nearest_name("detach_tmies", known), "detach_times");
  EXPECT_EQ(nearest_name("graps_angle", known), "grasp_angle");
  EXPECT_EQ(nearest_name("weather", known), "");
}

TEST(Units, ConvertToTheNearestDouble) {
  EXPECT_EQ(find_unit("mm")->to_si(21), 0.021);
  EXPECT_EQ(find_unit("ms")->to_si(3), 0.003);
  EXPECT_EQ(find_unit("us")->to_si(7), 7e-6);
  EXPECT_EQ(find_unit("g")->to_si(246), 0.246);
  EXPECT_DOUBLE_EQ(find_unit("deg/s")->to_si(180), 3.141592653589793);
  EXPECT_EQ(find_unit("m")->to_si(0.1), 0.1);
}

TEST(Units, KnowTheirQuantityAndSpellings) {
  for (const char* torque : {"N m", "N*m", "N·m", " N m "}) {
    ASSERT_NE(find_unit(torque), nullptr) << torque;
    EXPECT_EQ(find_unit(torque)->quantity, Quantity::torque);
  }
  EXPECT_EQ(find_unit("m/s²"), find_unit("m/s^2"));
  EXPECT_EQ(find_unit("rad")->quantity, Quantity::angle);
  EXPECT_EQ(find_unit("1")->quantity, Quantity::number);
  for (const char* none : {"", "meter", "M", "Nm s", "m/s/s", "mm,"})
    EXPECT_EQ(find_unit(none), nullptr) << none;
  EXPECT_THAT(units_of(Quantity::angle),
              testing::AllOf(testing::HasSubstr("rad"), testing::HasSubstr("deg")));
}

// The documented layout is the table that reader and writer use.
TEST(Layout, ListsEveryDatasetByDimension) {
  const auto paths = [](int dimension) {
    std::vector<std::string> out;
    for (const LayoutRow& row : throw_log_layout(dimension))
      out.push_back(row.path + " " + row.shape + " " + row.units);
    return out;
  };
  EXPECT_EQ(paths(2).size(), 15U);
  EXPECT_THAT(paths(2), testing::Contains("hand/acceleration (N,3) m/s^2,m/s^2,rad/s^2"));
  EXPECT_THAT(paths(2), testing::Contains("landing/pose (1,2) m,rad"));
  EXPECT_THAT(paths(3), testing::Contains("mocap/pose (N,7) m,m,m,1,1,1,1"));
  EXPECT_THAT(paths(3), testing::Contains("mocap/pose (N,3) m,m,m"));
  EXPECT_THAT(paths(3), testing::Not(testing::Contains(testing::StartsWith("hand/"))));
}

TEST(Reference, IsLabelledAsReported) {
  for (const ReportedModel& model : release_models_as_reported.models) {
    EXPECT_THAT(std::string(model.label), testing::HasSubstr("as reported"));
  }
  EXPECT_EQ(release_models_as_reported.throws,
            2 * 3 * 6 * 5);  // offsets, pitches, accelerations, repetitions
}

}  // namespace
}  // namespace unhand::datasets::test
