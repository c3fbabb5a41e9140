// The JSON, the text and the page of unhand discover on measured logs.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "fitting/slips/surface_discovery.hpp"

namespace unhand::apps {

/// A result with what stands beside it.
struct MeasuredResult {
  fitting::MeasuredDiscovery answer;
  std::vector<fitting::SurfaceEvidence> surfaces;  ///< slips only
  std::string log, command;
  std::string origin;  ///< as the log declares it
};

/// discovery.json, schema "discovery" version 1.
Json measured_json(const MeasuredResult& result);
/// NamedErrors for people: a key of the JSON ends with its unit, as _m or _deg; lengths are shown in mm.
/// "trajectory rms [mm]" of trajectory_rms_m.
std::string error_title(const std::string& key);
/// The value to go with that title; "-" where it was not measured.
std::string error_text(const std::string& key, double value);
std::string measured_text(const MeasuredResult& result);
/// Residuals over the share of the duration, a panel for each channel: of the base model and of an answer,
/// with what the key calls them.
Figure measured_residual_figure(const std::vector<fitting::ResidualProfile>& base,
                                const std::vector<fitting::ResidualProfile>& answer,
                                const std::string& base_name, const std::string& answer_name);
/// What candidates would do to the samples, over the same share.
Figure measured_footprints(const fitting::MeasuredDiscovery& found);
/// The acceleration that is missing, with 2 σ: a panel for each component.
Figure missing_acceleration_figure(const fitting::MissingAcceleration& missing);
/// Held-out direction errors by surface, and those of the null control.
Figure surface_figure(const MeasuredResult& result);
/// A self-contained page (index.html), the figures with their data and scripts, and discovery.json.
void write_measured_report(const MeasuredResult& result, const Json& json,
                           const std::filesystem::path& directory);

}  // namespace unhand::apps
