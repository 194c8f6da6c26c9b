// SPDX-License-Identifier: Apache-2.0
#include "files/data_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <unordered_map>

#include "files/csv.hpp"
#include "files/write_file.hpp"
#include "input_error.hpp"
#include "nearest.hpp"
#include "quaternion.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

constexpr std::array<const char*, 3> axis_names{"x", "y", "z"};
constexpr std::array<const char*, 4> quaternion_names{"qw", "qx", "qy", "qz"};
constexpr std::array<const char*, 4> reflector_names{"a", "b", "c", "d"};

// Readings below 7 in all rows may be radians: 7 rad is more than a full turn.
constexpr double suspicious_below = 7;
constexpr std::size_t suspicious_rows = 3;

std::string joint_name(std::size_t j) { return fmt::format("q{}_deg", j + 1); }
std::string seed_name(std::size_t j) { return fmt::format("seed{}_deg", j + 1); }
std::string move_name(std::size_t j) { return fmt::format("move{}_deg", j + 1); }
std::string direction_name(std::size_t j) { return fmt::format("dir{}", j + 1); }
std::string position_name(std::size_t k) { return fmt::format("{}_mm", axis_names[k]); }
std::string com_name(std::size_t k) { return fmt::format("payload_{}_mm", axis_names[k]); }
std::string force_name(std::size_t k) { return fmt::format("f{}_n", axis_names[k]); }
std::string point_name(std::size_t r, std::size_t k) {
  return fmt::format("{}{}_mm", reflector_names[r], axis_names[k]);
}

/// All column names of data files and targets, for hints.
const std::vector<std::string>& known_names() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> names;
    for (std::size_t j = 0; j < joint_count; ++j) names.push_back(joint_name(j));
    for (std::size_t j = 0; j < joint_count; ++j) names.push_back(seed_name(j));
    for (std::size_t j = 0; j < joint_count; ++j) names.push_back(move_name(j));
    for (std::size_t j = 0; j < joint_count; ++j) names.push_back(direction_name(j));
    for (std::size_t k = 0; k < 3; ++k) {
      names.push_back(position_name(k));
      names.push_back(com_name(k));
      names.push_back(force_name(k));
      for (std::size_t r = 0; r < 4; ++r) names.push_back(point_name(r, k));
    }
    names.insert(names.end(), quaternion_names.begin(), quaternion_names.end());
    names.insert(names.end(), {"payload_kg", "temp_c", "time_s", "sigma_mm", "sigma_deg"});
    return names;
  }();
  return all;
}

bool is_known(const std::string& name) {
  return std::find(known_names().begin(), known_names().end(), name) != known_names().end();
}

/// Calls visit(name, unit, is there, value) for each context column, in the order of files.
template <class Columns, class Row, class Visit>
void each_context_column(Columns& columns, Row&& row, const Visit& visit) {
  auto& context = row.context;
  visit("payload_kg", unit::si, columns.payload_mass, context.payload_kg);
  for (std::size_t k = 0; k < 3; ++k)
    visit(com_name(k), unit::mm, columns.payload_com[k], context.payload_com_m[k]);
  for (std::size_t j = 0; j < joint_count; ++j)
    visit(move_name(j), unit::degree, columns.move[j], row.move_rad[j]);
  for (std::size_t j = 0; j < joint_count; ++j)
    visit(direction_name(j), unit::si, columns.direction[j], context.direction[j]);
  visit("temp_c", unit::si, columns.temperature, context.temperature_c);
  visit("time_s", unit::si, columns.time, context.time_s);
  for (std::size_t k = 0; k < 3; ++k) visit(force_name(k), unit::si, columns.force[k], context.force_n[k]);
}

/// The same for the standard deviations of what was measured.
template <class Columns, class Row, class Visit>
void each_sigma_column(Columns& columns, Row&& row, const Visit& visit) {
  visit("sigma_mm", unit::mm, columns.position_sigma, row.position_sigma_m);
  visit("sigma_deg", unit::degree, columns.orientation_sigma, row.orientation_sigma_rad);
}

