// SPDX-License-Identifier: Apache-2.0
#include "report/sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "report/html.hpp"
#include "report/numbers.hpp"
#include "report/plots.hpp"
#include "report/pose_errors.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

/// The criterion over the work done; empty of a search that found nothing better than its start.
std::string plot_progress(const PagePlan& plan) {
  Curve best{.style = CurveStyle::steps};
  for (const auto& [work, value] : plan.progress) best.points.push_back({work / 1e3, value});
  // What was found last held until the end.
  if (!best.points.empty() && plan.evaluations / 1e3 > best.points.back()[0])
    best.points.push_back({plan.evaluations / 1e3, best.points.back()[1]});
  if (best.points.size() < 2) return "";
  return plot_curves({.described = "Criterion of the best set of poses over the work done",
                      .x_name = "thousand evaluations",
                      .y_name = "criterion",
                      .curves = {best},
                      .x_from_zero = true});
}

}  // namespace

PageSection poses_table(const std::string& title, const std::vector<std::array<double, joint_count>>& q_rad,
                        const std::vector<double>& payload_kg, int decimals) {
  PageSection s{.title = title, .columns = {"pose"}};
  for (std::size_t j = 0; j < joint_count; ++j) s.columns.push_back(fmt::format("q{} [deg]", j + 1));
  if (!payload_kg.empty()) s.columns.emplace_back("payload [kg]");
  for (std::size_t k = 0; k < q_rad.size(); ++k) {
    Cells row{fmt::format("{}", k + 1)};
    for (const double v : q_rad[k]) row.push_back(fmt::format("{:.{}f}", degrees(v), decimals));
    if (!payload_kg.empty()) row.push_back(fmt::format("{:g}", payload_kg[k]));
    s.rows.push_back(row);
  }
  return s;
}

std::string doubts_section(const Page& page) {
  std::vector<std::string> doubts = page.doubts;
  for (const PagePoses& set : page.poses) {
    const ErrorPairs position = position_errors(set);
    const double before = statistics_of(position.before).mean, after = statistics_of(position.after).mean;
    if (after > 1.05 * before)
      doubts.push_back(fmt::format("{}: the errors are larger after than before (mean {} before, {} after).",
                                   set.title, length_text(before), length_text(after)));
  }
  if (doubts.empty()) return "";
  std::string out = "<section class=\"doubts\"><h2>Do not rely on this yet</h2>\n<ul>\n";
  for (const std::string& doubt : doubts) out += fmt::format("<li>{}</li>\n", escaped(doubt));
  return out + "</ul></section>\n";
}

std::string facts_list(const Page& page) {
  if (page.facts.empty()) return "";
  std::string out = "<dl class=\"facts\">\n";
  for (const PageFact& f : page.facts)
    out += fmt::format("<div><dt>{}</dt><dd>{}</dd></div>\n", escaped(f.name), escaped(f.value));
  return out + "</dl>\n";
}

std::string free_section(const PageSection& s) {
  std::string body;
  for (const std::string& text : s.paragraphs) body += paragraph(text);
  body += table(s.columns, s.rows);
  if (!s.figures.empty()) {
    body += "<div class=\"plots wide\">\n";
    for (const auto& [svg, caption] : s.figures) body += figure(svg, caption);
    body += "</div>\n";
  }
  return section(s.title, body);
}

std::string plan_sections(const PagePlan& plan) {
  const char* higher = plan.known_q_rad.empty() ? "." : "; orange, a little higher: measured already.";
  PageSection expected{"What to expect",
                       {"One standard deviation of each parameter that these poses make known, for the noise "
                        "of the robot file."},
                       {"parameter", "±", "unit"}};
  for (const auto& [name, sigma] : plan.expected)
    expected.rows.push_back({name, fmt::format("{:.2g}", sigma), unit_of_name(name)});
  return free_section(
             {.title = "The plan",
              .figures = {{plot_coverage(plan),
                           fmt::format("Where the poses lie between the limits of each joint{}", higher)},
                          {plot_progress(plan),
                           "The criterion of the best set so far, over the work done."}}}) +
         free_section(poses_table("Planned poses", plan.q_rad, plan.payload_kg, 3)) + free_section(expected);
}

