// An HDF5 file as a tree of nodes whose every failure is a LogError naming file, path and reason. Private.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/attribute_fields.hpp"
#include "datasets/channel_rules.hpp"
#include "datasets/hdf5_apart.hpp"
#include "datasets/hdf5_handles.hpp"

namespace unhand::datasets::hdf5 {

/// Numbers one file may make us hold, far above any campaign (180 throws are 1e6) and far below a machine's
/// memory.
inline constexpr std::size_t element_budget = 50'000'000;

/// One open group or dataset.
class Node {
 public:
  /// Opens the file read-only and checks that it is one: present, regular, HDF5, whole. What is read of it
  /// is noted in `place` where there is one.
  static Node open_file(const std::string& file, Place* place);

  const std::string& path() const { return path_; }
  const std::string& file() const { return shared_->file; }
  hid_t id() const { return object_.id(); }
  [[noreturn]] void fail(std::string_view name, const std::string& reason) const;
  [[noreturn]] void fail_attribute(std::string_view name, const std::string& reason) const;

  std::vector<std::string> children() const;  // in order of name
  std::vector<std::string> attributes() const;
  bool has(std::string_view name) const;
  bool has_attribute(std::string_view name) const;
  /// Fails on a name that is not known but nearly is, while the known one is missing.
  void reject_misspelt(std::span<const std::string_view> children,
                       std::span<const std::string_view> attributes) const;

  Node group(std::string_view name) const;
  /// A group or a dataset.
  Node child(std::string_view name) const;
  std::string text(std::string_view attribute) const;
  long long integer(std::string_view attribute) const;
  /// A scalar or a list; integers are taken as the numbers they are. n = 0: any length.
  std::vector<double> reals(std::string_view attribute, std::size_t n) const;

  /// A table of one of the layouts, in SI units, with its noise.
  Series series(std::string_view dataset, std::span<const ColumnLayout> layouts) const;
  Flags flags(std::string_view dataset) const;

 private:
  struct Shared {
    std::string file;
    Place* place = nullptr;
    std::size_t budget = element_budget;
    Handle handle;
  };
  struct Table;
  Node(std::shared_ptr<Shared> shared, Handle object, std::string path);
  void note(const std::string& path) const;  // what is read now
  void check_link(std::string_view name) const;
  Handle open_attribute(std::string_view name, H5T_class_t& kind, std::size_t& count) const;
  Table open_table(std::string_view name) const;

  std::shared_ptr<Shared> shared_;
  Handle object_;
  std::string path_;
};

/// Fills a struct's attributes from a node.
struct AttributeReader {
  const Node& node;

  void operator()(std::string_view name, std::string& text) const { text = node.text(name); }
  void operator()(std::string_view name, double& value, const Range&) const {
    value = node.reals(name, 1)[0];
  }
  void operator()(std::string_view name, int& value, const Range& range) const;
  void operator()(std::string_view name, Split& split) const;
  void operator()(std::string_view name, std::array<double, 3>& values, const Range&) const;
  void operator()(std::string_view name, std::pair<double, double>& interval) const;
  void operator()(std::string_view name, std::vector<double>& values, const Range&, std::size_t n) const {
    values = node.reals(name, n);
  }
  void increasing(std::string_view name, std::vector<double>& times) const {
    if (node.has_attribute(name)) times = node.reals(name, 0);
  }
  template <class T, class... Rules>
  void operator()(std::string_view name, std::optional<T>& value, const Rules&... rules) const {
    if (node.has_attribute(name)) (*this)(name, value.emplace(), rules...);
  }
};

/// schema and schema_version, which every log starts with.
void check_schema(const Node& root, std::string_view schema, int version);

/// Reads every channel of one owner from its node; `attributes` are the names it may carry.
template <class Owner>
void read_channels(const Node& node, std::span<const Channel<Owner>> channels, int dimension,
                   std::span<const std::string_view> attributes, Owner& owner) {
  std::vector<std::string_view> groups;
  for (const Channel<Owner>& channel : channels) {
    const std::string_view name = channel.group.empty() ? channel.name : channel.group;
    if (groups.empty() || groups.back() != name) groups.push_back(name);
  }
  node.reject_misspelt(groups, attributes);
  for (std::size_t first = 0; first < channels.size();) {
    std::size_t last = first;
    std::vector<std::string_view> names;
    for (; last < channels.size() && channels[last].group == channels[first].group; ++last) {
      names.push_back(channels[last].name);
    }
    const std::string_view group = channels[first].group;
    const auto read_all = [&](const Node& home) {
      for (const Channel<Owner>& channel : channels.subspan(first, last - first)) {
        if (!channel.required && !home.has(channel.name)) continue;
        if (channel.layouts(dimension).empty()) node.fail(group, "is for planar logs (dimension = 2) only");
        const Slot slot = channel.slot(owner, true);
        if (channel.kind == ChannelKind::flag) {
          *std::get<Flags*>(slot) = home.flags(channel.name);
        } else {
          *std::get<Series*>(slot) = home.series(channel.name, channel.layouts(dimension));
        }
      }
    };
    if (group.empty()) {
      read_all(node);
    } else if (node.has(group)) {
      const Node home = node.group(group);
      home.reject_misspelt(names, {});
      read_all(home);
    }
    first = last;
  }
}

}  // namespace unhand::datasets::hdf5
