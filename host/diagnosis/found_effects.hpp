// SPDX-License-Identifier: Apache-2.0
/// \file
/// Uncertainty of the selected effects: coefficients, sizes, p-values (D17), confounded effects, and errors step by step.
#pragma once

#include <cstdint>
#include <vector>

#include "diagnosis/effect_search.hpp"
#include "diagnosis/residual_analysis.hpp"

namespace flexcomp::host {

/// The effects of the catalogue in a selection, largest gain first.
/// \param left  residual of the selection, which is permuted for the p-values \param seed  of the permutations
std::vector<FoundEffect> found_effects(const Robot& robot, const Selection& selection,
                                       const ResidualAnalysis& left, const LeftOutPoses& left_out,
                                       std::uint64_t seed);
/// The curve of a group of a refit at the measured readings; nothing of other effects.
std::optional<CurveSpan> curve_span(const Refit& refit, const EffectGroup& group,
                                    const std::vector<Observation>& rows);

/// Errors of the start, and after each effect and unnamed function that is added in turn.
std::vector<DiagnosisStep> steps_of(const Selection& selection, const std::vector<FoundEffect>& effects,
                                    const LeftOutPoses& left_out);

/// Where a named effect acts, as a misfit of the start.
Misfit misfit_of(const FoundEffect& effect, const std::vector<PlaceShare>& places);

}  // namespace flexcomp::host
