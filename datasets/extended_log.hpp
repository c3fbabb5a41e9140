// A throw log in the place of another one, without loss of what the layout does not know.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// The bytes of a file that takes the place of another log's.
struct ExtendedLog {
  std::string image;                  ///< as of to_hdf5, with what else the old file holds
  std::vector<std::string> left_out;  ///< paths of attributes that cannot be in another file
};

/// The bytes of `log` with every group, dataset and attribute of the file `old` whose name the layout does
/// not know at its place, where the log has that place: also beside a channel that is another one now.
/// Attributes that refer to objects of their file are left out, and references inside of what is copied are
/// empty. `old` is opened read-only; `file` is for messages. Throws LogError.
ExtendedLog to_hdf5_with_extras(const ThrowLog& log, const std::filesystem::path& old,
                                const std::string& file = "(in memory)");

}  // namespace unhand::datasets
