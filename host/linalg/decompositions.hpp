// SPDX-License-Identifier: Apache-2.0
/// \file
/// Decompositions of dense matrices (Eigen's), instantiated once: in every source that uses them they would cost several
/// seconds to compile.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/QR>

namespace flexcomp::host {

/// A = P^T L D L^T P with A symmetric and semidefinite; its lower triangle is read.
class Ldlt {
 public:
  explicit Ldlt(const Eigen::MatrixXd& a);
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const;
  Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;
  Eigen::MatrixXd inverse() const;

 private:
  Eigen::LDLT<Eigen::MatrixXd> factor_;
};

/// A = L L^T with A symmetric and positive definite; its lower triangle is read.
class Llt {
 public:
  explicit Llt(const Eigen::MatrixXd& a);
  bool is_positive_definite() const { return factor_.info() == Eigen::Success; }
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const;
  Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;
  Eigen::MatrixXd inverse() const;
  /// L
  Eigen::MatrixXd lower() const;
  /// Elements of L on the diagonal.
  Eigen::VectorXd diagonal() const;
  /// log det A
  double log_det() const;

 private:
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

/// A^-1 by LU with partial pivoting.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& a);

/// A = V diag(values) V^T with A symmetric, values ascending.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& a);
/// The eigenvalues alone, ascending: a third of the work.
Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& a);

/// Singular values, descending.
Eigen::VectorXd singular_values(const Eigen::MatrixXd& a);

/// R of A = Q R with as many rows as A has columns. A has at least as many rows as columns.
Eigen::MatrixXd upper_factor(const Eigen::MatrixXd& a);
/// Q of A = Q R, square.
Eigen::MatrixXd orthogonal_factor(const Eigen::MatrixXd& a);
/// The first columns of Q, as many as A has: an orthonormal basis of the columns of A.
Eigen::MatrixXd orthonormal_basis(const Eigen::MatrixXd& a);

/// A P = Q R with column pivoting.
class PivotedQr {
 public:
  explicit PivotedQr(const Eigen::MatrixXd& a);
  /// x that minimises |A x - b|
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const;

 private:
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor_;
};

/// The shortest of all x that minimise |A x - b|.
Eigen::VectorXd shortest_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

/// The rotation R that maximises tr(R^T A) (Kabsch). Where A has rank 2, as for points in a plane, the determinant says
/// which way the third direction points.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& a);

}  // namespace flexcomp::host
