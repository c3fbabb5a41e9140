// The inverse of small matrices, dense and sparse, against Eigen's LU.
#include "dynamics/small_inverse.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

namespace unhand::dynamics {
namespace {

struct LuReference {
  double condition;
  Eigen::VectorXd solution;
};
LuReference lu_reference(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) {
  const Eigen::PartialPivLU<Eigen::MatrixXd> lu(matrix);
  return {matrix.norm() * lu.inverse().norm(), lu.solve(right)};
}

template <int N>
void compare(double share_of_zeros) {
  std::mt19937_64 random(N);
  std::uniform_real_distribution<double> uniform(-1, 1), chance(0, 1);
  for (int trial = 0; trial < 500; ++trial) {
    double a[N][N];
    Eigen::MatrixXd matrix(N, N);
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j)
        matrix(i, j) = a[i][j] = chance(random) < share_of_zeros ? 0 : uniform(random);
    typename SmallInverse<N>::Vector x{}, y{};
    Eigen::VectorXd right(N);
    for (int i = 0; i < N; ++i) right(i) = x[i] = uniform(random);
    const auto [condition, expected] = lu_reference(matrix, right);
    if (!(condition < 1e6)) continue;
    SmallInverse<N> inverse;
    inverse.compute(a);
    inverse.multiply(x, y);
    // Both err by a few ε times the condition number.
    for (int i = 0; i < N; ++i)
      EXPECT_NEAR(y[i], expected(i), 1e-14 * condition * expected.norm()) << "N " << N << " trial " << trial;
  }
}

TEST(SmallInverse, SolvesLikeLu) {
  for (const double zeros : {0.0, 0.4}) {
    compare<1>(zeros);
    compare<2>(zeros);
    compare<3>(zeros);
    compare<6>(zeros);
    compare<7>(zeros);
  }
}

TEST(SmallInverse, SingularIsNotFinite) {
  const double a[2][2] = {{1, 2}, {2, 4}};
  SmallInverse<2> inverse;
  inverse.compute(a);
  SmallInverse<2>::Vector x{1, 1}, y{};
  inverse.multiply(x, y);
  EXPECT_FALSE(std::isfinite(y[0] + y[1]));
}

}  // namespace
}  // namespace unhand::dynamics
