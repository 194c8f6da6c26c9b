#include "identification/identify.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "files/input_error.hpp"
#include "flexcomp/forward.hpp"
#include "identification/identifiability.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// Arms miss by 0.5 to 4 mm before calibration; per metre of reach about half a millimetre once base and tool are fitted
/// (the measured UR5 and UR10: 0.5 and 0.7 mm). A hundred times that is no arm's error.
constexpr double usual_error_per_reach = 5e-4;
constexpr double suspicious_factor = 100;

/// A column of which less is left after projection on the others counts as confounded with them: a tool point 0.2 mm off
/// axis 6, as fitted, does not make known what a point on the axis cannot know.
constexpr double structural_tolerance = 1e-3;

double reach(const RobotFile& robot) {
  double sum = 0;
  for (const NominalLink& link : robot.nominal.links) sum += std::hypot(link.a_m, link.d_m);
  return sum;
}

/// Root mean square distance of points from their mean.
double spread(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  double sum = 0;
  for (const Eigen::Vector3d& p : points)
    sum += (p - mean).squaredNorm() / static_cast<double>(points.size());
  return std::sqrt(sum);
}

void refuse_the_implausible(const RobotFile& robot, const std::vector<Observation>& rows,
                            const Before& before, const std::string& source) {
  const double limit = suspicious_factor * usual_error_per_reach * reach(robot);
  const double found = before.fitted_frames
                           ? std::min(before.fitted_frames->rms_m, before.nominal_frames.rms_m)
                           : before.nominal_frames.rms_m;
  if (!(found > limit)) return;
  std::vector<Eigen::Vector3d> measured;
  std::vector<Eigen::Vector3d> nominal;
  const auto model = prepare(TermSet(), robot, source);
  for (const Observation& row : rows) {
    measured.push_back(row.p_m);
    nominal.push_back(nominal_forward(*model, row.q_rad).position);
  }
  const double ratio = spread(measured) / std::max(spread(nominal), 1e-9);
  std::string suspicion = "the data belong to another arm, or joints are in another order or sign";
  if (ratio < 0.01) suspicion = "positions are in metres, not in millimetres";
  if (ratio > 100) suspicion = "positions are in micrometres, not in millimetres";
  throw InputError(source, 0, "x_mm y_mm z_mm",
                   fmt::format("residuals to the nominal {} below {:.0f} mm", robot.name, limit * 1e3),
                   fmt::format("{:.1f} mm (rms): {}? --force goes on all the same", found * 1e3, suspicion));
}

