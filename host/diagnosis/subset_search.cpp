// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/subset_search.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "linalg/blas.hpp"

namespace flexcomp::host {

namespace {

constexpr double minus_infinity = -std::numeric_limits<double>::infinity();

/// Coefficients without a prior are at most some hundred of their usual sizes (precision per square unit), and never
/// closer to free than this share of their own information: directions that the columns of a set leave open (the sum of
/// a curve's splines, an axis that wobbles once a turn on a base that tilts) stay where they do no harm.
constexpr double hardly_bound = 1e-4;
constexpr double nearly_free = 1e-8;

/// What is left of a column after the others, by which it counts as theirs (squared share).
constexpr double spanned = 1e-6;

/// Would the function's own members say the same?
bool is_part_of(const Block& function, const EffectId& id) {
  if (id.joint != function.function_joint) return false;
  const auto follows = [&](unsigned joint) {
    return std::find(function.function_readings.begin(), function.function_readings.end(), joint) !=
           function.function_readings.end();
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

Scored SubsetSearch::score(const Subset& subset) const {
  Scored out;
  out.blocks = subset;
  std::vector<Eigen::Index> index;
  Eigen::VectorXd prior;
  // Blocks with a prior come last: the factor's diagonal is then that of their Schur complement.
  Subset ordered = subset;
  std::stable_sort(ordered.begin(), ordered.end(), [&](std::size_t a, std::size_t b) {
    return (system_.blocks[a].precision > 0) < (system_.blocks[b].precision > 0);
  });
  out.blocks = ordered;
  for (const std::size_t b : ordered)
    index.insert(index.end(), system_.blocks[b].columns.begin(), system_.blocks[b].columns.end());
  const Eigen::Index n = static_cast<Eigen::Index>(index.size());
  Eigen::MatrixXd normal(n, n);
  Eigen::VectorXd right(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    right[i] = product_[index[static_cast<std::size_t>(i)]];
    for (Eigen::Index k = 0; k <= i; ++k)
      normal(i, k) = normal(k, i) =
          gram_(index[static_cast<std::size_t>(i)], index[static_cast<std::size_t>(k)]);
  }
  prior.resize(n);
  Eigen::Index at = 0;
  for (const std::size_t b : ordered) {
    for (const Eigen::Index c : system_.blocks[b].columns) prior[at++] = precision_of(system_.blocks[b], c);
  }
  normal.diagonal() += prior;
  if (!factor_in_place(normal)) {
    out.gain = minus_infinity;
    return out;
  }
  Eigen::MatrixXd solved = right;
  solve_lower(normal, solved);
  solve_lower_transposed(normal, solved);
  out.solution = solved.col(0);
  out.chi2_gain = out.solution.dot(right);
  // More than there is: the columns are one another's to rounding.
  if (!(out.chi2_gain <= total_)) {
    out.gain = minus_infinity;
    return out;
  }
  out.gain = out.chi2_gain;
  at = 0;
  for (const std::size_t b : ordered) {
    const Block& block = system_.blocks[b];
    const Eigen::Index size = static_cast<Eigen::Index>(block.columns.size());
    if (block.precision > 0) {
      for (Eigen::Index k = at; k < at + size; ++k)
        out.gain -= std::log(std::pow(normal(k, k), 2) / block.precision);
    }
    // A scan has looked at many positions of a function with few numbers: they count besides the evidence.
    out.gain -= block.parameters * log_n_;
    out.parameters += block.parameters;
    if (block.positive) {
      for (Eigen::Index k = at; k < at + size; ++k) {
        if (out.solution[k] < 0) out.gain = minus_infinity;
      }
    }
    at += size;
  }
  return out;
}

std::vector<double> SubsetSearch::extensions(const Subset& subset) const {
  std::vector<Eigen::Index> index;
  std::vector<double> prior;
  for (const std::size_t b : subset) {
    for (const Eigen::Index c : system_.blocks[b].columns) {
      index.push_back(c);
      prior.push_back(precision_of(system_.blocks[b], c));
    }
  }
  const Eigen::Index n = static_cast<Eigen::Index>(index.size());
  Eigen::MatrixXd reduced(n, gram_.cols());  // L^-1 G[S, :]
  Eigen::MatrixXd done = Eigen::MatrixXd::Zero(n, 1);
  if (n > 0) {
    Eigen::MatrixXd normal(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      reduced.row(i) = gram_.row(index[static_cast<std::size_t>(i)]);
      done(i, 0) = product_[index[static_cast<std::size_t>(i)]];
      for (Eigen::Index k = 0; k < n; ++k)
        normal(i, k) = gram_(index[static_cast<std::size_t>(i)], index[static_cast<std::size_t>(k)]);
      normal(i, i) += prior[static_cast<std::size_t>(i)];
    }
    if (!factor_in_place(normal)) return std::vector<double>(system_.blocks.size(), minus_infinity);
    solve_lower(normal, reduced);
    solve_lower(normal, done);
  }
  std::vector<double> gains(system_.blocks.size(), minus_infinity);
  for (std::size_t b = 0; b < system_.blocks.size(); ++b) {
    const Block& block = system_.blocks[b];
    if (std::any_of(subset.begin(), subset.end(), [&](std::size_t s) { return s == b || !compatible(s, b); }))
      continue;
    const Eigen::Index size = static_cast<Eigen::Index>(block.columns.size());
    Eigen::MatrixXd normal(size, size);
    Eigen::VectorXd right(size);
    Eigen::MatrixXd taken(n, size);
    for (Eigen::Index i = 0; i < size; ++i)
      taken.col(i) = reduced.col(block.columns[static_cast<std::size_t>(i)]);
    const Eigen::MatrixXd carried = gram(taken);
    bool is_spanned = false;
    for (Eigen::Index i = 0; i < size; ++i) {
      const Eigen::Index ci = block.columns[static_cast<std::size_t>(i)];
      right[i] = product_[ci] - (n > 0 ? taken.col(i).dot(done.col(0)) : 0);
      for (Eigen::Index k = 0; k < size; ++k)
        normal(i, k) = gram_(ci, block.columns[static_cast<std::size_t>(k)]) - carried(i, k);
      if (normal(i, i) < spanned * gram_(ci, ci) && size == 1) is_spanned = true;
      normal(i, i) += precision_of(block, ci);
    }
    if (is_spanned) continue;
    if (!factor_in_place(normal)) continue;
    Eigen::MatrixXd solution = right;
    solve_lower(normal, solution);
    double gain = solution.squaredNorm();
    solve_lower_transposed(normal, solution);
    if (block.positive && (solution.array() < 0).any()) continue;
    if (block.precision > 0) {
      for (Eigen::Index k = 0; k < size; ++k) gain -= std::log(std::pow(normal(k, k), 2) / block.precision);
    }
    gains[b] = gain - block.parameters * log_n_;
  }
  return gains;
}

std::pair<Eigen::MatrixXd, Eigen::VectorXd> SubsetSearch::given(const Subset& others,
                                                                std::size_t block) const {
  std::vector<Eigen::Index> index;
  std::vector<double> prior;
  for (const std::size_t b : others) {
    for (const Eigen::Index c : system_.blocks[b].columns) {
      index.push_back(c);
      prior.push_back(precision_of(system_.blocks[b], c));
    }
  }
  const std::vector<Eigen::Index>& own = system_.blocks[block].columns;
  Eigen::MatrixXd information = gram_(own, own);
  Eigen::VectorXd right = product_(own);
  if (index.empty()) return {information, right};
  Eigen::MatrixXd normal = gram_(index, index);
  normal.diagonal() +=
      Eigen::Map<const Eigen::VectorXd>(prior.data(), static_cast<Eigen::Index>(prior.size()));
  Eigen::MatrixXd across = gram_(index, own);
  Eigen::MatrixXd done = product_(index);
  if (!factor_in_place(normal)) return {information, right};
  solve_lower(normal, across);
  solve_lower(normal, done);
  information -= gram(across);
  right -= across.transpose() * done;
  return {information, right};
}

Scored SubsetSearch::best(std::size_t largest, const std::vector<Subset>& starts,
                          const std::vector<bool>& allowed) const {
  constexpr std::size_t beam = 4;
  const auto may = [&](std::size_t b) { return allowed.empty() || allowed[b]; };
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
    front.erase(
        std::remove_if(front.begin(), front.end(), [&](const Subset& s) { return s.size() >= largest; }),
        front.end());
    std::vector<std::pair<double, Subset>> next;
    for (const Subset& s : front) {
      const double here = score(s).gain;
      const std::vector<double> gains = extensions(s);
      std::vector<std::size_t> order;
      for (std::size_t b = 0; b < gains.size(); ++b) {
        if (gains[b] > minus_infinity && may(b)) order.push_back(b);
      }
      const std::size_t few = std::min<std::size_t>(order.size(), 2 * beam);
      std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(few), order.end(),
                        [&](std::size_t a, std::size_t b) { return gains[a] > gains[b]; });
      for (std::size_t k = 0; k < few; ++k) {
        Subset t = s;
        t.push_back(order[k]);
        std::sort(t.begin(), t.end());
        if (!seen.insert(t).second) continue;
        next.emplace_back(here + gains[order[k]] - margins(t), t);
      }
    }
    std::sort(next.begin(), next.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
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
  // Exchanges and removals.
  for (int round = 0; round < 20; ++round) {
    Scored better = best;
    for (std::size_t k = 0; k < best.blocks.size(); ++k) {
      Subset without = best.blocks;
      without.erase(without.begin() + static_cast<std::ptrdiff_t>(k));
      const Scored removed = score(without);
      if (value(removed) > value(better)) better = removed;
      const std::vector<double> gains = extensions(without);
      for (std::size_t b = 0; b < gains.size(); ++b) {
        Subset exchanged = without;
        exchanged.push_back(b);
        if (!may(b) || !(removed.gain + gains[b] - margins(exchanged) > value(better))) continue;
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
    Eigen::MatrixXd normal(size, size);
    Eigen::MatrixXd right(size, residuals.cols());
    for (Eigen::Index i = 0; i < size; ++i) {
      right.row(i) = products.row(block.columns[static_cast<std::size_t>(i)]);
      for (Eigen::Index k = 0; k < size; ++k)
        normal(i, k) =
            gram_(block.columns[static_cast<std::size_t>(i)], block.columns[static_cast<std::size_t>(k)]);
      normal(i, i) += precision_of(block, block.columns[static_cast<std::size_t>(i)]);
    }
    if (!factor_in_place(normal)) continue;
    double cost = block.parameters * log_n_;
    if (block.precision > 0) {
      for (Eigen::Index k = 0; k < size; ++k) cost += std::log(std::pow(normal(k, k), 2) / block.precision);
    }
    solve_lower(normal, right);
    for (Eigen::Index c = 0; c < right.cols(); ++c) {
      if (block.positive && size == 1 && right(0, c) < 0) continue;
      largest[c] = std::max(largest[c], right.col(c).squaredNorm() - cost);
    }
  }
  return largest;
}

}  // namespace flexcomp::host
