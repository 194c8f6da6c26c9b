// SPDX-License-Identifier: Apache-2.0
/// \file
/// A diagnosis as text for the terminal.
#ifndef FLEXCOMP_HOST_COMMANDS_DIAGNOSIS_TEXT_HPP
#define FLEXCOMP_HOST_COMMANDS_DIAGNOSIS_TEXT_HPP

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/held_out.hpp"

namespace flexcomp::host {

/// The effects found with their sizes, where what is left was localised, and what could not be tested.
std::vector<std::string> effect_lines(const Diagnosis& d, const Robot& robot);
/// Errors before and after, of the fitted and of the held-out rows.
std::vector<std::string> gap_lines(const Diagnosis& d, const std::optional<HeldOut>& others);

/// What to do now. \param calibration  where the calibration was written \param plan  where the telling poses were
/// written; empty: nowhere
std::vector<std::string> next_steps(const Diagnosis& d, const std::string& calibration,
                                    const std::string& plan);

}  // namespace flexcomp::host

#endif
