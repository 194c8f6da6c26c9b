// SPDX-License-Identifier: Apache-2.0
/// \file
/// Results as text for the terminal. Each kind of result has a source of its own beside this header; errors before and after,
/// which identify, validate and diagnose show, are in accuracy.cpp.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/held_out.hpp"
#include "identification/identify.hpp"
#include "model/set_difference.hpp"
#include "planning/plan_result.hpp"

namespace flexcomp::host {

// --- Errors before and after

/// The three or two lines of a table: before (nominal frames, fitted frames) and after.
std::string accuracy_table(const Before& before, const ErrorStatistics& after);

/// The same of an arm that was driven with corrected commands: one line.
std::string accuracy_table(const ErrorStatistics& corrected);

/// Warns of down-weighted rows by their lines, the first eight of them.
void add_outlier_warning(std::vector<std::string>& warnings, const std::string& data,
                         const std::vector<Observation>& rows, const std::vector<std::size_t>& outliers);

/// Joins doubts into one message, each on a line of its own.
std::string joined(const std::vector<std::string>& lines);

// --- A diagnosis

/// The effects found with their sizes, where what is left was localised, and what could not be tested.
std::vector<std::string> effect_lines(const Diagnosis& d, const Robot& robot);
/// Errors before and after, of the fitted and of the held-out rows.
std::vector<std::string> gap_lines(const Diagnosis& d, const std::optional<HeldOut>& others);

/// What to do now. \param calibration  where the calibration was written \param plan  where the telling poses were
/// written; empty: nowhere
std::vector<std::string> next_steps(const Diagnosis& d, const std::string& calibration,
                                    const std::string& plan);

// --- What a new parameter set changes

/// A line for each parameter that changes, and what all of them do at the tool.
std::string difference_table(const SetDifference& d);

// --- An identification

/// \param data, out  the files
/// \param rows       how many were fitted
std::vector<std::string> text_lines(const Identification& r, const Robot& robot, const std::string& data,
                                    std::size_t rows, const std::string& out);

/// Why the result is not trustworthy, with the poses that would identify them.
std::string doubts_text(const Identification& r);

// --- A plan

std::vector<std::string> text_lines(const PlanTask& task, const PlanResult& result,
                                    const std::string& output);
/// The methods beside each other.
std::vector<std::string> comparison_lines(const PlanResult& result);

}  // namespace flexcomp::host
