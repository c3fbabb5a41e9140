// The pads of a card as a contact law takes them. Internal to planners.
#pragma once

#include <type_traits>

#include "contact/patch.hpp"
#include "contact/registry.hpp"
#include "planners/tube/release_card.hpp"

namespace unhand::planners {

/// With a friction coefficient [-] and a length L [m] of one's own.
template <class S>
contact::ContactParameters<S> pads_of(const ReleaseCard& card, const S& mu, const S& length) {
  contact::ContactParameters<S> out;
  out.patch = contact::Patch<S>::of_length(mu, length, card.pads);
  for (const auto& [name, value] : card.law_values) out.law_values.emplace(name, S(value));
  if constexpr (std::is_same_v<S, double>)
    out.variation = card.friction;
  else
    out.variation = contact::constant(card.friction);
  return out;
}

}  // namespace unhand::planners
