// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/numbers.hpp"
#include "commands/outputs.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "flexcomp/model.hpp"
#include "input_error.hpp"
#include "kinematics/measured_pose.hpp"
#include "measurement/noise_level.hpp"
#include "quaternion.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

const std::map<std::string, NoiseLevel> noise_levels{
    {noise_n1.name, noise_n1}, {noise_n2.name, noise_n2}, {no_noise.name, no_noise}};

constexpr double largest_move_rad = radians(30);
constexpr double seconds_per_pose = 60;
constexpr double temperature_spread_k = 8;

/// A value with so many decimals in its file's unit: files that people can read.
double rounded(double si, int decimals, const Unit& unit) {
  return *parse_si(fmt::format("{:.{}f}", si / unit.si_per_file_unit(), decimals), unit);
}
/// To the micro-degree, finer than any controller displays it.
double rounded_angle(double rad) { return rounded(rad, 6, unit::degree); }

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
  Measurement random_place(std::size_t k, const Robot& robot_file, std::mt19937_64& random) const;
  void random_context(std::size_t k, const Robot& robot_file, std::mt19937_64& random,
                      Measurement& row) const;
  void measured(const Robot& robot_file, Pose<double> pose, std::mt19937_64& random, Measurement& row) const;
};

/// Motion, temperature and time that do not follow each other or the pose, so that their effects can be told apart.
void Simulate::random_context(std::size_t k, const Robot& robot_file, std::mt19937_64& random,
                              Measurement& row) const {
  std::uniform_real_distribution<double> symmetric(-1, 1);
  double largest = 0;
  for (std::size_t j = 0; j < joint_count; ++j) {
    row.move_rad[j] = rounded_angle(largest_move_rad * symmetric(random));
    row.context.direction[j] = row.move_rad[j] > 0 ? 1 : row.move_rad[j] < 0 ? -1 : 0;
    largest = std::max(largest, std::abs(row.move_rad[j]));
  }
  for (std::size_t j = 0; j < joint_count && largest > 0; ++j)
    row.context.relative_speed[j] = row.move_rad[j] / largest;
  row.context.temperature_c = rounded(
      robot_file.nominal.reference_temperature_c + temperature_spread_k * symmetric(random), 2, unit::si);
  row.context.time_s =
      rounded(seconds_per_pose * (static_cast<double>(k) + 0.2 * symmetric(random) + 0.2), 1, unit::si);
}

/// What the instrument says about a true pose.
void Simulate::measured(const Robot& robot_file, Pose<double> pose, std::mt19937_64& random,
                        Measurement& row) const {
  const NoiseLevel& level = noise_levels.at(noise);
  std::normal_distribution<double> normal(0, 1);
  const auto vector = [&](double sigma) {
    const double x = sigma * normal(random);
    const double y = sigma * normal(random);
    return Eigen::Vector3d(x, y, sigma * normal(random));
  };
  for (std::size_t r = 0;
       r < robot_file.reflectors_m.size() && measurement_kinds.at(measure) == MeasurementKind::reflectors;
       ++r) {
    row.reflector_m[r] =
        pose.rotation * robot_file.reflectors_m[r] + pose.position + vector(level.position_sigma_m);
  }
  row.position_m = pose.position + vector(level.position_sigma_m);
  const Eigen::Vector3d turn = vector(level.orientation_sigma_rad);
  if (turn.norm() > 0) {
    pose.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * pose.rotation;
  }
  row.orientation = unit_quaternion(pose.rotation);
  row.position_sigma_m = level.position_sigma_m;
  row.orientation_sigma_rad = level.orientation_sigma_rad;
}

/// Where to measure, and in which context.
Measurement Simulate::random_place(std::size_t k, const Robot& robot_file, std::mt19937_64& random) const {
  Measurement row;
  row.context = default_context<double>(robot_file.nominal);
  for (std::size_t j = 0; j < joint_count; ++j) {
    const JointLimits& limits = robot_file.nominal.limits[j];
    row.q_rad[j] =
        rounded_angle(std::uniform_real_distribution<double>(limits.min_rad, limits.max_rad)(random));
  }
  if (!payloads.empty()) row.context.payload_kg = payloads[k % payloads.size()];
  if (context) random_context(k, robot_file, random, row);
  return row;
}

