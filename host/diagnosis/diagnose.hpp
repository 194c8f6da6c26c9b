// SPDX-License-Identifier: Apache-2.0
/// \file
/// Diagnosis of the misfit between a calibrated model and measured rows: which effects are missing, with a calibration that
/// has them. docs/diagnosis.md has the equations (D1) to (D20).
///
/// Stages, bottom up; each header includes only headers that stand before it in this table:
///
/// | stage | computes | equation, reference |
/// |---|---|---|
/// | result | what diagnose() answers | |
/// | candidates | effects of the catalogue that the rows can test, as parameters | docs/model.md, M5 |
/// | gap_system | whitened residual and candidates' columns, nuisance parameters projected out | D1; docs/model.md, M31 to M33 |
/// | subset_search | gain of a subset by BIC or evidence, beam search | D2 (Schwarz 1978), D3 (MacKay 1992), D4 |
/// | residual_analysis | residual of a solution, share of each place | D5, D6 (Satterthwaite 1946) |
/// | local_faults | scans for local faults of a joint and steps of the measured point | D7, D8 |
/// | smooth_functions, bump_functions | unnamed functions of one or two covariates, their relevant members | D9, D10, D11 (Tipping 2001) |
/// | cross_validation | leave-one-pose-out prediction, pruning | D12 (Allen 1974) |
/// | hypothesis, scanned_blocks | what a search selects; blocks that scans add | |
/// | joint_curves | curves of all joints, their sizes and spectrum | D19, D20 (MacKay 1992; Rasmussen and Williams 2006) |
/// | smooth_table, refit | nonlinear fit with the selected hypotheses | D16; docs/model.md, M34 to M40 |
/// | outlier_hypotheses | outliers or structure | D13 |
/// | effect_search | the search: selection, pruning, outliers, lack of fit; search and refit in turns | D14 |
/// | remainder | what no name explains, carried; names beside it | D19, D20 |
/// | scatter | places that scatter from pose to pose, as the alternative | D15 |
/// | found_effects | p-values, confounded effects, sizes | D17 |
/// | discriminating_poses | poses that separate confounded effects | D18 (Atkinson and Fedorov 1975) |
///
/// Readers of the result: messages, effect_profile, held_out.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/result.hpp"
#include "measurement/measured_data.hpp"
#include "measurement/observation.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

struct DiagnoseOptions {
  /// Where to start; nothing: the full model of the paper is identified first.
  std::optional<Calibration> start;
  ContextColumns columns;  ///< which the data have
  bool force = false;      ///< as IdentifyOptions::force
  std::uint64_t seed = 1;
  DiagnosisProgress progress;  ///< may be empty
};

/// Searches the effects that explain the misfit of a model, refits with them, and tests what is left.
/// \param source  names the data in messages
/// \throws InputError  as identify()
Diagnosis diagnose(const Robot& robot, const std::vector<Observation>& rows, const std::string& source,
                   const DiagnoseOptions& options);

}  // namespace flexcomp::host
