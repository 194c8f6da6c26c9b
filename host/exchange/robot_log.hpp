// SPDX-License-Identifier: Apache-2.0
/// \file
/// Joint readings as robots and their programs log them: any names of columns, degrees or radians, other signs and zeros.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "exchange/declared_unit.hpp"
#include "exchange/time_stamp.hpp"
#include "model/robot.hpp"
#include "units.hpp"

namespace flexcomp::host {

/// One joint: reading of the model = sign · column + offset.
struct JointColumn {
  std::string column;
  std::optional<Unit> unit;
  double sign = 1;
  double offset_rad = 0;
};

/// Which column is what (docs/formats.md). Empty names are worked out from the header.
struct LogMap {
  std::string path;        ///< of the map, for messages
  std::string columns_by;  ///< what names the joints' columns where it is no map, for messages
  DialectChoice dialect;
  std::optional<std::array<JointColumn, joint_count>> joints;
  UnitSource joint_unit;  ///< where neither the map nor the header has one
  std::string name;       ///< column with the names of the poses
  std::string time;
  std::optional<Unit> time_unit;
  std::vector<std::pair<std::string, std::string>> context;  ///< column of a data file, column of the log
};

/// Reads a map (YAML). \throws InputError  as the other YAML files
LogMap load_log_map(const std::string& path);

struct LogRow {
  std::size_t line = 0;
  std::string name;
  std::array<double, joint_count> q_rad{};
  TimeStamp time;
  std::vector<double> context;  ///< in the units of the data file's columns
};

struct RobotLog {
  std::string path;
  Dialect dialect;
  std::size_t header_line = 0;
  bool names = false;
  std::vector<std::string> doubtful_names;  ///< columns of which each could be the name: then none is read
  bool times = false;
  std::array<std::string, joint_count> joint_columns;
  std::vector<std::string>
      context;  ///< columns of a data file (payload_kg …), numbers as they stand in the log
  std::vector<LogRow> rows;
  std::vector<std::string> unused;
};

/// Without map the joints are the columns q1 … q6, j1 … j6, a1 … a6, joint1 … or axis1 … with a unit in their names or by
/// `map.joint_unit`; columns that are called as in a data file (payload_kg, temp_c …) are taken as they are.
/// \throws InputError  as read_delimited(); a column that is not there, there twice, or one of two that could be meant; a
///                     joint without unit, a unit that is not known or contradicts another; a cell that is no number; a
///                     reading beyond the limits of `robot`
RobotLog read_robot_log(const std::string& path, const LogMap& map, const Robot& robot);

}  // namespace flexcomp::host
