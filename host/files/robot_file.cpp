#include "files/robot_file.hpp"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "files/yaml_field.hpp"

namespace flexcomp::host {

namespace {

std::array<double, 3> array3(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

void read_joint(const YamlField& joint, std::size_t i, RobotFile& robot) {
  joint.require_keys({"theta_deg", "d_mm", "a_mm", "alpha_deg", "beta_deg", "min_deg", "max_deg",
                      "max_speed_deg_s", "gear_ratio"});
  NominalLink& link = robot.nominal.links[i];
  link.theta_rad = joint.at("theta_deg").number(unit::degree);
  link.d_m = joint.at("d_mm").number(unit::mm);
  link.a_m = joint.at("a_mm").number(unit::mm);
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

void read_tool(const YamlField& tool, RobotFile& robot) {
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

}  // namespace

namespace {

RobotFile read_robot(const YamlField& root) {
  const std::string& path = root.file();
  root.require_keys(
      {"name", "joints", "gravity_m_s2", "tool", "payload", "reference_temperature_c", "noise", "capsules"});
  RobotFile robot;
  robot.path = path;
  robot.name = root.at("name").text();
  robot.nominal.name_hash = name_hash(robot.name.data(), robot.name.size());

  const YamlField list = root.at("joints");
  const std::vector<YamlField> joints = list.items();
  if (joints.size() != joint_count) throw list.error("a list of exactly six joints");
  for (std::size_t i = 0; i < joint_count; ++i) read_joint(joints[i], i, robot);

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

RobotFile load_robot(const std::string& path) { return read_robot(YamlField::load(path)); }

RobotFile parse_robot(const std::string& text, const std::string& name) {
  return read_robot(YamlField::parse(text, name));
}

}  // namespace flexcomp::host
