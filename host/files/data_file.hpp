// SPDX-License-Identifier: Apache-2.0
/// \file
/// Reads and writes measured data and targets (docs/files.md).
#pragma once

#include <string>
#include <vector>

#include "measurement/measured_data.hpp"
#include "model/targets.hpp"

namespace flexcomp::host {

/// Tolerance of joint limits for readings that were rounded when written, rad.
constexpr double limit_tolerance_rad = 1e-9;

struct LoadOptions {
  bool force = false;  ///< accept suspicious values (radians for degrees); invalid ones are always refused
};

/// Reads measured data (docs/files.md, data file).
/// A row whose |norm - 1| of the quaternion exceeds 1e-3 is refused, below that it is normalised.
/// \throws InputError  file:line: column for: a missing column, an empty cell, what is not a finite number, a reading
///                     beyond its limit in the robot file, dir not -1, 0 or 1, a sigma that is not positive, a row that
///                     repeats another one in all its values, no rows; no reading above 7 degrees in three rows or
///                     more (suspicion of radians; not where options.force)
MeasuredData load_data(const std::string& path, const Robot& robot, const LoadOptions& options = {});

/// Reads joints and context: as load_data(), but measured columns may be absent and rows may repeat.
MeasuredData load_joints(const std::string& path, const Robot& robot, const LoadOptions& options = {});

/// Formats a data file, from which the identical doubles are read back. Default contexts are not written.
std::string data_text(const MeasuredData& data);

/// Writes data_text() atomically. \throws std::runtime_error where the file cannot be written
void save_data(const std::string& path, const MeasuredData& data);

/// Names of the context columns: payload_kg, move1_deg …, temp_c, fx_n …; not time_s.
const std::vector<std::string>& context_names();

/// Column with the instrument's name of the point: passed through without a warning.
constexpr const char* point_label = "point";

/// Names of the joint and context columns, for files that begin with them.
std::vector<std::string> joint_and_context_names(const ContextColumns& columns);
/// Cells of these columns.
std::vector<std::string> joint_and_context_cells(const ContextColumns& columns, const Measurement& row);

/// Reads targets: joint commands, or poses with seeds. Joint commands beyond a limit are accepted: the
/// controller's status reports them per row.
/// \throws InputError  as load_data(), and for a pose without seeds
TargetsFile load_targets(const std::string& path, const Robot& robot, const LoadOptions& options = {});

}  // namespace flexcomp::host
