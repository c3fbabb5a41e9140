// The independent noise of samples of a smooth motion, from the samples themselves. For importers and
// summaries.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace unhand::datasets {

/// Gathers third differences of series whose samples need not be equally spaced.
class SampleNoise {
 public:
  /// Four samples at rising times [s].
  void add(const std::array<double, 4>& times, const std::array<double, 4>& values);
  /// σ, in the unit of the values; 0 of nothing. Differences beyond five of their typical size are glitches
  /// of a tracker and left out.
  double sigma() const;
  /// How many were added.
  std::size_t size() const { return squares_.size(); }

 private:
  std::vector<double> squares_;
};

}  // namespace unhand::datasets
