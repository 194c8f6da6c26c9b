// SPDX-License-Identifier: Apache-2.0
#include "measurement/simulation.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "input_error.hpp"
#include "kinematics/measured_pose.hpp"
#include "quaternion.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

constexpr double largest_move_rad = radians(30);
constexpr double seconds_per_pose = 60;
constexpr double temperature_spread_k = 8;

/// A value with so many decimals in its file's unit: files that people can read.
double rounded(double si, int decimals, const Unit& unit) {
  return *parse_si(fmt::format("{:.{}f}", si / unit.si_per_file_unit(), decimals), unit);
}
/// To the micro-degree, finer than any controller displays it.
double rounded_angle(double rad) { return rounded(rad, 6, unit::degree); }

/// Motion, temperature and time that do not follow each other or the pose, so that their effects can be told apart.
void random_context(std::size_t k, const Robot& robot, std::mt19937_64& random, Measurement& row) {
  std::uniform_real_distribution<double> symmetric(-1, 1);
  double largest = 0;
  for (std::size_t j = 0; j < joint_count; ++j) {
    row.move_rad[j] = rounded_angle(largest_move_rad * symmetric(random));
    row.context.direction[j] = row.move_rad[j] > 0 ? 1 : row.move_rad[j] < 0 ? -1 : 0;
    largest = std::max(largest, std::abs(row.move_rad[j]));
  }
  for (std::size_t j = 0; j < joint_count && largest > 0; ++j)
    row.context.relative_speed[j] = row.move_rad[j] / largest;
  row.context.temperature_c =
      rounded(robot.nominal.reference_temperature_c + temperature_spread_k * symmetric(random), 2, unit::si);
  row.context.time_s =
      rounded(seconds_per_pose * (static_cast<double>(k) + 0.2 * symmetric(random) + 0.2), 1, unit::si);
}

/// What the instrument says about a true pose.
void measure(const Robot& robot, MeasurementKind kind, const NoiseLevel& level, Pose<double> pose,
             std::mt19937_64& random, Measurement& row) {
  std::normal_distribution<double> normal(0, 1);
  const auto vector = [&](double sigma) {
    const double x = sigma * normal(random);
    const double y = sigma * normal(random);
    return Eigen::Vector3d(x, y, sigma * normal(random));
  };
  for (std::size_t r = 0; r < robot.reflectors_m.size() && kind == MeasurementKind::reflectors; ++r) {
    row.reflector_m[r] =
        pose.rotation * robot.reflectors_m[r] + pose.position + vector(level.position_sigma_m);
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
Measurement random_place(std::size_t k, const Robot& robot, const Simulation& simulation,
                         std::mt19937_64& random) {
  Measurement row;
  row.context = default_context<double>(robot.nominal);
  for (std::size_t j = 0; j < joint_count; ++j) {
    const JointLimits& limits = robot.nominal.limits[j];
    row.q_rad[j] =
        rounded_angle(std::uniform_real_distribution<double>(limits.min_rad, limits.max_rad)(random));
  }
  const std::vector<double>& payloads = simulation.payloads_kg;
  if (!payloads.empty()) row.context.payload_kg = payloads[k % payloads.size()];
  if (simulation.context) random_context(k, robot, random, row);
  return row;
}

}  // namespace

MeasuredData simulate(const Robot& robot, const Calibration& truth, const Simulation& simulation,
                      const std::optional<MeasuredData>& joints) {
  MeasuredData data;
  if (joints) {
    data = *joints;
    // What may have been measured there is not what is measured here.
    data.extra.clear();
    for (Measurement& row : data.rows) row.extra.clear();
  } else {
    data.columns.payload_mass = !simulation.payloads_kg.empty();
    data.columns.move.fill(simulation.context);
    data.columns.temperature = data.columns.time = simulation.context;
    data.rows.resize(simulation.poses);
  }
  data.kind = simulation.kind;
  data.reflectors = data.kind == MeasurementKind::reflectors ? robot.reflectors_m.size() : 0;
  if (data.kind == MeasurementKind::reflectors && data.reflectors == 0) {
    throw InputError(robot.path, 0, "tool.reflectors_mm", "reflectors a, b, c (, d)", "nothing",
                     ErrorCode::no_reflectors);
  }
  const bool noisy = simulation.noise.position_sigma_m > 0;
  data.columns.position_sigma = noisy;
  data.columns.orientation_sigma = noisy && data.kind == MeasurementKind::pose;
  const auto model = prepare(truth.terms, robot, truth.path);
  std::mt19937_64 random(simulation.seed);
  for (std::size_t k = 0; k < data.rows.size(); ++k) {
    Measurement& row = data.rows[k];
    if (!joints) row = random_place(k, robot, simulation, random);
    measure(robot, data.kind, simulation.noise, measured_pose(*model, truth, row.q_rad, row.context), random,
            row);
  }
  return data;
}

}  // namespace flexcomp::host
