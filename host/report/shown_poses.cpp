#include "report/shown_poses.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace flexcomp::host {

std::vector<std::size_t> shown_poses(const std::vector<PagePose>& poses, std::size_t limit) {
  std::vector<std::size_t> rows(poses.size());
  std::iota(rows.begin(), rows.end(), std::size_t{0});
  if (rows.size() <= limit) return rows;
  const auto size = [&](std::size_t k) {
    const auto& e = poses[k].after_m;
    return std::hypot(e[0], e[1], e[2]);
  };
  const auto large = static_cast<std::ptrdiff_t>(limit / 20);
  std::nth_element(rows.begin(), rows.begin() + large, rows.end(),
                   [&](std::size_t a, std::size_t b) { return size(a) > size(b); });
  std::sort(rows.begin() + large, rows.end());
  std::vector<std::size_t> shown(rows.begin(), rows.begin() + large);
  const std::size_t others = rows.size() - shown.size(), wanted = limit - shown.size();
  for (std::size_t k = 0; k < wanted; ++k)
    shown.push_back(rows[static_cast<std::size_t>(large) + k * others / wanted]);
  std::sort(shown.begin(), shown.end());
  return shown;
}

}  // namespace flexcomp::host
