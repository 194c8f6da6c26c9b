// SPDX-License-Identifier: Apache-2.0
#include "planning/criterion.hpp"

#include <cmath>

#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

/// An update rounds by about 1e-16 times the condition of M, and the errors accumulate.
constexpr int updates_per_refresh = 32;

/// True where an update changes the information of some direction by orders of magnitude, which costs its digits:
/// refactorise then.
bool loses_digits(const Llt& llt) {
  const Eigen::VectorXd diagonal = llt.diagonal();
  return !llt.is_positive_definite() || diagonal.minCoeff() < 1e-2 || diagonal.maxCoeff() > 1e2;
}

/// Computes log det G and tr(G⁻¹ S) for symmetric G and S.
template <int R>
void small_solve(const Eigen::Matrix<double, R, R>& g, const Eigen::Matrix<double, R, R>& s, double& log_det,
                 double& trace) {
  // Cholesky decomposition of G, unrolled for R = 3 or 6: this runs for every candidate.
  Eigen::Matrix<double, R, R> l = g;
  double det = 1;
  for (int j = 0; j < R; ++j) {
    double d = l(j, j);
    for (int k = 0; k < j; ++k) d -= l(j, k) * l(j, k);
    det *= d;
    d = std::sqrt(d);
    l(j, j) = d;
    for (int i = j + 1; i < R; ++i) {
      double v = l(i, j);
      for (int k = 0; k < j; ++k) v -= l(i, k) * l(j, k);
      l(i, j) = v / d;
    }
  }
  log_det = std::log(det);
  // tr(G⁻¹ S) = tr(L⁻¹ S L⁻ᵀ): solve for the columns, then for the diagonal of the rows.
  Eigen::Matrix<double, R, R> x = s;
  for (int c = 0; c < R; ++c) {
    for (int i = 0; i < R; ++i) {
      double v = x(i, c);
      for (int k = 0; k < i; ++k) v -= l(i, k) * x(k, c);
      x(i, c) = v / l(i, i);
    }
  }
  trace = 0;
  for (int i = 0; i < R; ++i) {
    // Row i of L⁻¹ S, times L⁻ᵀ, up to element i.
    for (int c = 0; c <= i; ++c) {
      double v = x(i, c);
      for (int k = 0; k < c; ++k) v -= l(c, k) * x(i, k);
      x(i, c) = v / l(c, c);
    }
    trace += x(i, i);
  }
}

}  // namespace

double Criterion::o1(const Figures& f) const {
  return std::exp(f.log_det / (2 * static_cast<double>(parameters))) / std::sqrt(poses);
}

double Criterion::fitness(const Figures& f) const { return f.trace / o1(f); }

double Criterion::log_score(const Figures& f) const {
  const double log_o1 = f.log_det / (2 * static_cast<double>(parameters)) - 0.5 * std::log(poses);
  return goal == Goal::dual ? std::log(f.trace) - log_o1 : -log_o1;
}

Information::Information(Eigen::Index nuisance, Eigen::Index parameters, double prior)
    : prior_(prior), v_nuisance_(nuisance, nuisance) {
  assign(Eigen::MatrixXd::Zero(nuisance + parameters, nuisance + parameters));
}

void Information::assign(const Eigen::MatrixXd& m) {
  m_ = m;
  m_.diagonal().array() += prior_;
  refresh();
}

void Information::refresh() {
  updates_ = 0;
  const Eigen::Index f = nuisance();
  const Llt llt(m_);
  v_ = llt.inverse();
  figures_.trace = v_.diagonal().tail(parameters()).sum();
  figures_.log_det = llt.log_det();
  if (f > 0) {
    const Llt own(m_.topLeftCorner(f, f));
    v_nuisance_ = own.inverse();
    figures_.log_det -= own.log_det();
  }
}

void Information::update(const Block& h, double sign) {
  m_.noalias() += sign * h * h.transpose();
  if (++updates_ >= updates_per_refresh) return refresh();
  const Eigen::Index r = h.cols();
  const Block vh = v_ * h;
  const Eigen::MatrixXd g = Eigen::MatrixXd::Identity(r, r) + sign * h.transpose() * vh;
  const Llt llt(g);
  if (loses_digits(llt)) return refresh();
  v_.noalias() -= sign * vh * llt.solve(Eigen::MatrixXd(vh.transpose()));
  figures_.trace = v_.diagonal().tail(parameters()).sum();
  figures_.log_det += llt.log_det();
  const Eigen::Index f = nuisance();
  if (f == 0) return;
  const Eigen::MatrixXd own = h.topRows(f);
  const Eigen::MatrixXd own_vh = v_nuisance_ * own;
  const Llt own_llt(Eigen::MatrixXd::Identity(r, r) + sign * own.transpose() * own_vh);
  if (loses_digits(own_llt)) return refresh();
  v_nuisance_.noalias() -= sign * own_vh * own_llt.solve(Eigen::MatrixXd(own_vh.transpose()));
  figures_.log_det -= own_llt.log_det();
}

