// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "report/plot_frame.hpp"
#include "report/plots.hpp"
#include "report/pose_errors.hpp"

namespace flexcomp::host {
namespace {

constexpr std::size_t most_points_with_dots = 60;

/// Smallest and largest of the numbers seen.
struct Range {
  double low = HUGE_VAL, high = -HUGE_VAL;
  void add(double v) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
};

Axis x_axis(const Curves& c, Range x) {
  if (!c.x_texts.empty()) {
    x.add(0.0);
    x.high = std::max(x.high, static_cast<double>(c.x_texts.size() - 1));
  }
  if (c.x_from_zero) x.low = std::min(x.low, 0.0);
  const double margin = std::max(1e-9, c.x_texts.empty() ? 0.02 * (x.high - x.low) : 0.5);
  Axis axis{{c.x_from_zero ? x.low : x.low - margin, x.high + margin, false}, c.x_name, 6};
  for (std::size_t k = 0; k < c.x_texts.size(); ++k)
    axis.named.push_back({static_cast<double>(k), c.x_texts[k]});
  return axis;
}

bool is_joined(const Curves& all, const Curve& curve) {
  return curve.style == CurveStyle::usual ? all.x_texts.empty() : curve.style != CurveStyle::dots;
}

void draw_curve(PlotFrame& frame, const Curves& all, const Curve& curve, const std::string& kind) {
  const bool only_dots = curve.style == CurveStyle::dots;
  const std::size_t count = curve.points.size();
  std::string line, dots, upper, lower;
  for (const std::size_t n : evenly_spaced(count, only_dots ? Detail().dots : count)) {
    const auto& [x, y] = curve.points[n];
    if (all.log_y && !(y > 0)) continue;
    const double at_x = frame.px(x), at_y = frame.py(y);
    line += line.empty()                       ? fmt::format("M{:.1f} {:.1f}", at_x, at_y)
            : curve.style == CurveStyle::steps ? fmt::format("H{:.1f}V{:.1f}", at_x, at_y)
                                               : fmt::format("L{:.1f} {:.1f}", at_x, at_y);
    dots += dot(at_x, at_y);
    if (n >= curve.band.size()) continue;
    const auto& [low, high] = curve.band[n];
    upper += fmt::format("{}{:.1f} {:.1f}", upper.empty() ? "M" : "L", at_x, frame.py(high));
    lower.insert(0, fmt::format("L{:.1f} {:.1f}", at_x, frame.py(low)));
  }
  if (!upper.empty()) frame.add_path(upper + lower + "Z", "bars " + kind);
  if (is_joined(all, curve)) frame.add_path(line, "line " + kind);
  const bool with_dots = curve.style == CurveStyle::usual || curve.style == CurveStyle::joined;
  if (only_dots || (with_dots && count <= most_points_with_dots)) frame.add_path(dots, dots_of(count, kind));
}

}  // namespace

std::string plot_curves(const Curves& c) {
  Range x, y;
  const auto is_drawn = [&](double v) { return !c.log_y || v > 0; };
  for (const Curve& curve : c.curves) {
    for (const auto& [at, value] : curve.points) {
      if (!is_drawn(value)) continue;
      x.add(at);
      y.add(value);
    }
    for (const auto& ends : curve.band) {
      for (const double end : ends)
        if (is_drawn(end)) y.add(end);
    }
  }
  if (!(y.high >= y.low)) return "";
  if (c.floor && is_drawn(*c.floor)) y.add(*c.floor);
  const std::size_t drawn = std::min(c.curves.size(), Curves::most);
  std::vector<LegendItem> legend;
  for (std::size_t k = 0; k < drawn; ++k) {
    const Curve& curve = c.curves[k];
    legend.push_back(
        {curve.name, curve.colour.empty() ? fmt::format("c{}", k + 1) : curve.colour, is_joined(c, curve)});
  }
  PlotFrame frame(c.described, x_axis(c, x), {round_limits(y.low, y.high, c.log_y), c.y_name},
                  c.curves.size() > 1 ? legend : std::vector<LegendItem>());
  for (std::size_t k = 0; k < drawn; ++k) draw_curve(frame, c, c.curves[k], legend[k].kind);
  if (c.floor) frame.add_noise_floor(*c.floor);
  return frame.svg();
}

std::string plot_bars(const Bars& bars) {
  double most = 0;
  for (const auto* list : {&bars.before, &bars.after})
    for (const double v : *list) most = std::max(most, v);
  if (!(most > 0)) return "";
  const auto count = static_cast<double>(std::max<std::size_t>(bars.names.size(), 1));
  Axis y{{0, count, false}, ""};
  for (std::size_t k = 0; k < bars.names.size(); ++k)
    y.named.push_back({count - static_cast<double>(k) - 0.5, bars.names[k]});
  PlotFrame frame(bars.described, {from_zero(most, 5), bars.x_name}, y);
  const auto draw = [&](const std::vector<double>& values, double from, double to, const char* kind) {
    std::string d;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const double top = count - static_cast<double>(k);
      d += fmt::format("M{:.1f} {:.1f}H{:.1f}V{:.1f}H{:.1f}Z", frame.px(0), frame.py(top - from),
                       frame.px(std::max(values[k], 0.0)), frame.py(top - to), frame.px(0));
    }
    frame.add_path(d, kind);
  };
  draw(bars.before, 0.12, bars.after.empty() ? 0.88 : 0.5, "bars before");
  draw(bars.after, 0.5, 0.88, "bars after");
  return frame.svg();
}

std::string plot_coverage(const PagePlan& plan) {
  Axis y{{0.4, static_cast<double>(joint_count) + 0.6, false}, "joint"};
  for (std::size_t j = 0; j < joint_count; ++j)
    y.named.push_back({static_cast<double>(joint_count - j), fmt::format("q{}", j + 1)});
  PlotFrame frame("Where the poses lie between the limits of each joint",
                  {{0, 100, false}, "% of the way from the lower to the upper limit"}, y);
  const auto draw = [&](const std::vector<std::array<double, joint_count>>& poses, double shift,
                        const char* kind) {
    std::string d;
    for (const auto& q : poses) {
      for (std::size_t j = 0; j < joint_count; ++j) {
        const auto& [lower, upper] = plan.limits_rad[j];
        d += dot(frame.at_share_x(std::clamp((q[j] - lower) / (upper - lower), 0.0, 1.0)),
                 frame.py(static_cast<double>(joint_count - j) + shift));
      }
    }
    frame.add_path(d, dots_of(poses.size(), kind));
  };
  draw(plan.known_q_rad, 0.2, "before");
  draw(plan.q_rad, 0, "after");
  return frame.svg();
}

}  // namespace flexcomp::host