/// The same for what was measured, all of which is there.
template <class Visit>
void each_measured_column(const MeasuredData& data, const Measurement& row, const Visit& visit) {
  if (data.kind == MeasurementKind::position || data.kind == MeasurementKind::pose) {
    for (std::size_t k = 0; k < 3; ++k)
      visit(position_name(k), unit::mm, true, row.position_m[static_cast<Eigen::Index>(k)]);
  }
  if (data.kind == MeasurementKind::pose) {
    const Eigen::Quaterniond& q = row.orientation;
    const std::array<double, 4> wxyz{q.w(), q.x(), q.y(), q.z()};
    for (std::size_t k = 0; k < 4; ++k) visit(quaternion_names[k], unit::si, true, wxyz[k]);
  }
  for (std::size_t r = 0; r < data.reflectors; ++r) {
    for (std::size_t k = 0; k < 3; ++k)
      visit(point_name(r, k), unit::mm, true, row.reflector_m[r][static_cast<Eigen::Index>(k)]);
  }
}

/// Reads the columns common to data files and targets, and records which ones were used.
class ColumnReader {
 public:
  ColumnReader(CsvTable table, const Robot& robot)
      : table_(std::move(table)), robot_(robot), used_(table_.header.size()) {
    Measurement row;
    const auto look = [this](const std::string& name, const Unit&, bool& there, double&) {
      there = use(name).has_value();
    };
    each_context_column(columns_, row, look);
    each_sigma_column(columns_, row, look);
  }

  const CsvTable& table() const { return table_; }
  bool has(const std::string& name) const { return table_.has(name); }

  std::optional<std::size_t> use(const std::string& name) {
    const auto column = table_.find(name);
    if (column) used_[*column] = true;
    return column;
  }
  std::size_t require(const std::string& name, std::string_view purpose) {
    std::vector<std::string> strange;
    for (const std::string& h : table_.header) {
      if (!is_known(h)) strange.push_back(h);
    }
    const std::size_t column = table_.require(name, purpose, strange);
    used_[column] = true;
    return column;
  }
  std::array<std::size_t, joint_count> require_joints(std::string (*name)(std::size_t),
                                                      std::string_view purpose) {
    std::array<std::size_t, joint_count> columns{};
    for (std::size_t j = 0; j < joint_count; ++j) columns[j] = require(name(j), purpose);
    return columns;
  }

  double number(const CsvRow& row, std::size_t column, const Unit& unit) const {
    return table_.number(row, column, unit);
  }
  InputError error(const CsvRow& row, const std::string& column, const std::string& expected) const {
    return {table_.path, row.line, column, expected, "'" + row.cells[*table_.find(column)] + "'"};
  }

  const ContextColumns& columns() const { return columns_; }

  /// Context, motion and sigma of a row.
  void read_context(const CsvRow& row, Measurement& m) const {
    m.context = default_context<double>(robot_.nominal);
    m.position_sigma_m = robot_.position_sigma_m;
    m.orientation_sigma_rad = robot_.orientation_sigma_rad;
    each_context_column(columns_, m,
                        [&](const std::string& name, const Unit& unit, bool there, double& value) {
                          if (there) value = number(row, *table_.find(name), unit);
                        });
    if (m.context.payload_kg < 0) throw error(row, "payload_kg", "a mass of 0 or more");
    each_sigma_column(columns_, m, [&](const char* name, const Unit& unit, bool there, double& value) {
      if (!there) return;
      value = number(row, *table_.find(name), unit);
      if (!(value > 0)) throw error(row, name, "a standard deviation above 0");
    });
    read_motion(row, m);
  }

  void read_joints(const CsvRow& row, const std::array<std::size_t, joint_count>& columns,
                   std::array<double, joint_count>& q_rad, bool within_limits) const {
    for (std::size_t j = 0; j < joint_count; ++j) {
      q_rad[j] = number(row, columns[j], unit::degree);
      const JointLimits& limits = robot_.nominal.limits[j];
      if (within_limits && (q_rad[j] < limits.min_rad - limit_tolerance_rad ||
                            q_rad[j] > limits.max_rad + limit_tolerance_rad)) {
        throw error(row, table_.header[columns[j]],
                    fmt::format("a reading within the limits of joint {} in {} ({:.6g} to {:.6g} deg)", j + 1,
                                robot_.path, degrees(limits.min_rad), degrees(limits.max_rad)));
      }
    }
  }

  Eigen::Quaterniond read_quaternion(const CsvRow& row, const std::array<std::size_t, 4>& columns) const {
    std::array<double, 4> wxyz{};
    for (std::size_t k = 0; k < 4; ++k) wxyz[k] = number(row, columns[k], unit::si);
    if (const auto q = unit_quaternion(wxyz)) return *q;
    throw InputError(table_.path, row.line, "qw qx qy qz", unit_quaternion_rule, norm_text(wxyz));
  }

