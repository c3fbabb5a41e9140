#include "fitting/discovery/jackknife.hpp"

#include <algorithm>

#include "dynamics/dense_solve.hpp"

namespace unhand::fitting {

LinearAnswer::LinearAnswer(const Equations& equations) {
  const Eigen::Index width = equations.cols() - 1;
  covariance = dynamics::pseudo_inverse(equations.topLeftCorner(width, width));
  step = covariance * equations.col(width).head(width);
}

Jackknife jackknife(const std::map<std::string, Equations>& groups, const Equations& all,
                    const LinearAnswer& whole) {
  const Eigen::VectorXd noise = whole.covariance.diagonal();
  const Eigen::Index width = noise.size();
  Jackknife out{Eigen::VectorXd::Zero(width), Eigen::VectorXd::Zero(width)};
  Eigen::VectorXd shares = out.excess, squares = out.excess;
  for (const auto& [name, of] : groups) {
    const LinearAnswer rest(all - of);
    for (Eigen::Index k = 0; k < width; ++k) {
      const double without = rest.covariance(k, k), step = rest.step[k] - whole.step[k];
      constexpr double kAlone = 1e4;  // what is hardly known without it is its own
      const bool alone = !(without > noise[k] * (1 - 1e-9)) || without > kAlone * noise[k];
      const double share = alone ? 1 : std::clamp(1 - noise[k] / without, 0.0, 1.0);
      shares[k] += share, squares[k] += share * share;
      if (!alone) out.excess[k] += step * step - (without - noise[k]);
    }
  }
  for (Eigen::Index k = 0; k < width; ++k)
    if (squares[k] > 0) out.groups[k] = shares[k] * shares[k] / squares[k];
  return out;
}

}  // namespace unhand::fitting
