// Logs composed of a fuzzer's bytes (composer.hpp), and what the reader has to say of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/fuzz/readers.hpp"

namespace unhand::fuzz {

/// HDF5 files: read by a child process, as users have it, or in this one, where a fuzzer sees it.
enum class Process { of_its_own, this_one };

/// "throw_log", "slip_log"
std::vector<std::string> composed_names();

/// Composes a log of the bytes, lets the reader read it, and compares: a reader accepts all that the schema
/// allows and refuses all else with datasets::LogError; a log that it accepts is the same after it was
/// written and read again, and can be summarised. Returns what it said. Throws std::logic_error where it is
/// not so, and whatever else the reader throws.
Reading read_composed(const std::string& log, const std::uint8_t* data, std::size_t size,
                      Process process = Process::of_its_own);

}  // namespace unhand::fuzz
