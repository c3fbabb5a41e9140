// What is said on stderr.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <utility>

namespace unhand::apps {

/// Says something on stderr. What cannot be said there is lost; it changes neither answer nor exit code.
template <class... Values>
void tell(fmt::format_string<Values...> text, Values&&... values) {
  std::fputs(fmt::format(text, std::forward<Values>(values)...).c_str(), stderr);
}

}  // namespace unhand::apps
