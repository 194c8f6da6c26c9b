// SPDX-License-Identifier: Apache-2.0
#include "exchange/joined_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "files/data_file.hpp"
#include "files/write_file.hpp"
#include "input_error.hpp"
#include "json.hpp"

namespace flexcomp::host {

const char* measured_name(MeasurementKind kind) {
  return kind == MeasurementKind::reflectors ? "reflector points"
         : kind == MeasurementKind::pose     ? "full poses"
                                             : "positions";
}

std::vector<std::string> check_joined(const std::string& text, const std::string& out, const Robot& robot,
                                      const PointList& points, const RobotLog& log, const Joining& joining,
                                      bool force) {
  std::string folder = (std::filesystem::temp_directory_path() / "flexcomp-XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr)
    throw std::runtime_error(fmt::format("{}: cannot be made: {}", folder, std::strerror(errno)));
  struct Remove {
    const std::string& folder;
    ~Remove() {
      std::error_code ignored;
      std::filesystem::remove_all(folder, ignored);
    }
  } remove{folder};
  const std::string path = folder + "/data.csv";
  write_file(path, text);
  try {
    std::vector<std::string> warnings = load_data(path, robot, {force}).warnings;
    for (std::string& w : warnings) {
      if (w.starts_with(path)) w.replace(0, path.size(), out);
    }
    return warnings;
  } catch (const InputError& e) {
    std::vector<std::string> of_log = joint_and_context_names(joining.data.columns);
    of_log.insert(of_log.end(), log.context.begin(), log.context.end());
    // The field may be several columns, "q1_deg … q6_deg".
    const bool measured = !e.field().empty() &&
                          std::none_of(of_log.begin(), of_log.end(),
                                       [&e](const std::string& name) { return e.field().starts_with(name); });
    const std::vector<std::size_t>& lines = measured ? joining.point_lines : joining.log_lines;
    const std::size_t line = e.line() < 2 ? 0 : lines[e.line() - 2];
    throw InputError(measured ? points.path : log.path, line, e.field(), e.expected(), e.found());
  }
}

Json to_json(const Joining& joining, const PointList& points, const RobotLog& log, JoinBy by) {
  return {{"rows", joining.data.rows.size()},
          {"measured", measured_name(joining.data.kind)},
          {"join", name_in(join_names, by)},
          {"points", points.points.size()},
          {"log_rows", log.rows.size()},
          {"unit", points.length.name},
          {"dialect", words(points.dialect)},
          {"log_dialect", words(log.dialect)},
          {"joint_columns", log.joint_columns},
          {"sigma", points.sigmas},
          {"points_without_joints", joining.lonely_points},
          {"joints_without_point", joining.lonely_rows},
          {"columns_not_read", points.unused},
          {"log_columns_not_read", log.unused}};
}

}  // namespace flexcomp::host
