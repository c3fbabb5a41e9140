// A release in the Bullet physics engine, in double precision: another code, another method.
#pragma once

#include "contact/patch.hpp"
#include "release/simulate_release.hpp"

namespace unhand::crosscheck {

/// How the two pads touch the object.
enum class BulletPads {
  pins,      ///< 3 n² pins per pad, each pressed with its share: force and torque couple by themselves
  point,     ///< one point per pad with Bullet's spinning friction, μ c a: two limits that do not know each
             ///< other
  cylinder,  ///< the face of a cylinder of radius a: up to four points, which Bullet chooses
};
const char* to_string(BulletPads);

/// Bullet's friction rows at a contact; each is limited by μ times the normal impulse on its own.
enum class BulletFriction {
  along,   ///< one, along the slip: Bullet's default
  across,  ///< and one across it
  fixed,   ///< two, fixed in the world: an often used setting
};
const char* to_string(BulletFriction);

struct BulletOptions {
  double step{1e-4};  ///< [s], (0, 1e-2]
  BulletPads pads{BulletPads::pins};
  int rings{3};         ///< n of the pins, [1, 10]
  int iterations{200};  ///< of the sequential impulses, per step
  BulletFriction friction{BulletFriction::along};
};

struct BulletResult {
  release::ReleaseOutcome outcome{};
  release::DetachState<double> detach;  ///< at the end of the hand's motion, if the pads never part
  contact::Relative<double> relative;   ///< the object against the hand then
  int steps{};
};

/// False where the library was built without Bullet (Debian: libbullet-dev).
bool has_bullet();

/// Pads follow the hand's poses exactly and are pressed with the normal force; the object, a plate kept in
/// the plane, is between them and moves under friction and gravity alone. Semi-implicit Euler steps,
/// sequential impulses.
///
/// The contact model of `problem` is not used. Throws std::invalid_argument for options out of range,
/// std::runtime_error where there is no Bullet.
BulletResult simulate_in_bullet(const release::ReleaseProblem<double>& problem,
                                const contact::Patch<double>& patch, const BulletOptions& options = {});

}  // namespace unhand::crosscheck
