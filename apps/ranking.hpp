// The candidates that a discovery tried, as JSON and as a figure: the same for throws and for measured logs.
#pragma once

#include <span>

#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "fitting/discover.hpp"

namespace unhand::apps {

Json ranking_json(std::span<const fitting::Ranked> ranking);

/// Bars of the fall of chi-square to first order; those of the accepted effects are blue.
Figure ranking_figure(std::span<const fitting::Ranked> ranking,
                      std::span<const fitting::AcceptedEffect> accepted);

/// An accepted effect as `effects` of discovery.json lists it.
Json effect_json(const fitting::AcceptedEffect& effect);

}  // namespace unhand::apps
