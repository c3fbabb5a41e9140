// What the parts of `unhand compare` hand to each other.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "apps/output.hpp"
#include "apps/table.hpp"
#include "experiment/compare.hpp"

namespace unhand::apps {

struct CompareRequest {
  std::string log;
  std::vector<std::string> models, cards;  ///< no models: the usual ones of that kind of log
  std::string json, report, write_cards;   ///< destinations; empty: none
  bool fit{};
  int threads{0};
  release::NaiveOptions naive;
  double rtol{1e-6};  // the printed digits do not change below 1e-5

  std::vector<std::filesystem::path> inputs() const {
    std::vector<std::filesystem::path> all(cards.begin(), cards.end());
    all.emplace_back(log);
    return all;
  }
};

/// Free flights: every throw through the flight models.
void compare_flights(const CompareRequest& request, const datasets::ThrowLog& log);

/// Free flights or falls with the card of one of their models: errors without its effects and with them.
void compare_with_card(const CompareRequest& request, const datasets::ThrowLog& log);

/// Slip logs: limit surfaces identified from measured slips, cross-validated.
void compare_slips(const CompareRequest& request);

/// Writes what the request wants of one table's answer (`report` draws and writes into a directory, to which
/// compare.json comes), and prints it.
void answer_with(const CompareRequest& request, const std::string& heading, const Table& table,
                 const Json& json, const std::function<void(const std::filesystem::path& directory)>& report);

/// Statistics of errors, null where so few errors have none: below one a mean, below two a standard
/// deviation.
Json statistics_json(const experiment::ErrorStatistics&);

/// The tables of a comparison of releases, in words and numbers.
struct ReleaseTables {
  Table errors, bias, parameters;
  std::string heading, floor;
  std::vector<std::string>
      methods;  ///< "[1] ...": how parameters were found, as the table's "how" counts them
};
ReleaseTables release_tables(const experiment::Comparison& comparison, const datasets::ThrowLog& log,
                             const std::string& file);
Json release_json(const experiment::Comparison& comparison, const CompareRequest& request);

/// Every throw with every model: predictions and errors, times on the clock of the log's file.
Table throw_table(const experiment::Comparison& comparison, const datasets::ThrowLog& log);

/// Figures, tables, per-throw errors and JSON into a directory.
void write_release_report(const experiment::Comparison& comparison, const datasets::ThrowLog& log,
                          const ReleaseTables& tables, const Json& json,
                          const std::filesystem::path& directory);

/// "landed", or what ended the prediction.
std::string outcome_of(const experiment::Prediction& prediction);
/// The same as a clause, for people.
std::string outcome_in_words(const experiment::Prediction& prediction);

}  // namespace unhand::apps
