// What a log holds that its layout does not know, taken along into another file. Private to the module.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/hdf5_reader.hpp"
#include "datasets/hdf5_writer.hpp"

namespace unhand::datasets::hdf5 {

/// The names that a layout knows at one place of a file, whether a log has them or not.
struct KnownNames {
  std::string name;  ///< of this group or dataset; empty: whatever the log calls it
  std::vector<std::string_view> attributes;
  std::vector<KnownNames> children;
};

/// Copies every attribute, group, dataset and link of `old` that `known` does not name at its place to the
/// same place of `made`, as far down as both have what `known` names. What is known is left as `made` has it
/// or has it not. Returns the paths of attributes that refer to other objects of their file, which would lead
/// nowhere in another one: they are left out. Throws LogError.
std::vector<std::string> take_extras(const Node& old, const Output& made, const KnownNames& known);

/// The paths of what `known` does not name at its place of the file, a '*' for names that the log chose, each
/// with the number of places. Throws LogError.
std::map<std::string, std::size_t> extra_paths(const Node& root, const KnownNames& known);

}  // namespace unhand::datasets::hdf5
