// SPDX-License-Identifier: Apache-2.0
/// \file
/// One self-contained page about a calibration, without network; light, dark and on paper. Text, tables and drawings
/// (inline SVG) are made here and can be read without scripts; the script that the page carries (report/web) adds the arm
/// in 3-D and plots to choose from. Whoever has numbers fills a Page; whatever is left empty leaves no trace on the page.
/// All text is escaped.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/calibration.hpp"
#include "model/cell.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// What was off at one pose, before and after.
struct PagePose {
  std::array<double, joint_count> q_rad{};  ///< reading, or command before correction
  std::array<double, 3> before_m{};         ///< error vector: measured - modelled, or reached - wanted
  std::array<double, 3> after_m{};
  std::optional<double> before_rad;  ///< angle of the rotation error, where orientations are known
  std::optional<double> after_rad;
  bool outlier = false;  ///< down-weighted
  std::size_t line = 0;  ///< of the data file; 0: unknown
};

/// Something beside the joints that was recorded at every pose and is not the same at all of them.
struct PageCovariate {
  std::string name;            ///< with its unit: "payload [kg]"
  std::vector<double> values;  ///< one per pose, in that unit
  bool on_paper = true;        ///< false: among the script's choices only
};

/// A set of poses with its summary, the two plots per pose, the histogram and the residuals against each joint.
struct PagePoses {
  std::string title;   ///< "Poses that were fitted", "Validation: where the arm truly went"
  std::string about;   ///< a sentence or two below it
  std::string before;  ///< what "before" is: "nominal model, frames fitted"
  std::string after;   ///< what "after" is: "calibrated model"
  std::vector<PagePose> poses;
  std::vector<PageCovariate> covariates;
  /// Of the measurement in which the error vectors are given, where it is not F0: where to draw them.
  std::optional<MeasurementFrames> frames;
  /// Mean length of the measurement's own error: nothing can be seen below it. Drawn where it is given.
  std::optional<double> noise_floor_m;
  bool exact = false;  ///< fitted with as many unknowns as numbers: what is left says nothing
};

struct PageParameter {
  std::string name;  ///< link1.theta_deg, joint_compliance[joint=2].rad_per_nm
  double value = 0;  ///< in the unit that the name ends with
  std::optional<double> sigma = {};
};

struct PageConfounded {
  std::string parameter;
  std::vector<std::string> with;
};

struct PageFact {
  std::string name;
  std::string value;
};

/// Another set of data with its own calibration, in a line.
struct PageResult {
  std::string title;  ///< "UR5, laser tracker"
  std::size_t poses = 0;
  double before_m = 0;  ///< mean position error
  double after_m = 0;
  std::string remark;
};

/// Text, a table and figures about anything that has no form of its own above.
struct PageSection {
  std::string title;
  std::vector<std::string> paragraphs = {};
  std::vector<std::string> columns = {};  ///< of the table; none: no table
  std::vector<std::vector<std::string>> rows = {};
  std::vector<std::pair<std::string, std::string>> figures = {};  ///< SVG of plots.hpp and its caption
};

/// A link to a page beside this one, or to one of its own sections.
struct PageLink {
  std::string href;
  std::string text;
};

/// Only places beside a page or inside it: a report never leads into the network, and leaves other links out.
bool is_local(const std::string& href);

/// A plan of measurement poses.
struct PagePlan {
  std::vector<std::pair<double, double>> progress;  ///< evaluations and criterion at each improvement
  double evaluations = 0;                           ///< in all: the last criterion held until then
  std::vector<std::array<double, joint_count>> q_rad;
  std::vector<double> payload_kg;                            ///< per pose, or empty
  std::vector<std::array<double, joint_count>> known_q_rad;  ///< measured already
  std::array<std::pair<double, double>, joint_count> limits_rad{};
  std::optional<Cell> cell;                              ///< tracker and obstacles
  std::vector<std::pair<std::string, double>> expected;  ///< sigma per parameter, unit as the name says
};

struct Page {
  std::string title;                ///< "Calibration of staubli-tx60l"
  std::string summary;              ///< what came out, in a sentence or two for somebody in a hurry
  std::vector<std::string> doubts;  ///< why the result must not be relied on; shown first, in words
  std::optional<Robot> arm;         ///< drawn in 3-D with the poses below
  std::vector<PageFact> facts;      ///< data file, poses, parameters, condition, chi-square per dof …
  std::optional<PagePlan> plan;
  std::vector<PagePoses> poses;
  std::vector<PageParameter> parameters;
  std::vector<PageConfounded> confounded;
  std::vector<std::string> missing;  ///< parameters that these data do not know though such data could
  std::vector<std::array<double, joint_count>> cure_rad;  ///< poses that would make them known
  std::vector<PageSection> sections;                      ///< before the poses
  std::vector<PageSection> further;                       ///< after them
  std::vector<PageResult> results;
  std::vector<PageLink> links;
  std::string made_by;  ///< "flexcomp 0.1.0, 2025-01-31"
};

/// \return whether this program was built with the script (FLEXCOMP_REPORT_WEB)
bool has_web_parts();

/// The page as one HTML document, at most 1.5 MB whatever the number of poses: of very many, statistics and histograms
/// take all and drawings show a part, and the page says so.
/// \param web  with the script, where the program has it
std::string html(const Page& page, bool web = has_web_parts());

}  // namespace flexcomp::host
