// A file from bytes in memory.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace unhand::datasets {

/// Makes the file hold these bytes. Says in the system's words what failed ("No space left on device"),
/// nothing if all went well; what was written so far then stays.
std::string write_whole(const std::filesystem::path& file, std::string_view bytes);

/// The same beside the file first, then renamed: after a failure the file is as it was and nothing stays.
std::string replace_whole(const std::filesystem::path& file, std::string_view bytes);

}  // namespace unhand::datasets
