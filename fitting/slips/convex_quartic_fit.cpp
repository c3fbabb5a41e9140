// The convex quartic of fit_surface: an augmented Lagrangian keeps it convex, a mixture makes it exactly so.
#include <Eigen/Core>

#include "dynamics/dense_solve.hpp"
#include "dynamics/scalar.hpp"
#include "fitting/slips/slip_surface_solver.hpp"

namespace unhand::fitting {

using dynamics::congruent, dynamics::Spectrum, dynamics::spectrum_of;

namespace {

using Sym3 = Eigen::Matrix3d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

double value_of(double x) { return x; }
template <int N>
double value_of(const dynamics::DualOf<N>& x) {
  return x.a;
}

/// √ρ times the positive eigenvalues of Y/ρ − S, S = Σ adj(A_k) of the quartic's squares: half their square
/// is the augmented Lagrangian of "S is positive semidefinite", Y its multiplier. An eigenvalue with
/// eigenvector v changes by vᵀ dS v, so v may be held while the derivative is taken.
struct ConvexityResidual {
  Sym3 multiplier = Sym3::Zero();
  double penalty = 1;

  Spectrum spectrum(const Sym3& s) const { return spectrum_of(multiplier / penalty - s); }
  template <class T>
  bool operator()(const T* p, T* r) const {
    const std::array<T, 6> s = adjugate_sum(p);
    std::array<double, 6> value;
    for (std::size_t i = 0; i < 6; ++i) value[i] = value_of(s[i]);
    const Spectrum found = spectrum(symmetric(value));
    for (int k = 0; k < 3; ++k) {
      r[k] = T(0);
      if (!(found.values[k] > 0)) continue;
      const Eigen::Vector3d v = found.vectors.col(k);
      const T turned = v[0] * v[0] * s[0] + v[1] * v[1] * s[3] + v[2] * v[2] * s[5] +
                       2.0 * (v[0] * v[1] * s[1] + v[0] * v[2] * s[2] + v[1] * v[2] * s[4]);
      r[k] = std::sqrt(penalty) * (v.dot(multiplier * v) / penalty - turned);
    }
    return true;
  }
  /// The next multiplier.
  void update(const Sym3& s) {
    const Spectrum found = spectrum(s);
    multiplier = penalty * congruent(found.vectors, found.values.cwiseMax(0.0).asDiagonal());
  }
};

/// Holds the directions that no sample determines.
struct Hold {
  template <class T>
  bool operator()(const T* p, T* r) const {
    for (int i = 0; i < QuarticTerms::parameters; ++i) r[i] = 1e-4 * p[i];
    return true;
  }
};

Vector6 vector_of(const Sym3& a) {
  const double r = std::sqrt(2.0);
  return Vector6{{a(0, 0), a(1, 1), a(2, 2), r * a(0, 1), r * a(0, 2), r * a(1, 2)}};
}

using Squares = std::array<double, QuarticTerms::parameters>;

Matrix6 gram_of(const Squares& p) {
  const Eigen::Map<const Matrix6> columns(p.data());
  return columns * columns.transpose();
}

/// The symmetric root.
Squares squares_of(const Matrix6& gram) {
  const Spectrum found = spectrum_of(gram);
  Squares p{};
  Eigen::Map<Matrix6>(p.data()) =
      congruent(found.vectors, found.values.cwiseMax(0.0).cwiseSqrt().asDiagonal());
  return p;
}

double least_eigenvalue(const Sym3& s) { return spectrum_of(s).values[0]; }

/// The Gram matrix of |Bw|⁴, and of a sum of six squares that spreads evenly about it.
struct Ball {
  Matrix6 squared, spread;

