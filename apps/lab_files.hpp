// One file of a lab's instrument, as unhand import reads it.
#pragma once

#include <string>
#include <vector>

#include "apps/import_lab.hpp"
#include "datasets/throw_log.hpp"

namespace unhand::apps {

/// What one file gave: throws without names, and a line to say of it.
struct Reading {
  std::vector<datasets::Throw> throws;
  std::string text;
  Json details;
  std::vector<std::string> notes;
};

/// Reads a file of `format` for `log`, whose dimension, gravity and landing height count. Throws WrongUsage
/// for options that contradict each other, datasets::LogError and datasets::ImportError for the file.
Reading read_lab_file(const std::string& format, const std::string& file, const datasets::ThrowLog& log,
                      const LabOptions& options);

}  // namespace unhand::apps
