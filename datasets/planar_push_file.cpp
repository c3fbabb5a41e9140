#include "datasets/planar_push_file.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <string>
#include <string_view>

#include "datasets/attribute_fields.hpp"
#include "datasets/file_kind.hpp"
#include "datasets/log_error.hpp"

namespace unhand::datasets {
namespace {

constexpr double norm_tolerance = 2e-3;  // the robot's quaternions have three decimals
constexpr int most_rows = 10'000'000;
constexpr std::string_view blanks = " \t\r";

/// The lines of the file, one after another, and the numbers in each.
class Lines {
 public:
  explicit Lines(const std::filesystem::path& file) : name_(file.string()) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) throw ImportError(name_, "", "no such file");
    in_.open(file, std::ios::binary);
    if (!in_) throw ImportError(name_, "", "cannot be read");
  }

  [[noreturn]] void fail(const std::string& why, std::string_view column = {}) const {
    throw ImportError(
        name_,
        column.empty() ? fmt::format("line {}", number_) : fmt::format("line {}, column {}", number_, column),
        why);
  }

  /// `values` from the next line, which names its columns.
  template <std::size_t N>
  std::array<double, N> numbers(const std::array<std::string_view, N>& columns, std::string_view what) {
    next(what);
    std::string_view rest = text_;
    std::array<double, N> out{};
    for (std::size_t j = 0; j < N; ++j) {
      const std::string_view part = word(rest);
      if (part.empty()) fail(fmt::format("{} of {} numbers of {}", j, N, what), columns[j]);
      out[j] = number<double>(part, columns[j]);
    }
    if (const auto extra = word(rest); !extra.empty())
      fail(fmt::format("'{}' after the {} numbers of {}", extra, N, what), fmt::format("{}", N + 1));
    return out;
  }

  int count(std::string_view what, int least) {
    next(what);
    std::string_view rest = text_;
    const int n = number<int>(word(rest), what);
    if (!word(rest).empty()) fail("one number was expected", what);
    if (n < least || n > most_rows) fail(fmt::format("{} is not in {} ... {}", n, least, most_rows), what);
    return n;
  }

  void expect_end() {
    while (std::getline(in_, text_)) {
      ++number_;
      std::string_view rest = text_;
      if (const auto extra = word(rest); !extra.empty())
        fail(fmt::format("'{}' after the last push", extra.substr(0, 20)));
    }
  }

 private:
  void next(std::string_view what) {
    ++number_;
    if (!std::getline(in_, text_)) fail(fmt::format("the file ends where {} should be", what));
    if (number_ == 1 && text_.starts_with("\xef\xbb\xbf")) text_.erase(0, 3);  // a byte order mark
    if (!is_utf8_text(text_)) fail(with_kind("is not UTF-8 text", number_ == 1 ? kind_of_file(name_) : ""));
  }

  static std::string_view word(std::string_view& rest) {
    const auto begin = rest.find_first_not_of(blanks);
    if (begin == std::string_view::npos) return {};
    const auto end = std::min(rest.find_first_of(blanks, begin), rest.size());
    const auto out = rest.substr(begin, end - begin);
    rest.remove_prefix(end);
    return out;
  }

  template <class Number>
  Number number(std::string_view part, std::string_view column) const {
    Number value{};
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    constexpr bool whole = std::is_integral_v<Number>;
    if (error != std::errc{} || end != part.data() + part.size())
      fail(fmt::format("'{}' is not {}", part.substr(0, 40), whole ? "an integer" : "a number"), column);
    if constexpr (!whole) {
      if (!std::isfinite(value)) fail(fmt::format("{} is not finite", value), column);
    }
    return value;
  }

  std::string name_, text_;
  std::ifstream in_;
  int number_ = 0;
};

template <std::size_t N>
std::array<double, 7> pose_of(const std::array<double, N>& row, const Lines& lines) {
  std::array<double, 7> out;
  std::copy(row.end() - 7, row.end(), out.begin());
  const double norm = std::sqrt(out[3] * out[3] + out[4] * out[4] + out[5] * out[5] + out[6] * out[6]);
  if (std::abs(norm - 1) > norm_tolerance)
    lines.fail(fmt::format("quaternion of norm {:.6g}, expected 1", norm), "qw");
  return out;
}

template <class Row>
void append(std::vector<Row>& rows, const Row& row, const Lines& lines) {
  if (!rows.empty() && row.time <= rows.back().time)
    lines.fail(
        fmt::format("time is not strictly increasing: {:.9f} after {:.9f}", row.time, rows.back().time), "t");
  rows.push_back(row);
}

}  // namespace

std::vector<RawPush> read_push_file(const std::filesystem::path& file) {
  Lines lines(file);
  std::vector<RawPush> out;
  const int pushes = lines.count("number of pushes", 1);
  for (int k = 0; k < pushes; ++k) {
    RawPush push;
    constexpr std::array<std::string_view, 7> pose{"x", "y", "z", "qw", "qx", "qy", "qz"};
    push.before = pose_of(lines.numbers(pose, "the object's pose before the push"), lines);
    push.after = pose_of(lines.numbers(pose, "the object's pose after the push"), lines);
    const int forces = lines.count("number of force samples", 2);
    for (int i = 0; i < forces; ++i) {
      const auto row = lines.numbers(std::array<std::string_view, 3>{"t", "fx", "fy"}, "a force sample");
      append(push.forces, TimedForce{row[0], {row[1], row[2]}}, lines);
    }
    const int poses = lines.count("number of robot poses", 2);
    for (int i = 0; i < poses; ++i) {
      const auto row = lines.numbers(
          std::array<std::string_view, 8>{"t", "x", "y", "z", "qw", "qx", "qy", "qz"}, "a robot pose");
      append(push.robot, TimedPose{row[0], pose_of(row, lines)}, lines);
    }
    out.push_back(std::move(push));
  }
  lines.expect_end();
  return out;
}

}  // namespace unhand::datasets
