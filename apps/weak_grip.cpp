#include "apps/weak_grip.hpp"

#include <fmt/ranges.h>

#include <algorithm>

#include "apps/tell.hpp"

namespace unhand::apps {

int slips_at_start(const experiment::ModelComparison& model) {
  return static_cast<int>(std::count_if(model.throws.begin(), model.throws.end(),
                                        [](const auto& one) { return one.prediction.slips_at_start; }));
}

void tell_weak_grip(const experiment::ModelComparison& model) {
  const int n = slips_at_start(model);
  if (n == 0) return;
  std::vector<std::string> conditions;
  for (const auto& condition : experiment::conditions_of(model.throws))
    if (std::any_of(model.throws.begin(), model.throws.end(), [&](const auto& one) {
          return one.prediction.slips_at_start && one.object == condition.object &&
                 one.condition == condition.condition;
        }))
      conditions.push_back(condition.label);
  constexpr std::size_t kNamed = 5;
  const std::size_t named = std::min(conditions.size(), kNamed);
  tell(
      "unhand: {}: in {} of {} throws the grip cannot hold the object, which slips from the start; {} {}{}\n",
      model.model, n, model.throws.size(), conditions.size() == 1 ? "condition" : "conditions",
      fmt::join(conditions.begin(), conditions.begin() + named, "; "),
      named < conditions.size() ? fmt::format(" and {} more", conditions.size() - named) : "");
}

}  // namespace unhand::apps
