// How what importers read from several files becomes the throws of one log.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// What a file's name says: "slow_03.csv" is throw "slow_03", condition "slow", repetition 3; a name without
/// a number at its end is a condition by itself, repetition 0. Files that phyphox names ("Raw Data.csv") take
/// the name of their folder.
struct ThrowName {
  std::string id, condition;  ///< of the throw; of what it repeats
  int repetition = 0;         ///< as the name counts
};
/// The name of the throw that a file holds.
ThrowName name_of(const std::filesystem::path& file);

/// Which throws are held out, the same for the same names every time: every `test_every`-th throw of each
/// condition, in the order of repetitions, and the whole of each condition in `test_conditions`.
struct SplitRule {
  int test_every = 5;                        // >= 2; 0: none
  std::vector<std::string> test_conditions;  ///< held out as a whole
};
/// Throws std::invalid_argument for a rule out of range, or a condition that the log does not have.
void split_throws(ThrowLog& log, const SplitRule& rule);

/// Throws ImportError (`file` is where the throw would come from) if the id is taken.
void require_new(const ThrowLog& log, const std::string& id, const std::string& file);

/// Adds a throw. Throws ImportError (`file` is where it came from) if its id is taken.
void add_throw(ThrowLog& log, Throw one, const std::string& file);

/// Moves the channels (hand, ft, mocap, landing, imu) that `channels` carries, and its free_flight, into the
/// throw `id` of the log that `log_file` holds. Throws LogError if there is no such throw, or if it carries
/// one of them already and `replace` is not set.
void fill_throw(ThrowLog& log, const std::string& id, Throw channels, bool replace,
                const std::string& log_file);

/// The first valid sample at or below `height` [m] after the highest valid one of those later than `after`
/// [s]; nothing where the track does not come from above. `dimension` is the log's.
std::optional<std::size_t> first_below(const MocapLog& mocap, int dimension, double height,
                                       double after = -HUGE_VAL);

/// Where the track passes `height` [m] downwards for the first time after its highest point, interpolated
/// between two samples of `mocap` that follow each other without a loss: time and pose as in a throw log,
/// with the track's noise. Nothing where it does not. `dimension` is the log's.
std::optional<LandingLog> landing_of(const MocapLog& mocap, int dimension, double height);

}  // namespace unhand::datasets
