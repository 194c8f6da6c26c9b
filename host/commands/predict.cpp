// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <string>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "json.hpp"
#include "kinematics/measured_pose.hpp"
#include "quaternion.hpp"

namespace flexcomp::host {
namespace {

struct Predict {
  CommonOptions common;
  std::string robot;
  std::string calibration;
  std::string joints;
  std::string out;
  bool force = false;

  void run() const;
};

void Predict::run() const {
  refuse_same_file({{"--robot", robot}, {"--calibration", calibration}, {"--joints", joints}},
                   {{"-o", out}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  Calibration set;  // without a calibration: the nominal arm
  if (!calibration.empty()) set = load_calibration(calibration, robot_file);
  MeasuredData data = load_joints(joints, robot_file, {force});
  common.warn(data.warnings);
  const auto model = prepare(set.terms, robot_file, set.path);
  data.kind = MeasurementKind::pose;
  data.reflectors = 0;
  data.columns.position_sigma = data.columns.orientation_sigma = false;  // nothing was measured
  for (Measurement& row : data.rows) {
    const Pose<double> pose = measured_pose(*model, set, row.q_rad, row.context);
    row.position_m = pose.position;
    row.orientation = unit_quaternion(pose.rotation);
  }
  save_data(out, data);
  common.say(fmt::format("{}: {} poses of {} with {}{}", out, data.rows.size(), robot_file.name,
                         calibration.empty() ? "no errors (nominal)" : calibration,
                         set.frames ? ", in the frame of the instrument" : ""));
  common.write_json({{"poses", data.rows.size()},
                     {"robot", robot_file.name},
                     {"calibration", calibration},
                     {"frames", set.frames.has_value()},
                     {"output", out}});
}

}  // namespace

void add_predict(CLI::App& app) {
  auto [command, options] =
      add_command<Predict>(app, "predict", "The pose that the forward model gives for joint readings");
  add_robot_option(command, options.robot);
  add_value(command, "--calibration", options.calibration, "CAL.yaml|TRUTH.yaml",
            "Calibration or truth file; without it the nominal arm");
  add_value(command, "--joints", options.joints, "Q.csv",
            "Joint readings q1_deg … q6_deg [deg] and, where it matters, context (payload_kg, temp_c, …); "
            "a data file will do, what was measured in it is not used")
      ->required();
  add_value(command, "-o,--output", options.out, "P.csv",
            "Poses in the columns of a data file [mm, quaternion w x y z]")
      ->required();
  add_force_option(command, options.force);
  options.common.add_to(command);
  command.footer(
      "Example:\n  flexcomp predict --robot tx60l.yaml --calibration cal.yaml --joints q.csv -o p.csv");
}

}  // namespace flexcomp::host
