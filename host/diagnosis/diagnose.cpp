#include "diagnosis/diagnose.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <random>

#include "diagnosis/explanation.hpp"
#include "diagnosis/refit.hpp"
#include "diagnosis/remainder.hpp"
#include "diagnosis/subset_search.hpp"
#include "diagnosis/telling_poses.hpp"
#include "identification/fitted_calibration.hpp"
#include "identification/identify.hpp"

namespace flexcomp::host {

namespace {

/// The model at the start, refitted to these rows, and what of it the rows can move.
struct Start {
  Fit fit;
  Unknowns fitted;
};

Start start_from(const Calibration& calibration, const RobotFile& robot, const std::vector<Observation>& rows,
                 std::uint64_t seed) {
  Estimate estimate{calibration.terms, calibration.f(), calibration.e()};
  Unknowns all;
  if (calibration.frames) all.frames = free_frames(rows);
  const bool has_sigma = std::any_of(calibration.sigma.begin(), calibration.sigma.end(),
                                     [](double s) { return std::isfinite(s); });
  for (Parameter& p : parameters_of(calibration.terms, robot.nominal)) {
    const std::vector<double>& sigma = p.value ? calibration.value_sigma : calibration.sigma;
    const std::size_t at = p.value ? *p.value : p.terms.front();
    // Given, not fitted: it stays what it is.
    if (has_sigma && !(at < sigma.size() && std::isfinite(sigma[at]))) continue;
    // What was not understood before is looked at anew.
    if (estimate.set.terms[p.terms.front()].effect == Effect::unnamed) continue;
    all.parameters.push_back(std::move(p));
  }
  all.prior = prior_knowledge(estimate.set, all.parameters, true, {});
  Start out;
  out.fitted = what_is_knowable(robot, rows, estimate, all, seed).fitted;
  out.fit = fit(estimate, out.fitted, rows, robot, {});
  return out;
}

double noise_floor(const std::vector<Observation>& rows) {
  double sum = 0;
  for (const Observation& row : rows) {
    const Eigen::Matrix3d w = row.whitening.topLeftCorner<3, 3>();
    sum += (w.transpose() * w).inverse().trace();
  }
  return rows.empty() ? 0 : std::sqrt(sum / static_cast<double>(rows.size()));
}

/// Chi-square per measured number on poses that were left out, ten folds in a fixed order: the model's own parameters
/// and the blocks are fitted to nine tenths.
double cross_validated(const GapSystem& system, const Scored& solution) {
  constexpr std::size_t folds = 10;
  Eigen::Index count = system.nuisance.cols();
  for (const std::size_t b : solution.blocks)
    count += static_cast<Eigen::Index>(system.blocks[b].columns.size());
  Eigen::MatrixXd all(system.columns.rows(), count);
  all.leftCols(system.nuisance.cols()) = system.nuisance;
  Eigen::VectorXd ridge = Eigen::VectorXd::Constant(count, 1e-12);
  Eigen::Index at = system.nuisance.cols();
  for (const std::size_t b : solution.blocks) {
    for (const Eigen::Index c : system.blocks[b].columns) {
      ridge[at] = std::max(system.blocks[b].precision, 1e-10);
      all.col(at++) = system.columns.col(c);
    }
  }
  const Eigen::MatrixXd normal = all.transpose() * all;
  const Eigen::VectorXd right = all.transpose() * system.residual;
  double sum = 0;
  for (std::size_t fold = 0; fold < folds; ++fold) {
    Eigen::MatrixXd reduced = normal;
    Eigen::VectorXd reduced_right = right;
    reduced.diagonal() += ridge;
    std::vector<Eigen::Index> left_out;
    for (std::size_t k = fold; k < system.rows; k += folds) {
      const auto block = all.middleRows<6>(6 * static_cast<Eigen::Index>(k));
      reduced.noalias() -= block.transpose() * block;
      reduced_right.noalias() -=
          block.transpose() * system.residual.segment<6>(6 * static_cast<Eigen::Index>(k));
      left_out.push_back(6 * static_cast<Eigen::Index>(k));
    }
    const Eigen::VectorXd x = reduced.ldlt().solve(reduced_right);
    for (const Eigen::Index k : left_out)
      sum += (system.residual.segment<6>(k) - all.middleRows<6>(k) * x).squaredNorm();
  }
  return sum / system.numbers;
}

/// Probability that chance gains as much anywhere in the catalogue: poses are permuted, freely and in blocks of
/// consecutive ones, and of each permutation the largest gain of all is taken. Beyond the permutations by the Gumbel
/// distribution of their maxima.
class ChanceGains {
 public:
  ChanceGains(const SubsetSearch& search, const Remainder& left, std::uint64_t seed) {
    const GapSystem& system = search.system();
    const std::size_t count = system.rows > 300 ? 100 : 200;
    std::mt19937_64 random(seed);
    std::vector<std::size_t> live;
    for (std::size_t k = 0; k < system.rows; ++k) {
      if (system.counts[k]) live.push_back(k);
    }
    if (live.size() < 8) return;
    const std::size_t run =
        std::max<std::size_t>(2, static_cast<std::size_t>(std::sqrt(double(live.size()))));
    Eigen::MatrixXd permuted = Eigen::MatrixXd::Zero(left.residual.size(), static_cast<Eigen::Index>(count));
    for (std::size_t p = 0; p < count; ++p) {
      std::vector<std::size_t> order;
      if (p % 2 == 0) {
        order = live;
        std::shuffle(order.begin(), order.end(), random);
      } else {
        std::vector<std::size_t> starts;
        const std::size_t shift = random() % live.size();
        for (std::size_t s = 0; s < live.size(); s += run) starts.push_back(s);
        std::shuffle(starts.begin(), starts.end(), random);
        for (const std::size_t s : starts) {
          for (std::size_t k = s; k < std::min(s + run, live.size()); ++k)
            order.push_back(live[(k + shift) % live.size()]);
        }
      }
      for (std::size_t k = 0; k < live.size(); ++k) {
        permuted.col(static_cast<Eigen::Index>(p)).segment<6>(6 * static_cast<Eigen::Index>(live[k])) =
            left.residual.segment<6>(6 * static_cast<Eigen::Index>(order[k]));
      }
    }
    permuted -= system.nuisance * (system.nuisance.transpose() * permuted);
    const Eigen::VectorXd largest = search.largest_single_gains(permuted);
    maxima_.assign(largest.data(), largest.data() + largest.size());
  }

