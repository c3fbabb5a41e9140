// In place of siconos.cpp where Siconos is not installed.
#include "bench/peers/truths.hpp"

namespace unhand::bench {
std::vector<Work> run_siconos() { return {}; }
}  // namespace unhand::bench
