// Is an unknown name a known one, misspelt?
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace unhand::datasets {

/// Edit distance in which swapping two neighbours is one step (optimal string alignment); case is ignored.
int edit_distance(std::string_view a, std::string_view b);

/// True when `name` is plausibly `known` misspelt: one step for names up to five letters (for names up to
/// three only a swap, another case, a letter twice, an s at the end or a sign), two for longer ones.
bool is_near_miss(std::string_view name, std::string_view known);

/// The nearest of `known` that `name` misses, or nothing.
std::string_view nearest_name(std::string_view name, std::span<const std::string_view> known);

/// What a user who wrote `name` meant of `known`, or nothing: the nearest name; the only one that has this
/// for what follows its first dot ("wind" for "flight.wind"), or nearly; the only one that is this number
/// ("1" for "001").
std::string_view meant_name(std::string_view name, std::span<const std::string_view> known);

/// "X; did you mean 'y'?" or "X (there are: a, b)": what to say of a name that is not among those known. Of
/// "flight.x", those of its family are listed, if there are any.
std::string unknown_name(const std::string& said, std::string_view name,
                         const std::vector<std::string>& known);

}  // namespace unhand::datasets
