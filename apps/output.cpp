#include "apps/output.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "apps/command.hpp"
#include "apps/interruption.hpp"
#include "datasets/extended_log.hpp"
#include "datasets/whole_file.hpp"

namespace unhand::apps {

namespace fs = std::filesystem;

namespace {

constexpr const char* kPart = ".part-";  // .NAME.part-PROCESS-NUMBER, beside NAME

/// The path as it will be called once it is in place.
fs::path in_place(const fs::path& made) {
  fs::path out;
  for (const fs::path& step : made) {
    const std::string name = step.string();
    const std::size_t at = name.rfind(kPart);
    out /=
        name.starts_with('.') && at != std::string::npos && at > 0 ? fs::path(name.substr(1, at - 1)) : step;
  }
  return out.lexically_normal();
}

[[noreturn]] void refuse(const fs::path& file, const std::string& why) {
  throw Unanswered(fmt::format("{}: cannot be written: {}", in_place(file).string(), why));
}

fs::path parent_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

/// The path without a slash at its end.
fs::path trimmed(const fs::path& directory) {
  return directory.has_filename() ? directory : directory.parent_path();
}

/// The nearest directory above `path` that exists, or what stands in its place.
fs::path nearest_existing(fs::path path) {
  std::error_code error;
  while (!fs::exists(path, error) && path.has_relative_path()) path = parent_of(path);
  return path;
}

void require_directory(const fs::path& wanted, const fs::path& directory) {
  std::error_code error;
  if (!fs::is_directory(directory, error))
    refuse(wanted, fmt::format("{} is no directory", directory.string()));
  if (access(directory.c_str(), W_OK | X_OK) != 0)
    refuse(wanted, fmt::format("no permission in {}", directory.string()));
}

/// Whether a path, both without links and dots, leads through the other one.
bool is_below(const fs::path& path, const fs::path& other) {
  return path != other &&
         std::mismatch(path.begin(), path.end(), other.begin(), other.end()).second == other.end();
}

void put_in_place(const fs::path& made, const fs::path& destination) {
  std::error_code error;
  fs::rename(made, destination, error);
  if (error) refuse(destination, error.message());
}

void require_other_than(const std::vector<fs::path>& inputs, const fs::path& destination) {
  std::error_code error;
  for (const fs::path& input : inputs)
    if (!input.empty() && fs::equivalent(input, destination, error) && !error)
      throw WrongUsage(fmt::format("{} is read: it cannot be an output too", destination.string()));
}

/// Its signature is at 0, 512, 1024, 2048, ...
bool is_hdf5(const fs::path& file) {
  constexpr std::string_view signature = "\x89HDF\r\n\x1a\n";
  std::ifstream in(file, std::ios::binary);
  std::string there(signature.size(), '\0');
  for (std::streamoff at = 0; in.seekg(at) && in.read(there.data(), std::ssize(there));
       at = at == 0 ? 512 : 2 * at)
    if (there == signature) return true;
  return false;
}

void require_file(const Wanted& wanted, const std::vector<fs::path>& inputs) {
  const fs::path& file = wanted.path;
  if (file == "-") throw WrongUsage("'-' names no file, and outputs are files: ./- for one of that name");
  std::error_code error;
  if (fs::is_directory(file, error)) refuse(file, "it is a directory");
  if (fs::exists(file, error) && !fs::is_regular_file(file, error)) refuse(file, "it is no regular file");
  if (fs::is_symlink(file, error) && !fs::exists(file, error))
    refuse(file, "it is a link that leads nowhere");
  require_directory(file, parent_of(file));
  require_other_than(inputs, file);
  if (wanted.what != Wanted::log && is_hdf5(file))
    throw WrongUsage(
        fmt::format("{} is an HDF5 file, which only a log may replace; if it is to be read: --json takes the "
                    "next word as its file, so write --json=FILE, or {} before it",
                    file.string(), file.string()));
}

void require_one(const Wanted& wanted, const std::vector<fs::path>& inputs) {
  if (wanted.path.empty()) return;
  if (wanted.what == Wanted::directory)
    require_directory(wanted.path, nearest_existing(trimmed(wanted.path)));
  else
    require_file(wanted, inputs);
}

/// However it is spelt.
fs::path one_spelling(const fs::path& path) {
  std::error_code error;
  return fs::weakly_canonical(fs::absolute(trimmed(path), error), error);  // alone, it leaves "a" as it is
}

void require_apart(const Wanted& first, const Wanted& second) {
  if (first.path.empty() || second.path.empty()) return;
  const fs::path one = one_spelling(first.path), other = one_spelling(second.path);
  if (one == other) throw WrongUsage(fmt::format("two outputs are to be {}", second.path.string()));
  if ((first.what != Wanted::directory && is_below(other, one)) ||
      (second.what != Wanted::directory && is_below(one, other)))
    throw WrongUsage(fmt::format("{} and {}: one output is to be a file, the other one below it",
                                 first.path.string(), second.path.string()));
}

}  // namespace

void require_outputs(const std::vector<Wanted>& outputs, const std::vector<fs::path>& inputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) require_apart(outputs[j], outputs[i]);
  for (const Wanted& one : outputs) require_one(one, inputs);
}

std::string utf8_name(const fs::path& file) {
  return Json::parse(json_text(file.filename().string())).get<std::string>();
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }
Json number(const std::optional<double>& value) { return value ? number(*value) : Json(nullptr); }
std::string fixed(const std::optional<double>& value, int digits) {
  return value ? fmt::format("{:.{}f}", *value, digits) : "-";
}

