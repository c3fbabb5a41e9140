// An effect that a search has found, and what is asked of its size.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace unhand::fitting::support {

/// The effect of that name; null where it was not found.
template <class Found>
auto named(const Found& found, const std::string& id) {
  const auto at = std::find_if(found.effects.begin(), found.effects.end(),
                               [&](const auto& effect) { return effect.id == id; });
  return at == found.effects.end() ? nullptr : &*at;
}

/// It was found; its first parameter, of every object, is within three of its own sigmas of the truth (one
/// campaign, whose seed is fixed), and as it was found, four sigmas do not reach its absence: `neutral`.
template <class Found>
void expect_size(const Found& found, const std::string& id, double truth, double neutral = 0) {
  const auto* effect = named(found, id);
  ASSERT_NE(effect, nullptr) << id << " was not found";
  ASSERT_FALSE(effect->parameters.empty()) << id;
  const auto stem = [](const std::string& name) { return name.substr(0, name.find('[')); };
  const std::string first = stem(effect->parameters.front().name);
  for (const auto& p : effect->parameters) {
    if (stem(p.name) != first) continue;
    EXPECT_NEAR(p.value, truth, 3 * p.sigma) << id << '.' << p.name;
    EXPECT_LT(p.sigma, 0.25 * std::abs(truth - neutral)) << id << '.' << p.name;
    EXPECT_GT(p.sigma, 0) << id << '.' << p.name;
  }
}

}  // namespace unhand::fitting::support
