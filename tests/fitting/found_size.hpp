// What is asked of the size of an effect that a search has found.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace unhand::fitting::support {

/// The effect of that name; its first parameter, of every object, is within three of its own sigmas of the
/// truth (one campaign, whose seed is fixed), and as it was found, four sigmas do not reach its absence:
/// `neutral`.
template <class Found>
void expect_size(const Found& found, const std::string& id, double truth, double neutral = 0) {
  for (const auto& effect : found.effects) {
    if (effect.id != id) continue;
    ASSERT_FALSE(effect.parameters.empty()) << id;
    const auto stem = [](const std::string& name) { return name.substr(0, name.find('[')); };
    const std::string first = stem(effect.parameters.front().name);
    for (const auto& p : effect.parameters) {
      if (stem(p.name) != first) continue;
      EXPECT_NEAR(p.value, truth, 3 * p.sigma) << id << '.' << p.name;
      EXPECT_LT(p.sigma, 0.25 * std::abs(truth - neutral)) << id << '.' << p.name;
      EXPECT_GT(p.sigma, 0) << id << '.' << p.name;
    }
    return;
  }
  ADD_FAILURE() << id << " was not found";
}

}  // namespace unhand::fitting::support
