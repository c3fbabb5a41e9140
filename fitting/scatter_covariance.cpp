#include "fitting/scatter_covariance.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/dense_solve.hpp"

namespace unhand::fitting {

using dynamics::congruent, dynamics::gram, dynamics::product, dynamics::Spectrum, dynamics::spectrum_of;

ScatterCovariance scatter_covariance(const std::vector<Cluster>& clusters, const Eigen::MatrixXd& information,
                                     const Eigen::MatrixXd& prior) {
  const Eigen::Index width = information.rows();
  // In units in which the diagonal is one: parameters differ by orders of magnitude.
  Eigen::MatrixXd H = information + prior;
  const Eigen::VectorXd unit = H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  H = unit.asDiagonal() * H * unit.asDiagonal();
  const Spectrum spectrum = spectrum_of(H);
  const double floor = 1e-12 * std::max(1e-300, spectrum.values.maxCoeff());
  const Eigen::VectorXd root = spectrum.values.cwiseMax(floor).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd whiten =  // whitenᵀ (information + prior) whiten = 1
      unit.asDiagonal() * spectrum.vectors * root.asDiagonal();

  std::vector<Eigen::MatrixXd> share, adjust;
  const Eigen::MatrixXd known = congruent(whiten.transpose(), prior);  // a measurement whose noise is certain
  Eigen::MatrixXd G = known, unseen = Eigen::MatrixXd::Zero(width, width);
  for (const Cluster& part : clusters) {
    share.push_back(congruent(whiten.transpose(), part.information));
    constexpr double kLeastRest = 0.1;  // one that alone determines a direction leaves no residual there
    const Spectrum own = spectrum_of(share.back());
    const Eigen::ArrayXd rest = 1 - own.values.array(), counted = rest.cwiseMax(kLeastRest);
    adjust.push_back(congruent(own.vectors, counted.rsqrt().matrix().asDiagonal()));
    unseen += congruent(own.vectors, (own.values.array() * (1 - rest / counted)).matrix().asDiagonal());
    const Eigen::VectorXd g = adjust.back() * (whiten.transpose() * part.gradient);
    G += g * g.transpose();
  }
  G += unseen;
  ScatterCovariance out;
  out.noise = gram(whiten.transpose());
  const auto n = static_cast<Eigen::Index>(share.size());
  out.degrees_of_freedom.setOnes(width);
  for (Eigen::Index k = 0; k < width; ++k) {
    Eigen::VectorXd c = whiten.row(k);
    const double size = c.stableNorm();  // no power of it counts below, and its own may not be representable
    if (!(size > 0) || !std::isfinite(size)) continue;
    c /= size;
    Eigen::MatrixXd toward(width, n), shared(width, n);  // A_i c and H_i A_i c
    for (Eigen::Index i = 0; i < n; ++i) {
      toward.col(i) = adjust[static_cast<std::size_t>(i)] * c;
      shared.col(i) = share[static_cast<std::size_t>(i)] * toward.col(i);
    }
    Eigen::MatrixXd B = -gram(shared);
    for (Eigen::Index i = 0; i < n; ++i) B(i, i) += toward.col(i).dot(shared.col(i));
    const double alone = c.dot(unseen * c), trace = B.trace() + c.dot(known * c) + alone;
    if (const double square = B.squaredNorm() + alone * alone; trace > 0)
      out.degrees_of_freedom[k] = std::clamp(trace * trace / std::max(square, 1e-300), 1.0, kCertain);
  }
  Spectrum scatter = spectrum_of(G);
  const double seen = width > 0 ? out.degrees_of_freedom.minCoeff() : 0;
  for (double& x : scatter.values)
    if (x < 1) x = (1 + seen * std::max(0.0, x)) / (1 + seen);
  out.covariance = congruent(product(whiten, scatter.vectors), scatter.values.asDiagonal());
  return out;
}

ScatterCovariance borrowing_scatter(const std::vector<Cluster>& clusters, const Eigen::MatrixXd& information,
                                    const Eigen::MatrixXd& prior) {
  ScatterCovariance out = scatter_covariance(clusters, information, prior);
  const Eigen::MatrixXd& noise = out.noise;
  const Eigen::Index width = noise.rows();
  const auto ratio = [&](Eigen::Index k) {
    return noise(k, k) > 0 ? std::max(0.0, out.covariance(k, k) / noise(k, k)) : 0.0;
  };
  const auto is_few = [&](Eigen::Index k) { return out.degrees_of_freedom[k] < kFewDegrees; };
  const auto is_held = [&](Eigen::Index k) { return prior(k, k) * noise(k, k) > 0.5; };
  double sum = 0, degrees = 0;  // of those that lend
  for (Eigen::Index k = 0; k < width; ++k) {
    if (is_few(k) || is_held(k)) continue;
    const double counts = std::min(out.degrees_of_freedom[k], 1e3);
    sum += counts * ratio(k), degrees += counts;
  }
  Eigen::VectorXd wanted(width);
  for (Eigen::Index k = 0; k < width; ++k) {
    double& own = out.degrees_of_freedom[k];
    wanted[k] = ratio(k);
    if (is_few(k) && !is_held(k) && degrees > 0) {
      wanted[k] = (own * ratio(k) + kBorrowed * sum / degrees) / (own + kBorrowed);
      own += kBorrowed;
    }
    wanted[k] = std::max(1.0, wanted[k]);
  }
  for (Eigen::Index k = 0; k < width; ++k) {
    constexpr double kNothing = 1e-12;
    const double is = ratio(k);
    const double factor = is > kNothing ? std::sqrt(wanted[k] / is) : 0.0;
    out.covariance.row(k) *= factor;
    out.covariance.col(k) *= factor;
    if (!(is > kNothing)) out.covariance(k, k) = wanted[k] * noise(k, k);
  }
  return out;
}

}  // namespace unhand::fitting
