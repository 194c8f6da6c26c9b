// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/found_effects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "flexcomp/forward.hpp"
#include "linalg/blas.hpp"
#include "model/covariate.hpp"
#include "model/effects/descriptor.hpp"
#include "model/place.hpp"

namespace flexcomp::host {

std::optional<CurveSpan> curve_span(const Refit& refit, const EffectGroup& group,
                                    const std::vector<Observation>& rows) {
  if (group.id.effect != Effect::joint_curve || group.id.factor != Factor::one || rows.empty()) return {};
  const std::size_t size = group.parameters.size();
  Eigen::MatrixXd weight =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(size));
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto w = detail::curve_weights(rows[k].q_rad[group.id.joint - 1], static_cast<std::uint16_t>(size));
    for (std::size_t i = 0; i < 4; ++i)
      weight(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(w.index[i])) += w.w[i];
  }
  // A turn that is the same everywhere is geometry.
  weight.rowwise() -= Eigen::RowVectorXd(weight.colwise().mean());
  Eigen::VectorXd value(weight.cols());
  std::vector<Eigen::Index> own, of_fit;
  for (std::size_t c = 0; c < size; ++c) {
    value[static_cast<Eigen::Index>(c)] = group.parameters[c].get(refit.fit.estimate.set);
    for (std::size_t p = 0; p < refit.fitted.parameters.size(); ++p) {
      if (refit.fitted.parameters[p].value != group.parameters[c].value || !group.parameters[c].value)
        continue;
      own.push_back(static_cast<Eigen::Index>(c));
      of_fit.push_back(static_cast<Eigen::Index>(refit.fitted.frames.size() + p));
    }
  }
  const Eigen::VectorXd turn = weight * value;
  CurveSpan out{turn.minCoeff(), turn.maxCoeff(), 0};
  if (own.empty()) return out;
  const double unit = unit_of(group.parameters.front(), refit.fit.estimate.set);
  const Eigen::MatrixXd covariance = refit.fit.covariance(of_fit, of_fit) * (unit * unit);
  const Eigen::MatrixXd of_rows = weight(Eigen::all, own);
  std::vector<double> sigma;
  for (Eigen::Index k = 0; k < of_rows.rows(); ++k)
    sigma.push_back(std::sqrt(std::max(0.0, of_rows.row(k).dot(of_rows.row(k) * covariance))));
  out.sigma_rad = median(sigma);
  return out;
}

namespace {

using Rows = std::vector<std::size_t>;

/// The rows in an order without structure: every second permutation moves whole runs, which keeps drift within them.
Rows permuted_order(const Rows& live, bool in_runs, std::mt19937_64& random) {
  if (!in_runs) {
    Rows order = live;
    std::shuffle(order.begin(), order.end(), random);
    return order;
  }
  const std::size_t run = std::max<std::size_t>(2, static_cast<std::size_t>(std::sqrt(double(live.size()))));
  Rows order;
  Rows starts;
  const std::size_t shift = random() % live.size();
  for (std::size_t s = 0; s < live.size(); s += run) starts.push_back(s);
  std::shuffle(starts.begin(), starts.end(), random);
  for (const std::size_t s : starts) {
    for (std::size_t k = s; k < std::min(s + run, live.size()); ++k)
      order.push_back(live[(k + shift) % live.size()]);
  }
  return order;
}

/// Null distribution of the largest gain in the whole catalogue, by permutation of the poses (D17).
class PermutationNull {
 public:
  /// Permutes the poses of a residual, freely and in runs of consecutive ones in turn, and keeps of each permutation the
  /// largest gain of one block alone.
  PermutationNull(const SubsetSearch& search, const ResidualAnalysis& left, std::uint64_t seed);

  /// Probability that chance gains as much anywhere in the catalogue; beyond the permutations by the Gumbel distribution
  /// of their maxima (moments). 1 where the rows are too few.
  double p_value(double gain) const;

