#include "datasets/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "datasets/attribute_fields.hpp"
#include "datasets/file_kind.hpp"

namespace unhand::datasets {
namespace {

constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";

std::string trimmed(std::string_view part) {
  while (!part.empty() && (part.front() == ' ' || part.front() == '\t')) part.remove_prefix(1);
  while (!part.empty() && (part.back() == ' ' || part.back() == '\t')) part.remove_suffix(1);
  return std::string(part);
}

/// What a message shows of a cell.
std::string shown(std::string_view cell) {
  return cell.size() <= 40 ? std::string(cell) : std::string(cell.substr(0, 37)) + "...";
}

char find_separator(std::string_view text) {
  for (const char candidate : {'\t', ';'})
    if (text.find(candidate) != std::string_view::npos) return candidate;
  return ',';
}

/// Cells in double quotes may hold separators; two quotes in one are a quote.
std::vector<std::string> split(const CsvLine& line, char separator) {
  std::vector<std::string> cells;
  std::string cell;
  bool quoted = false, was_quoted = false;
  const auto finish = [&] {
    cells.push_back(was_quoted ? cell : trimmed(cell));
    cell.clear();
    was_quoted = false;
  };
  const std::string& text = line.text;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted && c == '"' && i + 1 < text.size() && text[i + 1] == '"') {
      cell += c;
      ++i;
    } else if (c == '"' && (quoted || trimmed(cell).empty())) {
      if (!quoted) cell.clear();
      quoted = !quoted;
      was_quoted = true;
    } else if (c == separator && !quoted) {
      finish();
    } else if (!was_quoted || quoted || (c != ' ' && c != '\t')) {
      cell += c;
    }
  }
  if (quoted) line.fail("", "a quote is opened and not closed");
  finish();
  return cells;
}

template <class Number>
bool parse(std::string_view text, Number& value) {
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

bool parse_real(const CsvLine& line, std::size_t i, double& value) {
  std::string cell = line.cells[i];
  if (line.decimal_comma && cell.find('.') == std::string::npos)
    std::replace(cell.begin(), cell.end(), ',', '.');
  return parse(cell, value);
}

}  // namespace

void CsvLine::fail(std::string_view column, const std::string& why) const {
  throw ImportError(
      file,
      column.empty() ? fmt::format("line {}", number) : fmt::format("line {}, column {}", number, column),
      why);
}

double CsvLine::real(std::size_t i, std::string_view column) const {
  double value = 0;
  if (!parse_real(*this, i, value)) fail(column, fmt::format("'{}' is not a number", shown(cells[i])));
  if (!std::isfinite(value)) fail(column, fmt::format("{} is not finite", value));
  return value;
}

int CsvLine::integer(std::size_t i, std::string_view column) const {
  int value = 0;
  if (parse(cells[i], value)) return value;
  double real = 0;
  if (parse_real(*this, i, real) && real == std::floor(real) && std::abs(real) < 1e9)
    return static_cast<int>(real);
  fail(column, fmt::format("'{}' is not an integer", shown(cells[i])));
}

bool CsvLine::is_number(std::size_t i) const {
  double value = 0;
  return parse_real(*this, i, value);
}

void CsvLine::expect_cells(std::size_t n) const {
  if (cells.size() == n) return;
  fail("", fmt::format("{} values, expected {}{}", cells.size(), n,
                       cut_off ? "; the file ends here, in the middle of a line: is it cut off?" : ""));
}

CsvReader::CsvReader(const std::filesystem::path& file, char separator)
    : file_(file.string()), in_(file, std::ios::binary), separator_(separator) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error)) fail(0, "is a folder, expected a text file");
  if (!std::filesystem::exists(file, error)) fail(0, "no such file");
  if (!in_) fail(0, "cannot be opened");
}

void CsvReader::fail(int line, const std::string& why) const {
  throw ImportError(file_, line > 0 ? fmt::format("line {}", line) : "", why);
}

bool CsvReader::next(CsvLine& line) {
  line.file = file_;
  while (std::getline(in_, line.text)) {
    line.number = ++number_;
    line.cut_off = in_.eof();
    if (line.text.ends_with('\r')) line.text.pop_back();
    if (number_ == 1) {
      if (line.text.starts_with(byte_order_mark)) line.text.erase(0, byte_order_mark.size());
      if (line.text.starts_with("\xff\xfe") || line.text.starts_with("\xfe\xff"))
        line.fail("", "is UTF-16 text, expected UTF-8: save it again as CSV UTF-8");
    }
    if (!is_utf8_text(line.text))
      line.fail("", with_kind("is not UTF-8 text", number_ == 1 ? kind_of_file(file_) : ""));
    if (trimmed(line.text).empty()) continue;
    if (separator_ == '\0') separator_ = find_separator(line.text);
    line.decimal_comma = separator_ != ',';
    line.cells = split(line, separator_);
    return true;
  }
  if (in_.bad()) fail(number_, "cannot be read");
  return false;
}

}  // namespace unhand::datasets
