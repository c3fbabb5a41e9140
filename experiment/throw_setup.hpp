// A throw with the effects on it: what predictions and synthetic campaigns share, so that an effect is the
// same physics in both.
#pragma once

#include <memory>
#include <vector>

#include "contact/friction_effects.hpp"
#include "dynamics/effect.hpp"
#include "dynamics/gravity_effects.hpp"
#include "experiment/sensing.hpp"
#include "flight/effects.hpp"
#include "flight/fly.hpp"
#include "release/effects.hpp"
#include "release/simulate_release.hpp"

namespace unhand::experiment {

/// The effects of all folders, in the order of their ids' first words.
std::vector<dynamics::Effect> known_effects();

/// Everything that effects may change, each folder's part in its own struct.
template <class S>
struct ThrowSetup {
  contact::FrictionVariation<S> friction;  ///< contact.*
  release::Lateness<S> late;               ///< release.*
  dynamics::Gravity<S> gravity;            ///< flight.gravity_tilt
  flight::Air<S> air;                      ///< flight.*, of the air
  Sensing<S> sensing;                      ///< sensor.*

  /// Reads the values of all effects that `values` names; the others stay neutral.
  explicit ThrowSetup(const dynamics::Values<S>& values);
};

/// The normal force that the object feels: a base with the effects on it wrapped around, innermost first.
template <class S>
class FeltForce {
 public:
  /// `base` must outlive it.
  explicit FeltForce(const contact::NormalForce& base) : force_(&base) {}
  explicit FeltForce(std::unique_ptr<contact::NormalForce> base) { wrap(std::move(base)); }

  /// Moves the release of a measured ramp by `deviation` standard deviations, if its smoothing knows them.
  void doubt(const contact::NormalForceSummary& ramp, const S& deviation);
  /// Takes the sensor's errors off a measured force: its bias, its opening starting at the stamp
  /// `opening_start` [s], then its clock's.
  void correct(const ThrowSetup<S>& setup, double opening_start);
  /// What comes between sensor and object: release.opening_delay, then contact.adhesion.
  void act(const ThrowSetup<S>& setup);

  /// The force with all that was wrapped around it.
  const contact::NormalForce& operator*() const { return *force_; }

 private:
  void wrap(std::unique_ptr<contact::NormalForce> outer);
  const contact::NormalForce* force_{};
  std::vector<std::unique_ptr<contact::NormalForce>> owned_;
};

/// The flight from a detach, under `gravity` [m/s²], with the declared drag [1/m]; tracked is the declared
/// CoM.
template <class S>
flight::FlightProblem<S> flight_from(const release::DetachState<S>& detach, const dynamics::Vec2<S>& gravity,
                                     double declared_drag, double landing_height, const ThrowSetup<S>& setup);

/// What the sensors report of one simulated throw, without their noise. The references must outlive it.
template <class S>
class ThrowReader {
 public:
  /// `pads` share the wrench on the object evenly.
  ThrowReader(const release::ReleaseProblem<S>& problem, const release::ReleaseResult<S>& result,
              const flight::FlightProblem<S>& flight, const ThrowSetup<S>& setup, int pads);

  /// Integrates the flight up to `longest` [s] after the detach, where the air matters: before mocap().
  void fly(double longest, const dynamics::IntegratorOptions& options);

  /// Of the sensor behind one pad at its stamp [s], on the object, in the hand frame, about the pad centre.
  dynamics::Wrench<S> wrench(double stamp) const;
  /// The tracked frame as the tracker reports it at its stamp [s], in the world.
  dynamics::Pose<S> mocap(double stamp) const;
  /// x of the landing as reported [m], from the true one.
  S landing_x(const S& x) const;

 private:
  double first() const;
  dynamics::Pose<S> com(const S& t) const;
  dynamics::Pose<S> flying(const S& since) const;

  const release::ReleaseProblem<S>& problem_;
  const release::ReleaseResult<S>& result_;
  const flight::FlightProblem<S>& flight_;
  const ThrowSetup<S>& setup_;
  int pads_;
  flight::RecordedFlight<S> flown_;
  bool in_air_{};
};

}  // namespace unhand::experiment