  explicit Ball(const std::array<double, 6>& b) {
    const Eigen::Matrix3d upper{{b[0], b[1], b[2]}, {0, b[3], b[4]}, {0, 0, b[5]}};
    const Vector6 whole = vector_of(upper.transpose() * upper);
    squared = whole * whole.transpose();
    spread.setZero();
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j) {
        Sym3 unit = Sym3::Zero();
        unit(i, j) = unit(j, i) = i == j ? 1.0 : std::sqrt(0.5);
        const Vector6 one = vector_of(upper.transpose() * unit * upper);
        spread += one * one.transpose();
      }
  }
};

/// Mixes in the least share of the ball that makes Σ adj(A_k), which is linear in the Gram matrix, positive
/// semidefinite.
Squares made_convex(const Squares& p, const Matrix6& ball) {
  const Matrix6 gram = gram_of(p);
  const Sym3 inside = symmetric(adjugate_sum(squares_of(ball).data())),
             own = symmetric(adjugate_sum(p.data()));
  const double margin = 1e-9 * own.norm();
  double low = 0, high = 1;
  if (least_eigenvalue(own) < margin)
    for (int k = 0; k < 60; ++k) {
      const double middle = (low + high) / 2;
      (least_eigenvalue((1 - middle) * own + middle * inside) < margin ? low : high) = middle;
    }
  else
    high = 0;
  const double share = std::max(high, 1e-9);
  return squares_of((1 - share) * gram + share * ball);
}

}  // namespace

QuarticSolution solve_quartic(const std::vector<SlipSample>& samples, const std::array<double, 6>& ellipsoid,
                              SurfaceNoise noise) {
  const Ball ball(ellipsoid);
  QuarticSolution out;
  out.p = squares_of(ball.squared + 0.01 * ball.spread);
  const double size = symmetric(adjugate_sum(out.p.data())).norm();
  ConvexityResidual convexity;
  convexity.penalty = 1e3 / (size * size);
  constexpr int turns = 16, noise_turns = 10;
  double last_gap = 1e300;
  for (int turn = 0; turn < turns; ++turn) {
    ceres::Problem problem;
    add_samples<QuarticTerms>(problem, samples, noise, out.p.data());
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ConvexityResidual, 3, QuarticTerms::parameters>(
                                 new ConvexityResidual(convexity)),
                             nullptr, out.p.data());
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Hold, QuarticTerms::parameters, QuarticTerms::parameters>(new Hold),
        nullptr, out.p.data());
    const Solved solved = solve(problem, 200);
    out.iterations += solved.iterations;
    out.usable = solved.usable;
    if (!solved.usable) return out;
    const Sym3 reached = symmetric(adjugate_sum(out.p.data()));
    const double gap = std::max(0.0, -least_eigenvalue(reached)) / size;
    convexity.update(reached);
    if (gap > 0.25 * last_gap) convexity.penalty *= 4;
    last_gap = gap;
    const SurfaceNoise next = noise_of<QuarticTerms>(samples, out.p.data());
    const bool still = turn >= noise_turns || settled(noise, next);
    if (turn < noise_turns) noise = next;
    if (still && gap < 1e-6) break;
  }
  out.p = made_convex(out.p, ball.squared);
  out.noise = noise;
  return out;
}

std::array<double, 15> quartic_coefficients(const double* p) {
  constexpr int power[6][3] = {{2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {1, 1, 0}, {1, 0, 1}, {0, 1, 1}};
  Squares columns;
  std::copy_n(p, columns.size(), columns.begin());
  const Matrix6 gram = gram_of(columns);
  std::array<double, 15> out{};
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) {
      const int x = power[i][0] + power[j][0], y = power[i][1] + power[j][1];
      const int rest = 4 - x;  // so many monomials' rows have a higher power of w_x before this one
      const double weight = (i < 3 ? 1.0 : std::sqrt(2.0)) * (j < 3 ? 1.0 : std::sqrt(2.0));
      out[static_cast<std::size_t>(rest * (rest + 1) / 2 + rest - y)] += weight * gram(i, j);
    }
  return out;
}

}  // namespace unhand::fitting
