#include "datasets/throw_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>

#include "datasets/channel_rules.hpp"
#include "datasets/extended_log.hpp"
#include "datasets/hdf5_apart.hpp"
#include "datasets/hdf5_extras.hpp"
#include "datasets/hdf5_reader.hpp"
#include "datasets/hdf5_writer.hpp"
#include "datasets/parse_log.hpp"
#include "datasets/throw_log_table.hpp"

namespace unhand::datasets {
namespace {

const std::span<const Channel<Throw>> channels{throw_channels};

/// The attribute names of a struct, with those that its group carries besides.
template <class List, class... Rest>
std::vector<std::string_view> names_of(List&& list, std::initializer_list<std::string_view> more = {}) {
  AttributeNames names;
  list(names);
  names.names.insert(names.names.end(), more);
  return names.names;
}

Object read_object(const hdf5::Node& node, int dimension) {
  Object object;
  node.reject_misspelt({}, names_of([&](auto& names) { object_fields(names, object, dimension); }));
  object_fields(hdf5::AttributeReader{node}, object, dimension);
  return object;
}

Gripper read_gripper(const hdf5::Node& node) {
  Gripper gripper;
  node.reject_misspelt({}, names_of([&](auto& names) { gripper_fields(names, gripper); }));
  gripper_fields(hdf5::AttributeReader{node}, gripper);
  return gripper;
}

Throw read_throw(const hdf5::Node& node, const std::string& id, int dimension) {
  Throw toss;
  const auto attributes = names_of([&](auto& names) { throw_fields(names, toss); });
  hdf5::read_channels<Throw>(node, channels, dimension, attributes, toss);
  toss.id = id;
  throw_fields(hdf5::AttributeReader{node}, toss);
  return toss;
}

void check_throw(const std::string& file, const ThrowLog& log, const Throw& toss) {
  check_name(file, "/throws", toss.id);
  const std::string path = "/throws/" + toss.id;
  const AttributeChecker check{file, path};
  throw_fields(check, toss);
  if (!log.objects.contains(toss.object)) {
    std::string known;
    for (const auto& [name, object] : log.objects) known += (known.empty() ? "" : ", ") + name;
    check.fail("object", fmt::format("there is no object '{}' in /objects (known: {})", toss.object, known));
  }
  if (check_channels<Throw>(file, path, toss, channels, log.dimension) == 0) {
    fail_at(file, path, "is empty: none of hand, ft, mocap, landing, imu");
  }
}

template <class Change>
void change_times(Throw& toss, Change change) {
  for (const Channel<Throw>& channel : channels) {
    if (channel.kind != ChannelKind::time) continue;
    const Slot slot = channel.slot(toss, false);
    if (auto* const* time = std::get_if<Series*>(&slot)) std::ranges::for_each((*time)->data, change);
  }
  if (toss.detach_time) change(*toss.detach_time);
  if (toss.free_flight) change(toss.free_flight->first), change(toss.free_flight->second);
  std::ranges::for_each(toss.hand_jump_times, change);
}

/// Of all samples [s]; +infinity if there are none.
double first_time(const ThrowLog& log) {
  double first = HUGE_VAL;
  for (const Throw& toss : log.throws)
    for (const Channel<Throw>& channel : channels)
      if (channel.kind == ChannelKind::time)
        if (const Slot slot = channel.slot(const_cast<Throw&>(toss), false);
            const auto* const* time = std::get_if<Series*>(&slot))
          if (!(*time)->empty()) first = std::min(first, (*time)->data.front());
  return first;
}

void move_clock(ThrowLog& log, double origin) {
  if (log.gripper && log.gripper->opening_command_time) *log.gripper->opening_command_time -= origin;
  for (Throw& toss : log.throws) datasets::move_clock(toss, origin);
  log.clock_origin += origin;
}

constexpr auto bring_throw_log = [](auto& pipe, ThrowLog& log) {
  const AttributeCarrier<std::remove_reference_t<decltype(pipe)>> visit{pipe};
  log_fields(visit, log);
  carry_map(pipe, log.objects, [&](Object& object) { object_fields(visit, object, log.dimension); });
  if (carry_flag(pipe, log.gripper.has_value())) {
    if (!log.gripper) log.gripper.emplace();
    gripper_fields(visit, *log.gripper);
  }
  carry_list(pipe, log.throws, [&](Throw& toss) {
    carry(pipe, toss.id);
    throw_fields(visit, toss);
    carry_channels(pipe, channels, toss);
  });
};

/// The log with the times of its file, checked; in `moved` where they are others.
const ThrowLog& as_in_file(const ThrowLog& log, const std::string& file, std::optional<ThrowLog>& moved) {
  validate(log, file);
  if (log.clock_origin == 0) return log;
  move_clock(moved.emplace(log), -log.clock_origin);
  validate(*moved, file);
  return *moved;
}

void write(const hdf5::Output& root, const ThrowLog& log) {
  root.text("schema", "throw-log");
  root.integer("schema_version", throw_log_version);
  log_fields(hdf5::AttributeWriter{root}, log);
  const hdf5::Output objects = root.group("objects");
  for (const auto& [name, object] : log.objects) {
    const hdf5::Output out = objects.group(name);
    object_fields(hdf5::AttributeWriter{out}, object, log.dimension);
  }
  if (log.gripper) {
    const hdf5::Output out = root.group("gripper");
    gripper_fields(hdf5::AttributeWriter{out}, *log.gripper);
  }
  const hdf5::Output throws = root.group("throws");
  for (const Throw& toss : log.throws) {
    const hdf5::Output out = throws.group(toss.id);
    throw_fields(hdf5::AttributeWriter{out}, toss);
    hdf5::write_channels<Throw>(out, channels, log.dimension, toss);
  }
}

/// Of the whole layout.
hdf5::KnownNames known_names() {
  const ThrowLog log;
  const Object object_values;
  const Gripper gripper_values;
  const Throw throw_values;
  hdf5::KnownNames object{"", names_of([&](auto& names) { object_fields(names, object_values, 3); }), {}};
  hdf5::KnownNames toss{"", names_of([&](auto& names) { throw_fields(names, throw_values); }), {}};
  for (const Channel<Throw>& channel : channels) {
    if (toss.children.empty() || toss.children.back().name != channel.group)
      toss.children.push_back({std::string(channel.group), {}, {}});
    toss.children.back().children.push_back({std::string(channel.name), {"units", "sigma"}, {}});
  }
  return {"",
          names_of([&](auto& names) { log_fields(names, log); }, {"schema", "schema_version"}),
          {{"objects", {}, {std::move(object)}},
           {"gripper", names_of([&](auto& names) { gripper_fields(names, gripper_values); }), {}},
           {"throws", {}, {std::move(toss)}}}};
}

}  // namespace

std::vector<std::pair<std::string, std::string>> conditions_of(const ThrowLog& log,
                                                               std::optional<Split> split) {
  std::vector<std::pair<std::string, std::string>> out;
  for (const Throw& one : log.throws) {
    const std::pair condition{one.object, one.condition};
    if ((!split || one.split == *split) && std::find(out.begin(), out.end(), condition) == out.end())
      out.push_back(condition);
  }
  return out;
}

void move_clock(Throw& toss, double origin) {
  change_times(toss, [&](double& t) { t -= origin; });
}

void validate(const ThrowLog& log, const std::string& file) {
  log_fields(AttributeChecker{file, "/"}, log);
  if (log.objects.empty()) fail_at(file, "/objects", "is empty: at least one object is needed");
  for (const auto& [name, object] : log.objects) {
    check_name(file, "/objects", name);
    object_fields(AttributeChecker{file, "/objects/" + name}, object, log.dimension);
  }
  if (log.gripper) gripper_fields(AttributeChecker{file, "/gripper"}, *log.gripper);
  if (log.throws.empty()) fail_at(file, "/throws", "is empty: at least one throw is needed");
  std::set<std::string_view> ids;
  for (const Throw& toss : log.throws) {
    check_throw(file, log, toss);
    if (!ids.insert(toss.id).second) fail_at(file, "/throws/" + toss.id, "the id is used twice");
  }
}

ThrowLog hdf5::parse_throw_log(const std::string& file, Place* place) {
  const Node root = Node::open_file(file, place);
  hdf5::check_schema(root, "throw-log", throw_log_version);

  ThrowLog log;
  const std::string_view groups[] = {"objects", "gripper", "throws"};
  root.reject_misspelt(groups,
                       names_of([&](auto& names) { log_fields(names, log); }, {"schema", "schema_version"}));
  log_fields(hdf5::AttributeReader{root}, log);
  log_fields(AttributeChecker{root.file(), "/"}, log);  // the dimension decides on every shape below

  const hdf5::Node objects = root.group("objects");
  for (const std::string& name : objects.children()) {
    log.objects.emplace(name, read_object(objects.group(name), log.dimension));
  }
  if (root.has("gripper")) log.gripper = read_gripper(root.group("gripper"));
  const hdf5::Node throws = root.group("throws");
  for (const std::string& id : throws.children()) {
    log.throws.push_back(read_throw(throws.group(id), id, log.dimension));
  }
  return log;
}

ThrowLog read_throw_log(const std::filesystem::path& file) {
  auto log = hdf5::value_apart<ThrowLog>(file.string(), hdf5::parse_throw_log, bring_throw_log);
  validate(log, file.string());
  for (Throw& toss : log.throws) {
    if (toss.mocap) normalise_quaternions(toss.mocap->pose, toss.mocap->valid);
  }
  std::sort(log.throws.begin(), log.throws.end(), [](const Throw& a, const Throw& b) { return a.id < b.id; });
  constexpr double kFar = 1e6;  // [s] doubles are 1e-10 s apart there
  if (const double first = first_time(log); std::isfinite(first) && std::abs(first) > kFar)
    move_clock(log, std::floor(first));
  return log;
}

std::string to_hdf5(const ThrowLog& log, const std::string& file) {
  std::optional<ThrowLog> moved;
  const ThrowLog& there = as_in_file(log, file, moved);
  const hdf5::Session session;
  return hdf5::image_of(file, [&](const hdf5::Output& root) { write(root, there); });
}

ExtendedLog to_hdf5_with_extras(const ThrowLog& log, const std::filesystem::path& old,
                                const std::string& file) {
  std::optional<ThrowLog> moved;
  const ThrowLog& known = as_in_file(log, file, moved);
  const auto extend = [&](const std::string& name, hdf5::Place* place) {
    const hdf5::Node extended = hdf5::Node::open_file(name, place);
    ExtendedLog out;
    out.image = hdf5::image_of(file, [&](const hdf5::Output& root) {
      write(root, known);
      out.left_out = hdf5::take_extras(extended, root, known_names());
    });
    return out;
  };
  return hdf5::value_apart<ExtendedLog>(old.string(), extend, [](auto& pipe, ExtendedLog& out) {
    carry(pipe, out.image);
    carry_list(pipe, out.left_out, [&](std::string& path) { carry(pipe, path); });
  });
}

std::map<std::string, std::size_t> ignored_names(const std::filesystem::path& file) {
  using Names = std::vector<std::pair<std::string, std::uint64_t>>;
  const auto parse = [](const std::string& name, hdf5::Place* place) {
    const auto paths = hdf5::extra_paths(hdf5::Node::open_file(name, place), known_names());
    return Names(paths.begin(), paths.end());
  };
  const Names names = hdf5::value_apart<Names>(file.string(), parse, [](auto& pipe, Names& all) {
    carry_list(pipe, all, [&](auto& one) { carry(pipe, one.first), carry(pipe, one.second); });
  });
  return {names.begin(), names.end()};
}

void write_throw_log(const std::filesystem::path& file, const ThrowLog& log) {
  hdf5::write_atomically(file, to_hdf5(log, file.string()));
}

std::string read_schema_name(const std::filesystem::path& file) {
  const auto parse = [](const std::string& name, hdf5::Place* place) {
    const hdf5::Node root = hdf5::Node::open_file(name, place);
    const std::string_view known[] = {"schema", "schema_version"};
    root.reject_misspelt({}, known);
    return root.text("schema");
  };
  return hdf5::value_apart<std::string>(file.string(), parse,
                                        [](auto& pipe, std::string& name) { carry(pipe, name); });
}

std::vector<LayoutRow> throw_log_layout(int dimension) {
  std::vector<LayoutRow> rows;
  for (const Channel<Throw>& channel : channels) {
    for (const ColumnLayout& layout : channel.layouts(dimension)) {
      const std::string n = channel.single ? "1" : "N";
      const std::string shape =
          width(layout) == 1 ? fmt::format("({})", n) : fmt::format("({},{})", n, width(layout));
      rows.push_back({fmt::format("{}/{}", channel.group, channel.name), shape, std::string(layout.columns),
                      std::string(layout.units), !channel.required});
    }
  }
  return rows;
}

}  // namespace unhand::datasets
