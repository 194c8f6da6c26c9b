// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "report/plot_frame.hpp"
#include "report/plots.hpp"
#include "report/pose_errors.hpp"

namespace flexcomp::host {
namespace {

constexpr std::size_t most_stems = 120, most_precise_dots = 200;

/// Covers all errors and the noise floor with round limits.
Scale scale_of(const ErrorPairs& errors) {
  double low = HUGE_VAL, high = 0;
  for (const auto* set : {&errors.before, &errors.after}) {
    for (const double v : *set) {
      high = std::max(high, v);
      if (v > 0) low = std::min(low, v);
    }
  }
  if (errors.floor) {
    high = std::max(high, *errors.floor);
    low = std::min(low, *errors.floor);
  }
  if (!(high > 0)) return {0, 1, false};
  if (!is_logarithmic(errors)) return from_zero(high, 5);
  return log_error_scale(low, high, errors.after.empty() ? high : statistics_of(errors.after).mean);
}

/// "position error [mm]"
Axis error_axis(const ErrorPairs& errors, int ticks = 5) {
  return {scale_of(errors), fmt::format("{} [{}]", errors.quantity, errors.unit), ticks};
}

std::string distribution_line(const PlotFrame& frame, std::vector<double> values, std::size_t most) {
  std::ranges::sort(values);
  std::string d;
  const auto n = static_cast<double>(values.size());
  double from = 0;
  for (const std::size_t k : evenly_spaced(values.size(), most)) {
    const double to = 100 * static_cast<double>(k + 1) / n;
    d += fmt::format("{}{:.1f} {:.1f}V{:.1f}", d.empty() ? "M" : "L", frame.px(values[k]), frame.py(from),
                     frame.py(to));
    from = to;
  }
  return d;
}

/// Symmetric to 0. The bulk sets the scale; what lies far off is drawn at the edge.
Scale residual_scale(const std::vector<PagePose>& poses) {
  double largest = 0;
  std::vector<double> sizes;
  for (const PagePose& pose : poses) {
    for (const double e : pose.after_m) {
      sizes.push_back(std::abs(e) * 1e3);
      largest = std::max(largest, sizes.back());
    }
  }
  const double reach = std::min(largest, 3 * ninth_decile(std::move(sizes)));
  const double end = from_zero(reach > 0 ? reach : 1e-3, 2).high;
  return {-end, end, false};
}

}  // namespace

std::string plot_in_order(const ErrorPairs& errors, const Detail& detail) {
  const auto n = static_cast<double>(errors.before.size());
  Axis x{{0.5 - 0.02 * n, n + 0.5 + 0.02 * n, false}, "pose"};
  for (int about = 6; about > 0 && x.named.empty(); --about) {
    for (Tick& t : x.scale.ticks(about)) {
      if (t.value >= 1 && t.value <= n && t.value == std::floor(t.value)) x.named.push_back(t);
    }
  }
  PlotFrame frame("Error of each pose in the order of the data, before and after", x, error_axis(errors));
  std::string stems, before, after, apart;
  const std::vector<std::size_t> shown = shown_rows({&errors.after, &errors.before}, detail.dots);
  for (const std::size_t k : shown) {
    const double at = frame.px(static_cast<double>(k + 1));
    const double upper = frame.py(errors.before[k]), lower = frame.py(errors.after[k]);
    if (errors.before.size() <= most_stems) stems += fmt::format("M{:.1f} {:.1f}V{:.1f}", at, upper, lower);
    before += dot(at, upper);
    after += dot(at, lower);
    if (std::ranges::binary_search(errors.outliers, k)) apart += diamond(at, lower);
  }
  frame.add_path(stems, "stem");
  frame.add_path(before, dots_of(shown.size(), "before"));
  frame.add_path(after, dots_of(shown.size(), "after"));
  frame.add_path(apart, "apart");
  if (errors.floor) frame.add_noise_floor(*errors.floor);
  return frame.svg();
}

std::string plot_sorted(const ErrorPairs& errors, const Detail& detail) {
  PlotFrame frame("Share of the poses whose error lies below a value, before and after",
                  error_axis(errors, 6), {{0, 100, false}, "% of the poses below", 4});
  if (errors.floor) {
    const double at = frame.px(*errors.floor);
    const bool has_room = at < frame.at_share_x(0.8);
    frame.add_line(at, frame.at_share_y(0), at, frame.at_share_y(1), "floor");
    frame.add_text(has_room ? at + 3 : at - 3, frame.at_share_y(0.06), has_room ? "start" : "end", "noise");
  }
  frame.add_path(distribution_line(frame, errors.before, detail.steps), "line before");
  frame.add_path(distribution_line(frame, errors.after, detail.steps), "line after");
  return frame.svg();
}

std::string plot_histogram(const ErrorPairs& errors) {
  const Axis x = error_axis(errors, 6);
  const std::size_t bins = bin_count(errors.before.size());
  const auto before = histogram(errors.before, x.scale, bins);
  const auto after = histogram(errors.after, x.scale, bins);
  std::size_t most = 1;
  for (std::size_t k = 0; k < bins; ++k) most = std::max({most, before[k], after[k]});
  const double step = std::max(1.0, round_step(static_cast<double>(most), 4));
  Axis y{{0, step * std::ceil(static_cast<double>(most) / step), false}, "poses"};
  for (double v = 0; v <= y.scale.high; v += step) y.named.push_back({v, fmt::format("{:.0f}", v)});
  PlotFrame frame("How many poses have which error, before and after", x, y);
  const auto bars = [&](const std::vector<std::size_t>& count) {
    std::string d;
    for (std::size_t k = 0; k < bins; ++k) {
      if (count[k] == 0) continue;
      const double from = static_cast<double>(k) / static_cast<double>(bins);
      const double to = static_cast<double>(k + 1) / static_cast<double>(bins);
      d += fmt::format("M{:.1f} {:.1f}V{:.1f}H{:.1f}V{:.1f}Z", frame.at_share_x(from) + 0.5, frame.py(0),
                       frame.py(static_cast<double>(count[k])), frame.at_share_x(to) - 0.5, frame.py(0));
    }
    return d;
  };
  frame.add_path(bars(before), "bars before");
  frame.add_path(bars(after), "bars after");
  return frame.svg();
}

std::string plot_against(const std::vector<PagePose>& poses, const std::vector<double>& values,
                         const std::string& axis, const std::string& described, const Detail& detail) {
  if (values.empty()) return "";
  const auto [low, high] = std::ranges::minmax_element(values);
  const double margin = *high > *low ? 0.04 * (*high - *low) : 1;
  const Scale errors = residual_scale(poses);
  PlotFrame frame("What is left of the position error against " + described,
                  {{*low - margin, *high + margin, false}, axis, 6}, {errors, "error after [mm]", 4});
  const std::vector<std::size_t> shown = shown_poses(poses, detail.dots_of_three);
  std::string apart;
  for (std::size_t k = 0; k < 3; ++k) {
    std::vector<std::array<double, 2>> places;
    places.reserve(shown.size());
    std::string d;
    for (const std::size_t n : shown) {
      const double x = frame.px(values[n]);
      const double y = frame.py(std::clamp(poses[n].after_m[k] * 1e3, errors.low, errors.high));
      places.push_back({x, y});
      d += dot(x, y);
      if (poses[n].outlier) apart += diamond(x, y);
    }
    if (places.size() > most_precise_dots || places.size() < poses.size()) d = fine_dots(std::move(places));
    frame.add_path(d, dots_of(shown.size(), std::string(1, "xyz"[k])));
  }
  frame.add_path(apart, "apart");
  return frame.svg();
}

}  // namespace flexcomp::host
