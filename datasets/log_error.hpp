// What goes wrong with a file, as one line: which file, where inside it, and why.
#pragma once

#include <stdexcept>
#include <string>

namespace unhand::datasets {

/// A file that cannot be read, or a log that cannot be written. what() is "FILE: WHERE: REASON", always on
/// one line; WHERE is a path inside an HDF5 file, with attributes after an @ ("/throws/001@split").
class LogError : public std::runtime_error {
 public:
  LogError(std::string file_name, std::string path_inside, std::string why);

  std::string file, path, reason;

 protected:
  LogError(std::string file_name, std::string path_inside, std::string why, const std::string& message);
};

/// A text file of someone else's that an importer cannot read: path is "line L" or "line L, column NAME".
class ImportError : public LogError {
 public:
  using LogError::LogError;
};

/// A TOML file with a mistake in it; what() is "FILE:LINE:COLUMN: KEY: REASON".
class TomlError : public LogError {
 public:
  TomlError(std::string file_name, int line_number, int column_number, std::string key, std::string why);

  int line, column;
};

}  // namespace unhand::datasets
