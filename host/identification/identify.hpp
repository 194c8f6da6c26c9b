// SPDX-License-Identifier: Apache-2.0
/// \file
/// Identifies a calibration from measured rows: identifiable parameters, estimates, uncertainty.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "identification/estimator.hpp"
#include "identification/parameter_selection.hpp"
#include "identification/statistics.hpp"
#include "measurement/repeats.hpp"
#include "model/calibration.hpp"
#include "model/paper_model.hpp"
#include "model/tolerance.hpp"

namespace flexcomp::host {

enum class FrameChoice { by_distance, nominal, fit };

/// Parameter that is not fitted, with its given value.
struct FixedParameter {
  std::string name;
  double value_si = 0;
};

struct IdentifyOptions {
  ModelKind model = ModelKind::full;
  FrameChoice frames = FrameChoice::by_distance;
  std::vector<FixedParameter> fixed = {};
  std::vector<Tolerance> tolerances = {};  ///< of parameters by name; later ones win
  bool physical = true;                    ///< bounds compliances at zero
  bool force = false;                      ///< accept residuals that suggest another unit or arm
  std::uint64_t seed = 1;  ///< of the 1,000 random reference poses of the identifiability analysis
  EstimatorOptions estimator = {};
};

/// Errors of the nominal arm.
struct Before {
  ErrorStatistics nominal_frames;
  std::optional<ErrorStatistics> fitted_frames;  ///< from four rows on
};

struct Identification {
  Calibration calibration;
  std::size_t parameters = 0;    ///< of the model, without F and E
  std::size_t identifiable = 0;  ///< of these, in these data
  std::size_t frame_parameters = 0;
  Identifiability identifiability;  ///< identifiable, confounded and missing parameters; suggested poses
  Fit fit;                          ///< of identifiability.fitted
  double condition = 0;             ///< of the whitened, scaled columns of the parameters
  double o1 = 0;                    ///< (product of their singular values)^(1/L) / sqrt(n), Borm and Menq
  Before before;
  ErrorStatistics after;
  std::vector<RowResidual> nominal;    ///< before, in fitted frames where the model has them, per row
  std::vector<RowResidual> residuals;  ///< after, per row
  std::vector<std::size_t> outliers;   ///< down-weighted rows, by index
  std::optional<PureError>
      pure_error;  ///< of repeated rows without outliers; nothing where none are repeated
  /// Reasons why the result is not reliable; empty where it is.
  std::vector<std::string> doubts;
};

/// Identifies the paper's model from rows: identifiability (M33), fit (M34), uncertainty (M40).
/// \param source  names the data in messages
/// \throws InputError  a fixed parameter or a tolerance of one that the model does not have; residuals to the
///                     nominal arm over 100 times the usual ones (metres for millimetres, another arm), unless
///                     options.force; a fitted base above 20 mm or 2 degrees
Identification identify(const Robot& robot, const std::vector<Observation>& rows, const std::string& source,
                        const IdentifyOptions& options);

/// Errors of the nominal arm, in nominal and in fitted frames. \param fitted  receives the fitted frames, may be null
Before errors_before(const Robot& robot, const std::vector<Observation>& rows, Estimate* fitted = nullptr);

/// Estimates the measurement frames F (robot base in the instrument's frame) and E (measured point in Ftool), Eq. (M2), for
/// given terms (none: the nominal arm): start by least squares from 24 rotations, then robust refinement. Parameters that the
/// rows leave open keep their start.
Estimate fit_frames(const TermSet& set, const std::vector<Observation>& rows, const Robot& robot);

/// True where the nominal frames (F = E = 1) miss the median row by more than 20 mm or 2 degrees.
bool nominal_frames_are_off(const std::vector<RowResidual>& nominal, const std::vector<Observation>& rows);

/// Refuses residuals to the nominal arm above 100 times the usual 0.5 mm per metre of reach: another unit or arm.
/// \throws InputError
void require_plausible_residuals(const Robot& robot, const std::vector<Observation>& rows,
                                 const std::string& source, const Before& before);

/// What is said of one fitted parameter, in the unit of files.
struct FittedParameter {
  std::string name;
  double value = 0;
  double sigma = 0;
  double low = 0;
  double high = 0;
  bool at_bound = false;
  /// Different from the nominal arm beyond chance: zero lies outside the 95 % interval.
  bool significant() const { return low > 0 || high < 0; }
};

std::vector<FittedParameter> fitted_parameters(const Identification& r);

}  // namespace flexcomp::host
