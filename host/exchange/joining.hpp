// SPDX-License-Identifier: Apache-2.0
/// \file
/// What an instrument saw and what the robot's joints read at the time, two lists of two machines, into rows of a data
/// file. Nothing is guessed and nothing is dropped without being named.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "exchange/point_list.hpp"
#include "exchange/robot_log.hpp"
#include "measurement/measured_data.hpp"
#include "units.hpp"

namespace flexcomp::host {

enum class JoinBy { name, order, time };

struct JoinOptions {
  JoinBy by = JoinBy::name;
  /// How points are called, with {pose}, {reflector} (a … d or 1 … 4) and * for anything: "*::{pose}_{reflector}". Empty:
  /// the whole name, or its last part behind :: where the log's names have none. Never * beside {pose}.
  std::string names;
  std::size_t reflectors = 0;  ///< 3 or 4 points one after the other belong to a pose (by order); 0: one
  bool repeats = false;        ///< several points of one name are the pose measured again
  double tolerance_s = 0.5;    ///< by time: a row of the log that is farther away is no partner
  double shift_s = 0;          ///< the log's clock less the instrument's
  double still_rad =
      radians(0.01);  ///< by time: all readings within the tolerance agree so well, or the arm was moving
};

struct Joining {
  MeasuredData data;  ///< without path; context of the log in `extra`, as is the point's name
  std::vector<std::size_t> log_lines;    ///< of each row
  std::vector<std::size_t> point_lines;  ///< of each row, of its first point
  std::vector<std::string>
      lonely_points;                     ///< "P7 (line 9)": measured, but nobody knows where the joints were
  std::vector<std::string> lonely_rows;  ///< rows of the log at which nothing was measured; not by time
};

/// \throws InputError  files without the names or times that it goes by, or with clocks of two kinds (a zone or none are two),
///                     or times of day across midnight; two rows of the log with one name; two points of one name (but see `repeats`); by order: other numbers of points than of
///                     rows; by time: a point at which the arm was moving; nothing joined
Joining join(const PointList& points, const RobotLog& log, const JoinOptions& options);

}  // namespace flexcomp::host
