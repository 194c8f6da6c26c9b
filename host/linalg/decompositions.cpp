// SPDX-License-Identifier: Apache-2.0
#include "linalg/decompositions.hpp"

#include <Eigen/Dense>

namespace flexcomp::host {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Ldlt::Ldlt(const MatrixXd& a) : factor_(a) {}
VectorXd Ldlt::solve(const VectorXd& b) const { return factor_.solve(b); }
MatrixXd Ldlt::solve(const MatrixXd& b) const { return factor_.solve(b); }
MatrixXd Ldlt::inverse() const { return solve(MatrixXd(MatrixXd::Identity(factor_.rows(), factor_.cols()))); }

Llt::Llt(const MatrixXd& a) : factor_(a) {}
VectorXd Llt::solve(const VectorXd& b) const { return factor_.solve(b); }
MatrixXd Llt::solve(const MatrixXd& b) const { return factor_.solve(b); }
MatrixXd Llt::inverse() const { return solve(MatrixXd(MatrixXd::Identity(factor_.rows(), factor_.cols()))); }
MatrixXd Llt::lower() const { return factor_.matrixL(); }
VectorXd Llt::diagonal() const { return factor_.matrixLLT().diagonal(); }
double Llt::log_det() const { return 2 * factor_.matrixLLT().diagonal().array().log().sum(); }

MatrixXd inverse(const MatrixXd& a) { return a.inverse(); }

SymmetricEigen symmetric_eigen(const MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(a);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

VectorXd symmetric_eigenvalues(const MatrixXd& a) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

VectorXd singular_values(const MatrixXd& a) { return Eigen::JacobiSVD<MatrixXd>(a).singularValues(); }

MatrixXd upper_factor(const MatrixXd& a) {
  return Eigen::HouseholderQR<MatrixXd>(a).matrixQR().topRows(a.cols()).triangularView<Eigen::Upper>();
}

MatrixXd orthogonal_factor(const MatrixXd& a) { return Eigen::HouseholderQR<MatrixXd>(a).householderQ(); }

MatrixXd orthonormal_basis(const MatrixXd& a) {
  return Eigen::HouseholderQR<MatrixXd>(a).householderQ() * MatrixXd::Identity(a.rows(), a.cols());
}

PivotedQr::PivotedQr(const MatrixXd& a) : factor_(a) {}
VectorXd PivotedQr::solve(const VectorXd& b) const { return factor_.solve(b); }

VectorXd shortest_least_squares(const MatrixXd& a, const VectorXd& b) {
  return Eigen::CompleteOrthogonalDecomposition<MatrixXd>(a).solve(b);
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& a) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace flexcomp::host
