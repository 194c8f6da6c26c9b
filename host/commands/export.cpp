// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <string>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "exchange/bus_files.hpp"
#include "exchange/corrected_urdf.hpp"
#include "exchange/robot_header.hpp"
#include "exchange/urdf_file.hpp"
#include "files/calibration_file.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "json.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

/// How far a rigid description is off is asked of so many poses.
constexpr std::size_t asked_poses = 2000;

struct Export {
  CommonOptions common;
  std::string robot;
  std::string calibration;
  std::string urdf;
  UrdfLinks links;
  std::string format;
  std::string out;

  void run() const;

 private:
  void need(const std::string& value, const char* option) const;
  void c_header() const;
  void corrected_urdf() const;
  void data_sheet() const;
  void modbus_map() const;
};

void Export::need(const std::string& value, const char* option) const {
  if (value.empty()) throw CLI::RequiredError(fmt::format("{} (with --as {})", option, format));
}

void Export::run() const {
  refuse_same_file({{"--robot", robot}, {"--calibration", calibration}, {"--urdf", urdf}},
                   {{"-o", out}, {"--json", common.json}});
  if (format == "c") c_header();
  if (format == "urdf") corrected_urdf();
  if (format == "eds") data_sheet();
  if (format == "modbus") modbus_map();
}

void Export::c_header() const {
  need(robot, "--robot");
  const Robot file = load_robot(robot);
  write_file(out, robot_header(file, "\"flexcomp export\""));
  const std::string hash = hex(nominal_hash(file.nominal));
  common.say(fmt::format("{}: nominal robot {} as the C constant {}, nominal hash {}…", out, file.name,
                         c_identifier(file.name), hash.substr(0, 12)));
  common.write_json({{"robot", file.name},
                     {"format", format},
                     {"constant", c_identifier(file.name)},
                     {"nominal_hash", hash},
                     {"output", out}});
}

void Export::corrected_urdf() const {
  need(robot, "--robot");
  need(calibration, "--calibration");
  need(urdf, "--urdf");
  const Robot file = load_robot(robot);
  const Calibration set = load_calibration(calibration, file);
  const CorrectedUrdf corrected = correct_urdf(urdf, links, file, set);
  const LeftOut left = left_out_by_rigid(set, file, asked_poses);
  write_file(out, corrected.text);
  common.say(fmt::format(
      "{}: {} with the origins of {} joints corrected; its link {} moves as Ftool of {}, seen from {}", out,
      urdf, corrected.joints.size(), corrected.tip, calibration, corrected.base));
  Json joints = Json::array();
  for (const CorrectedUrdf::Joint& j : corrected.joints) {
    common.say(fmt::format("  {:<24} moved {:>9.4f} mm, turned {:>9.5f} deg", j.name, j.moved_m * 1e3,
                           degrees(j.turned_rad)));
    joints.push_back(
        {{"joint", j.name}, {"moved_mm", j.moved_m * 1e3}, {"turned_deg", degrees(j.turned_rad)}});
  }
  if (corrected.added_tip) {
    common.say(fmt::format("  nothing fixed lies between joint 6 and the tip: the link {} was added for it",
                           corrected.tip));
  }
  Json effects = Json::array();
  if (left.effects.empty()) {
    common.say("  the calibration is rigid: the URDF holds all of it");
  } else {
    common.say(fmt::format(
        "  a URDF cannot hold the rest, up to {:.4f} mm and {:.5f} deg at the tool over {} random poses:",
        left.largest_m * 1e3, degrees(left.largest_rad), left.poses));
    for (const LeftOut::Effect& e : left.effects) {
      common.say(fmt::format("    {:<40} up to {:>8.4f} mm, {:>9.5f} deg", e.name, e.largest_m * 1e3,
                             degrees(e.largest_rad)));
      effects.push_back(
          {{"effect", e.name}, {"largest_mm", e.largest_m * 1e3}, {"largest_deg", degrees(e.largest_rad)}});
    }
  }
  if (set.frames) common.say("  frames F and E belong to the measurement and are not in it");
  common.write_json({{"robot", file.name},
                     {"format", format},
                     {"base", corrected.base},
                     {"tip", corrected.tip},
                     {"added_tip", corrected.added_tip},
                     {"joints", joints},
                     {"left_out",
                      {{"largest_mm", left.largest_m * 1e3},
                       {"largest_deg", degrees(left.largest_rad)},
                       {"poses", left.poses},
                       {"effects", effects}}},
                     {"output", out}});
}

