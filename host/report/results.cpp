#include "report/results.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "report/parameters.hpp"

namespace flexcomp::host {

PagePoses page_poses(const std::vector<RowResidual>& before, const std::vector<RowResidual>& after,
                     const std::vector<Observation>& rows, const std::vector<std::size_t>& outliers) {
  PagePoses set;
  set.before = "nominal model";
  set.after = "calibrated model";
  for (std::size_t k = 0; k < rows.size(); ++k) {
    PagePose pose;
    pose.q_rad = rows[k].q_rad;
    for (std::size_t i = 0; i < 3; ++i) {
      pose.before_m[i] = before[k].position_m[static_cast<Eigen::Index>(i)];
      pose.after_m[i] = after[k].position_m[static_cast<Eigen::Index>(i)];
    }
    if (rows[k].has_orientation) {
      pose.before_rad = before[k].orientation_rad.norm();
      pose.after_rad = after[k].orientation_rad.norm();
    }
    pose.outlier = std::find(outliers.begin(), outliers.end(), k) != outliers.end();
    set.poses.push_back(pose);
  }
  return set;
}

Page titled_page(const std::string& title, const RobotFile& robot) {
  Page page;
  page.title = title;
  Calibration now;
  stamp(now, robot);
  page.made_by = fmt::format("flexcomp {}, {}", now.tool_version, now.date);
  return page;
}

namespace {

std::string gained(const ErrorStatistics& before, const ErrorStatistics& after) {
  return fmt::format("Mean position error {:.3f} mm before, {:.3f} mm after.", before.mean_m * 1e3,
                     after.mean_m * 1e3);
}

}  // namespace

Page page_of(const Identification& r, const std::vector<Observation>& rows, const RobotFile& robot,
             const std::string& data) {
  Page p = titled_page("Identification of " + robot.name, robot);
  p.summary =
      gained(statistics(r.nominal, rows), r.after) + " On the poses that were fitted: validate on others.";
  p.doubts = r.doubts;
  p.facts = {{"data", data},
             {"poses", fmt::format("{}", rows.size())},
             {"parameters identifiable", fmt::format("{} of {}", r.identifiable, r.parameters)},
             {"numbers of the frames", fmt::format("{}", r.frame_parameters)},
             {"chi-square per degree of freedom", fmt::format("{:.3g}", r.fit.chi2_per_dof())},
             {"condition", fmt::format("{:.3g}", r.condition)},
             {"O1", fmt::format("{:.3g}", r.o1)},
             {"converged", r.fit.converged ? "yes" : "no"},
             {"rows outside the bulk", fmt::format("{}", r.outliers.size())}};
  PagePoses set = page_poses(r.nominal, r.residuals, rows, r.outliers);
  set.title = "Poses that were fitted";
  p.poses.push_back(set);
  add_parameters(p, r.calibration, robot);
  p.missing = r.known.missing;
  for (const CuringPose& c : r.known.cure) p.cure_rad.push_back(c.q_rad);
  return p;
}

Page page_of(const Validation& v, const std::vector<Observation>& rows, const RobotFile& robot,
             const Calibration& calibration, const std::string& data) {
  Page p = titled_page("Validation of " + robot.name, robot);
  p.summary = gained(statistics(v.nominal, rows), v.after);
  p.doubts = v.doubts;
  p.facts = {{"data", data},
             {"calibration", calibration.path},
             {"poses", fmt::format("{}", rows.size())},
             {"chi-square per degree of freedom", fmt::format("{:.3g}", v.chi2_per_dof())}};
  PagePoses set = page_poses(v.nominal, v.residuals, rows, {});
  set.title = "Poses that were not fitted";
  p.poses.push_back(set);
  add_parameters(p, calibration, robot);
  return p;
}

}  // namespace flexcomp::host
