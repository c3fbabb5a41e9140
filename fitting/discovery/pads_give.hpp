// No pads are rigid: some micrometres that they give before they slip bend what slipping pads say of an
// effect, and what predictions lack. Such a give is fitted along, as a nuisance that is no part of the
// answer. Internal to fitting.
#pragma once

#include "fitting/discovery/discover.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// The give of the pads.
inline constexpr const char* kPads = "contact.pad_compliance";
/// The give of pads before they slip, under the grip's friction limit, from where on it is an effect like any
/// other [m].
inline constexpr double kMostGive = 3e-5;

/// The give of a fit's pads [m]; 0 where it has none.
double give_of(const Stage& stage);

/// Whether the stage's give is a nuisance: in its model, and none of its ids.
bool gives_along(const Stage& stage);

/// The effects of a model of this law that has a give along, if it can and the catalogue knows the give.
std::vector<std::string> with_give(const CampaignProblem& problem, const std::string& law,
                                   const DiscoverOptions& options);
/// Lets `start` (of the problem's unknowns, from the stage's fit) begin with a give of some micrometres.
void start_give(const Stage& stage, const CampaignProblem& problem, std::vector<double>& start);

/// Fits a give along, where BIC is for it and it stays below kMostGive; else the stage stays as it was. Not
/// before the first step where an effect that pads take no part in explains so much more of a misfit that the
/// give would imitate it (kImitation). One that is there already begins anew: fitted while something was
/// missing, it has taken up some of that, and need not find back.
void fit_give_along(Stage& stage, const DiscoverOptions& options);

/// A nuisance that has grown beyond what all pads do becomes an effect like any other, and an effect that is
/// no more than that a nuisance.
void settle_give(Stage& stage, const DiscoverOptions& options, Discovery& out);

/// In an answer without effects a give stays only if it matters to a channel of the held-out throws, or they
/// are predicted the better for it and are likelier; and never where it spoils their predictions: it then
/// stands for something else. Else it goes (true), and is left in `out.small`, if it does not matter and
/// nothing more evident is there.
bool drop_idle_give(Stage& stage, const DiscoverOptions& options, Discovery& out);

/// A give along that has vanished in later fits, beside what was added or taken away since, goes (true).
bool drop_vanished_give(Stage& stage, const DiscoverOptions& options);

}  // namespace unhand::fitting
