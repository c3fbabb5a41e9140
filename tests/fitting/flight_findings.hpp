// What the loop finds in synthetic free flights in space, and what is asked of it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "fitting/measured/flight_discovery.hpp"
#include "fitting/measured/measured_discovery.hpp"

namespace unhand::fitting::support {

/// The loop with its usual options, but without the effects of the catalogue that it is to forget.
inline MeasuredDiscovery found_in_flights(const datasets::ThrowLog& log,
                                          std::vector<std::string> forget = {}) {
  MeasuredOptions options;
  options.search.forget = std::move(forget);
  return discover_flights(log, options);
}

/// The accepted effect that has that name, or has it among its other names; null where none does.
inline const AcceptedEffect* under_any_name(const MeasuredDiscovery& found, const std::string& id) {
  for (const auto& e : found.effects) {
    if (e.id == id) return &e;
    for (const auto& [other, correlation] : e.equivalent)
      if (other == id) return &e;
  }
  return nullptr;
}

/// The parameter of an effect that was found, within four of its own sigmas: one in 16,000 is farther off.
inline void expect_value(const MeasuredDiscovery& found, const std::string& id, const std::string& name,
                         double truth) {
  const AcceptedEffect* effect = under_any_name(found, id);
  ASSERT_NE(effect, nullptr) << id << " was not found";
  const auto p = std::find_if(effect->parameters.begin(), effect->parameters.end(),
                              [&](const Parameter& q) { return q.name == name; });
  ASSERT_NE(p, effect->parameters.end()) << effect->id << " has no " << name;
  EXPECT_NEAR(p->value, truth, 4 * p->sigma) << effect->id << '.' << name;
  const double neutral = name == "scale" || name.starts_with("ratio") ? 1 : 0;
  EXPECT_LT(p->sigma, 0.5 * std::max(std::abs(truth - neutral), 1e-3))
      << "it was found, so its interval excludes its absence";
}

}  // namespace unhand::fitting::support