  /// Refuses readings in radians under names in degrees: all below 7.
  void refuse_radians(const std::array<std::size_t, joint_count>& columns, const LoadOptions& options) const {
    if (options.force || table_.rows.size() < suspicious_rows) return;
    double largest = 0;
    for (const CsvRow& row : table_.rows) {
      for (const std::size_t c : columns) largest = std::max(largest, std::abs(number(row, c, unit::si)));
    }
    if (largest > suspicious_below) return;
    throw InputError(table_.path, 0, "q1_deg … q6_deg", "degrees",
                     fmt::format("no reading above {:.3g} in {} rows: these look like radians", largest,
                                 table_.rows.size()),
                     ErrorCode::looks_like_radians);
  }

  /// Lists unknown columns, with a warning each. Known columns that are not used (a measured position where
  /// only joints are read) are left out without one.
  std::vector<std::size_t> unknown(std::vector<std::string>& names,
                                   std::vector<std::string>& warnings) const {
    std::vector<std::size_t> columns;
    for (std::size_t k = 0; k < used_.size(); ++k) {
      const std::string& name = table_.header[k];
      if (used_[k] || is_known(name)) continue;
      const std::string near = nearest(name, known_names());
      columns.push_back(k);
      names.push_back(name);
      if (name == point_label) continue;
      warnings.push_back(fmt::format("{}:1: column '{}' has no meaning here and is passed through{}.",
                                     table_.path, name,
                                     near.empty() ? "" : fmt::format(" (did you mean '{}'?)", near)));
    }
    return columns;
  }

 private:
  void read_motion(const CsvRow& row, Measurement& m) const {
    double largest = 0;
    for (std::size_t j = 0; j < joint_count; ++j) {
      double& d = m.context.direction[j];
      if (d != -1 && d != 0 && d != 1) throw error(row, direction_name(j), "-1, 0 (unknown) or 1");
      if (!columns_.move[j]) continue;
      const double sign = m.move_rad[j] > 0 ? 1 : m.move_rad[j] < 0 ? -1 : 0;
      if (d != 0 && d != sign) {
        const std::string& move = row.cells[*table_.find(move_name(j))];
        throw error(row, direction_name(j), fmt::format("the sign of {} ({})", move_name(j), move));
      }
      d = sign;
      largest = std::max(largest, std::abs(m.move_rad[j]));
    }
    // The speed relative to the fastest joint needs the motion of every joint.
    if (!columns_.all_moves() || largest == 0) return;
    for (std::size_t j = 0; j < joint_count; ++j) m.context.relative_speed[j] = m.move_rad[j] / largest;
  }

  CsvTable table_;
  const Robot& robot_;
  std::vector<bool> used_;
  ContextColumns columns_;
};

/// Measured columns of a file.
struct MeasuredColumns {
  MeasurementKind kind = MeasurementKind::joints;
  std::array<std::size_t, 3> position{};
  std::array<std::size_t, 4> quaternion{};
  std::array<std::array<std::size_t, 3>, 4> point{};
  std::size_t reflectors = 0;
};

MeasuredColumns find_measured(ColumnReader& reader, bool required) {
  MeasuredColumns m;
  bool any_position = false;
  bool any_quaternion = false;
  std::array<bool, 4> any_point{};
  for (std::size_t k = 0; k < 3; ++k) {
    any_position = any_position || reader.has(position_name(k));
    for (std::size_t r = 0; r < 4; ++r) any_point[r] = any_point[r] || reader.has(point_name(r, k));
  }
  for (const char* name : quaternion_names) any_quaternion = any_quaternion || reader.has(name);
  const bool any_reflector = any_point[0] || any_point[1] || any_point[2] || any_point[3];
  const char* const choice =
      "what was measured: x_mm y_mm z_mm with or without qw qx qy qz, or reflectors ax_mm … cz_mm (dz_mm)";
  if ((any_position || any_quaternion) && any_reflector) {
    throw InputError(reader.table().path, 1, "", choice, "both a position and reflectors");
  }
  if (any_position || any_quaternion) {
    for (std::size_t k = 0; k < 3; ++k) m.position[k] = reader.require(position_name(k), choice);
    m.kind = MeasurementKind::position;
  }
  if (any_quaternion) {
    for (std::size_t k = 0; k < 4; ++k) m.quaternion[k] = reader.require(quaternion_names[k], choice);
    m.kind = MeasurementKind::pose;
  }
  if (any_reflector) {
    m.reflectors = any_point[3] ? 4 : 3;
    for (std::size_t r = 0; r < m.reflectors; ++r) {
      for (std::size_t k = 0; k < 3; ++k) m.point[r][k] = reader.require(point_name(r, k), choice);
    }
    m.kind = MeasurementKind::reflectors;
  }
  if (required && m.kind == MeasurementKind::joints) reader.require("x_mm", choice);
  return m;
}

