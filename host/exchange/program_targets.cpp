// SPDX-License-Identifier: Apache-2.0
#include "exchange/program_targets.hpp"

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
#include "units.hpp"

namespace flexcomp::host {

TargetsFile joint_targets(const TargetProgram& program, const Robot& robot, const ProgramTargets& how) {
  TargetsFile list;
  list.path = program.path;
  list.warnings = program.warnings;
  std::optional<std::array<double, joint_count>> before = how.start_rad;
  const Pose<double>& f0 = how.f0;
  for (const ProgramTarget& t : program.targets) {
    Target target;
    target.line = t.line;
    target.context = default_context<double>(robot.nominal);
    target.q_rad = t.q_rad;
    if (t.pose) {
      const Eigen::Matrix3d turned = f0.rotation.transpose();
      const Pose<double> pose{turned * t.orientation.toRotationMatrix(),
                              turned * (t.position_m - f0.position)};
      std::vector<std::array<double, joint_count>> all = nominal_inverses(robot.nominal, pose);
      const std::size_t solutions = all.size();
      std::erase_if(all, [&t](const auto& q) { return !words_fit(t, q); });
      if (all.empty()) {
        throw InputError(
            program.path, t.line, t.name, "a pose that the nominal arm reaches with its tool, in F0",
            solutions == 0
                ? std::string("one that it does not reach")
                : fmt::format("{} ways to reach it, none with the turns that it asks for", solutions),
            ErrorCode::unreachable_pose);
      }
      // Only where several remain: there are programs whose cfx was never looked at.
      if (all.size() > 1 && t.cfx) {
        std::vector<std::array<double, joint_count>> as_said;
        std::copy_if(all.begin(), all.end(), std::back_inserter(as_said), [&](const auto& q) {
          const auto sides = arm_sides(robot.nominal, q);
          return sides && fits_cfx(*sides, *t.cfx);
        });
        if (!as_said.empty()) {
          all = std::move(as_said);
        } else {
          list.warnings.push_back(
              fmt::format("{}:{}: {}{}cfx {} fits none of {} ways to reach the pose: the nearest is taken.",
                          program.path, t.line, t.name, t.name.empty() ? "" : ": ", *t.cfx, all.size()));
        }
      }
      if (all.size() > 1 && !before) {
        throw InputError(program.path, t.line, t.name,
                         "the joints at the beginning, of which the nearest way is taken",
                         fmt::format("{} ways to reach the pose", all.size()), ErrorCode::several_branches);
      }
      const auto away = [&before](const auto& q) {
        double most = 0;
        for (std::size_t j = 0; before && j < joint_count; ++j)
          most = std::max(most, std::abs(q[j] - (*before)[j]));
        return most;
      };
      target.q_rad = *std::min_element(all.begin(), all.end(),
                                       [&](const auto& a, const auto& b) { return away(a) < away(b); });
    }
    before = target.q_rad;
    list.rows.push_back(std::move(target));
    if (how.progress) how.progress(list.rows.size(), program.targets.size());
  }
  return list;
}

std::string corrected_text(const TargetProgram& program, const Robot& robot, const Pose<double>& f0,
                           const std::vector<Answer>& answers) {
  Model<double, joint_count, Capacity<1, 1, 6>> nominal;
  nominal.begin(robot.nominal);
  nominal.finish();
  std::vector<ProgramTarget> corrected = program.targets;
  for (std::size_t k = 0; k < corrected.size(); ++k) {
    ProgramTarget& t = corrected[k];
    t.q_rad = answers[k].q_rad;
    if (!t.pose) continue;
    const Pose<double> pose = f0 * nominal_forward(nominal, t.q_rad);
    t.position_m = pose.position;
    t.orientation = unit_quaternion(pose.rotation);
    if (t.turn) t.turn = turn_of(t.q_rad, *t.turn);
    if (t.quadrant) t.quadrant = quadrants_of(t.q_rad, *t.quadrant);
  }
  return program_text(program, corrected);
}

}  // namespace flexcomp::host
