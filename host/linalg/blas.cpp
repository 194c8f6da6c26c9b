// SPDX-License-Identifier: Apache-2.0
#include "linalg/blas.hpp"

#include <cblas.h>

extern "C" void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
extern "C" void dpotri_(const char* uplo, const int* n, double* a, const int* lda, int* info);

namespace flexcomp::host {

namespace {

/// The threaded library is needed because only that may be called from several threads; its own threads are not: the
/// order of sums, and with it the last bits of a result, must not depend on the number of processors.
[[maybe_unused]] const bool one_thread_each = (openblas_set_num_threads(1), true);

int whole(Eigen::Index n) { return static_cast<int>(n); }

void solve(const Eigen::MatrixXd& factor, Eigen::MatrixXd& b, CBLAS_SIDE side, CBLAS_TRANSPOSE transposed) {
  if (b.size() == 0) return;
  cblas_dtrsm(CblasColMajor, side, CblasLower, transposed, CblasNonUnit, whole(b.rows()), whole(b.cols()),
              1.0, factor.data(), whole(factor.rows()), b.data(), whole(b.rows()));
}

}  // namespace

Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(a.cols(), b.cols());
  if (out.size() == 0 || a.rows() == 0) return out;
  cblas_dgemm(CblasColMajor, CblasTrans, CblasNoTrans, whole(a.cols()), whole(b.cols()), whole(a.rows()), 1.0,
              a.data(), whole(a.rows()), b.data(), whole(b.rows()), 0.0, out.data(), whole(out.rows()));
  return out;
}

Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(a.rows(), b.cols());
  if (out.size() == 0 || a.cols() == 0) return out;
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, whole(a.rows()), whole(b.cols()), whole(a.cols()),
              1.0, a.data(), whole(a.rows()), b.data(), whole(b.rows()), 0.0, out.data(), whole(out.rows()));
  return out;
}

Eigen::MatrixXd gram(const Eigen::MatrixXd& a) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(a.cols(), a.cols());
  if (a.size() == 0) return out;
  cblas_dsyrk(CblasColMajor, CblasLower, CblasTrans, whole(a.cols()), whole(a.rows()), 1.0, a.data(),
              whole(a.rows()), 0.0, out.data(), whole(out.rows()));
  out.triangularView<Eigen::StrictlyUpper>() = out.transpose();
  return out;
}

bool factor_in_place(Eigen::MatrixXd& symmetric) {
  const int n = whole(symmetric.rows());
  if (n == 0) return true;
  int info = 0;
  const char lower = 'L';
  dpotrf_(&lower, &n, symmetric.data(), &n, &info);
  return info == 0;
}

Eigen::MatrixXd inverse_of_factored(const Eigen::MatrixXd& factor) {
  Eigen::MatrixXd out = factor;
  const int n = whole(factor.rows());
  if (n == 0) return out;
  int info = 0;
  const char lower = 'L';
  dpotri_(&lower, &n, out.data(), &n, &info);
  out.triangularView<Eigen::StrictlyUpper>() = out.transpose();
  return out;
}

void solve_lower(const Eigen::MatrixXd& factor, Eigen::MatrixXd& b) {
  solve(factor, b, CblasLeft, CblasNoTrans);
}

void solve_lower_transposed(const Eigen::MatrixXd& factor, Eigen::MatrixXd& b) {
  solve(factor, b, CblasLeft, CblasTrans);
}

void orthonormalise(const Eigen::MatrixXd& factor, Eigen::MatrixXd& b) {
  solve(factor, b, CblasRight, CblasTrans);
}

}  // namespace flexcomp::host
