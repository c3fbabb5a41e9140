// What `unhand plan flip` learned, and how it is told.
#pragma once

#include <filesystem>
#include <numbers>
#include <optional>
#include <string>

#include "apps/output.hpp"
#include "planners/flip/session.hpp"

namespace unhand::apps {

inline constexpr double kDegree = std::numbers::pi / 180;  ///< rad

struct FlipAnswer {
  std::string learner;
  planners::flip::FlipTarget target;
  planners::flip::Bar declared_bar;  ///< of the robot file; the population's
  planners::flip::Bar bar;           ///< that is thrown
  planners::flip::Bar known_bar;     ///< whose throws the learner began with
  bool paper_shift{};                ///< the bar is the paper's shift away, since nobody named one
  std::vector<planners::flip::FlipDatum> known;  ///< what the learner began with, transferred to `bar`
  int known_throws{};
  planners::flip::LearningPath path;
  int throws{};  ///< of each command
  std::optional<planners::flip::Gathered> population;
  std::string card;  ///< a model card's JSON, of m4
};

std::string text_of(const FlipAnswer& answer);
Json flip_json(const FlipAnswer& answer);
/// path.md, flip.json, and the figures path, progress and, if it was thrown, population.
void write_report(const FlipAnswer& answer, const std::filesystem::path& directory);

}  // namespace unhand::apps
