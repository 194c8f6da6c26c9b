// SPDX-License-Identifier: Apache-2.0
/// \file
/// Errors before and after as text for the terminal, for identify, validate and diagnose.
#ifndef FLEXCOMP_HOST_COMMANDS_ACCURACY_HPP
#define FLEXCOMP_HOST_COMMANDS_ACCURACY_HPP

#include <string>
#include <vector>

#include "identification/identify.hpp"

namespace flexcomp::host {

/// The three or two lines of a table: before (nominal frames, fitted frames) and after.
std::string accuracy_table(const Before& before, const ErrorStatistics& after);

/// The same of an arm that was driven with corrected commands: one line.
std::string accuracy_table(const ErrorStatistics& corrected);

/// Warns of down-weighted rows by their lines, the first eight of them.
void add_outlier_warning(std::vector<std::string>& warnings, const std::string& data,
                         const std::vector<Observation>& rows, const std::vector<std::size_t>& outliers);

/// Joins doubts into one message, each on a line of its own.
std::string joined(const std::vector<std::string>& lines);

}  // namespace flexcomp::host

#endif
