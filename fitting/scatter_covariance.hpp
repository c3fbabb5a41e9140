// What the scatter between clusters (throws, groups) says of the unknowns that they share. Internal to
// fitting.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fitting/distributions.hpp"

namespace unhand::fitting {

/// What one throw or group says of the shared unknowns, its own eliminated.
struct Cluster {
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;  ///< at the solution
};

/// A covariance that rests on the scatter between clusters.
struct ScatterCovariance {
  Eigen::MatrixXd covariance;
  Eigen::VectorXd degrees_of_freedom;  ///< of every unknown's variance
  Eigen::MatrixXd noise;               ///< H⁻¹: the covariance if all is as declared
};
/// H⁻¹ G H⁻¹; H = information + prior, G = prior + U + Σ g̃_i g̃_iᵀ over the clusters' gradients g_i,
/// g̃_i = (1 − H_i H⁻¹)^(−1/2) g_i: the fit follows a cluster by its share H_i of the information, which makes
/// its gradient that much too small. If the noise is as declared, E[G] = H whatever the shares: "CR2" of
/// [BellMcCaffrey2002]. A cluster with more than nine tenths of what is known along a direction hardly
/// scatters there: U is what its g̃_i, not taken larger than 10^(1/2) g_i, lacks of that, as the noise says.
///
/// With c the row of H⁻¹ that belongs to an unknown and B_ij = Cov(cᵀg̃_i, cᵀg̃_j), the degrees of freedom of
/// its variance are (tr B + cᵀ(prior + U)c)²/(tr B² + (cᵀUc)²), as there: nothing of the prior's part is
/// estimated, and U counts as one more cluster. At most kCertain.
///
/// Few clusters may by chance, or in some direction must, agree better than their noise allows. So where an
/// eigenvalue λ of H^(−1/2) G H^(−1/2) is below 1 it becomes (1 + ν λ)/(1 + ν), ν the least of the degrees of
/// freedom: one more cluster that scatters as the noise says.
ScatterCovariance scatter_covariance(const std::vector<Cluster>& clusters, const Eigen::MatrixXd& information,
                                     const Eigen::MatrixXd& prior);

/// The same for clusters of which some unknowns are known from few, as the size of one object from its two
/// flights: the variance over noise of an unknown with less than kFewDegrees is mixed with that of those
/// which have more, as kBorrowed degrees of freedom. What a prior holds for the most part takes no part in
/// that. No unknown is surer than the noise lets it be.
inline constexpr double kFewDegrees = 5, kBorrowed = 4;
ScatterCovariance borrowing_scatter(const std::vector<Cluster>& clusters, const Eigen::MatrixXd& information,
                                    const Eigen::MatrixXd& prior);

}  // namespace unhand::fitting
