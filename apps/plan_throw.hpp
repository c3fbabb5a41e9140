// What `unhand plan throw` found, and how it is told.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/output.hpp"
#include "planners/tube/plan_throw.hpp"
#include "planners/tube/release_throw.hpp"

namespace unhand::apps {

/// Landings of the same draws under one motion, from the target.
struct PredictedLandings {
  std::string name;             ///< "planned", "no acceleration", …
  planners::Landings drawn;     ///< forward [m]
  int hits{};                   ///< within the box, of all draws
  planners::Landings across{};  ///< the same draws, across [m]
  double rms() const;           ///< of the distance from the target [m]; NaN where none lands
};

struct ThrowAnswer {
  planners::Chain chain;  ///< up to what lands: the object's centre of mass
  planners::TargetBox box;
  planners::ThrowPlan plan;
  bool of_tube{true};  ///< the plan's state and margins are Tube-CVX's throw's, not the insensitive motion's
  double window{};     ///< for which q̈ is held [s]
  flight::Medium medium;  ///< of the flight
  std::string drag_from;  ///< who told its drag
  /// A number that the release rests on, and who told it and its σ.
  struct Number {
    std::string name, unit;  ///< "-" where it has none
    double value{};
    std::optional<double> sigma;  ///< none: not counted by itself
    std::string from;             ///< "card", "card; sigma: assumed", …
    std::string sigma_in{};       ///< the number in whose σ this one's is counted; empty: none
  };
  std::vector<Number> numbers;           ///< with a contact model
  std::vector<std::string> beyond_card;  ///< where the plan is beyond what its card was tried on
  std::vector<std::string> passed_over;  ///< sigmas that are told and that the plan does not count
  double lever{};                        ///< of an SKU: from the pads to the centre of mass [m]
  bool with_release{};                   ///< the release follows a contact model, not a delay
  std::optional<double> needed_force;    ///< of one pad, so that the grip holds until the command to open [N]
  std::optional<planners::ReleaseLanding> rigid,
      real;  ///< of the tube's motion: carried until the detach, and as the model says
  std::optional<planners::ReleaseSpread> spread_before, spread_after;
  std::vector<PredictedLandings> predicted;  ///< the plan's first
};

std::string text_of(const ThrowAnswer& answer, bool markdown = false);
Json throw_json(const ThrowAnswer& answer);
/// report.md, plan.json, trajectory.csv, landings.csv, and the figures tube, motion and landings.
void write_report(const ThrowAnswer& answer, const Json& json, const std::filesystem::path& directory);

}  // namespace unhand::apps
