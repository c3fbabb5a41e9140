// Which effects a model lacks: forward steps, a backward check, and other names of what was accepted.
// Internal to fitting.
#pragma once

#include <optional>

#include "fitting/discovery/discover.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// One step forward: the candidate that explains most, if it convinces. Writes its scores into `out.ranking`
/// and what it accepted into `out.effects`, with the names of other effects that convince as well and whose
/// evidence is not less by what an effect needs to be accepted (ten of the criterion). Convincing is evidence
/// on the train throws, and on held-out ones an improvement that matters: to a channel (Improvement), or,
/// where no candidate's does, to the predictions made before the throw (PredictionGain). The most evident one
/// that matters to neither is left in `out.small`. Empty if none convinces.
std::optional<Stage> forward(const Stage& stage, const DiscoverOptions& options, Discovery& out);

/// Effects that a later one, or the pads' give, has made superfluous are taken back.
void backward(Stage& stage, const DiscoverOptions& options, Discovery& out);

/// Withdraws imitations of something that is not in the catalogue, and names them in `out.imitations`: an
/// effect whose size is not told from none by its own interval, which counts by how much conditions and
/// blocks of sensors disagree on it (count_discrepancy); and one that leaves a tenth of the base model's
/// misfit (a third of its size) in the half of the throw where it was said to act, the wrenches included, on
/// train or on held-out throws, if the base model's fit left something there in both. What was accepted after
/// it in that half goes with it: it was judged in its company. Returns the stage's fit
/// with intervals that count its misfit.
FitResult withdraw(Stage& stage, const DiscoverOptions& options, Discovery& out);

/// What speaks for every accepted effect in the end: the answer with it against the answer without it.
void judge(const Stage& stage, const DiscoverOptions& options, Discovery& out);

/// Values, significance and other names of what was accepted. From here on the fit of the stage is `counted`,
/// what withdraw returned.
void describe(Stage& stage, FitResult counted, const DiscoverOptions& options, Discovery& out);

}  // namespace unhand::fitting
