// SPDX-License-Identifier: Apache-2.0
#include "report/pose_errors.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "units.hpp"

namespace flexcomp::host {
namespace {

// Above this ratio of the largest to the usual error an axis is logarithmic: else the smaller ones lie on it.
constexpr double log_from_ratio = 8;

}  // namespace

double length(const std::array<double, 3>& v) { return std::hypot(v[0], v[1], v[2]); }

ErrorPairs position_errors(const PagePoses& set) {
  ErrorPairs e;
  e.unit = "mm";
  e.quantity = "position error";
  if (set.noise_floor_m) e.floor = *set.noise_floor_m * 1e3;
  for (const PagePose& p : set.poses) {
    if (p.outlier) e.outliers.push_back(e.before.size());
    e.before.push_back(length(p.before_m) * 1e3);
    e.after.push_back(length(p.after_m) * 1e3);
  }
  return e;
}

ErrorPairs component_errors(const PagePoses& set, std::size_t axis) {
  ErrorPairs e;
  e.unit = "mm";
  for (const PagePose& p : set.poses) {
    e.before.push_back(p.before_m[axis] * 1e3);
    e.after.push_back(p.after_m[axis] * 1e3);
  }
  return e;
}

ErrorPairs orientation_errors(const PagePoses& set) {
  ErrorPairs e;
  e.unit = "deg";
  e.quantity = "orientation error";
  for (const PagePose& p : set.poses) {
    if (!p.before_rad || !p.after_rad) return {};
    e.before.push_back(degrees(*p.before_rad));
    e.after.push_back(degrees(*p.after_rad));
  }
  return e;
}

bool is_logarithmic(const ErrorPairs& errors) {
  double high = errors.floor.value_or(0);
  for (const auto* set : {&errors.before, &errors.after})
    for (const double v : *set) high = std::max(high, v);
  const double usual = errors.after.empty() ? high : statistics_of(errors.after).mean;
  return usual > 0 && high / usual > log_from_ratio;
}

SampleStatistics statistics_of(std::vector<double> values) {
  SampleStatistics s;
  if (values.empty()) return s;
  std::ranges::sort(values);
  double squares = 0;
  for (const double v : values) {
    s.mean += v;
    squares += v * v;
  }
  const auto count = static_cast<double>(values.size());
  s.mean /= count;
  s.rms = std::sqrt(squares / count);
  s.median = 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
  s.max = values.back();
  return s;
}

double ninth_decile(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) * 9 / 10);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

PageCovariate time_covariate(std::vector<double> time_s) {
  const double start = time_s.empty() ? 0 : time_s.front();
  for (double& t : time_s) t -= start;
  return {"time since the first row [s]", std::move(time_s)};
}

std::vector<std::size_t> shown_rows(const std::vector<const std::vector<double>*>& sizes, std::size_t limit) {
  std::vector<std::size_t> rows(sizes.empty() ? 0 : sizes.front()->size());
  std::iota(rows.begin(), rows.end(), std::size_t{0});
  if (rows.size() <= limit) return rows;
  std::vector<std::size_t> shown;
  for (const auto* size : sizes) {
    const auto large = static_cast<std::ptrdiff_t>(limit / 20);
    std::nth_element(rows.begin(), rows.begin() + large, rows.end(),
                     [&](std::size_t a, std::size_t b) { return (*size)[a] > (*size)[b]; });
    shown.insert(shown.end(), rows.begin(), rows.begin() + large);
    rows.erase(rows.begin(), rows.begin() + large);
  }
  std::ranges::sort(rows);
  const std::size_t wanted = limit - shown.size();
  for (std::size_t k = 0; k < wanted; ++k) shown.push_back(rows[k * rows.size() / wanted]);
  std::ranges::sort(shown);
  return shown;
}

std::vector<std::size_t> shown_poses(const std::vector<PagePose>& poses, std::size_t limit) {
  std::vector<double> after, before;
  for (const PagePose& p : poses) {
    after.push_back(length(p.after_m));
    before.push_back(length(p.before_m));
  }
  return shown_rows({&after, &before}, limit);
}

std::vector<std::size_t> evenly_spaced(std::size_t count, std::size_t most) {
  std::vector<std::size_t> chosen;
  const std::size_t drawn = std::min(count, most);
  for (std::size_t k = 0; k < drawn; ++k) chosen.push_back(drawn < 2 ? k : k * (count - 1) / (drawn - 1));
  return chosen;
}

}  // namespace flexcomp::host
