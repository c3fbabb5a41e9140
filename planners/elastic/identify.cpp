#include "planners/elastic/identify.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

#include "dynamics/dense_solve.hpp"

namespace unhand::planners::elastic {
namespace {

using control::kLinkParameters;
using control::LinkParameters;
using Joints = JointVector<double>;

constexpr int kPasses = 3;  ///< of least squares
/// Singular values below this share of the largest belong to combinations that no motion shows.
constexpr double kRank = 1e-9;

/// π of a link from its ten log-Cholesky parameters (α, d₁, d₂, d₃, s₁₂, s₂₃, s₁₃, t₁, t₂, t₃).
template <class S>
Eigen::Matrix<S, kLinkParameters, 1> parameters_from(const Eigen::Matrix<S, kLinkParameters, 1>& phi) {
  using std::exp;
  const S o(0.0), one(1.0), scale = exp(2.0 * phi[0]);
  Eigen::Matrix<S, 4, 4> U;
  U << exp(phi[1]), phi[4], phi[6], phi[7],  //
      o, exp(phi[2]), phi[5], phi[8],        //
      o, o, exp(phi[3]), phi[9],             //
      o, o, o, one;
  const Eigen::Matrix<S, 4, 4> J = scale * (U * U.transpose());
  const S trace = J(0, 0) + J(1, 1) + J(2, 2);
  Eigen::Matrix<S, kLinkParameters, 1> out;
  out << J(3, 3), J(0, 3), J(1, 3), J(2, 3), trace - J(0, 0), trace - J(1, 1), trace - J(2, 2), -J(0, 1),
      -J(0, 2), -J(1, 2);
  return out;
}

LinkParameters log_cholesky(const LinkParameters& p, const std::string& joint) {
  const Eigen::Matrix3d I = symmetric(p[4], p[5], p[6], p[7], p[8], p[9]);
  Eigen::Matrix4d J;
  J.topLeftCorner<3, 3>() = 0.5 * I.trace() * Eigen::Matrix3d::Identity() - I;
  J.topRightCorner<3, 1>() = p.segment<3>(1);
  J.bottomLeftCorner<1, 3>() = p.segment<3>(1).transpose();
  J(3, 3) = p[0];
  Eigen::Matrix4d U = Eigen::Matrix4d::Zero();  // J = U Uᵀ, from the last column on
  for (int j = 3; j >= 0; --j)
    for (int i = j; i >= 0; --i) {
      double rest = J(i, j);
      for (int k = j + 1; k < 4; ++k) rest -= U(i, k) * U(j, k);
      if (i == j && !(rest > 0))
        throw std::invalid_argument(
            fmt::format("identify: no body has the prior inertia of joint '{}'", joint));
      U(i, j) = i == j ? std::sqrt(rest) : rest / U(j, j);
    }
  const Eigen::Matrix4d T = U / U(3, 3);
  LinkParameters out;
  out << std::log(U(3, 3)), std::log(T(0, 0)), std::log(T(1, 1)), std::log(T(2, 2)), T(0, 1), T(1, 2),
      T(0, 2), T(0, 3), T(1, 3), T(2, 3);
  return out;
}

/// All links' π and ∂π/∂φ.
void evaluate(const Eigen::VectorXd& phi, Eigen::VectorXd& pi, Eigen::MatrixXd& derivative) {
  using Dual10 = dynamics::DualOf<kLinkParameters>;
  derivative.setZero(phi.size(), phi.size());
  pi.resize(phi.size());
  for (Eigen::Index first = 0; first < phi.size(); first += kLinkParameters) {
    Eigen::Matrix<Dual10, kLinkParameters, 1> in;
    for (int k = 0; k < kLinkParameters; ++k) in[k] = Dual10(phi[first + k], k);
    const auto out = parameters_from<Dual10>(in);
    for (int k = 0; k < kLinkParameters; ++k) {
      pi[first + k] = out[k].a;
      derivative.block(first + k, first, 1, kLinkParameters) = out[k].v.transpose();
    }
  }
}

double condition_of(const Eigen::VectorXd& s) {
  double least = s[0];
  for (const double one : s)
    if (one > kRank * s[0]) least = one;
  return s[0] / least;
}

Eigen::MatrixXd stacked(const Chain& chain, const Excitation& motion, int samples) {
  const int n = chain.size();
  Eigen::MatrixXd W(n * samples, kLinkParameters * n);
  Joints q(n), qd(n), qdd(n);
  for (int k = 0; k < samples; ++k) {
    motion.at(motion.period * k / samples, q, qd, qdd);
    W.middleRows(n * k, n) = control::torque_regressor<double>(chain, q, qd, qdd);
  }
  return W;
}

}  // namespace

void Excitation::at(double t, Joints& q, Joints& qd, Joints& qdd) const {
  q = centre;
  qd.setZero(centre.size());
  qdd.setZero(centre.size());
  for (Eigen::Index k = 0; k < sine.cols(); ++k) {
    const double w = 2 * std::numbers::pi * static_cast<double>(k + 1) / period, s = std::sin(w * t),
                 c = std::cos(w * t);
    q += s * sine.col(k) + c * cosine.col(k);
    qd += w * (c * sine.col(k) - s * cosine.col(k));
    qdd -= w * w * (s * sine.col(k) + c * cosine.col(k));
  }
}

DesignedExcitation design_excitation(const Chain& chain, const ExcitationOptions& o) {
  validate(chain);
  if (!(o.period > 0 && std::isfinite(o.period)) || o.harmonics < 1 || o.harmonics > 100 || o.samples < 10 ||
      o.trials < 1)
    throw std::invalid_argument(
        "design_excitation: period in (0, inf) s, harmonics of 1 to 100, samples >= 10 and trials >= 1 are "
        "accepted");
  const int n = chain.size();
  std::mt19937_64 random(o.seed);
  std::normal_distribution<double> normal;
  DesignedExcitation out;
  for (int trial = 0; trial < o.trials; ++trial) {
    Excitation one{o.period, Joints::Zero(n), Eigen::MatrixXd(n, o.harmonics),
                   Eigen::MatrixXd(n, o.harmonics)};
    const double width = std::pow(0.1, static_cast<double>(trial) / o.trials);  // narrows around the best
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < o.harmonics; ++k) {
        one.sine(i, k) = trial == 0 ? normal(random) : out.motion.sine(i, k) + width * normal(random);
        one.cosine(i, k) = trial == 0 ? normal(random) : out.motion.cosine(i, k) + width * normal(random);
      }
    // Shrink each joint into its limits, seen twenty times a period of the fastest, with 5 % to spare.
    const int instants = std::max(o.samples, 20 * o.harmonics);
    Joints q(n), qd(n), qdd(n), low = Joints::Constant(n, 1e9), high = -low, fast = Joints::Zero(n);
    for (int k = 0; k < instants; ++k) {
      one.at(o.period * k / instants, q, qd, qdd);
      low = low.cwiseMin(q), high = high.cwiseMax(q), fast = fast.cwiseMax(qd.cwiseAbs());
    }
    for (int i = 0; i < n; ++i) {
      const JointLimits& l = chain.joints[i].limits;
      const double upper = std::min(l.upper, 3.0), lower = std::max(l.lower, -3.0);
      const double shrink =
          0.95 * std::min({1 / 0.95, (upper - lower) / (high[i] - low[i]), l.velocity / fast[i]});
      one.sine.row(i) *= shrink;
      one.cosine.row(i) *= shrink;
      one.centre[i] = 0.5 * (upper + lower) - 0.5 * shrink * (high[i] + low[i]);
    }
    const Eigen::MatrixXd W = stacked(chain, one, o.samples);
    const double condition =
        condition_of(dynamics::singular_vectors(W, Eigen::VectorXd::Zero(W.rows())).values);
    if (trial == 0) out.first_condition = condition;
    if (trial == 0 || condition < out.condition) {
      out.condition = condition;
      out.motion = one;
    }
  }
  return out;
}

