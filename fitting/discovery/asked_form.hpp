// Whether tracked flights ask for another form of acceleration than the effects that were accepted. Internal
// to fitting.
#pragma once

#include "fitting/discovery/discover.hpp"
#include "fitting/discovery/stage.hpp"

namespace unhand::fitting {

/// What accepted effects may leave of the misfit in tracked flights to count as its explanation, and a form
/// of what they leave.
inline constexpr double kOutdone = 0.5;

/// What tracked flights ask for that accepted effects of the air do not give them. The laws of flight and of
/// sensors are exact, so that a form that describes the flights better means that something unlisted acts:
/// beside them, or in their place. Asked where the effects explain most of the acceleration that flights lack
/// without them, and the terms do. They are outdone where a few terms (missing_terms, one candidate an
/// object), fitted to the train throws in their place, win by Bayes' criterion there (kDeltaBic), and make
/// the held-out flights kTimesAsLikely as likely; where the effects leave a misfit, if less than kOutdone of
/// it is left in both halves, too. An effect whose own form is among those terms is not outdone but backed,
/// also where effects explain little of the flights. Without words: nothing else is asked for.
///
/// Nothing at all outdoes effects that leave a misfit in flights which lack less, by the same measures (but
/// without credit for unknowns), if all effects whose form is an acceleration are taken away, those of
/// sensors that were seen in the hand included.
AskedForm form_asked_for(const Stage& stage, const Discovery& so_far, const DiscoverOptions& options);

}  // namespace unhand::fitting
