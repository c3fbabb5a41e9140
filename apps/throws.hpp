// Logs of throws as the subcommands want them: read, not empty, in the units that they declare.
#pragma once

#include <string>
#include <vector>

#include "datasets/sku.hpp"
#include "datasets/slip_log.hpp"
#include "datasets/throw_log.hpp"

namespace unhand::apps {

/// Leaves out, and says so on stderr, throws without a hand, as long as others have one, and throws from a
/// hand that do not show the grasp (experiment::shows_grasp), as long as others do. Tells of times that
/// cannot be (experiment::impossible_times). Throws datasets::LogError where the file is no throw log, a
/// column is in another unit (experiment::require_units), or no throw shows the grasp since the clocks do not
/// overlap; Unanswered where it holds no throws.
datasets::ThrowLog read_throws(const std::string& file);

/// Leaves out, and says so on stderr, throws without a normal force, as long as others have one: for models
/// that follow the pads and are not told how these open.
void leave_out_forceless(datasets::ThrowLog& log);

/// A log's own words with blanks for control characters, which would steer the terminal.
std::string printable(std::string text);

/// Title and source as the log declares them: "synthetic throws: ...; synthetic: simulated by ...".
std::string origin_text(const datasets::ThrowLog& log);
/// Of a slip-log: how many surfaces, and what is said of the first.
std::string origin_text(const datasets::SlipLog& log);

/// Where the throw of that id is. Throws WrongUsage, naming the nearest id or some of them, if there is none.
std::size_t place_of(const datasets::ThrowLog& log, const std::string& id, const std::string& file);

/// Whether no throw of the log has a hand in the plane to be released from.
bool is_of_flights(const datasets::ThrowLog& log);

/// Throws datasets::LogError where every throw is held at first and nothing says when it flies
/// (datasets::held_by); where some are, they are left out as not_free.
void require_flights(const datasets::ThrowLog& log, const std::string& file);

/// Slips whose friction takes work from the object: throws datasets::LogError for a surface of which the
/// samples say the opposite (datasets::dissipation < 0), as where a wrench or a twist has the other sign.
datasets::SlipLog read_slips(const std::string& file);

/// An object that a body can be: throws datasets::TomlError where none of its mass and dims has its inertia
/// (experiment::impossible_inertia), and as datasets::read_sku does.
datasets::Sku read_possible_sku(const std::string& file);
/// The same with its inertia known, which every throw needs.
datasets::Sku read_throwable_sku(const std::string& file);

/// What can be fitted to slips: limit surfaces.
std::vector<std::string> surface_model_names();
/// Throws datasets::LogError where the log, of slips or of throws, is not of the kind that the model
/// predicts.
void require_of_slips(const std::string& model, const std::string& file);
void require_of_throws(const std::string& model, const std::string& file);

/// In words, what is wrong with a surface of that (negative) datasets::dissipation.
std::string sign_doubt(double dissipation);

}  // namespace unhand::apps
