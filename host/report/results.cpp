// SPDX-License-Identifier: Apache-2.0
#include "report/results.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "model/effects.hpp"
#include "report/numbers.hpp"
#include "report/plots.hpp"
#include "report/pose_errors.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

using Row = const Observation&;

std::vector<double> values_of(const std::vector<Observation>& rows, const std::function<double(Row)>& of) {
  std::vector<double> values;
  values.reserve(rows.size());
  for (const Observation& row : rows) values.push_back(of(row));
  return values;
}

/// Appends it where it is not the same at every row.
void add_covariate(PagePoses& set, PageCovariate c) {
  const auto [low, high] = std::ranges::minmax_element(c.values);
  if (c.values.empty() || !(*high > *low)) return;
  set.covariates.push_back(std::move(c));
}

void add_covariates(PagePoses& set, const std::vector<Observation>& rows) {
  const auto add = [&](const std::string& name, const std::function<double(Row)>& of, bool on_paper = true) {
    add_covariate(set, {name, values_of(rows, of), on_paper});
  };
  add("payload [kg]", [](Row r) { return r.context.payload_kg; });
  add("temperature [°C]", [](Row r) { return r.context.temperature_c; });
  add_covariate(set, time_covariate(values_of(rows, [](Row r) { return r.context.time_s; })));
  for (std::size_t k = 0; k < 3; ++k)
    add(fmt::format("force {} [N]", "xyz"[k]), [k](Row r) { return r.context.force_n[k]; });
  const bool speeds = std::ranges::any_of(rows, [](Row r) {
    return std::ranges::any_of(r.context.relative_speed, [](double v) { return v != 0; });
  });
  for (std::size_t j = 0; j < joint_count; ++j) {
    const std::string name = speeds ? fmt::format("last motion of joint {} (1: the fastest)", j + 1)
                                    : fmt::format("last direction of joint {}", j + 1);
    const auto of = [j, speeds](Row r) {
      return speeds ? r.context.relative_speed[j] : r.context.direction[j];
    };
    add(name, of, false);
  }
}

/// The numbers of F and E that were fitted, under their names: "cannot be told apart" speaks of them.
void add_frames(Page& page, const Calibration& calibration) {
  static constexpr std::array<const char*, 6> names{"x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"};
  const std::array<std::pair<const char*, const Frame*>, 2> frames{
      {{"frame_f.", &calibration.frames->f}, {"frame_e.", &calibration.frames->e}}};
  for (const auto& [prefix, frame] : frames) {
    const Eigen::AngleAxisd turn(frame->orientation);
    const Eigen::Vector3d turned = turn.angle() * turn.axis();
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i % 3);
      PageParameter shown{std::string(prefix) + names[i],
                          i < 3 ? frame->position_m[at] * 1e3 : degrees(turned[at])};
      if (calibration.covariance) {
        const auto& known = calibration.covariance->parameters;
        const auto row = std::ranges::find(known, shown.name);
        if (row == known.end()) continue;
        const double sigma = calibration.covariance->sigma(row - known.begin());
        shown.sigma = i < 3 ? sigma * 1e3 : degrees(sigma);
      }
      page.parameters.push_back(shown);
    }
  }
}

/// The error of the nominal arm with the frames that the summary does not have.
void add_other_before(Page& page, const Before& before, bool frames_fitted) {
  if (frames_fitted) {
    page.facts.push_back({"nominal model, frames nominal: mean [mm]",
                          fmt::format("{:.3f}", before.nominal_frames.mean_m * 1e3)});
  } else if (before.fitted_frames) {
    page.facts.push_back({"nominal model, frames fitted: mean [mm]",
                          fmt::format("{:.3f}", before.fitted_frames->mean_m * 1e3)});
  }
}

/// To the micrometre, and never a nought for what is none.
std::string micrometre_text(double metres) {
  return metres > 0 && metres < 5e-7 ? std::string("< 0.001") : fmt::format("{:.3f}", metres * 1e3);
}

std::string gained(const ErrorStatistics& before, const ErrorStatistics& after) {
  return fmt::format("Mean position error {} mm before, {} mm after.", micrometre_text(before.mean_m),
                     micrometre_text(after.mean_m));
}

PageSection models_section(const std::vector<ModelFit>& compared, bool without_priors) {
  PageSection section{"Which model?"};
  section.paragraphs = {fmt::format(
      "The models of the paper, each fitted anew to these rows{}. What a model gains on the rows that it is "
      "fitted to may be noise that it has learnt; what it gains on rows left out is the arm. Left out: each "
      "row in turn, predicted by a fit to all the others.",
      without_priors ? ", without the fixed parameters and tolerances of this run" : "")};
  section.columns = {
      "model",        "parameters",        "fitted: mean [mm]", "largest [mm]", "left out: mean [mm]",
      "largest [mm]", "chi-square per dof"};
  Curves curves{
      "Position error of the left-out rows over the share of rows that are further off, for each model",
      "% of the rows that are further off",
      "position error, left out [mm]",
      {},
      true};
  bool partly = false;
  for (const ModelFit& m : compared) {
    section.rows.push_back({model_words(m.kind), fmt::format("{}", m.parameters), mm_text(m.fitted.mean_m),
                            mm_text(m.fitted.max_m), m.left_out ? mm_text(m.left_out->mean_m) : "–",
                            m.left_out ? mm_text(m.left_out->max_m) : "–",
                            fmt::format("{:.3g}", m.chi2_per_dof)});
    partly = partly || !m.left_out;
    if (!m.left_out) continue;
    Curve curve{model_words(m.kind), {}, CurveStyle::line};
    std::vector<double> sorted = m.left_out_m;
    std::ranges::sort(sorted, std::greater<>());
    const auto n = static_cast<double>(sorted.size());
    for (const std::size_t k : evenly_spaced(sorted.size(), 200))
      curve.points.push_back({100 * static_cast<double>(k) / n, sorted[k] * 1e3});
    curves.curves.push_back(curve);
  }
  if (partly)
    section.paragraphs.emplace_back(
        "–: a parameter is known by one row alone; without that row nothing could be predicted.");
  if (!curves.curves.empty())
    section.figures.emplace_back(plot_curves(curves), "Rows left out, the farthest first: lower is better.");
  return section;
}

}  // namespace

