// SPDX-License-Identifier: Apache-2.0
/// \file `flexcomp-plant`: simulates the true robot of a closed loop: measurements with noise, and the poses
/// that the arm reaches. Shares no code with the core or the calibrator.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "files.hpp"
#include "true_robot.hpp"

namespace {

using namespace plant;

constexpr double degree = std::numbers::pi / 180;
constexpr double millimetre = 1e-3;
constexpr double largest_move_deg = 30;

/// Standard deviations per axis (Chen et al. 2019).
struct Noise {
  double position_m;
  double orientation_rad;
};
const std::map<std::string, Noise> noises{
    {"N1", {0.035e-3, 0.007 * degree}}, {"N2", {0.07e-3, 0.014 * degree}}, {"none", {0, 0}}};

struct Options {
  std::string robot, truth, measure = "reflectors", noise = "N1", joints, nominal, out, json, points, log;
  std::vector<double> payloads_kg;
  bool moves = false;
  unsigned poses = 0;
  std::uint64_t seed = 1;
};

std::vector<std::string> joint_names() {
  std::vector<std::string> names;
  for (std::size_t j = 1; j <= joints; ++j) names.push_back("q" + std::to_string(j) + "_deg");
  return names;
}

void add(std::vector<double>& values, const KDL::Vector& v) {
  for (int k = 0; k < 3; ++k) values.push_back(v[k] / millimetre);
}

void add(std::vector<double>& values, const KDL::Rotation& rotation) {
  double x = 0, y = 0, z = 0, w = 0;
  rotation.GetQuaternion(x, y, z, w);
  const double sign = w < 0 ? -1 : 1;
  for (const double c : {w, x, y, z}) values.push_back(sign * c);
}

void measure(const Options& options) {
  const Nominal robot = read_robot(options.robot);
  const Truth truth = read_truth(options.truth, robot);
  const Noise& noise = noises.at(options.noise);
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  const auto error = [&](double sigma) {
    const double x = normal(random);
    const double y = normal(random);
    return sigma * KDL::Vector(x, y, normal(random));
  };

  const bool reflectors = options.measure == "reflectors";
  const bool pose = options.measure == "pose";
  if (reflectors && robot.reflector_m.size() < 3) {
    throw std::runtime_error(options.robot + ": tool.reflectors_mm: expected a, b, c (, d)");
  }
  std::vector<std::string> header = joint_names();
  if (!options.payloads_kg.empty()) header.emplace_back("payload_kg");
  for (std::size_t j = 1; options.moves && j <= joints; ++j)
    header.push_back("move" + std::to_string(j) + "_deg");
  if (reflectors) {
    for (std::size_t r = 0; r < robot.reflector_m.size(); ++r) {
      for (const char* axis : {"x_mm", "y_mm", "z_mm"}) header.push_back(std::string(1, "abcd"[r]) + axis);
    }
  } else {
    header.insert(header.end(), {"x_mm", "y_mm", "z_mm"});
    if (pose) header.insert(header.end(), {"qw", "qx", "qy", "qz"});
  }
  if (noise.position_m > 0) header.emplace_back("sigma_mm");
  if (noise.position_m > 0 && pose) header.emplace_back("sigma_deg");

  Table table(header);
  for (unsigned n = 0; n < options.poses; ++n) {
    JointVector q{};
    std::vector<double> row;
    for (std::size_t j = 0; j < joints; ++j) {
      std::uniform_real_distribution<double> reading(robot.min_rad[j] / degree, robot.max_rad[j] / degree);
      // Rounded as on a teach pendant: the written reading is the true one.
      const double shown_deg = std::trunc(reading(random) * 1e4) / 1e4;
      q[j] = shown_deg * degree;
      row.push_back(shown_deg);
    }
    Context context = usual_context(robot);
    if (!options.payloads_kg.empty()) {
      context.payload_kg = options.payloads_kg[n % options.payloads_kg.size()];
      row.push_back(context.payload_kg);
    }
    for (std::size_t j = 0; options.moves && j < joints; ++j) {
      std::uniform_real_distribution<double> move(-largest_move_deg, largest_move_deg);
      const double shown_deg = std::trunc(move(random) * 1e4) / 1e4;
      context.move_rad[j] = shown_deg * degree;
      context.direction[j] = shown_deg > 0 ? 1 : shown_deg < 0 ? -1 : 0;
      row.push_back(shown_deg);
    }
    const Reached arm = reached(robot, truth, q, context);
    if (reflectors) {
      for (const KDL::Vector& r : robot.reflector_m) {
        add(row, arm.tool * (arm.slip + r) + error(noise.position_m));
      }
    } else {
      add(row, arm.tool * arm.slip + error(noise.position_m));
      const KDL::Vector turn = error(noise.orientation_rad);
      if (pose) add(row, KDL::Rotation::Rot(turn, turn.Norm()) * arm.tool.M);
    }
    if (noise.position_m > 0) row.push_back(noise.position_m / millimetre);
    if (noise.position_m > 0 && pose) row.push_back(noise.orientation_rad / degree);
    table.row(row);
  }
  table.save(options.out);
  std::printf("%s: %u poses measured (%s, noise %s)\n", options.out.c_str(), options.poses,
              options.measure.c_str(), options.noise.c_str());
}

/// Pose of the tracker of session() in Fb: in front of the arm, facing it, slightly inclined.
const KDL::Frame tracker_in_base(KDL::Rotation::RPY(0.3 * degree, -0.2 * degree, 171 * degree),
                                 KDL::Vector(2.5, -0.4, 0.3));

/// Writes the files of a measuring session: the tracker's point list, in its own frame, and the robot's log.
/// Poses are named by their index in the plan. Where a controller corrects the commands, the log has the
/// uncorrected ones.
void session(const Options& options) {
  const Nominal robot = read_robot(options.robot);
  const Truth truth = read_truth(options.truth, robot);
  const std::vector<Row> poses = read_joints(options.joints, robot);
  const std::vector<Row> wanted = options.nominal.empty() ? poses : read_joints(options.nominal, robot);
  if (wanted.size() != poses.size()) {
    throw std::runtime_error(options.joints + " has " + std::to_string(poses.size()) + " rows, " +
                             options.nominal + " has " + std::to_string(wanted.size()));
  }
  const double sigma = noises.at(options.noise).position_m;
  if (robot.reflector_m.size() < 3) {
    throw std::runtime_error(options.robot + ": tool.reflectors_mm: expected a, b, c (, d)");
  }
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  std::string points =
      "// Units: Millimeters, Degrees\n// Frame: Instrument::0\n// Collection::Group::Point X Y Z\n";
  std::string log = "pose";
  for (std::size_t j = 1; j <= joints; ++j) log += ",J" + std::to_string(j) + " [deg]";
  log += ",payload_kg\n";
  std::array<char, 160> line{};
  for (std::size_t n = 0; n < poses.size(); ++n) {
    const Row& pose = wanted[n];
    std::snprintf(line.data(), line.size(), "P%02zu", n + 1);
    const std::string name = line.data();
    log += name;
    for (const double q : pose.q_rad) {
      std::snprintf(line.data(), line.size(), ",%.4f", q / degree);
      log += line.data();
    }
    std::snprintf(line.data(), line.size(), ",%g\n", pose.context.payload_kg);
    log += line.data();
    const Reached arm = reached(robot, truth, poses[n].q_rad, pose.context);
    for (std::size_t r = 0; r < robot.reflector_m.size(); ++r) {
      KDL::Vector seen = tracker_in_base.Inverse() * (arm.tool * (arm.slip + robot.reflector_m[r]));
      for (int k = 0; k < 3; ++k) seen[k] += sigma * normal(random);
      std::snprintf(line.data(), line.size(), "Cell::%s_%c %.4f %.4f %.4f\n", name.c_str(), "abcd"[r],
                    seen[0] / millimetre, seen[1] / millimetre, seen[2] / millimetre);
      points += line.data();
    }
  }
  save(options.points, points);
  save(options.log, log);
  std::printf("%s: %zu points of %zu poses (noise %s); %s: the robot's log\n", options.points.c_str(),
              poses.size() * robot.reflector_m.size(), poses.size(), options.noise.c_str(),
              options.log.c_str());
}

/// Mean, root mean square and maximum of one number over all poses.
struct Summary {
  double sum = 0, squares = 0, max = 0;
  unsigned count = 0;
  void take(double v) {
    sum += v;
    squares += v * v;
    max = std::max(max, v);
    ++count;
  }
  double mean() const { return sum / count; }
  double rms() const { return std::sqrt(squares / count); }
};

void where(const Options& options) {
  const Nominal robot = read_robot(options.robot);
  const Truth truth = read_truth(options.truth, robot);
  const std::vector<Row> commands = read_joints(options.joints, robot);
  const std::vector<Row> wanted = read_joints(options.nominal, robot);
  if (commands.size() != wanted.size()) {
    throw std::runtime_error(options.joints + " has " + std::to_string(commands.size()) + " rows, " +
                             options.nominal + " has " + std::to_string(wanted.size()));
  }
  std::vector<std::string> header = joint_names();
  header.insert(header.end(), {"x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "dx_mm", "dy_mm", "dz_mm",
                               "distance_mm", "distance_deg"});
  Table table(header);
  Summary position, orientation;
  for (std::size_t n = 0; n < commands.size(); ++n) {
    // The context is that of the uncorrected poses: corrected commands have joint angles only.
    const Reached arm = reached(robot, truth, commands[n].q_rad, wanted[n].context);
    const KDL::Frame target = drawn(robot, wanted[n].q_rad);
    const KDL::Vector off = arm.tool.p - target.p;
    const double turned = angle_of(arm.tool.M * target.M.Inverse());
    std::vector<double> row;
    for (const double q : commands[n].q_rad) row.push_back(q / degree);
    add(row, arm.tool.p);
    add(row, arm.tool.M);
    add(row, off);
    row.push_back(off.Norm() / millimetre);
    row.push_back(turned / degree);
    table.row(row);
    position.take(off.Norm() / millimetre);
    orientation.take(turned / degree);
  }
  table.save(options.out);
  std::printf(
      "%u poses: the arm is off by %.4f mm on average, %.4f mm at most; %.4f deg on average, %.4f deg at "
      "most\n",
      position.count, position.mean(), position.max, orientation.mean(), orientation.max);
  if (options.json.empty()) return;
  std::ofstream json(options.json);
  json.precision(12);
  json << "{\"poses\": " << position.count << ", \"mean_mm\": " << position.mean()
       << ", \"rms_mm\": " << position.rms() << ", \"max_mm\": " << position.max
       << ", \"mean_deg\": " << orientation.mean() << ", \"max_deg\": " << orientation.max << "}\n";
  json.close();
  if (!json) throw std::runtime_error(options.json + ": cannot be written");
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{
      "Simulates the true robot with its hidden errors, for closed loops. Shares no code with the "
      "calibrator.",
      "flexcomp-plant"};
  app.require_subcommand(1);
  CLI::App* measuring =
      app.add_subcommand("measure", "Measurements with noise at random poses within the limits");
  CLI::App* cell = app.add_subcommand("session", "A tracker's export and the robot's log at planned poses");
  CLI::App* asking = app.add_subcommand("where", "Poses that the true arm reaches for joint commands");
  for (CLI::App* command : {measuring, cell, asking}) {
    command->add_option("--robot", options.robot, "Robot file")->required();
    command->add_option("--truth", options.truth, "Truth file: the hidden errors")->required();
  }
  for (CLI::App* command : {measuring, asking})
    command->add_option("-o,--output", options.out, "CSV file to write")->required();
  for (CLI::App* command : {measuring, cell}) {
    command->add_option("--seed", options.seed, "Seed of the random numbers")->capture_default_str();
    command->add_option("--noise", options.noise, "N1: 0.035 mm and 0.007 deg per axis; N2: twice that; none")
        ->check(CLI::IsMember({"N1", "N2", "none"}))
        ->capture_default_str();
  }
  measuring->add_option("--poses", options.poses, "Number of poses")
      ->check(CLI::Range(1U, 1000000U))
      ->required();
  measuring->add_option("--measure", options.measure, "reflectors (A, B, C, D), pose or position")
      ->check(CLI::IsMember({"reflectors", "pose", "position"}))
      ->capture_default_str();
  measuring
      ->add_option("--payloads", options.payloads_kg, "Payloads in turn [kg]; otherwise the robot file's")
      ->delimiter(',');
  measuring->add_flag("--moves", options.moves,
                      "Each joint comes to the pose by a random motion, which is recorded");
  cell->add_option("--joints", options.joints,
                   "The plan: joints q1_deg … q6_deg, with payload_kg and other context columns")
      ->required();
  cell->add_option(
      "--nominal", options.nominal,
      "Uncorrected joints, where --joints are a controller's: the log has these, with the context");
  cell->add_option("--points", options.points,
                   "Point list to write, of the reflectors, in the tracker's frame")
      ->required();
  cell->add_option("--log", options.log, "The robot's log to write")->required();
  asking->add_option("--joints", options.joints, "Commanded joints, q1_deg … q6_deg")->required();
  asking
      ->add_option("--nominal", options.nominal,
                   "Uncorrected joints, whose nominal poses are the reference; with the context "
                   "(payload_kg, …)")
      ->required();
  asking->add_option("--json", options.json, "Means and maxima as JSON");
  try {
    app.parse(argc, argv);
    if (measuring->parsed()) measure(options);
    if (cell->parsed()) session(options);
    if (asking->parsed()) where(options);
    return 0;
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "flexcomp-plant: %s\n", e.what());
    return 3;
  }
}
