// SPDX-License-Identifier: Apache-2.0
#include "report/web_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <string>
#include <vector>

#include "json.hpp"
#include "report/axis.hpp"
#include "report/plots.hpp"
#include "report/pose_errors.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

// Whole numbers of these are short, and finer than anything that can be drawn.
constexpr double joint_unit_rad = radians(1e-3);
constexpr double error_unit_mm = 1e-5;
constexpr double angle_unit_deg = 1e-6;

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
  return json_list(capsules, [](const Capsule& c) -> Json {
    return {{"frame", c.frame},
            {"from", numbers(c.from_m)},
            {"to", numbers(c.to_m)},
            {"radius", short_number(c.radius_m)}};
  });
}

Json arm_json(const Robot& robot) {
  Json arm{{"name", robot.name}, {"links", Json::array()}, {"capsules", bodies(robot.capsules)}};
  for (const NominalLink& l : robot.nominal.links)
    arm["links"].push_back({l.theta_rad, l.d_m, l.a_m, l.alpha_rad, l.beta_rad});
  arm["tool"] = robot.nominal.tool_xyz_m;
  arm["tool_wxyz"] = robot.nominal.tool_wxyz;
  arm["reflectors"] = json_list(robot.reflectors_m, numbers);
  return arm;
}

/// How many of all poses, drawn or not, lie in each bin; null where there is nothing to see on a logarithmic axis.
/// \param lists  what is drawn, the smaller errors last: they set where a logarithmic axis begins
Json histogram_json(const std::vector<const std::vector<double>*>& lists, bool log) {
  Scale scale{HUGE_VAL, -HUGE_VAL, log};
  for (const auto* list : lists) {
    for (const double v : *list) {
      if (!std::isfinite(v) || (log && !(v > 0))) continue;
      scale.low = std::min(scale.low, v);
      scale.high = std::max(scale.high, v);
    }
  }
  if (!(scale.high >= scale.low)) {
    if (log) return nullptr;
    scale.low = scale.high = 0;
  }
  if (log) {
    std::vector<double> finite;
    std::copy_if(lists.back()->begin(), lists.back()->end(), std::back_inserter(finite),
                 [](double v) { return std::isfinite(v); });
    scale = log_error_scale(scale.low, scale.high, statistics_of(finite).mean);
  } else {
    scale.low = std::min(scale.low, 0.0);
    if (!(scale.high > scale.low)) scale.high = scale.low + 1;
  }
  const auto counts = [&](const auto* list) { return histogram(*list, scale, bin_count(list->size())); };
  return {{"log", log}, {"low", scale.low}, {"high", scale.high}, {"counts", json_list(lists, counts)}};
}

/// Of one quantity: before and after together and each alone, on either axis.
Json histograms(const ErrorPairs& errors, bool is_signed) {
  const auto &before = errors.before, &after = errors.after;
  Json j{{"starts_log", !is_signed && is_logarithmic({before, after, "", std::nullopt})}};
  for (const bool log : {false, true}) {
    if (log && is_signed) continue;
    const std::string axis = log ? "_log" : "";
    j["both" + axis] = histogram_json({&before, &after}, log);
    j["before" + axis] = histogram_json({&before}, log);
    j["after" + axis] = histogram_json({&after}, log);
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

Json counted(const std::vector<double>& values, const std::vector<std::size_t>& rows, double unit) {
  return json_list(rows, [&](std::size_t k) { return counted(values[k], unit); });
}

/// Which poses of the data these are: their numbers where some are left out, their lines where they are known.
void add_places(Json& j, const std::vector<PagePose>& poses, const std::vector<std::size_t>& rows) {
  Json number = Json::array(), line = Json::array(), outlier = Json::array();
  bool gapless = true;
  for (const std::size_t k : rows) {
    if (poses[k].outlier) outlier.push_back(number.size());
    number.push_back(k + 1);
    line.push_back(poses[k].line);
    gapless = gapless && poses[k].line == poses[rows[0]].line + k - rows[0];
  }
  if (rows.size() < poses.size()) j["number"] = number;
  // A file without gaps is its first line and a count.
  const bool lines = std::ranges::all_of(poses, [](const PagePose& p) { return p.line > 0; });
  if (lines && gapless && !rows.empty()) {
    j["first_line"] = poses[rows[0]].line - rows[0];
  } else if (lines) {
    j["line"] = line;
  }
  j["outlier"] = outlier;
}

/// Errors of the rows as whole numbers of their units.
void add_errors(Json& j, const std::array<ErrorPairs, 3>& component, const ErrorPairs& size,
                const ErrorPairs& angle, const std::vector<std::size_t>& rows) {
  const double before_mm = unit_for(size.before, error_unit_mm),
               after_mm = unit_for(size.after, error_unit_mm);
  Json before = Json::array(), after = Json::array();
  for (const std::size_t k : rows) {
    for (const ErrorPairs& e : component) {
      before.push_back(counted(e.before[k], before_mm));
      after.push_back(counted(e.after[k], after_mm));
    }
  }
  j["before"] = before;
  j["after"] = after;
  const double before_deg = unit_for(angle.before, angle_unit_deg),
               after_deg = unit_for(angle.after, angle_unit_deg);
  const std::vector<std::size_t> turned = angle.before.empty() ? std::vector<std::size_t>() : rows;
  j["turned_before"] = counted(angle.before, turned, before_deg);
  j["turned_after"] = counted(angle.after, turned, after_deg);
  j["before_unit_mm"] = before_mm;
  j["after_unit_mm"] = after_mm;
  j["before_unit_deg"] = before_deg;
  j["after_unit_deg"] = after_deg;
}

Json set_json(const PagePoses& set, std::size_t limit) {
  const std::vector<std::size_t> rows = shown_poses(set.poses, limit);
  const ErrorPairs size = position_errors(set), angle = orientation_errors(set);
  const std::array<ErrorPairs, 3> component{component_errors(set, 0), component_errors(set, 1),
                                            component_errors(set, 2)};
  Json j{
      {"title", set.title}, {"before_is", set.before}, {"after_is", set.after}, {"total", set.poses.size()}};
  add_places(j, set.poses, rows);
  j["q"] = Json::array();
  for (const std::size_t k : rows) append(j["q"], set.poses[k].q_rad);
  add_errors(j, component, size, angle, rows);
  if (set.noise_floor_m) j["floor_mm"] = short_number(*set.noise_floor_m * 1e3);
  if (!set.poses.empty()) {
    j["histograms"]["size"] = histograms(size, false);
    for (std::size_t i = 0; i < 3; ++i)
      j["histograms"][std::string(1, "xyz"[i])] = histograms(component[i], true);
    if (!angle.before.empty()) j["histograms"]["turned"] = histograms(angle, false);
  }
  j["covariates"] =
      json_list(set.covariates, [&](const PageCovariate& c) { return covariate_json(c, rows); });
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
