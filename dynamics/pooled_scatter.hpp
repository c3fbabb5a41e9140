// How repetitions scatter, over several groups of them.
#pragma once

#include <cmath>
#include <vector>

namespace unhand::dynamics {

/// The scatter of numbers about the means of their groups, each group with a mean of its own.
class PooledScatter {
 public:
  /// A group of fewer than two says nothing.
  void add(const std::vector<double>& group) {
    if (group.size() < 2) return;
    ++groups_, freedom_ += static_cast<int>(group.size()) - 1;
    double mean = 0;
    for (const double x : group) mean += x / static_cast<double>(group.size());
    for (const double x : group) squares_ += (x - mean) * (x - mean);
  }
  /// Groups that were counted.
  int groups() const { return groups_; }
  /// Degrees of freedom.
  int freedom() const { return freedom_; }
  /// 1 σ, in the numbers' unit; 0 without freedom.
  double sigma() const { return freedom_ > 0 ? std::sqrt(squares_ / freedom_) : 0; }

 private:
  double squares_{};
  int groups_{}, freedom_{};
};

}  // namespace unhand::dynamics
