// SPDX-License-Identifier: Apache-2.0
/// \file
/// Points joined with a log: checked as a data file, and as JSON.
#pragma once

#include <string>
#include <vector>

#include "exchange/joining.hpp"
#include "exchange/point_list.hpp"
#include "exchange/robot_log.hpp"
#include "json.hpp"
#include "named_values.hpp"

namespace flexcomp::host {

inline const NamedValues<JoinBy> join_names{
    {"name", JoinBy::name}, {"order", JoinBy::order}, {"time", JoinBy::time}};

/// "full poses"
const char* measured_name(MeasurementKind kind);

/// The warnings of load_data() for the text of a data file, as if it were in `out`.
/// \throws InputError  what load_data() refuses, with the line of the list or the log that it came from
std::vector<std::string> check_joined(const std::string& text, const std::string& out, const Robot& robot,
                                      const PointList& points, const RobotLog& log, const Joining& joining,
                                      bool force);

Json to_json(const Joining& joining, const PointList& points, const RobotLog& log, JoinBy by);

}  // namespace flexcomp::host
