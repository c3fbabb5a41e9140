#include "dynamics/dense_solve.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace unhand::dynamics {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kDependent = 1e-10;
constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// What brings a diagonal of squares to one.
VectorXd units_of(const VectorXd& squares) { return squares.cwiseMax(1e-300).cwiseSqrt().cwiseInverse(); }

VectorXd units_of_columns(const MatrixXd& A) { return units_of(A.colwise().squaredNorm().transpose()); }

/// A D P = Q R, the diagonal D given. Eigen's own products with Q, in blocks, take longer to compile than all
/// the rest here.
struct PivotedColumns {
  VectorXd unit;  ///< D
  Eigen::ColPivHouseholderQR<MatrixXd> qr;
  PivotedColumns(const MatrixXd& A, VectorXd diagonal)
      : unit(std::move(diagonal)), qr(MatrixXd(A * unit.asDiagonal())) {
    qr.setThreshold(kDependent);
  }
  /// One reflection of Q, to the rows that it changes.
  void reflect(Index k, MatrixXd& B) const {
    VectorXd workspace(B.cols());
    const Index below = B.rows() - k - 1;
    B.bottomRows(below + 1).applyHouseholderOnTheLeft(qr.matrixQR().col(k).tail(below), qr.hCoeffs()[k],
                                                      workspace.data());
  }
  /// Q B for as many rows of B as A has
  MatrixXd turned(MatrixXd B) const {
    for (Index k = qr.hCoeffs().size(); k-- > 0;) reflect(k, B);
    return B;
  }
  /// Qᵀ B
  MatrixXd turned_back(MatrixXd B) const {
    for (Index k = 0; k < qr.hCoeffs().size(); ++k) reflect(k, B);
    return B;
  }
  /// D P R⁻¹ B for the columns that do not depend on others; zero for those that do.
  MatrixXd solved(const MatrixXd& B) const {
    const Index rank = qr.rank();
    const MatrixXd top =
        qr.matrixQR().topLeftCorner(rank, rank).triangularView<Eigen::Upper>().solve(B.topRows(rank));
    MatrixXd x = MatrixXd::Zero(unit.size(), B.cols());
    for (Index k = 0; k < rank; ++k) {
      const Index column = qr.colsPermutation().indices()[k];
      x.row(column) = unit[column] * top.row(k);
    }
    return x;
  }
};

}  // namespace

MatrixXd pseudo_inverse(const MatrixXd& A) {
  if (A.cols() == 0) return A;
  const VectorXd unit = units_of(A.diagonal());
  const Spectrum s = spectrum_of(unit.asDiagonal() * A * unit.asDiagonal());
  const double none = kEpsilon * static_cast<double>(A.cols()) * s.values.cwiseAbs().maxCoeff();
  MatrixXd roots = unit.asDiagonal() * s.vectors;
  for (Index k = 0; k < roots.cols(); ++k)
    roots.col(k) *= s.values[k] > none ? 1 / std::sqrt(s.values[k]) : 0;
  return product(roots, roots.transpose());
}

VectorXd pseudo_solve(const MatrixXd& A, const VectorXd& b) {
  if (A.cols() == 0) return VectorXd();
  VectorXd x = pseudo_inverse(A) * b;
  for (Index k = 0; k < x.size(); ++k)
    if (!(A(k, k) > 0)) x[k] = 0;
  return x;
}

VectorXd pseudo_solve(const MatrixXd& A, const VectorXd& b, const std::vector<int>& sides) {
  VectorXd x = pseudo_solve(A, b);
  const auto allowed = [&](Index k, double value) {
    return sides[static_cast<std::size_t>(k)] * value < 0 ? 0 : value;
  };
  bool outside = false;
  for (Index k = 0; k < x.size(); ++k) outside |= allowed(k, x[k]) != x[k];
  if (!outside) return x;
  for (Index k = 0; k < x.size(); ++k) x[k] = allowed(k, x[k]);
  constexpr int kMostSweeps = 500;
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    double moved = 0;  // the largest step, by what it takes off the minimum
    for (Index k = 0; k < x.size(); ++k) {
      if (!(A(k, k) > 0)) continue;
      const double next = allowed(k, x[k] + (b[k] - A.row(k).dot(x)) / A(k, k));
      moved = std::max(moved, A(k, k) * (next - x[k]) * (next - x[k]));
      x[k] = next;
    }
    if (!(moved > 1e-20 * std::abs(b.dot(x)))) break;
  }
  return x;
}

