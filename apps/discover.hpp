// unhand discover: its JSON and its page.
#pragma once

#include <filesystem>
#include <string>

#include "apps/output.hpp"
#include "apps/table.hpp"
#include "fitting/discovery/discover.hpp"

namespace unhand::apps {

/// discovery.json, schema "discovery" version 1.
Json discovery_json(const fitting::Discovery& discovery, const std::string& log, const std::string& model);

/// The answer in a few lines; `origin` is what the log declares of itself.
std::string discovery_text(const fitting::Discovery& discovery, const std::string& log,
                           const std::string& origin);

/// Errors of what is predicted before the throw, of train and test throws, before and after.
Table prediction_errors(const fitting::Discovery& discovery);
/// The base model's parameters as the answer has them and, where it adds something, as they were before.
std::string parameters_text(const fitting::Discovery& discovery);
/// What was fitted along without being an answer, by the effect's id, with its values in `fit`.
std::string along_text(const std::string& id, const fitting::FitResult& fit);

/// A self-contained page (index.html), the figures with their data and scripts, and discovery.json.
void write_discovery_report(const fitting::Discovery& discovery, const std::string& log,
                            const std::string& origin, const std::string& command, const Json& json,
                            const std::filesystem::path& directory);

}  // namespace unhand::apps
