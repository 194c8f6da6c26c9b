#include "files/robot_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "files/data_file.hpp"
#include "files/declared_unit.hpp"
#include "files/input_error.hpp"
#include "files/nearest.hpp"
#include "files/yaml_field.hpp"

namespace flexcomp::host {

namespace {

constexpr double limit_tolerance_rad = 1e-9;  // as in data files: rounding of a log with few digits

const std::vector<std::string> name_stems{"name", "point",  "pointname", "pose", "posename",
                                          "id",   "target", "nr",        "no"};
const std::vector<std::string> time_stems{"time", "timestamp", "t", "datetime", "zeit"};

bool is_joint_stem(const std::string& stem, std::size_t joint) {
  for (const char* prefix : {"q", "j", "a", "joint", "jointa", "axis", "achse"}) {
    if (stem == fmt::format("{}{}", prefix, joint + 1)) return true;
  }
  return false;
}

std::optional<std::size_t> find_joint(const std::vector<std::string>& cells, std::size_t joint) {
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (is_joint_stem(column_name(cells[k]).stem, joint)) return k;
  }
  return {};
}

std::optional<std::size_t> find_cell(const std::vector<std::string>& cells, const std::string& name) {
  const auto at = std::find(cells.begin(), cells.end(), name);
  if (at == cells.end()) return {};
  return static_cast<std::size_t>(at - cells.begin());
}

bool one_of(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// \throws InputError naming the map
std::size_t require(const DelimitedText& table, const LogMap& map, const std::string& column,
                    const std::string& what) {
  if (const auto at = find_cell(table.header->cells, column)) return *at;
  const std::string near = nearest(column, table.header->cells);
  throw InputError(table.path, table.header->line, column,
                   fmt::format("this column ({} of {})", what, map.path.empty() ? "the options" : map.path),
                   near.empty()
                       ? fmt::format("none; the columns are {}", fmt::join(table.header->cells, ", "))
                       : fmt::format("none, but '{}'", near));
}

std::optional<char> character(const YamlField& map, const std::string& key, const std::string& allowed) {
  const auto field = map.find(key);
  if (!field) return {};
  std::string text = field->text();
  if (text == "tab" || text == "\\t") text = "\t";
  if (text == "blanks" || text == "space") text = " ";
  if (text.size() != 1 || allowed.find(text[0]) == std::string::npos) {
    throw field->error(key == "decimal" ? "\".\" or \",\"" : "\",\", \";\", tab or blanks");
  }
  return text[0];
}

}  // namespace

LogMap load_log_map(const std::string& path) {
  const YamlField root = YamlField::load(path);
  root.require_keys({"delimiter", "decimal", "name", "time", "joints", "context"});
  LogMap map;
  map.path = path;
  map.dialect.delimiter = character(root, "delimiter", ",;\t ");
  map.dialect.decimal = character(root, "decimal", ".,");
  if (const auto name = root.find("name")) map.name = name->text();
  if (const auto time = root.find("time")) {
    if (time->is_mapping()) {
      time->require_keys({"column", "unit"});
      map.time = time->at("column").text();
      if (const auto unit = time->find("unit")) {
        map.time_unit = time_unit_of(unit->text());
        if (!map.time_unit) throw unit->error("s, ms or us");
      }
    } else {
      map.time = time->text();
    }
  }
  if (const auto joints = root.find("joints")) {
    const std::vector<YamlField> items = joints->items();
    if (items.size() != joint_count) throw joints->error("six joints");
    map.joints.emplace();
    for (std::size_t j = 0; j < joint_count; ++j) {
      items[j].require_keys({"column", "unit", "sign", "offset_deg"});
      JointColumn& joint = (*map.joints)[j];
      joint.column = items[j].at("column").text();
      if (const auto unit = items[j].find("unit")) {
        joint.unit = angle_unit_of(unit->text());
        if (!joint.unit) throw unit->error("deg or rad");
      }
      joint.sign = items[j].number_or("sign", unit::si, 1);
      if (joint.sign != 1 && joint.sign != -1) throw items[j].at("sign").error("1 or -1");
      joint.offset_rad = items[j].number_or("offset_deg", unit::degree, 0);
    }
  }
  if (const auto context = root.find("context")) {
    for (const std::string& key : context->keys()) {
      if (!one_of(context_names(), key)) {
        const std::string near = nearest(key, context_names());
        throw context->at(key).error(
            near.empty() ? fmt::format("one of the columns {}", fmt::join(context_names(), ", "))
                         : fmt::format("a column of a data file (did you mean '{}'?)", near),
            "'" + key + "'");
      }
      map.context.emplace_back(key, context->at(key).text());
    }
  }
  return map;
}

RobotLog read_robot_log(const std::string& path, const LogMap& map, const RobotFile& robot) {
  const std::string header = map.joints ? fmt::format("a header with the columns of {}",
                                                      map.path.empty() ? "--joint-columns" : map.path)
                                        : "a header with the columns q1 … q6 (or j1 …, a1 …, joint1 …, axis1 "
                                          "…), or --joint-columns or --map";
  const auto is_header = [&map](const std::vector<std::string>& cells) {
    for (std::size_t j = 0; j < joint_count; ++j) {
      const auto at = map.joints ? find_cell(cells, (*map.joints)[j].column) : find_joint(cells, j);
      // Of the columns that a map names one is enough: the header is found, and what is missing is said by name.
      if (map.joints && at) return true;
      if (!map.joints && !at) return false;
    }
    return !map.joints;
  };
  DelimitedText table = read_delimited(path, map.dialect, is_header, header);
  RobotLog log;
  log.path = path;
  std::vector<bool> used(table.header->cells.size());
  std::array<std::size_t, joint_count> joints{};
  std::array<JointColumn, joint_count> how;
  const DeclaredUnits declared = declared_units(table.remarks);
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (map.joints) how[j] = (*map.joints)[j];
    joints[j] = map.joints ? require(table, map, how[j].column, fmt::format("joint {}", j + 1))
                           : *find_joint(table.header->cells, j);
    if (used[joints[j]]) {
      throw InputError(path, table.header->line, table.column_label(joints[j]), "a column for each joint",
                       fmt::format("it again for joint {}", j + 1));
    }
    used[joints[j]] = true;
    const std::string& label = table.header->cells[joints[j]];
    const auto in_name = angle_unit_of(column_name(label).unit);
    if (how[j].unit && in_name && how[j].unit->name != in_name->name) {
      throw InputError(path, table.header->line, label,
                       fmt::format("{}, as {} says", how[j].unit->name, map.path),
                       std::string(in_name->name));
    }
    if (map.joint_unit && in_name && map.joint_unit->name != in_name->name) {
      throw InputError(path, table.header->line, "--joint-unit",
                       fmt::format("{}, as the column's name says", in_name->name),
                       std::string(map.joint_unit->name));
    }
    if (!how[j].unit) how[j].unit = in_name;
    if (!how[j].unit) how[j].unit = map.joint_unit ? map.joint_unit : declared.angle;
    if (!how[j].unit) {
      throw InputError(
          path, table.header->line, label,
          "deg or rad: in the name (q1_deg, J1 [rad]), in a line above (Units: deg) or by --joint-unit",
          "no unit");
    }
    log.joint_columns[j] = label;
  }
  std::optional<std::size_t> name;
  std::optional<std::size_t> time;
  Unit time_unit = map.time_unit.value_or(unit::si);
  if (!map.name.empty()) name = require(table, map, map.name, "name");
  if (!map.time.empty()) time = require(table, map, map.time, "time");
  std::vector<std::size_t> context;
  for (const auto& [key, column] : map.context) {
    context.push_back(require(table, map, column, key));
    log.context.push_back(key);
    used[context.back()] = true;
  }
  for (std::size_t k = 0; k < used.size(); ++k) {
    if (used[k] || k == name || k == time) continue;
    const std::string& label = table.header->cells[k];
    const ColumnName parts = column_name(label);
    if (!name && one_of(name_stems, parts.stem)) {
      name = k;
    } else if (!time && one_of(time_stems, parts.stem)) {
      time = k;
    } else if (one_of(context_names(), label) && !one_of(log.context, label)) {
      context.push_back(k);
      log.context.push_back(label);
    } else {
      log.unused.push_back(label);
    }
  }
  if (time && !map.time_unit) {
    if (const auto unit = time_unit_of(column_name(table.header->cells[*time]).unit)) time_unit = *unit;
  }
  std::vector<std::size_t> numbers(joints.begin(), joints.end());
  numbers.insert(numbers.end(), context.begin(), context.end());
  table.settle_decimal(numbers, map.dialect.decimal);
  log.dialect = table.dialect;
  log.names = name.has_value();
  log.times = time.has_value();
  for (const TextRow& row : table.rows) {
    LogRow out;
    out.line = row.line;
    for (std::size_t j = 0; j < joint_count; ++j) {
      out.q_rad[j] = how[j].sign * table.number(row, joints[j], *how[j].unit) + how[j].offset_rad;
      const JointLimits& limits = robot.nominal.limits[j];
      if (out.q_rad[j] < limits.min_rad - limit_tolerance_rad ||
          out.q_rad[j] > limits.max_rad + limit_tolerance_rad) {
        throw InputError(
            path, row.line, log.joint_columns[j],
            fmt::format("a reading within the limits of joint {} in {} ({:.6g} to {:.6g} deg)", j + 1,
                        robot.path, degrees(limits.min_rad), degrees(limits.max_rad)),
            fmt::format("'{}', which is {:.6g} deg", row.cells[joints[j]], degrees(out.q_rad[j])));
      }
    }
    if (name) {
      out.name = row.cells[*name];
      if (out.name.empty())
        throw InputError(path, row.line, table.column_label(*name), "a name", "an empty field");
    }
    if (time) {
      const auto stamp = time_stamp(row.cells[*time], time_unit, table.dialect.decimal);
      if (!stamp) {
        throw InputError(path, row.line, table.column_label(*time),
                         "seconds, 12:30:05.25 or 2026-03-01T12:30:05.25", "'" + row.cells[*time] + "'");
      }
      out.time = *stamp;
    }
    for (const std::size_t c : context) out.context.push_back(table.number(row, c, unit::si));
    log.rows.push_back(std::move(out));
  }
  return log;
}

}  // namespace flexcomp::host