namespace {

/// The equations of each joint less what its noise keeps of the sample before, in units of what comes anew.
/// `left`: residuals of a fit with so many parameters a joint, which take (1 + 3 ρ)/samples off a correlation
/// each.
void whiten(const Eigen::VectorXd& left, int joints, double parameters, const Eigen::MatrixXd& W,
            const Eigen::VectorXd& tau, Eigen::MatrixXd& white, Eigen::VectorXd& white_tau) {
  const Eigen::Index samples = left.size() / joints;
  for (int i = 0; i < joints; ++i) {
    double squares = 0, products = 0;
    for (Eigen::Index k = 0; k < samples; ++k) {
      const double r = left[k * joints + i];
      squares += r * r;
      if (k > 0) products += r * left[(k - 1) * joints + i];
    }
    if (!(squares > 0)) continue;  // without noise
    const double seen = products / squares, n = static_cast<double>(samples),
                 stays =
                     std::clamp((seen + parameters / n) / std::max(0.5, 1 - 3 * parameters / n), 0.0, 0.98),
                 size = std::sqrt(squares / n * (1 - stays * stays)), first = std::sqrt(1 - stays * stays);
    for (Eigen::Index k = samples - 1; k >= 0; --k) {
      const Eigen::Index row = k * joints + i, before = row - joints;
      white.row(row) =
          k > 0 ? ((W.row(row) - stays * W.row(before)) / size).eval() : (first / size * W.row(row)).eval();
      white_tau[row] = k > 0 ? (tau[row] - stays * tau[before]) / size : first / size * tau[row];
    }
  }
}

}  // namespace

