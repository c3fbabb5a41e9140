// What linear equations say of their unknowns, and how far that hangs on each of the groups that they sum.
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>

namespace unhand::fitting {

/// The information H of unknowns (n × n) and, in a last row and column, the gradient g of half the sum of
/// squares: sums over samples, so that a group's part can be taken off.
using Equations = Eigen::MatrixXd;

inline Equations no_equations(Eigen::Index unknowns) { return Equations::Zero(unknowns + 1, unknowns + 1); }

/// The covariance H⁻¹ that equations leave, and the step H⁻¹ g that they ask for; pseudo-inverses, where they
/// do not determine all unknowns.
struct LinearAnswer {
  Eigen::MatrixXd covariance;
  Eigen::VectorXd step;
  explicit LinearAnswer(const Equations& equations);
};

/// What leaving out each group does to every unknown.
struct Jackknife {
  Eigen::VectorXd
      groups;  ///< that speak of it: (Σ h)²/Σ h² by their shares h = 1 − H⁻¹/H₋c⁻¹ of what is known
  Eigen::VectorXd excess;  ///< Σ_c δ_c² − (H₋c⁻¹ − H⁻¹): less what noise alone makes of it
};

/// `groups` are parts of the sum `all`; `whole` is the answer of that.
Jackknife jackknife(const std::map<std::string, Equations>& groups, const Equations& all,
                    const LinearAnswer& whole);

}  // namespace unhand::fitting
