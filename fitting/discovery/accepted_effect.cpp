#include "fitting/discovery/accepted_effect.hpp"

#include <algorithm>

namespace unhand::fitting {

void AcceptedEffect::add_other_name(const std::string& other, double correlation) {
  for (auto& [name, known] : equivalent)
    if (name == other) {
      known = std::max(known, correlation);
      return;
    }
  equivalent.push_back({other, correlation});
}

}  // namespace unhand::fitting
