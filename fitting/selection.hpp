// Which effects a model lacks: forward steps, a backward check, and other names of what was accepted.
// Internal to fitting.
#pragma once

#include <optional>

#include "fitting/stage.hpp"

namespace unhand::fitting {

/// One step forward: the candidate that explains most, if it convinces. Writes its scores into `out.ranking`
/// and what it accepted into `out.effects`, with the names of other effects that convince as well and whose
/// evidence is not less by what an effect needs to be accepted (ten of the criterion). Empty if none
/// convinces.
std::optional<Stage> forward(const Stage& stage, const DiscoverOptions& options, Discovery& out);

/// Effects that a later one has made superfluous are taken back.
void backward(Stage& stage, const DiscoverOptions& options, Discovery& out);

/// An effect that still leaves a tenth of the base model's misfit (a third of its size) where it was said to
/// act is an imitation of something that is not in the catalogue: it is withdrawn, and named in
/// `out.imitations`.
void withdraw(Stage& stage, const DiscoverOptions& options, Discovery& out);

/// No pads are rigid: a give of some micrometres before they slip bends what the slipping pads say of an
/// effect on them, long before any prediction would be the better for knowing it. Where an effect on the
/// contact or the release was accepted, contact.pad_compliance is fitted along if the evidence (BIC) is for
/// it; then it is a nuisance of the answer, not a part of it. True if it is.
bool fit_along(Stage& stage, const DiscoverOptions& options);

/// Values, significance and other names of what was accepted. The intervals of the fit count its misfit from
/// here on (count_discrepancy).
void describe(Stage& stage, const DiscoverOptions& options, Discovery& out);

}  // namespace unhand::fitting
