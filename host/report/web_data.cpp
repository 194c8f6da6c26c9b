// SPDX-License-Identifier: Apache-2.0
#include "report/web_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "report/plots.hpp"
#include "report/shown_poses.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

// Whole numbers of these are short, and finer than anything that can be drawn.
constexpr double joint_unit_rad = radians(1e-3);
constexpr double error_unit_mm = 1e-5;
constexpr double angle_unit_deg = 1e-6;

using Json = nlohmann::ordered_json;

/// What is drawn needs no more digits than these.
double short_number(double v) {
  constexpr int digits = 6;
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

/// The unit above, or a finer one where even the largest number is small in it.
double unit_for(const std::vector<double>& values, double usual) {
  double largest = 0;
  for (const double v : values) {
    if (std::isfinite(v)) largest = std::max(largest, std::abs(v));
  }
  return largest > 0 ? std::min(usual, std::pow(10, std::floor(std::log10(largest)) - 4)) : usual;
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

Json arm_json(const Robot& robot) {
  Json arm{{"name", robot.name}, {"links", Json::array()}, {"capsules", bodies(robot.capsules)}};
  for (const NominalLink& l : robot.nominal.links)
    arm["links"].push_back({l.theta_rad, l.d_m, l.a_m, l.alpha_rad, l.beta_rad});
  arm["tool"] = robot.nominal.tool_xyz_m;
  arm["tool_wxyz"] = robot.nominal.tool_wxyz;
  arm["reflectors"] = Json::array();
  for (const Eigen::Vector3d& p : robot.reflectors_m) arm["reflectors"].push_back(numbers(p));
  return arm;
}

/// 1, 2 or 5 times a power of ten.
double round_number(double v, bool up) {
  const double power = std::pow(10, std::floor(std::log10(v) + 1e-9));
  double below = power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (up && factor * power >= v * (1 - 1e-9)) return factor * power;
    if (factor * power <= v * (1 + 1e-9)) below = factor * power;
  }
  return up ? 10 * power : below;
}

/// How many of all poses, drawn or not, lie in each class; null where there is nothing to see on a logarithmic axis.
/// \param lists  what is drawn, the smaller errors last: they set where a logarithmic axis begins
Json histogram(const std::vector<const std::vector<double>*>& lists, bool log) {
  double low = HUGE_VAL, high = -HUGE_VAL, sum = 0;
  std::size_t count = 0;
  for (const auto* list : lists) {
    sum = 0;
    count = 0;
    for (const double v : *list) {
      if (!std::isfinite(v)) continue;
      sum += v;
      ++count;
      if (log && !(v > 0)) continue;
      low = std::min(low, v);
      high = std::max(high, v);
    }
  }
  if (!(high >= low)) {
    if (log) return nullptr;
    low = high = 0;
  }
  if (log) {
    // With round ends, as the axis has them. One lucky pose near zero must not press all the others together.
    low = round_number(std::max(low, sum / static_cast<double>(std::max<std::size_t>(count, 1)) / 30), false);
    high = round_number(high, true);
    if (!(high > low)) high = 10 * low;
  } else {
    low = std::min(low, 0.0);
    if (!(high > low)) high = low + 1;
  }
  const auto classes = static_cast<std::size_t>(
      std::clamp(std::round(2 * std::cbrt(static_cast<double>(lists.front()->size())) + 8), 12.0, 40.0));
  Json j{{"log", log}, {"low", low}, {"high", high}, {"counts", Json::array()}};
  for (const auto* list : lists) {
    std::vector<std::size_t> counts(classes);
    for (const double v : *list) {
      const double share =
          log ? std::log(std::max(v, low) / low) / std::log(high / low) : (v - low) / (high - low);
      const double at = std::isfinite(share) ? std::clamp(std::floor(share * static_cast<double>(classes)),
                                                          0.0, static_cast<double>(classes - 1))
                                             : 0;
      ++counts[static_cast<std::size_t>(at)];
    }
    j["counts"].push_back(counts);
  }
  return j;
}

/// Of one quantity: before and after together and each alone, on either axis.
Json histograms(const std::vector<double>& before, const std::vector<double>& after, bool is_signed) {
  Json j{{"starts_log", !is_signed && is_logarithmic({before, after, "", std::nullopt})}};
  for (const bool log : {false, true}) {
    if (log && is_signed) continue;
    const std::string axis = log ? "_log" : "";
    j["both" + axis] = histogram({&before, &after}, log);
    j["before" + axis] = histogram({&before}, log);
    j["after" + axis] = histogram({&after}, log);
  }
  return j;
}

/// To the thousandth part of the range: a time keeps its seconds, a share its thousandths, wherever they begin.
Json covariate_json(const PageCovariate& c, const std::vector<std::size_t>& rows) {
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const double v : c.values) {
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  const double range = high > low ? high - low : std::max(std::abs(high), 1e-300);
  const int exponent = std::isfinite(range) ? static_cast<int>(std::floor(std::log10(range))) - 3 : 0;
  const double power = std::pow(10, std::abs(exponent));
  Json values = Json::array();
  for (const std::size_t k : rows) {
    double v = k < c.values.size() && std::isfinite(c.values[k]) ? c.values[k] : 0;
    // By a whole number, so that what is written is short.
    v = exponent < 0 ? std::round(v * power) / power : std::round(v / power) * power;
    if (v == std::round(v) && std::abs(v) < 1e15) {
      values.push_back(static_cast<std::int64_t>(v));
    } else {
      values.push_back(v);
    }
  }
  return {{"name", c.name}, {"values", values}};
}

Json set_json(const PagePoses& set, std::size_t limit) {
  const std::vector<std::size_t> rows = shown_poses(set.poses, limit);
  Json j{
      {"title", set.title}, {"before_is", set.before}, {"after_is", set.after}, {"total", set.poses.size()}};
  bool turned = !set.poses.empty();
  bool lines = true;
  std::array<std::vector<double>, 3> components_before, components_after;
  std::vector<double> size_before, size_after, angle_before, angle_after;
  for (const PagePose& p : set.poses) {
    turned = turned && p.before_rad && p.after_rad;
    lines = lines && p.line > 0;
    for (std::size_t i = 0; i < 3; ++i) {
      components_before[i].push_back(p.before_m[i] * 1e3);
      components_after[i].push_back(p.after_m[i] * 1e3);
    }
    size_before.push_back(std::hypot(p.before_m[0], p.before_m[1], p.before_m[2]) * 1e3);
    size_after.push_back(std::hypot(p.after_m[0], p.after_m[1], p.after_m[2]) * 1e3);
  }
  for (const PagePose& p : set.poses) {
    if (!turned) break;
    angle_before.push_back(degrees(*p.before_rad));
    angle_after.push_back(degrees(*p.after_rad));
  }
  Json number = Json::array(), line = Json::array(), outlier = Json::array(), q = Json::array(),
       before = Json::array(), after = Json::array(), turned_before = Json::array(),
       turned_after = Json::array();
  const double before_mm = unit_for(size_before, error_unit_mm),
               after_mm = unit_for(size_after, error_unit_mm);
  const double before_deg = unit_for(angle_before, angle_unit_deg),
               after_deg = unit_for(angle_after, angle_unit_deg);
  for (const std::size_t k : rows) {
    const PagePose& p = set.poses[k];
    number.push_back(k + 1);
    if (p.outlier) outlier.push_back(number.size() - 1);
    append(q, p.q_rad);
    for (std::size_t i = 0; i < 3; ++i) {
      before.push_back(counted(components_before[i][k], before_mm));
      after.push_back(counted(components_after[i][k], after_mm));
    }
    if (!turned) continue;
    turned_before.push_back(counted(angle_before[k], before_deg));
    turned_after.push_back(counted(angle_after[k], after_deg));
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
  j["before_unit_mm"] = before_mm;
  j["after_unit_mm"] = after_mm;
  j["before_unit_deg"] = before_deg;
  j["after_unit_deg"] = after_deg;
  if (set.noise_floor_m) j["floor_mm"] = short_number(*set.noise_floor_m * 1e3);
  if (!set.poses.empty()) {
    j["histograms"]["size"] = histograms(size_before, size_after, false);
    for (std::size_t i = 0; i < 3; ++i)
      j["histograms"][std::string(1, "xyz"[i])] = histograms(components_before[i], components_after[i], true);
    if (turned) j["histograms"]["turned"] = histograms(angle_before, angle_after, false);
  }
  j["covariates"] = Json::array();
  for (const PageCovariate& c : set.covariates) j["covariates"].push_back(covariate_json(c, rows));
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
  Json j{{"joint_unit_deg", degrees(joint_unit_rad)}, {"sets", Json::array()}};
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
