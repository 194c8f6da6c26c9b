// SPDX-License-Identifier: Apache-2.0
#include "files.hpp"

#include <yaml-cpp/yaml.h>

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <numbers>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string_view>

namespace plant {
namespace {

constexpr double millimetre = 1e-3;
constexpr double degree = std::numbers::pi / 180;
constexpr double per_hour = 1.0 / 3600;

using KDL::Vector;

std::runtime_error wrong(const std::string& path, const YAML::Node& node, const std::string& text) {
  return std::runtime_error(path + ":" + std::to_string(node.Mark().line + 1) + ": " + text);
}

Vector vector3(const YAML::Node& node, double unit) {
  const auto v = node.as<std::array<double, 3>>();
  return {unit * v[0], unit * v[1], unit * v[2]};
}

/// Key of a file with its internal name and unit.
struct Key {
  std::string_view file;
  std::string_view here;
  double unit;
};

constexpr std::array small_keys{Key{"x_mm", "x", millimetre}, Key{"y_mm", "y", millimetre},
                                Key{"z_mm", "z", millimetre}, Key{"rx_deg", "rx", degree},
                                Key{"ry_deg", "ry", degree},  Key{"rz_deg", "rz", degree}};
constexpr std::array link_keys{Key{"theta_deg", "theta", degree}, Key{"d_mm", "d", millimetre},
                               Key{"a_mm", "a", millimetre}, Key{"alpha_deg", "alpha", degree},
                               Key{"beta_deg", "beta", degree}};
constexpr std::array effect_keys{Key{"joint", "joint", 1},
                                 Key{"from", "from", 1},
                                 Key{"link", "link", 1},
                                 Key{"order", "order", 1},
                                 Key{"rad_per_nm", "rad_per_nm", 1},
                                 Key{"rad_per_nm3", "rad_per_nm3", 1},
                                 Key{"k1_rad", "k1", 1},
                                 Key{"k2_rad", "k2", 1},
                                 Key{"k3_rad", "k3", 1},
                                 Key{"sin_rad", "sin", 1},
                                 Key{"cos_rad", "cos", 1},
                                 Key{"half_gap_rad", "half_gap", 1},
                                 Key{"rad", "lag", 1},
                                 Key{"gain", "gain", 1},
                                 Key{"alpha_sin_rad", "alpha_sin", 1},
                                 Key{"alpha_cos_rad", "alpha_cos", 1},
                                 Key{"gamma_sin_rad", "gamma_sin", 1},
                                 Key{"gamma_cos_rad", "gamma_cos", 1},
                                 Key{"alpha_rad_per_nm", "alpha_per_nm", 1},
                                 Key{"beta_rad_per_nm", "beta_per_nm", 1},
                                 Key{"per_k", "per_k", 1},
                                 Key{"x_mm_per_h", "x_per_s", millimetre* per_hour},
                                 Key{"y_mm_per_h", "y_per_s", millimetre* per_hour},
                                 Key{"z_mm_per_h", "z_per_s", millimetre* per_hour},
                                 Key{"rx_deg_per_h", "rx_per_s", degree* per_hour},
                                 Key{"ry_deg_per_h", "ry_per_s", degree* per_hour},
                                 Key{"rz_deg_per_h", "rz_per_s", degree* per_hour},
                                 Key{"pivot_z_mm", "pivot_z", millimetre},
                                 Key{"rx_rad_per_nm", "rx_per_nm", 1},
                                 Key{"ry_rad_per_nm", "ry_per_nm", 1},
                                 Key{"mass_kg", "mass", 1},
                                 Key{"com_x_mm", "com_x", millimetre},
                                 Key{"com_y_mm", "com_y", millimetre},
                                 Key{"com_z_mm", "com_z", millimetre},
                                 Key{"after_s", "after", 1},
                                 Key{"x_mm", "x", millimetre},
                                 Key{"y_mm", "y", millimetre},
                                 Key{"z_mm", "z", millimetre}};

/// Numbers of a mapping by internal names, without the `skipped` keys.
template <class Keys>
std::map<std::string, double> numbers(const std::string& path, const YAML::Node& node, const Keys& keys,
                                      const std::vector<std::string>& skipped = {}) {
  std::map<std::string, double> values;
  for (const auto& entry : node) {
    const auto name = entry.first.as<std::string>();
    bool known = false;
    for (const std::string& s : skipped) known = known || s == name;
    if (known) continue;
    for (const Key& key : keys) {
      if (key.file != name) continue;
      values[std::string(key.here)] = key.unit * entry.second.as<double>();
      known = true;
    }
    if (!known) throw wrong(path, entry.first, "the plant does not know the key '" + name + "'");
  }
  return values;
}

double of(const std::map<std::string, double>& values, const std::string& key) {
  const auto found = values.find(key);
  return found == values.end() ? 0 : found->second;
}

SmallMove small_move(const std::string& path, const YAML::Node& node) {
  if (!node) return {};
  const auto v = numbers(path, node, small_keys);
  return {of(v, "x"), of(v, "y"), of(v, "z"), of(v, "rx"), of(v, "ry"), of(v, "rz")};
}

Link link_of(const std::map<std::string, double>& v) {
  return {of(v, "theta"), of(v, "d"), of(v, "a"), of(v, "alpha"), of(v, "beta"), 0};
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::string cell;
  for (std::istringstream in(line); std::getline(in, cell, ',');) {
    const auto begin = cell.find_first_not_of(" \t\r\"");
    const auto end = cell.find_last_not_of(" \t\r\"");
    cells.push_back(begin == std::string::npos ? std::string() : cell.substr(begin, end - begin + 1));
  }
  return cells;
}

/// One line of a CSV file as numbers by column name.
struct Cells {
  const std::map<std::string, std::size_t>& column;
  std::vector<std::string> cell;
  std::string where;

