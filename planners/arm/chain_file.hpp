// Arms from files.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "planners/arm/chain.hpp"

namespace unhand::planners {

/// A chain in TOML, with modified Denavit-Hartenberg parameters:
///
///   name = "shoulder and elbow"
///   home_rad = [0.5, 1.2]     # optional: where it rests, an angle for each joint
///   [[joint]]
///   name = "shoulder"
///   a_m = 0.0                 # with alpha_deg and d_m: modified_dh; theta_deg, if any, is where q = 0
///   alpha_deg = 90
///   d_m = 0.3
///   lower_rad = -2.9          # limits; those left out are unlimited
///   upper_rad = 2.9
///   velocity_rad_s = 2.2      # and acceleration_rad_s2, jerk_rad_s3, torque_n_m
///   mass_kg = 2.0             # the link's, 0 if it is left out
///   com_m = [0.1, 0.0, 0.0]
///   inertia_kg_m2 = [0.01, 0.02, 0.02, 0.0, 0.0, 0.0]   # about the com: xx, yy, zz, xy, xz, yz
///   friction = [0.5, 5.1, 0.04]                         # JointFriction: N m, s/rad, rad/s
///   [tip]                     # optional: the tip in the last link's frame
///   a_m = 0.0
///   alpha_deg = 0.0
///   d_m = 0.1
///
/// Keys `source` and `notes` are free text. Throws datasets::TomlError.
Chain read_toml_chain(const std::filesystem::path& file);
/// The same from text; `name` stands for the file in errors.
Chain toml_chain(std::string_view text, const std::string& name);

/// The chain from the root to link `tip` of a URDF file; an empty name: the only leaf. Joints
/// may be revolute or continuous, about any axis (frames are turned so that it is z), and fixed: a link fixed
/// to a moving one belongs to it. Links beside the chain on joints that move (fingers) do not count, nor does
/// their mass, as the chain's notes say; a joint of the chain that mimics another is refused. A URDF tells no
/// limits of acceleration and jerk. Throws datasets::ImportError with the line.
Chain read_urdf_chain(const std::filesystem::path& file, const std::string& tip = "");

/// By name or file: "panda", FILE.toml or FILE.urdf, of the last up to link `tip`. Throws
/// std::invalid_argument for another name, and for a tip of what is no URDF file.
Chain read_chain(const std::string& name_or_file, const std::string& tip = "");

}  // namespace unhand::planners
