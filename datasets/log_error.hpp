// What goes wrong with a file, as one line: which file, where inside it, and why.
#pragma once

#include <stdexcept>
#include <string>

namespace unhand::datasets {

/// A file that cannot be read, or a log that cannot be written. what() is "FILE: WHERE: REASON", always on
/// one line; WHERE is a path inside an HDF5 file, with attributes after an @ ("/throws/001@split"), and is
/// left out where it is the whole file that is wrong.
class LogError : public std::runtime_error {
 public:
  /// The three parts of what().
  LogError(std::string file_name, std::string path_inside, std::string why);

  std::string file, path, reason;  ///< as what() shows them

 protected:
  /// For formats with a message of their own.
  LogError(std::string file_name, std::string path_inside, std::string why, const std::string& message);
};

/// A text file of someone else's that an importer cannot read: path is "line L" or "line L, column NAME".
class ImportError : public LogError {
 public:
  using LogError::LogError;  ///< with the three parts
};

/// A TOML file with a mistake in it; what() is "FILE:LINE:COLUMN: KEY: REASON".
class TomlError : public LogError {
 public:
  /// `line_number` and `column_number` count from 1; 0 where the mistake is not at a place.
  TomlError(std::string file_name, int line_number, int column_number, std::string key, std::string why);

  int line, column;  ///< from 1; 0: not at a place
};

}  // namespace unhand::datasets
