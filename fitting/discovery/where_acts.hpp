// Where an effect acts: in the hand, on the pads, in the air. Internal to fitting.
#pragma once

#include <string>

#include "fitting/discovery/accepted_effect.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// In flight or at the landing, not in the hand.
bool in_air(Phase phase);
/// Whether an effect is one on the contact or the release.
bool acts_on_pads(const std::string& id);
/// Whether an effect is one of sensing, or of what the log declares.
bool is_of_sensor(const std::string& id);
/// Whether an effect acts in the hand and in the air alike (Effect::acts_everywhere); laws do not.
bool acts_everywhere(const std::string& id);
/// Whether an effect on the pads was added.
bool acts_on_pads(const Stage& stage);
/// Whether an effect acts in the air, or in the hand: where the misfit fell most, an effect on the pads in
/// the hand wherever that was, and one that acts everywhere (Effect::acts_everywhere) in both.
bool acts(const AcceptedEffect& effect, bool air);

}  // namespace unhand::fitting
