// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/diagnose.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <random>

#include "diagnosis/cross_validation.hpp"
#include "diagnosis/discriminating_poses.hpp"
#include "diagnosis/effect_search.hpp"
#include "diagnosis/refit.hpp"
#include "diagnosis/residual_analysis.hpp"
#include "diagnosis/scatter.hpp"
#include "diagnosis/subset_search.hpp"
#include "identification/fitted_calibration.hpp"
#include "identification/identify.hpp"
#include "linalg/blas.hpp"
#include "model/place.hpp"

namespace flexcomp::host {

namespace {

/// The model at the start, refitted to these rows, and what of it the rows can move.
struct Start {
  Fit fit;
  Unknowns fitted;
};

Start start_from(const Calibration& calibration, const Robot& robot, const std::vector<Observation>& rows,
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
  out.fitted = analyse_identifiability(robot, rows, estimate, all, seed).fitted;
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

/// Chi-square by the noise that was declared, of the rows that count in full.
double declared_chi2(const std::vector<double>& weight, const std::vector<RowResidual>& residual,
                     const std::vector<Observation>& rows) {
  double sum = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (weight[k] >= 1) sum += whitened(rows[k], residual[k]).squaredNorm();
  }
  return sum;
}

/// What was found in rows with this noise, and all that it stands on.
struct Answer {
  std::unique_ptr<const std::vector<Observation>> rows;
  Start start;
  std::unique_ptr<const EffectSearch> explainer;
  Explanation found;
  Refit refit;
};

using Tell = std::function<void(const std::string&, double)>;

Answer answer_for(const Robot& robot, const std::vector<Observation>& rows, const ContextColumns& columns,
                  Start start, bool poses_scatter, const Tell& tell, double done) {
  Answer out;
  out.rows = std::make_unique<const std::vector<Observation>>(rows);
  out.start = std::move(start);
  const Estimate& at = out.start.fit.estimate;
  const Unknowns& fitted = out.start.fitted;
  out.explainer = std::make_unique<const EffectSearch>(robot, *out.rows, columns, at, fitted,
                                                       out.start.fit.weight, poses_scatter);
  out.found = out.explainer->explain(
      [&](double share) { tell("searching the catalogue", done + (0.6 - done) * share); });
  tell("the model with what was found", 0.6);
  out.refit = refit_with(robot, *out.rows, at, fitted, out.found);
  // Where the search was linear the refit is not: once more from there, until the names stay.
  for (int round = 0; round < 2 && !out.found.pieces.empty(); ++round) {
    Explanation again = out.explainer->explain_again(out.refit, out.found);
    const bool same = same_names(out.found, again);
    out.found = std::move(again);
    if (same) break;
    out.refit = refit_with(robot, *out.rows, at, fitted, out.found);
  }
  return out;
}

/// Shares of a refitted model's misfit by the noise that these rows declare.
std::vector<PlaceShare> places_left_at(const Refit& refit, const Robot& robot,
                                       const std::vector<Observation>& rows) {
  std::vector<bool> counts;
  for (const double w : refit.fit.weight) counts.push_back(w >= 1);
  const Estimate& at = refit.fit.estimate;
  const GapSystem system =
      gap_system(robot, rows, counts, at, refit.fitted, CandidateSet{at.set, {}, {}, {}});
  return place_shares(system, remainder(system));
}

std::string in_words(const Scatter& s) {
  if (place_unit(s.place).name == "mm") return fmt::format("{:.3g} mm", s.sigma * 1e3);
  return fmt::format("{:.3g} arcsec", degrees(s.sigma) * 3600);
}

/// -2 ln of the likelihood of the misfit at the start, what the parameters of the answer cost added, against the same
/// noise for all answers to the same rows.
double price(const Answer& answer) {
  const GapSystem& system = *answer.found.system;
  const SubsetSearch& search = *answer.found.search;
  const Scored& s = answer.found.solution;
  const double scale2 = search.noise_scale2();
  const ResidualAnalysis left = remainder(search, s);
  const auto masked = static_cast<double>(std::count(system.counts.begin(), system.counts.end(), false));
  return left.residual.squaredNorm() / scale2 + system.numbers * std::log(scale2) + (s.chi2_gain - s.gain) +
         search.margins(s.blocks) + masked * outlier_price;
}

/// What is left over after the names may be a place that moves from pose to pose. Then the numbers of a row are not
/// independent, and names that are judged as if they were take chance for structure: judged anew under that noise, and
/// the better of the two answers stands.
/// \param places  shares of the misfit at the start
/// \return whether it is the one with a place that moves
bool prefer_scatter(Answer& answer, const Robot& robot, const std::vector<Observation>& rows,
                    const Start& at_first, const ContextColumns& columns,
                    const std::vector<PlaceShare>& places, const Tell& tell) {
  // Many rows bear a little scatter without taking it for structure, and each answer takes its time.
  const bool many = rows.size() > most_few_rows;
  if (many && answer.found.search->noise_scale2() < 1.5) return false;
  tell("what moves from pose to pose", 0.6);
  ScatteredModel scattered =
      scattered_model(robot, rows, at_first.fit.estimate, at_first.fitted, at_first.fit.weight);
  if (scattered.places.empty()) return false;
  const auto under = [&] {
    Start start{scattered.fit, at_first.fitted};
    return answer_for(robot, scattered.rows, columns, std::move(start), true, tell, 0.6);
  };
  Answer other = under();
  // The scatter was that of everything at first: what was named is no scatter, and less scatter lets more be named.
  double size = scattered.log_determinant;
  for (int round = 0; round < (many ? 1 : 3) && !other.found.pieces.empty(); ++round) {
    ScatteredModel less =
        scattered_model(robot, rows, other.refit.fit.estimate, other.refit.fitted, other.refit.fit.weight);
    if (less.places.empty() || less.log_determinant > 0.95 * size) break;
    EstimatorOptions options;
    options.spectrum = false;
    less.fit = fit(scattered.fit.estimate, at_first.fitted, less.rows, robot, options);
    size = less.log_determinant;
    scattered = std::move(less);
    other = under();
  }
  const double cost =
      scattered.log_determinant + static_cast<double>(scattered.places.size()) * answer.found.search->log_n();
  if (price(other) + cost >= price(answer)) return false;
  const Scatter& most = scattered.places.front();
  Misfit m;
  m.place = most.place;
  m.joint = m.place.body >= 1 && m.place.body <= joint_count ? m.place.body : 0;
  m.p_value = std::exp(-0.5 * most.gain);
  for (const PlaceShare& share : places) {
    if (share.place == m.place) m.explains = share.explains;
  }
  other.found.unnamed = true;
  const bool follows = other.found.misfit && !other.found.misfit->covariates.empty();
  if (!follows) other.found.misfit = m;
  other.found.notes.clear();
  for (const Scatter& s : scattered.places) {
    other.found.notes.push_back(fmt::format(
        "{} moves by {} (standard deviation) from pose to pose and follows nothing that was recorded",
        place_name(s.place), in_words(s)));
  }
  for (const NotTestable& n : other.explainer->not_testable()) {
    const Needs needs = descriptor(n.effect).needs;
    if ((needs != Needs::direction && needs != Needs::moves) || n.needs.empty()) continue;
    if (most.place.slot == slot::theta)
      other.found.notes.push_back(fmt::format("{} would look like this; to test it record {}",
                                              effect_name(n.effect), fmt::join(n.needs, ", ")));
  }
  answer = std::move(other);
  return true;
}

/// Probability that chance gains as much anywhere in the catalogue: poses are permuted, freely and in blocks of
/// consecutive ones, and of each permutation the largest gain of all is taken. Beyond the permutations by the Gumbel
/// distribution of their maxima.
class ChanceGains {
 public:
  ChanceGains(const SubsetSearch& search, const ResidualAnalysis& left, std::uint64_t seed) {
    const GapSystem& system = search.system();
    const std::size_t count = system.rows > most_few_rows ? 100 : 200;
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
    permuted -= product(system.nuisance, transposed_product(system.nuisance, permuted));
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

Diagnosis diagnose(const Robot& robot, const std::vector<Observation>& rows, const std::string& source,
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
    for (const std::string& d : base.doubts) out.doubts.push_back("the model at the start: " + d);
    start.fit = std::move(base.fit);
    start.fitted = std::move(base.identifiability.fitted);
    out.before.confounded = base.calibration.confounded;
  }
  const std::vector<Confounded> confounded = out.before.confounded;
  out.before = fitted_calibration(start.fit, start.fitted, robot);
  out.before.confounded = confounded;
  out.noise_floor_m = noise_floor(rows);

  const Start at_first = start;
  Answer answer = answer_for(robot, rows, options.columns, std::move(start), false, tell, 0.1);
  const SubsetSearch& first = *answer.found.search;
  out.places = place_shares(first.system(), remainder(first, first.score({})));
  const bool scatters = answer.found.unnamed &&
                        prefer_scatter(answer, robot, rows, at_first, options.columns, out.places, tell);
  const EffectSearch& explainer = *answer.explainer;
  const Explanation& found = answer.found;
  const Refit& refit = answer.refit;
  out.not_testable = explainer.not_testable();
  tell("how sure it is", 0.7);

  // --- before and after -----------------------------------------------------------------------------------------
  const auto before_model = prepare(at_first.fit.estimate.set, robot, source);
  out.residuals_before = residuals(at_first.fit.estimate, *before_model, rows);
  out.error_before = statistics(out.residuals_before, rows);
  out.chi2_per_dof_before = at_first.fit.chi2_per_dof();
  out.after = refit.calibration;
  out.after.confounded = confounded;
  const auto after_model = prepare(refit.fit.estimate.set, robot, source);
  out.residuals_after = residuals(refit.fit.estimate, *after_model, rows);
  out.error_after = statistics(out.residuals_after, rows);
  const double chi2_after = declared_chi2(refit.fit.weight, out.residuals_after, rows);
  out.chi2_per_dof_after = chi2_after / std::max(1.0, refit.fit.degrees_of_freedom);
  out.degrees_of_freedom_after = refit.fit.degrees_of_freedom;
  for (std::size_t k = 0; k < refit.fit.weight.size(); ++k) {
    if (refit.fit.weight[k] < 1) out.outliers.push_back(k);
  }

  // --- the search's own figures -----------------------------------------------------------------------------------
  const GapSystem& system = *found.system;
  const SubsetSearch& search = *found.search;
  const ResidualAnalysis left = remainder(search, found.solution);
  out.dropped = system.dropped;
  out.places_left = scatters ? places_left_at(refit, robot, rows) : place_shares(system, left);
  const ChanceGains chance(search, left, options.seed);
  const LeftOutPoses left_out(rows);
  const double all_cv = left_out.chi2_per_number(search, found.solution);
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
    const double cv = left_out.chi2_per_number(search, less);
    effect.cross_validation = cv > 0 ? 1 - all_cv / cv : 0;
    effect.pushed = !belongs_to_measurement(effect.id.effect);
    effect.confounded_with = rivals_of(search, found.solution, without, effect.id);
    describe(effect, refit, robot, *answer.rows, system.nuisance);
    out.effects.push_back(std::move(effect));
  }
  std::stable_sort(out.effects.begin(), out.effects.end(),
                   [](const FoundEffect& a, const FoundEffect& b) { return a.delta_bic > b.delta_bic; });

