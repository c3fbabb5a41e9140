// How repetitions scatter, over several groups of them.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace unhand::dynamics {

/// The scatter of N numbers about the means of their groups, each group with a mean of its own.
template <std::size_t N>
class PooledScatter {
 public:
  /// A group of fewer than two says nothing.
  void add(const std::vector<std::array<double, N>>& group) {
    if (group.size() < 2) return;
    ++groups_, freedom_ += static_cast<int>(group.size()) - 1;
    for (std::size_t c = 0; c < N; ++c) {
      double mean = 0, sum = 0;
      for (const auto& x : group) mean += x[c] / static_cast<double>(group.size());
      for (const auto& x : group) sum += (x[c] - mean) * (x[c] - mean);
      squares_[c] += sum;
    }
  }
  /// Groups that were counted.
  int groups() const { return groups_; }
  /// Degrees of freedom.
  int freedom() const { return freedom_; }
  /// 1 σ of number `c`, in its unit; 0 without freedom.
  double sigma(std::size_t c) const { return freedom_ > 0 ? std::sqrt(squares_[c] / freedom_) : 0; }

 private:
  std::array<double, N> squares_{};
  int groups_{}, freedom_{};
};

}  // namespace unhand::dynamics
