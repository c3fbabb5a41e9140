// Results as files: all of them in place, or none.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "datasets/slip_log.hpp"
#include "datasets/throw_log.hpp"

namespace unhand::apps {

using Json = nlohmann::ordered_json;

/// A number as JSON, which knows neither NaN nor infinity: those are null.
Json number(double value);
Json number(const std::optional<double>& value);
/// With so many digits after the point; "-" where there is none.
std::string fixed(const std::optional<double>& value, int digits);

/// Names of files may hold any bytes, JSON only UTF-8: what is none becomes U+FFFD.
inline std::string json_text(const Json& value) {
  return value.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}
/// The name of a file without its directories, as json_text would have it.
std::string utf8_name(const std::filesystem::path& file);

/// Writes a file in place, for directories that are not in place yet. Throws Unanswered.
void write_text(const std::filesystem::path& file, const std::string& content);

/// That a file which another program made is there to its end, `ending`. Otherwise throws Unanswered with
/// what the disk says of another one there, and below it what the program `said`.
void require_whole(const std::filesystem::path& file, const std::string& ending, const std::string& said);

/// What a run is to leave.
struct Wanted {
  enum What { file, log, directory };
  std::filesystem::path path;  // empty where nothing is wanted
  What what = file;
};

/// Finds out before the work begins what cannot be written: no directory to write it in, or something that is
/// no regular file in its place; a directory need not exist yet. Throws Unanswered, and WrongUsage for "-",
/// which elsewhere stands for the standard output, for one of `inputs`, which the run reads, for an HDF5 file
/// that something else than a log would replace, and for two that are one file, or one below the other.
void require_outputs(const std::vector<Wanted>& outputs,
                     const std::vector<std::filesystem::path>& inputs = {});

/// The files and directories that one run leaves. Everything is made beside its destination first; commit()
/// then renames, replacing files of the same names; behind a symbolic link, the file that it leads to.
/// Without commit() nothing stays, nor after an interruption (apps/interruption.hpp). Throws as
/// require_outputs does.
class Outputs {
 public:
  Outputs() = default;
  /// `inputs`: what the run reads, which no output may replace; empty paths are ignored.
  explicit Outputs(std::vector<std::filesystem::path> inputs) : inputs_(std::move(inputs)) {}
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;
  ~Outputs();

  void text(const std::filesystem::path& file, const std::string& content);
  void json(const std::filesystem::path& file, const Json& value) { text(file, json_text(value)); }

  void log(const std::filesystem::path& file, const datasets::ThrowLog& log);
  /// With what else the log `old` holds, see datasets/extended_log.hpp; returns what is left out.
  std::vector<std::string> log(const std::filesystem::path& file, const datasets::ThrowLog& log,
                               const std::filesystem::path& old);
  void log(const std::filesystem::path& file, const datasets::SlipLog& log);

  /// A directory to fill; commit() moves what it holds to `destination`, which may exist and keeps its other
  /// files.
  std::filesystem::path directory(const std::filesystem::path& destination);

  void commit();

 private:
  struct Part {
    std::filesystem::path made;
    Wanted destination;
  };
  /// `image`: the bytes.
  void hdf5(const std::filesystem::path& file, const std::function<std::string()>& image);
  std::filesystem::path part_of(const std::filesystem::path& destination);
  /// Where to make it.
  std::filesystem::path add(const Wanted& wanted);

  std::vector<std::filesystem::path> inputs_;
  std::vector<Part> parts_;
};

/// Removes from a directory what runs that were killed left of outputs with that file name, or of any: parts
/// of processes that no longer live.
void remove_leftovers(const std::filesystem::path& directory, const std::string& file_name = "");

/// {"schema": name, "schema_version": 1, "software": {...}}: the head of every JSON file.
Json json_head(const std::string& schema);

}  // namespace unhand::apps