  std::optional<double> find(const std::string& name) const {
    const auto found = column.find(name);
    if (found == column.end()) return std::nullopt;
    double v = 0;
    const std::string text = found->second < cell.size() ? cell[found->second] : std::string();
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), v);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(v)) {
      throw std::runtime_error(where + ": " + name + ": expected a number, found '" + text + "'");
    }
    return v;
  }
  double in(const std::string& name, double unit, double otherwise) const {
    const auto v = find(name);
    return v ? *v * unit : otherwise;
  }
};

Row row_of(const Cells& cells, const Nominal& nominal) {
  Row row;
  Context& c = row.context = usual_context(nominal);
  c.payload_kg = cells.in("payload_kg", 1, c.payload_kg);
  c.temperature_c = cells.in("temp_c", 1, c.temperature_c);
  c.time_s = cells.in("time_s", 1, 0);
  for (int k = 0; k < 3; ++k) {
    const std::string axis(1, "xyz"[k]);
    c.payload_com_m[k] = cells.in("payload_" + axis + "_mm", millimetre, c.payload_com_m[k]);
    c.force_n[k] = cells.in("f" + axis + "_n", 1, 0);
  }
  for (std::size_t j = 0; j < joints; ++j) {
    const std::string number = std::to_string(j + 1);
    const auto q = cells.find("q" + number + "_deg");
    if (!q) throw std::runtime_error(cells.where + ": column q" + number + "_deg is missing");
    row.q_rad[j] = *q * degree;
    c.move_rad[j] = cells.in("move" + number + "_deg", degree, 0);
    const double sign = c.move_rad[j] > 0 ? 1 : c.move_rad[j] < 0 ? -1 : 0;
    c.direction[j] = cells.in("dir" + number, 1, sign);
  }
  return row;
}

}  // namespace