  // --- step by step -------------------------------------------------------------------------------------------------
  Subset so_far;
  const auto step = [&](std::string what) {
    const Scored s = search.score(so_far);
    const ResidualAnalysis r = remainder(search, s);
    DiagnosisStep d;
    d.what = std::move(what);
    d.chi2_per_dof = r.residual.squaredNorm() / std::max(1.0, system.numbers - r.fitted_numbers);
    d.cross_validated = left_out.chi2_per_number(search, s);
    double square = 0;
    double count = 0;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      if (!system.counts[k]) continue;
      square += unwhitened(answer.rows->at(k), r.residual.segment<6>(6 * static_cast<Eigen::Index>(k)))
                    .head<3>()
                    .squaredNorm();
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
  for (const Hypothesis& piece : found.pieces) {
    if (!piece.local) continue;
    const Eigen::VectorXd inside = local_values(*piece.local, rows);
    std::vector<std::size_t> lines;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      if (inside[static_cast<Eigen::Index>(k)] > 0.1) lines.push_back(rows[k].line);
    }
    if (lines.size() > 3) continue;
    out.notes.push_back(
        fmt::format("{} rests on {} (line {}): measure more poses with joint {} near {:.0f} deg",
                    name(piece.id), lines.size() == 1 ? "one row" : fmt::format("{} rows", lines.size()),
                    fmt::join(lines, ", "), piece.local->joint, degrees(piece.local->centre_rad)));
  }
  for (const std::string& note : found.notes) out.notes.push_back(note);
  if (!out.outliers.empty())
    out.notes.push_back(
        fmt::format("{} of {} rows are outliers and do not count in full", out.outliers.size(), rows.size()));

  tell("poses that tell rivals apart", 0.9);
  out.discriminating_poses =
      discriminating_poses(robot, *answer.rows, answer.start.fit.estimate, answer.start.fitted,
                           explainer.candidate_set(), found, out.effects, options.seed);

  if (!refit.fit.converged)
    out.doubts.push_back(
        fmt::format("the fit did not converge (a further step would still gain {:.2g} in chi-square)",
                    refit.fit.newton_decrement));
  if (out.degrees_of_freedom_after < 1)
    out.doubts.push_back(
        "there are as many unknowns as measured numbers: no effect could show in what is left");
  const bool changed = !found.pieces.empty();
  if (changed && !(out.chi2_per_dof_after <= out.chi2_per_dof_before * 1.0001) &&
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
