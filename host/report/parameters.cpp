// SPDX-License-Identifier: Apache-2.0
#include "report/parameters.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "model/effects.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// The numbers of F and E that were fitted, under their names: "cannot be told apart" speaks of them.
void add_frames(Page& page, const Calibration& calibration) {
  static constexpr std::array<const char*, 6> names{"x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"};
  const std::array<std::pair<const char*, const Frame*>, 2> frames{
      {{"frame_f.", &calibration.frames->f}, {"frame_e.", &calibration.frames->e}}};
  for (const auto& [prefix, frame] : frames) {
    const Eigen::AngleAxisd turn(frame->orientation);
    const Eigen::Vector3d turned = turn.angle() * turn.axis();
    for (std::size_t i = 0; i < names.size(); ++i) {
      PageParameter shown;
      shown.name = std::string(prefix) + names[i];
      const auto at = static_cast<Eigen::Index>(i % 3);
      shown.value = i < 3 ? frame->position_m[at] * 1e3 : degrees(turned[at]);
      if (calibration.covariance) {
        const auto& known = calibration.covariance->parameters;
        const auto row = std::find(known.begin(), known.end(), shown.name);
        if (row == known.end()) continue;
        const double sigma = calibration.covariance->factor.row(row - known.begin()).norm();
        shown.sigma = i < 3 ? sigma * 1e3 : degrees(sigma);
      }
      page.parameters.push_back(shown);
    }
  }
}

}  // namespace

void add_parameters(Page& page, const Calibration& calibration, const Robot& robot) {
  for (const Parameter& p : parameters_of(calibration.terms, robot.nominal)) {
    PageParameter shown;
    shown.name = p.name;
    shown.value = p.get(calibration.terms) / p.si_per_file_unit();
    const std::vector<double>& sigmas = p.value ? calibration.value_sigma : calibration.sigma;
    const std::size_t at = p.value ? *p.value : p.terms.front();
    if (at < sigmas.size() && std::isfinite(sigmas[at])) shown.sigma = sigmas[at] / p.si_per_file_unit();
    page.parameters.push_back(shown);
  }
  if (calibration.frames) add_frames(page, calibration);
  for (const Confounded& c : calibration.confounded) page.confounded.push_back({c.parameter, c.with});
}

}  // namespace flexcomp::host
