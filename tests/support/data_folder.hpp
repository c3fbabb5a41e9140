// Measured and synthetic data that tests read where there are any.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace unhand::support {

/// Something in the folder that UNHAND_DATA names.
struct FromDataFolder {
  std::filesystem::path path;
  std::string missing;  ///< what to set or add, for GTEST_SKIP; empty where it is there
};

/// `name` is relative to the folder; empty for the folder itself.
inline FromDataFolder from_data_folder(const std::string& name) {
  const char* folder = std::getenv("UNHAND_DATA");
  if (folder == nullptr || *folder == '\0')
    return {{}, "UNHAND_DATA is not set: no data folder to take " + (name.empty() ? "logs" : name) + " from"};
  const std::filesystem::path path = std::filesystem::path(folder) / name;
  return {path, std::filesystem::exists(path) ? "" : "the data folder has no " + name};
}

}  // namespace unhand::support
