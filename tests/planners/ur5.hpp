// The UR5 as its maker publishes it.
#pragma once

namespace unhand::planners {

/// Denavit-Hartenberg parameters [UniversalRobotsDH], as modified ones; ranges, speeds and torques of the
/// data sheet. Masses are left out; limits of acceleration and jerk, which are not published, are chosen.
constexpr const char* kUr5 = R"(name = "UR5"
[[joint]]
name = "base"
d_m = 0.089159
lower_rad = -6.2832
upper_rad = 6.2832
velocity_rad_s = 3.1416
acceleration_rad_s2 = 15
jerk_rad_s3 = 5000
torque_n_m = 150
[[joint]]
name = "shoulder"
alpha_deg = 90
lower_rad = -6.2832
upper_rad = 6.2832
velocity_rad_s = 3.1416
acceleration_rad_s2 = 15
jerk_rad_s3 = 5000
torque_n_m = 150
[[joint]]
name = "elbow"
a_m = -0.425
lower_rad = -6.2832
upper_rad = 6.2832
velocity_rad_s = 3.1416
acceleration_rad_s2 = 15
jerk_rad_s3 = 5000
torque_n_m = 150
[[joint]]
name = "wrist_1"
a_m = -0.39225
d_m = 0.10915
lower_rad = -6.2832
upper_rad = 6.2832
velocity_rad_s = 3.1416
acceleration_rad_s2 = 15
jerk_rad_s3 = 5000
torque_n_m = 28
[[joint]]
name = "wrist_2"
alpha_deg = 90
d_m = 0.09465
lower_rad = -6.2832
upper_rad = 6.2832
velocity_rad_s = 3.1416
acceleration_rad_s2 = 15
jerk_rad_s3 = 5000
torque_n_m = 28
[[joint]]
name = "wrist_3"
alpha_deg = -90
d_m = 0.0823
lower_rad = -6.2832
upper_rad = 6.2832
velocity_rad_s = 3.1416
acceleration_rad_s2 = 15
jerk_rad_s3 = 5000
torque_n_m = 28
)";

}  // namespace unhand::planners
