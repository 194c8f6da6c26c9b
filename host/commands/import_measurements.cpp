// SPDX-License-Identifier: Apache-2.0
#include "commands/import_measurements.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "exchange/declared_unit.hpp"
#include "exchange/joined_data.hpp"
#include "exchange/point_list.hpp"
#include "exchange/robot_log.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "input_error.hpp"
#include "json.hpp"

namespace flexcomp::host {
namespace {

constexpr const char* group_name = "An instrument's points and a robot's log";
const std::map<std::string, char> delimiter_names{{"comma", ','}, {",", ','},    {"semicolon", ';'},
                                                  {";", ';'},     {"tab", '\t'}, {"blanks", ' '}};
const std::map<std::string, char> decimal_names{{"point", '.'}, {".", '.'}, {"comma", ','}, {",", ','}};
const std::map<std::string, AngleConvention> angle_names{
    {"fixed-xyz", AngleConvention::fixed_xyz},
    {"moving-xyz", AngleConvention::moving_xyz},
    {"rotation-vector", AngleConvention::rotation_vector}};
template <class Value>
std::vector<std::string> keys_of(const std::map<std::string, Value>& names) {
  std::vector<std::string> keys;
  for (const auto& entry : names) keys.push_back(entry.first);
  return keys;
}

template <class Value>
std::optional<Value> chosen(const std::map<std::string, Value>& names, const std::string& text) {
  return text.empty() ? std::optional<Value>() : std::optional<Value>(names.at(text));
}

void list(const CommonOptions& common, const std::string& what, const std::vector<std::string>& lonely) {
  if (lonely.empty()) return;
  constexpr std::size_t most = 20;
  std::string text = fmt::format("  {}: {}", lonely.size(), what);
  for (std::size_t k = 0; k < std::min(most, lonely.size()); ++k) text += "\n    " + lonely[k];
  if (lonely.size() > most)
    text += fmt::format("\n    … and {} more (--json lists them all)", lonely.size() - most);
  common.say(text);
}

}  // namespace

void ImportMeasurements::add_to(CLI::App& command) {
  this->command = &command;
  const auto group = [](CLI::Option* option) { return option->group(group_name); };
  group(command.add_option(
            "--joints", joints,
            "Joint readings of the measured poses, a log of the robot: makes data for identify of SOURCE"))
      ->type_name("LOG.csv");
  group(command.add_option("--robot", robot, "Robot file, for the joints' limits"))->type_name("ROBOT.yaml");
  group(
      command.add_option("--map", map, "Which column of the log is which joint, with unit, sign and offset"))
      ->type_name("MAP.yaml");
  group(command.add_option("--joint-columns", joint_columns, "The same in short: the six columns, in order"))
      ->delimiter(',')
      ->expected(static_cast<int>(joint_count))
      ->type_name("C1,…,C6");
  group(command.add_option("--joint-unit", joint_unit, "Unit of the log's joints where it does not tell"))
      ->check(CLI::IsMember(angle_unit_names()));
  group(command.add_option("--unit", unit, "Unit of the points where the export does not tell"))
      ->check(CLI::IsMember(length_unit_names()));
  group(command.add_option("--angle-unit", angle_unit, "Unit of the export's angles where it does not tell"))
      ->check(CLI::IsMember(angle_unit_names()));
  group(command.add_option("--angles", angles,
                           "What rx ry rz mean: about fixed axes (SpatialAnalyzer), about moved ones "
                           "(Stäubli), or one vector"))
      ->check(CLI::IsMember(keys_of(angle_names)));
  group(
      command.add_option(
          "--columns", columns,
          "Meaning of the export's columns where its header does not tell: name,group,x,y,z,sigma,time; - is "
          "not read"))
      ->delimiter(',')
      ->type_name("NAME,…");
  group(command.add_option("--delimiter", delimiter, "What parts the export's fields [default: worked out]"))
      ->check(CLI::IsMember(keys_of(delimiter_names)));
  group(command.add_option("--decimal", decimal, "The export's decimal mark [default: worked out]"))
      ->check(CLI::IsMember(keys_of(decimal_names)));
  group(command.add_option("--coverage", coverage,
                           "The export's uncertainties are so many standard deviations"))
      ->check(positive_number())
      ->capture_default_str();
  group(command.add_option("--join", by,
                           "How points find their joints [default: name, where both files have names]"))
      ->check(CLI::IsMember(keys_of(join_names)));
  group(command.add_option("--names", names,
                           "How points are called: {pose}, {reflector} (a … d, 1 … 4), * for anything, as "
                           "'*::{pose}_{reflector}'"))
      ->type_name("PATTERN");
  group(command.add_option("--reflectors", reflectors,
                           "With --join order: so many points one after the other are one pose"))
      ->check(CLI::Range(3, 4));
  group(command.add_flag("--repeats", repeats, "Points of one name are the same pose measured again"));
  group(command.add_option("--tolerance", tolerance_s, "With --join time: how far apart the two may be [s]"))
      ->check(non_negative_number())
      ->capture_default_str();
  group(command.add_option("--time-shift", shift_s,
                           "With --join time: what to add to the instrument's times [s]"))
      ->check(finite_number())
      ->capture_default_str();
  group(add_force_option(command, force));
}

void ImportMeasurements::refuse_idle() const {
  const auto refuse = [this](const char* option, const char* join, bool applies) {
    if (!applies && command->get_option(option)->count() > 0)
      throw CLI::ValidationError(option, fmt::format("goes with --join {} alone", join));
  };
  refuse("--names", "name", by.empty() || by == "name");
  refuse("--repeats", "name", by.empty() || by == "name");
  refuse("--reflectors", "order", by == "order");
  refuse("--tolerance", "time", by == "time");
  refuse("--time-shift", "time", by == "time");
}

void ImportMeasurements::refuse_without_joints() const {
  for (const CLI::Option* option : command->get_options()) {
    if (option->get_group() == group_name && option->count() > 0)
      throw CLI::ValidationError(option->get_name(), "is for an instrument's points, with --joints LOG.csv");
  }
}

void ImportMeasurements::run(const CommonOptions& common, const std::string& source,
                             const std::string& out) const {
  if (robot.empty()) throw CLI::RequiredError("--robot (with --joints)");
  if (!map.empty() && !joint_columns.empty())
    throw CLI::ValidationError("--joint-columns", "is the short form of --map: give one of them");
  refuse_idle();
  const Robot robot_file = load_robot(robot);
  LogMap how = map.empty() ? LogMap() : load_log_map(map);
  if (!joint_unit.empty()) how.joint_unit = {angle_unit_of(joint_unit), "--joint-unit"};
  if (!joint_columns.empty()) {
    how.columns_by = "--joint-columns";
    how.joints.emplace();
    for (std::size_t j = 0; j < joint_count; ++j) (*how.joints)[j].column = joint_columns[j];
  }
  PointListOptions reading;
  reading.dialect = {chosen(delimiter_names, delimiter), chosen(decimal_names, decimal)};
  reading.columns = columns;
  if (!unit.empty()) reading.length = {length_unit_of(unit), "--unit"};
  if (!angle_unit.empty()) reading.angle = {angle_unit_of(angle_unit), "--angle-unit"};
  reading.angles = chosen(angle_names, angles);
  reading.coverage = coverage;
  const PointList points = read_point_list(source, reading);
  const RobotLog log = read_robot_log(joints, how, robot_file);

  JoinOptions joining_options;
  if (by.empty() && !(points.names && (log.names || !log.doubtful_names.empty()))) {
    throw InputError(points.names ? log.path : points.path, 0, "--join",
                     "order or time, for the points cannot be joined by name", "no column with names");
  }
  joining_options.by = chosen(join_names, by).value_or(JoinBy::name);
  joining_options.names = names;
  joining_options.reflectors = reflectors;
  joining_options.repeats = repeats;
  joining_options.tolerance_s = tolerance_s;
  joining_options.shift_s = shift_s;
  const Joining joining = join(points, log, joining_options);
  const std::string text = data_text(joining.data);
  common.warn(check_joined(text, out, robot_file, points, log, joining, force));
  write_file(out, text);

  common.say(fmt::format("{}: {} rows, {} of {} joined with {} by {}", out, joining.data.rows.size(),
                         measured_name(joining.data.kind), source, joints,
                         name_in(join_names, joining_options.by)));
  common.say(fmt::format(
      "  {}: {} points in {}, fields separated by {}{}", source, points.points.size(), points.length.name,
      words(points.dialect),
      points.unused.empty() ? "" : fmt::format("; not read: {}", fmt::join(points.unused, ", "))));
  common.say(
      fmt::format("  {}: {} rows, joints {}, fields separated by {}{}", joints, log.rows.size(),
                  fmt::join(log.joint_columns, " "), words(log.dialect),
                  log.unused.empty() ? "" : fmt::format("; not read: {}", fmt::join(log.unused, ", "))));
  list(common, fmt::format("points of {} without joint readings, left out", source), joining.lonely_points);
  list(common, fmt::format("rows of {} at which nothing was measured", joints), joining.lonely_rows);
  Json result{{"output", out}};
  result.update(to_json(joining, points, log, joining_options.by));
  common.write_json(result);
}

}  // namespace flexcomp::host