void write_text(const fs::path& file, const std::string& content) {
  const Unbroken here;
  if (const std::string failed = datasets::write_whole(file, content); !failed.empty()) refuse(file, failed);
}

void require_whole(const fs::path& file, const std::string& ending, const std::string& said) {
  std::error_code error;
  std::ifstream in(file, std::ios::binary);
  const auto size = static_cast<std::streamoff>(in ? fs::file_size(file, error) : 0);
  constexpr std::streamoff tail = 64;
  in.seekg(std::max(std::streamoff{0}, size - tail));
  if (std::string((std::istreambuf_iterator<char>(in)), {}).find(ending) != std::string::npos) return;
  constexpr std::size_t much = 1 << 16;
  const fs::path probe = file.string() + ".probe";
  std::string why = datasets::write_whole(probe, std::string(much, ' '));
  fs::remove(probe, error);
  if (why.empty()) why = "it is not whole, and the disk takes more";
  refuse(file, said.empty() ? why : why + "\n" + said);
}

Outputs::~Outputs() {
  if (parts_.empty()) return;
  const Unbroken here;
  std::error_code ignored;
  for (const Part& part : parts_) {
    fs::remove_all(part.made, ignored);
    keep_if_interrupted(part.made);
  }
}

namespace {

/// Where the parts of an output are made: beside it; a directory that is there, which may be a volume of its
/// own, has them inside.
fs::path place_of_parts(const fs::path& destination) {
  std::error_code error;
  return fs::is_directory(destination, error) ? destination : nearest_existing(parent_of(destination));
}

}  // namespace

fs::path Outputs::part_of(const fs::path& destination) {
  return place_of_parts(destination) /
         fmt::format(".{}{}{}-{}", destination.filename().string(), kPart, getpid(), parts_.size());
}

fs::path Outputs::add(const Wanted& wanted) {
  require_one(wanted, inputs_);
  for (const Part& part : parts_) require_apart(part.destination, wanted);
  std::error_code error;
  const fs::path destination =
      fs::is_symlink(wanted.path, error) ? fs::weakly_canonical(wanted.path, error) : wanted.path;
  remove_leftovers(place_of_parts(destination), destination.filename().string());
  parts_.push_back({part_of(destination), {destination, wanted.what}});
  remove_if_interrupted(parts_.back().made);
  return parts_.back().made;
}

void Outputs::text(const fs::path& file, const std::string& content) { write_text(add({file}), content); }

void Outputs::hdf5(const fs::path& file, const std::function<std::string()>& image) {
  const fs::path made = add({file, Wanted::log});
  try {
    write_text(made, image());
  } catch (const datasets::LogError& error) {
    refuse(file, fmt::format("{}: {}", error.path, error.reason));
  }
}

void Outputs::log(const fs::path& file, const datasets::ThrowLog& log) {
  hdf5(file, [&] { return datasets::to_hdf5(log, file.string()); });
}

std::vector<std::string> Outputs::log(const fs::path& file, const datasets::ThrowLog& log,
                                      const fs::path& old) {
  auto extended = datasets::to_hdf5_with_extras(log, old, file.string());  // LogErrors are the old file's
  hdf5(file, [&] { return std::move(extended.image); });
  return std::move(extended.left_out);
}

void Outputs::log(const fs::path& file, const datasets::SlipLog& log) {
  hdf5(file, [&] { return datasets::to_hdf5(log, file.string()); });
}

fs::path Outputs::directory(const fs::path& destination) {
  const Unbroken here;  // an interruption removes what is there
  const fs::path made = add({trimmed(destination), Wanted::directory});
  std::error_code error;
  if (!fs::create_directory(made, error) || error) refuse(destination, error.message());
  return made;
}

void Outputs::commit() {
  const Unbroken here;  // all or none
  std::error_code error;
  std::vector<Part> moves;
  for (const Part& part : parts_) {
    const fs::path& destination = part.destination.path;
    if (part.destination.what != Wanted::directory) {
      moves.push_back(part);
      continue;
    }
    fs::create_directories(destination, error);
    if (error) refuse(destination, error.message());
    for (const auto& entry : fs::directory_iterator(part.made))
      moves.push_back({entry.path(), {destination / entry.path().filename()}});
  }
  for (const auto& [from, to] : moves) {  // all that is known to fail, before the first one is in place
    if (fs::is_directory(from, error))
      require_other_than(inputs_, to.path);
    else
      require_file(to, inputs_);
  }
  for (const auto& [from, to] : moves) put_in_place(from, to.path);
  for (const Part& part : parts_) {
    if (part.destination.what == Wanted::directory) fs::remove(part.made, error);
    keep_if_interrupted(part.made);
  }
  parts_.clear();
}

void remove_leftovers(const fs::path& directory, const std::string& file_name) {
  std::error_code error;
  std::vector<fs::path> dead;
  for (const auto& entry : fs::directory_iterator(directory, error)) {
    const std::string name = entry.path().filename().string();
    const std::size_t at = name.rfind(kPart);
    if (at == std::string::npos || at == 0 || name.front() != '.') continue;
    if (!file_name.empty() && name.substr(1, at - 1) != file_name) continue;
    const pid_t process = std::atoi(name.c_str() + at + std::strlen(kPart));
    if (process > 0 && kill(process, 0) != 0 && errno == ESRCH) dead.push_back(entry.path());
  }
  for (const fs::path& one : dead) fs::remove_all(one, error);
}

Json json_head(const std::string& schema) {
  return {{"schema", schema},
          {"schema_version", 1},
          {"software", {{"name", "unhand"}, {"version", UNHAND_VERSION}}}};
}

}  // namespace unhand::apps
