// The throws of a throw-flip session as files: each in place as a whole or not there, so that a session that
// was killed goes on where it was.
#pragma once

#include <filesystem>

#include "apps/output.hpp"
#include "planners/flip/session.hpp"

namespace unhand::apps {

Json trial_json(const planners::flip::FlipTrial& trial);
Json bar_json(const planners::flip::Bar& bar);

/// DIRECTORY/session.json says what is thrown; DIRECTORY/trials/STAGE-INDEX.json is one throw.
class FlipStore {
 public:
  /// Creates the session, or goes on with the one that is there, and removes what a killed run left half
  /// written. `settings` has a `robot` and a `seed`, which every throw's file repeats. Throws WrongUsage,
  /// with the options that differ, where another session lies there, and datasets::LogError where its file
  /// cannot be read.
  FlipStore(std::filesystem::path directory, const Json& settings);

  /// Recalls the throws that are there, and keeps those that `plant` makes. A recalled throw must be of the
  /// same robot, seed, stage, index, command and bar; otherwise throws datasets::LogError.
  planners::flip::Thrower over(planners::flip::Thrower plant);

  int recalled() const { return recalled_; }
  int thrown() const { return thrown_; }

 private:
  Json label_of(const planners::flip::TrialRequest& request) const;

  std::filesystem::path directory_;
  Json robot_, seed_;
  int recalled_{}, thrown_{};
};

}  // namespace unhand::apps
