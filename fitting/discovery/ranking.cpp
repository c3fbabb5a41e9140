#include "fitting/discovery/ranking.hpp"

#include <algorithm>

namespace unhand::fitting {

const char* to_string(Fate fate) {
  switch (fate) {
    case Fate::not_refitted:
      return "not refitted";
    case Fate::no_fit:
      return "no fit";
    case Fate::not_significant:
      return "not significant";
    case Fate::too_small:
      return "too small";
    case Fate::outdone:
      return "outdone";
    case Fate::another_name:
      return "another name";
    case Fate::withdrawn:
      return "withdrawn";
    case Fate::fitted_along:
      return "fitted along";
    case Fate::accepted:
      return "accepted";
  }
  return "";
}

void tell_fates(std::span<const AcceptedEffect> effects, std::span<const std::string> withdrawn,
                std::span<const std::string> along, std::vector<Ranked>& ranking) {
  const auto among = [](std::span<const std::string> ids, const std::string& id) {
    return std::find(ids.begin(), ids.end(), id) != ids.end();
  };
  for (Ranked& one : ranking) {
    if (among(withdrawn, one.id)) one.fate = Fate::withdrawn;
    if (among(along, one.id)) one.fate = Fate::fitted_along;
    for (const AcceptedEffect& effect : effects)
      for (const auto& [other, correlation] : effect.equivalent)
        if (other == one.id) one.fate = Fate::another_name;
    for (const AcceptedEffect& effect : effects)
      if (effect.id == one.id) one.fate = Fate::accepted;
  }
}

std::vector<std::string> leading_names(std::span<const AcceptedEffect> effects,
                                       std::span<const Ranked> ranking) {
  constexpr std::size_t kShown = 4;
  std::vector<std::string> out;
  const auto add = [&](const std::string& id) {
    if (out.size() < kShown && std::find(out.begin(), out.end(), id) == out.end()) out.push_back(id);
  };
  for (const AcceptedEffect& effect : effects) add(effect.id);
  for (const Ranked& ranked : ranking)
    if (ranked.visible) add(ranked.id);
  return out;
}

}  // namespace unhand::fitting
