// Text tables of others, line by line and cell by cell, with the place of everything in them. Private to the
// module.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/log_error.hpp"

namespace unhand::datasets {

/// One line: its cells without quotes and without spaces around them.
struct CsvLine {
  std::string file;
  int number = 0;    // from 1
  std::string text;  // as it stands in the file, without the line's end
  std::vector<std::string> cells;

  /// Throws ImportError: "FILE: line L, column NAME: WHY", without the column where `column` is empty.
  [[noreturn]] void fail(std::string_view column, const std::string& why) const;

  /// The number in cell i, finite. `column` names it in errors. Where cells are not separated by commas, a
  /// decimal comma is a decimal point. Throws ImportError.
  double real(std::size_t i, std::string_view column) const;
  /// A whole number; 3.0 is one, too.
  int integer(std::size_t i, std::string_view column) const;
  bool is_number(std::size_t i) const;

  /// Throws ImportError where the line does not hold that many cells.
  void expect_cells(std::size_t n) const;

  bool decimal_comma = false;
  bool cut_off = false;  // the file ends here, in the middle of a line
};

/// The lines of a text file. `separator` '\0' is found out from the first line: tab, semicolon or comma.
class CsvReader {
 public:
  /// Throws ImportError where there is no such file.
  explicit CsvReader(const std::filesystem::path& file, char separator = ',');

  /// The next line that is not blank, or false at the end of the file.
  bool next(CsvLine& line);

  [[noreturn]] void fail(int line, const std::string& why) const;
  int line() const { return number_; }  ///< the last one read

 private:
  std::string file_;
  std::ifstream in_;
  char separator_;
  int number_ = 0;
};

}  // namespace unhand::datasets
