// SPDX-License-Identifier: Apache-2.0
#include "measurement/observation.hpp"

#include <fmt/format.h>

#include <cmath>

#include "input_error.hpp"
#include "linalg/decompositions.hpp"
#include "measurement/reflectors.hpp"

namespace flexcomp::host {

namespace {

constexpr double improbable = 1e-6;

std::vector<Points> reflector_rows(const MeasuredData& data) {
  std::vector<Points> rows;
  for (const Measurement& m : data.rows) {
    rows.emplace_back(m.reflector_m.begin(),
                      m.reflector_m.begin() + static_cast<std::ptrdiff_t>(data.reflectors));
    if (on_one_line(rows.back())) {
      throw InputError(data.path, m.line, "ax_mm … cz_mm", "three reflectors that are not on one line",
                       "A, B, C on one line");
    }
  }
  return rows;
}

/// Reflector template in the order of the data's columns: the robot file's, or the mean shape of the data.
Points choose_template(const MeasuredData& data, const Robot& robot, const std::vector<Points>& rows) {
  if (robot.reflectors_m.empty()) return estimate_template(rows);
  if (robot.reflectors_m.size() < data.reflectors) {
    throw InputError(robot.path, 0, "tool.reflectors_mm.d",
                     fmt::format("reflector D, which {} has", data.path), "nothing");
  }
  Points shape(robot.reflectors_m.begin(),
               robot.reflectors_m.begin() + static_cast<std::ptrdiff_t>(data.reflectors));
  if (on_one_line(shape)) {
    throw InputError(robot.path, 0, "tool.reflectors_mm", "three reflectors that are not on one line",
                     "A, B, C on one line");
  }
  return shape;
}

/// "reflector A", or all candidates with their probabilities.
std::string names_of_moved(const Suspicion& suspicion) {
  if (suspicion.several) return "more than one reflector";
  if (suspicion.named.size() == 1) return fmt::format("reflector {}", "ABCD"[suspicion.named[0]]);
  std::string text = "one of the reflectors";
  for (std::size_t i = 0; i < suspicion.named.size(); ++i) {
    const std::size_t k = suspicion.named[i];
    text += fmt::format("{} {} ({:.0f} %)", i == 0 ? "" : (i + 1 == suspicion.named.size() ? " or" : ","),
                        "ABCD"[k], 100 * suspicion.probability[k]);
  }
  return text;
}

/// Warns of moved reflectors in these rows (indices, ascending), once for consecutive rows of the same shape.
void warn_of_slips(const MeasuredData& data, const Robot& robot, const std::vector<Points>& rows,
                   const Points& shape, const std::vector<std::size_t>& slipped,
                   std::vector<std::string>& warnings) {
  if (2 * slipped.size() > data.rows.size() && !robot.reflectors_m.empty()) {
    warnings.push_back(fmt::format(
        "{}: in {} of {} rows the distances between the reflectors are not those of {} (tool.reflectors_mm): "
        "either the template or sigma_mm is wrong; without reflectors_mm the template is estimated from the "
        "data.",
        data.path, slipped.size(), data.rows.size(), robot.path));
    return;
  }
  for (std::size_t i = 0; i < slipped.size();) {
    const double sigma = data.rows[slipped[i]].position_sigma_m;
    std::vector<Points> together{rows[slipped[i]]};
    std::size_t next = i + 1;
    for (; next < slipped.size() && slipped[next] == slipped[next - 1] + 1; ++next) {
      if (data.rows[slipped[next]].position_sigma_m != sigma) break;
      together.push_back(rows[slipped[next]]);
      if (same_shape(together, sigma)) continue;
      together.pop_back();
      break;
    }
    const Points mean = estimate_template(together);
    const std::string lines = together.size() == 1 ? fmt::format("{}", data.rows[slipped[i]].line)
                                                   : fmt::format("{}-{}", data.rows[slipped[i]].line,
                                                                 data.rows[slipped[next - 1]].line);
    warnings.push_back(fmt::format(
        "{}:{}: {} has moved or is badly seated: the distances to the others are off (misfit {:.3f} mm "
        "rms).",
        data.path, lines, names_of_moved(suspect_reflectors(together, shape, sigma)),
        1e3 * std::sqrt(fit_rigid(mean, shape).squares_m2 / static_cast<double>(data.reflectors))));
    i = next;
  }
}

void observe_reflectors(const MeasuredData& data, const Robot& robot, std::vector<Observation>& observations,
                        std::vector<std::string>* warnings) {
  const std::vector<Points> rows = reflector_rows(data);
  const Points shape = choose_template(data, robot, rows);
  std::vector<std::size_t> slipped;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const Measurement& m = data.rows[k];
    Observation& o = observations[k];
    const RigidFit fit = fit_rigid(rows[k], shape);
    o.has_orientation = true;
    o.p_m = fit.pose.position;
    o.R = fit.pose.rotation;
    const Matrix6d information = fit_information(fit.pose, shape, m.position_sigma_m);
    o.whitening = Llt(information).lower().transpose();
    o.misfit_chi2 = fit.squares_m2 / (m.position_sigma_m * m.position_sigma_m);
    o.misfit_dof = 3 * data.reflectors - 6;
    if (misfit_probability(o.misfit_chi2, o.misfit_dof) < improbable) slipped.push_back(k);
  }
  if (warnings != nullptr) warn_of_slips(data, robot, rows, shape, slipped, *warnings);
}

}  // namespace

std::vector<Observation> observe(const MeasuredData& data, const Robot& robot,
                                 std::vector<std::string>* warnings) {
  if (data.kind == MeasurementKind::joints) {
    throw InputError(data.path, 1, "", "something measured (x_mm y_mm z_mm or reflectors)", "joints only");
  }
  std::vector<Observation> observations(data.rows.size());
  for (std::size_t k = 0; k < data.rows.size(); ++k) {
    const Measurement& m = data.rows[k];
    Observation& o = observations[k];
    o.q_rad = m.q_rad;
    o.context = m.context;
    o.line = m.line;
    o.p_m = m.position_m;
    o.whitening.topLeftCorner<3, 3>().diagonal().setConstant(1 / m.position_sigma_m);
    if (data.kind == MeasurementKind::pose) {
      o.has_orientation = true;
      o.R = m.orientation.toRotationMatrix();
      o.whitening.bottomRightCorner<3, 3>().diagonal().setConstant(1 / m.orientation_sigma_rad);
    }
  }
  if (data.kind == MeasurementKind::reflectors) observe_reflectors(data, robot, observations, warnings);
  return observations;
}

}  // namespace flexcomp::host
