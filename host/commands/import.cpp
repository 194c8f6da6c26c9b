// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/import_measurements.hpp"
#include "exchange/imported_arm.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "input_error.hpp"
#include "json.hpp"
#include "quaternion.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

struct Import {
  CommonOptions common;
  std::string source;
  UrdfLinks links;
  ImportMeasurements measurements;
  std::string name;
  std::string out;

  void run() const;
};

/// F0 in the base as people and machines read it.
struct Placed {
  std::array<double, 3> xyz_mm;
  std::array<double, 4> wxyz;

  explicit Placed(const Pose<double>& pose) {
    const Eigen::Vector3d p = pose.position * 1e3;
    const Eigen::Quaterniond q = unit_quaternion(pose.rotation);
    xyz_mm = {p.x(), p.y(), p.z()};
    wxyz = {q.w(), q.x(), q.y(), q.z()};
  }
  std::string text() const {
    return fmt::format("xyz_mm [{}], quaternion_wxyz [{}]", fmt::join(xyz_mm, ", "), fmt::join(wxyz, ", "));
  }
};

bool is_robot_file(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  return ending == ".yaml" || ending == ".yml";
}

std::vector<std::string> comment(const ImportedArm& arm, const std::string& source) {
  const std::string file = std::filesystem::path(source).filename().string();
  std::vector<std::string> lines{fmt::format("Made of {} by \"flexcomp import\".", file)};
  if (arm.base.empty()) {
    lines.push_back("The same arm, F0 and tool; near-parallel axes by beta_deg.");
    return lines;
  }
  lines.push_back(fmt::format("Ftool is its link {}, F6 lies at its link {}; joints {}.", arm.tip, arm.flange,
                              fmt::join(arm.joints, ", ")));
  if (arm.f0_is_base) {
    lines.push_back(fmt::format("F0 is its link {}.", arm.base));
  } else {
    lines.push_back(fmt::format(
        "F0 is not its link {0}, for the axis of joint 1 is not the z axis there. F0 seen from {0}:",
        arm.base));
    lines.push_back(Placed(arm.base_to_f0).text());
  }
  lines.push_back("Payload, noise of the instrument, reflectors and capsules are not in a URDF: add yours.");
  for (const std::string& warning : arm.warnings) lines.push_back(warning);
  return lines;
}

void Import::run() const {
  const bool links_given = !(links.base.empty() && links.tip.empty() && links.flange.empty());
  if (measurements.asked()) {
    if (links_given || !name.empty())
      throw CLI::ValidationError("--base, --tip, --flange, --name",
                                 "belong to a robot; --joints makes data of points");
    refuse_same_file({{"FILE", source},
                      {"--joints", measurements.joints},
                      {"--robot", measurements.robot},
                      {"--map", measurements.map}},
                     {{"--output", out}, {"--json", common.json}});
    measurements.run(common, source, out);
    return;
  }
  measurements.refuse_without_joints();
  refuse_same_file({{"FILE", source}}, {{"--output", out}, {"--json", common.json}});
  const bool from_robot_file = is_robot_file(source);
  if (from_robot_file && links_given) {
    throw CLI::ValidationError("--base, --tip, --flange", "are links of a URDF; a robot file has none");
  }
  ImportedArm arm = from_robot_file ? import_robot(source) : import_urdf(source, links);
  if (!name.empty()) arm.robot.name = name;
  if (arm.robot.name.empty()) throw InputError(source, 0, "robot", "a name, here or by --name", "none");
  write_file(out, robot_text(arm.robot, comment(arm, source)));
  const Placed f0(arm.base_to_f0);
  common.warn(arm.warnings);
  common.say(from_robot_file
                 ? fmt::format("{}: {}, links put anew", out, arm.robot.name)
                 : fmt::format("{}: {}, from link {} to link {}", out, arm.robot.name, arm.base, arm.tip));
  if (!arm.f0_is_base) {
    common.say(fmt::format("  F0 is not {}: the axis of joint 1 is not the z axis there. F0 seen from it: {}",
                           arm.base, f0.text()));
  }
  Json result{{"robot", arm.robot.name}};
  if (!from_robot_file) {
    result.update({{"base", arm.base}, {"flange", arm.flange}, {"tip", arm.tip}, {"joints", arm.joints}});
  }
  result["f0_is_base"] = arm.f0_is_base;
  result["base_to_f0"] = {{"xyz_mm", f0.xyz_mm}, {"quaternion_wxyz", f0.wxyz}};
  result["warnings"] = arm.warnings;
  result["output"] = out;
  common.write_json(result);
}

}  // namespace

void add_import(CLI::App& app) {
  auto [command, options] = add_command<Import>(
      app, "import",
      "What others write: an instrument's points with a robot's log into data, or a URDF into a robot file.\n"
      "With --joints: SOURCE is a point list as SpatialAnalyzer, PolyWorks and their like export it; each "
      "point gets the "
      "joint\n"
      "readings of the log by name, order or time. What has no partner is listed, what is not understood "
      "refused.\n"
      "Without: SOURCE is a URDF (or a robot file whose near-parallel axes made lengths run off) with "
      "exactly six "
      "revolute or\n"
      "continuous joints between base and tip. The tip moves as in the URDF to 1e-9 m and rad, seen from the "
      "base: F0 is "
      "the base\n"
      "wherever joint 1 turns about its z axis, else the nearest frame of which that is true, and the "
      "constant transform "
      "between\n"
      "them is in the file's comment and in --json.");
  add_value(command, "source", options.source, "FILE",
            "Point list of an instrument; or a URDF (after xacro), or a robot file (.yaml)")
      ->required();
  add_value(command, "--base", options.links.base, "LINK",
            "Link that is to be the base [default: the root link]");
  add_value(command, "--tip", options.links.tip, "LINK",
            "Link that is to be Ftool [default: the only end of six joints]");
  add_value(command, "--flange", options.links.flange, "LINK",
            "Link at which F6 is to lie, between joint 6 and the tip [default: tool0, else the tip]");
  add_value(command, "--name", options.name, "NAME", "Name of the robot [default: the file's]");
  add_value(command, "-o,--output", options.out, "FILE", "Robot file, or data file with --joints")
      ->required();
  options.measurements.add_to(command);
  options.common.add_to(command);
  command.footer(
      "Examples:\n"
      "  flexcomp import tracker.txt --joints log.csv --robot tx60l.yaml -o measured.csv\n"
      "  flexcomp import tracker.txt --joints log.csv --map map.yaml --names '*::{pose}' --unit mm --robot "
      "tx60l.yaml -o "
      "measured.csv\n"
      "  flexcomp import kr6.urdf --base base_link --tip tool0 --name kuka-kr6-r900 -o kr6.yaml\n"
      "docs/formats.md shows the formats and a map. Payload, reflectors, noise and capsules are not in a "
      "URDF: add yours.");
}

}  // namespace flexcomp::host
