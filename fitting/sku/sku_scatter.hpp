// Where the scatter of an SKU's landing comes from. Internal to fitting.
#pragma once

#include "fitting/sku/sku_motion.hpp"

namespace unhand::fitting {

/// What every input contributes to the landing's scatter, the largest share first; J = motion.slopes().
std::vector<BudgetLine> budget_of(const SkuMotion& motion, const Eigen::MatrixXd& J,
                                  const LandingTolerance& tolerance);

/// What every measurement would take off the scatter, the largest first.
std::vector<MeasurementGain> gains_of(const ThrowInputs& inputs, const Eigen::MatrixXd& J,
                                      const LandingTolerance& tolerance);

/// Draws of the inputs through the simulation and through J: fills the samples, the shares within the
/// tolerance, and whether the two agree.
void monte_carlo(const SkuMotion& motion, const Eigen::MatrixXd& J, const SkuRequest& request,
                 SkuValidation& out);

/// The scatter of the log's repetitions; nothing where fewer than three repeat a condition. After
/// monte_carlo(), whose draws it moves.
std::optional<MotionRepeats> repeats_of(const SkuRequest& request, const LoggedLandings& landings,
                                        const SkuValidation& answer);

}  // namespace unhand::fitting
