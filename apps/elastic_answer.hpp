// What the commands of elastic arms found, as it is written and printed.
#pragma once

#include <string>
#include <vector>

#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "apps/table.hpp"

namespace unhand::apps {

/// An answer in all its forms.
struct ElasticAnswer {
  Table table;
  std::string notes;         ///< lines below the table
  std::string table_file;    ///< its name in a report
  std::string trajectories;  ///< CSV of the runs
  std::vector<Figure> figures;
  Json json;
};

/// Writes JSON and report where they are asked for (a path that is not empty), then prints table and notes.
/// `command` made it; `arm` is the file that it was made from, which is not overwritten.
void give(const ElasticAnswer& answer, const std::string& command, const std::string& arm,
          const std::string& json, const std::string& report);

}  // namespace unhand::apps
