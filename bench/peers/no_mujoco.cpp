// In place of mujoco.cpp where MuJoCo is not installed.
#include "bench/peers/truths.hpp"

namespace unhand::bench {
std::vector<Work> run_mujoco() { return {}; }
}  // namespace unhand::bench
