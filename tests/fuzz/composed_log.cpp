#include "tests/fuzz/composed_log.hpp"

#include <optional>
#include <stdexcept>

#include "datasets/parse_log.hpp"
#include "datasets/summary.hpp"
#include "tests/fuzz/composer.hpp"
#include "tests/fuzz/scratch_file.hpp"

namespace unhand::fuzz {
namespace {

constexpr std::string_view kSplits[] = {"train", "test"};

void head(Composer& file, std::string_view schema) {
  const std::string_view good[] = {schema};
  file.text(file.root(), "schema", std::string(schema), true, good);
  file.integer(file.root(), "schema_version", 1, 1, 1);
  file.extras(file.root());
}

/// The groups of a throw that hold samples. `units` in SI; the first table is the time.
struct Channel {
  const char *group, *name, *planar, *spatial;
  bool required = true;
};
constexpr Channel kChannels[] = {{"hand", "time", "s", ""},
                                 {"hand", "pose", "m,m,rad", ""},
                                 {"hand", "twist", "m/s,m/s,rad/s", ""},
                                 {"hand", "acceleration", "m/s^2,m/s^2,rad/s^2", ""},
                                 {"ft", "time", "s", ""},
                                 {"ft", "wrench", "N,N,N m", ""},
                                 {"ft", "normal_force", "N", ""},
                                 {"mocap", "time", "s", "s"},
                                 {"mocap", "pose", "m,m,rad", "m,m,m,1,1,1,1"},
                                 {"landing", "time", "s", "s"},
                                 {"landing", "pose", "m,rad", "m,m,m"},
                                 {"imu", "time", "s", "s"},
                                 {"imu", "specific_force", "m/s^2,m/s^2,m/s^2", "m/s^2,m/s^2,m/s^2"},
                                 {"imu", "angular_rate", "rad/s,rad/s,rad/s", "rad/s,rad/s,rad/s", false}};

/// True if the group is there.
bool sensor(Composer& file, hid_t owner, const std::string& group, bool spatial) {
  const bool known = !spatial || (group != "hand" && group != "ft");
  if (!known && file.choices().next() != 1) return false;
  const Handle home = file.group(owner, group, false);
  if (!home) return false;
  if (!known) file.harm();
  const std::size_t rows = group == "landing" ? 1 : 1 + (file.choices().next() + 3) % 50;
  std::vector<std::uint8_t> mask;
  if (group == "mocap") mask = file.flags(home.id(), "valid", rows);
  for (const Channel& channel : kChannels) {
    if (channel.group != group) continue;
    std::string_view units = spatial && known ? channel.spatial : channel.planar;
    if (spatial && group == "mocap" && units.size() > 5 && file.choices().next() == 1) units = "m,m,m";
    const bool time = std::string_view(channel.name) == "time";
    file.table(home.id(), channel.name,
               {rows, units, time, channel.required, time ? std::span<const std::uint8_t>{} : mask});
  }
  file.extras(home.id());
  return true;
}

void one_throw(Composer& file, hid_t throws, const std::string& id, std::span<const std::string_view> objects,
               bool spatial) {
  const Handle home = file.group(throws, id, false);
  if (!home) return;
  const hid_t toss = home.id();
  file.text(toss, "object", std::string(objects.empty() ? "bar" : objects.front()), true, objects);
  file.text(toss, "condition", "pitch-23");
  file.integer(toss, "repetition", 3, 0, 1'000'000'000);
  file.text(toss, "split", "train", true, kSplits);
  file.reals(toss, "detach_time", {0.1}, {1}, {}, false);
  file.reals(toss, "grasp_angle", {-0.2}, {1}, {}, false);
  Rule increasing;
  increasing.increasing = true;
  file.reals(toss, "hand_jump_times", {0.5, 1.5}, {}, increasing, false);
  file.reals(toss, "free_flight", {0.5, 1.5}, {2}, increasing, false);
  bool any = false;
  for (const char* group : {"hand", "ft", "mocap", "landing", "imu"})
    any = sensor(file, toss, group, spatial) || any;
  if (!any) file.harm();
  file.extras(toss);
}

bool compose_throw_log(const std::string& path, Choices& choices) {
  Composer file(path, choices);
  head(file, "throw-log");
  const bool spatial = choices.next() == 1;
  file.integer(file.root(), "dimension", spatial ? 3 : 2, spatial ? 3 : 2, spatial ? 3 : 2);
  file.text(file.root(), "title", "composed");
  file.text(file.root(), "source", "a fuzzer");
  file.text(file.root(), "licence", "CC0", false);
  file.reals(file.root(), "gravity", {9.81}, {1}, kNonNegative);
  file.reals(file.root(), "landing_height", {-0.1}, {1}, {});

  std::vector<std::string> names;
  if (const Handle objects = file.group(file.root(), "objects", true); objects) {
    const unsigned n = (choices.next() + 1) % 4;
    for (unsigned k = 0; k < n; ++k) {
      const std::string name = file.name("bar" + std::to_string(k));
      const Handle home = file.group(objects.id(), name, false);
      if (!home) continue;
      names.push_back(name);
      file.reals(home.id(), "mass", {0.246}, {1}, kPositive);
      file.reals(home.id(), "inertia", std::vector<double>(spatial ? 3 : 1, 1e-3), {spatial ? 3u : 1u},
                 kPositive, false);
      file.reals(home.id(), "com_offset", {0.1}, {1}, {}, false);
      file.reals(home.id(), "dims", {0.34, 0.03, 0.02}, {3}, kPositive, false);
      file.text(home.id(), "surface", "aluminium", false);
      file.text(home.id(), "sku", "bar-100", false);
      file.reals(home.id(), "drag_k", {0.01}, {1}, kNonNegative, false);
      file.extras(home.id());
    }
  }
  if (names.empty()) file.harm();
  const std::vector<std::string_view> objects(names.begin(), names.end());
  if (const Handle gripper = file.group(file.root(), "gripper", false); gripper) {
    file.integer(gripper.id(), "n_pads", 2, 1, 1000);
    file.reals(gripper.id(), "pad_radius", {0.0106}, {1}, kPositive, false);
    file.reals(gripper.id(), "opening_command_time", {0.05}, {1}, {}, false);
    file.extras(gripper.id());
  }
  if (const Handle throws = file.group(file.root(), "throws", true); throws) {
    const unsigned n = (choices.next() + 1) % 5;
    for (unsigned k = 0; k < n; ++k)
      one_throw(file, throws.id(), file.name(std::to_string(k)), objects, spatial);
    H5G_info_t info{};
    H5Gget_info(throws.id(), &info);
    if (info.nlinks == 0) file.harm();
  }
  return file.allowed();
}

bool compose_slip_log(const std::string& path, Choices& choices) {
  Composer file(path, choices);
  head(file, "slip-log");
  const Handle surfaces = file.group(file.root(), "surfaces", true);
  if (!surfaces) return false;
  const unsigned n = (choices.next() + 1) % 4;
  unsigned made = 0;
  for (unsigned k = 0; k < n; ++k) {
    const Handle surface = file.group(surfaces.id(), file.name("abs" + std::to_string(k)), false);
    if (!surface) continue;
    ++made;
    file.reals(surface.id(), "mass", {1.5}, {1}, kPositive);
    file.reals(surface.id(), "characteristic_length", {0.05}, {1}, kPositive);
    file.text(surface.id(), "description", "plastic");
    file.text(surface.id(), "licence", "CC0", false);
    file.extras(surface.id());
    const Handle slips = file.group(surface.id(), "slips", true);
    if (!slips) continue;
    const unsigned m = (choices.next() + 1) % 5;
    unsigned any = 0;
    for (unsigned i = 0; i < m; ++i) {
      const Handle slip = file.group(slips.id(), file.name(std::to_string(i)), false);
      if (!slip) continue;
      ++any;
      file.text(slip.id(), "split", "test", true, kSplits);
      const std::size_t rows = 1 + (choices.next() + 3) % 50;
      file.table(slip.id(), "time", {rows, "s", true});
      file.table(slip.id(), "wrench", {rows, "N,N,N m"});
      file.table(slip.id(), "twist", {rows, "m/s,m/s,rad/s"});
      file.extras(slip.id());
    }
    if (any == 0) file.harm();
  }
  if (made == 0) file.harm();
  return file.allowed();
}

/// NaN is the same as NaN.
void without_nan(datasets::ThrowLog& log) {
  for (auto& toss : log.throws)
    if (toss.mocap)
      for (double& x : toss.mocap->pose.data)
        if (std::isnan(x)) x = -1e300;
}
void without_nan(datasets::SlipLog&) {}

template <class Log, class Parse, class Read, class Write>
std::optional<Log> log_of(const ScratchFile& file, Process process, const Parse& parse, const Read& read,
                          const Write& write) {
  const auto once = [&](const std::string& path) {
    Log log;
    if (process == Process::of_its_own) {
      log = read(path);
    } else {
      const datasets::hdf5::Session session;
      log = parse(path, nullptr);
      datasets::validate(log);
    }
    return log;
  };
  Log first;
  try {
    first = once(file.path().string());
  } catch (const datasets::LogError&) {
    return {};
  }
  const ScratchFile copy(nullptr, 0);
  Log second;
  try {
    write(copy.path(), first);
    second = once(copy.path().string());
  } catch (const datasets::LogError& error) {
    throw std::logic_error(std::string("refused what it accepted before: ") + error.what());
  }
  without_nan(first);
  without_nan(second);
  if (!(first == second)) throw std::logic_error("not the same after it was written and read again");
  return first;
}

}  // namespace

std::vector<std::string> composed_names() { return {"throw_log", "slip_log"}; }

Reading read_composed(const std::string& log, const std::uint8_t* data, std::size_t size, Process process) {
  const bool throws = log == "throw_log";
  if (!throws && log != "slip_log") throw std::invalid_argument("no composed log is called " + log);
  const ScratchFile file(nullptr, 0);
  bool allowed = false;
  {
    const datasets::hdf5::Session session;
    Choices choices(data, size);
    allowed = (throws ? compose_throw_log : compose_slip_log)(file.path().string(), choices);
  }
  bool accepted = false;
  if (throws) {
    const auto read = log_of<datasets::ThrowLog>(file, process, datasets::hdf5::parse_throw_log,
                                                 datasets::read_throw_log, datasets::write_throw_log);
    accepted = read.has_value();
    if (read) to_json(datasets::summarise(*read));
  } else {
    accepted = log_of<datasets::SlipLog>(file, process, datasets::hdf5::parse_slip_log,
                                         datasets::read_slip_log, datasets::write_slip_log)
                   .has_value();
  }
  if (accepted && !allowed) throw std::logic_error("accepted what the schema does not allow");
  if (!accepted && allowed) throw std::logic_error("refused what the schema allows");
  return accepted ? Reading::accepted : Reading::refused;
}

}  // namespace unhand::fuzz
