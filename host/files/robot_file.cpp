// SPDX-License-Identifier: Apache-2.0
#include "files/robot_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "files/capsule.hpp"
#include "files/yaml_field.hpp"

namespace flexcomp::host {

namespace {

std::array<double, 3> array3(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

double length(const YamlField& joint, const char* key, LongLinks long_links) {
  const YamlField field = joint.at(key);
  const double value = field.number(unit::mm);
  if (long_links == LongLinks::refused && std::abs(value) > longest_link_m) {
    throw field
        .error(fmt::format(
            "at most {:.0f} mm either way. Calibrated tables of arms with nearly parallel axes hold such "
            "lengths, "
            "which cancel on the next link",
            longest_link_m / unit::mm.si_per_file_unit()))
        .with(ErrorCode::long_links);
  }
  return value;
}

void read_joint(const YamlField& joint, std::size_t i, LongLinks long_links, Robot& robot) {
  joint.require_keys({"theta_deg", "d_mm", "a_mm", "alpha_deg", "beta_deg", "min_deg", "max_deg",
                      "max_speed_deg_s", "gear_ratio"});
  NominalLink& link = robot.nominal.links[i];
  link.theta_rad = joint.at("theta_deg").number(unit::degree);
  link.d_m = length(joint, "d_mm", long_links);
  link.a_m = length(joint, "a_mm", long_links);
  link.alpha_rad = joint.at("alpha_deg").number(unit::degree);
  link.beta_rad = joint.number_or("beta_deg", unit::degree, 0);
  JointLimits& limits = robot.nominal.limits[i];
  limits.min_rad = joint.at("min_deg").number(unit::degree);
  limits.max_rad = joint.at("max_deg").number(unit::degree);
  if (!(limits.min_rad < limits.max_rad)) {
    throw joint.at("max_deg").error(fmt::format("more than min_deg ({})", joint.at("min_deg").text()));
  }
  if (const auto speed = joint.find("max_speed_deg_s")) {
    robot.max_speed_rad_s[i] = speed->number(unit::degree, 0, "a number above 0");
  }
  if (const auto ratio = joint.find("gear_ratio")) {
    robot.gear_ratio[i] = ratio->number(unit::si, 0, "a number above 0");
  }
}

void read_tool(const YamlField& tool, Robot& robot) {
  tool.require_keys({"xyz_mm", "quaternion_wxyz", "reflectors_mm"});
  if (const auto xyz = tool.find("xyz_mm")) robot.nominal.tool_xyz_m = array3(xyz->vector3(unit::mm));
  if (const auto wxyz = tool.find("quaternion_wxyz")) {
    const Eigen::Quaterniond q = wxyz->quaternion();
    robot.nominal.tool_wxyz = {q.w(), q.x(), q.y(), q.z()};
  }
  if (const auto reflectors = tool.find("reflectors_mm")) {
    reflectors->require_keys({"a", "b", "c", "d"});
    for (const char* key : {"a", "b", "c"})
      robot.reflectors_m.push_back(reflectors->at(key).vector3(unit::mm));
    if (const auto d = reflectors->find("d")) robot.reflectors_m.push_back(d->vector3(unit::mm));
  }
}

std::string list_text(const Eigen::Vector3d& v, const Unit& unit) {
  return fmt::format("[{}, {}, {}]", yaml_number(v.x(), unit), yaml_number(v.y(), unit),
                     yaml_number(v.z(), unit));
}

Eigen::Vector3d vector3(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

std::string joint_text(const Robot& robot, std::size_t i) {
  const NominalLink& link = robot.nominal.links[i];
  const JointLimits& limits = robot.nominal.limits[i];
  std::string text = fmt::format(
      "  - {{theta_deg: {}, d_mm: {}, a_mm: {}, alpha_deg: {}, beta_deg: {}, min_deg: {}, max_deg: {}",
      yaml_number(link.theta_rad, unit::degree), yaml_number(link.d_m, unit::mm),
      yaml_number(link.a_m, unit::mm), yaml_number(link.alpha_rad, unit::degree),
      yaml_number(link.beta_rad, unit::degree), yaml_number(limits.min_rad, unit::degree),
      yaml_number(limits.max_rad, unit::degree));
  if (robot.max_speed_rad_s[i] > 0)
    text += ", max_speed_deg_s: " + yaml_number(robot.max_speed_rad_s[i], unit::degree);
  if (robot.gear_ratio[i] > 0) text += ", gear_ratio: " + yaml_number(robot.gear_ratio[i], unit::si);
  return text + "}\n";
}

}  // namespace

std::string robot_text(const Robot& robot, const std::vector<std::string>& comment) {
  const NominalRobot<joint_count>& nominal = robot.nominal;
  std::string text;
  for (std::string line : comment) {
    // Names come from other files: no line break may end the comment.
    std::replace_if(
        line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
    text += line.empty() ? "#\n" : "# " + line + "\n";
  }
  text += "name: " + yaml_quoted(robot.name) + "\n";
  if (!robot.serial.empty()) text += "serial: " + yaml_quoted(robot.serial) + "\n";
  text += "joints:\n";
  for (std::size_t i = 0; i < joint_count; ++i) text += joint_text(robot, i);
  text += "gravity_m_s2: " + list_text(vector3(nominal.gravity_m_s2), unit::si) + "\n";
  const auto& q = nominal.tool_wxyz;
  text += fmt::format("tool: {{xyz_mm: {}, quaternion_wxyz: [{}, {}, {}, {}]",
                      list_text(vector3(nominal.tool_xyz_m), unit::mm), yaml_number(q[0], unit::si),
                      yaml_number(q[1], unit::si), yaml_number(q[2], unit::si), yaml_number(q[3], unit::si));
  if (!robot.reflectors_m.empty()) {
    text += ", reflectors_mm: {";
    for (std::size_t k = 0; k < robot.reflectors_m.size(); ++k)
      text +=
          fmt::format("{}{}: {}", k == 0 ? "" : ", ", "abcd"[k], list_text(robot.reflectors_m[k], unit::mm));
    text += "}";
  }
  text += fmt::format("}}\npayload: {{mass_kg: {}, com_mm: {}}}\n", yaml_number(nominal.payload_kg, unit::si),
                      list_text(vector3(nominal.payload_com_m), unit::mm));
  text += "reference_temperature_c: " + yaml_number(nominal.reference_temperature_c, unit::si) + "\n";
  if (robot.has_noise) {
    text += fmt::format("noise: {{position_mm: {}, orientation_deg: {}}}\n",
                        yaml_number(robot.position_sigma_m, unit::mm),
                        yaml_number(robot.orientation_sigma_rad, unit::degree));
  }
  if (!robot.capsules.empty()) text += "capsules:\n";
  for (const Capsule& c : robot.capsules) {
    text += fmt::format("  - {{frame: {}, from_mm: {}, to_mm: {}, radius_mm: {}}}\n", c.frame,
                        list_text(c.from_m, unit::mm), list_text(c.to_m, unit::mm),
                        yaml_number(c.radius_m, unit::mm));
  }
  return text;
}

namespace {

Robot read_robot(const YamlField& root, LongLinks long_links) {
  const std::string& path = root.file();
  root.require_keys({"name", "joints", "gravity_m_s2", "tool", "payload", "reference_temperature_c", "noise",
                     "capsules", "serial"});
  Robot robot;
  robot.path = path;
  robot.name = root.at("name").text();
  robot.nominal.name_hash = name_hash(robot.name.data(), robot.name.size());

  if (const auto serial = root.find("serial")) {
    const std::string text = serial->text();
    if (!is_serial(text)) {
      // What was found is not repeated: it may be what makes a terminal do something.
      throw serial->error(
          fmt::format("a serial number of 1 to {} bytes of UTF-8 without control characters", longest_serial),
          fmt::format("{} bytes that are none", text.size()));
    }
    set_serial(robot, text);
  }

  const YamlField list = root.at("joints");
  const std::vector<YamlField> joints = list.items();
  if (joints.size() != joint_count) throw list.error("a list of exactly six joints");
  for (std::size_t i = 0; i < joint_count; ++i) read_joint(joints[i], i, long_links, robot);

  if (const auto gravity = root.find("gravity_m_s2")) {
    robot.nominal.gravity_m_s2 = array3(gravity->vector3(unit::si));
    const auto& g = robot.nominal.gravity_m_s2;
    if (std::hypot(g[0], g[1], g[2]) > 100) throw gravity->error("an acceleration in m/s^2, about 9.8 long");
  }
  if (const auto tool = root.find("tool")) read_tool(*tool, robot);
  if (const auto payload = root.find("payload")) {
    payload->require_keys({"mass_kg", "com_mm"});
    robot.nominal.payload_kg = payload->at("mass_kg").number(unit::si);
    if (robot.nominal.payload_kg < 0) throw payload->at("mass_kg").error("a mass of 0 or more");
    if (const auto com = payload->find("com_mm"))
      robot.nominal.payload_com_m = array3(com->vector3(unit::mm));
  }
  robot.nominal.reference_temperature_c = root.number_or("reference_temperature_c", unit::si, 20);
  if (const auto noise = root.find("noise")) {
    noise->require_keys({"position_mm", "orientation_deg"});
    robot.has_noise = true;
    robot.position_sigma_m = noise->at("position_mm").number(unit::mm, 0, "a standard deviation above 0");
    if (const auto orientation = noise->find("orientation_deg")) {
      robot.orientation_sigma_rad = orientation->number(unit::degree, 0, "a standard deviation above 0");
    }
  }
  if (const auto capsules = root.find("capsules")) {
    for (const YamlField& field : capsules->items()) robot.capsules.push_back(read_capsule(field));
  }
  return robot;
}

}  // namespace

Robot load_robot(const std::string& path, LongLinks long_links) {
  return read_robot(YamlField::load(path), long_links);
}

Robot parse_robot(const std::string& text, const std::string& name) {
  return read_robot(YamlField::parse(text, name), LongLinks::refused);
}

}  // namespace flexcomp::host