void Simulate::run() const {
  refuse_same_file({{"--robot", robot}, {"--truth", truth}, {"--joints", joints}},
                   {{"-o", out}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  Calibration set = load_calibration(truth, robot_file);
  MeasuredData data;
  if (joints.empty()) {
    data.columns.payload_mass = !payloads.empty();
    data.columns.move.fill(context);
    data.columns.temperature = data.columns.time = context;
    data.rows.resize(poses);
  } else {
    data = load_joints(joints, robot_file);
    common.warn(data.warnings);
    // What may have been measured there is not what is measured here.
    data.extra.clear();
    for (Measurement& row : data.rows) row.extra.clear();
  }
  data.kind = measurement_kinds.at(measure);
  data.reflectors = 0;
  if (data.kind == MeasurementKind::reflectors) {
    data.reflectors = robot_file.reflectors_m.size();
    if (data.reflectors == 0) {
      throw InputError(robot, 0, "tool.reflectors_mm", "reflectors a, b, c (, d) for --measure reflectors",
                       "nothing");
    }
  }
  if (!frame.empty()) {
    if (!set.frames) set.frames.emplace();
    set.frames->f = Frame::of(small_pose<double>({frame[0] * 1e-3, frame[1] * 1e-3, frame[2] * 1e-3,
                                                  radians(frame[3]), radians(frame[4]), radians(frame[5])}));
  }
  const bool noisy = noise != "none";
  data.columns.position_sigma = noisy;
  data.columns.orientation_sigma = noisy && data.kind == MeasurementKind::pose;
  const auto model = prepare(set.terms, robot_file, truth);

  std::mt19937_64 random(common.seed);
  for (std::size_t k = 0; k < data.rows.size(); ++k) {
    Measurement& row = data.rows[k];
    if (joints.empty()) row = random_place(k, robot_file, random);
    measured(robot_file, measured_pose(*model, set, row.q_rad, row.context), random, row);
  }
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
  auto options = std::make_shared<Simulate>();
  CLI::App* command = app.add_subcommand("simulate", "Measured data from an assumed true robot");
  add_robot_option(*command, options->robot);
  command->add_option("--truth", options->truth, "Truth file: the robot's errors by name")
      ->type_name("TRUTH.yaml")
      ->required();
  CLI::Option_group* where = command->add_option_group("poses", "Where to measure");
  where->add_option("--poses", options->poses, "Number of random poses, uniform within the joint limits")
      ->check(CLI::Range(1U, 10000000U));
  CLI::Option* joints =
      where
          ->add_option("--joints", options->joints,
                       "Poses from a file instead, with its payloads and context: a plan, say")
          ->type_name("Q.csv");
  where->require_option(1);
  command->add_option("--measure", options->measure, "What is measured: pose, position or reflectors")
      ->check(CLI::IsMember({"pose", "position", "reflectors"}))
      ->capture_default_str();
  command
      ->add_option("--payloads", options->payloads,
                   "Payloads in turn [kg], at the robot file's centre of mass")
      ->delimiter(',')
      ->check(non_negative_number())
      ->type_name("KG,KG,…")
      ->excludes(joints);
  command
      ->add_flag("--context", options->context,
                 "Also random motion before each pose [deg], temperature [deg C] and time [s]")
      ->excludes(joints);
  command
      ->add_option(
          "--noise", options->noise,
          "N1 (0.035 mm, 0.007 deg per axis), N2 (twice that) or none; reflectors: mm per coordinate")
      ->check(CLI::IsMember({"N1", "N2", "none"}))
      ->capture_default_str();
  command
      ->add_option("--frame", options->frame,
                   "Where the instrument sees the robot's base: x,y,z,rx,ry,rz [mm, deg], turned by "
                   "Rot(z,rz) Rot(y,ry) Rot(x,rx)")
      ->delimiter(',')
      ->expected(6)
      ->check(finite_number())
      ->type_name("X,Y,Z,RX,RY,RZ");
  command->add_option("-o,--output", options->out, "Data file")->type_name("D.csv")->required();
  options->common.add_seed_to(*command);
  options->common.add_to(*command);
  command->footer(
      "Example:\n  flexcomp simulate --robot tx60l.yaml --truth truth.yaml --poses 60 --payloads 0,1.108 "
      "--noise N1 -o "
      "data.csv");
  command->callback([options] { options->run(); });
}

}  // namespace flexcomp::host
