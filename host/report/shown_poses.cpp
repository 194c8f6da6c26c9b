// SPDX-License-Identifier: Apache-2.0
#include "report/shown_poses.hpp"

#include <algorithm>
#include <numeric>

#include "report/pose_errors.hpp"

namespace flexcomp::host {

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
  std::sort(rows.begin(), rows.end());
  const std::size_t wanted = limit - shown.size();
  for (std::size_t k = 0; k < wanted; ++k) shown.push_back(rows[k * rows.size() / wanted]);
  std::sort(shown.begin(), shown.end());
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
