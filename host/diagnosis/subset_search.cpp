// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/subset_search.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "linalg/blas.hpp"
#include "model/effects/descriptor.hpp"

namespace flexcomp::host {

namespace {

constexpr double minus_infinity = -std::numeric_limits<double>::infinity();

/// Weak prior precision (per square unit: some hundred usual sizes), and its least share of a column's own information.
/// It bounds directions that a subset leaves undetermined: the sum of a curve's splines, an axis wobble on a tilted base.
constexpr double hardly_bound = 1e-4;
constexpr double nearly_free = 1e-8;

/// Squared share of a column outside the span of others below which it counts as spanned by them.
constexpr double spanned = 1e-6;

/// The Occam factor of the evidence (D3): -ln of the block's part of the determinant, from `from` on in the Cholesky factor.
void subtract_evidence_cost(double& gain, const Block& block, const Eigen::MatrixXd& factor,
                            Eigen::Index from) {
  if (!(block.precision > 0)) return;
  for (Eigen::Index k = from; k < from + static_cast<Eigen::Index>(block.columns.size()); ++k)
    gain -= std::log(std::pow(factor(k, k), 2) / block.precision);
}

/// Whether the function's members span the effect.
bool is_part_of(const Block& function, const EffectId& id) {
  if (id.joint != function.function_joint) return false;
  const auto follows = [&](unsigned joint) {
    return std::ranges::find(function.function_readings, joint) != function.function_readings.end();
  };
  const EffectDescriptor& d = descriptor(id.effect);
  if (d.in_paper_model || d.place(id) != Place{static_cast<std::uint8_t>(id.joint), slot::theta})
    return false;
  const Follows of = d.follows(id);
  if (of.covariate == Covariate::payload) return function.function_load;
  return of.covariate == Covariate::joint_position && follows(of.joint[0]);
}

}  // namespace

SubsetSearch::SubsetSearch(const GapSystem& system, double noise_scale2)
    : system_(system), scale2_(noise_scale2), log_n_(std::log(std::max(2.0, system.numbers))) {
  gram_ = gram(system.columns) / scale2_;
  product_ = system.columns.transpose() * system.residual / scale2_;
  total_ = system.residual.squaredNorm() / scale2_ * (1 + 1e-9);
}

double SubsetSearch::precision_of(const Block& block, Eigen::Index column) const {
  if (block.precision > 0) return block.precision;
  const double least = nearly_free * gram_(column, column);
  return block.margin > 0 ? std::max(hardly_bound, least) : least;
}

double SubsetSearch::margins(const Subset& subset) const {
  double sum = 0;
  for (const std::size_t b : subset) sum += system_.blocks[b].margin;
  return sum;
}

void SubsetSearch::extend() {
  const Eigen::Index had = gram_.cols();
  const Eigen::Index has = system_.columns.cols();
  gram_.conservativeResize(has, has);
  const Eigen::MatrixXd fresh = system_.columns.rightCols(has - had);
  gram_.bottomRows(has - had) = transposed_product(fresh, system_.columns) / scale2_;
  gram_.topRightCorner(had, has - had) = gram_.bottomLeftCorner(has - had, had).transpose();
  product_.conservativeResize(has);
  product_.tail(has - had) = fresh.transpose() * system_.residual / scale2_;
}

bool SubsetSearch::compatible(std::size_t a, std::size_t b) const {
  const EffectId& x = system_.blocks[a].id;
  const EffectId& y = system_.blocks[b].id;
  for (const auto& [f, other] : {std::pair{&system_.blocks[a], &y}, std::pair{&system_.blocks[b], &x}}) {
    if (f->function_joint != 0 && is_part_of(*f, *other)) return false;
  }
  const EffectDescriptor& d = descriptor(x.effect);
  if (x.effect == y.effect && d.has(Selector::after)) return std::abs(x.after_s - y.after_s) > 0;
  if (same_name(x, y)) {
    // Several local faults of one joint make one curve.
    return system_.blocks[a].width_rad > 0 && system_.blocks[b].width_rad > 0 &&
           std::abs(std::remainder(system_.blocks[a].centre_rad - system_.blocks[b].centre_rad, 2 * pi)) >
               system_.blocks[a].width_rad + system_.blocks[b].width_rad;
  }
  if (x.effect == y.effect && d.all_links_by_default && (x.link == 0 || y.link == 0)) return false;
  if (x.joint == y.joint && follows_own_joint(x) && follows_own_joint(y)) {
    const auto is_smooth_curve = [&](std::size_t block) {
      return descriptor(system_.blocks[block].id.effect).table == TableKind::curve &&
             system_.blocks[block].width_rad == 0;
    };
    return !is_smooth_curve(a) && !is_smooth_curve(b);  // the smooth curve contains the other
  }
  return true;
}

SubsetSearch::Selected SubsetSearch::selected(const Subset& subset) const {
  std::vector<double> precision;
  Selected out;
  for (const std::size_t b : subset) {
    for (const Eigen::Index c : system_.blocks[b].columns) {
      out.index.push_back(c);
      precision.push_back(precision_of(system_.blocks[b], c));
    }
  }
  out.precision =
      Eigen::Map<const Eigen::VectorXd>(precision.data(), static_cast<Eigen::Index>(precision.size()));
  return out;
}

ChosenColumns SubsetSearch::columns_of(const Subset& subset) const {
  const Selected s = selected(subset);
  return {system_.columns(Eigen::all, s.index), scale2_ * s.precision};
}

Eigen::MatrixXd SubsetSearch::normal_matrix(const Selected& s) const {
  Eigen::MatrixXd normal = gram_(s.index, s.index);
  normal.diagonal() += s.precision;
  return normal;
}

Scored SubsetSearch::score(const Subset& subset) const {
  Scored out;
  // Blocks with a prior come last: the factor's diagonal is then that of their Schur complement.
  out.blocks = subset;
  std::ranges::stable_sort(out.blocks, [&](std::size_t a, std::size_t b) {
    return (system_.blocks[a].precision > 0) < (system_.blocks[b].precision > 0);
  });
  const Selected s = selected(out.blocks);
  const Eigen::VectorXd right = product_(s.index);
  Eigen::MatrixXd normal = normal_matrix(s);
  out.gain = minus_infinity;
  if (!factor_in_place(normal)) return out;
  Eigen::MatrixXd solved = right;
  solve_lower(normal, solved);
  solve_lower_transposed(normal, solved);
  out.solution = solved.col(0);
  out.chi2_gain = out.solution.dot(right);
  // More than there is: the columns are one another's to rounding.
  if (!(out.chi2_gain <= total_)) return out;
  out.gain = out.chi2_gain;
  Eigen::Index at = 0;
  for (const std::size_t b : out.blocks) {
    const Block& block = system_.blocks[b];
    const Eigen::Index size = static_cast<Eigen::Index>(block.columns.size());
    subtract_evidence_cost(out.gain, block, normal, at);
    // A scan has looked at many positions of a function with few numbers: they count besides the evidence.
    out.gain -= block.parameters * log_n_;
    out.parameters += block.parameters;
    if (block.positive && (out.solution.segment(at, size).array() < 0).any()) out.gain = minus_infinity;
    at += size;
  }
  return out;
}

std::vector<double> SubsetSearch::extensions(const Subset& subset) const {
  const Selected s = selected(subset);
  Eigen::MatrixXd reduced = gram_(s.index, Eigen::all);  // L^-1 G[S, :]
  Eigen::MatrixXd done = product_(s.index);
  if (!s.index.empty()) {
    Eigen::MatrixXd normal = normal_matrix(s);
    if (!factor_in_place(normal)) return std::vector<double>(system_.blocks.size(), minus_infinity);
    solve_lower(normal, reduced);
    solve_lower(normal, done);
  }
  std::vector<double> gains(system_.blocks.size(), minus_infinity);
  for (std::size_t b = 0; b < system_.blocks.size(); ++b) {
    if (std::ranges::any_of(subset, [&](std::size_t o) { return o == b || !compatible(o, b); })) continue;
    gains[b] = gain_of_adding(system_.blocks[b], reduced, done);
  }
  return gains;
}

double SubsetSearch::gain_of_adding(const Block& block, const Eigen::MatrixXd& reduced,
                                    const Eigen::MatrixXd& done) const {
  const Eigen::Index size = static_cast<Eigen::Index>(block.columns.size());
  const Eigen::MatrixXd taken = reduced(Eigen::all, block.columns);
  const Eigen::MatrixXd absorbed = gram(taken);
  Eigen::MatrixXd normal(size, size);
  Eigen::VectorXd right(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const Eigen::Index ci = block.columns[static_cast<std::size_t>(i)];
    right[i] = product_[ci] - (reduced.rows() > 0 ? taken.col(i).dot(done.col(0)) : 0);
    for (Eigen::Index k = 0; k < size; ++k)
      normal(i, k) = gram_(ci, block.columns[static_cast<std::size_t>(k)]) - absorbed(i, k);
    if (normal(i, i) < spanned * gram_(ci, ci) && size == 1) return minus_infinity;
    normal(i, i) += precision_of(block, ci);
  }
  if (!factor_in_place(normal)) return minus_infinity;
  Eigen::MatrixXd solution = right;
  solve_lower(normal, solution);
  double gain = solution.squaredNorm();
  solve_lower_transposed(normal, solution);
  if (block.positive && (solution.array() < 0).any()) return minus_infinity;
  subtract_evidence_cost(gain, block, normal, 0);
  return gain - block.parameters * log_n_;
}

std::pair<Eigen::MatrixXd, Eigen::VectorXd> SubsetSearch::given(const Subset& others,
                                                                std::size_t block) const {
  const Selected s = selected(others);
  const std::vector<Eigen::Index>& own = system_.blocks[block].columns;
  Eigen::MatrixXd information = gram_(own, own);
  Eigen::VectorXd right = product_(own);
  if (s.index.empty()) return {information, right};
  Eigen::MatrixXd normal = normal_matrix(s);
  Eigen::MatrixXd across = gram_(s.index, own);
  Eigen::MatrixXd done = product_(s.index);
  if (!factor_in_place(normal)) return {information, right};
  solve_lower(normal, across);
  solve_lower(normal, done);
  information -= gram(across);
  right -= across.transpose() * done;
  return {information, right};
}

Scored SubsetSearch::best(std::size_t largest, const std::vector<Subset>& starts,
                          const std::vector<bool>& allowed) const {
  return with_exchanges(beam_search(largest, starts, allowed), allowed);
}

Scored SubsetSearch::beam_search(std::size_t largest, const std::vector<Subset>& starts,
                                 const std::vector<bool>& allowed) const {
  constexpr std::size_t beam = 4;
  std::vector<Subset> front{Subset()};
  front.insert(front.end(), starts.begin(), starts.end());
  Scored best = score(Subset());
  for (const Subset& s : front) {
    const Scored scored = score(s);
    if (value(scored) > value(best)) best = scored;
  }
  std::set<Subset> seen;
  int idle = 0;
  for (std::size_t depth = 0; depth < largest && idle < 2; ++depth) {
    std::erase_if(front, [&](const Subset& s) { return s.size() >= largest; });
    std::vector<std::pair<double, Subset>> next;
    for (const Subset& s : front) {
      const double here = score(s).gain;
      const std::vector<double> gains = extensions(s);
      std::vector<std::size_t> order;
      for (std::size_t b = 0; b < gains.size(); ++b) {
        if (gains[b] > minus_infinity && (allowed.empty() || allowed[b])) order.push_back(b);
      }
      const std::size_t few = std::min<std::size_t>(order.size(), 2 * beam);
      std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(few), order.end(),
                        [&](std::size_t a, std::size_t b) { return gains[a] > gains[b]; });
      for (std::size_t k = 0; k < few; ++k) {
        Subset t = s;
        t.push_back(order[k]);
        std::ranges::sort(t);
        if (!seen.insert(t).second) continue;
        next.emplace_back(here + gains[order[k]] - margins(t), t);
      }
    }
    std::ranges::sort(next, [](const auto& a, const auto& b) { return a.first > b.first; });
    front.clear();
    bool better = false;
    for (const auto& [guess, s] : next) {
      const Scored scored = score(s);
      if (scored.gain == minus_infinity) continue;
      if (value(scored) > value(best)) {
        best = scored;
        better = true;
      }
      front.push_back(s);
      if (front.size() >= beam) break;
    }
    idle = better ? 0 : idle + 1;
    if (front.empty()) break;
  }
  return best;
}

