// The arms that come with the library: their TOML files as they are beside this header.
#pragma once

#include <array>
#include <string_view>

namespace unhand::planners::elastic {

/// An arm that comes with the library.
struct BuiltInArm {
  std::string_view name, arm, chain;  ///< text of NAME.toml and NAME_chain.toml
};
/// All of them.
const std::array<BuiltInArm, 2>& built_in_arms();

}  // namespace unhand::planners::elastic
