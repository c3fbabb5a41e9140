// How a table of samples is declared, once, for the reader, the writer, the checker and the documentation.
// Private.
#pragma once

#include <span>
#include <string_view>
#include <variant>

#include "datasets/series.hpp"

namespace unhand::datasets {

/// One permitted set of columns: names and SI units, separated by commas.
struct ColumnLayout {
  std::string_view columns, units;
  bool operator==(const ColumnLayout&) const = default;
};

/// What a channel of a log holds.
enum class ChannelKind {
  time,  // strictly increasing; opens its group and sets the number of rows
  real,  // finite
  pose,  // finite where the group's flag is 1; seven columns end in a unit quaternion
  flag,  // 0 or 1
};

/// Where a channel lives in its owner: null when the owner does not carry the group.
using Slot = std::variant<std::monostate, Series*, Flags*>;

/// `group` may be empty: then the datasets sit directly in the owner's group.
template <class Owner>
struct Channel {
  std::string_view group, name;
  ChannelKind kind;
  bool required;  // when its group is there
  bool single;    // exactly one row
  std::span<const ColumnLayout> planar, spatial;
  Slot (*slot)(Owner&, bool create);

  std::span<const ColumnLayout> layouts(int dimension) const { return dimension == 3 ? spatial : planar; }
};

/// The slot `owner.group->member`, made on demand.
template <auto group, auto member, class Owner>
Slot slot_in(Owner& owner, bool create) {
  auto& part = owner.*group;
  if (!part && !create) return {};
  if (!part) part.emplace();
  return &((*part).*member);
}

/// The slot `owner.member`.
template <auto member, class Owner>
Slot slot_of(Owner& owner, bool) {
  return &(owner.*member);
}

/// The parts of "a,b,c", one at a time.
inline std::string_view next_part(std::string_view& list) {
  const std::size_t comma = list.find(',');
  const std::string_view part = list.substr(0, comma);
  list = comma == std::string_view::npos ? std::string_view{} : list.substr(comma + 1);
  return part;
}

inline std::string_view part_of(std::string_view list, std::size_t index) {
  std::string_view part;
  for (std::size_t i = 0; i <= index; ++i) part = next_part(list);
  return part;
}

inline std::size_t width(const ColumnLayout& layout) {
  std::size_t n = 1;
  for (const char c : layout.columns) n += c == ',';
  return n;
}

/// The permitted layout of that many columns, or null.
inline const ColumnLayout* layout_of_width(std::span<const ColumnLayout> layouts, std::size_t columns) {
  for (const ColumnLayout& layout : layouts) {
    if (width(layout) == columns) return &layout;
  }
  return nullptr;
}

}  // namespace unhand::datasets
