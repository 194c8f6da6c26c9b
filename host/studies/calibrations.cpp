// SPDX-License-Identifier: Apache-2.0
#include "studies/calibrations.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <random>
#include <stdexcept>
#include <thread>

#include "flexcomp/forward.hpp"
#include "identification/estimator.hpp"
#include "identification/identifiability.hpp"
#include "identification/parameter_selection.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

constexpr std::uint64_t structure_seed = 1;

Eigen::Vector3d normal_vector(std::normal_distribution<double>& normal, std::mt19937_64& random,
                              double sigma) {
  const double x = sigma * normal(random);
  const double y = sigma * normal(random);
  return {x, y, sigma * normal(random)};
}

/// Expectation of max(0, 1 - |z| s) for a standard normal z.
double expected_score(double relative_sigma) {
  if (!(relative_sigma > 0)) return 1;
  const double limit = 1 / relative_sigma;
  const double density_gap = (1 - std::exp(-0.5 * limit * limit)) / std::sqrt(2 * pi);
  return std::erf(limit / std::sqrt(2.0)) - 2 * relative_sigma * density_gap;
}

/// Minimum-norm least squares solution.
Eigen::VectorXd minimum_norm_solution(const Linearised& lin) {
  return shortest_least_squares(lin.derivative, lin.residual);
}

}  // namespace

std::vector<Observation> clean_rows(const StudiedArm& arm, const std::vector<StudiedPose>& poses,
                                    bool orientations, const NoiseLevel& noise) {
  const auto truth = prepare(arm.truth, arm.robot, arm.name);
  std::vector<Observation> rows;
  Workspace<double, joint_count> ws;
  for (const StudiedPose& pose : poses) {
    Observation row;
    row.q_rad = pose.q_rad;
    row.context = default_context<double>(arm.robot.nominal);
    row.context.payload_kg = pose.payload_kg;
    const Pose<double> measured = forward(*truth, row.q_rad, row.context, ws);
    row.p_m = measured.position;
    row.R = measured.rotation;
    row.has_orientation = orientations;
    row.whitening.topLeftCorner<3, 3>().diagonal().setConstant(1 / noise.position_sigma_m);
    if (orientations)
      row.whitening.bottomRightCorner<3, 3>().diagonal().setConstant(1 / noise.orientation_sigma_rad);
    rows.push_back(row);
  }
  return rows;
}

std::vector<Eigen::Vector3d> position_errors_m(const StudiedArm& arm, const TermSet& terms,
                                               const std::vector<Observation>& rows) {
  const auto model = prepare(terms, arm.robot, arm.name);
  Workspace<double, joint_count> ws;
  std::vector<Eigen::Vector3d> errors;
  for (const Observation& row : rows)
    errors.emplace_back(row.p_m - forward(*model, row.q_rad, row.context, ws).position);
  return errors;
}

Experiment::Experiment(const StudiedArm& arm, const std::vector<StudiedPose>& poses,
                       const ExperimentOptions& options)
    : arm_(arm), options_(options), clean_(clean_rows(arm, poses, options.orientations, options.noise)) {
  const ParametricModel paper = paper_model(arm.robot.nominal, options.model, true);
  start_.set = paper.set;
  Unknowns all{.parameters = paper.parameters};
  all.prior =
      prior_knowledge(paper.set, all.parameters, options.method == Estimation::ours, options.tolerances);
  const Identifiability identifiability =
      analyse_identifiability(arm.robot, clean_, start_, all, structure_seed);
  missing_ = identifiability.missing;
  unknowns_ = identifiability.fitted;
  if (options.fit_all) {
    const Elimination possible = possible_columns(arm.robot, clean_, start_, all, structure_seed);
    unknowns_ = Unknowns();
    for (const std::size_t c : possible.kept) {
      unknowns_.parameters.push_back(all.parameters[c]);
      unknowns_.prior.push_back(all.prior[c]);
    }
  }

  // True values of the fitted parameters: noise-free fit of the complete model at poses that identify it.
  Unknowns complete;
  ParametricModel full = paper_model(arm.robot.nominal, ModelKind::full, true);
  Estimate nominal{.set = full.set};
  const std::vector<Observation> many = clean_rows(
      arm, random_poses(arm, 60, 2, {0.5 * arm.robot.nominal.payload_kg, arm.robot.nominal.payload_kg}),
      options.orientations, options.noise);
  Unknowns every{.parameters = full.parameters};
  const Elimination possible = possible_columns(arm.robot, many, nominal, every, structure_seed);
  for (const std::size_t c : possible.kept) complete.parameters.push_back(every.parameters[c]);
  const Fit without_noise = fit(nominal, complete, many, arm.robot, {.robust = false});
  if (!without_noise.converged) throw std::runtime_error("the noise-free fit did not converge");
  at_truth_ = without_noise.estimate;
  truth_.resize(static_cast<Eigen::Index>(unknowns_.parameters.size()));
  for (std::size_t p = 0; p < unknowns_.parameters.size(); ++p) {
    const auto same = std::ranges::find(every.parameters, unknowns_.parameters[p].name, &Parameter::name);
    truth_[static_cast<Eigen::Index>(p)] = same->get(at_truth_.set);
  }
}

