// What a contact law takes beside the patch: its own parameters, by name.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>

namespace unhand::contact {

/// A parameter of one law alone. Fits search it, cards hold it, plans and predictions pass it on, all by what
/// is said here.
struct LawParameter {
  std::string name;  ///< as on cards: none of the names of patch, gripper and throw (mu, length, delay, ...)
  std::string unit;  ///< not empty: "-" where it has none
  double start{};    ///< where fits begin, and what holds where nobody says [unit]
  double low{}, high{};                 ///< accepted, ends included [unit]
  double search_low{}, search_high{};   ///< where fits look, within [low, high] [unit]
  double typical{};                     ///< a step that matters, > 0 [unit]
  std::optional<double> prior_sigma{};  ///< of `start`, 1 σ, > 0 [unit]; nothing is known if absent
  std::string remedy{};                 ///< what to measure where a log does not tell it
};

/// Values of a law's own parameters by name; LawParameter::start where one is absent.
template <class S>
using LawValues = std::map<std::string, S, std::less<>>;

}  // namespace unhand::contact
