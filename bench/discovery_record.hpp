// What a study of the loop keeps of one campaign, one line of JSON, and the tables over many.
#pragma once

#include <string>
#include <vector>

#include "experiment/campaign_effects.hpp"
#include "fitting/discovery/discover.hpp"

namespace unhand {

/// The effect's id in "id.parameter".
inline std::string id_of(const std::string& setting) { return setting.substr(0, setting.rfind('.')); }

/// An effect that was put into a campaign.
struct Planted {
  std::string id;
  double size{};  ///< of its largest parameter, in typical steps from neutral
  bool right{};   ///< it was named, or the catalogue had to forget it and its phase is unexplained
  /// It was missed, and looked for again in the same campaign: without the other effect, or by the catalogue
  /// that does not forget it.
  bool asked_again{};
  bool found_again{};  ///< and named then
  bool evident{};      ///< it was missed, but said to be evident and too small to matter
};

/// A size that the loop gave, and the true one.
struct Estimated {
  std::string name;  ///< id.parameter
  double truth{}, value{}, sigma{};
};

/// A campaign and what the loop said of it.
struct StudyRecord {
  std::string kind, without;         ///< of the study; sensors that the campaign does not have
  unsigned long long seed{};         ///< of the campaign
  std::string answer;                ///< in words; or why the campaign could not be made
  bool made{true}, false_name{};     ///< false_name: something was named that is not there
  bool unexplained{};                ///< something was said to be left
  std::vector<Planted> effects;      ///< that are there
  std::vector<Estimated> estimates;  ///< of those that were named
  double cpu_seconds{}, seconds{};   ///< of all threads of the process; of the wall's clock

  /// Judges an answer.
  void judge(const experiment::EffectSettings& truth, const fitting::Discovery& found);
  /// One line of JSON.
  std::string line() const;
  /// Throws as the JSON library does.
  static StudyRecord parse(const std::string& line);
};

/// Whether an answer names an effect, if only as another name.
bool names(const fitting::Discovery& found, const std::string& id);
/// An answer in a few words.
std::string answer_of(const fitting::Discovery& found);
/// Records of a file; none where there is no file.
std::vector<StudyRecord> read_records(const std::string& file);
/// For every kind and lack of sensors: what was found by effect and size, how good the sizes are, what was
/// named falsely.
void print_tables(const std::vector<StudyRecord>& records);

}  // namespace unhand