Eigen::MatrixXd select(const Eigen::MatrixXd& m, const std::vector<std::size_t>& columns) {
  Eigen::MatrixXd out(m.rows(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    out.col(static_cast<Eigen::Index>(k)) = m.col(static_cast<Eigen::Index>(columns[k]));
  }
  return out;
}

Eigen::VectorXd sigmas(const Eigen::MatrixXd& matrix) {
  const Eigen::MatrixXd normal = matrix.transpose() * matrix;
  return normal.ldlt()
      .solve(Eigen::MatrixXd::Identity(normal.rows(), normal.cols()))
      .diagonal()
      .cwiseMax(0)
      .cwiseSqrt();
}

/// Known in principle is not known: a parameter whose standard deviation is over 30 units (3 mm, 1.5 degrees) and over 30
/// times what as many random poses would give is left out, the last in the order first, until none is. Otherwise
/// near-confounded ones run off together (a5 = 43 mm +- 40 mm) and the others with them.
std::vector<std::size_t> drop_the_unknowable(const Eigen::MatrixXd& data, const Eigen::MatrixXd& reference,
                                             const std::vector<std::size_t>& order, std::size_t frames,
                                             std::vector<std::size_t>& kept) {
  constexpr double too_many = 30;
  const double more_rows =
      std::sqrt(static_cast<double>(reference.rows()) / static_cast<double>(data.rows()));
  std::vector<std::size_t> dropped;
  while (!kept.empty()) {
    const Eigen::VectorXd here = sigmas(select(data, kept));
    const Eigen::VectorXd usual = sigmas(select(reference, kept)) * more_rows;
    std::size_t worst = kept.size();
    std::size_t latest = 0;
    for (std::size_t k = 0; k < kept.size(); ++k) {
      const Eigen::Index i = static_cast<Eigen::Index>(k);
      if (kept[k] < frames || !(here[i] > too_many && here[i] > too_many * usual[i])) continue;
      const std::size_t position =
          static_cast<std::size_t>(std::find(order.begin(), order.end(), kept[k]) - order.begin());
      if (worst == kept.size() || position > latest) {
        worst = k;
        latest = position;
      }
    }
    if (worst == kept.size()) break;
    dropped.push_back(kept[worst]);
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  return dropped;
}

/// Whether rows know every one of these columns well enough.
bool knows_all(const Eigen::MatrixXd& data, const Eigen::MatrixXd& reference, std::size_t frames) {
  std::vector<std::size_t> order(static_cast<std::size_t>(data.cols()));
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::vector<std::size_t> kept = eliminate(data, order).kept;
  return kept.size() == order.size() && drop_the_unknowable(data, reference, order, frames, kept).empty();
}

/// Greedy choice among the random poses of the reference until all columns are known: each adds the most information
/// about what is still unknown (D-optimal, by rank-six updates).
std::vector<std::array<double, joint_count>> poses_that_cure(Eigen::MatrixXd data,
                                                             const Eigen::MatrixXd& reference,
                                                             const std::vector<Observation>& reference_rows,
                                                             std::size_t frames) {
  constexpr std::size_t most = 40;
  constexpr Eigen::Index candidates = 300;
  const Eigen::Index columns = data.cols();
  // A weak prior of 100 units stands in for what the data do not know.
  Eigen::MatrixXd covariance =
      (data.transpose() * data + 1e-4 * Eigen::MatrixXd::Identity(columns, columns)).inverse();
  std::vector<std::array<double, joint_count>> chosen;
  std::set<Eigen::Index> taken;
  while (chosen.size() < most && !knows_all(data, reference, frames)) {
    double best = -1;
    Eigen::Index which = 0;
    for (Eigen::Index c = 0; c < candidates; ++c) {
      if (taken.count(c) != 0) continue;
      const auto h = reference.middleRows<6>(6 * c);
      const Eigen::Matrix<double, 6, 6> gain =
          Eigen::Matrix<double, 6, 6>::Identity() + h * covariance * h.transpose();
      const double information = gain.llt().matrixLLT().diagonal().array().log().sum();
      if (information > best) {
        best = information;
        which = c;
      }
    }
    taken.insert(which);
    const Eigen::MatrixXd h = reference.middleRows<6>(6 * which);
    const Eigen::MatrixXd ch = covariance * h.transpose();
    const Eigen::MatrixXd gain = Eigen::MatrixXd::Identity(6, 6) + h * ch;
    covariance -= ch * gain.ldlt().solve(ch.transpose());
    data.conservativeResize(data.rows() + 6, Eigen::NoChange);
    data.bottomRows<6>() = h;
    chosen.push_back(reference_rows[static_cast<std::size_t>(which)].q_rad);
  }
  return chosen;
}

/// Terms that no kept parameter drives say nothing: they are left out of the calibration.
void keep_what_was_identified(Calibration& calibration, const TermSet& set, const Unknowns& fitted,
                              const Eigen::VectorXd& sigma) {
  std::vector<double> of_term(set.terms.size(), std::nan(""));
  std::vector<bool> kept(set.terms.size(), false);
  for (std::size_t p = 0; p < fitted.parameters.size(); ++p) {
    for (const std::size_t t : fitted.parameters[p].terms) {
      of_term[t] = sigma[static_cast<Eigen::Index>(fitted.frames.size() + p)];
      kept[t] = true;
    }
  }
  for (std::size_t t = 0; t < set.terms.size(); ++t) {
    if (!kept[t]) continue;
    calibration.terms.terms.push_back(set.terms[t]);
    calibration.sigma.push_back(of_term[t]);
  }
}

}  // namespace

Before errors_before(const RobotFile& robot, const std::vector<Observation>& rows, Estimate* fitted) {
  Before before;
  Estimate nominal;
  const auto model = prepare(TermSet(), robot, "nominal robot");
  before.nominal_frames = statistics(residuals(nominal, *model, rows), rows);
  // Below four rows a frame of six numbers and a tool point of three fit nearly anything.
  if (rows.size() >= 4) {
    const Estimate frames = fit_frames(TermSet(), rows, robot);
    before.fitted_frames = statistics(residuals(frames, *model, rows), rows);
    if (fitted != nullptr) *fitted = frames;
  }
  return before;
}

Identification identify(const RobotFile& robot, const std::vector<Observation>& rows,
                        const std::string& source, const IdentifyOptions& options) {
  Identification out;
  Estimate start;
  out.before = errors_before(robot, rows, &start);
  if (!options.force) refuse_the_implausible(robot, rows, out.before, source);

  Estimate nominal;
  const auto nominal_model = prepare(TermSet(), robot, source);
  const bool fit_frames_too = options.frames == FrameChoice::fit ||
                              (options.frames == FrameChoice::by_distance &&
                               nominal_frames_are_off(residuals(nominal, *nominal_model, rows), rows));
  if (!fit_frames_too) start = Estimate();
  out.nominal = residuals(start, *nominal_model, rows);

  ParametricModel paper = paper_model(robot.nominal, options.model, !fit_frames_too);
  out.parameters = paper.parameters.size();
  start.set = paper.set;
  Unknowns all;
  if (fit_frames_too) all.frames = free_frames(rows);
  all.parameters = paper.parameters;
  const std::vector<std::string> names = names_of(all);
  const std::vector<std::size_t> order = elimination_order(all, start.set);

  // What 1,000 random poses of this kind could know is a property of the arm and the kind of measurement; what these
  // data know besides depends on the poses. Both at the nominal arm, where nothing is parallel by accident only.
  const std::vector<Observation> reference = random_observations(robot, rows, 1000, options.seed);
  const auto zero_model = prepare(start.set, robot, source);
  const Eigen::MatrixXd reference_matrix = linearised(start, *zero_model, reference, all).derivative;
  const Eigen::MatrixXd data_matrix = linearised(start, *zero_model, rows, all).derivative;
  const Elimination possible = eliminate(reference_matrix, order, structural_tolerance);
  for (const LostColumn& lost : possible.lost) {
    Confounded entry{names[lost.column], {}};
    for (const std::size_t c : lost.with) entry.with.push_back(names[c]);
    out.confounded.push_back(entry);
  }
  std::vector<std::size_t> possible_order;
  for (const std::size_t c : order) {
    if (std::binary_search(possible.kept.begin(), possible.kept.end(), c)) possible_order.push_back(c);
  }
  Elimination known = eliminate(data_matrix, possible_order);
  for (const LostColumn& lost : known.lost) out.missing.push_back(names[lost.column]);
  for (const std::size_t c :
       drop_the_unknowable(data_matrix, reference_matrix, possible_order, all.frames.size(), known.kept)) {
    out.missing.push_back(names[c]);
  }

  Unknowns fitted;
  for (const std::size_t c : known.kept) {
    if (c < all.frames.size()) {
      fitted.frames.push_back(all.frames[c]);
    } else {
      fitted.parameters.push_back(all.parameters[c - all.frames.size()]);
    }
  }
  out.frame_parameters = fitted.frames.size();
  out.identifiable = fitted.parameters.size();

  if (fitted.count() > 0) {
    out.fit = fit(start, fitted, rows, robot, options.estimator);
  } else {
    out.fit.estimate = start;
  }

  const Eigen::VectorXd sigma_units = out.fit.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  if (!out.missing.empty()) {
    // In the order of preference, so that the same columns are judged here as above; frames stand first in it.
    out.cure = poses_that_cure(
        select(data_matrix, possible_order), select(reference_matrix, possible_order), reference,
        static_cast<std::size_t>(std::count_if(possible_order.begin(), possible_order.end(),
                                               [&](std::size_t c) { return c < all.frames.size(); })));
  }

  const Eigen::VectorXd& s = out.fit.singular_values;
  if (s.size() > 0 && s[s.size() - 1] > 0) {
    out.condition = s[0] / s[s.size() - 1];
    out.o1 = std::exp(s.array().log().mean()) / std::sqrt(static_cast<double>(rows.size()));
  }

  const auto model = prepare(out.fit.estimate.set, robot, source);
  out.residuals = residuals(out.fit.estimate, *model, rows);
  out.after = statistics(out.residuals, rows);
  for (std::size_t k = 0; k < out.fit.weight.size(); ++k) {
    if (out.fit.weight[k] < 1) out.outliers.push_back(k);
  }

  const Eigen::VectorXd units = units_of(fitted, out.fit.estimate.set);
  keep_what_was_identified(out.calibration, out.fit.estimate.set, fitted, sigma_units.cwiseProduct(units));
  out.calibration.covariance = CovarianceFactor{
      names_of(fitted), units.asDiagonal() * Eigen::MatrixXd(out.fit.covariance.llt().matrixL())};
  if (fit_frames_too) {
    out.calibration.frames = MeasurementFrames{Frame::of(out.fit.estimate.f), Frame::of(out.fit.estimate.e)};
  } else {
    // B is the small step from the constructed base frame to the robot's own; anything larger is another frame (F).
    double shift = 0;
    double turn = 0;
    for (const Term<double>& t : out.calibration.terms.terms) {
      if (t.place.body != body::base || t.basis != Basis::one) continue;
      double& largest = t.place.slot <= slot::z ? shift : turn;
      largest = std::max(largest, std::abs(t.coefficient));
    }
    if (shift > 0.020 || turn > radians(2)) {
      throw InputError(
          source, 0, "base", "a base within 20 mm and 2 degrees of the nominal one",
          fmt::format("{:.1f} mm, {:.2f} degrees; --frames fit lets the measurement frame lie anywhere",
                      shift * 1e3, degrees(turn)));
    }
  }
  out.calibration.confounded = out.confounded;
  out.calibration.residuals = {{"before_mean_mm", out.before.nominal_frames.mean_m * 1e3},
                               {"after_mean_mm", out.after.mean_m * 1e3},
                               {"after_rms_mm", out.after.rms_m * 1e3},
                               {"after_max_mm", out.after.max_m * 1e3}};
  stamp(out.calibration, robot);

  if (!out.missing.empty()) {
    std::string list;
    for (const std::string& m : out.missing) list += (list.empty() ? "" : ", ") + m;
    out.doubts.push_back(
        fmt::format("these {} rows cannot know {} parameters that random poses of the same kind would: {}",
                    rows.size(), out.missing.size(), list));
  }
  if (!out.fit.converged) {
    out.doubts.push_back(
        fmt::format("the fit did not converge (a further step would still gain {:.2g} in chi-square)",
                    out.fit.newton_decrement));
  }
  if (out.missing.empty() && out.fit.degrees_of_freedom < 1) {
    out.doubts.push_back(
        "there are as many unknowns as measured numbers: nothing is left to check the result against");
  }
  return out;
}

}  // namespace flexcomp::host