IdentifiedInertia identify_inertia(const Chain& prior, const std::vector<MotionSample>& log) {
  validate(prior);
  const int n = prior.size(), parameters = kLinkParameters * n, rows = n * static_cast<int>(log.size());
  if (rows < 2 * parameters)
    throw std::invalid_argument(
        fmt::format("identify: {} samples; accepted: at least {}", log.size(), 2 * parameters / n));
  Eigen::MatrixXd W(rows, parameters);
  Eigen::VectorXd tau(rows);
  for (std::size_t k = 0; k < log.size(); ++k) {
    const MotionSample& one = log[k];
    require_sizes(prior, "identify", one.q, one.qd, one.qdd, one.torque);
    if (!std::isfinite(one.q.sum() + one.qd.sum() + one.qdd.sum() + one.torque.sum()))
      throw std::invalid_argument(fmt::format("identify: sample {} is not finite", k));
    W.middleRows(n * static_cast<int>(k), n) =
        control::torque_regressor<double>(prior, one.q, one.qd, one.qdd);
    tau.segment(n * static_cast<int>(k), n) = one.torque;
  }
  IdentifiedInertia out;
  out.condition = condition_of(dynamics::singular_vectors(W, tau).values);
  // Least squares, then twice again with what was left: each joint's noise has its own size, and stays from
  // sample to sample as far as it does (Cochrane and Orcutt).
  Eigen::MatrixXd white = W;
  Eigen::VectorXd white_tau = tau;
  for (int pass = 0; pass < kPasses; ++pass) {
    const dynamics::SingularVectors svd = dynamics::singular_vectors(white, white_tau);
    const Eigen::VectorXd& s = svd.values;
    int rank = 0;
    while (rank < s.size() && s[rank] > kRank * s[0]) ++rank;
    out.combinations = svd.right.leftCols(rank);
    out.estimate = svd.left_times_b.head(rank).cwiseQuotient(s.head(rank));
    const Eigen::VectorXd solution = out.combinations * out.estimate, left = tau - W * solution;
    const double freedom = static_cast<double>(rows - rank);
    out.torque_noise = left.norm() / std::sqrt(freedom);
    out.sigma = (white_tau - white * solution).norm() / std::sqrt(freedom) * s.head(rank).cwiseInverse();
    if (pass + 1 < kPasses) whiten(left, n, static_cast<double>(rank) / n, W, tau, white, white_tau);
  }

  // Bodies: Levenberg and Marquardt on the log-Cholesky parameters, held to the prior's by 1e-3 of a sigma.
  constexpr double hold = 1e-3;
  Eigen::VectorXd phi(parameters), pi;
  for (int i = 0; i < n; ++i)
    phi.segment<kLinkParameters>(kLinkParameters * i) =
        log_cholesky(control::parameters_of(prior.joints[i].link), prior.joints[i].name);
  const Eigen::VectorXd start = phi;
  Eigen::MatrixXd D;
  const Eigen::VectorXd weight = out.sigma.cwiseMax(1e-12).cwiseInverse();
  const auto misfit = [&](const Eigen::VectorXd& at) {
    return Eigen::VectorXd(weight.cwiseProduct(out.combinations.transpose() * at - out.estimate));
  };
  double damping = 1e-3;
  for (int iteration = 0; iteration < 200; ++iteration) {
    evaluate(phi, pi, D);
    const Eigen::VectorXd r = misfit(pi);
    const Eigen::MatrixXd J = weight.asDiagonal() * dynamics::inner_products(out.combinations, D);
    const double cost = r.squaredNorm() + hold * hold * (phi - start).squaredNorm();
    Eigen::MatrixXd H = dynamics::gram(J);
    H.diagonal().array() += hold * hold;
    const Eigen::VectorXd gradient = J.transpose() * r + hold * hold * (phi - start);
    Eigen::MatrixXd damped = H;
    damped.diagonal() += damping * H.diagonal();
    const Eigen::VectorXd step = -dynamics::definite_solve(damped, gradient);
    Eigen::VectorXd tried;
    evaluate(phi + step, tried, D);
    const double next = misfit(tried).squaredNorm() + hold * hold * (phi + step - start).squaredNorm();
    if (std::isfinite(next) && next < cost) {
      phi += step;
      damping = std::max(1e-12, damping / 5);
      if (cost - next < 1e-10 * cost) break;
    } else {
      damping *= 4;
      if (damping > 1e12) break;
    }
  }
  evaluate(phi, pi, D);
  out.feasible = prior;
  for (int i = 0; i < n; ++i)
    out.feasible.joints[i].link = control::inertia_from(pi.segment<kLinkParameters>(kLinkParameters * i));
  out.feasible_misfit = std::sqrt(misfit(pi).squaredNorm() / static_cast<double>(out.estimate.size()));
  return out;
}

