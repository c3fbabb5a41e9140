// Tests over toy systems that run once with every method.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "tests/dynamics/toy_systems.hpp"

namespace unhand::dynamics {

inline constexpr double kGravity = 9.81;  // m/s²

/// y = (height, velocity) under gravity, and the guard that is the height.
inline auto free_fall() {
  return [](int, const auto&, const auto& y, auto& dy) {
    dy[0] = y[1];
    dy[1] = decltype(y[1] + 0.0)(-kGravity);
  };
}
inline auto falling_floor() {
  return [](int, const auto&, const auto& y, auto* g) { g[0] = y[0]; };
}

/// What every test of an event's time asks: 1e-9 s, the accuracy the library promises. The global error of
/// the methods at tolerances of 1e-12 is 1e-11 to 1e-10 over these spans.
inline constexpr double kEventTime = 1e-9;

/// A state that never changes: guards of time alone.
inline auto still() {
  return [](int, const auto&, const auto&, auto& dy) { dy = {}; };
}

inline std::string name_of(Method method) {
  switch (method) {
    case Method::automatic:
      return "automatic";
    case Method::dormand_prince:
      return "dormand_prince";
    case Method::rosenbrock:
      return "rosenbrock";
    case Method::radau:
      return "radau";
    case Method::cvode:
      return "cvode";
  }
  return "unknown";
}

/// Tests of this kind run once with every method.
class EveryMethod : public testing::TestWithParam<Method> {
 protected:
  /// CVODE's events are found on its interpolant, which is as good as its tolerance: that sets these.
  static IntegratorOptions options() {
    IntegratorOptions options;
    options.method = GetParam();
    options.tolerances = {1e-12, 1e-13};
    return options;
  }
};

#define UNHAND_METHODS(Suite, ...)                                \
  INSTANTIATE_TEST_SUITE_P(, Suite, testing::Values(__VA_ARGS__), \
                           [](const auto& test) { return name_of(test.param); })
#define UNHAND_EVERY_METHOD(Suite)                                                                    \
  UNHAND_METHODS(Suite, Method::automatic, Method::dormand_prince, Method::rosenbrock, Method::radau, \
                 Method::cvode)
/// CVODE's stepper carries values only.
#define UNHAND_EVERY_METHOD_WITH_DERIVATIVES(Suite) \
  UNHAND_METHODS(Suite, Method::automatic, Method::dormand_prince, Method::rosenbrock, Method::radau)

}  // namespace unhand::dynamics
