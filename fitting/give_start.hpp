// Where the fit of pads that give begins. Internal to fitting.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "fitting/fit.hpp"

namespace unhand::fitting {

/// How far pads give at the friction limit of all of them, per unit of contact.pad_compliance [N]; `values`
/// are of the problem's unknowns.
double give_per_compliance(const CampaignProblem& problem, std::span<const double> values);

/// Pads that ring after a jump of the hand's acceleration have a minimum at every give whose pitch is off by
/// a beat; damped ones have one. Of such gives and loss times beside the other `values`, those at which some
/// of the throws of `fitted` are likeliest while their own unknowns alone follow; none if `values` are. The
/// problem has the give among its effects.
std::optional<std::vector<double>> likelier_give(const CampaignProblem& problem,
                                                 const std::vector<double>& values,
                                                 std::span<const ThrowFit> fitted, const FitOptions& options);

}  // namespace unhand::fitting
