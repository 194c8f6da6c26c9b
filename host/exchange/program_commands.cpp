// SPDX-License-Identifier: Apache-2.0
#include "exchange/program_commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "exchange/arm_sides.hpp"
#include "flexcomp/forward.hpp"
#include "flexcomp/model.hpp"
#include "input_error.hpp"
#include "kinematics/nominal_inverse.hpp"
#include "quaternion.hpp"

namespace flexcomp::host {

namespace {

using Joints = std::array<double, joint_count>;

/// All joint commands that reach the pose of a target as its words say.
/// \throws InputError  there are none
std::vector<Joints> solutions(const TargetProgram& program, const ProgramTarget& t, const Robot& robot,
                              const Pose<double>& pose, std::vector<std::string>& warnings) {
  std::vector<Joints> all = nominal_inverses(robot.nominal, pose);
  const std::size_t reaching = all.size();
  std::erase_if(all, [&t](const Joints& q) { return !words_fit(t, q); });
  if (all.empty()) {
    throw InputError(program.path, t.line, t.name, "a pose that the nominal arm reaches with its tool, in F0",
                     reaching == 0
                         ? std::string("one that it does not reach")
                         : fmt::format("{} ways to reach it, none with the turns that it asks for", reaching),
                     ErrorCode::unreachable_pose);
  }
  // Only where several remain: there are programs whose cfx was never looked at.
  if (all.size() == 1 || !t.cfx) return all;
  std::vector<Joints> with_cfx;
  std::copy_if(all.begin(), all.end(), std::back_inserter(with_cfx), [&](const Joints& q) {
    const auto sides = arm_sides(robot.nominal, q);
    return sides && fits_cfx(*sides, *t.cfx);
  });
  if (!with_cfx.empty()) return with_cfx;
  warnings.push_back(
      fmt::format("{}:{}: {}{}cfx {} fits none of {} ways to reach the pose: the nearest is taken.",
                  program.path, t.line, t.name, t.name.empty() ? "" : ": ", *t.cfx, all.size()));
  return all;
}

double largest_difference(const Joints& a, const Joints& b) {
  double most = 0;
  for (std::size_t j = 0; j < joint_count; ++j) most = std::max(most, std::abs(a[j] - b[j]));
  return most;
}

}  // namespace

TargetsFile program_commands(const TargetProgram& program, const Robot& robot, const Pose<double>& frame,
                             const std::optional<Joints>& start,
                             const std::function<void(std::size_t, std::size_t)>& progress) {
  TargetsFile list;
  list.path = program.path;
  list.warnings = program.warnings;
  std::optional<Joints> before = start;
  const Eigen::Matrix3d to_f0 = frame.rotation.transpose();
  for (const ProgramTarget& t : program.targets) {
    Target target;
    target.line = t.line;
    target.context = default_context<double>(robot.nominal);
    target.q_rad = t.q_rad;
    if (t.pose) {
      const Pose<double> pose{to_f0 * t.orientation.toRotationMatrix(),
                              to_f0 * (t.position_m - frame.position)};
      const std::vector<Joints> all = solutions(program, t, robot, pose, list.warnings);
      if (all.size() > 1 && !before) {
        throw InputError(program.path, t.line, t.name,
                         "the joints at the beginning, of which the nearest way is taken",
                         fmt::format("{} ways to reach the pose", all.size()), ErrorCode::several_branches);
      }
      const Joints from = before.value_or(all.front());
      target.q_rad = *std::min_element(all.begin(), all.end(), [&from](const Joints& a, const Joints& b) {
        return largest_difference(a, from) < largest_difference(b, from);
      });
    }
    before = target.q_rad;
    list.rows.push_back(std::move(target));
    progress(list.rows.size(), program.targets.size());
  }
  return list;
}

std::string with_commands(const TargetProgram& program, const Robot& robot, const Pose<double>& frame,
                          const std::vector<Joints>& q_rad) {
  Model<double, joint_count, Capacity<1, 1, 6>> nominal;
  nominal.begin(robot.nominal);
  nominal.finish();
  std::vector<ProgramTarget> corrected = program.targets;
  for (std::size_t k = 0; k < corrected.size(); ++k) {
    ProgramTarget& t = corrected[k];
    t.q_rad = q_rad[k];
    if (!t.pose) continue;
    const Pose<double> pose = frame * nominal_forward(nominal, t.q_rad);
    t.position_m = pose.position;
    t.orientation = unit_quaternion(pose.rotation);
    if (t.turn) t.turn = turn_of(t.q_rad, *t.turn);
    if (t.quadrant) t.quadrant = quadrants_of(t.q_rad, *t.quadrant);
  }
  return program_text(program, corrected);
}

}  // namespace flexcomp::host