void read_measured(const ColumnReader& reader, const CsvRow& row, const MeasuredColumns& columns,
                   Measurement& m) {
  if (columns.kind == MeasurementKind::position || columns.kind == MeasurementKind::pose) {
    for (std::size_t k = 0; k < 3; ++k) {
      m.position_m[static_cast<Eigen::Index>(k)] = reader.number(row, columns.position[k], unit::mm);
    }
  }
  if (columns.kind == MeasurementKind::pose) m.orientation = reader.read_quaternion(row, columns.quaternion);
  for (std::size_t r = 0; r < columns.reflectors; ++r) {
    for (std::size_t k = 0; k < 3; ++k) {
      m.reflector_m[r][static_cast<Eigen::Index>(k)] = reader.number(row, columns.point[r][k], unit::mm);
    }
  }
}

/// Refuses a row that equals another one in all values. A repeated measurement differs in its noise; an equal row is a
/// copying error that would count as independent data.
void refuse_repeats(const CsvTable& table) {
  std::unordered_map<std::string, std::size_t> seen;
  for (const CsvRow& row : table.rows) {
    std::string key;
    for (const std::string& cell : row.cells) {
      // By value: 1.0 and 1 are the same number.
      const auto value = parse_si(cell, unit::si);
      key += value ? fmt::format("{},", *value) : "\"" + cell + "\",";
    }
    const auto [at, is_new] = seen.emplace(std::move(key), row.line);
    if (!is_new) {
      throw InputError(table.path, row.line, "", "another row (a pose measured again differs in its noise)",
                       fmt::format("every value of line {} again", at->second));
    }
  }
}

MeasuredData load(const std::string& path, const Robot& robot, const LoadOptions& options, bool measured) {
  ColumnReader reader(read_csv(path), robot);
  MeasuredData data;
  data.path = path;
  const auto joints = reader.require_joints(joint_name, "joint readings q1_deg … q6_deg");
  const MeasuredColumns columns = find_measured(reader, measured);
  data.kind = columns.kind;
  data.reflectors = columns.reflectors;
  data.columns = reader.columns();
  const std::vector<std::size_t> extra = reader.unknown(data.extra, data.warnings);
  const CsvTable& table = reader.table();
  if (table.rows.empty()) throw InputError(path, 2, "", "at least one row", "none");
  reader.refuse_radians(joints, options);
  for (const CsvRow& row : table.rows) {
    Measurement m;
    m.line = row.line;
    reader.read_joints(row, joints, m.q_rad, true);
    reader.read_context(row, m);
    read_measured(reader, row, columns, m);
    for (const std::size_t c : extra) m.extra.push_back(row.cells[c]);
    data.rows.push_back(std::move(m));
  }
  if (measured) {
    refuse_repeats(table);
    if (!robot.has_noise && !data.columns.position_sigma) {
      data.warnings.push_back(fmt::format(
          "{}: neither it (sigma_mm) nor {} (noise) says how exact the measurement is; {:.3g} mm is assumed.",
          path, robot.path, robot.position_sigma_m * 1e3));
    }
  }
  return data;
}

std::string joined(const std::vector<std::string>& cells) {
  return fmt::format("{}\n", fmt::join(cells, ","));
}

}  // namespace

MeasuredData load_data(const std::string& path, const Robot& robot, const LoadOptions& options) {
  return load(path, robot, options, true);
}

MeasuredData load_joints(const std::string& path, const Robot& robot, const LoadOptions& options) {
  return load(path, robot, options, false);
}

const std::vector<std::string>& context_names() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> names{"payload_kg", "temp_c"};
    for (std::size_t k = 0; k < 3; ++k) {
      names.push_back(com_name(k));
      names.push_back(force_name(k));
    }
    for (std::size_t j = 0; j < joint_count; ++j) {
      names.push_back(move_name(j));
      names.push_back(direction_name(j));
    }
    return names;
  }();
  return all;
}

