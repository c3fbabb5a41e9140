// Numbers that others reported for their own hardware: to set beside a result, never to stand in for one.
#pragma once

#include <string_view>

namespace unhand::datasets {

/// Mean absolute error and the standard deviation of the absolute error.
struct ReportedError {
  double mae, std;  ///< in the unit that the quantity's name ends with
};

/// One model's errors over a campaign, as reported.
struct ReportedModel {
  std::string_view model, label;  ///< name in this library; name in tables
  ReportedError detach_vx_m_s, detach_omega_deg_s, landing_x_m, landing_theta_deg;  ///< by quantity
};

/// A table of errors that others report of their hardware.
struct ReportedTable {
  std::string_view title, source, campaign;  ///< of the table; where it is printed; what was thrown
  int throws;                                ///< in the campaign
  ReportedModel models[2];                   ///< as reported
};

/// The limit surface as it was integrated there, and the sliding pivot.
inline constexpr ReportedTable release_models_as_reported{
    "Release models, as reported",
    "D4.6, Table 7",
    "2 CoM offsets x 3 pitch angles x 6 release accelerations x 5 repetitions; the raw logs are not public",
    180,
    {{"limit_surface", "LS, as reported", {0.192, 0.159}, {112.30, 101.72}, {0.110, 0.105}, {62.47, 57.74}},
     {"sliding_pivot", "SP, as reported", {0.045, 0.030}, {22.13, 20.27}, {0.026, 0.020}, {14.77, 12.34}}}};

/// The later conference version gives the sliding pivot's landing errors alone.
struct ReportedLanding {
  std::string_view label, source;         ///< name in tables; where it is printed
  double landing_x_m, landing_theta_deg;  ///< mean absolute errors
};
/// Mean absolute errors as reported, in m and degrees.
inline constexpr ReportedLanding sliding_pivot_as_reported_later{
    "SP, as reported", "the conference version, ICRA 2026", 0.024, 15.4};

}  // namespace unhand::datasets
