// SPDX-License-Identifier: Apache-2.0
/// \file
/// Repeated calibrations of a simulated arm with random noise, their scores and Cramér-Rao limits.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "identification/residuals.hpp"
#include "measurement/observation.hpp"
#include "measurement/simulation.hpp"
#include "model/paper_model.hpp"
#include "model/tolerance.hpp"
#include "studies/paper.hpp"

namespace flexcomp::host {

/// Estimator.
enum class Estimation {
  m_lm,  ///< the paper's modified Levenberg-Marquardt (Chen 36, 37), whitened, without weights and bounds
  ours,  ///< the default of `identify`: bounded compliances, robust loss
  least_squares,  ///< one linear solution with H of the nominal arm (Chen 24), whitened
  unweighted,     ///< the same in mm and rad, unweighted
};

struct ExperimentOptions {
  bool orientations = true;  ///< false: positions only
  ModelKind model = ModelKind::full;
  Estimation method = Estimation::m_lm;
  NoiseLevel noise = noise_n1;
  std::vector<Tolerance> tolerances = {};
  /// True: fit all parameters that random poses of this kind identify, also those that these poses do not
  /// (least squares then give the minimum-norm solution). False: those that analyse_identifiability() selects.
  bool fit_all = false;
};

/// Simulated experiment: an assumed true arm, poses, and the fitted model. Each calibration draws its own noise.
class Experiment {
 public:
  Experiment(const StudiedArm& arm, const std::vector<StudiedPose>& poses, const ExperimentOptions& options);

  std::size_t fitted() const { return unknowns_.parameters.size(); }
  const std::vector<Parameter>& parameters() const { return unknowns_.parameters; }
  /// Parameters that random poses of the kind identify, but these poses do not.
  const std::vector<std::string>& missing() const { return missing_; }

  /// True values of the fitted parameters, SI, including confounded ones (d1 + base z): from a noise-free fit of the
  /// complete model at many poses.
  const Eigen::VectorXd& truth() const { return truth_; }

  /// Estimate from the rows with random noise of this seed.
  Estimate calibrate(std::uint64_t seed) const;
  Estimate calibrate_without_noise() const { return from(clean_); }
  Eigen::VectorXd values(const Estimate& estimate) const;  ///< of the fitted parameters, SI

  /// Score max(0, 1 - |estimate - true| / |true|) of each fitted parameter, Eq. (M50).
  Eigen::VectorXd scores(const Estimate& estimate) const;

  /// Expected mean score of estimates that are normal around the truth with the Cramér-Rao covariance; 0 where
  /// the poses do not identify every parameter.
  double cramer_rao_score() const;
  /// Cramér-Rao covariance (inverse information matrix) at the truth, SI.
  Eigen::MatrixXd cramer_rao() const;

  const Estimate& at_truth() const { return at_truth_; }
  const Unknowns& unknowns() const { return unknowns_; }

 private:
  Estimate from(const std::vector<Observation>& rows) const;

  StudiedArm arm_;
  ExperimentOptions options_;
  std::vector<Observation> clean_;
  Unknowns unknowns_;
  Estimate start_;
  Estimate at_truth_;
  Eigen::VectorXd truth_;
  std::vector<std::string> missing_;
};

/// Noise-free rows of an arm; the whitening is that of the noise level.
std::vector<Observation> clean_rows(const StudiedArm& arm, const std::vector<StudiedPose>& poses,
                                    bool orientations, const NoiseLevel& noise);

/// True position of each row less the position of an arm with these terms, m.
std::vector<Eigen::Vector3d> position_errors_m(const StudiedArm& arm, const TermSet& terms,
                                               const std::vector<Observation>& rows);

/// Runs work(k) for k = 0 … count - 1 on all cores; the results do not depend on their number.
void for_each_repeat(std::size_t count, const std::function<void(std::size_t)>& work);

/// Mean and standard deviation of the score over repeats.
struct Score {
  double mean = 0;
  double sigma = 0;  ///< standard deviation of one repeat
  std::size_t repeats = 0;
  Eigen::VectorXd of_parameter;  ///< mean per fitted parameter

  double error_of_mean() const;
  /// Repeats after which the 95 % interval of the mean is ±1 % of it.
  double repeats_for_one_percent() const;
};

/// Scores of `repeats` calibrations with independent noise.
Score repeated_score(const Experiment& experiment, std::size_t repeats, std::uint64_t seed);

}  // namespace flexcomp::host
