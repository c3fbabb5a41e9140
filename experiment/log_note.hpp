// What is odd about a log.
#pragma once

#include <fmt/core.h>

#include <cstddef>
#include <string>

namespace unhand::experiment {

/// Something that a log says and that is odd, though it can be read.
struct LogNote {
  std::string path;  ///< of the first throw that shows it, or of the log's one value
  std::string said;  ///< what is there, and why that is odd
  int throws{};      ///< that show it
  /// "/throws/003@detach_time: ...; so in 12 of 24 throws".
  std::string in_words(std::size_t of) const {
    return fmt::format("{}: {}{}", path, said,
                       throws > 1 || of > 1 ? fmt::format("; so in {} of {} throws", throws, of) : "");
  }
};

}  // namespace unhand::experiment
