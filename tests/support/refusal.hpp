// What wrong input is told.
#pragma once

#include <stdexcept>
#include <string>

namespace unhand::support {

/// The message of the Error that `action` throws; "accepted" where it throws none.
template <class Error = std::invalid_argument, class Action>
std::string refusal(const Action& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace unhand::support
