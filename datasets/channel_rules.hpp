// The rules every table of samples obeys, wherever it came from. Private to the module.
#pragma once

#include <span>
#include <string>

#include "datasets/channel_table.hpp"

namespace unhand::datasets {

/// What the norm of a logged quaternion may differ by from 1 [-]: six printed decimals and a filter.
inline constexpr double kQuaternionTolerance = 1e-3;

/// What one channel is checked against. `mask` and `time` may be null.
struct ChannelCheck {
  std::string file, path;
  ChannelKind kind;
  bool single;
  std::span<const ColumnLayout> layouts;
  std::size_t rows;  // of the group's time; 0 for the time itself
  const Flags* mask;
};

void check_series(const ChannelCheck& check, const Series& series);
void check_flags(const ChannelCheck& check, const Flags& flags);
/// A name of a group: not empty, no '/', not "." or "..", UTF-8.
void check_name(const std::string& file, const std::string& path, const std::string& name);
/// Seven-column poses: quaternions that are off unit length by more than rounding are normalised.
void normalise_quaternions(Series& pose, const Flags& valid);

std::string join(const std::string& path, std::string_view name);
[[noreturn]] void fail_at(const std::string& file, const std::string& path, const std::string& reason);

/// Checks every channel of one owner; `owner_path` is its path in the file. Returns how many groups it
/// carries.
template <class Owner>
int check_channels(const std::string& file, const std::string& owner_path, const Owner& const_owner,
                   std::span<const Channel<Owner>> channels, int dimension) {
  auto& owner = const_cast<Owner&>(const_owner);  // slots are for writing too; nothing is written here
  int groups = 0;
  for (const Channel<Owner>& channel : channels) {
    const Slot slot = channel.slot(owner, false);
    if (std::holds_alternative<std::monostate>(slot)) continue;
    const std::string path = join(join(owner_path, channel.group), channel.name);
    ChannelCheck check{file, path, channel.kind, channel.single, channel.layouts(dimension), 0, nullptr};
    for (const Channel<Owner>& other : channels) {
      if (other.group != channel.group) continue;
      const Slot found = other.slot(owner, false);
      if (other.kind == ChannelKind::time && channel.kind != ChannelKind::time) {
        check.rows = std::get<Series*>(found)->rows;
      }
      if (other.kind == ChannelKind::flag) check.mask = std::get<Flags*>(found);
    }
    if (check.layouts.empty())
      fail_at(file, join(owner_path, channel.group), "is for planar logs (dimension = 2) only");
    if (channel.kind == ChannelKind::flag) {
      const Flags& flags = *std::get<Flags*>(slot);
      if (channel.required || !flags.empty()) check_flags(check, flags);
    } else {
      const Series& series = *std::get<Series*>(slot);
      if (channel.required || !series.empty()) check_series(check, series);
    }
    groups += channel.kind == ChannelKind::time;
  }
  return groups;
}

}  // namespace unhand::datasets