 private:
  std::vector<double> maxima_;
};

PermutationNull::PermutationNull(const SubsetSearch& search, const ResidualAnalysis& left,
                                 std::uint64_t seed) {
  const GapSystem& system = search.system();
  const std::size_t count = system.rows > many_rows ? 100 : 200;
  std::mt19937_64 random(seed);
  Rows live;
  for (std::size_t k = 0; k < system.rows; ++k) {
    if (system.counts[k]) live.push_back(k);
  }
  if (live.size() < 8) return;
  Eigen::MatrixXd permuted = Eigen::MatrixXd::Zero(left.residual.size(), static_cast<Eigen::Index>(count));
  for (std::size_t p = 0; p < count; ++p) {
    const Rows order = permuted_order(live, p % 2 == 1, random);
    for (std::size_t k = 0; k < live.size(); ++k) {
      permuted.col(static_cast<Eigen::Index>(p)).segment<6>(first_number(live[k])) =
          left.residual.segment<6>(first_number(order[k]));
    }
  }
  permuted -= product(system.nuisance, transposed_product(system.nuisance, permuted));
  const Eigen::VectorXd largest = search.largest_single_gains(permuted);
  maxima_.assign(largest.data(), largest.data() + largest.size());
}

double PermutationNull::p_value(double gain) const {
  if (maxima_.empty()) return 1;
  const double n = static_cast<double>(maxima_.size());
  const auto above = static_cast<double>(std::ranges::count_if(maxima_, [&](double m) { return m >= gain; }));
  if (above >= 10) return (1 + above) / (1 + n);
  double mean = 0;
  double square = 0;
  for (const double m : maxima_) mean += m / n;
  for (const double m : maxima_) square += (m - mean) * (m - mean) / (n - 1);
  const double beta = std::sqrt(6 * square) / pi;
  const double mu = mean - 0.57721566490153286 * beta;
  return -std::expm1(-std::exp(-(gain - mu) / std::max(beta, 1e-9)));
}

/// Coefficients, and how far the effect moves the measured point beyond what the model's other parts would absorb.
/// \param nuisance  orthonormal basis of these, whitened as the rows are
void describe(FoundEffect& effect, const Refit& refit, const Robot& robot,
              const std::vector<Observation>& rows, const Eigen::MatrixXd& nuisance) {
  const TermSet& set = refit.fit.estimate.set;
  for (EffectGroup& group : effects_of(set, robot.nominal)) {
    if (!same_name(group.id, effect.id)) continue;
    effect.id = group.id;
    Estimate without = refit.fit.estimate;
    for (const Parameter& p : group.parameters) {
      EffectCoefficient c;
      c.key = p.name.substr(p.name.rfind('.') + 1);
      c.unit = p.unit;
      c.value = p.get(set);
      c.sigma = std::nan("");
      for (std::size_t k = 0; k < refit.fitted.parameters.size(); ++k) {
        if (refit.fitted.parameters[k].name != p.name) continue;
        const Eigen::Index i = static_cast<Eigen::Index>(refit.fitted.frames.size() + k);
        c.sigma = std::sqrt(std::max(0.0, refit.fit.covariance(i, i))) * unit_of(p, set);
      }
      effect.coefficients.push_back(c);
      p.set(without.set, 0);
    }
    effect.curve = curve_span(refit, group, rows);
    const std::vector<RowResidual> a = residuals(refit.fit.estimate, robot, rows, "diagnosis");
    std::vector<RowResidual> shift = residuals(without, robot, rows, "diagnosis");
    for (std::size_t k = 0; k < rows.size(); ++k) {
      shift[k].position_m = a[k].position_m - shift[k].position_m;
      shift[k].orientation_rad = a[k].orientation_rad - shift[k].orientation_rad;
    }
    Eigen::VectorXd column = whitened(shift, rows);
    // What geometry and frames would take up is theirs: an axis that tilts once a turn is largely a tilted base.
    column -= nuisance * (nuisance.transpose() * column);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const double moved = unwhitened(rows[k], column.segment<6>(first_number(k))).head<3>().norm();
      effect.largest_m = std::max(effect.largest_m, moved);
      effect.rms_m += moved * moved / static_cast<double>(rows.size());
    }
    effect.rms_m = std::sqrt(effect.rms_m);
    return;
  }
}

/// Other effects that could stand for `id`, within decisive_bic of it. \param without  the solution without its blocks
std::vector<Rival> rivals_of(const SubsetSearch& search, const Scored& solution, const Subset& without,
                             const EffectId& id) {
  std::vector<Rival> rivals;
  const GapSystem& system = search.system();
  const double base = search.score(without).gain;
  const std::vector<double> gains = search.extensions(without);
  for (std::size_t b = 0; b < gains.size(); ++b) {
    const Block& block = system.blocks[b];
    if (same_name(block.id, id) || block.is_function()) continue;
    const double delta = solution.gain - (base + gains[b]);
    // A rival is better than nothing.
    if (!(delta < decisive_bic) || !(gains[b] > 0)) continue;
    const auto known =
        std::ranges::find_if(rivals, [&](const Rival& r) { return same_name(r.id, block.id); });
    if (known == rivals.end()) {
      rivals.push_back({block.id, delta});
    } else if (delta < known->delta_bic) {
      *known = {block.id, delta};
    }
  }
  std::ranges::sort(rivals, {}, &Rival::delta_bic);
  return rivals;
}

