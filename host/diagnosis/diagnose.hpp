// SPDX-License-Identifier: Apache-2.0
/// \file
/// Where model and measurement still disagree: find it, name it, add it to the model, and show that the gap shrinks.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_DIAGNOSE_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_DIAGNOSE_HPP

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "identification/estimator.hpp"
#include "identification/parameter_selection.hpp"
#include "identification/statistics.hpp"
#include "measurement/measured_data.hpp"
#include "measurement/observation.hpp"
#include "model/calibration.hpp"
#include "model/effects.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

enum class Verdict {
  none,    ///< the model explains the data down to the noise
  named,   ///< effects were found and nothing is left
  unnamed  ///< something is left that no effect of the catalogue explains
};

/// One identified number of an effect.
struct EffectCoefficient {
  std::string key;   ///< as in files, e.g. sin_rad; of a curve coefficients_rad[0] …
  Unit unit;         ///< of the number in files
  double value = 0;  ///< SI
  double sigma = 0;  ///< standard deviation, SI
};

/// Another name for what was found, which these data cannot tell from it.
struct Rival {
  EffectId id;
  double delta_bic = 0;  ///< BIC with this name less BIC with the chosen one; below telling_bic
};

struct FoundEffect {
  EffectId id;
  std::vector<EffectCoefficient> coefficients;
  double p_value =
      1;  ///< against chance over the whole catalogue (permutations of poses, largest score of all)
  double delta_bic = 0;         ///< BIC of the final model without this effect less BIC with it
  double cross_validation = 0;  ///< share of the chi-square on left-out poses that the effect takes away
  double largest_m = 0;         ///< largest shift of the measured point that it causes at the measured poses
  double rms_m = 0;             ///< its root mean square
  bool pushed = true;           ///< false: belongs to the measurement
  std::vector<Rival> confounded_with;
};

/// An effect of the catalogue that these data cannot speak of.
struct NotTestable {
  Effect effect = Effect::geometric;
  std::vector<std::string> needs;  ///< columns that are absent, or never vary
};

/// How much of what is left a motion of one place alone, free from pose to pose, could explain.
struct PlaceShare {
  Place place;
  double explains = 0;  ///< share of the squared whitened misfit beyond what noise would give it, 0 … 1
  double p_value = 1;   ///< that noise alone explains as much
};

/// Where the model fails, and what the failure follows.
struct Misfit {
  Place place;
  unsigned joint = 0;  ///< from 1, that moves wrongly; 0: base, tool or point
  std::vector<std::string>
      covariates;  ///< q2, payload_kg, …; order: of measurement; empty: nothing that was recorded
  std::vector<std::optional<double>> around_deg;  ///< per covariate: where it is concentrated, where it is
  double explains = 0;                            ///< share of the misfit
  double p_value = 1;
};

/// One decision on the way, for the report.
struct DiagnosisStep {
  std::string what;        ///< e.g. "joint_curve[joint=3] added"
  double train_rms_m = 0;  ///< 3-D position error after it
  double chi2_per_dof = 0;
  double cross_validated = 0;  ///< chi-square per measured number on left-out poses
};

struct DiagnoseOptions {
  /// Where to start; nothing: the full model of the paper is identified first.
  std::optional<Calibration> start;
  ContextColumns columns;  ///< which the data have
  bool force = false;      ///< as IdentifyOptions::force
  std::uint64_t seed = 1;
  /// Called with what is being done and how much of it is done, 0 … 1; may be empty.
  std::function<void(const std::string&, double)> progress;
};

struct Diagnosis {
  Verdict verdict = Verdict::none;
  std::vector<FoundEffect> effects;  ///< what was named, measurement effects too; never an unnamed one
  std::vector<NotTestable> not_testable;
  std::vector<EffectId> dropped;  ///< columns of which less than 1e-3 is left after geometry and frames
  std::optional<Misfit> where;    ///< of the gap: the remaining one if unnamed, else that of the first effect
  std::vector<PlaceShare> places;       ///< of the model at the start, largest first
  std::vector<PlaceShare> places_left;  ///< of the final model
  std::vector<DiagnosisStep> steps;     ///< first the model at the start
  std::vector<SuggestedPose>
      discriminating_poses;  ///< tell confounded names apart, best first; empty where none are
  Calibration before;        ///< the model at the start
  Calibration after;         ///< with what was found; an unnamed remainder as effect `unnamed`
  std::vector<RowResidual> residuals_before, residuals_after;  ///< per row
  std::vector<std::size_t> outliers;                           ///< rows that do not count in full, by index
  ErrorStatistics error_before, error_after;                   ///< of the rows that were fitted
  double noise_floor_m = 0;  ///< sqrt(mean over rows of the trace of the position's covariance)
  double chi2_per_dof_before = 0, chi2_per_dof_after = 0;  ///< outliers left out
  double degrees_of_freedom_after = 0;
  std::vector<std::string> notes;   ///< for people: noise, outliers, what is missing
  std::vector<std::string> doubts;  ///< why the result must not be relied on; empty where it may
};

/// Names closer than this in BIC are confounded (Kass and Raftery 1995: 10 is decisive).
constexpr double telling_bic = 10;

/// \param source  names the data in messages
/// \throws InputError  as identify()
Diagnosis diagnose(const Robot& robot, const std::vector<Observation>& rows, const std::string& source,
                   const DiagnoseOptions& options);

}  // namespace flexcomp::host

#endif
