// Gauss-Newton on a manifold.
#pragma once

#include <Eigen/Core>
#include <functional>

namespace unhand::experiment {

/// Minimises |r(x)|² by Gauss-Newton with halved steps, on whatever manifold x lives. evaluate(d, r, J) gives
/// the weighted residual at move(x, d) and its Jacobian with respect to the step from there; accept(d) makes
/// x that. `unknowns`: size of d. `sigma` is the weights' scale, by which r is good to 1e-9/sigma. False if
/// it does not converge.
bool gauss_newton(
    const std::function<void(const Eigen::VectorXd& d, Eigen::VectorXd& r, Eigen::MatrixXd& J)>& evaluate,
    const std::function<void(const Eigen::VectorXd& d)>& accept, int unknowns, double sigma);

}  // namespace unhand::experiment
