// The best of every engine on every motion, and what unhand makes of it at equal time and at equal error.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/peers/truths.hpp"

namespace unhand::bench {

constexpr double kExact = 1e-13;  ///< m: errors below this are equal, the answer is exact

inline const std::vector<std::string> kMotions{"slide", "spin", "stick", "stick-slip", "release", "bounce"};

struct Verdict {
  Work best;                      ///< the other engine's most accurate run; of equal ones the fastest
  int settings{}, met{};          ///< its runs on that motion, and those against which the goal is met
  std::optional<Work> in_time;    ///< unhand's most accurate run that takes no longer
  std::optional<Work> for_error;  ///< unhand's fastest run that errs no more

  bool both_exact() const { return in_time && best.error <= kExact && in_time->error <= kExact; }
  double more_accurate() const;  ///< error over unhand's, both at least kExact; 0 without a run in that time
  double faster() const;         ///< time over unhand's; 0 without a run of that error
  bool goal() const { return more_accurate() >= 100 || faster() >= 10; }  ///< against the best
  std::string accuracy_words() const;
  std::string speed_words() const;
};

/// Every engine that is installed.
std::vector<Work> run_all();

std::vector<Verdict> verdicts(const std::vector<Work>& all);

}  // namespace unhand::bench
