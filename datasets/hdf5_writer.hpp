// Writing groups, attributes and tables; a file appears whole or not at all. Private.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "datasets/attribute_fields.hpp"
#include "datasets/channel_table.hpp"
#include "datasets/hdf5_handles.hpp"

namespace unhand::datasets::hdf5 {

/// One group being written. Failures are LogErrors naming the destination.
class Output {
 public:
  Output(std::string file, Handle group, std::string path)
      : file_(std::move(file)), group_(std::move(group)), path_(std::move(path)) {}

  hid_t id() const { return group_.id(); }
  Output group(std::string_view name) const;
  void text(std::string_view attribute, const std::string& value) const;
  void integer(std::string_view attribute, long long value) const;
  void reals(std::string_view attribute, const double* values, std::size_t n, bool scalar) const;
  /// Chunked, shuffled, gzipped, with a checksum; `units` one for all columns or one per column.
  void series(std::string_view dataset, const Series& series, std::string_view units) const;
  void flags(std::string_view dataset, const Flags& flags) const;

 private:
  [[noreturn]] void fail(std::string_view name) const;
  Handle table(std::string_view name, hid_t type, std::size_t rows, std::size_t cols,
               const void* values) const;
  void sigma(const Handle& dataset, std::string_view name, const std::vector<double>& values) const;

  std::string file_;
  Handle group_;
  std::string path_;
};

/// The bytes of a file that `fill` writes into, from its root; `file` is for messages only. It is made in
/// memory: after a write that failed, HDF5 cannot close a file on a disk, and crashes with it when the
/// process ends. Needs the Session of its caller.
std::string image_of(const std::string& file, const std::function<void(const Output&)>& fill);

/// Puts these bytes in the place of `file`, whole or not at all.
void write_atomically(const std::filesystem::path& file, std::string_view image);

/// Writes a struct's attributes.
struct AttributeWriter {
  const Output& out;

  void operator()(std::string_view name, const std::string& text) const { out.text(name, text); }
  void operator()(std::string_view name, double value, const Range&) const {
    out.reals(name, &value, 1, true);
  }
  void operator()(std::string_view name, int value, const Range&) const { out.integer(name, value); }
  void operator()(std::string_view name, Split split) const { out.text(name, to_string(split)); }
  void operator()(std::string_view name, const std::array<double, 3>& values, const Range&) const {
    out.reals(name, values.data(), 3, false);
  }
  void operator()(std::string_view name, const std::vector<double>& values, const Range&,
                  std::size_t n) const {
    out.reals(name, values.data(), n, n == 1);
  }
  void operator()(std::string_view name, const std::pair<double, double>& interval) const {
    const double both[] = {interval.first, interval.second};
    out.reals(name, both, 2, false);
  }
  void increasing(std::string_view name, const std::vector<double>& times) const {
    if (!times.empty()) out.reals(name, times.data(), times.size(), false);
  }
  template <class T, class... Rules>
  void operator()(std::string_view name, const std::optional<T>& value, const Rules&... rules) const {
    if (value) (*this)(name, *value, rules...);
  }
};

/// Writes every channel that the owner carries.
template <class Owner>
void write_channels(const Output& out, std::span<const Channel<Owner>> channels, int dimension,
                    const Owner& const_owner) {
  auto& owner = const_cast<Owner&>(const_owner);  // slots are for reading too; nothing is changed here
  std::string_view open;
  std::optional<Output> home;
  for (const Channel<Owner>& channel : channels) {
    const Slot slot = channel.slot(owner, false);
    if (std::holds_alternative<std::monostate>(slot)) continue;
    if (!channel.group.empty() && channel.group != open) {
      open = channel.group;
      home.emplace(out.group(open));
    }
    const Output& where = channel.group.empty() ? out : *home;
    if (channel.kind == ChannelKind::flag) {
      if (const Flags& flags = *std::get<Flags*>(slot); !flags.empty()) where.flags(channel.name, flags);
    } else if (const Series& series = *std::get<Series*>(slot); !series.empty()) {
      where.series(channel.name, series, layout_of_width(channel.layouts(dimension), series.cols)->units);
    }
  }
}

}  // namespace unhand::datasets::hdf5