void Export::data_sheet() const {
  write_file(out, electronic_data_sheet(std::filesystem::path(out).filename().string()));
  common.say(out + ": electronic data sheet of the CANopen node");
  common.write_json({{"format", format}, {"output", out}});
}

void Export::modbus_map() const {
  const std::string ending = std::filesystem::path(out).extension().string();
  if (ending == ".csv") {
    write_file(out, register_map_csv());
  } else if (ending == ".json") {
    write_file(out, register_map_json().dump(2) + "\n");
  } else if (ending == ".md") {
    write_file(out, register_map_markdown());
  } else {
    throw CLI::ValidationError("-o", "a file that ends in .csv, .json or .md says how the map is written");
  }
  common.say(fmt::format("{}: Modbus register map, {} fields", out, register_map().size()));
  common.write_json({{"format", format}, {"output", out}});
}

}  // namespace

void add_export(CLI::App& app) {
  auto [command, options] = add_command<Export>(
      app, "export",
      "Robot, calibration and bus maps in the words of other programs.\n"
      "c: the nominal robot as a header for a controller's build. A parameter set is accepted only where "
      "the controller has the\n"
      "very geometry, to the last bit, for which the set was made; the header holds it so. Give its "
      "constant to flexcomp_init().\n"
      "urdf: your URDF with the origins of its joints corrected, all else byte for byte; what a URDF "
      "cannot hold is said in mm.\n"
      "eds: electronic data sheet (CiA 306) of the CANopen node.\n"
      "modbus: the register map, as .csv, .json or .md.");
  command.add_option("--as", options.format, "Format")
      ->required()
      ->check(CLI::IsMember({"c", "urdf", "eds", "modbus"}));
  add_value(command, "--robot", options.robot, "ROBOT.yaml", "Robot file (c, urdf)");
  add_value(command, "--calibration", options.calibration, "CAL.yaml", "Calibration file (urdf)");
  add_value(command, "--urdf", options.urdf, "ARM.urdf",
            "URDF of the same arm, whose joints are corrected (urdf)");
  add_value(command, "--base", options.links.base, "LINK",
            "Link of the URDF that is the base [default: the root link]");
  add_value(command, "--tip", options.links.tip, "LINK",
            "Link of the URDF that is Ftool [default: the only end of six joints]");
  add_value(command, "--flange", options.links.flange, "LINK",
            "Link of the URDF at which F6 lies [default: tool0, else the tip]");
  add_value(command, "-o,--output", options.out, "FILE", "File to write")->required();
  options.common.add_to(command);
  command.footer(
      "Examples:\n"
      "  flexcomp export --robot tx60l.yaml --as c -o tx60l.h\n"
      "  flexcomp export --robot tx60l.yaml --calibration cal.yaml --urdf tx60l.urdf --as urdf -o "
      "corrected.urdf\n"
      "  flexcomp export --as eds -o flexcomp.eds\n"
      "  flexcomp export --as modbus -o map.csv\n"
      "and in the controller:\n"
      "  #include \"tx60l.h\"\n"
      "  arm = flexcomp_init(&memory, sizeof memory, &staubli_tx60l, NULL, &flash);\n"
      "The constant has the robot's name; the comment in the header shows the nominal hash, of which\n"
      "\"flexcomp push\" says when a controller has another one. Export again when the robot file changes.");
}

}  // namespace flexcomp::host
