#include "tests/fuzz/readers.hpp"

#include <filesystem>
#include <functional>
#include <map>
#include <stdexcept>

#include "datasets/import_columns.hpp"
#include "datasets/import_cube_tosses.hpp"
#include "datasets/import_motive.hpp"
#include "datasets/import_phyphox.hpp"
#include "datasets/model_card.hpp"
#include "datasets/planar_push_file.hpp"
#include "datasets/sku.hpp"
#include "datasets/slip_log.hpp"
#include "datasets/throw_log.hpp"
#include "planners/arm/chain_file.hpp"
#include "planners/flip/robot.hpp"
#include "tests/fuzz/scratch_file.hpp"

namespace unhand::fuzz {
namespace {

using Path = std::filesystem::path;
using datasets::TableKind;

/// Columns by their own names, in SI units.
datasets::ColumnMap plain(TableKind kind) {
  const auto channels = channels_of(kind);
  datasets::ColumnMap map;
  for (const auto& channel : channels) map.columns[channel] = channel;
  const std::map<std::string, std::string> units{
      {"time", "s"}, {"x", "m"},         {"z", "m"},      {"theta", "rad"}, {"vx", "m/s"},
      {"vz", "m/s"}, {"omega", "rad/s"}, {"ax", "m/s^2"}, {"az", "m/s^2"},  {"alpha", "rad/s^2"},
      {"fx", "N"},   {"fz", "N"},        {"tau", "N m"},  {"normal", "N"}};
  for (const auto& channel : channels) map.units[channel] = units.at(channel);
  return map;
}

const std::map<std::string, std::function<void(const Path&)>>& readers() {
  static const std::map<std::string, std::function<void(const Path&)>> all{
      {"throw_log", [](const Path& file) { datasets::read_throw_log(file); }},
      {"slip_log", [](const Path& file) { datasets::read_slip_log(file); }},
      {"model_card", [](const Path& file) { datasets::read_model_card(file); }},
      {"sku", [](const Path& file) { datasets::read_sku(file); }},
      {"hand_csv", [](const Path& file) { datasets::read_hand_csv(file, plain(TableKind::hand)); }},
      {"ft_csv", [](const Path& file) { datasets::read_ft_csv(file, plain(TableKind::ft)); }},
      {"mocap_csv", [](const Path& file) { datasets::read_mocap_csv(file, plain(TableKind::mocap)); }},
      {"motive_csv", [](const Path& file) { datasets::read_motive_csv(file); }},
      {"phyphox", [](const Path& file) { datasets::read_phyphox(file); }},
      {"cube_tosses", [](const Path& file) { datasets::import_cube_tosses(file); }},
      {"planar_pushes", [](const Path& file) { datasets::read_push_file(file); }},
      {"robot_toml", [](const Path& file) { planners::read_toml_chain(file); }},
      {"robot_urdf", [](const Path& file) { planners::read_urdf_chain(file, "hand"); }},
      {"flip_robot", [](const Path& file) { planners::flip::read_flip_robot(file.string()); }}};
  return all;
}

}  // namespace

std::vector<std::string> reader_names() {
  std::vector<std::string> names;
  for (const auto& [name, reader] : readers()) names.push_back(name);
  return names;
}

Reading read(const std::string& reader, const std::uint8_t* data, std::size_t size) {
  const auto found = readers().find(reader);
  if (found == readers().end()) throw std::invalid_argument("no reader is called " + reader);
  const ScratchFile file(data, size);
  try {
    found->second(file.path());
    return Reading::accepted;
  } catch (const datasets::LogError&) {
    return Reading::refused;
  }
}

}  // namespace unhand::fuzz
