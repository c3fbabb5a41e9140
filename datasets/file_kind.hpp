// What a file is that was taken for another kind.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace unhand::datasets {

/// What the first bytes of a file tell: "an HDF5 file", "a model card (JSON)", "JSON of schema 'fit'",
/// "JSON". Empty where they tell nothing.
std::string kind_of(std::string_view bytes);
std::string kind_of_file(const std::filesystem::path& file);

/// Whether the first character that is no blank opens a JSON object.
bool begins_json_object(std::string_view bytes);

/// `said`, then what the file is instead: "is not an HDF5 file; it is a model card (JSON)".
std::string with_kind(const std::string& said, const std::string& kind);

}  // namespace unhand::datasets