Nominal read_robot(const std::string& path) {
  const YAML::Node root = YAML::LoadFile(path);
  Nominal robot;
  robot.name = root["name"].as<std::string>();
  const YAML::Node list = root["joints"];
  if (list.size() != joints) throw wrong(path, list, "expected six joints");
  for (std::size_t i = 0; i < joints; ++i) {
    const YAML::Node joint = list[i];
    robot.link[i] =
        link_of(numbers(path, joint, link_keys, {"min_deg", "max_deg", "max_speed_deg_s", "gear_ratio"}));
    robot.min_rad[i] = joint["min_deg"].as<double>() * degree;
    robot.max_rad[i] = joint["max_deg"].as<double>() * degree;
  }
  if (root["gravity_m_s2"]) robot.gravity = vector3(root["gravity_m_s2"], 1);
  if (const YAML::Node tool = root["tool"]) {
    if (tool["xyz_mm"]) robot.tool.p = vector3(tool["xyz_mm"], millimetre);
    if (tool["quaternion_wxyz"]) {
      const auto q = tool["quaternion_wxyz"].as<std::array<double, 4>>();
      const double norm = std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
      robot.tool.M = KDL::Rotation::Quaternion(q[1] / norm, q[2] / norm, q[3] / norm, q[0] / norm);
    }
    if (const YAML::Node reflectors = tool["reflectors_mm"]) {
      for (const char* name : {"a", "b", "c", "d"}) {
        if (reflectors[name]) robot.reflector_m.push_back(vector3(reflectors[name], millimetre));
      }
    }
  }
  if (const YAML::Node payload = root["payload"]) {
    robot.payload_kg = payload["mass_kg"].as<double>();
    if (payload["com_mm"]) robot.payload_com_m = vector3(payload["com_mm"], millimetre);
  }
  if (root["reference_temperature_c"]) {
    robot.reference_temperature_c = root["reference_temperature_c"].as<double>();
  }
  return robot;
}

Truth read_truth(const std::string& path, const Nominal& nominal) {
  const YAML::Node root = YAML::LoadFile(path);
  for (const auto& entry : root) {
    const auto name = entry.first.as<std::string>();
    if (name != "robot" && name != "geometric" && name != "base" && name != "tool" && name != "effects") {
      throw wrong(path, entry.first, "a truth file has no '" + name + "'");
    }
  }
  if (root["robot"] && root["robot"].as<std::string>() != nominal.name) {
    throw wrong(path, root["robot"], "this is the truth of " + root["robot"].as<std::string>());
  }
  Truth truth;
  for (const YAML::Node& node : root["geometric"]) {
    const auto i = node["link"].as<std::size_t>();
    if (i < 1 || i > joints) throw wrong(path, node, "a link from 1 to 6");
    truth.error[i - 1] = link_of(numbers(path, node, link_keys, {"link"}));
  }
  truth.base = small_move(path, root["base"]);
  truth.tool = small_move(path, root["tool"]);
  for (const YAML::Node& node : root["effects"]) {
    Effect effect;
    effect.name = node["effect"].as<std::string>();
    effect.value = numbers(path, node, effect_keys, {"effect", "coefficients_rad"});
    if (node["coefficients_rad"]) effect.curve_rad = node["coefficients_rad"].as<std::vector<double>>();
    truth.effects.push_back(effect);
  }
  return truth;
}

std::vector<Row> read_joints(const std::string& path, const Nominal& nominal) {
  std::ifstream file(path);
  std::string line;
  if (!std::getline(file, line)) throw std::runtime_error(path + ": cannot be read");
  std::map<std::string, std::size_t> column;
  const std::vector<std::string> header = cells_of(line);
  for (std::size_t k = 0; k < header.size(); ++k) column[header[k]] = k;
  std::vector<Row> rows;
  for (std::size_t number = 2; std::getline(file, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    rows.push_back(row_of({column, cells_of(line), path + ":" + std::to_string(number)}, nominal));
  }
  if (rows.empty()) throw std::runtime_error(path + ": no rows");
  return rows;
}

void save(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) throw std::runtime_error(path + ": cannot be written");
}

void Table::row(const std::vector<double>& values) {
  if (values.size() != header_.size()) throw std::logic_error("a row of another length than the header");
  rows_.push_back(values);
}

void Table::save(const std::string& path) const {
  std::string text;
  for (std::size_t k = 0; k < header_.size(); ++k) text += (k > 0 ? "," : "") + header_[k];
  text += '\n';
  std::array<char, 40> cell{};
  for (const auto& row : rows_) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      // 14 digits: a metre in mm to a millionth of a micrometre, so that rounding does not affect comparisons.
      std::snprintf(cell.data(), cell.size(), "%s%.14g", k > 0 ? "," : "", row[k]);
      text += cell.data();
    }
    text += '\n';
  }
  plant::save(path, text);
}

}  // namespace plant
