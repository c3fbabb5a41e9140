// What the small solvers promise: in the units of the unknowns, where something is not determined, and of
// nothing at all.
#include "dynamics/dense_solve.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using namespace unhand::dynamics;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A symmetric matrix of rank 2 over unknowns whose units differ by 1e8.
MatrixXd singular() {
  MatrixXd F(2, 3);
  F << 1e4, 2e-4, 1, -2e4, 1e-4, 3;
  return gram(F);
}

TEST(DenseSolve, ThePseudoInverseInvertsWhatIsDetermined) {
  const MatrixXd A = singular(), P = pseudo_inverse(A);
  const VectorXd unit = A.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd left = unit.asDiagonal() * MatrixXd(A * P * A - A) * unit.asDiagonal();
  EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-12);  // rounding, in units in which A's diagonal is one
  EXPECT_LT(MatrixXd(P - P.transpose()).norm(), 1e-12 * P.norm());
}

TEST(DenseSolve, AnUnknownThatNothingDependsOnStaysAtZero) {
  MatrixXd A = MatrixXd::Zero(3, 3);
  A(0, 0) = 4, A(2, 2) = 1e-12;
  VectorXd b(3);
  b << 8, 5, 3e-12;
  const VectorXd x = pseudo_solve(A, b);
  EXPECT_NEAR(x[0], 2, 1e-12);
  EXPECT_EQ(x[1], 0);
  EXPECT_NEAR(x[2], 3, 1e-12);
}

// The minimum on a cone: no allowed step is downhill (Karush, Kuhn and Tucker).
TEST(DenseSolve, SidedUnknownsStayOnTheirSide) {
  MatrixXd F(5, 3);
  F << 1, 2, 0, 0, 1, 3, 2, 0, 1, 1, 1, 1, 0, 2, 1;
  VectorXd y(5);
  y << 1, -4, 2, 0, -3;
  const MatrixXd A = gram(F);
  const VectorXd b = F.transpose() * y;
  for (const std::vector<int>& sides :
       {std::vector<int>{0, 0, 0}, {1, 1, 1}, {-1, 1, 0}, {-1, -1, -1}, {1, 0, 1}}) {
    const VectorXd x = pseudo_solve(A, b, sides), slope = A * x - b;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const int side = sides[static_cast<std::size_t>(k)];
      EXPECT_GE(side * x[k], 0);
      if (side == 0 || x[k] != 0)
        EXPECT_NEAR(slope[k], 0, 1e-8) << k;
      else
        EXPECT_GE(side * slope[k], 0) << k;
    }
  }
}

TEST(DenseSolve, EliminationLeavesTheBlockOfTheInverse) {
  MatrixXd F(5, 4);
  F << 1, 2, 0, 1, 0, 1, 3, 2, 2, 0, 1, 1, 1, 1, 1, 0, 0, 2, 1, 4;
  const MatrixXd G = gram(F);
  const MatrixXd rest = eliminated(G, 2), covariance = definite_inverse(G).bottomRightCorner(2, 2);
  EXPECT_LT(MatrixXd(rest * covariance - MatrixXd::Identity(2, 2)).norm(), 1e-12);
  EXPECT_EQ(eliminated(G, 0), G);
}

TEST(DenseSolve, LeastSquaresLeavesTheResidualNormalToTheColumns) {
  MatrixXd A(4, 3);
  A << 1, 1e6, 1, 1, 2e6, 1, 1, 3e6, 1, 1, 5e6, 1;  // the last column is the first again
  VectorXd b(4);
  b << 1, 0, 2, 5;
  const VectorXd x = least_squares(A, b), left = b - A * x;
  EXPECT_LT(std::abs(A.col(0).dot(left)), 1e-12);
  EXPECT_LT(std::abs(A.col(1).dot(left)), 1e-6);
  const MatrixXd Q = orthonormal_basis(A);
  ASSERT_EQ(Q.cols(), 2);
  EXPECT_LT(MatrixXd(gram(Q) - MatrixXd::Identity(2, 2)).norm(), 1e-14);
  EXPECT_LT(VectorXd(Q.transpose() * left).norm(), 1e-12);
}