IdentifiedSpring identify_spring(const std::vector<SpringSample>& log) {
  const int rows = static_cast<int>(log.size());
  if (rows < 10)
    throw std::invalid_argument(fmt::format("identify_spring: {} samples; accepted: at least 10", rows));
  constexpr double kAlike = 20;  // condition number: a swing at one frequency is 1/noise, one at two some 4
  Eigen::Matrix<double, Eigen::Dynamic, 3> W(rows, 3);
  Eigen::VectorXd tau(rows);
  for (int k = 0; k < rows; ++k) {
    W.row(k) << log[k].deflection, log[k].rate, log[k].acceleration;
    tau[k] = log[k].torque;
    if (!std::isfinite(W.row(k).sum() + tau[k]))
      throw std::invalid_argument(fmt::format("identify_spring: sample {} is not finite", k));
  }
  const Eigen::RowVector3d sizes = W.colwise().norm();
  if (!(sizes.minCoeff() > 0))
    throw std::invalid_argument("identify_spring: the log does not move the motor");
  const Eigen::VectorXd values = dynamics::singular_vectors(W.array().rowwise() / sizes.array(), tau).values;
  if (!(values[0] < kAlike * values[2]))
    throw std::invalid_argument(
        fmt::format("identify_spring: deflection, rate and acceleration are not told apart (condition number "
                    "{:.2g}, accepted: up to {}): a swing at one frequency shows K - B w^2 alone; move the "
                    "motor at two",
                    values[0] / values[2], kAlike));
  const Eigen::Matrix3d information = W.transpose() * W, inverse = information.inverse();
  const Eigen::Vector3d x = inverse * (W.transpose() * tau);
  const double noise = (tau - W * x).norm() / std::sqrt(rows - 3.0);
  return {x[0],
          x[1],
          x[2],
          noise * std::sqrt(inverse(0, 0)),
          noise * std::sqrt(inverse(1, 1)),
          noise * std::sqrt(inverse(2, 2))};
}

}  // namespace unhand::planners::elastic
