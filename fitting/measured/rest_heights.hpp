// What a box of known size says about a tracker by coming to rest: its scale, and where the tracked point is.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "datasets/throw_log.hpp"

namespace unhand::fitting {

/// The last samples of tracked boxes that lie still on a face, on a level floor. The tracked height on face
/// ±i is floor + (1 + scale) (half side_i ± offset_i): opposite faces give the offset of the tracked point
/// from the box's middle, and their mean, if the floor's height is known, the scale.
struct RestHeights {
  int n{};         ///< throws at rest
  double scale{};  ///< reported/true − 1 [-], if the floor is where it was said to be
  double above{};  ///< mean height of the middle above where the size puts it [m]
  double sigma{};  ///< from the scatter between axes, or between throws if that is larger [-]
  std::array<std::optional<double>, 3> offset;  ///< from the middle to the tracked point, body axes [m]
  std::array<double, 3> offset_sigma{};         ///< 1 σ [m]
};
/// Of one object with `dims`, spatial log with orientation. Empty if fewer than five throws come to rest, or
/// no axis has two rests on each of its faces; an axis that has not is left out.
std::optional<RestHeights> rest_heights(const datasets::ThrowLog& log, const std::string& object,
                                        double floor);

/// Throws of boxes that end still, and those among them that lie on a face.
struct RestsOnFaces {
  int still{};    ///< throws that end so
  int on_face{};  ///< of these
  /// Boxes stop on their faces: where most seem not to, attitudes are in another convention than the
  /// schema's.
  bool is_doubtful() const;
  /// For reports.
  std::string in_words() const;
};
/// Of all objects with `dims`, spatial log with orientation.
RestsOnFaces rests_on_faces(const datasets::ThrowLog& log);

}  // namespace unhand::fitting
