#include "report/web_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "report/shown_poses.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

// Whole numbers of these are short, and finer than anything that can be drawn.
constexpr double joint_unit_rad = radians(1e-3);
constexpr double error_unit_m = 1e-8;
constexpr double angle_unit_rad = radians(1e-6);

using Json = nlohmann::ordered_json;

/// What is drawn needs no more digits than these.
double short_number(double v, int digits = 6) {
  if (!std::isfinite(v) || v == 0) return 0;
  const double power = std::pow(10, digits - 1 - std::floor(std::log10(std::abs(v))));
  return std::round(v * power) / power;
}

Json numbers(const Eigen::Vector3d& v) {
  return {short_number(v[0]), short_number(v[1]), short_number(v[2])};
}

std::int64_t counted(double value, double unit) {
  return std::isfinite(value) ? static_cast<std::int64_t>(std::llround(std::clamp(value / unit, -1e15, 1e15)))
                              : 0;
}

void append(Json& list, const std::array<double, joint_count>& q_rad) {
  for (const double q : q_rad) list.push_back(counted(q, joint_unit_rad));
}

Json joints(const std::vector<std::array<double, joint_count>>& poses) {
  Json list = Json::array();
  for (const auto& q : poses) append(list, q);
  return list;
}

Json bodies(const std::vector<Capsule>& capsules) {
  Json list = Json::array();
  for (const Capsule& c : capsules) {
    list.push_back({{"frame", c.frame},
                    {"from", numbers(c.from_m)},
                    {"to", numbers(c.to_m)},
                    {"radius", short_number(c.radius_m)}});
  }
  return list;
}

Json arm_json(const RobotFile& robot) {
  Json arm{{"name", robot.name}, {"links", Json::array()}, {"capsules", bodies(robot.capsules)}};
  for (const NominalLink& l : robot.nominal.links)
    arm["links"].push_back({l.theta_rad, l.d_m, l.a_m, l.alpha_rad, l.beta_rad});
  arm["tool"] = robot.nominal.tool_xyz_m;
  arm["tool_wxyz"] = robot.nominal.tool_wxyz;
  arm["reflectors"] = Json::array();
  for (const Eigen::Vector3d& p : robot.reflectors_m) arm["reflectors"].push_back(numbers(p));
  return arm;
}

Json set_json(const PagePoses& set, std::size_t limit) {
  const std::vector<std::size_t> rows = shown_poses(set.poses, limit);
  Json j{
      {"title", set.title}, {"before_is", set.before}, {"after_is", set.after}, {"total", set.poses.size()}};
  Json number = Json::array(), line = Json::array(), outlier = Json::array(), q = Json::array(),
       before = Json::array(), after = Json::array(), turned_before = Json::array(),
       turned_after = Json::array();
  bool turned = !rows.empty();
  bool lines = true;
  for (const std::size_t k : rows) {
    turned = turned && set.poses[k].before_rad && set.poses[k].after_rad;
    lines = lines && set.poses[k].line > 0;
  }
  for (const std::size_t k : rows) {
    const PagePose& p = set.poses[k];
    number.push_back(k + 1);
    if (p.outlier) outlier.push_back(number.size() - 1);
    append(q, p.q_rad);
    for (const double e : p.before_m) before.push_back(counted(e, error_unit_m));
    for (const double e : p.after_m) after.push_back(counted(e, error_unit_m));
    if (!turned) continue;
    turned_before.push_back(counted(*p.before_rad, angle_unit_rad));
    turned_after.push_back(counted(*p.after_rad, angle_unit_rad));
  }
  // 1, 2, 3 … need not be said.
  if (rows.size() < set.poses.size()) j["number"] = number;
  // A file without gaps is its first line and a count.
  bool gapless = lines;
  for (const std::size_t k : rows)
    gapless = gapless && set.poses[k].line == set.poses[rows[0]].line + k - rows[0];
  if (gapless && !rows.empty()) {
    j["first_line"] = set.poses[rows[0]].line - rows[0];
  } else if (lines) {
    for (const std::size_t k : rows) line.push_back(set.poses[k].line);
    j["line"] = line;
  }
  j["outlier"] = outlier;
  j["q"] = q;
  j["before"] = before;
  j["after"] = after;
  j["turned_before"] = turned_before;
  j["turned_after"] = turned_after;
  if (set.noise_floor_m) j["floor_mm"] = short_number(*set.noise_floor_m * 1e3);
  j["covariates"] = Json::array();
  for (const PageCovariate& c : set.covariates) {
    // To the thousandth part of the largest: a time of the day keeps its seconds, a share its thousandths.
    double largest = 0;
    for (const double v : c.values) largest = std::max(largest, std::abs(v));
    const double unit = largest > 0 ? std::pow(10, std::floor(std::log10(largest)) - 3) : 1;
    Json values = Json::array();
    for (const std::size_t k : rows) {
      const double v = k < c.values.size() ? std::round(c.values[k] / unit) * unit : 0;
      // A whole number where it is one: shorter.
      if (v == std::round(v) && std::abs(v) < 1e9) {
        values.push_back(static_cast<std::int64_t>(v));
      } else {
        values.push_back(short_number(v, 5));
      }
    }
    j["covariates"].push_back({{"name", c.name}, {"values", values}});
  }
  if (set.frames) {
    const Eigen::Matrix3d turn = set.frames->f.orientation.toRotationMatrix().transpose();
    j["turn"] = {numbers(turn.row(0)), numbers(turn.row(1)), numbers(turn.row(2))};
    j["point"] = numbers(set.frames->e.position_m);
  }
  return j;
}

Json plan_json(const PagePlan& plan) {
  Json j{{"q", joints(plan.q_rad)}, {"known", joints(plan.known_q_rad)}, {"payload", plan.payload_kg}};
  if (!plan.cell) return j;
  if (plan.cell->tracker_m) j["tracker"] = numbers(*plan.cell->tracker_m);
  j["obstacles"] = bodies(plan.cell->obstacles);
  return j;
}

}  // namespace

std::string web_data(const Page& page, std::size_t most) {
  Json j{{"joint_unit_deg", degrees(joint_unit_rad)},
         {"error_unit_mm", error_unit_m * 1e3},
         {"angle_unit_deg", degrees(angle_unit_rad)},
         {"sets", Json::array()}};
  if (page.arm) j["arm"] = arm_json(*page.arm);
  std::size_t filled = 0;
  for (const PagePoses& set : page.poses) filled += set.poses.empty() ? 0 : 1;
  // Numbered as on the page: a set without poses takes its place too.
  for (const PagePoses& set : page.poses)
    j["sets"].push_back(set_json(set, most / std::max<std::size_t>(filled, 1)));
  if (page.plan) j["plan"] = plan_json(*page.plan);
  const std::string text = j.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    if (c == '<') {
      safe += "\\u003c";  // no </script> and no <!-- of a name can end the element
    } else {
      safe += c;
    }
  }
  return safe;
}

}  // namespace flexcomp::host