  double p_value(double gain) const {
    if (maxima_.empty()) return 1;
    const double n = static_cast<double>(maxima_.size());
    const auto above = static_cast<double>(
        std::count_if(maxima_.begin(), maxima_.end(), [&](double m) { return m >= gain; }));
    if (above >= 10) return (1 + above) / (1 + n);
    double mean = 0;
    double square = 0;
    for (const double m : maxima_) mean += m / n;
    for (const double m : maxima_) square += (m - mean) * (m - mean) / (n - 1);
    const double beta = std::sqrt(6 * square) / pi;
    const double mu = mean - 0.57721566490153286 * beta;
    return -std::expm1(-std::exp(-(gain - mu) / std::max(beta, 1e-9)));
  }

 private:
  std::vector<double> maxima_;
};

}  // namespace

Diagnosis diagnose(const RobotFile& robot, const std::vector<Observation>& rows, const std::string& source,
                   const DiagnoseOptions& options) {
  Diagnosis out;
  const auto tell = [&](const std::string& what, double share) {
    if (options.progress) options.progress(what, share);
  };
  tell("the model at the start", 0);
  Start start;
  if (options.start) {
    start = start_from(*options.start, robot, rows, options.seed);
  } else {
    IdentifyOptions identify_options;
    identify_options.force = options.force;
    identify_options.seed = options.seed;
    Identification base = identify(robot, rows, source, identify_options);
    for (const std::string& d : base.doubts) out.notes.push_back("the model at the start: " + d);
    start.fit = std::move(base.fit);
    start.fitted = std::move(base.known.fitted);
    out.before.confounded = base.calibration.confounded;
  }
  const std::vector<Confounded> confounded = out.before.confounded;
  out.before = fitted_calibration(start.fit, start.fitted, robot);
  out.before.confounded = confounded;
  out.noise_floor_m = noise_floor(rows);

  Explainer explainer(robot, rows, options.columns, start.fit.estimate, start.fitted, start.fit.weight);
  out.not_testable = explainer.not_testable();
  Explanation found =
      explainer.explain([&](double share) { tell("searching the catalogue", 0.1 + 0.5 * share); });
  tell("the model with what was found", 0.6);
  Refit refit = refit_with(robot, rows, start.fit.estimate, start.fitted, found);
  // Where the search was linear the refit is not: once more from there, until the names stay.
  for (int round = 0; round < 2 && !found.pieces.empty(); ++round) {
    Explanation again = explainer.explain_again(refit, found);
    const bool same = same_names(found, again);
    found = std::move(again);
    if (same) break;
    refit = refit_with(robot, rows, start.fit.estimate, start.fitted, found);
  }
  tell("how sure it is", 0.7);

  // --- before and after -----------------------------------------------------------------------------------------
  const auto before_model = prepare(start.fit.estimate.set, robot, source);
  out.residuals_before = residuals(start.fit.estimate, *before_model, rows);
  out.error_before = statistics(out.residuals_before, rows);
  out.chi2_per_dof_before = start.fit.chi2_per_dof();
  out.after = refit.calibration;
  out.after.confounded = confounded;
  const auto after_model = prepare(refit.fit.estimate.set, robot, source);
  out.residuals_after = residuals(refit.fit.estimate, *after_model, rows);
  out.error_after = statistics(out.residuals_after, rows);
  out.chi2_per_dof_after = refit.fit.chi2_per_dof();
  out.degrees_of_freedom_after = refit.fit.degrees_of_freedom;
  for (std::size_t k = 0; k < refit.fit.weight.size(); ++k) {
    if (refit.fit.weight[k] < 1) out.outliers.push_back(k);
  }

  // --- the search's own figures -----------------------------------------------------------------------------------
  const GapSystem& system = *found.system;
  const SubsetSearch& search = *found.search;
  const Remainder nothing_found = remainder(search, search.score({}));
  const Remainder left = remainder(search, found.solution);
  out.dropped = system.dropped;
  out.places = place_shares(system, nothing_found);
  out.places_left = place_shares(system, left);
  const ChanceGains chance(search, left, options.seed);
  const double all_cv = cross_validated(system, found.solution);
  for (const std::size_t b : found.solution.blocks) {
    if (system.blocks[b].id.effect == Effect::unnamed) continue;
    Subset without;
    bool known = false;
    for (const FoundEffect& e : out.effects) known = known || same_name(e.id, system.blocks[b].id);
    if (known) continue;  // a second local fault of the same curve
    for (const std::size_t other : found.solution.blocks) {
      if (!same_name(system.blocks[other].id, system.blocks[b].id)) without.push_back(other);
    }
    FoundEffect effect;
    effect.id = system.blocks[b].id;
    const Scored less = search.score(without);
    effect.delta_bic = found.solution.gain - less.gain;
    effect.p_value = chance.p_value(effect.delta_bic);
    const double cv = cross_validated(system, less);
    effect.cross_validation = cv > 0 ? 1 - all_cv / cv : 0;
    effect.pushed = !is_measurement_effect(effect.id.effect);
    effect.confounded_with = rivals_of(search, found.solution, without, effect.id);
    describe(effect, refit, robot, rows);
    out.effects.push_back(std::move(effect));
  }
  std::stable_sort(out.effects.begin(), out.effects.end(),
                   [](const FoundEffect& a, const FoundEffect& b) { return a.delta_bic > b.delta_bic; });

  // --- step by step -------------------------------------------------------------------------------------------------
  Subset so_far;
  const auto step = [&](std::string what) {
    const Scored s = search.score(so_far);
    const Remainder r = remainder(search, s);
    DiagnosisStep d;
    d.what = std::move(what);
    d.chi2_per_dof = r.residual.squaredNorm() / std::max(1.0, system.numbers - double(r.basis.cols()));
    d.cross_validated = cross_validated(system, s);
    double square = 0;
    double count = 0;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      if (!system.counts[k]) continue;
      const Eigen::Matrix3d w = rows[k].whitening.topLeftCorner<3, 3>();
      square += w.partialPivLu().solve(r.residual.segment<3>(6 * static_cast<Eigen::Index>(k))).squaredNorm();
      ++count;
    }
    d.train_rms_m = std::sqrt(square / std::max(1.0, count));
    out.steps.push_back(d);
  };
  step("the model at the start");
  for (const FoundEffect& effect : out.effects) {
    for (const std::size_t b : found.solution.blocks) {
      if (same_name(system.blocks[b].id, effect.id)) so_far.push_back(b);
    }
    step(name(effect.id));
  }
  for (const std::size_t b : found.solution.blocks) {
    if (system.blocks[b].id.effect != Effect::unnamed) continue;
    so_far.push_back(b);
    step(fmt::format("{} as a smooth function", place_name(system.blocks[b].id.place)));
  }

