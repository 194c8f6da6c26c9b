// SPDX-License-Identifier: Apache-2.0
#include "model/set_difference.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <random>

#include "flexcomp/forward.hpp"
#include "model/effects.hpp"
#include "model/host_model.hpp"

namespace flexcomp::host {

std::vector<RandomPlace> random_places(const Robot& robot, std::size_t count) {
  std::mt19937_64 random(1);
  std::vector<RandomPlace> out(count);
  for (RandomPlace& p : out) {
    p.context = default_context<double>(robot.nominal);
    for (std::size_t j = 0; j < joint_count; ++j) {
      const JointLimits& l = robot.nominal.limits[j];
      p.q_rad[j] = std::uniform_real_distribution<double>(l.min_rad, l.max_rad)(random);
      p.context.direction[j] = random() % 2 == 0 ? 1 : -1;
    }
  }
  return out;
}

std::vector<Pose<double>> poses_of(const TermSet& set, const Robot& robot, const std::vector<RandomPlace>& at,
                                   const std::string& source) {
  const auto model = prepare(set, robot, source);
  Workspace<double, joint_count> workspace;
  std::vector<Pose<double>> out;
  out.reserve(at.size());
  for (const RandomPlace& p : at) out.push_back(forward(*model, p.q_rad, p.context, workspace));
  return out;
}

ToolShift tool_shift(const std::vector<Pose<double>>& from, const std::vector<Pose<double>>& to) {
  ToolShift out;
  for (std::size_t k = 0; k < from.size(); ++k) {
    const double moved = (to[k].position - from[k].position).norm();
    out.largest_m = std::max(out.largest_m, moved);
    out.mean_m += moved / static_cast<double>(from.size());
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(from[k].rotation.transpose() * to[k].rotation));
    out.largest_rad = std::max(out.largest_rad, turn.angle());
  }
  return out;
}

SetDifference difference(const TermSet& before, const TermSet& after, const Robot& robot, std::size_t poses) {
  const std::vector<RandomPlace> at = random_places(robot, poses);
  const std::vector<Pose<double>> from = poses_of(before, robot, at);
  const std::vector<Pose<double>> to = poses_of(after, robot, at);
  SetDifference out;
  out.poses = poses;
  out.at_tool = tool_shift(from, to);
  std::map<std::string, Parameter> old;
  for (const Parameter& p : parameters_of(before, robot.nominal)) old.emplace(p.name, p);
  for (const Parameter& p : parameters_of(after, robot.nominal)) {
    ParameterChange change{p.name, p.unit, 0, p.get(after), {}};
    if (const auto there = old.find(p.name); there != old.end()) {
      change.before = there->second.get(before);
      old.erase(there);
    }
    if (change.before == change.after) {
      ++out.unchanged;
      continue;
    }
    TermSet without = after;
    p.set(without, change.before);
    change.at_tool = tool_shift(poses_of(without, robot, at), to);
    out.changes.push_back(std::move(change));
  }
  for (const Parameter& p : parameters_of(before, robot.nominal)) {
    if (old.count(p.name) == 0) continue;
    const double value = p.get(before);
    if (value == 0) {
      ++out.unchanged;
      continue;
    }
    TermSet without = before;
    p.set(without, 0);
    out.changes.push_back({p.name, p.unit, value, 0, tool_shift(from, poses_of(without, robot, at))});
  }
  return out;
}

Json to_json(const SetDifference& d) {
  Json result;
  result["unchanged"] = d.unchanged;
  result["tool"] = {{"mean_mm", d.at_tool.mean_m * 1e3},
                    {"largest_mm", d.at_tool.largest_m * 1e3},
                    {"largest_deg", degrees(d.at_tool.largest_rad)},
                    {"poses", d.poses}};
  result["parameters"] = Json::array();
  for (const ParameterChange& c : d.changes) {
    result["parameters"].push_back({{"name", c.name},
                                    {"old", c.before / c.unit.si_per_file_unit()},
                                    {"new", c.after / c.unit.si_per_file_unit()},
                                    {"unit", c.unit.name},
                                    {"tool_mm", c.at_tool.largest_m * 1e3},
                                    {"tool_deg", degrees(c.at_tool.largest_rad)}});
  }
  return result;
}

}  // namespace flexcomp::host