TEST(DenseSolve, TheSpectrumRebuildsItsMatrix) {
  MatrixXd A(4, 4);
  A << 0, 3, 1, 0, 3, 0, 2, 0, 1, 2, -5, 1e-9, 0, 0, 1e-9, 1e-12;  // of either sign, and of thirteen decades
  const Spectrum s = spectrum_of(A);
  EXPECT_LT(MatrixXd(gram(s.vectors) - MatrixXd::Identity(4, 4)).norm(), 1e-14);
  EXPECT_LT(MatrixXd(congruent(s.vectors, s.values.asDiagonal()) - A).norm(), 1e-14 * A.norm());
  for (Eigen::Index k = 1; k < 4; ++k) EXPECT_LE(s.values[k - 1], s.values[k]);
}

TEST(DenseSolve, SingularVectorsRebuildTheNormalEquations) {
  MatrixXd A(5, 3);
  A << 1, 2, 3, 0, 1, 1, 2, 0, 2, 1, 1, 2, 0, 2, 2;  // the last column is the sum of the others
  VectorXd b(5);
  b << 1, -4, 2, 0, -3;
  const SingularVectors s = singular_vectors(A, b);
  const MatrixXd V = s.right, S = s.values.asDiagonal();
  EXPECT_LT(MatrixXd(gram(V) - MatrixXd::Identity(3, 3)).norm(), 1e-14);
  EXPECT_LT(MatrixXd(congruent(V, product(S, S)) - gram(A)).norm(), 1e-13 * gram(A).norm());
  EXPECT_LT(VectorXd(V * s.values.cwiseProduct(s.left_times_b) - A.transpose() * b).norm(),
            1e-13);  // Aᵀ = V S Uᵀ
  EXPECT_LT(s.values[2], 1e-15 * s.values[0]);
}

TEST(DenseSolve, TheInverseOfAGramMatrixAndItsDeterminant) {
  MatrixXd A(4, 2);
  A << 1, 1e6, 1, 2e6, 1, 3e6, 1, 5e6;
  const VectorXd b = VectorXd::LinSpaced(4, -1, 2);
  const auto [x, inverse] = least_squares_with_covariance(A, b);
  EXPECT_EQ(x, least_squares(A, b));
  EXPECT_LT(MatrixXd(gram(A) * inverse - MatrixXd::Identity(2, 2)).cwiseAbs().maxCoeff(), 1e-8);
  EXPECT_NEAR(log_determinant(gram(A)), std::log(35e12), 1e-12);  // 4 Σt² − (Σt)²
  MatrixXd twice(4, 3);
  twice << A, A.col(0);
  const LeastSquares dependent = least_squares_with_covariance(twice, b);
  EXPECT_EQ(dependent.solution, least_squares(twice, b));
  EXPECT_EQ(dependent.covariance.size(), 0);
}

TEST(DenseSolve, OfNothingComesNothing) {
  const MatrixXd none(0, 0), columns(3, 0);
  EXPECT_EQ(pseudo_inverse(none).size(), 0);
  EXPECT_EQ(pseudo_solve(none, VectorXd()).size(), 0);
  EXPECT_EQ(spectrum_of(none).values.size(), 0);
  EXPECT_EQ(gram(columns).size(), 0);
  EXPECT_EQ(least_squares(columns, VectorXd::Ones(3)).rows(), 0);
  EXPECT_EQ(orthonormal_basis(columns).cols(), 0);
  EXPECT_EQ(definite_solve(MatrixXd::Identity(2, 2), MatrixXd::Zero(2, 0)).cols(), 0);
  EXPECT_EQ(product(columns, MatrixXd::Zero(0, 2)), MatrixXd(MatrixXd::Zero(3, 2)));
}

}  // namespace
