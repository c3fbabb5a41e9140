// A lab's own CSV columns, by name and by number.
#include "datasets/import_columns.hpp"

#include <numbers>
#include <stdexcept>

#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

using testing::HasSubstr;

const ColumnMap ft_map{
    {{"time", "t"}, {"fx", "-Fx"}, {"fz", "Fz"}, {"tau", "Ty"}, {"normal", "grip"}}, {}, {}, 0};
const std::string ft_header = "t [ms],Fz (N),Fx (N),Ty (Nmm),grip (N)\n";

ColumnMap hand_map() {
  ColumnMap map;
  int k = 0;
  for (const std::string& name : channels_of(TableKind::hand)) map.columns[name] = "#" + std::to_string(++k);
  map.units = {{"time", "s"}, {"x", "mm"},        {"z", "mm"},     {"theta", "deg"}, {"vx", "m/s"},
               {"vz", "m/s"}, {"omega", "deg/s"}, {"ax", "m/s^2"}, {"az", "m/s^2"},  {"alpha", "deg/s^2"}};
  return map;
}

TEST(ColumnsImport, ForceAndTorqueByName) {
  const Scratch scratch;
  put_bytes(scratch / "ft.csv", ft_header + "10,1,2,300,40\n11,-1,-2,-300,41\n");
  ColumnMap map = ft_map;
  map.sigma = {{"fx", 0.02}, {"fz", 0.03}, {"tau", 2}};
  map.time_offset = 0.5;
  const FtLog ft = read_ft_csv(scratch / "ft.csv", map);
  EXPECT_EQ(ft.time, (Series{2, 1, {0.51, 0.511}, {}}));
  EXPECT_EQ(ft.wrench, (Series{2, 3, {-2, 1, 0.3, 2, -1, -0.3}, {0.02, 0.03, 0.002}}));
  EXPECT_EQ(ft.normal_force, (Series{2, 1, {40, 41}, {}}));
}

TEST(ColumnsImport, HandByNumberWithoutHeader) {
  const Scratch scratch;
  put_bytes(scratch / "hand.csv", "0;100;200;170,5;1;2;90;3;4;180\n0,1;101;201;-179,5;1;2;90;3;4;180\n");
  const HandLog hand = read_hand_csv(scratch / "hand.csv", hand_map());
  ASSERT_EQ(hand.time.rows, 2U);
  EXPECT_EQ(hand.pose(0, 0), 0.1);
  EXPECT_DOUBLE_EQ(hand.pose(1, 2), 180.5 * std::numbers::pi / 180);  // unwrapped
  EXPECT_DOUBLE_EQ(hand.twist(0, 2), std::numbers::pi / 2);
  EXPECT_DOUBLE_EQ(hand.acceleration(1, 2), std::numbers::pi);
}

// Lost rows are marked, never filled in; the angle counts on across them.
TEST(ColumnsImport, ATrackedObjectWithLosses) {
  const Scratch scratch;
  const std::string file = scratch / "mocap.csv";
  ColumnMap map{{{"time", "t"}, {"x", "X"}, {"z", "Z"}, {"theta", "-pitch"}}, {}, {}, -1};
  map.sigma = {{"x", 0.2}, {"z", 0.3}, {"theta", 0.9}};
  put_bytes(file,
            "\xef\xbb\xbf"
            "frame,Z (mm),X (mm),pitch (deg),t (s)\r\n1,800,500,-179,1.5\r\n2,,,,1.6\r\n"
            "3,NaN,510,1,1.7\r\n4,810,520,179,1.8\r\n5,805,530,170,1.9\r\n");
  const MocapLog mocap = read_mocap_csv(file, map);
  EXPECT_EQ(mocap.valid, (Flags{1, 0, 0, 1, 1}));
  ASSERT_EQ(mocap.time.rows, 5U);
  EXPECT_NEAR(mocap.time(3), 0.8, 1e-12);
  constexpr double degree = std::numbers::pi / 180;
  EXPECT_DOUBLE_EQ(mocap.pose(0, 0), 0.5);
  EXPECT_DOUBLE_EQ(mocap.pose(0, 1), 0.8);
  EXPECT_NEAR(mocap.pose(0, 2), 179 * degree, 1e-12);
  EXPECT_NEAR(mocap.pose(3, 2), 181 * degree, 1e-12);
  EXPECT_NEAR(mocap.pose(4, 2), 190 * degree, 1e-12);
  for (std::size_t j = 0; j < 3; ++j)
    EXPECT_TRUE(std::isnan(mocap.pose(1, j)) && std::isnan(mocap.pose(2, j)));
  const std::vector<double> sigma{2e-4, 3e-4, 0.9 * degree};
  for (std::size_t j = 0; j < 3; ++j) EXPECT_DOUBLE_EQ(mocap.pose.sigma[j], sigma[j]);

  put_bytes(file, "t (s),X (m),Z (m),pitch (deg)\n0,,,\n1,,,\n");
  expect_error<ImportError>([&] { read_mocap_csv(file, map); }, file, "", "lost in all of its 2 rows");
  // Without a header, too, and as C prints what is no number.
  put_bytes(file, "0,,,\n0.1,-nan,1,0\n0.2,1,1,1\n");
  ColumnMap numbered{{{"time", "#1"}, {"x", "#2"}, {"z", "#3"}, {"theta", "#4"}}, {}, {}, 0};
  numbered.units = {{"time", "s"}, {"x", "m"}, {"z", "m"}, {"theta", "rad"}};
  EXPECT_EQ(read_mocap_csv(file, numbered).valid, (Flags{0, 0, 1}));
  put_bytes(file, "0,-,1,0\n0.1,1,1,0\n");
  expect_error<ImportError>([&] { read_mocap_csv(file, numbered); }, file, "line 1, column #2",
                            "'-' is not a number");
  put_bytes(file, "t (s),X (m),Z (m),pitch (deg)\n0,1,1,x\n");
  expect_error<ImportError>([&] { read_mocap_csv(file, map); }, file, "line 2, column pitch (deg)",
                            "'x' is not a number");
  // Half of a number is none, and no loss that a tracker tells.
  for (const std::string cell : {"-", "+", "-na", "+n/a"}) {
    put_bytes(file, "t (s),X (m),Z (m),pitch (deg)\n0,1,1," + cell + "\n");
    expect_error<ImportError>([&] { read_mocap_csv(file, map); }, file, "line 2, column pitch (deg)",
                              "'" + cell + "' is not a number");
  }
  put_bytes(file, "t (s),X (m),Z (m),pitch (deg)\n,1,1,1\n");
  expect_error<ImportError>([&] { read_mocap_csv(file, map); }, file, "line 2, column t (s)",
                            "'' is not a number");
  map.sigma.erase("z");
  EXPECT_THAT(fault_of(map, TableKind::mocap), HasSubstr("for all of x, z, theta or for none"));
}

