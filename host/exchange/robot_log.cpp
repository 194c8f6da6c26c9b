// SPDX-License-Identifier: Apache-2.0
#include "exchange/robot_log.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "exchange/declared_unit.hpp"
#include "files/data_file.hpp"
#include "files/text.hpp"
#include "files/yaml_field.hpp"
#include "input_error.hpp"
#include "nearest.hpp"

namespace flexcomp::host {

namespace {

const std::vector<std::string> name_stems{"name", "point",  "pointname", "pose", "posename",
                                          "id",   "target", "nr",        "no"};
const std::vector<std::string> time_stems{"time", "timestamp", "t", "datetime", "zeit"};

bool is_joint_stem(const std::string& stem, std::size_t joint) {
  for (const char* prefix : {"q", "j", "a", "joint", "jointa", "axis", "achse"}) {
    if (stem == fmt::format("{}{}", prefix, joint + 1)) return true;
  }
  return false;
}

/// The columns that could be this joint. What has a unit of voltage, speed and the like is none, unless there is nothing else.
std::vector<std::size_t> find_joint(const std::vector<std::string>& cells, std::size_t joint) {
  std::vector<std::size_t> angles;
  std::vector<std::size_t> others;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const ColumnName name = column_name(cells[k]);
    if (is_joint_stem(name.stem, joint)) (is_no_angle(name.unit) ? others : angles).push_back(k);
  }
  return angles.empty() ? others : angles;
}

std::optional<std::size_t> find_cell(const std::vector<std::string>& cells, const std::string& name) {
  const auto at = std::find(cells.begin(), cells.end(), name);
  if (at == cells.end()) return {};
  return static_cast<std::size_t>(at - cells.begin());
}

/// \throws InputError  a column of this name stands there again
void require_once(const DelimitedText& table, const std::string& column) {
  if (std::count(table.header->cells.begin(), table.header->cells.end(), column) > 1) {
    throw InputError(table.path, table.header->line, column, "a column of this name once",
                     "two with the same name");
  }
}

/// The column that is `what`; nothing where there is none.
/// \throws InputError  several could be it: `choose` says how to tell
std::optional<std::size_t> only_one(const DelimitedText& table, const std::vector<std::size_t>& columns,
                                    const std::string& what, ErrorCode several) {
  if (columns.empty()) return {};
  const std::string& label = table.header->cells[columns.front()];
  require_once(table, label);
  if (columns.size() > 1) {
    throw InputError(table.path, table.header->line, label, fmt::format("one column that can be {}", what),
                     fmt::format("'{}' as well", table.header->cells[columns[1]]), several);
  }
  return columns.front();
}

bool one_of(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// \throws InputError naming the map
std::size_t require(const DelimitedText& table, const LogMap& map, const std::string& column,
                    const std::string& what) {
  require_once(table, column);
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

/// \throws InputError  a column of the log in another unit than the data file's column that it shall become
void require_unit_of(const DelimitedText& table, const std::string& key, const std::string& column) {
  const std::string found = column_name(column).unit;
  if (found.empty()) return;
  const std::string wanted = column_name(key).unit;
  const auto same = [&](UnitOf unit_of) {
    const auto a = unit_of(found);
    const auto b = unit_of(wanted);
    return a && b && a->name == b->name;
  };
  const std::string unit = lower(found);
  const bool celsius = key == "temp_c" && one_of({"c", "°c", "degc", "deg c", "celsius"}, unit);
  if (celsius || unit == wanted || (!wanted.empty() && (same(length_unit_of) || same(angle_unit_of)))) return;
  throw InputError(
      table.path, table.header->line, column,
      key == "temp_c" ? std::string("degrees Celsius, as temp_c") : fmt::format("the unit of {}", key),
      fmt::format("'{}'", found));
}

bool mapped(const LogMap& map, const std::string& key) {
  return std::any_of(map.context.begin(), map.context.end(), [&](const auto& c) { return c.first == key; });
}

/// Seconds where nobody says otherwise. Only numbers have a unit: "Time [UTC]" with times of day needs none.
Unit unit_of_times(const DelimitedText& table, const LogMap& map, std::size_t column,
                   const UnitSource& declared) {
  const auto counts = [column](const TextRow& row) { return is_number(row.cells[column]); };
  if (std::none_of(table.rows.begin(), table.rows.end(), counts)) return unit::si;
  const std::string& label = table.header->cells[column];
  const auto in_name = unit_in_name(table.path, table.header->line, label, time_unit_of,
                                    fmt::format("a unit of time ({})", fmt::join(time_unit_names(), ", ")));
  return agreed_unit(table.path, table.header->line, label,
                     {declared, {map.time_unit, map.path}, {in_name, "the column's name"}})
      .value_or(unit::si);
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
      if (!one_of(context_names(), key))
        throw context->at(key).error(
            expected_name(key, context_names(), "one of the columns", "a column of a data file"),
            "'" + key + "'");
      map.context.emplace_back(key, context->at(key).text());
    }
  }
  return map;
}

RobotLog read_robot_log(const std::string& path, const LogMap& map, const Robot& robot) {
  const std::string header =
      map.joints
          ? fmt::format("a header with the columns of {}", map.path.empty() ? map.columns_by : map.path)
          : "a header with the columns q1 … q6 (or j1 …, a1 …, joint1 …, axis1 …)";
  const auto is_header = [&map](const std::vector<std::string>& cells) {
    for (std::size_t j = 0; j < joint_count; ++j) {
      // Of the columns that a map names one is enough: the header is found, and what is missing is said by name.
      if (map.joints && find_cell(cells, (*map.joints)[j].column)) return true;
      if (!map.joints && find_joint(cells, j).empty()) return false;
    }
    return !map.joints;
  };
  DelimitedText table = read_delimited(path, map.dialect, is_header, header,
                                       map.joints ? ErrorCode::none : ErrorCode::log_without_joints);
  RobotLog log;
  log.path = path;
  std::vector<bool> used(table.header->cells.size());
  std::array<std::size_t, joint_count> joints{};
  std::array<JointColumn, joint_count> how;
  const DeclaredUnits declared = declared_units(table);
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (map.joints) how[j] = (*map.joints)[j];
    joints[j] = map.joints ? require(table, map, how[j].column, fmt::format("joint {}", j + 1))
                           : *only_one(table, find_joint(table.header->cells, j),
                                       fmt::format("joint {}", j + 1), ErrorCode::ambiguous_joint_column);
    if (used[joints[j]]) {
      throw InputError(path, table.header->line, table.column_label(joints[j]), "a column for each joint",
                       fmt::format("it again for joint {}", j + 1));
    }
    used[joints[j]] = true;
    const std::string& label = table.header->cells[joints[j]];
    const auto in_name =
        unit_in_name(path, table.header->line, label, angle_unit_of, "a joint's unit, deg or rad");
    how[j].unit = agreed_unit(
        path, table.header->line, label,
        {{how[j].unit, map.path}, declared.angle, {in_name, "the column's name"}, map.joint_unit});
    if (!how[j].unit) {
      throw InputError(path, table.header->line, label,
                       "deg or rad: in the name (q1_deg, J1 [rad]), in a line above (Units: deg)", "no unit",
                       ErrorCode::no_joint_unit);
    }
    log.joint_columns[j] = label;
  }
  std::vector<std::size_t> names;
  std::vector<std::size_t> times;
  if (!map.name.empty()) names = {require(table, map, map.name, "name")};
  if (!map.time.empty()) times = {require(table, map, map.time, "time")};
  std::vector<std::size_t> context;
  for (const auto& [key, column] : map.context) {
    context.push_back(require(table, map, column, key));
    require_unit_of(table, key, column);
    log.context.push_back(key);
    used[context.back()] = true;
  }
  for (std::size_t k = 0; k < used.size(); ++k) {
    const std::string& label = table.header->cells[k];
    const ColumnName parts = column_name(label);
    const auto is = [k](const std::vector<std::size_t>& columns) {
      return std::find(columns.begin(), columns.end(), k) != columns.end();
    };
    if (used[k] || is(names) || is(times)) continue;
    if (map.name.empty() && one_of(name_stems, parts.stem)) {
      names.push_back(k);
    } else if (map.time.empty() && one_of(time_stems, parts.stem)) {
      times.push_back(k);
    } else if (one_of(context_names(), label) && !mapped(map, label)) {
      require_once(table, label);
      context.push_back(k);
      log.context.push_back(label);
    } else {
      log.unused.push_back(label);
    }
  }
  const auto time = only_one(table, times, "the time", ErrorCode::ambiguous_time_column);
  const Unit time_unit = time ? unit_of_times(table, map, *time, declared.time) : unit::si;
  // Two columns with names do no harm to who joins by order or time.
  std::optional<std::size_t> name;
  if (names.size() > 1) {
    for (const std::size_t k : names) {
      log.doubtful_names.push_back(table.header->cells[k]);
      log.unused.push_back(table.header->cells[k]);
    }
  } else if (!names.empty()) {
    name = names.front();
  }
  log.header_line = table.header->line;
  std::vector<std::size_t> numbers(joints.begin(), joints.end());
  numbers.insert(numbers.end(), context.begin(), context.end());
  // No joint turns a thousand degrees or radians: a comma there is a decimal comma.
  table.settle_decimal(numbers, map.dialect.decimal, {joints.begin(), joints.end()},
                       ErrorCode::ambiguous_log_decimal_mark);
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
    if (time) out.time = table.time(row, *time, row.cells[*time], time_unit);
    for (const std::size_t c : context) out.context.push_back(table.number(row, c, unit::si));
    log.rows.push_back(std::move(out));
  }
  return log;
}

}  // namespace flexcomp::host
