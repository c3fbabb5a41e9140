#include "apps/elastic_trajectory.hpp"

#include <fmt/format.h>

#include <cstddef>

#include "planners/elastic/clutched_arm.hpp"

namespace unhand::apps {

namespace el = planners::elastic;

std::string trajectory_header(const std::string& of) {
  return of +
         ",time_s,mode,q1_rad,q2_rad,q3_rad,motor_rad,spring_end_rad,deflection_rad,qd1_rad_s,qd2_rad_s,"
         "qd3_rad_s,motor_rad_s,spring_end_rad_s,torque1_N_m,torque2_N_m,motor_torque_N_m,tip_x_m,tip_z_m,"
         "tip_vx_m_s,tip_vz_m_s\n";
}

std::string trajectory_rows(const std::string& name, const el::ClutchedArm& arm, const el::Replay& run) {
  constexpr double kApart = 1e-3 - 1e-9;  // [s]
  std::string out;
  const auto& all = run.samples;
  double last = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const el::ReplaySample& s = all[k];
    const bool end = k == 0 || k + 1 == all.size();
    const bool switches = (k > 0 && all[k - 1].mode != s.mode) || (!end && all[k + 1].mode != s.mode);
    if (!end && !switches && s.t - last < kApart) continue;
    last = s.t;
    const auto tip = el::tip_of<double>(arm, s.at.tail<3>(), s.rate.tail<3>());
    out += fmt::format("{},{:.6f},{}", name, s.t, el::to_string(s.mode));
    for (const double x :
         {s.at[2], s.at[3], s.at[4], s.at[0], s.at[1], s.at[0] - s.at[1], s.rate[2], s.rate[3], s.rate[4],
          s.rate[0], s.rate[1], s.torque[0], s.torque[1], s.torque[2], tip.x, tip.z, tip.vx, tip.vz})
      out += fmt::format(",{:.9g}", x);
    out += "\n";
  }
  return out;
}

}  // namespace unhand::apps