TEST(ColumnsImport, HeadersOfSeveralSpellings) {
  const Scratch scratch;
  put_bytes(scratch / "ft.csv", "\"t\"\tFz_[N]\tFx\t\"Ty (N m)\"\tgrip\n0\t1\t2\t3\t4\n");
  ColumnMap map = ft_map;
  map.units = {{"time", "sec"}, {"fx", "kN"}, {"normal", "N"}, {"tau", "mNm"}};  // said wins over written
  const FtLog ft = read_ft_csv(scratch / "ft.csv", map);
  EXPECT_EQ(ft.wrench.data, (std::vector<double>{-2000, 1, 0.003}));
}

TEST(ColumnsImport, SaysWhichLineAndColumn) {
  const Scratch scratch;
  const std::string file = scratch / "ft.csv";
  const auto expect = [&](const std::string& text, const ColumnMap& map, const std::string& place,
                          const std::string& reason) {
    put_bytes(file, text);
    expect_error<ImportError>([&] { read_ft_csv(file, map); }, file, place, reason);
  };
  const std::string row = "10,1,2,300,40\n";
  expect("", ft_map, "line 1", "is empty");
  expect(ft_header, ft_map, "line 1", "holds no rows");
  expect(row + row, ft_map, "line 1", "the header is missing");
  expect(ft_header + row + row, ft_map, "line 3, column t [ms]",
         "time is not strictly increasing: 0.01 s after 0.01 s");
  expect(ft_header + "10,1,nan,300,40\n", ft_map, "line 2, column Fx (N)", "not finite");
  expect(ft_header + "10,1,,300,40\n", ft_map, "line 2, column Fx (N)", "'' is not a number");
  expect(ft_header + row + "11,1,2", ft_map, "line 3", "is it cut off?");
  expect("t [ms],Fz (N),Fx,Ty (Nmm),grip (N)\n" + row, ft_map, "line 1, column Fx",
         "has no unit: give fx=UNIT (N, mN, kN)");
  expect("t [ms],Fz (N),Fx (lbf),Ty (Nmm),grip (N)\n" + row, ft_map, "line 1, column Fx (lbf)",
         "unit 'lbf' is not known");
  expect("t [ms],Fz (N),Fx (m),Ty (Nmm),grip (N)\n" + row, ft_map, "line 1, column Fx (m)",
         "unit 'm' is for length, but fx is measured in N, mN, kN");
  expect("t [ms],Fz (N),Fx (N),Ty (Nmm),girp (N)\n" + row, ft_map, "line 1",
         "there is no column 'grip' for normal; did you mean 'girp'?");
  expect("t [ms],Fz (N),Fx (N),Ty (Nmm),Fx (N)\n" + row, ft_map, "line 1, column Fx", "stands 2 times");
  ColumnMap map = ft_map;
  map.columns["normal"] = "#6";
  expect(ft_header + row, map, "line 1", "normal=#6 of 5 columns");
}

TEST(ColumnsImport, MapsAreChecked) {
  const auto fault = [](const auto& change) {
    ColumnMap map = ft_map;
    change(map);
    EXPECT_THROW(read_ft_csv("none.csv", map), std::invalid_argument);
    return fault_of(map, TableKind::ft);
  };
  EXPECT_EQ(fault_of(ft_map, TableKind::ft), "");
  EXPECT_THAT(fault([](ColumnMap& m) { m.columns.erase("tau"); }), HasSubstr("'tau' is missing"));
  EXPECT_THAT(fault([](ColumnMap& m) { m.columns["nromal"] = "x"; }), HasSubstr("did you mean 'normal'?"));
  EXPECT_THAT(fault([](ColumnMap& m) { m.units["ax"] = "m"; }), HasSubstr("units: there is no channel 'ax'"));
  EXPECT_THAT(fault([](ColumnMap& m) { m.sigma["fx"] = 1; }),
              HasSubstr("for all of fx, fz, tau or for none"));
  EXPECT_THAT(fault([](ColumnMap& m) { m.sigma["normal"] = -1; }), HasSubstr("normal=-1 is not >= 0"));
}

}  // namespace
}  // namespace unhand::datasets::test
