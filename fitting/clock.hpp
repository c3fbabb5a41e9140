// How long something takes. Internal to fitting.
#pragma once

#include <chrono>

namespace unhand::fitting {

using Clock = std::chrono::steady_clock;
inline double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

}  // namespace unhand::fitting
