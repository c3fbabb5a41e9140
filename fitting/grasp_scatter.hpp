// How repetitions differ in where the pads hold the object. Internal to fitting.
#pragma once

#include <string>
#include <vector>

#include "datasets/throw_log.hpp"
#include "experiment/prepared_throw.hpp"

namespace unhand::fitting {

/// Scatter of the pads' place across the object's x axis.
struct GraspScatter {
  double sigma{};     ///< between repetitions, beyond the sensor's noise [m]; 1 σ
  double p_value{1};  ///< that noise alone differs as much
  int throws{};       ///< with motion capture before the opening, in conditions that have another one
  /// Surely more than noise: every throw needs a place of its own then.
  bool is_evident() const { return p_value < 1e-6; }
  std::string in_words() const;
};

/// From what motion capture sees of the object in the hand before the gripper opens: the mean over a throw's
/// samples, about the mean of its object's condition. What is wrong with a clock, a frame or the hand repeats
/// with the condition, and is none of it. The noise of a mean is that of the samples about it, by object,
/// enlarged where neighbours correlate. `prepared` in the order of the log.
GraspScatter grasp_scatter_across(const datasets::ThrowLog& log,
                                  const std::vector<experiment::PreparedThrow>& prepared);

}  // namespace unhand::fitting
