// Tables of a TOML file, asked key by key; every mistake is told with line, column, value and accepted range.
#pragma once

#include <toml++/toml.h>
#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/log_error.hpp"

namespace unhand::datasets {

/// Accepted values of a key, ends included unless open.
struct TomlLimits {
  double low, high;  ///< in `unit`
  bool open_low;     ///< `low` itself is not accepted
  const char* unit;  ///< for the message

  /// True for an accepted value; false for NaN.
  bool accept(double value) const { return value <= high && (open_low ? value > low : value >= low); }
  /// "(0, 10] m"
  std::string text() const;
};

/// A table whose keys are asked for one by one; a key nobody asked for is an error. All throw TomlError.
class TomlKeys {
 public:
  /// The table of a whole file.
  static TomlKeys parse(const std::filesystem::path& file);
  /// The same of text that comes with the library; `name` stands for the file in errors.
  static TomlKeys parse_text(std::string_view text, const std::string& name);

  /// Throws TomlError with the place of `key`, or of its table where the key is missing.
  [[noreturn]] void fail(std::string_view key, const std::string& why) const;

  /// The number of that key, if it is there; an integer counts as one.
  std::optional<double> number(std::string_view key, const TomlLimits& limits);
  /// The text of that key, if it is there.
  std::optional<std::string> text(std::string_view key);
  /// A list of as many numbers as `out` holds; false: there is none.
  bool numbers(std::string_view key, const TomlLimits& limits, std::span<double> out);
  /// A list of three numbers, if it is there.
  std::optional<std::array<double, 3>> triple(std::string_view key, const TomlLimits& limits);
  /// [key], if it is there.
  std::optional<TomlKeys> table(std::string_view key);
  /// [[key]] … [[key]]
  std::vector<TomlKeys> tables(std::string_view key);

  /// The value, or TomlError where it is missing.
  template <class T>
  T required(std::string_view key, std::optional<T> value) const {
    if (!value) fail(key, "required key is missing");
    return *std::move(value);
  }

  /// To be called once every key has been asked for.
  void reject_unknown() const;

 private:
  TomlKeys(std::string file, std::shared_ptr<const toml::table> root, const toml::table& table)
      : file_(std::move(file)), root_(std::move(root)), table_(&table) {}
  const toml::node* ask(std::string_view key);
  double checked(std::string_view key, const toml::node& node, const TomlLimits& limits) const;

  std::string file_;
  std::shared_ptr<const toml::table> root_;  // a copied table would forget where it stood
  const toml::table* table_;
  std::vector<std::string_view> asked_;
};

}  // namespace unhand::datasets
