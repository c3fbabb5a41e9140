// What is in a throw log, at a glance: counts, rates, gaps, declared noise.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"

namespace unhand::datasets {

/// One group ("hand", "ft", "mocap", "imu") of one throw on its own clock. Rates are 0 where there is one
/// sample only.
struct ChannelSummary {
  std::string group;                   ///< its name in the log
  std::size_t rows = 0, lost = 0;      // lost: samples flagged invalid
  double start = 0, end = 0;           // [s], as all times of this by the file's clock
  double rate = 0;                     // [Hz] 1 / median step
  double median_step = 0;              // [s]
  double longest_gap = 0, gap_at = 0;  // [s] the largest step, and the time it starts at
  std::size_t longest_loss = 0;        // most invalid samples in a row
};

/// What `unhand inspect` says of one throw.
struct ThrowSummary {
  std::string id, object, condition;     ///< as in the log
  Split split = Split::train;            ///< whether it may be fitted to
  bool landing = false;                  ///< whether the landing was measured
  std::vector<ChannelSummary> channels;  ///< one per group that the throw has
};

/// One group over all throws that carry it.
struct GroupSummary {
  std::string group;                           ///< its name in the log
  std::size_t throws = 0, rows = 0, lost = 0;  ///< that carry it; samples; flagged invalid
  double lowest_rate = 0, highest_rate = 0;    // [Hz]
  double worst_gap_ratio = 0;                  // longest gap over median step
  std::string worst_gap_throw;                 ///< id of the throw with that gap
};

/// The declared noise of one dataset: [lowest, highest] per column over all throws; empty where none declares
/// any. Beside it the high-frequency scatter of the samples themselves, from third differences over all
/// throws, without what a smooth motion adds (its third differences over doubled steps are eight times as
/// large, those of white noise are not). Noise that is slower than the samples does not show in it. Of a
/// sensor that falls, that of its falls: before and after, hands and bounces move it.
struct NoiseSummary {
  /// From this ratio on a column scatters by more than it declares [-].
  static constexpr double kMore = 1.2;
  std::string dataset;                   // "mocap/pose"
  std::string columns, units;            ///< "x,z,theta" and "m,m,rad"; of the widest, where throws differ
  std::size_t throws = 0, declared = 0;  ///< that carry the dataset; that declare its noise
  std::size_t zero = 0;  ///< throws that declare 0 for a column; in series that counts as undeclared
  std::vector<double> lowest, highest;  ///< 1 σ by column, SI units
  std::vector<double> scatter;          ///< 1 σ by column, SI units; empty for single rows and times
  std::vector<double> ratio;            ///< of the scatter to the declared noise; 0 where there is no either
  std::vector<bool> too_small;  ///< a ratio above kMore, above 1 by three of its standard errors, where
                                ///< noise, not motion, is most of the doubled differences
  /// The columns whose declared noise is too small: "fx 3.3 times, tau 2 times"; empty where there are none.
  std::string understated() const;
};

/// What `unhand inspect` says of a log.
struct LogSummary {
  int dimension = 2;                                              ///< 2: in a plane, 3: in space
  std::string title, source, licence;                             ///< as declared
  double gravity = 0, landing_height = 0;                         ///< m/s²; m
  std::size_t throws = 0, train = 0, test = 0, free_flights = 0;  ///< how many; those that fly free
  std::vector<std::string> objects;                               ///< ids
  std::map<std::string, std::size_t> conditions;                  // throws in each
  std::vector<GroupSummary> groups;                               ///< one per group
  std::vector<NoiseSummary> noise;                                ///< one per dataset
  std::vector<ThrowSummary> each;                                 ///< in the order of the log
};

/// What shows that motion capture sees a throw without a hand while a gripper still holds it, or may: an
/// `ft`, an opening command or a `detach_time` not before its first valid sample; and no `free_flight` says
/// from when on it flies. In words; empty where it flies free, where it has a hand, or without motion
/// capture.
std::string held_by(const ThrowLog& log, const Throw& toss);

/// Counts, rates, gaps and declared noise of a log.
LogSummary summarise(const ThrowLog& log);

/// {"schema": "inspect", "schema_version": 1, ...}, indented, with a line break at the end.
std::string to_json(const LogSummary& summary);

}  // namespace unhand::datasets
