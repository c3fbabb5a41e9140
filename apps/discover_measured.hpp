// unhand discover on logs that are no throws from a hand: free flights, falling accelerometers, slips.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace unhand::apps {

/// What such a log is.
enum class MeasuredKind { flights, falls, slips };
struct MeasuredRequest {
  std::string log, report, json, card, command;
  std::optional<std::string> model;  ///< absent, as for the command's default: the kind's own
  std::vector<std::string> forget;
  double floor{0};
  int most{6}, threads{0};
};

/// Empty for a log of planar throws. Throws as the readers do.
std::optional<MeasuredKind> measured_kind(const std::string& log);
/// The base models that these logs have.
const std::vector<std::string>& measured_models();
/// Runs the loop and writes what was asked for. Throws WrongUsage for a model that the log's kind has not,
/// and Unanswered.
void discover_measured(MeasuredKind kind, const MeasuredRequest& request);

}  // namespace unhand::apps
