// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "flexcomp/model.hpp"
#include "json.hpp"
#include "measurement/simulation.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

const std::map<std::string, NoiseLevel> noise_levels{
    {noise_n1.name, noise_n1}, {noise_n2.name, noise_n2}, {no_noise.name, no_noise}};

struct Simulate {
  CommonOptions common;
  std::string robot;
  std::string truth;
  unsigned poses = 0;
  std::string joints;
  std::string measure = "pose";
  std::vector<double> payloads;
  bool context = false;
  std::string noise = "N1";
  std::vector<double> frame;  // x y z mm, rx ry rz deg
  std::string out;

  void run() const;
};

void Simulate::run() const {
  refuse_same_file({{"--robot", robot}, {"--truth", truth}, {"--joints", joints}},
                   {{"-o", out}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  Calibration set = load_calibration(truth, robot_file);
  if (!frame.empty()) {
    if (!set.frames) set.frames.emplace();
    set.frames->f = Frame::of(small_pose<double>({frame[0] * 1e-3, frame[1] * 1e-3, frame[2] * 1e-3,
                                                  radians(frame[3]), radians(frame[4]), radians(frame[5])}));
  }
  Simulation simulation;
  simulation.kind = measurement_kinds.at(measure);
  simulation.noise = noise_levels.at(noise);
  simulation.poses = poses;
  simulation.payloads_kg = payloads;
  simulation.context = context;
  simulation.seed = common.seed;
  std::optional<MeasuredData> given;
  if (!joints.empty()) {
    given = load_joints(joints, robot_file);
    common.warn(given->warnings);
  }
  const MeasuredData data = simulate(robot_file, set, simulation, given);
  save_data(out, data);
  common.say(fmt::format("{}: {} {} of {}, {} measured with noise {}, seed {}", out, data.rows.size(),
                         joints.empty() ? "random poses" : "poses of " + joints, robot_file.name, measure,
                         noise, common.seed));
  common.write_json({{"poses", data.rows.size()},
                     {"robot", robot_file.name},
                     {"measure", measure},
                     {"noise", noise},
                     {"seed", common.seed},
                     {"output", out}});
}

}  // namespace

void add_simulate(CLI::App& app) {
  auto [command, options] =
      add_command<Simulate>(app, "simulate", "Measured data from an assumed true robot");
  add_robot_option(command, options.robot);
  add_value(command, "--truth", options.truth, "TRUTH.yaml", "Truth file: the robot's errors by name")
      ->required();
  CLI::Option_group* where = command.add_option_group("poses", "Where to measure");
  where->add_option("--poses", options.poses, "Number of random poses, uniform within the joint limits")
      ->check(CLI::Range(1U, 10000000U));
  CLI::Option* joints =
      where
          ->add_option("--joints", options.joints,
                       "Poses from a file instead, with its payloads and context: a plan, say")
          ->type_name("Q.csv");
  where->require_option(1);
  command.add_option("--measure", options.measure, "What is measured: pose, position or reflectors")
      ->check(CLI::IsMember({"pose", "position", "reflectors"}))
      ->capture_default_str();
  add_value(command, "--payloads", options.payloads, "KG,KG,…",
            "Payloads in turn [kg], at the robot file's centre of mass")
      ->delimiter(',')
      ->check(non_negative_number())
      ->excludes(joints);
  command
      .add_flag("--context", options.context,
                "Also random motion before each pose [deg], temperature [deg C] and time [s]")
      ->excludes(joints);
  command
      .add_option("--noise", options.noise,
                  "N1 (0.035 mm, 0.007 deg per axis), N2 (twice that) or none; reflectors: mm per coordinate")
      ->check(CLI::IsMember({"N1", "N2", "none"}))
      ->capture_default_str();
  add_value(command, "--frame", options.frame, "X,Y,Z,RX,RY,RZ",
            "Where the instrument sees the robot's base: x,y,z,rx,ry,rz [mm, deg], turned by "
            "Rot(z,rz) Rot(y,ry) Rot(x,rx)")
      ->delimiter(',')
      ->expected(6)
      ->check(finite_number());
  add_value(command, "-o,--output", options.out, "D.csv", "Data file")->required();
  options.common.add_seed_to(command);
  options.common.add_to(command);
  command.footer(
      "Example:\n  flexcomp simulate --robot tx60l.yaml --truth truth.yaml --poses 60 --payloads 0,1.108 "
      "--noise N1 -o "
      "data.csv");
}

}  // namespace flexcomp::host
