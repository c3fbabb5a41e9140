// Tables of text as spreadsheets and recorders write them.
#include "datasets/csv.hpp"
#include "datasets/file_kind.hpp"
#include "datasets/near_miss.hpp"

#include "log_samples.hpp"

namespace unhand::datasets::test {
namespace {

std::vector<CsvLine> lines_of(const std::string& file, char separator = ',') {
  CsvReader reader(file, separator);
  std::vector<CsvLine> lines;
  for (CsvLine line; reader.next(line);) lines.push_back(line);
  return lines;
}

TEST(Csv, CellsAsSpreadsheetsWriteThem) {
  const Scratch scratch;
  put_bytes(scratch / "a.csv", "\xef\xbb\xbf\"a, b\" , c,\"say \"\"d\"\"\"\r\n\r\n 1 ,+2.5e1,\n , ,");
  const auto lines = lines_of(scratch / "a.csv");
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_THAT(lines[0].cells, testing::ElementsAre("a, b", "c", "say \"d\""));
  EXPECT_THAT(lines[1].cells, testing::ElementsAre("1", "+2.5e1", ""));
  EXPECT_EQ(lines[1].number, 3);  // the blank line counts
  EXPECT_EQ(lines[1].integer(0, "a"), 1);
  EXPECT_EQ(lines[1].real(1, "b"), 25);
  EXPECT_FALSE(lines[1].is_number(2));
  EXPECT_FALSE(lines[1].cut_off);
  EXPECT_TRUE(lines[2].cut_off);
}

TEST(Csv, SeparatorsAndDecimalCommas) {
  const Scratch scratch;
  put_bytes(scratch / "a.csv", "t;x, y\n0,5;-1,25E-3\n");
  const auto lines = lines_of(scratch / "a.csv", '\0');
  EXPECT_THAT(lines.at(0).cells, testing::ElementsAre("t", "x, y"));
  EXPECT_EQ(lines.at(1).real(0, "t"), 0.5);
  EXPECT_EQ(lines.at(1).real(1, "x, y"), -1.25e-3);
  put_bytes(scratch / "b.csv", "1.5\t2\n");
  EXPECT_EQ(lines_of(scratch / "b.csv", '\0').at(0).real(0, "t"), 1.5);
}

TEST(Csv, SaysWhereAndWhat) {
  const Scratch scratch;
  const std::string file = scratch / "a.csv";
  const auto expect = [&](const std::string& text, const std::string& place, const std::string& reason) {
    put_bytes(file, text);
    expect_error<ImportError>(
        [&] {
          for (const CsvLine& line : lines_of(file)) {
            line.expect_cells(2);
            line.real(0, "t");
            line.integer(1, "n");
          }
        },
        file, place, reason);
  };
  expect("1,2\n1,2,3\n", "line 2", "3 values, expected 2");
  expect("1,2\n3", "line 2", "the file ends here, in the middle of a line");
  expect("1,2\n\n1.2.3,4\n", "line 3, column t", "'1.2.3' is not a number");
  expect("nan,2\n", "line 1, column t", "nan is not finite");
  expect("1e999,2\n", "line 1, column t", "is not a number");
  expect("1,2.5\n", "line 1, column n", "'2.5' is not an integer");
  expect("1,\"2\n", "line 1", "a quote is opened and not closed");
  expect(std::string("1,\0002\n", 5), "line 1", "is not UTF-8 text");
  expect(
      "\xff\xfe"
      "1,2\n",
      "line 1", "UTF-16");
  const std::string long_cell(60, 'x');
  expect(long_cell + ",2\n", "line 1, column t", "xxx...' is not a number");
  expect_error<ImportError>([&] { lines_of(scratch / "none.csv"); }, scratch / "none.csv", "",
                            "no such file");
}

TEST(Csv, UnknownNames) {
  EXPECT_EQ(unknown_name("no 'ptich'", "ptich", {"x", "pitch"}), "no 'ptich'; did you mean 'pitch'?");
  EXPECT_EQ(unknown_name("no 'q'", "q", {"x", "", "pitch"}), "no 'q' (there are: x, pitch)");
  EXPECT_THAT(unknown_name("no 'q'", "q", std::vector<std::string>(40, "column")),
              testing::EndsWith(", ...)"));
  EXPECT_EQ(unknown_name("no 'flight.q'", "flight.q", {"sensor.mass", "flight.wind", "flight.drift"}),
            "no 'flight.q' (there are: flight.wind, flight.drift)");
  const std::vector<std::string> ids{"sensor.mass", "flight.wind", "hand.lag", "arm.lag"};
  EXPECT_EQ(unknown_name("no 'wind'", "wind", ids), "no 'wind'; did you mean 'flight.wind'?");
  EXPECT_EQ(unknown_name("no 'widn'", "widn", ids), "no 'widn'; did you mean 'flight.wind'?");
  EXPECT_THAT(unknown_name("no 'lag'", "lag", ids), testing::HasSubstr("there are: "))
      << "of which of the two?";
  EXPECT_EQ(unknown_name("no '1'", "1", {"001", "010"}), "no '1'; did you mean '001'?");
  EXPECT_EQ(unknown_name("no '0'", "0", {"000", "toss-0"}), "no '0'; did you mean '000'?");
  EXPECT_EQ(unknown_name("no '2'", "2", {"001", "010"}), "no '2' (there are: 001, 010)");
}

TEST(FileKind, IsToldByTheFirstBytes) {
  EXPECT_EQ(kind_of("\x89HDF\r\n\x1a\n..."), "an HDF5 file");
  EXPECT_EQ(kind_of("{\n \"schema\": \"model-card\","), "a model card (JSON)");
  EXPECT_EQ(kind_of("\n{\"schema\" :\"fit\"}"), "JSON of schema 'fit'");
  for (const char* json : {"{}", "{\"a\": 1}", "{\"schema\"", "{\"schema\": 3}", "{\"schema\": \"fi"})
    EXPECT_EQ(kind_of(json), "JSON") << json;
  for (const char* other : {"", " \n", "name = 'bar'\n", "[table]\n", "t,x\n1,2\n"})
    EXPECT_EQ(kind_of(other), "");
  EXPECT_TRUE(begins_json_object(" \n{")) << "blanks may come first";
  EXPECT_TRUE(begins_json_object("\xef\xbb\xbf{}")) << "and a byte order mark";
  for (const char* other : {"", "[1]", "name = 'bar'\n"}) EXPECT_FALSE(begins_json_object(other));
  EXPECT_EQ(with_kind("is no log", kind_of("{}")), "is no log; it is JSON");
  EXPECT_EQ(with_kind("is no log", ""), "is no log");
}

}  // namespace
}  // namespace unhand::datasets::test
