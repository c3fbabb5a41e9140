// Tests over toy systems that run once with every method.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "tests/dynamics/toy_systems.hpp"

namespace unhand::dynamics {

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
