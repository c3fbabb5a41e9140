// What a model card says of a release, as plans of throws take it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "contact/friction_effects.hpp"
#include "contact/law_parameter.hpp"
#include "contact/patch.hpp"
#include "datasets/model_card.hpp"

namespace unhand::planners {

/// A number known up to a standard deviation, in the same unit.
struct Uncertain {
  double value{}, sigma{};  ///< 1 σ
};

/// Where a number of the release is from.
enum class NumberSource {
  assumed,    ///< nothing told it
  parameter,  ///< the card's parameters and spreads
  range,      ///< the card's valid range: measured in the throws that the card is of
  widened,    ///< of a σ: assumed, and a spread of the card's on top
};
/// As reports write it.
const char* to_string(NumberSource);
/// Of a number and of its σ.
struct NumberOrigin {
  NumberSource value{}, sigma{};    ///< of each
  std::vector<std::string> with{};  ///< spreads and numbers on cards whose σ is in this one, too
  std::string counted_in{};         ///< the number that this one's σ is in; empty: σ is its own
};

/// What is known of the release: a contact model, the friction of its pads, and how the gripper opens.
struct ReleaseCard {
  /// A name that contact::make_contact_model knows, of a law that follows the pads (contact::follows_pads).
  std::string model{"limit_surface"};
  Uncertain mu{0.5, 0.05};                        ///< friction coefficient [-]
  double length{contact::kFingerLength};          ///< L = τ_max/f_max [m]
  int pads{2};                                    ///< n >= 1
  double grip_force{40};                          ///< of one pad [N]
  Uncertain dead_time{0.020, 0.005};              ///< from the command to the first change of the force [s]
  Uncertain opening_time{0.060, 0.006};           ///< from there until the pads part [s]
  double shape{1.0};                              ///< p of contact::OpeningProfile [-]
  contact::LawValues<double> law_values{};        ///< of the law's own parameters
  contact::FrictionVariation<double> friction{};  ///< of the effects on friction
  std::vector<std::string> effects{};             ///< ids of these
  double grasp_offset{};  ///< 1 σ of the place of the pads on the object, throw to throw [m]
  double grasp_angle{};   ///< 1 σ of the object's angle in the hand, throw to throw [rad]
  std::map<std::string, NumberOrigin> origins{};  ///< by a number's name on cards; assumed if absent
  std::vector<std::string> passed_over{};         ///< names of numbers whose σ no unknown of the throw has
  double length_sigma{}, shape_sigma{};           ///< 1 σ of `length` [m] and of `shape` [-]
};

/// The least that a gripper's numbers scatter where a card's valid range tells them, 1 σ.
inline constexpr double kLeastForceSigma = 0.03,  ///< of the grip force, as its share [-]
    kLeastOpeningSigma = 1e-3;                    ///< of the dead time and of the opening time [s]

/// A model card's numbers: of its parameters mu, length, those of the law's own, pads, grip_force,
/// dead_time, opening_time and shape; else, for these four of the gripper, of its valid range; else those of
/// `otherwise`. The card's spreads from throw to throw add to σ: mu_deviation, dead_time_deviation,
/// grasp_offset and grasp_angle; force_deviation is of a log's sensor and passed over. σ of the grip force
/// counts as friction's, with which it forms one product. Effects on friction (contact::friction_effects)
/// act in the release; those of sensors, of what a log measured or declared, are passed over. Throws
/// datasets::CardError for a card of gripper_delay, for one with other effects, which this planner does not
/// take, and for parameters and spreads that it does not know.
ReleaseCard release_card(const datasets::ModelCard& card, const std::string& file,
                         const ReleaseCard& otherwise = {});

}  // namespace unhand::planners
