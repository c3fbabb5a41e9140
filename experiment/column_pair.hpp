// Two columns that should be equal, and by which factor they are not. Internal to unit_check and axis_check.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

namespace unhand::experiment {

/// Numbers of two columns that should be equal, in SI units.
class ColumnPair {
 public:
  /// One more of each.
  void add(double a, double b) { aa_ += a * a, ab_ += a * b, bb_ += b * b, n_ += 1; }
  /// Of the two columns as vectors; 0 where one is zero.
  double cosine() const { return aa_ > 0 && bb_ > 0 ? ab_ / std::sqrt(aa_ * bb_) : 0; }
  /// The first over the second by least squares, where their cosine is above 0.9 and both have an rms of
  /// `shows` or more.
  std::optional<double> fitted_ratio(double shows) const {
    constexpr double kTogether = 0.9;
    if (n_ == 0 || std::min(aa_, bb_) < n_ * shows * shows) return {};
    if (!(ab_ > kTogether * std::sqrt(aa_ * bb_))) return {};
    return ab_ / bb_;
  }
  /// The size of the first over that of the second, with the cosine's sign, where that is beyond ±0.95 and
  /// the larger has an rms of `shows` or more.
  std::optional<double> size_ratio(double shows) const {
    constexpr double kTogether = 0.95;
    if (n_ == 0 || std::max(aa_, bb_) < n_ * shows * shows || !(std::abs(cosine()) > kTogether)) return {};
    return std::copysign(std::sqrt(aa_ / bb_), ab_);
  }

 private:
  double aa_{}, ab_{}, bb_{}, n_{};
};

}  // namespace unhand::experiment
