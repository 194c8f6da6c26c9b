// SPDX-License-Identifier: Apache-2.0
#include "report/stored_results.hpp"

#include <fmt/format.h>

#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "files/csv.hpp"
#include "files/read_file.hpp"
#include "input_error.hpp"
#include "json.hpp"
#include "model/robot.hpp"
#include "report/pose_errors.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

struct ErrorColumns {
  std::array<std::size_t, joint_count> q{};
  std::array<std::size_t, 3> d{};
  std::optional<std::size_t> turned;
};

ErrorColumns columns_of(const CsvTable& table) {
  ErrorColumns c;
  for (std::size_t j = 0; j < joint_count; ++j)
    c.q[j] = table.require(fmt::format("q{}_deg", j + 1), "joint readings");
  for (std::size_t i = 0; i < 3; ++i)
    c.d[i] = table.require(fmt::format("d{}_mm", "xyz"[i]), "the position error");
  c.turned = table.find("distance_deg");
  return c;
}

}  // namespace

PagePoses errors_before_and_after(const std::string& title, const std::string& before_csv,
                                  const std::string& after_csv, double noise_floor_m) {
  const CsvTable before = read_csv(before_csv);
  const CsvTable after = read_csv(after_csv);
  if (before.rows.size() != after.rows.size()) {
    throw InputError(after.path, 0, "",
                     fmt::format("as many rows as {} ({})", before.path, before.rows.size()),
                     fmt::format("{}", after.rows.size()));
  }
  const ErrorColumns b = columns_of(before), a = columns_of(after);
  PagePoses set;
  set.title = title;
  set.before = "uncorrected";
  set.after = "corrected";
  if (noise_floor_m > 0) set.noise_floor_m = noise_floor_m;
  for (std::size_t k = 0; k < before.rows.size(); ++k) {
    const CsvRow &rb = before.rows[k], &ra = after.rows[k];
    PagePose pose;
    for (std::size_t j = 0; j < joint_count; ++j) pose.q_rad[j] = before.number(rb, b.q[j], unit::degree);
    for (std::size_t i = 0; i < 3; ++i) {
      pose.before_m[i] = before.number(rb, b.d[i], unit::mm);
      pose.after_m[i] = after.number(ra, a.d[i], unit::mm);
    }
    if (b.turned && a.turned) {
      pose.before_rad = before.number(rb, *b.turned, unit::degree);
      pose.after_rad = after.number(ra, *a.turned, unit::degree);
    }
    set.poses.push_back(pose);
  }
  // Whatever of the context stands beside the joints, under the names of data files.
  static constexpr std::array<std::array<const char*, 2>, 3> recorded{
      {{"payload_kg", "payload [kg]"}, {"temp_c", "temperature [°C]"}, {"time_s", ""}}};
  for (const auto& [column, shown] : recorded) {
    const auto at = before.find(column);
    if (!at) continue;
    std::vector<double> values;
    for (const CsvRow& row : before.rows) values.push_back(before.number(row, *at, unit::si));
    set.covariates.push_back(column == std::string_view("time_s") ? time_covariate(std::move(values))
                                                                  : PageCovariate{shown, std::move(values)});
  }
  return set;
}

PageResult stored_result(const std::string& title, const std::string& path) {
  try {
    const auto j = Json::parse(read_file(path));
    PageResult r;
    r.title = title;
    r.poses = j.at("poses");
    const auto& before = j.at("before");
    const bool fitted = before.contains("fitted_frames");
    r.before_m = before.at(fitted ? "fitted_frames" : "nominal_frames").at("mean_mm").get<double>() * 1e-3;
    r.after_m = j.at("after").at("mean_mm").get<double>() * 1e-3;
    r.remark = fmt::format("before: nominal arm{}; chi-square per degree of freedom {:.3g}",
                           fitted ? ", frames fitted" : "", j.at("chi2_per_dof").get<double>());
    return r;
  } catch (const Json::exception& e) {
    throw InputError(path, 0, "", "a result", e.what(), ErrorCode::no_result_file);
  }
}

}  // namespace flexcomp::host