std::string results_section(const Page& page) {
  if (page.results.empty()) return "";
  std::vector<Cells> rows;
  std::string remarks;
  for (const PageResult& r : page.results) {
    rows.push_back(
        {r.title, fmt::format("{}", r.poses), number_text(r.before_m * 1e3), number_text(r.after_m * 1e3)});
    if (!r.remark.empty()) remarks += paragraph(r.title + ": " + r.remark);
  }
  return section("Other data",
                 table({"data", "poses", "before, mean [mm]", "after, mean [mm]"}, rows) + remarks);
}

std::string identifiability_sections(const Page& page) {
  std::string out;
  if (!page.confounded.empty()) {
    std::string items;
    for (const PageConfounded& c : page.confounded) {
      items +=
          fmt::format("<li><code>{}</code>: {}</li>\n", escaped(c.parameter),
                      c.with.empty() ? "has no effect in these data" : "absorbed by " + code_list(c.with));
    }
    out += section(
        "Cannot be told apart",
        paragraph(
            "No data of this kind can separate these; the ones on the left were left out and the ones on "
            "the right carry them.") +
            fmt::format("<ul>\n{}</ul>", items));
  }
  if (page.missing.empty()) return out;
  out += section(
      "Missing in these data",
      fmt::format("<p>Other poses of the same kind would know them: {}.</p>\n", code_list(page.missing)));
  if (!page.cure_rad.empty())
    out += free_section(poses_table("Poses that would identify them, best first", page.cure_rad, {}, 1));
  return out;
}

std::string parameters_section(const Page& page) {
  if (page.parameters.empty()) return "";
  const auto carried_by = [&](const std::string& name) {
    std::string list;
    for (const PageConfounded& c : page.confounded) {
      for (const std::string& by : c.with)
        if (by == name) list += (list.empty() ? "" : ", ") + c.parameter;
    }
    return list;
  };
  bool carries = false, frames = false;
  std::vector<Cells> rows;
  std::vector<bool> pale;
  for (const PageParameter& p : page.parameters) {
    const auto [value, sigma] = with_uncertainty(p.value, p.sigma);
    const double times = p.sigma && *p.sigma > 0 ? std::abs(p.value) / *p.sigma : HUGE_VAL;
    pale.push_back(times < 2);
    rows.push_back({p.name, value, sigma, unit_of_name(p.name),
                    times == HUGE_VAL ? "–" : fmt::format("{:.{}f}", times, times < 100 ? 1 : 0),
                    carried_by(p.name)});
    carries = carries || !rows.back().back().empty();
    frames = frames || p.name.starts_with("frame_");
  }
  Cells columns{"parameter", "value", "±", "unit", "value / ±"};
  if (carries) {
    columns.emplace_back("carries");
  } else {
    for (Cells& row : rows) row.pop_back();
  }
  std::string about =
      "Estimates with one standard deviation. Pale: not larger than twice its own uncertainty, so it may as "
      "well "
      "be zero.";
  if (carries)
    about +=
        " What carries a parameter that cannot be told from it has the sum of both, as far as they act "
        "alike.";
  if (frames)
    about +=
        " frame_f: the base in the frame of the measurement; frame_e: the measured point in that of the "
        "tool; "
        "turns as axis times angle.";
  return section("Parameters", paragraph(about) + table(columns, rows, "parameters", pale));
}

std::string links_list(const Page& page) {
  std::string links;
  for (const PageLink& link : page.links) {
    if (!is_local(link.href)) continue;
    links += fmt::format("<li><a href=\"{}\">{}</a></li>\n", escaped(link.href), escaped(link.text));
  }
  return links.empty() ? "" : fmt::format("<nav><h2>Beside this page</h2><ul>\n{}</ul></nav>\n", links);
}

}  // namespace flexcomp::host