  // --- verdict ------------------------------------------------------------------------------------------------------
  out.where = found.misfit;
  const bool unnamed = found.unnamed;
  out.verdict = unnamed ? Verdict::unnamed : out.effects.empty() ? Verdict::none : Verdict::named;
  if (!out.where && !out.effects.empty()) out.where = misfit_of(out.effects.front(), out.places);
  for (const std::string& note : found.notes) out.notes.push_back(note);
  if (!out.outliers.empty())
    out.notes.push_back(
        fmt::format("{} of {} rows are outliers and do not count in full", out.outliers.size(), rows.size()));

  tell("poses that tell rivals apart", 0.9);
  out.telling_poses = telling_poses(robot, rows, start.fit.estimate, start.fitted, explainer.candidate_set(),
                                    found, out.effects, options.seed);

  if (!refit.fit.converged)
    out.doubts.push_back(
        fmt::format("the fit did not converge (a further step would still gain {:.2g} in chi-square)",
                    refit.fit.newton_decrement));
  const bool changed = !out.effects.empty() || unnamed;
  if (changed &&
      !(refit.fit.chi2 / std::max(1.0, refit.fit.degrees_of_freedom) <=
        start.fit.chi2 / std::max(1.0, start.fit.degrees_of_freedom) * 1.0001) &&
      !(out.error_after.rms_m < out.error_before.rms_m))
    out.doubts.push_back("the error after is not below the error before");
  if (out.verdict != Verdict::unnamed && refit.fit.degrees_of_freedom >= 1 &&
      refit.fit.chi2 < chi2_quantile(0.0005, refit.fit.degrees_of_freedom)) {
    out.doubts.push_back(
        fmt::format("chi-square per degree of freedom {:.3g}: the noise is smaller than was declared",
                    refit.fit.chi2_per_dof()));
  }
  tell("done", 1);
  return out;
}

}  // namespace flexcomp::host
