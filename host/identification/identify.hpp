// SPDX-License-Identifier: Apache-2.0
/// \file
/// Identifies a calibration from measured rows: identifiable parameters, estimates, uncertainty.
#ifndef FLEXCOMP_HOST_IDENTIFICATION_IDENTIFY_HPP
#define FLEXCOMP_HOST_IDENTIFICATION_IDENTIFY_HPP

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "identification/estimator.hpp"
#include "identification/frames.hpp"
#include "identification/parameter_selection.hpp"
#include "identification/statistics.hpp"
#include "measurement/repeats.hpp"
#include "model/calibration.hpp"
#include "model/effects.hpp"
#include "model/tolerance.hpp"

namespace flexcomp::host {

/// A parameter that is known from elsewhere and not fitted.
struct FixedParameter {
  std::string name;
  double value_si = 0;
};

struct IdentifyOptions {
  ModelKind model = ModelKind::full;
  FrameChoice frames = FrameChoice::by_distance;
  std::vector<FixedParameter> fixed;
  std::vector<Tolerance> tolerances;  ///< of parameters by name; later ones win
  bool physical = true;               ///< compliances are kept at or above zero
  bool force = false;                 ///< go on where the data look like another unit or another arm
  std::uint64_t seed = 1;             ///< of the 1,000 random reference poses of the identifiability analysis
  EstimatorOptions estimator;
};

struct Before {
  ErrorStatistics nominal_frames;
  std::optional<ErrorStatistics> fitted_frames;  ///< nothing where the rows are too few for a frame
};

struct Identification {
  Calibration calibration;
  std::size_t parameters = 0;    ///< of the model, without F and E
  std::size_t identifiable = 0;  ///< of these, in these data
  std::size_t frame_parameters = 0;
  Identifiability known;  ///< what these data identify, what they do not, and poses that would
  Fit fit;                ///< of known.fitted
  double condition = 0;   ///< of the whitened, scaled columns of the parameters
  double o1 = 0;          ///< (product of their singular values)^(1/L) / sqrt(n), Borm and Menq
  Before before;
  ErrorStatistics after;
  std::vector<RowResidual> nominal;    ///< before, in fitted frames where the model has them, per row
  std::vector<RowResidual> residuals;  ///< after, per row
  std::vector<std::size_t> outliers;   ///< down-weighted rows, by index
  std::optional<PureError>
      pure_error;  ///< of repeated rows, outliers left out; nothing where none are repeated
  /// Why the result must not be relied on; empty where it may.
  std::vector<std::string> doubts;
};

/// \param source  names the data in messages
/// \throws InputError  a fixed parameter or a tolerance of one that the model does not have; residuals to the nominal arm over 100 times what an arm of this size usually has (metres for
///                     millimetres, another arm), unless options.force; a fitted base above 20 mm or 2 degrees
Identification identify(const Robot& robot, const std::vector<Observation>& rows, const std::string& source,
                        const IdentifyOptions& options);

/// Errors of the nominal arm, in nominal and in fitted frames. `model` (optional) receives the fitted frames.
Before errors_before(const Robot& robot, const std::vector<Observation>& rows, Estimate* fitted = nullptr);

/// \throws InputError  the rows are further from the nominal arm than any arm of this size: another unit, another arm
void refuse_the_implausible(const Robot& robot, const std::vector<Observation>& rows,
                            const std::string& source, const Before& before);

}  // namespace flexcomp::host

#endif