/// Blocks of the solution that are not of an effect.
Subset without_effect(const SearchResult& found, const EffectId& id) {
  return without_if(found.solution.blocks,
                    [&](std::size_t b) { return same_name(found.system->blocks[b].id, id); });
}

}  // namespace

std::vector<FoundEffect> found_effects(const Robot& robot, const Selection& selection,
                                       const ResidualAnalysis& left, const LeftOutPoses& left_out,
                                       std::uint64_t seed) {
  const SearchResult& found = selection.found;
  const SubsetSearch& search = *found.search;
  const PermutationNull chance(search, left, seed);
  const double all_cv = left_out.chi2_per_number(search, found.solution);
  std::vector<FoundEffect> effects;
  for (const Hypothesis& h : found.hypotheses) {
    if (h.function) continue;
    // A second local fault of the same curve is no other effect.
    if (std::ranges::any_of(effects, [&](const FoundEffect& e) { return same_name(e.id, h.id); })) continue;
    FoundEffect effect;
    effect.id = h.id;
    const Subset without = without_effect(found, h.id);
    const Scored less = search.score(without);
    effect.delta_bic = found.solution.gain - less.gain;
    effect.p_value = chance.p_value(effect.delta_bic);
    const double cv = left_out.chi2_per_number(search, less);
    effect.cross_validation = cv > 0 ? 1 - all_cv / cv : 0;
    effect.pushed = !belongs_to_measurement(effect.id.effect);
    effect.confounded_with = rivals_of(search, found.solution, without, effect.id);
    describe(effect, selection.refit, robot, *selection.rows, found.system->nuisance);
    effects.push_back(std::move(effect));
  }
  std::ranges::stable_sort(effects, std::ranges::greater(), &FoundEffect::delta_bic);
  return effects;
}

std::vector<DiagnosisStep> steps_of(const Selection& selection, const std::vector<FoundEffect>& effects,
                                    const LeftOutPoses& left_out) {
  const GapSystem& system = *selection.found.system;
  const SubsetSearch& search = *selection.found.search;
  std::vector<DiagnosisStep> steps;
  Subset so_far;
  const auto step = [&](std::string what) {
    const Scored s = search.score(so_far);
    const ResidualAnalysis r = residual_after(search, s);
    DiagnosisStep d;
    d.what = std::move(what);
    d.chi2_per_dof = r.residual.squaredNorm() / std::max(1.0, system.numbers - r.fitted_numbers);
    d.cross_validated = left_out.chi2_per_number(search, s);
    double square = 0;
    double count = 0;
    for (std::size_t k = 0; k < system.rows; ++k) {
      if (!system.counts[k]) continue;
      square +=
          unwhitened(selection.rows->at(k), r.residual.segment<6>(first_number(k))).head<3>().squaredNorm();
      ++count;
    }
    d.train_rms_m = std::sqrt(square / std::max(1.0, count));
    steps.push_back(d);
  };
  step("the model at the start");
  for (const FoundEffect& effect : effects) {
    for (const std::size_t b : selection.found.solution.blocks) {
      if (same_name(system.blocks[b].id, effect.id)) so_far.push_back(b);
    }
    step(name(effect.id));
  }
  for (const std::size_t b : selection.found.solution.blocks) {
    if (!system.blocks[b].is_function()) continue;
    so_far.push_back(b);
    step(fmt::format("{} as a smooth function", place_name(system.blocks[b].id.place)));
  }
  return steps;
}

Misfit misfit_of(const FoundEffect& effect, const std::vector<PlaceShare>& places) {
  Misfit m;
  const EffectId& id = effect.id;
  const EffectDescriptor& d = descriptor(id.effect);
  m.place = d.place(id);
  m.joint = d.has(Selector::link) ? id.link : is_link(m.place) ? m.place.body : 0;
  const Follows follows = d.follows(id);
  for (const unsigned joint : follows.joint) {
    if (joint != 0 || m.covariates.empty()) m.covariates.push_back(covariate_name(follows.covariate, joint));
  }
  m.around_deg.assign(m.covariates.size(), std::nullopt);
  for (const PlaceShare& p : places) {
    if (p.place == m.place) {
      m.explains = p.explains;
      m.p_value = p.p_value;
    }
  }
  return m;
}

}  // namespace flexcomp::host
