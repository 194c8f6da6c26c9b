// SPDX-License-Identifier: Apache-2.0
/// \file
/// The few products and factors of large dense matrices that a search through a thousand columns consists of, by BLAS
/// and LAPACK (OpenBLAS, one thread: the same numbers every time). Eigen is built without vector instructions here, for
/// the core's sake.
#pragma once

#include <Eigen/Core>

namespace flexcomp::host {

/// a^T b
Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
/// a b
Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
/// a^T a, both triangles
Eigen::MatrixXd gram(const Eigen::MatrixXd& a);

/// Lower Cholesky factor in place (the upper triangle is left as it was). False where the matrix is not positive definite.
bool factor_in_place(Eigen::MatrixXd& symmetric);
/// (L L^T)^-1, both triangles
Eigen::MatrixXd inverse_of_factored(const Eigen::MatrixXd& factor);
/// b <- L^-1 b
void solve_lower(const Eigen::MatrixXd& factor, Eigen::MatrixXd& b);
/// b <- L^-T b
void solve_lower_transposed(const Eigen::MatrixXd& factor, Eigen::MatrixXd& b);
/// b <- b L^-T: columns whose Gram matrix L L^T was are orthonormal then.
void orthonormalise(const Eigen::MatrixXd& factor, Eigen::MatrixXd& b);

}  // namespace flexcomp::host
