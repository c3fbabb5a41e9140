// The figure of the detection rate against the size of an effect, from the records of a study of the loop.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "apps/figure.hpp"
#include "bench/discovery_record.hpp"

namespace unhand {

/// A search for one effect.
struct Trial {
  double size{};  ///< in typical steps, positive
  bool found{};
};

/// P(found) = 1/(1 + exp(−(a + b ln size))).
struct Logistic {
  double a{}, b{};
  double sigma_ln_half{};  ///< 1 σ of ln half(), from the curvature of the likelihood
  double at(double size) const;
  double half() const;  ///< the size at which half are found
};
/// The likeliest; none where it does not exist, since found and missed sizes do not overlap
/// [AlbertAnderson1984], or where larger ones are not found more often.
std::optional<Logistic> fit_logistic(const std::vector<Trial>& trials);

/// The 95 % interval of a share, found of n [Wilson1927].
std::pair<double, double> wilson95(int found, int n);

/// Above, the share found of all effects by size; below, every campaign by effect. Of the campaigns of one
/// effect that had all sensors.
apps::Figure detection_figure(const std::vector<StudyRecord>& records);

}  // namespace unhand
