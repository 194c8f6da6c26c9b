// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/held_out.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <system_error>

#include "files/data_file.hpp"
#include "identification/validate.hpp"
#include "input_error.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {
namespace {

constexpr double suspicious_factor = 100;

/// Everything that was read off instruments at a row: two rows that agree in all of it are one measurement.
std::array<double, 25> readings(const Measurement& m) {
  std::array<double, 25> all{};
  auto at = std::copy(m.q_rad.begin(), m.q_rad.end(), all.begin());
  at = std::copy(m.position_m.begin(), m.position_m.end(), at);
  const auto& orientation = m.orientation.coeffs();
  at = std::copy(orientation.begin(), orientation.end(), at);
  for (const Eigen::Vector3d& p : m.reflector_m) at = std::copy(p.begin(), p.end(), at);
  return all;
}

}  // namespace

double noise_floor_m(const std::vector<Observation>& rows) {
  double sum = 0;
  for (const Observation& row : rows) {
    if (row.has_orientation) {
      const Matrix6d root = inverse(row.whitening);
      sum += (root * root.transpose()).topLeftCorner<3, 3>().trace();
    } else {
      const Eigen::Matrix3d root = row.whitening.topLeftCorner<3, 3>().inverse();
      sum += (root * root.transpose()).trace();
    }
  }
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(rows.size(), 1)));
}

HeldOut held_out(const Robot& robot, const Diagnosis& d, const std::vector<Observation>& rows,
                 const std::string& source, bool force) {
  HeldOut out;
  out.rows = rows.size();
  out.before = statistics(residuals_with(robot, d.before, rows), rows);
  out.after = statistics(residuals_with(robot, d.after, rows), rows);
  out.noise_floor_m = noise_floor_m(rows);
  const double usual = std::max(d.error_before.rms_m, out.noise_floor_m);
  if (!force && out.before.rms_m > suspicious_factor * usual) {
    throw InputError(
        source, 0, "x_mm y_mm z_mm",
        fmt::format("rows in the same measurement frame as those that were fitted ({:.3g} mm off, rms)",
                    d.error_before.rms_m * 1e3),
        fmt::format("{:.1f} mm (rms): was the instrument moved?", out.before.rms_m * 1e3),
        ErrorCode::implausible_data);
  }
  return out;
}

void refuse_the_fitted(const MeasuredData& fitted, const MeasuredData& other) {
  const char* const expected = "poses that were not fitted";
  std::error_code unknown;
  if (fitted.path == other.path || std::filesystem::equivalent(fitted.path, other.path, unknown))
    throw InputError(other.path, 0, "", expected, "the same file", ErrorCode::held_out_was_fitted);
  std::map<std::array<double, 25>, std::size_t> lines;
  for (const Measurement& m : fitted.rows) lines.emplace(readings(m), m.line);
  for (const Measurement& m : other.rows) {
    const auto same = lines.find(readings(m));
    if (same != lines.end())
      throw InputError(other.path, m.line, "", expected,
                       fmt::format("the measurement of {}:{}", fitted.path, same->second),
                       ErrorCode::held_out_was_fitted);
  }
}

std::vector<std::string> missing_columns(const MeasuredData& fitted, const MeasuredData& other) {
  const std::vector<std::string> have = joint_and_context_names(other.columns);
  std::vector<std::string> missing;
  for (const std::string& name : joint_and_context_names(fitted.columns)) {
    if (std::ranges::find(have, name) == have.end()) missing.push_back(name);
  }
  return missing;
}

}  // namespace flexcomp::host
