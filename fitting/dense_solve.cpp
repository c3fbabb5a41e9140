#include "fitting/dense_solve.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace unhand::fitting {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kDependent = 1e-10;
constexpr double kRounding = std::numeric_limits<double>::epsilon();

/// What brings a diagonal of squares to one.
VectorXd units_of(const VectorXd& squares) { return squares.cwiseMax(1e-300).cwiseSqrt().cwiseInverse(); }

/// QR of columns of length one.
struct ScaledColumns {
  VectorXd unit;
  Eigen::ColPivHouseholderQR<MatrixXd> qr;
  explicit ScaledColumns(const MatrixXd& A)
      : unit(A.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse()),
        qr(MatrixXd(A * unit.asDiagonal())) {
    qr.setThreshold(kDependent);
  }
};

}  // namespace

MatrixXd pseudo_inverse(const MatrixXd& A) {
  if (A.cols() == 0) return A;
  const VectorXd unit = units_of(A.diagonal());
  const Spectrum s = spectrum_of(unit.asDiagonal() * A * unit.asDiagonal());
  const double none = kRounding * static_cast<double>(A.cols()) * s.values.cwiseAbs().maxCoeff();
  MatrixXd roots = unit.asDiagonal() * s.vectors;
  for (Index k = 0; k < roots.cols(); ++k)
    roots.col(k) *= s.values[k] > none ? 1 / std::sqrt(s.values[k]) : 0;
  return roots * roots.transpose();
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

MatrixXd definite_inverse(const MatrixXd& H) {
  return definite_solve(H, MatrixXd::Identity(H.rows(), H.cols()));
}

MatrixXd product(const MatrixXd& A, const MatrixXd& B) {
  if (A.size() == 0 || B.size() == 0) return MatrixXd::Zero(A.rows(), B.cols());
  return A * B;
}

MatrixXd gram(const MatrixXd& A) { return inner_products(A, A); }

MatrixXd inner_products(const MatrixXd& A, const MatrixXd& B) {
  if (A.size() == 0 || B.size() == 0) return MatrixXd::Zero(A.cols(), B.cols());
  return A.transpose() * B;
}

MatrixXd congruent(const MatrixXd& A, const MatrixXd& B) {
  if (A.size() == 0) return MatrixXd::Zero(A.rows(), A.rows());
  return A * B * A.transpose();
}

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

MatrixXd least_squares(const MatrixXd& A, const MatrixXd& B) {
  if (A.cols() == 0 || B.cols() == 0) return MatrixXd::Zero(A.cols(), B.cols());
  const ScaledColumns columns(A);
  const MatrixXd x = columns.qr.solve(B);
  return columns.unit.asDiagonal() * x;
}

MatrixXd orthonormal_basis(const MatrixXd& A) {
  if (A.cols() == 0) return MatrixXd::Zero(A.rows(), 0);
  const ScaledColumns columns(A);
  return columns.qr.householderQ() * MatrixXd::Identity(A.rows(), columns.qr.rank());
}

}  // namespace unhand::fitting
