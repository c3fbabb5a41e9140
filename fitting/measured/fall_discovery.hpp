// Accelerometers in free fall as groups: the speed at the start of each fall is its own, effects are shared.
#pragma once

#include "fitting/measured/fall_readings.hpp"
#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// Throws with `imu` and `free_flight`, dimension 3, under experiment::falling_readings.
///
/// Own unknowns of a fall: the speed at its first sample, a turn of the vertical (in body axes) against where
/// it stood at rest before, and its turning rate; each known beforehand to what the recording before the fall
/// says of it. (The vertical is what the sensor reads at rest without its bias.) The turning rate is what a
/// gyroscope has not seen; without one, the terms of a lever arm are zero.
///
/// The noise of an axis is the declared one or that of its third differences, and not below what rounding to
/// the grid of its readings adds. An axis that says nothing of a fall, as it stands still or is cut off, is
/// left out of it.
///
/// Beside a fit, every fall has a zero of its own: biases wander from recording to recording, and a steady
/// turn about an axis off the sensor adds a constant as well. What readings differ by from fall to fall where
/// the object does not move, at the start of a fall or at the apex, is then noise that all samples of an axis
/// share, and their mean counts by so much less. (What a lever arm that was found makes of the turns that a
/// gyroscope saw is taken off first: it differs from fall to fall, too, and is no zero.)
class FallProblem final : public GroupedProblem {
 public:
  /// What the sensor reads of no force is the same in all recordings. Throws datasets::LogError for a log
  /// that breaks the rules of its kind, std::invalid_argument when no throw can be used.
  explicit FallProblem(const datasets::ThrowLog& log);
  /// It differs from recording to recording, beside what `fit` found.
  FallProblem(const datasets::ThrowLog& log, const GroupedFit& fit);
  std::vector<dynamics::Effect> effects() const override;
  GroupEquations equations(std::size_t group, std::span<const std::string> names,
                           std::span<const double> values, const Eigen::VectorXd& own,
                           Derivatives derivatives) const override;
  GroupMotion motion(std::size_t group, std::span<const std::string> names, std::span<const double> values,
                     const Eigen::VectorXd& own) const override;
  Eigen::VectorXd response(std::size_t group,
                           const std::vector<flight::Vec3<double>>& acceleration) const override;
  const flight::Vec3<double>& sigma(std::size_t group) const { return falls_[group].sigma; }  ///< [m/s²]
  /// What the sensor read before a fall.
  const BeforeFall& before(std::size_t group) const { return falls_[group].before; }
  /// (measured − predicted) of the rows that are measurements, from their residuals [m/s²].
  Eigen::VectorXd left_of(std::size_t group, const Eigen::VectorXd& residual) const;
  /// The axes that a fall's rows are of, in their order at every sample.
  const std::vector<std::size_t>& axes(std::size_t group) const { return falls_[group].axes; }
  /// Whether a gyroscope was read in every fall.
  bool has_gyroscope() const;
  /// What the readings are like: axes that were left out, and coarse ones.
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  struct Fall {
    FallReadings readings;
    BeforeFall before;
    std::vector<std::size_t> axes;       // that are used
    flight::Vec3<double> sigma{};        // of a reading [m/s²]
    flight::Vec3<double> mean{1, 1, 1};  // what is left of the mean of an axis' rows
  };
  struct AxisCounts;
  /// Makes a group of a throw, or says why it is none.
  std::string add(const datasets::Throw& one, datasets::Split split, const ForceAxes& axes,
                  AxisCounts& counts);
  /// The samples of a fall, less what the sensor would read of the turns that a gyroscope saw.
  std::vector<flight::Vec3<double>> without_turns(std::size_t group,
                                                  const dynamics::Values<double>& given) const;
  /// `names` and `values` as of `equations`.
  void free_zeros(std::span<const std::string> names, std::span<const double> values);
  /// The fall that starts as its own unknowns `x` say, with a sensor that errs as `given` says.
  template <class S>
  experiment::FallStart<S> started(const Fall& fall, const dynamics::Values<S>& given,
                                   const std::vector<S>& x) const;
  /// Rows of readings, axis by axis at every sample, without what their mean does not count for.
  template <class S>
  static void discount_means(const Fall& fall, std::vector<S>& rows);
  std::vector<Fall> falls_;
  std::vector<std::string> notes_;
  double gravity_{};
};

/// Errors over the falls of a split: what is left of the reading, and where one is after integrating it.
struct FallErrors {
  int n{};                      ///< falls
  double specific_force_rms{};  ///< of the vector [m/s²]
  double end_speed_mae{};       ///< |∫ residual dt| at the end of the fall [m/s]
  double end_position_mae{};    ///< |∬ residual dt²| [m]
  double chi2_per_dof{};        ///< 1 is the noise
};
/// The errors over the falls that `fit` used.
FallErrors fall_errors(const FallProblem& problem, const GroupedFit& fit);

}  // namespace unhand::fitting