std::vector<std::string> joint_and_context_names(const ContextColumns& columns) {
  std::vector<std::string> names;
  for (std::size_t j = 0; j < joint_count; ++j) names.push_back(joint_name(j));
  each_context_column(columns, Measurement(), [&](const std::string& name, const Unit&, bool there, double) {
    if (there) names.push_back(name);
  });
  return names;
}

std::vector<std::string> joint_and_context_cells(const ContextColumns& columns, const Measurement& row) {
  std::vector<std::string> cells;
  for (const double q : row.q_rad) cells.push_back(format_si(q, unit::degree));
  each_context_column(columns, row, [&](const std::string&, const Unit& unit, bool there, double value) {
    if (there) cells.push_back(format_si(value, unit));
  });
  return cells;
}

std::string data_text(const MeasuredData& data) {
  std::vector<std::string> names = joint_and_context_names(data.columns);
  const auto add_name = [&names](const std::string& name, const Unit&, bool there, double) {
    if (there) names.push_back(name);
  };
  each_measured_column(data, Measurement(), add_name);
  each_sigma_column(data.columns, Measurement(), add_name);
  for (const std::string& name : data.extra) names.push_back(csv_cell(name));

  std::string text = joined(names);
  for (const Measurement& row : data.rows) {
    std::vector<std::string> cells = joint_and_context_cells(data.columns, row);
    const auto add_cell = [&cells](const std::string&, const Unit& unit, bool there, double value) {
      if (there) cells.push_back(format_si(value, unit));
    };
    each_measured_column(data, row, add_cell);
    each_sigma_column(data.columns, row, add_cell);
    for (const std::string& cell : row.extra) cells.push_back(csv_cell(cell));
    text += joined(cells);
  }
  return text;
}

void save_data(const std::string& path, const MeasuredData& data) { write_file(path, data_text(data)); }

TargetsFile load_targets(const std::string& path, const Robot& robot, const LoadOptions& options) {
  ColumnReader reader(read_csv(path), robot);
  TargetsFile targets;
  targets.path = path;
  bool any_joint = false;
  for (std::size_t j = 0; j < joint_count; ++j) any_joint = any_joint || reader.has(joint_name(j));
  targets.poses =
      !any_joint && (reader.has("x_mm") || reader.has("y_mm") || reader.has("z_mm") || reader.has("qw"));
  const char* const choice =
      "targets: q1_deg … q6_deg, or x_mm y_mm z_mm qw qx qy qz with seed1_deg … seed6_deg";
  std::array<std::size_t, joint_count> joints{};
  MeasuredColumns pose;
  if (targets.poses) {
    for (std::size_t k = 0; k < 3; ++k) pose.position[k] = reader.require(position_name(k), choice);
    for (std::size_t k = 0; k < 4; ++k) pose.quaternion[k] = reader.require(quaternion_names[k], choice);
    pose.kind = MeasurementKind::pose;
    joints = reader.require_joints(seed_name, "a pose needs seed1_deg … seed6_deg to choose the branch");
  } else {
    joints = reader.require_joints(joint_name, choice);
  }
  const std::vector<std::size_t> extra = reader.unknown(targets.extra, targets.warnings);
  for (const std::string& name : targets.extra) {
    if (std::find(answer_columns.begin(), answer_columns.end(), name) != answer_columns.end())
      throw InputError(path, 1, name, "targets",
                       "a column of the answers to targets: this file was written by compensate or probe");
  }
  const CsvTable& table = reader.table();
  if (table.rows.empty()) throw InputError(path, 2, "", "at least one row", "none");
  reader.refuse_radians(joints, options);
  for (const CsvRow& row : table.rows) {
    Measurement m;
    reader.read_joints(row, joints, m.q_rad, targets.poses);
    reader.read_context(row, m);
    read_measured(reader, row, pose, m);
    Target target;
    target.line = row.line;
    target.q_rad = m.q_rad;
    target.position_m = m.position_m;
    target.orientation = m.orientation;
    target.context = m.context;
    for (const std::size_t c : extra) target.extra.push_back(row.cells[c]);
    targets.rows.push_back(std::move(target));
  }
  return targets;
}

}  // namespace flexcomp::host
