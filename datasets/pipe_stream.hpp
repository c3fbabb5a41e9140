// Plain values through a pipe: one function per type says how it travels, for both directions. Private to the
// module.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "datasets/channel_table.hpp"
#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// What comes through the pipe ends too early, too late or is not what was to come.
struct PipeBroken : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The end that bytes go into. Does not own the descriptor.
class PipeWriter {
 public:
  static constexpr bool takes = false;
  explicit PipeWriter(int descriptor) : descriptor_(descriptor) {}
  void raw(const void* data, std::size_t n);
  void flush();

 private:
  void write(const char* data, std::size_t n);
  int descriptor_;
  std::string buffer_;
};

/// The end that bytes come out of. Does not own the descriptor.
class PipeReader {
 public:
  static constexpr bool takes = true;
  /// Gives up after so long without a byte.
  PipeReader(int descriptor, int silence_milliseconds)
      : descriptor_(descriptor), silence_(silence_milliseconds) {}
  void raw(void* data, std::size_t n);

 private:
  std::size_t read(char* data, std::size_t n);
  int descriptor_, silence_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;
};

/// More of one kind than any log holds: the writer was out of its mind.
inline constexpr std::uint64_t kLongestList = 100'000'000;

template <class Pipe, class T>
requires std::is_arithmetic_v<T>
void carry(Pipe& pipe, T& value) { pipe.raw(&value, sizeof value); }

template <class Pipe>
std::size_t carry_size(Pipe& pipe, std::size_t size) {
  std::uint64_t n = size;
  carry(pipe, n);
  if (n > kLongestList) throw PipeBroken("a list too long");
  return static_cast<std::size_t>(n);
}

template <class Pipe>
bool carry_flag(Pipe& pipe, bool flag) {
  std::uint8_t byte = flag;
  carry(pipe, byte);
  return byte != 0;
}

template <class Pipe>
void carry(Pipe& pipe, Split& split) {
  split = carry_flag(pipe, split == Split::test) ? Split::test : Split::train;
}

template <class Pipe>
void carry(Pipe& pipe, std::string& text) {
  text.resize(carry_size(pipe, text.size()));
  pipe.raw(text.data(), text.size());
}

template <class Pipe, class T>
requires std::is_arithmetic_v<T>
void carry(Pipe& pipe, std::vector<T>& values) {
  values.resize(carry_size(pipe, values.size()));
  pipe.raw(values.data(), values.size() * sizeof(T));
}

template <class Pipe, std::size_t N>
void carry(Pipe& pipe, std::array<double, N>& values) {
  pipe.raw(values.data(), sizeof values);
}

template <class Pipe>
void carry(Pipe& pipe, std::pair<double, double>& values) {
  carry(pipe, values.first);
  carry(pipe, values.second);
}

template <class Pipe>
void carry(Pipe& pipe, Series& series) {
  carry(pipe, series.rows);
  carry(pipe, series.cols);
  carry(pipe, series.data);
  carry(pipe, series.sigma);
  const bool whole = series.cols > 0 && series.data.size() % series.cols == 0 &&
                     series.data.size() / series.cols == series.rows;
  if (!whole) throw PipeBroken("a table of another size");
}

template <class Pipe, class T>
void carry(Pipe& pipe, std::optional<T>& value) {
  const bool there = carry_flag(pipe, value.has_value());
  if (there && !value) value.emplace();
  if (there) carry(pipe, *value);
}

/// A list whose elements `each` carries.
template <class Pipe, class T, class Each>
void carry_list(Pipe& pipe, std::vector<T>& list, Each&& each) {
  const std::size_t n = carry_size(pipe, list.size());
  for (std::size_t i = 0; i < n; ++i) {
    if constexpr (Pipe::takes) list.emplace_back();
    each(list[i]);
  }
}

/// A map by name whose values `each` carries.
template <class Pipe, class T, class Each>
void carry_map(Pipe& pipe, std::map<std::string, T>& map, Each&& each) {
  const std::size_t n = carry_size(pipe, map.size());
  if constexpr (Pipe::takes) {
    for (std::size_t i = 0; i < n; ++i) {
      std::string name;
      carry(pipe, name);
      each(map[name]);
    }
  } else {
    for (auto& [name, value] : map) {
      std::string copy = name;
      carry(pipe, copy);
      each(value);
    }
  }
}

/// The visitor of a struct's attributes (attribute_fields.hpp).
template <class Pipe>
struct AttributeCarrier {
  Pipe& pipe;

  template <class T, class... Rules>
  void operator()(std::string_view, T& value, const Rules&...) const {
    carry(pipe, value);
  }
  void increasing(std::string_view, std::vector<double>& times) const { carry(pipe, times); }
};

/// Every channel that the owner carries.
template <class Pipe, class Owner>
void carry_channels(Pipe& pipe, std::span<const Channel<Owner>> channels, Owner& owner) {
  for (const Channel<Owner>& channel : channels) {
    if (!carry_flag(pipe, !std::holds_alternative<std::monostate>(channel.slot(owner, false)))) continue;
    const Slot slot = channel.slot(owner, true);
    if (channel.kind == ChannelKind::flag) {
      carry(pipe, *std::get<Flags*>(slot));
    } else {
      carry(pipe, *std::get<Series*>(slot));
    }
  }
}

}  // namespace unhand::datasets
