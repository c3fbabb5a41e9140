// What every discovery reports, of throws and of measured logs: the candidates, accepted effects, residuals.
#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "apps/table.hpp"
#include "fitting/discovery/discover.hpp"

namespace unhand::apps {

Json ranking_json(std::span<const fitting::Ranked> ranking);

/// The candidates, best first: what each would take away, and what a refit showed.
Table ranking_table(std::span<const fitting::Ranked> ranking);

/// The fall of chi-square to first order as points, by the step of the search that they are of; those of the
/// accepted effects are filled.
Figure ranking_figure(std::span<const fitting::Ranked> ranking,
                      std::span<const fitting::AcceptedEffect> accepted);

/// By name: value, sigma, low95, high95 and unit.
Json parameters_json(const std::vector<fitting::Parameter>& parameters);
/// An accepted effect as `effects` of discovery.json lists it.
Json effect_json(const fitting::AcceptedEffect& effect);

/// The same in words: its other names, its parameters, and the evidence.
std::string effect_text(const fitting::AcceptedEffect& effect);

/// A line for each experiment that would tell it from another of its names, and one for each name that none
/// of those tried tells it from.
std::vector<std::string> separating_lines(const fitting::AcceptedEffect& effect);

/// Evident, and yet no part of the answer: too small, or not confirmed by the held-out throws.
std::string small_text(const fitting::SmallEffect& small);
/// One that was accepted at first, with the reason why it was withdrawn.
std::string withdrawn_text(const fitting::Imitation& one);

/// Which throws were held out where the log does not say; empty where it does.
std::string held_out_text(const fitting::Discovery& found);
/// Throws (flights, falls, slips) that were left out, with the reason: the first few. Empty where none were.
std::string skipped_text(const std::vector<std::pair<std::string, std::string>>& skipped);
/// "skipped" of discovery.json.
Json skipped_json(const std::vector<std::pair<std::string, std::string>>& skipped);

/// Where mass and inertia are off by the same ratio: that it may be a gain of the wrench. Else empty.
std::string gain_text(const std::vector<fitting::AcceptedEffect>& effects);
/// The filters that would explain accepted delays of the F/T sensor and the tracker as well; empty without
/// any.
std::string filter_text(const std::vector<fitting::AcceptedEffect>& effects);

/// What is unexplained, with what that means for the sizes of what was found.
std::string unexplained_text(std::span<const fitting::AcceptedEffect> effects,
                             const std::string& description);

/// An accepted effect as HTML, with what would separate it from its other names.
std::string effect_html(const fitting::AcceptedEffect& effect);

/// Styles of the base model's residuals and of the answer's.
inline constexpr const char *kBefore = "with linespoints pointtype 6 linecolor rgb '#d55e00'",
                            *kAfter = "with linespoints pointtype 7 linecolor rgb '#0072b2'";

/// Residuals of a channel in a bin of `x`, in sigma.
struct ResidualPoint {
  double x{}, rms{}, mean{};
  int samples{};
};

/// Points by channel, in order of appearance, under one name.
struct NamedCurves {
  std::string name;
  std::vector<std::pair<std::string, std::vector<ResidualPoint>>> channels;

  void add(const std::string& channel, const ResidualPoint& point);
  /// None of a channel that is not there.
  std::vector<ResidualPoint> of(const std::string& channel) const;
};

/// What candidates would do to the samples (all but the first of `curves`), beside what the base model leaves
/// of them (the first): rms over `x`, a panel for each channel of the base model's.
Figure footprint_figure(const std::vector<NamedCurves>& curves, const std::string& x);

/// What the figure shows.
inline constexpr const char* kFootprints =
    "What the leading candidates would do to the samples, each at the size that takes most off chi2 (to "
    "first "
    "order) and with all that is fitted anyway making up for what it can; grey: what the base model leaves. "
    "What is missing should look like that, in every channel.";

/// Where the axes of residuals begin [sigma], and a note in the upper right corner that says so.
inline constexpr double kResidualFloor = 0.1;
std::string floor_note(const Figure& figure);

/// Marks of a logarithmic axis of residuals from there to `top` that do not overlap, for gnuplot.
std::string residual_tics(double top);

/// Adds a channel's residuals before and after as data of the figure. Returns the largest rms, at least 2.
double add_residuals(Figure& figure, const std::string& channel, const std::string& x,
                     const std::vector<ResidualPoint>& before, const std::vector<ResidualPoint>& after);

}  // namespace unhand::apps
