// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "report/html.hpp"
#include "report/numbers.hpp"
#include "report/plots.hpp"
#include "report/pose_errors.hpp"
#include "report/sections.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

/// Drawn anew by the script: seen on paper and where there is none.
std::string still(const std::string& drawing) {
  return fmt::format("<div class=\"still\">{}</div>\n", drawing);
}

std::string summary_table(const PagePoses& set, const ErrorPairs& position, const ErrorPairs& orientation) {
  std::vector<Cells> rows;
  const auto add = [&](const char* name, double before, double after) {
    rows.push_back({name, number_text(before), number_text(after), change_text(before, after, set.exact)});
  };
  const SampleStatistics pb = statistics_of(position.before), pa = statistics_of(position.after);
  add("mean [mm]", pb.mean, pa.mean);
  add("median [mm]", pb.median, pa.median);
  add("rms [mm]", pb.rms, pa.rms);
  add("largest [mm]", pb.max, pa.max);
  if (!orientation.before.empty()) {
    const SampleStatistics ob = statistics_of(orientation.before), oa = statistics_of(orientation.after);
    add("mean [deg]", ob.mean, oa.mean);
    add("largest [deg]", ob.max, oa.max);
  }
  std::string out = table({"error", "before", "after", "change"}, rows, "summary");
  if (set.exact)
    out += paragraph(
        "As many numbers were fitted as were measured: the fit passes through all of them, and what is left "
        "says "
        "nothing.");
  return out +
         fmt::format(
             "<p class=\"key\"><span class=\"mark before\"></span> before: {} &nbsp; <span class=\"mark "
             "after\"></span> after: {}</p>\n",
             escaped(set.before), escaped(set.after));
}

/// "2 of 60 poses are outliers …: 4, 17."
std::string outliers_paragraph(const std::vector<std::size_t>& outliers, std::size_t poses) {
  if (outliers.empty()) return "";
  constexpr std::size_t most_named = 12;
  const std::size_t count = outliers.size();
  std::string which;
  for (std::size_t k = 0; k < std::min(count, most_named); ++k)
    which += fmt::format("{}{}", k > 0 ? ", " : "", outliers[k] + 1);
  return paragraph(
      fmt::format("{} of {} poses {}: {}{}.", count, poses,
                  count == 1 ? "is an outlier and down-weighted" : "are outliers and down-weighted", which,
                  count > most_named ? ", …" : ""));
}

/// Where there are more poses than a drawing has room for.
std::string part_text(std::size_t most, std::size_t all) {
  if (most >= all) return "";
  return fmt::format(" {} of {} poses are drawn: the largest errors and an even part of the others.", most,
                     all);
}

/// What was recorded at the poses, against which the rest of the errors is drawn.
struct Covariate {
  std::string axis;
  std::string described;
  std::vector<double> values;
};

std::vector<Covariate> covariates(const PagePoses& set) {
  std::vector<Covariate> list;
  for (std::size_t j = 0; j < joint_count; ++j) {
    Covariate c{fmt::format("q{} [deg]", j + 1), fmt::format("the angle of joint {}", j + 1), {}};
    for (const PagePose& p : set.poses) c.values.push_back(degrees(p.q_rad[j]));
    list.push_back(c);
  }
  for (const PageCovariate& c : set.covariates) {
    if (c.on_paper && c.values.size() == set.poses.size()) list.push_back({c.name, c.name, c.values});
  }
  Covariate order{"order of the data", "the order of the data", {}};
  for (std::size_t k = 0; k < set.poses.size(); ++k) order.values.push_back(static_cast<double>(k + 1));
  list.push_back(order);
  return list;
}

std::string residual_plots(const PagePoses& set, const Detail& detail, const std::string& marked) {
  std::string out = fmt::format(
      "<h3>What is left, against each joint and whatever else was recorded</h3>\n"
      "<p>The three components of the position error after: <span class=\"mark x\"></span> x, "
      "<span class=\"mark y\"></span> y, <span class=\"mark z\"></span> z. Noise has no shape here; a curve "
      "or a "
      "slope is an effect that the model does not have. Poses far off the others are drawn at the "
      "edge.{}{}</p>\n"
      "<div class=\"plots\">\n",
      marked, part_text(detail.dots_of_three, set.poses.size()));
  for (const Covariate& c : covariates(set)) {
    out += figure(plot_against(set.poses, c.values, c.axis, c.described, detail),
                  fmt::format("Against {}.", c.described));
  }
  return out + "</div>";
}

}  // namespace

std::string poses_section(const PagePoses& set, std::size_t number, std::size_t sets) {
  std::string out = set.about.empty() ? "" : paragraph(set.about);
  if (set.poses.empty()) return section(set.title, out + "<p>No poses.</p>");
  Detail detail;
  for (std::size_t* most : {&detail.dots, &detail.dots_of_three, &detail.steps})
    *most = std::max<std::size_t>(*most / sets, 40);
  const ErrorPairs position = position_errors(set);
  const ErrorPairs orientation = orientation_errors(set);
  const std::size_t count = set.poses.size();
  out += fmt::format(
      "<p class=\"headline\"><span class=\"before\">{}</span> → <span class=\"after\">{}</span> "
      "<small>mean position error over {} pose{}</small></p>\n",
      length_text(statistics_of(position.before).mean), length_text(statistics_of(position.after).mean),
      count, count == 1 ? "" : "s");
  out += summary_table(set, position, orientation) + outliers_paragraph(position.outliers, count);
  const std::string marked = position.outliers.empty() ? "" : " A diamond: it lies far from the rest.";
  out += fmt::format("<div class=\"explore\" data-set=\"{}\"></div>\n<div class=\"plots wide\">\n", number);
  out +=
      still(figure(plot_in_order(position, detail), "Position error of each pose, in the order of the data." +
                                                        marked + part_text(detail.dots, count)));
  out += figure(plot_sorted(position, detail),
                "Position error, sorted: the share of the poses whose error lies below a value.");
  out += still(figure(plot_histogram(position), "How many poses have which position error."));
  if (!orientation.before.empty())
    out += figure(plot_sorted(orientation, detail), "Orientation error, sorted.");
  return section(set.title, out + "</div>\n" + still(residual_plots(set, detail, marked)));
}

}  // namespace flexcomp::host
