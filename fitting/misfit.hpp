// The misfit of a campaign by channel and phase, and what each group counts for. Internal to fitting.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

/// χ² by channel and phase, of every throw for itself.
struct Misfit {
  struct Part {
    double sum{}, n{};
    double mean() const { return sum / n; }
  };
  std::array<std::vector<Part>, kPhaseCount * kChannelCount> parts;

  void add(const CampaignThrow& thrown, const Eigen::VectorXd& residual, double detach) {
    std::array<Part, kPhaseCount * kChannelCount> own{};
    for (std::size_t j = 0; j < thrown.observed.all.size(); ++j) {
      const auto& o = thrown.observed.all[j];
      const Phase phase = phase_of(o, thrown.opening, thrown.release_or(detach));
      const double r = residual[static_cast<Eigen::Index>(j)];
      Part& part = own[static_cast<std::size_t>(static_cast<int>(phase) * kChannelCount +
                                                static_cast<int>(o.channel))];
      part.sum += r * r;
      part.n += 1;
    }
    for (std::size_t g = 0; g < own.size(); ++g)
      if (own[g].n > 0) parts[g].push_back(own[g]);
  }
  static Part total(const std::vector<Part>& of) {
    Part out;
    for (const Part& part : of) out.sum += part.sum, out.n += part.n;
    return out;
  }
  /// Without the tenth of the throws (from five on, at least one) that fit worst: a throw that went wrong
  /// must not speak for a channel.
  static Part trimmed(std::vector<Part> of) {
    std::sort(of.begin(), of.end(), [](const Part& a, const Part& b) { return a.mean() < b.mean(); });
    if (of.size() >= 5) of.resize(of.size() - std::max<std::size_t>(1, of.size() / 10));
    return total(of);
  }
  void weigh(Weighting& weighting) const {
    for (std::size_t g = 0; g < parts.size(); ++g) {
      if (parts[g].empty()) continue;
      const Part part = trimmed(parts[g]);
      // A small group's mean scatters by itself.
      const double allowed = 1 + 3 * std::sqrt(2.0 / part.n);
      weighting.group[g] = std::sqrt(1 / std::max(1.0, part.mean() / allowed));
    }
  }
};

}  // namespace unhand::fitting
