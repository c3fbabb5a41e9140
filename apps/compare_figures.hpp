// The figures of `unhand compare` on releases.
#pragma once

#include <optional>

#include "apps/figure.hpp"
#include "experiment/compare.hpp"

namespace unhand::apps {

/// Landing errors, x against theta, one marker and colour per model, of the test throws where there are any.
/// Where models differ much, a second panel shows the better ones. Nothing if no throw has an error.
std::optional<Figure> landing_figure(const experiment::Comparison& comparison);

/// Mean absolute landing errors, one line per condition.
std::optional<Figure> condition_figure(const experiment::Comparison& comparison);

}  // namespace unhand::apps