MatrixXd definite_solve(const MatrixXd& H, const MatrixXd& B) {
  if (H.cols() == 0 || B.cols() == 0) return MatrixXd::Zero(H.cols(), B.cols());
  return Eigen::LDLT<MatrixXd>(H).solve(B);
}

double log_determinant(const MatrixXd& H) { return Eigen::LDLT<MatrixXd>(H).vectorD().array().log().sum(); }

MatrixXd definite_inverse(const MatrixXd& H) {
  return definite_solve(H, MatrixXd::Identity(H.rows(), H.cols()));
}

MatrixXd product(const MatrixXd& A, const MatrixXd& B) {
  if (A.size() == 0 || B.size() == 0) return MatrixXd::Zero(A.rows(), B.cols());
  return A * B;
}

MatrixXd gram(const MatrixXd& A) { return inner_products(A, A); }

MatrixXd inner_products(const MatrixXd& A, const MatrixXd& B) { return product(A.transpose(), B); }

MatrixXd congruent(const MatrixXd& A, const MatrixXd& B) { return product(product(A, B), A.transpose()); }

MatrixXd eliminated(const MatrixXd& G, Index n) {
  const Index f = G.cols() - n;
  const MatrixXd cross = G.topRightCorner(n, f);
  return G.bottomRightCorner(f, f) - inner_products(cross, definite_solve(G.topLeftCorner(n, n), cross));
}

Spectrum spectrum_of(const MatrixXd& A) {
  if (A.cols() == 0) return {VectorXd(), A};
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

SingularVectors singular_vectors(const MatrixXd& A, const VectorXd& b) {
  const Index n = A.cols();
  const PivotedColumns columns(A, VectorXd::Ones(n));
  const MatrixXd R = columns.qr.matrixR().topLeftCorner(n, n).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<MatrixXd, Eigen::NoQRPreconditioner> svd(R,
                                                                  Eigen::ComputeFullU | Eigen::ComputeFullV);
  MatrixXd right(n, n);
  for (Index k = 0; k < n; ++k) right.row(columns.qr.colsPermutation().indices()[k]) = svd.matrixV().row(k);
  return {svd.singularValues(), right, inner_products(svd.matrixU(), columns.turned_back(b).topRows(n))};
}

MatrixXd least_squares(const MatrixXd& A, const MatrixXd& B) {
  if (A.cols() == 0 || B.cols() == 0) return MatrixXd::Zero(A.cols(), B.cols());
  const PivotedColumns columns(A, units_of_columns(A));
  return columns.solved(columns.turned_back(B));
}

LeastSquares least_squares_with_covariance(const MatrixXd& A, const MatrixXd& B) {
  const PivotedColumns columns(A, units_of_columns(A));
  LeastSquares out{columns.solved(columns.turned_back(B)), MatrixXd()};
  if (columns.qr.rank() < A.cols()) return out;
  const MatrixXd root = columns.solved(MatrixXd::Identity(A.cols(), A.cols()));
  out.covariance = product(root, root.transpose());
  return out;
}

MatrixXd orthonormal_basis(const MatrixXd& A) {
  if (A.cols() == 0) return MatrixXd::Zero(A.rows(), 0);
  const PivotedColumns columns(A, units_of_columns(A));
  return columns.turned(MatrixXd::Identity(A.rows(), columns.qr.rank()));
}

}  // namespace unhand::dynamics