Scored SubsetSearch::with_exchanges(Scored best, const std::vector<bool>& allowed) const {
  for (int round = 0; round < 20; ++round) {
    Scored better = best;
    for (std::size_t k = 0; k < best.blocks.size(); ++k) {
      const Subset rest = without(best.blocks, best.blocks[k]);
      const Scored removed = score(rest);
      if (value(removed) > value(better)) better = removed;
      const std::vector<double> gains = extensions(rest);
      for (std::size_t b = 0; b < gains.size(); ++b) {
        if (!allowed.empty() && !allowed[b]) continue;
        Subset exchanged = rest;
        exchanged.push_back(b);
        if (!(removed.gain + gains[b] - margins(exchanged) > value(better))) continue;
        const Scored scored = score(exchanged);
        if (value(scored) > value(better) + 1e-9) better = scored;
      }
    }
    if (!(value(better) > value(best) + 1e-9)) break;
    best = better;
  }
  return best;
}

Eigen::VectorXd SubsetSearch::largest_single_gains(const Eigen::MatrixXd& residuals) const {
  const Eigen::MatrixXd products = transposed_product(system_.columns, residuals) / scale2_;
  Eigen::VectorXd largest = Eigen::VectorXd::Constant(residuals.cols(), minus_infinity);
  for (const Block& block : system_.blocks) {
    const Eigen::Index size = static_cast<Eigen::Index>(block.columns.size());
    Eigen::MatrixXd normal = gram_(block.columns, block.columns);
    for (Eigen::Index i = 0; i < size; ++i)
      normal(i, i) += precision_of(block, block.columns[static_cast<std::size_t>(i)]);
    if (!factor_in_place(normal)) continue;
    double minus_cost = -(block.parameters * log_n_);
    subtract_evidence_cost(minus_cost, block, normal, 0);
    Eigen::MatrixXd right = products(block.columns, Eigen::all);
    solve_lower(normal, right);
    for (Eigen::Index c = 0; c < right.cols(); ++c) {
      if (block.positive && size == 1 && right(0, c) < 0) continue;
      largest[c] = std::max(largest[c], right.col(c).squaredNorm() + minus_cost);
    }
  }
  return largest;
}

}  // namespace flexcomp::host
