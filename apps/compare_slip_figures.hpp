// The figures of `unhand compare` on slip logs.
#pragma once

#include <vector>

#include "apps/figure.hpp"
#include "fitting/slips/compare_surfaces.hpp"

namespace unhand::apps {

/// One surface: sections of the fitted limit surfaces through (f_x, f_y) and (f_x, τ/L), with the wrenches
/// that lie within 20° of the section and where the object slid under them. Its files are section_`name`.
Figure section_figure(const fitting::SlipSamples& slips, const std::vector<fitting::SurfaceScore>& scores,
                      const std::string& name);

/// Cross-validated errors beside those of the null control, one line per surface.
Figure surface_error_figure(const std::vector<fitting::SlipSamples>& surfaces,
                            const std::vector<std::vector<fitting::SurfaceScore>>& scores);

}  // namespace unhand::apps
