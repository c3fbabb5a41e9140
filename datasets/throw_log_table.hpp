// The throw log's layout: every dataset in one table, every attribute in one place. Private to the module.
#pragma once

#include <array>

#include "datasets/attribute_fields.hpp"
#include "datasets/channel_table.hpp"
#include "datasets/throw_log.hpp"

namespace unhand::datasets {

inline constexpr int throw_log_version = 1;

namespace columns {
inline constexpr std::array<ColumnLayout, 1> time{{{"t", "s"}}};
inline constexpr std::array<ColumnLayout, 1> flag{{{"valid", "1"}}};
inline constexpr std::array<ColumnLayout, 1> pose{{{"x,z,theta", "m,m,rad"}}};
inline constexpr std::array<ColumnLayout, 2> pose3{
    {{"x,y,z,qw,qx,qy,qz", "m,m,m,1,1,1,1"}, {"x,y,z", "m,m,m"}}};
inline constexpr std::array<ColumnLayout, 1> twist{{{"vx,vz,omega", "m/s,m/s,rad/s"}}};
inline constexpr std::array<ColumnLayout, 1> acceleration{{{"ax,az,alpha", "m/s^2,m/s^2,rad/s^2"}}};
inline constexpr std::array<ColumnLayout, 1> wrench{{{"fx,fz,tau", "N,N,N m"}}};
inline constexpr std::array<ColumnLayout, 1> normal_force{{{"f_N", "N"}}};
inline constexpr std::array<ColumnLayout, 1> landing{{{"x,theta", "m,rad"}}};
inline constexpr std::array<ColumnLayout, 1> landing3{{{"x,y,z", "m,m,m"}}};
inline constexpr std::array<ColumnLayout, 1> specific_force{{{"fx,fy,fz", "m/s^2,m/s^2,m/s^2"}}};
inline constexpr std::array<ColumnLayout, 1> angular_rate{{{"wx,wy,wz", "rad/s,rad/s,rad/s"}}};
/// The hand and the force sensor are defined in the throwing plane only.
inline constexpr std::span<const ColumnLayout> none{};
}  // namespace columns

using enum ChannelKind;

/// Each group's time comes first, and a flag before the pose it masks.
inline constexpr Channel<Throw> throw_channels[] = {
    // group, name, kind, required, single row, planar, spatial, where
    {"hand", "time", time, true, false, columns::time, columns::none, slot_in<&Throw::hand, &HandLog::time>},
    {"hand", "pose", real, true, false, columns::pose, columns::none, slot_in<&Throw::hand, &HandLog::pose>},
    {"hand", "twist", real, true, false, columns::twist, columns::none,
     slot_in<&Throw::hand, &HandLog::twist>},
    {"hand", "acceleration", real, true, false, columns::acceleration, columns::none,
     slot_in<&Throw::hand, &HandLog::acceleration>},
    {"ft", "time", time, true, false, columns::time, columns::none, slot_in<&Throw::ft, &FtLog::time>},
    {"ft", "wrench", real, true, false, columns::wrench, columns::none, slot_in<&Throw::ft, &FtLog::wrench>},
    {"ft", "normal_force", real, true, false, columns::normal_force, columns::none,
     slot_in<&Throw::ft, &FtLog::normal_force>},
    {"mocap", "time", time, true, false, columns::time, columns::time,
     slot_in<&Throw::mocap, &MocapLog::time>},
    {"mocap", "valid", flag, false, false, columns::flag, columns::flag,
     slot_in<&Throw::mocap, &MocapLog::valid>},
    {"mocap", "pose", pose, true, false, columns::pose, columns::pose3,
     slot_in<&Throw::mocap, &MocapLog::pose>},
    {"landing", "time", time, true, true, columns::time, columns::time,
     slot_in<&Throw::landing, &LandingLog::time>},
    {"landing", "pose", real, true, true, columns::landing, columns::landing3,
     slot_in<&Throw::landing, &LandingLog::pose>},
    {"imu", "time", time, true, false, columns::time, columns::time, slot_in<&Throw::imu, &ImuLog::time>},
    {"imu", "specific_force", real, true, false, columns::specific_force, columns::specific_force,
     slot_in<&Throw::imu, &ImuLog::specific_force>},
    {"imu", "angular_rate", real, false, false, columns::angular_rate, columns::angular_rate,
     slot_in<&Throw::imu, &ImuLog::angular_rate>},
};

template <class Visitor, class Log>
void log_fields(Visitor&& visit, Log& log) {
  visit("dimension", log.dimension, Range{2, 3, "2 or 3"});
  visit("title", log.title);
  visit("source", log.source);
  visit("licence", log.licence);
  visit("gravity", log.gravity, non_negative);
  visit("landing_height", log.landing_height, finite);
}

template <class Visitor, class Thing>
void object_fields(Visitor&& visit, Thing& object, int dimension) {
  visit("mass", object.mass, positive);
  visit("inertia", object.inertia, positive, dimension == 3 ? std::size_t{3} : std::size_t{1});
  visit("com_offset", object.com_offset, finite);
  visit("dims", object.dims, positive);
  visit("surface", object.surface);
  visit("sku", object.sku);
  visit("drag_k", object.drag_k, non_negative);
}

template <class Visitor, class Hand>
void gripper_fields(Visitor&& visit, Hand& gripper) {
  visit("n_pads", gripper.n_pads, Range{1, 1000, "in 1..1000"});
  visit("pad_radius", gripper.pad_radius, positive);
  visit("opening_command_time", gripper.opening_command_time, finite);
}

template <class Visitor, class Toss>
void throw_fields(Visitor&& visit, Toss& toss) {
  visit("object", toss.object);
  visit("condition", toss.condition);
  visit("repetition", toss.repetition, Range{0, 1e9, "in 0..1e9"});
  visit("split", toss.split);
  visit("detach_time", toss.detach_time, finite);
  visit("grasp_angle", toss.grasp_angle, finite);
  visit.increasing("hand_jump_times", toss.hand_jump_times);
  visit("free_flight", toss.free_flight);
}

}  // namespace unhand::datasets
