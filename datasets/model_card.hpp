// A model card: a model's name, the numbers it takes, and where they come from, as one JSON file.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "datasets/log_error.hpp"

namespace unhand::datasets {

/// A parameter on a card.
struct CardParameter {
  double value = 0;             ///< in `unit`
  std::optional<double> sigma;  // 1 σ, in the same unit
  std::string unit;             // "-" where it has none
  bool determined = true;       // false: the log alone says nothing of it, sigma is what was known before
  /// Of sigma, which comes from the scatter between throws; absent: sigma is known.
  std::optional<double> degrees_of_freedom = {};
  /// The 95 % interval in `unit`, where it is not value ± t sigma; an end that is infinite is open.
  std::optional<std::array<double, 2>> interval95 = {};
  bool operator==(const CardParameter&) const = default;
};

/// Of the estimated parameters: names.size() squared numbers, row by row, in the product of their units.
/// Symmetric, positive semidefinite, and sigma² on the diagonal where a parameter has one, to 1e-6.
struct CardCovariance {
  std::vector<std::string> names;  ///< of the estimated parameters, a row and column each
  std::vector<double> matrix;      ///< row by row
  /// The entry of two of them; none where a name is not among `names`.
  std::optional<double> of(const std::string& a, const std::string& b) const;
  bool operator==(const CardCovariance&) const = default;
};

/// 1 σ from throw to throw of a number that every throw has for itself ("grasp_angle").
struct CardSpread {
  double sigma = 0;  ///< in `unit`, >= 0; 0: it is the same in all throws. Fits write more than 0
  std::string unit;  ///< "-" where it has none
  bool operator==(const CardSpread&) const = default;
};

/// Errors, predicted minus measured, over n throws, in the unit that the quantity's name ends with.
struct CardStatistics {
  int n = 0;        ///< throws
  double mae = 0;   // mean of the absolute error
  double std = 0;   // standard deviation of the absolute error; null in the file below two throws, 0 here
  double bias = 0;  // mean of the error
  bool operator==(const CardStatistics&) const = default;
};

/// The log that the parameters were estimated from.
struct CardLog {
  std::string file, title;              ///< name of the file, without its folder; the log's title
  std::optional<std::string> checksum;  ///< "fnv1a64:" and 16 digits, as checksum_of makes it
  /// What the pads touched there, as the log's objects say, sorted; empty: it does not tell.
  std::vector<std::string> surfaces = {};
  bool operator==(const CardLog&) const = default;
};

/// The interval of a condition, ends included, in which the card has been tried.
struct CardRange {
  double low = 0, high = 0;  ///< in `unit`
  std::string unit;          ///< "-" where it has none
  bool operator==(const CardRange&) const = default;
};

///   {"schema": "model-card", "schema_version": 1, "model": "sliding_pivot",
///    "effects": ["contact.viscous"],
///    "parameters": {"mu": {"value": 0.61, "sigma": 0.01, "unit": "-", "degrees_of_freedom": 40},
///                   "length": {"value": 0.007, "sigma": 0.001, "unit": "m", "degrees_of_freedom": 12,
///                              "low95": 0.0062, "high95": null}, ...},     (null: open)
///    "covariance": {"names": ["mu", ...], "matrix": [[1e-4, ...], ...]},
///    "own_spreads": {"mu_deviation": {"sigma": 0.02, "unit": "-"}, ...},
///    "log": {"file": "campaign.h5", "title": "...", "checksum": "fnv1a64:...", "surfaces": ["aluminium"]},
///    "split": "train",
///    "errors": {"test": {"landing_x_m": {"n": 90, "mae": 0.003, "std": 0.002, "bias": 0.0}, ...}, ...},
///    "valid_range": {"grip_force": {"low": 45, "high": 55, "unit": "N"}, ...},
///    "warnings": ["the fit stopped before it had converged: ..."],
///    "library_version": "0.1.0"}
/// Required: schema, schema_version, model, parameters (value and unit of each), log (file), library_version.
struct ModelCard {
  std::string model;  ///< name of the contact model
  std::vector<std::string>
      effects;  // ids; their parameters are among `parameters`, as "id.name" or "id.name[object]"
  std::map<std::string, CardParameter> parameters;  ///< by name: "mu", "length", "contact.viscous.1/v_0", ...
  std::optional<CardCovariance> covariance;         ///< of those that were estimated
  std::map<std::string, CardSpread> own_spreads;    ///< by the name of a throw's own unknown
  CardLog log;                                      ///< what it was estimated from
  std::optional<std::string> split;                 // the throws that were used: "train", "test" or "all"
  /// By split ("train", "test", "cross_validation"), then by quantity.
  std::map<std::string, std::map<std::string, CardStatistics>> errors;
  std::map<std::string, CardRange> valid_range;  ///< by condition: "grip_force", ...
  std::vector<std::string> warnings;  ///< of the fit: why its values are not to be trusted as they are
  std::string library_version;        ///< that wrote the card
  /// Keys that this version does not know, as the text of a JSON object in the card's own structure; they
  /// return to their places when the card is written. Empty: none.
  std::string extra;
  bool operator==(const ModelCard&) const = default;
};

/// A card with a mistake in it: path is a JSON pointer ("/parameters/mu/value"), or "line L, column C" where
/// the file is no JSON.
class CardError : public LogError {
 public:
  using LogError::LogError;  ///< with the three parts
};

/// This library's, "0.1.0": what cards that it writes say of themselves.
std::string library_version();

/// Throws CardError.
ModelCard read_model_card(const std::filesystem::path& file);

/// The same of a text in memory; `file` is its name in errors.
ModelCard parse_model_card(const std::string& text, const std::string& file = "(in memory)");

/// What the card's valid range says of a condition: its middle, with the sigma of a number drawn evenly from
/// it. Nothing where the card has no such range. Throws CardError, naming `file`, where it is in another
/// unit.
std::optional<CardParameter> middle_of_range(const ModelCard& card, const std::string& file,
                                             const std::string& condition, const std::string& unit);

/// Indented JSON with a line break at the end. Doubles come back bit for bit. Throws CardError for a card
/// that could not be read again (no name, a number that is not finite, a range upside down).
std::string to_json(const ModelCard& card);

/// Written beside the destination, then renamed: a failure leaves nothing behind. Throws CardError.
void write_model_card(const std::filesystem::path& file, const ModelCard& card);

}  // namespace unhand::datasets
