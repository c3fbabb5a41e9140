// A struct's attributes are listed once, by a function that visits them; reader, writer and checker are
// visitors. This header holds what the listings need, and the checker. Private to the module.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "datasets/log_error.hpp"
#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// Accepted values of an attribute.
struct Range {
  double low, high;  // both belong to the range
  std::string_view text;
};
inline constexpr double largest = std::numeric_limits<double>::max();
inline constexpr Range finite{-largest, largest, "finite"};
inline constexpr Range non_negative{0, largest, "finite and >= 0"};
inline constexpr Range positive{std::numeric_limits<double>::denorm_min(), largest, "finite and > 0"};

bool is_utf8_text(std::string_view text);
/// "/a" + "b" -> "/a/b", and "/" + "b" -> "/b".
std::string join(const std::string& path, std::string_view name);

/// Values in range, text in UTF-8, times in order.
struct AttributeChecker {
  std::string file, path;

  [[noreturn]] void fail(std::string_view name, std::string reason) const;
  void operator()(std::string_view name, double value, const Range& range) const;
  void operator()(std::string_view name, const std::string& text) const;
  void operator()(std::string_view name, Split) const { (void)name; }
  void operator()(std::string_view name, const std::array<double, 3>& values, const Range& range) const;
  void operator()(std::string_view name, const std::vector<double>& values, const Range& range,
                  std::size_t n) const;
  void operator()(std::string_view name, const std::pair<double, double>& interval) const;
  void increasing(std::string_view name, const std::vector<double>& times) const;

  template <class T, class... Rules>
  void operator()(std::string_view name, const std::optional<T>& value, const Rules&... rules) const {
    if (value) (*this)(name, *value, rules...);
  }
};

/// The names alone.
struct AttributeNames {
  std::vector<std::string_view> names;

  template <class... Anything>
  void operator()(std::string_view name, const Anything&...) {
    names.push_back(name);
  }
  void increasing(std::string_view name, const std::vector<double>&) { names.push_back(name); }
};

}  // namespace unhand::datasets
