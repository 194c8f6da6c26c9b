// SPDX-License-Identifier: Apache-2.0
/// \file
/// Answer of a diagnosis: verdict, effects with their uncertainty, places of the misfit, calibration before and after.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "identification/parameter_selection.hpp"
#include "identification/statistics.hpp"
#include "model/calibration.hpp"
#include "model/effects.hpp"

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

/// Another effect that fits these rows almost as well as the chosen one: confounded with it.
struct Rival {
  EffectId id;
  double delta_bic = 0;  ///< BIC with this name less BIC with the chosen one; below decisive_bic
};

/// A curve where it was measured, beyond its mean there.
struct CurveSpan {
  double low_rad = 0, high_rad = 0;  ///< least and greatest turn at the measured readings
  double sigma_rad = 0;              ///< median standard deviation there
};

/// An effect of the catalogue that was identified.
struct FoundEffect {
  EffectId id;
  std::vector<EffectCoefficient> coefficients;
  std::optional<CurveSpan> curve;  ///< of a joint curve
  double p_value = 1;              ///< of the whole catalogue under permuted poses (D17)
  double delta_bic = 0;            ///< BIC of the final model without this effect less BIC with it
  double cross_validation = 0;     ///< share of the chi-square on left-out poses that the effect takes away
  double largest_m = 0;  ///< largest shift of the measured point that it causes at the measured poses
  double rms_m = 0;      ///< its root mean square
  bool pushed = true;    ///< false: belongs to the measurement
  std::vector<Rival> confounded_with;
};

/// An effect of the catalogue that these rows cannot test.
struct NotTestable {
  Effect effect = Effect::geometric;
  std::vector<std::string> needs;  ///< columns that are absent, or never vary
};

/// Share of the misfit that a motion of one place alone explains, free from pose to pose (D6).
struct PlaceShare {
  Place place;
  double explains = 0;  ///< share of the squared whitened misfit beyond what noise would give it, 0 … 1
  double p_value = 1;   ///< that noise alone explains as much
};

/// Location of a misfit in the chain, and the covariates that it depends on.
struct Misfit {
  Place place;
  unsigned joint = 0;  ///< from 1, that moves wrongly; 0: base, tool or point
  /// q2, payload_kg, …; order: of measurement; empty: nothing that was recorded.
  std::vector<std::string> covariates;
  std::vector<std::optional<double>> around_deg;  ///< per covariate: where it is concentrated, where it is
  double explains = 0;                            ///< share of the misfit
  double p_value = 1;
};

/// Errors after one more effect entered the model, largest gain first.
struct DiagnosisStep {
  std::string what;        ///< e.g. "joint_curve[joint=3] added"
  double train_rms_m = 0;  ///< 3-D position error after it
  double chi2_per_dof = 0;
  double cross_validated = 0;  ///< chi-square per measured number on left-out poses
};

/// A joint whose curve is carried, named or not.
struct CarriedCurve {
  unsigned joint = 0;   ///< from 1
  double size_rad = 0;  ///< standard deviation of the curve, by its marginal likelihood
  bool sure = false;    ///< it gains as much as a name must
  bool named = false;   ///< it is among the effects
  CurveSpan span = {};
};

/// What no name explains, carried by curves of joints (D19, D20).
struct Remainder {
  std::vector<CarriedCurve> curves;
  double corner = 0;             ///< periods per turn up to which their common spectrum is flat
  double gain = 0;               ///< 2 ln of the Bayes factor against no curves
  double cross_validated = 0;    ///< chi-square per measured number on left-out poses
  double cross_validation = 0;   ///< share of it that they take away
  double position_noise = 1;     ///< noise that is left over the declared one, standard deviations
  double orientation_noise = 1;  ///< the same of orientations

  bool is_unnamed() const {
    return std::ranges::any_of(curves, [](const CarriedCurve& c) { return c.sure && !c.named; });
  }
};

struct Diagnosis {
  Verdict verdict = Verdict::none;
  std::vector<FoundEffect> effects;  ///< what was named, measurement effects too; never an unnamed one
  std::vector<NotTestable> not_testable;
  std::vector<EffectId> dropped;  ///< less than 1e-3 of their columns is left after the projection (D1)
  std::optional<Remainder> remainder;
  std::optional<Misfit> where;  ///< of the gap: the remaining one if unnamed, else that of the first effect
  std::vector<PlaceShare> places;       ///< of the model at the start, largest first
  std::vector<PlaceShare> places_left;  ///< of the final model
  std::vector<DiagnosisStep> steps;     ///< first the model at the start
  /// At which confounded effects differ, best first; empty where none are confounded.
  std::vector<SuggestedPose> discriminating_poses;
  Calibration before;  ///< the model at the start
  Calibration after;   ///< with what was found; an unnamed function as effect `unnamed`
  std::vector<RowResidual> residuals_before, residuals_after;  ///< per row
  std::vector<std::size_t> outliers;                           ///< down-weighted rows, by index
  ErrorStatistics error_before, error_after;                   ///< of the rows that were fitted
  double noise_floor_m = 0;  ///< sqrt(mean over rows of the trace of the position's covariance)
  double chi2_per_dof_before = 0, chi2_per_dof_after = 0;  ///< outliers left out
  double degrees_of_freedom_after = 0;
  std::vector<std::string> notes;   ///< on noise, outliers, what is missing
  std::vector<std::string> doubts;  ///< why the result must not be relied on; empty where it may
};

/// Called with what is being done and the share of it that is done, 0 … 1.
using DiagnosisProgress = std::function<void(const std::string&, double)>;

/// Effects closer than this in BIC are confounded (Kass and Raftery 1995: 10 is decisive).
constexpr double decisive_bic = 10;

}  // namespace flexcomp::host
