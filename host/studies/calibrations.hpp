// SPDX-License-Identifier: Apache-2.0
/// \file
/// Calibrations repeated with fresh noise: what a study counts.
#ifndef FLEXCOMP_HOST_STUDIES_CALIBRATIONS_HPP
#define FLEXCOMP_HOST_STUDIES_CALIBRATIONS_HPP

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "identification/residuals.hpp"
#include "measurement/noise_level.hpp"
#include "measurement/observation.hpp"
#include "model/effects.hpp"
#include "model/tolerance.hpp"
#include "studies/paper.hpp"

namespace flexcomp::host {

/// How parameters come from residuals.
enum class Estimation {
  m_lm,  ///< modified Levenberg-Marquardt (Eq. 36, 37), whitened, every row in full, no bounds: the paper's
  ours,  ///< the default of `identify`: bounded compliances, robust loss
  least_squares,  ///< one linear solution with H of the nominal arm (Eq. 24), whitened
  unweighted,     ///< the same on millimetres and radians as they are
};

struct ExperimentOptions {
  bool orientations = true;  ///< false: positions only
  ModelKind model = ModelKind::full;
  Estimation method = Estimation::m_lm;
  NoiseLevel noise = noise_n1;
  std::vector<Tolerance> tolerances;
  /// Fit what random poses of this kind would know even where these poses know it badly or not at all (where nothing
  /// is known, least squares give the smallest solution). false: what is_knowable says.
  bool insist = false;
};

/// Poses of an assumed true arm and the model that is fitted there. Poses, truth and model stay; noise is drawn.
class Experiment {
 public:
  Experiment(const StudiedArm& arm, const std::vector<StudiedPose>& poses, const ExperimentOptions& options);

  std::size_t fitted() const { return unknowns_.parameters.size(); }
  const std::vector<Parameter>& parameters() const { return unknowns_.parameters; }
  /// Parameters that random poses of the kind would know and these do not.
  const std::vector<std::string>& missing() const { return missing_; }

  /// True values of the fitted parameters in SI, with what they are lumped with (d1 + base z): the errors of the model
  /// that is complete and fitted without noise at many poses.
  const Eigen::VectorXd& truth() const { return truth_; }

  /// The same rows with noise of its own for each seed, and what is made of them.
  Estimate calibrate(std::uint64_t seed) const;
  Estimate calibrate_without_noise() const { return from(clean_); }
  Eigen::VectorXd values(const Estimate& estimate) const;  ///< of the fitted parameters, SI

  /// max(0, 1 - |estimate - true| / |true|) of each fitted parameter (docs/model.md, M50).
  Eigen::VectorXd scores(const Estimate& estimate) const;

  /// The mean score of estimates that are normal around the truth with the smallest covariance that unbiased ones can
  /// have (Cramér, Rao); 0 where the poses do not know every parameter.
  double cramer_rao_score() const;
  /// That covariance, in SI; at the truth.
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

/// Rows as an instrument without noise would see them; weights are those of the noise level.
std::vector<Observation> clean_rows(const StudiedArm& arm, const std::vector<StudiedPose>& poses,
                                    bool orientations, const NoiseLevel& noise);

/// Does work(k) for k = 0 … count - 1 on all cores; whatever they are, the same results.
void for_each_repeat(std::size_t count, const std::function<void(std::size_t)>& work);

/// Mean and spread of the score over repeats.
struct Score {
  double mean = 0;
  double sigma = 0;  ///< standard deviation of one repeat
  std::size_t repeats = 0;
  Eigen::VectorXd of_parameter;  ///< mean per fitted parameter

  double error_of_mean() const;
  /// Repeats after which the mean is within 1 % of itself with a probability of 95 %.
  double repeats_for_one_percent() const;
};

Score repeated_score(const Experiment& experiment, std::size_t repeats, std::uint64_t seed);

}  // namespace flexcomp::host

#endif
