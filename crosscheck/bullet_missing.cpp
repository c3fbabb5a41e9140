// In place of bullet_release.cpp where Bullet is not installed.
#include <stdexcept>

#include "crosscheck/bullet_release.hpp"

namespace unhand::crosscheck {

const char* to_string(BulletPads) { return "none"; }

const char* to_string(BulletFriction) { return "none"; }

bool has_bullet() { return false; }

BulletResult simulate_in_bullet(const release::ReleaseProblem<double>&, const contact::Patch<double>&,
                                const BulletOptions&) {
  throw std::runtime_error("built without Bullet (Debian package libbullet-dev)");
}

}  // namespace unhand::crosscheck
