// Every reader of files, by name, as one function of bytes: for the fuzzers and for the files that they
// found.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace unhand::fuzz {

/// The names of the readers, which are those of the folders in corpus/.
std::vector<std::string> reader_names();

enum class Reading { accepted, refused };

/// Hands the bytes to the reader as a file. A reader may accept them or refuse them with datasets::LogError;
/// any other exception leaves this function. Throws std::invalid_argument for an unknown name.
Reading read(const std::string& reader, const std::uint8_t* data, std::size_t size);

}  // namespace unhand::fuzz