PagePoses page_poses(const std::vector<RowResidual>& before, const std::vector<RowResidual>& after,
                     const std::vector<Observation>& rows, const std::vector<std::size_t>& outliers,
                     bool frames_fitted) {
  PagePoses set;
  set.before = frames_fitted ? "nominal model, frames fitted" : "nominal model";
  set.after = "calibrated model";
  for (std::size_t k = 0; k < rows.size(); ++k) {
    PagePose pose;
    pose.q_rad = rows[k].q_rad;
    pose.line = rows[k].line;
    for (std::size_t i = 0; i < 3; ++i) {
      pose.before_m[i] = before[k].position_m[static_cast<Eigen::Index>(i)];
      pose.after_m[i] = after[k].position_m[static_cast<Eigen::Index>(i)];
    }
    if (rows[k].has_orientation) {
      pose.before_rad = before[k].orientation_rad.norm();
      pose.after_rad = after[k].orientation_rad.norm();
    }
    pose.outlier = std::ranges::find(outliers, k) != outliers.end();
    set.poses.push_back(pose);
  }
  add_covariates(set, rows);
  return set;
}

Page titled_page(const std::string& title, const Robot& robot) {
  Page page;
  page.title = title;
  page.arm = robot;
  Calibration now;
  stamp(now, robot);
  page.made_by = fmt::format("flexcomp {}, {}", now.tool_version, now.date);
  return page;
}

void add_parameters(Page& page, const Calibration& calibration, const Robot& robot) {
  for (const Parameter& p : parameters_of(calibration.terms, robot.nominal)) {
    PageParameter shown{p.name, p.get(calibration.terms) / p.si_per_file_unit()};
    const std::vector<double>& sigmas = p.value ? calibration.value_sigma : calibration.sigma;
    const std::size_t at = p.value ? *p.value : p.terms.front();
    if (at < sigmas.size() && std::isfinite(sigmas[at])) shown.sigma = sigmas[at] / p.si_per_file_unit();
    page.parameters.push_back(shown);
  }
  if (calibration.frames) add_frames(page, calibration);
  for (const Confounded& c : calibration.confounded) page.confounded.push_back({c.parameter, c.with});
}

Page page_of(const Identification& r, const std::vector<Observation>& rows, const Robot& robot,
             const std::string& data, const std::vector<ModelFit>& compared, bool without_priors) {
  Page p = titled_page("Identification of " + robot.name, robot);
  p.summary =
      gained(statistics(r.nominal, rows), r.after) + " On the poses that were fitted: validate on others.";
  p.doubts = r.doubts;
  p.facts = {{"data", data},
             {"poses", fmt::format("{}", rows.size())},
             {"parameters identifiable", fmt::format("{} of {}", r.identifiable, r.parameters)},
             {"frame parameters", fmt::format("{}", r.frame_parameters)},
             {"chi-square per degree of freedom",
              r.fit.degrees_of_freedom > 0 ? fmt::format("{:.3g}", r.fit.chi2_per_dof()) : "–"},
             {"condition", fmt::format("{:.3g}", r.condition)},
             {"O1", fmt::format("{:.3g}", r.o1)},
             {"converged", r.fit.converged ? "yes" : "no"},
             {"rows outside the bulk", fmt::format("{}", r.outliers.size())}};
  const bool frames_fitted = r.calibration.frames.has_value();
  add_other_before(p, r.before, frames_fitted);
  PagePoses set = page_poses(r.nominal, r.residuals, rows, r.outliers, frames_fitted);
  set.title = "Poses that were fitted";
  set.exact = !(r.fit.degrees_of_freedom > 0);
  set.frames = r.calibration.frames;
  p.poses.push_back(set);
  if (!compared.empty()) p.further.push_back(models_section(compared, without_priors));
  add_parameters(p, r.calibration, robot);
  p.missing = r.identifiability.missing;
  for (const SuggestedPose& c : r.identifiability.suggested_poses) p.cure_rad.push_back(c.q_rad);
  return p;
}

Page page_of(const Validation& v, const std::vector<Observation>& rows, const Robot& robot,
             const Calibration& calibration, const std::string& data) {
  Page p = titled_page("Validation of " + robot.name, robot);
  p.summary = gained(statistics(v.nominal, rows), v.after);
  p.doubts = v.doubts;
  p.facts = {{"data", data},
             {"calibration", calibration.path},
             {"poses", fmt::format("{}", rows.size())},
             {"chi-square per degree of freedom", fmt::format("{:.3g}", v.chi2_per_dof())}};
  const bool frames_fitted = calibration.frames.has_value();
  add_other_before(p, v.before, frames_fitted);
  PagePoses set = page_poses(v.nominal, v.residuals, rows, {}, frames_fitted);
  set.title = "Poses that were not fitted";
  set.frames = calibration.frames;
  p.poses.push_back(set);
  add_parameters(p, calibration, robot);
  return p;
}

}  // namespace flexcomp::host