Estimate Experiment::calibrate(std::uint64_t seed) const {
  std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)};
  std::mt19937_64 random(sequence);
  std::normal_distribution<double> normal;
  std::vector<Observation> rows = clean_;
  for (Observation& row : rows) {
    row.p_m += normal_vector(normal, random, options_.noise.position_sigma_m);
    row.R = rotation_of(normal_vector(normal, random, options_.noise.orientation_sigma_rad)) * row.R;
  }
  return from(rows);
}

Estimate Experiment::from(const std::vector<Observation>& measured) const {
  if (options_.method == Estimation::m_lm || options_.method == Estimation::ours) {
    const bool robust = options_.method == Estimation::ours;
    return fit(start_, unknowns_, measured, arm_.robot, {.robust = robust}).estimate;
  }
  std::vector<Observation> rows = measured;
  if (options_.method == Estimation::unweighted) {
    for (Observation& row : rows) {
      row.whitening.topLeftCorner<3, 3>().diagonal().setConstant(1e3);
      if (row.has_orientation) row.whitening.bottomRightCorner<3, 3>().diagonal().setConstant(1);
    }
  }
  const auto model = prepare(start_.set, arm_.robot, arm_.name);
  Estimate estimate = start_;
  move(estimate, unknowns_, minimum_norm_solution(linearised(start_, *model, rows, unknowns_)));
  return estimate;
}

Eigen::VectorXd Experiment::values(const Estimate& estimate) const {
  Eigen::VectorXd v(truth_.size());
  for (Eigen::Index p = 0; p < v.size(); ++p)
    v[p] = unknowns_.parameters[static_cast<std::size_t>(p)].get(estimate.set);
  return v;
}

Eigen::VectorXd Experiment::scores(const Estimate& estimate) const {
  return (1 - (values(estimate) - truth_).array().abs() / truth_.array().abs()).max(0.0);
}

Eigen::MatrixXd Experiment::cramer_rao() const {
  const auto model = prepare(at_truth_.set, arm_.robot, arm_.name);
  // at_truth_ has the terms of the full model, unknowns_ indexes those of the fitted one: match by name.
  Unknowns there;
  const ParametricModel full = paper_model(arm_.robot.nominal, ModelKind::full, true);
  for (const Parameter& p : unknowns_.parameters) {
    there.parameters.push_back(*std::ranges::find(full.parameters, p.name, &Parameter::name));
  }
  const Eigen::MatrixXd j = linearised(at_truth_, *model, clean_, there).derivative;
  const Eigen::VectorXd units = units_of(there, at_truth_.set);
  const Eigen::MatrixXd information = j.transpose() * j;
  const Eigen::MatrixXd covariance = Ldlt(information).inverse();
  return units.asDiagonal() * covariance * units.asDiagonal();
}

double Experiment::cramer_rao_score() const {
  if (!missing_.empty()) return 0;
  const Eigen::VectorXd sigma = cramer_rao().diagonal().cwiseMax(0).cwiseSqrt();
  double sum = 0;
  for (Eigen::Index p = 0; p < sigma.size(); ++p) sum += expected_score(sigma[p] / std::abs(truth_[p]));
  return sum / static_cast<double>(sigma.size());
}

void for_each_repeat(std::size_t count, const std::function<void(std::size_t)>& work) {
  std::vector<std::thread> others;
  std::exception_ptr failure;
  std::mutex failing;
  std::atomic<std::size_t> next{0};
  const auto worker = [&] {
    try {
      for (std::size_t k = next++; k < count; k = next++) work(k);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(failing);
      failure = std::current_exception();
      next = count;
    }
  };
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  for (unsigned t = 1; t < cores; ++t) others.emplace_back(worker);
  worker();
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

double Score::error_of_mean() const { return sigma / std::sqrt(static_cast<double>(repeats)); }

double Score::repeats_for_one_percent() const {
  constexpr double two_sided_95 = 1.959964;
  return std::ceil(std::pow(two_sided_95 * sigma / (0.01 * mean), 2));
}

Score repeated_score(const Experiment& experiment, std::size_t repeats, std::uint64_t seed) {
  std::vector<Eigen::VectorXd> scores(repeats);
  for_each_repeat(
      repeats, [&](std::size_t k) { scores[k] = experiment.scores(experiment.calibrate((seed << 32) + k)); });
  Score out;
  out.repeats = repeats;
  out.of_parameter = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(experiment.fitted()));
  double squares = 0;
  for (const Eigen::VectorXd& s : scores) {
    out.of_parameter += s / static_cast<double>(repeats);
    out.mean += s.mean() / static_cast<double>(repeats);
  }
  for (const Eigen::VectorXd& s : scores) squares += std::pow(s.mean() - out.mean, 2);
  if (repeats > 1) out.sigma = std::sqrt(squares / static_cast<double>(repeats - 1));
  return out;
}

}  // namespace flexcomp::host
