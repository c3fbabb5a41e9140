// What rows and groups of a grouped fit count for. Internal to fitting.
#pragma once

#include "fitting/measured/grouped_fit.hpp"

namespace unhand::fitting {

/// Σ of Huber's loss over the rows: quadratic up to `limit` times the scatter of the row's channel.
double cost_of(const Eigen::VectorXd& residual, const Group& group, const GroupedWeights& weights,
               double limit);

/// Whether every row lies where the loss is quadratic.
bool is_quadratic(const Eigen::VectorXd& residual, const Group& group, const GroupedWeights& weights,
                  double limit);

/// Huber's factors on rows, on their residuals and their derivatives.
void weigh_rows(GroupEquations& equations, const Group& group, const GroupedWeights& weights, double limit);

/// Every group counts fully, every row quadratically.
GroupedWeights neutral_weights(const GroupedProblem& problem);

/// Scatter of every channel (from the median of |residual|), less weight for groups whose χ² per sample is
/// beyond options.group_limit medians, and what is known beforehand by the inflation of the samples'
/// variance: scatter² (1 + ρ)/(1 − ρ), ρ the correlation of neighbours, in the mean over the channels.
GroupedWeights learned_weights(const GroupedProblem& problem, const GroupedFit& fit,
                               const GroupedFitOptions& options);

}  // namespace unhand::fitting
