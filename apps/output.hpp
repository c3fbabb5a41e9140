// Results as files: all of them in place, or none.
#pragma once

#include <filesystem>
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

inline std::string json_text(const Json& value) { return value.dump(1) + "\n"; }

/// Writes a file in place, for directories that are not in place yet. Throws Unanswered.
void write_text(const std::filesystem::path& file, const std::string& content);

/// That a file which another program made is there to its end, `ending`. Otherwise throws Unanswered with
/// what the disk says of another one there, and below it what the program `said`.
void require_whole(const std::filesystem::path& file, const std::string& ending, const std::string& said);

/// The files and directories that one run leaves. Everything is made beside its destination first; commit()
/// then renames, replacing files of the same names; behind a symbolic link, the file that it leads to.
/// Without commit() nothing stays, nor after an interruption (apps/interruption.hpp). Throws Unanswered where
/// something cannot be written, and WrongUsage for an output that is an input, the same as another output, or
/// below one that is a file.
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
  void log(const std::filesystem::path& file, const datasets::SlipLog& log);

  /// A directory to fill; commit() moves what it holds to `destination`, which may exist and keeps its other
  /// files.
  std::filesystem::path directory(const std::filesystem::path& destination);

  void commit();

 private:
  struct Part {
    std::filesystem::path made, destination;
    bool is_directory{};
  };
  template <class Log>
  void hdf5(const std::filesystem::path& file, const Log& log);
  std::filesystem::path part_of(const std::filesystem::path& destination);
  void require_other_than_inputs(const std::filesystem::path& destination) const;
  /// Where to make what goes to `destination`.
  std::filesystem::path add(const std::filesystem::path& destination, bool is_directory);

  std::vector<std::filesystem::path> inputs_;
  std::vector<Part> parts_;
};

/// Finds out before the work begins that a file cannot be written there: no directory to write it in, or
/// something that is no regular file in its place. An empty path passes. Throws Unanswered, and WrongUsage
/// for "-", which elsewhere stands for the standard output, and for one of `inputs`, which the run reads.
void require_writable(const std::filesystem::path& file,
                      const std::vector<std::filesystem::path>& inputs = {});
/// The same of a directory, which need not exist yet.
void require_writable_directory(const std::filesystem::path& directory);

/// Removes from a directory what runs that were killed left of outputs with that file name, or of any: parts
/// of processes that no longer live.
void remove_leftovers(const std::filesystem::path& directory, const std::string& file_name = "");

/// {"schema": name, "schema_version": 1, "software": {...}}: the head of every JSON file.
Json json_head(const std::string& schema);

}  // namespace unhand::apps
