// Several numbers in one option.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "apps/command.hpp"

namespace unhand::apps {

/// "1.3,0,-0.2" or "0.15x0.15": as many finite numbers as asked for.
inline std::vector<double> numbers(const std::string& option, const std::string& text, char separator,
                                   std::size_t count) {
  std::vector<double> out(count);
  std::istringstream in(text);
  for (std::size_t i = 0; i < count; ++i) {
    char between = separator;
    if ((i > 0 && (!(in >> between) || between != separator)) || !(in >> out[i]) || !std::isfinite(out[i]))
      throw WrongUsage(
          fmt::format("{}: '{}' is not {} numbers with '{}' between", option, text, count, separator));
  }
  if (char rest{}; in >> rest)
    throw WrongUsage(fmt::format("{}: '{}' has more than {} numbers", option, text, count));
  return out;
}
template <std::size_t N>
std::array<double, N> numbers(const std::string& option, const std::string& text, char separator) {
  const auto list = numbers(option, text, separator, N);
  std::array<double, N> out{};
  std::copy(list.begin(), list.end(), out.begin());
  return out;
}

}  // namespace unhand::apps
