// Small dense linear algebra, compiled once: inverses of normal equations that may be singular, elimination,
// spectra, least squares. Empty matrices give empty answers.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace unhand::dynamics {

/// The Moore-Penrose inverse of a symmetric positive semidefinite A in units in which its diagonal is one,
/// since parameters differ by orders of magnitude: D (D A D)⁺ D, D = diag(A)^(-1/2). Directions that A does
/// not determine have none: zero there.
Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& A);

/// The least x, in the same units, that minimises xᵀAx − 2 bᵀx; zero where A's diagonal is.
Eigen::VectorXd pseudo_solve(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// The same where x_k may not be negative (`sides[k]` 1), not positive (−1), or is free (0): by coordinate
/// descent, which converges, since the problem is convex.
Eigen::VectorXd pseudo_solve(const Eigen::MatrixXd& A, const Eigen::VectorXd& b,
                             const std::vector<int>& sides);

/// H⁻¹ B for a symmetric positive definite H (LDLᵀ). Where H is singular the answer is not finite or large:
/// callers add a prior to H's diagonal, or ask allFinite().
Eigen::MatrixXd definite_solve(const Eigen::MatrixXd& H, const Eigen::MatrixXd& B);
Eigen::MatrixXd definite_inverse(const Eigen::MatrixXd& H);
/// ln det H of the same; NaN where H is not positive definite.
double log_determinant(const Eigen::MatrixXd& H);

/// A B, AᵀA, AᵀB and A B Aᵀ.
Eigen::MatrixXd product(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);
Eigen::MatrixXd gram(const Eigen::MatrixXd& A);
Eigen::MatrixXd inner_products(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);
Eigen::MatrixXd congruent(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// The Gram matrix of the columns that remain when the first n are eliminated: G_ff − G_fo G_oo⁻¹ G_of. Of
/// normal equations, the residual being the last column, this is information and gradient without the first n
/// unknowns. G_oo is definite: priors are in it as measurements.
Eigen::MatrixXd eliminated(const Eigen::MatrixXd& G, Eigen::Index n);

/// Eigenvalues in increasing order and their orthonormal vectors (columns) of a symmetric matrix.
struct Spectrum {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
Spectrum spectrum_of(const Eigen::MatrixXd& A);

/// A = U S Vᵀ of a matrix with no fewer rows than columns.
struct SingularVectors {
  Eigen::VectorXd values;        ///< S, in decreasing order, as many as A has columns
  Eigen::MatrixXd right;         ///< V, square even where the rank of A is less
  Eigen::VectorXd left_times_b;  ///< Uᵀ b
};
/// By way of A P = Q R, for A is tall.
SingularVectors singular_vectors(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// The X that minimises |A X − B| column by column; A's columns are scaled to one first, and what of them
/// depends on others to 1e-10 gets zero.
Eigen::MatrixXd least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// The same X and, without squaring the condition number, its covariance where B has unit noise.
struct LeastSquares {
  Eigen::MatrixXd solution;    ///< X
  Eigen::MatrixXd covariance;  ///< (AᵀA)⁻¹; empty where columns depend on others (by the same measure)
};
/// Both from one decomposition of A, which has columns.
LeastSquares least_squares_with_covariance(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// An orthonormal basis of the span of A's columns, of as many columns as A has rank (by the same measure).
Eigen::MatrixXd orthonormal_basis(const Eigen::MatrixXd& A);

}  // namespace unhand::dynamics
