// unhand import: the formats of a lab's own instruments, each file a throw or one part of it.
#pragma once

#include <string>
#include <vector>

#include "apps/output.hpp"
#include "apps/parser.hpp"

namespace unhand::apps {

/// As given on the command line; empty: not given.
struct LabOptions {
  std::string into, throw_id;
  bool replace{};
  std::string sku, object, title, source, licence, condition;
  double mass{}, gravity{9.81}, landing_height{}, pad_radius{}, opening_time{};
  int pads{2}, test_every{5}, dimension{3};
  std::vector<std::string> test_conditions;
  std::string columns, units, sigma;
  double time_offset{};
  std::string body;
  double heading{};  // [deg]
  bool trust_heading{};
  std::vector<double> origin, com, free_flight;
  bool landing{};
  double min_fall{0.4}, fall_threshold{5};  // [s], [m/s^2]
  const Parser* parser{};                   // knows which of them were given
};

/// What an importer says of its inputs.
struct Imported {
  std::string text;
  Json details;
  std::vector<std::string> notes;  ///< to be said on stderr once the log is written
};

/// The options that these formats share, in groups of the help.
void add_lab_options(Parser& parser, LabOptions& options);

/// Throws WrongUsage if one of these options is given: `format` takes none of them.
void refuse_lab_options(const std::string& format, const LabOptions& options);

/// Reads the files of one format ("hand-csv", "ft-csv", "mocap-csv", "motive-csv", "phyphox") into a new log,
/// or into the throws of the log that --into names, and hands it to `outputs` as `out`. Throws WrongUsage and
/// LogError.
Imported import_lab(const std::string& format, const std::vector<std::string>& inputs, const std::string& out,
                    const LabOptions& options, Outputs& outputs);

}  // namespace unhand::apps
