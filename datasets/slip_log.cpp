#include "datasets/slip_log.hpp"

#include <array>
#include <cmath>
#include <set>

#include "datasets/channel_rules.hpp"
#include "datasets/hdf5_apart.hpp"
#include "datasets/hdf5_reader.hpp"
#include "datasets/hdf5_writer.hpp"
#include "datasets/parse_log.hpp"

namespace unhand::datasets {
namespace {

constexpr int slip_log_version = 1;
constexpr int planar = 2;

constexpr std::array<ColumnLayout, 1> time_columns{{{"t", "s"}}};
constexpr std::array<ColumnLayout, 1> wrench_columns{{{"fx,fy,tau", "N,N,N m"}}};
constexpr std::array<ColumnLayout, 1> twist_columns{{{"vx,vy,omega", "m/s,m/s,rad/s"}}};

constexpr Channel<Slip> table[] = {
    {"", "time", ChannelKind::time, true, false, time_columns, {}, slot_of<&Slip::time, Slip>},
    {"", "wrench", ChannelKind::real, true, false, wrench_columns, {}, slot_of<&Slip::wrench, Slip>},
    {"", "twist", ChannelKind::real, true, false, twist_columns, {}, slot_of<&Slip::twist, Slip>},
};
const std::span<const Channel<Slip>> slip_channels{table};
constexpr std::string_view surface_attributes[] = {"mass", "characteristic_length", "description", "licence"};
constexpr std::string_view slip_attributes[] = {"split"};

template <class Visitor, class Patch>
void surface_fields(Visitor&& visit, Patch& surface) {
  visit("mass", surface.mass, positive);
  visit("characteristic_length", surface.characteristic_length, positive);
  visit("description", surface.description);
  visit("licence", surface.licence);
}

constexpr auto bring_slip_log = [](auto& pipe, SlipLog& log) {
  const AttributeCarrier<std::remove_reference_t<decltype(pipe)>> visit{pipe};
  carry_map(pipe, log.surfaces, [&](Surface& surface) {
    surface_fields(visit, surface);
    carry_list(pipe, surface.slips, [&](Slip& slip) {
      carry(pipe, slip.id);
      carry(pipe, slip.split);
      carry_channels(pipe, slip_channels, slip);
    });
  });
};

}  // namespace

void validate(const SlipLog& log, const std::string& file) {
  if (log.surfaces.empty()) fail_at(file, "/surfaces", "is empty: at least one surface is needed");
  for (const auto& [name, surface] : log.surfaces) {
    check_name(file, "/surfaces", name);
    const std::string path = "/surfaces/" + name;
    surface_fields(AttributeChecker{file, path}, surface);
    if (surface.slips.empty()) fail_at(file, path + "/slips", "is empty: at least one slip is needed");
    std::set<std::string_view> ids;
    for (const Slip& slip : surface.slips) {
      check_name(file, path + "/slips", slip.id);
      check_channels<Slip>(file, path + "/slips/" + slip.id, slip, slip_channels, planar);
      if (!ids.insert(slip.id).second) fail_at(file, path + "/slips/" + slip.id, "the id is used twice");
    }
  }
}

double dissipation(const Surface& surface) {
  double work = 0, size = 0;
  for (const Slip& slip : surface.slips)
    for (std::size_t i = 0; i < slip.time.rows; ++i) {
      double power = 0;
      for (std::size_t c = 0; c < 3; ++c) power += slip.wrench(i, c) * slip.twist(i, c);
      work += power, size += std::abs(power);
    }
  return size > 0 ? work / size : 0;
}

SlipLog hdf5::parse_slip_log(const std::string& file, Place* place) {
  const Node root = Node::open_file(file, place);
  check_schema(root, "slip-log", slip_log_version);
  const std::string_view groups[] = {"surfaces"}, inner[] = {"slips"};
  root.reject_misspelt(groups, {});

  SlipLog log;
  const hdf5::Node surfaces = root.group("surfaces");
  for (const std::string& name : surfaces.children()) {
    const hdf5::Node node = surfaces.group(name);
    node.reject_misspelt(inner, surface_attributes);
    Surface surface;
    surface_fields(hdf5::AttributeReader{node}, surface);
    const hdf5::Node slips = node.group("slips");
    for (const std::string& id : slips.children()) {
      const hdf5::Node home = slips.group(id);
      Slip slip;
      hdf5::read_channels<Slip>(home, slip_channels, planar, slip_attributes, slip);
      slip.id = id;
      hdf5::AttributeReader{home}("split", slip.split);
      surface.slips.push_back(std::move(slip));
    }
    log.surfaces.emplace(name, std::move(surface));
  }
  return log;
}

SlipLog read_slip_log(const std::filesystem::path& file) {
  auto log = hdf5::value_apart<SlipLog>(file.string(), hdf5::parse_slip_log, bring_slip_log);
  validate(log, file.string());
  return log;
}

std::string to_hdf5(const SlipLog& log, const std::string& file) {
  validate(log, file);
  const hdf5::Session session;
  return hdf5::image_of(file, [&](const hdf5::Output& root) {
    root.text("schema", "slip-log");
    root.integer("schema_version", slip_log_version);
    const hdf5::Output surfaces = root.group("surfaces");
    for (const auto& [name, surface] : log.surfaces) {
      const hdf5::Output home = surfaces.group(name);
      surface_fields(hdf5::AttributeWriter{home}, surface);
      const hdf5::Output slips = home.group("slips");
      for (const Slip& slip : surface.slips) {
        const hdf5::Output out = slips.group(slip.id);
        hdf5::AttributeWriter{out}("split", slip.split);
        hdf5::write_channels<Slip>(out, slip_channels, planar, slip);
      }
    }
  });
}

void write_slip_log(const std::filesystem::path& file, const SlipLog& log) {
  hdf5::write_atomically(file, to_hdf5(log, file.string()));
}

}  // namespace unhand::datasets
