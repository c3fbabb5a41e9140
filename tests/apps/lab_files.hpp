// Files as a lab has them, for `unhand import`.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

namespace unhand::cli {

/// Files of a lab: a hand, a sensor and a tracker saw the same throw.
inline void write_lab_files(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder / "hand");
  std::filesystem::create_directories(folder / "ft");
  std::filesystem::create_directories(folder / "takes");
  std::ofstream(folder / "bar.toml")
      << "name = \"bar\"\nmass_kg = 0.25\ninertia_kg_m2 = 2.4e-3\nsurface = \"steel\"\n";
  for (const std::string name : {"slow_01", "slow_02"}) {
    std::ofstream hand(folder / "hand" / (name + ".csv")), ft(folder / "ft" / (name + ".csv"));
    std::ofstream take(folder / "takes" / (name + ".csv"));
    hand << "t,X,Z,pitch,VX,VZ,Q,AX,AZ,DQ\n";
    ft << "t (s),Fx (N),Fz (N),Ty (N mm),Fy (N)\n";
    take << "Format Version,1.23,Take Name," << name
         << ",Rotation Type,Quaternion,Length Units,Millimeters\n\n"
         << ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body\n"
         << ",Name,bar,bar,bar,bar,bar,bar,bar\n,,Rotation,Rotation,Rotation,Rotation,Position,Position,"
            "Position\n"
         << "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z\n";
    for (int k = 0; k < 251; ++k) {
      const double t = 1e-3 * k, force = 40 * std::max(0.0, 1 - std::max(0.0, t - 0.11) / 0.04);
      hand << k << ',' << 500 + 1.5 * k << ',' << 800 + 1.5 * k << ",15,1.5,1.5,0,0,0,0\n";
      ft << t << ",0,-1.2,0," << force << '\n';
    }
    for (int k = 0; k < 240; ++k) {
      const double t = k / 240.0, fall = std::max(0.0, t - 0.15), half = 0.13 + 2 * fall;
      take << k << ',' << t << ",0,0," << std::sin(half) << ',' << std::cos(half) << ',' << 500 + 1500 * t
           << ',' << 800 + 1500 * t - 500 * 9.81 * fall * fall << ",0\n";
    }
  }
}

}  // namespace unhand::cli
