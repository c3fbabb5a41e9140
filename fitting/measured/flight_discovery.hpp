// Free flights as groups: the start of each is its own, effects are shared.
#pragma once

#include "experiment/flight_samples.hpp"
#include "experiment/free_flight.hpp"
#include "experiment/tracked_flight.hpp"
#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// Throws without a hand. Own unknowns: position and velocity of the CoM at the first sample, and where
/// orientation was tracked a rotation vector from its first fit and ω in the body. Channels position_x … and
/// rotation_x … (body axes). A planar flight is one in the plane y = 0 that turns about −y: it has the
/// unknowns, channels and effects' parameters of that plane alone (theta is the angle, with its sign).
/// Whitened with the declared sigma, or with the scatter from sample to sample where there is none. A log
/// without a test split holds every fifth throw out (splits_of).
class FlightProblem final : public GroupedProblem {
 public:
  /// Throws datasets::LogError for a log that breaks the rules of its kind, std::invalid_argument when no
  /// throw is a free flight.
  FlightProblem(const datasets::ThrowLog& log, int threads);
  std::vector<dynamics::Effect> effects() const override;
  GroupEquations equations(std::size_t group, std::span<const std::string> names,
                           std::span<const double> values, const Eigen::VectorXd& own,
                           Derivatives derivatives) const override;
  GroupMotion motion(std::size_t group, std::span<const std::string> names, std::span<const double> values,
                     const Eigen::VectorXd& own) const override;
  Eigen::VectorXd response(std::size_t group,
                           const std::vector<flight::Vec3<double>>& acceleration) const override;

  /// 1 σ of a row's channel, in m or rad.
  double sigma(std::size_t group, int channel) const;
  /// Whether the flight's orientation was tracked.
  bool oriented(std::size_t group) const { return !flights_[group].samples.attitude.empty(); }
  /// Measured axes, the first channels; those of the rotation follow.
  int position_channels() const { return static_cast<int>(axes_.size()); }
  /// Frames that were taken out as the tracker's glitches (experiment::remove_glitches).
  std::size_t glitches() const { return glitches_; }

 private:
  struct Flight {
    experiment::FlightSamples samples;
    flight::Quaternion<double> reference;
    flight::Vec3<double> inertia{1, 1, 1};
    double drag_k{};
  };
  /// Makes a group of a throw whose start is known, or says why it is none. `usual`: how the flights of its
  /// object scatter.
  std::string add(const datasets::ThrowLog& log, const datasets::Throw& one, datasets::Split split,
                  const experiment::FreeFlightFit& fit, const experiment::FlightScatter& usual);
  /// The flight that starts as its own unknowns `x` say.
  template <class S>
  experiment::TrackedFlight<S> started(const Flight& flight, const std::vector<S>& x) const;
  std::vector<Flight> flights_;
  double gravity_{};
  std::size_t glitches_{};
  std::vector<std::size_t> axes_, turns_;  ///< of the world and of the body, that a flight has
  double turn_sign_{1};                    ///< of the angle about turns_: a planar one is about −y
};

/// Errors of the flights of a split: `fit` holds the shared parameters and the own unknowns of whole flights;
/// predictions at the end have the start fitted to the first half of the samples. NaN: not measured.
struct FlightErrors {
  int n{};                                                 ///< flights
  double trajectory_rms{};                                 ///< [m]
  double end_position_mae{}, end_position_median{};        ///< [m]
  double end_orientation_mae{}, end_orientation_median{};  ///< [deg]
  double chi2_per_dof{};                                   ///< 1 is the noise
};
/// The errors over the flights that `fit` used.
FlightErrors flight_errors(const FlightProblem& problem, const GroupedFit& fit, int threads);

}  // namespace unhand::fitting