template <int R, class H, class VH>
Figures Information::changed(const H& h, const VH& vh) const {
  const Eigen::Index f = nuisance();
  const Eigen::Index p = parameters();
  Eigen::Matrix<double, R, R> g;
  Eigen::Matrix<double, R, R> s;
  for (int i = 0; i < R; ++i) {
    for (int j = 0; j <= i; ++j) {
      g(i, j) = g(j, i) = h.col(i).dot(vh.col(j)) + (i == j ? 1.0 : 0.0);
      s(i, j) = s(j, i) = vh.col(i).tail(p).dot(vh.col(j).tail(p));
    }
  }
  double log_det = 0;
  double trace = 0;
  small_solve<R>(g, s, log_det, trace);
  Figures out{figures_.trace - trace, figures_.log_det + log_det};
  if (f > 0) {
    const Eigen::Matrix<double, Eigen::Dynamic, R, Eigen::ColMajor, 12, R> own = h.topRows(f);
    const Eigen::Matrix<double, Eigen::Dynamic, R, Eigen::ColMajor, 12, R> own_vh = v_nuisance_ * own;
    g.noalias() = own.transpose() * own_vh;
    g.diagonal().array() += 1;
    small_solve<R>(g, s, log_det, trace);
    out.log_det -= log_det;
  }
  return out;
}

Figures Information::with(const Block& h) const {
  Block vh(h.rows(), h.cols());
  vh.noalias() = v_ * h;
  return h.cols() == 6 ? changed<6>(h, vh) : changed<3>(h, vh);
}

void Information::with_each(const Eigen::MatrixXd& blocks, Eigen::Index rows,
                            std::vector<Figures>& out) const {
  constexpr Eigen::Index at_once = 64;  // poses: fits into the first-level cache
  const Eigen::Index count = blocks.cols() / rows;
  out.resize(static_cast<std::size_t>(count));
  Eigen::MatrixXd vh(blocks.rows(), at_once * rows);
  for (Eigen::Index first = 0; first < count; first += at_once) {
    const Eigen::Index some = std::min(at_once, count - first);
    const auto h = blocks.middleCols(first * rows, some * rows);
    vh.leftCols(some * rows).noalias() = v_ * h;
    for (Eigen::Index k = 0; k < some; ++k) {
      out[static_cast<std::size_t>(first + k)] =
          rows == 6 ? changed<6>(h.middleCols<6>(6 * k), vh.middleCols<6>(6 * k))
                    : changed<3>(h.middleCols<3>(3 * k), vh.middleCols<3>(3 * k));
    }
  }
}

Eigen::MatrixXd Information::gradient(const Criterion& criterion) const {
  const Eigen::Index f = nuisance();
  const double half = 0.5 / static_cast<double>(parameters());
  Eigen::MatrixXd out = -half * v_;
  if (f > 0) out.topLeftCorner(f, f) += half * v_nuisance_;
  if (criterion.goal == Goal::dual) {
    const auto tail = v_.rightCols(parameters());
    out.noalias() -= tail * tail.transpose() / figures_.trace;
  }
  return out;
}

Eigen::MatrixXd sum_of_squares(const std::vector<Block>& blocks, Eigen::Index unknowns) {
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(unknowns, unknowns);
  for (const Block& h : blocks) m.noalias() += h * h.transpose();
  return m;
}

ExactFigures exact_figures(const std::vector<Block>& blocks, Eigen::Index nuisance) {
  ExactFigures out;
  Eigen::Index rows = 0;
  for (const Block& h : blocks) rows += h.cols();
  if (blocks.empty() || rows < blocks.front().rows()) return out;
  const Eigen::Index unknowns = blocks.front().rows();
  Eigen::MatrixXd h(rows, unknowns);
  rows = 0;
  for (const Block& b : blocks) {
    h.middleRows(rows, b.cols()) = b.transpose();
    rows += b.cols();
  }
  // Columns in their order, frames first: the lower right corner of R is that of the Schur complement.
  const Eigen::MatrixXd r = upper_factor(h);
  const Eigen::Index p = unknowns - nuisance;
  for (Eigen::Index c = 0; c < unknowns; ++c) {
    if (!(std::abs(r(c, c)) > 1e-10 * h.col(c).norm())) return out;
  }
  out.full_rank = true;
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(p, p);
  solve_lower_transposed(r.bottomRightCorner(p, p).transpose(), inverse);
  out.sigma = inverse.rowwise().norm();
  out.figures.trace = out.sigma.squaredNorm();
  out.figures.log_det = 2 * r.diagonal().tail(p).cwiseAbs().array().log().sum();
  return out;
}

}  // namespace flexcomp::host
