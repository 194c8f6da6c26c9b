// SPDX-License-Identifier: Apache-2.0
#include "nearest.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <vector>

namespace flexcomp::host {

namespace {

bool same_letter(char a, char b) {
  return std::tolower(static_cast<unsigned char>(a)) == std::tolower(static_cast<unsigned char>(b));
}

/// The name without its unit: what stands before the last underscore.
std::string_view stem(std::string_view name) { return name.substr(0, name.rfind('_')); }

/// Edits (insert, delete, replace, swap two neighbours) from one to the other, without regard to case.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      const bool same = same_letter(a[i - 1], b[j - 1]);
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (same ? 0U : 1U)});
      if (i > 1 && j > 1 && same_letter(a[i - 1], b[j - 2]) && same_letter(a[i - 2], b[j - 1])) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

}  // namespace

std::string nearest(std::string_view name, std::span<const std::string> known) {
  // A name without its unit ("a" for "a_mm") or with another one ("q1_rad" for "q1_deg") is farther away than a typing
  // error, and meant more often.
  std::string best;
  for (const std::string& k : known) {
    const bool other_unit = stem(k) == name || stem(k) == stem(name) || k == stem(name);
    if (other_unit && (best.empty() || k.size() < best.size())) best = k;
  }
  if (!best.empty()) return best;
  std::size_t least = std::max<std::size_t>(1, name.size() / 3) + 1;
  for (const std::string& k : known) {
    const std::size_t d = distance(name, k);
    if (d < least) {
      least = d;
      best = k;
    }
  }
  return best;
}

std::string expected_name(std::string_view wrong, std::span<const std::string> known, std::string_view one_of,
                          std::string_view a_known) {
  const std::string near = nearest(wrong, known);
  return near.empty() ? fmt::format("{} {}", one_of, fmt::join(known, ", "))
                      : fmt::format("{} (did you mean '{}'?)", a_known, near);
}

}  // namespace flexcomp::host
