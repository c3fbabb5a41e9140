// What an accelerometer recorded of falls and before them, and which of its axes say something.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "datasets/throw_log.hpp"
#include "experiment/falling_sensor.hpp"

namespace unhand::fitting {

/// The last quiet stretch before a fall, and the speed gained from there on. `rest` is what the sensor reads
/// there, a bias included: the vertical, once the bias is taken off.
struct BeforeFall {
  flight::Vec3<double> rest{0, 0, 1};  ///< body axes [m/s²]
  bool quiet{};                        ///< there was such a stretch
  double speed{};                      ///< upward, as the fall begins [m/s]
  double speed_sigma{3};               ///< of that [m/s]
  double tilt_sigma{0.3};              ///< of the vertical's direction [rad]
};
/// Of the recording before the sample `first`; `gravity` [m/s²]. Without a quiet stretch in the last seconds
/// the vertical is that of the mean force.
BeforeFall before_fall(const datasets::ImuLog& imu, std::size_t first, double gravity);

/// The samples that a recording has of its fall.
struct FallReadings {
  std::optional<std::size_t> first;         ///< the first of them in the recording; none: no sample
  experiment::FallSamples samples;          ///< when, and what a gyroscope said
  std::vector<flight::Vec3<double>> force;  ///< specific force, body axes [m/s²]
};
/// Of a throw with `imu` and `free_flight`.
FallReadings readings_of(const datasets::Throw& one);

/// An axis of an object over all its recordings: between which values it reads, and on which grid.
struct ForceAxis {
  double low{}, high{};  ///< [m/s²]
  double step{};         ///< of the grid; 0 on none [m/s²]
  std::string fault;     ///< why it says nothing of most falls, or nothing
};
/// By object and axis (of the body, 0 to 2).
using ForceAxes = std::map<std::string, std::array<ForceAxis, 3>>;
/// Of the throws that have falls. What says nothing of most falls of an object is not asked in the others:
/// they are the exception.
ForceAxes force_axes(const datasets::ThrowLog& log);

/// Which axes of a fall are used.
struct AxisUse {
  std::vector<std::size_t> used;     ///< 0 to 2, those without a fault
  std::vector<std::size_t> coarse;   ///< of these: the noise is less than half a step of the grid
  flight::Vec3<double> sigma{};      ///< of a reading, what rounding adds included [m/s²]
  std::array<std::string, 3> fault;  ///< why an axis is not used
};
/// `declared`: sigma by axis, where it is known. Four readings or more.
AxisUse axis_use(const FallReadings& fall, const std::vector<double>& declared,
                 const std::array<ForceAxis, 3>& axes);

}  // namespace unhand::fitting
