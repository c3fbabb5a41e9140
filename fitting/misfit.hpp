// The misfit of a campaign by channel and phase, and what each group counts for. Internal to fitting.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

/// χ² by channel and part, of every throw for itself.
struct Misfit {
  struct Part {
    double n{}, sum{}, squares{};  ///< samples, Σ r, Σ r²
    double mean_square() const { return squares / n; }
    /// What the mean's square is to that of white noise of σ = 1: up to n where residuals stay the same.
    double of_mean() const { return sum * sum / n; }
  };
  std::array<std::vector<Part>, kPartCount * kChannelCount> parts;

  void add(const CampaignThrow& thrown, const Eigen::VectorXd& residual, double detach) {
    std::array<Part, kPartCount * kChannelCount> own{};
    for (std::size_t j = 0; j < thrown.observed.all.size(); ++j) {
      const auto& o = thrown.observed.all[j];
      const double r = residual[static_cast<Eigen::Index>(j)];
      Part& part = own[group_of(part_of(o, thrown, detach), o.channel)];
      part.n += 1;
      part.sum += r;
      part.squares += r * r;
    }
    for (std::size_t g = 0; g < own.size(); ++g)
      if (own[g].n > 0) parts[g].push_back(own[g]);
  }

  /// The factor w on the residuals of a group, w² = 1/max(1, m², V): m² the mean square, and V that of the
  /// throws' means in units of 1/n. White noise of the declared σ has m² = V = 1. A law that cannot follow
  /// errs in one direction for a whole group: its n residuals are one witness, not n, and then V = n m².
  /// Weigh::variances leaves V out.
  static double factor(const std::vector<Part>& of, Weigh weigh) {
    double samples = 0;
    for (const Part& part : of) samples += part.n;
    // Means scatter by themselves: three σ are allowed.
    const auto allowed = [](double n) { return 1 + 3 * std::sqrt(2 / n); };
    double square = std::max(1.0, trimmed_mean(of, &Part::mean_square) / allowed(samples));
    if (weigh == Weigh::witnesses)
      square = std::max(square, trimmed_mean(of, &Part::of_mean) / allowed(static_cast<double>(of.size())));
    return 1 / std::sqrt(square);
  }
  /// By channel and part; for variances by channel and phase.
  void weigh(Weighting& weighting, Weigh weigh) const {
    for (int part = 0; part < kPartCount; ++part)
      for (int c = 0; c < kChannelCount; ++c) {
        const auto channel = static_cast<experiment::Channel>(c);
        std::vector<Part> of;
        for (int other = 0; other < kPartCount; ++other) {
          const auto& there = parts[group_of(other, channel)];
          if (other == part || (weigh == Weigh::variances && phase_of_part(other) == phase_of_part(part)))
            of.insert(of.end(), there.begin(), there.end());
        }
        if (!of.empty()) weighting.group[group_of(part, channel)] = factor(of, weigh);
      }
  }

 private:
  /// Without the largest tenth (from five on, at least one): a throw that went wrong must not speak for a
  /// channel.
  static double trimmed_mean(const std::vector<Part>& of, double (Part::*value)() const) {
    std::vector<double> x;
    for (const Part& part : of) x.push_back((part.*value)());
    std::sort(x.begin(), x.end());
    if (x.size() >= 5) x.resize(x.size() - std::max<std::size_t>(1, x.size() / 10));
    return std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
  }
};

}  // namespace unhand::fitting
