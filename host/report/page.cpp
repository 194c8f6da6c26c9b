// SPDX-License-Identifier: Apache-2.0
#include "report/page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "report/escape.hpp"
#include "report/plots.hpp"
#include "report/style.hpp"
#include "report/web_bundle.hpp"
#include "report/web_data.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

double length(const std::array<double, 3>& v) { return std::hypot(v[0], v[1], v[2]); }

struct Numbers {
  double mean = 0, rms = 0, median = 0, max = 0;
};

Numbers numbers_of(std::vector<double> values) {
  Numbers n;
  if (values.empty()) return n;
  std::sort(values.begin(), values.end());
  double squares = 0;
  for (const double v : values) {
    n.mean += v;
    squares += v * v;
  }
  const auto count = static_cast<double>(values.size());
  n.mean /= count;
  n.rms = std::sqrt(squares / count);
  n.median = 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
  n.max = values.back();
  return n;
}

/// Three significant digits and no more than five decimals; never a nought for what is none.
std::string shown(double v) {
  if (v == 0) return "0";
  if (std::abs(v) < 5e-6) return "< 0.00001";
  const int decimals = std::clamp(2 - static_cast<int>(std::floor(std::log10(std::abs(v)))), 0, 5);
  return fmt::format("{:.{}f}", v, decimals);
}

/// With the unit in which it can be read.
std::string length_text(double mm) {
  if (mm == 0 || mm >= 1e-3) return shown(mm) + " mm";
  if (mm >= 1e-6) return shown(mm * 1e3) + " µm";
  if (mm >= 1e-9) return shown(mm * 1e6) + " nm";
  return "< 0.001 nm";
}

/// \param exact  what is left has no meaning
std::string change_text(double before, double after, bool exact = false) {
  if (exact || !(before > 0) || !(after > 0)) return "–";
  const double ratio = before / after;
  const bool smaller = ratio >= 1;
  const double times = smaller ? ratio : 1 / ratio;
  const std::string text = times > 1000 ? "> 1000" : fmt::format("{:.1f}", times);
  if (text == "1.0") return "the same";
  return fmt::format("{} × {}", text, smaller ? "smaller" : "larger");
}

std::vector<std::size_t> outliers(const PagePoses& set) {
  std::vector<std::size_t> rows;
  for (std::size_t k = 0; k < set.poses.size(); ++k) {
    if (set.poses[k].outlier) rows.push_back(k);
  }
  return rows;
}

ErrorPairs positions(const PagePoses& set) {
  ErrorPairs e;
  e.unit = "mm";
  e.quantity = "position error";
  e.outliers = outliers(set);
  if (set.noise_floor_m) e.floor = *set.noise_floor_m * 1e3;
  for (const PagePose& p : set.poses) {
    e.before.push_back(length(p.before_m) * 1e3);
    e.after.push_back(length(p.after_m) * 1e3);
  }
  return e;
}

/// Empty where an orientation is not known at every pose.
ErrorPairs orientations(const PagePoses& set) {
  ErrorPairs e;
  e.unit = "deg";
  e.quantity = "orientation error";
  for (const PagePose& p : set.poses) {
    if (!p.before_rad || !p.after_rad) return {};
    e.before.push_back(degrees(*p.before_rad));
    e.after.push_back(degrees(*p.after_rad));
  }
  return e;
}

std::string figure(const std::string& svg, const std::string& caption) {
  if (svg.empty()) return "";  // nothing to draw
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", svg, caption);
}

/// Drawn anew by the script: seen on paper and where there is none.
std::string still(const std::string& drawing) {
  return fmt::format("<div class=\"still\">{}</div>\n", drawing);
}

using Cells = std::vector<std::string>;

bool is_number(const std::string& cell) {
  return cell.empty() || cell.starts_with("–") ||
         std::string_view("0123456789+-.<>").find(cell[0]) != std::string_view::npos;
}

/// A table whose first column names its rows. Numbers stand on the right of their column, words on the left, and these
/// may take several lines.
std::string table(const Cells& columns, const std::vector<Cells>& rows, const char* kind = "") {
  std::vector<const char*> form(columns.size(), "");
  for (const Cells& row : rows) {
    for (std::size_t k = 1; k < std::min(row.size(), form.size()); ++k) {
      if (!is_number(row[k]) && *form[k] == 0) form[k] = " class=\"text\"";
      if (row[k].size() > 40) form[k] = " class=\"text long\"";
    }
  }
  std::string out = fmt::format("<div class=\"scroll\"><table{}><thead><tr>", kind);
  for (std::size_t k = 0; k < columns.size(); ++k)
    out += fmt::format("<th scope=\"col\"{}>{}</th>", form[k], escaped(columns[k]));
  out += "</tr></thead><tbody>\n";
  for (const Cells& row : rows) {
    out += "<tr>";
    for (std::size_t k = 0; k < row.size(); ++k) {
      out += k == 0 ? fmt::format("<th scope=\"row\"{}>{}</th>", row[k].size() > 40 ? " class=\"long\"" : "",
                                  escaped(row[k]))
                    : fmt::format("<td{}>{}</td>", k < form.size() ? form[k] : "", escaped(row[k]));
    }
    out += "</tr>\n";
  }
  return out + "</tbody></table></div>\n";
}

/// Joint readings, a pose a row.
std::string poses_table(const std::vector<std::array<double, joint_count>>& q_rad,
                        const std::vector<double>& payload_kg, int decimals) {
  Cells columns{"pose"};
  for (std::size_t j = 0; j < joint_count; ++j) columns.push_back(fmt::format("q{} [deg]", j + 1));
  if (!payload_kg.empty()) columns.emplace_back("payload [kg]");
  std::vector<Cells> rows;
  for (std::size_t k = 0; k < q_rad.size(); ++k) {
    Cells row{fmt::format("{}", k + 1)};
    for (const double v : q_rad[k]) row.push_back(fmt::format("{:.{}f}", degrees(v), decimals));
    if (!payload_kg.empty()) row.push_back(fmt::format("{:g}", payload_kg[k]));
    rows.push_back(row);
  }
  return table(columns, rows);
}

std::string summary_table(const PagePoses& set, const ErrorPairs& position, const ErrorPairs& orientation) {
  std::vector<Cells> rows;
  const auto add = [&](const char* name, double before, double after) {
    rows.push_back({name, shown(before), shown(after), change_text(before, after, set.exact)});
  };
  const Numbers pb = numbers_of(position.before), pa = numbers_of(position.after);
  add("mean [mm]", pb.mean, pa.mean);
  add("median [mm]", pb.median, pa.median);
  add("rms [mm]", pb.rms, pa.rms);
  add("largest [mm]", pb.max, pa.max);
  if (!orientation.before.empty()) {
    const Numbers ob = numbers_of(orientation.before), oa = numbers_of(orientation.after);
    add("mean [deg]", ob.mean, oa.mean);
    add("largest [deg]", ob.max, oa.max);
  }
  std::string out = table({"error", "before", "after", "change"}, rows, " class=\"summary\"");
  if (set.exact)
    out +=
        "<p>As many numbers were fitted as were measured: the fit passes through all of them, and what is "
        "left "
        "says nothing.</p>\n";
  out += fmt::format(
      "<p class=\"key\"><span class=\"mark before\"></span> before: {} &nbsp; <span class=\"mark "
      "after\"></span> after: {}</p>\n",
      escaped(set.before), escaped(set.after));
  return out;
}

/// Where there are more poses than a drawing has room for.
std::string part_text(std::size_t drawn, std::size_t all) {
  if (drawn >= all) return "";
  return fmt::format(" {} of {} poses are drawn: the largest errors and an even part of the others.", drawn,
                     all);
}

/// What was recorded at the poses, against which the rest of the errors is drawn.
struct Covariate {
  std::string axis;
  std::string words;
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

/// \param number  of this set, for the script; what it draws instead has the class still
/// \param sets    that share the page
std::string poses_section(const PagePoses& set, std::size_t number, std::size_t sets) {
  Detail detail;
  for (std::size_t* most : {&detail.dots, &detail.dots_of_three, &detail.steps})
    *most = std::max<std::size_t>(*most / sets, 40);
  std::string out = fmt::format("<section><h2>{}</h2>\n", escaped(set.title));
  if (!set.about.empty()) out += fmt::format("<p>{}</p>\n", escaped(set.about));
  if (set.poses.empty()) return out + "<p>No poses.</p></section>\n";
  const ErrorPairs position = positions(set);
  const ErrorPairs orientation = orientations(set);
  const std::size_t count = set.poses.size();
  out += fmt::format(
      "<p class=\"headline\"><span class=\"before\">{}</span> → <span class=\"after\">{}</span> "
      "<small>mean position error over {} pose{}</small></p>\n",
      length_text(numbers_of(position.before).mean), length_text(numbers_of(position.after).mean), count,
      count == 1 ? "" : "s");
  out += summary_table(set, position, orientation);
  if (!position.outliers.empty()) {
    std::string which;
    std::size_t named = 0;
    for (const std::size_t k : position.outliers) {
      if (named < 12) which += fmt::format("{}{}", named++ > 0 ? ", " : "", k + 1);
    }
    const std::size_t apart = position.outliers.size();
    out += fmt::format("<p>{} of {} poses {} far from the rest and {} not count in full: {}{}.</p>\n", apart,
                       count, apart == 1 ? "lies" : "lie", apart == 1 ? "does" : "do", which,
                       apart > named ? ", …" : "");
  }
  const char* marked = position.outliers.empty() ? "" : " A diamond: it lies far from the rest.";
  out += fmt::format("<div class=\"explore\" data-set=\"{}\"></div>\n<div class=\"plots wide\">\n", number);
  out += still(figure(plot_in_order(position, detail),
                      fmt::format("Position error of each pose, in the order of the data.{}{}", marked,
                                  part_text(std::min(count, detail.dots), count))));
  out += figure(plot_sorted(position, detail),
                "Position error, sorted: the share of the poses whose error lies below a value.");
  out += still(figure(plot_histogram(position), "How many poses have which position error."));
  if (!orientation.before.empty()) {
    out += figure(plot_sorted(orientation, detail), "Orientation error, sorted.");
  }
  out += fmt::format(
      "</div>\n<div class=\"still\"><h3>What is left, against each joint and whatever else was "
      "recorded</h3>\n"
      "<p>The three components of the position error after: "
      "<span class=\"mark x\"></span> x, <span class=\"mark y\"></span> y, <span class=\"mark z\"></span> z. "
      "Noise has no shape here; a curve or a slope is an effect that the model does not have. Poses far off "
      "the others are drawn at the edge.{}{}</p>\n<div class=\"plots\">\n",
      marked, part_text(std::min(count, detail.dots_of_three), count));
  for (const Covariate& c : covariates(set)) {
    out += figure(plot_against(set.poses, c.values, c.axis, c.words, detail),
                  fmt::format("Against {}.", escaped(c.words)));
  }
  return out + "</div></div></section>\n";
}

/// The unit that a parameter's name ends with, for people.
std::string unit_of_name(std::string_view name) {
  static constexpr std::array<std::pair<std::string_view, const char*>, 10> units{
      {{"rad_per_nm3", "rad/(N·m)³"},
       {"rad_per_nm", "rad/(N·m)"},
       {"mm_per_h", "mm/h"},
       {"deg_per_h", "deg/h"},
       {"per_k", "1/K"},
       {"_kg", "kg"},
       {"_mm", "mm"},
       {"_deg", "deg"},
       {"rad", "rad"},
       {"gain", ""}}};
  for (const auto& [suffix, text] : units) {
    if (name.ends_with(suffix)) return text;
  }
  return "";
}

/// A value to the second digit of its uncertainty; small numbers with a power of ten.
std::pair<std::string, std::string> with_uncertainty(double value, const std::optional<double>& sigma) {
  const double size = std::max(std::abs(value), sigma.value_or(0));
  if (size == 0) return {"0", sigma ? "0" : "–"};
  const bool small = size < 1e-3;
  const int exponent = small ? static_cast<int>(std::floor(std::log10(size))) : 0;
  const double unit = std::pow(10, exponent);
  const double least = sigma && *sigma > 0 ? *sigma / unit : std::abs(value) / unit * 1e-3;
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(least))), 0, 7);
  const auto text = [&](double v) {
    std::string t = fmt::format("{:.{}f}", v / unit, decimals);
    if (small) t += fmt::format("e{}", exponent);
    return t;
  };
  return {text(value), sigma ? text(*sigma) : "–"};
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) {
    out += fmt::format("{}<code>{}</code>", out.empty() ? "" : ", ", escaped(name));
  }
  return out;
}

std::string parameter_table(const Page& page) {
  if (page.parameters.empty()) return "";
  std::map<std::string, std::vector<std::string>> carried;
  for (const PageConfounded& c : page.confounded) {
    for (const std::string& by : c.with) {
      // A column for those alone that the table has.
      if (std::any_of(page.parameters.begin(), page.parameters.end(),
                      [&](const PageParameter& p) { return p.name == by; }))
        carried[by].push_back(c.parameter);
    }
  }
  const bool frames = std::any_of(page.parameters.begin(), page.parameters.end(),
                                  [](const PageParameter& p) { return p.name.starts_with("frame_"); });
  std::string out = fmt::format(
      "<section><h2>Parameters</h2>\n<p>Estimates with one standard deviation. Pale: not larger than twice "
      "its own "
      "uncertainty, so it may as well be zero.{}{}</p>\n<div class=\"scroll\"><table "
      "class=\"parameters\"><thead><tr>"
      "<th scope=\"col\">parameter</th><th scope=\"col\">value</th><th scope=\"col\">±</th><th "
      "scope=\"col\">unit</th>"
      "<th scope=\"col\">value / ±</th>{}</tr></thead><tbody>\n",
      carried.empty() ? ""
                      : " What carries a parameter that cannot be told from it has the sum of both, as "
                        "far as they act alike.",
      frames
          ? " frame_f: the base in the frame of the measurement; frame_e: the measured point in that of the "
            "tool; turns as axis times angle."
          : "",
      carried.empty() ? "" : "<th scope=\"col\">carries</th>");
  for (const PageParameter& p : page.parameters) {
    const auto [value, sigma] = with_uncertainty(p.value, p.sigma);
    std::string ratio = "–";
    bool pale = false;
    if (p.sigma && *p.sigma > 0) {
      const double times = std::abs(p.value) / *p.sigma;
      pale = times < 2;
      ratio = times < 100 ? fmt::format("{:.1f}", times) : fmt::format("{:.0f}", times);
    }
    const auto also = carried.find(p.name);
    out += fmt::format(
        "<tr{}><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td>{}</tr>\n",
        pale ? " class=\"pale\"" : "", escaped(p.name), value, sigma, unit_of_name(p.name), ratio,
        carried.empty()
            ? ""
            : fmt::format("<td>{}</td>", also == carried.end() ? std::string() : joined(also->second)));
  }
  return out + "</tbody></table></div></section>\n";
}

std::string limits_of_the_data(const Page& page) {
  std::string out;
  if (!page.confounded.empty()) {
    out +=
        "<section><h2>Cannot be told apart</h2>\n<p>No data of this kind can separate these; the ones on the "
        "left were "
        "left out and the ones on the right carry them.</p>\n<ul>\n";
    for (const PageConfounded& c : page.confounded) {
      out += c.with.empty() ? fmt::format("<li><code>{}</code>: has no effect in these data</li>\n",
                                          escaped(c.parameter))
                            : fmt::format("<li><code>{}</code>: carried by {}</li>\n", escaped(c.parameter),
                                          joined(c.with));
    }
    out += "</ul></section>\n";
  }
  if (!page.missing.empty()) {
    out += fmt::format(
        "<section><h2>Missing in these data</h2>\n<p>Other poses of the same kind would know them: {}.</p>\n",
        joined(page.missing));
    if (!page.cure_rad.empty()) {
      out += "<p>Poses that would identify them, best first:</p>" + poses_table(page.cure_rad, {}, 1);
    }
    out += "</section>\n";
  }
  return out;
}

std::string results_table(const Page& page) {
  if (page.results.empty()) return "";
  std::vector<Cells> rows;
  std::string remarks;
  for (const PageResult& r : page.results) {
    rows.push_back({r.title, fmt::format("{}", r.poses), shown(r.before_m * 1e3), shown(r.after_m * 1e3)});
    if (!r.remark.empty()) remarks += fmt::format("<p>{}: {}</p>\n", escaped(r.title), escaped(r.remark));
  }
  return "<section><h2>Other data</h2>\n" +
         table({"data", "poses", "before, mean [mm]", "after, mean [mm]"}, rows) + remarks + "</section>\n";
}

std::string free_section(const PageSection& section) {
  std::string out = fmt::format("<section><h2>{}</h2>\n", escaped(section.title));
  for (const std::string& text : section.paragraphs) out += fmt::format("<p>{}</p>\n", escaped(text));
  if (!section.columns.empty()) out += table(section.columns, section.rows);
  if (!section.figures.empty()) {
    out += "<div class=\"plots wide\">\n";
    for (const auto& [svg, caption] : section.figures) out += figure(svg, escaped(caption));
    out += "</div>\n";
  }
  return out + "</section>\n";
}

std::string plan_section(const PagePlan& plan) {
  std::string out = "<section><h2>The plan</h2>\n<div class=\"plots wide\">\n";
  out += figure(plot_coverage(plan),
                plan.known_q_rad.empty()
                    ? "Where the poses lie between the limits of each joint."
                    : "Where the poses lie between the limits of each joint; orange, a little "
                      "higher: measured already.");
  Curves progress{"Criterion of the best set of poses over the work done",
                  "thousand evaluations",
                  "criterion",
                  {},
                  false,
                  {{"", {}, CurveStyle::steps, "", {}}}};
  for (const auto& [work, value] : plan.progress) progress.curves[0].points.push_back({work / 1e3, value});
  progress.x_from_zero = true;
  auto& points = progress.curves[0].points;
  // What was found last held until the end.
  if (!points.empty() && plan.evaluations / 1e3 > points.back()[0])
    points.push_back({plan.evaluations / 1e3, points.back()[1]});
  if (points.size() > 1)
    out += figure(plot_curves(progress), "The criterion of the best set so far, over the work done.");
  out += "</div>\n" + poses_table(plan.q_rad, plan.payload_kg, 3);
  out +=
      "</section>\n<section><h2>What to expect</h2>\n<p>One standard deviation of each parameter that these "
      "poses make known, for the noise of the robot file.</p>\n";
  std::vector<Cells> rows;
  for (const auto& [name, sigma] : plan.expected)
    rows.push_back({name, fmt::format("{:.2g}", sigma), unit_of_name(name)});
  return out + table({"parameter", "±", "unit"}, rows, " class=\"parameters\"") + "</section>\n";
}

/// What is wrong with a result that the numbers themselves say.
std::vector<std::string> doubts_of(const Page& page) {
  std::vector<std::string> doubts = page.doubts;
  for (const PagePoses& set : page.poses) {
    const ErrorPairs position = positions(set);
    const double before = numbers_of(position.before).mean, after = numbers_of(position.after).mean;
    if (after > 1.05 * before)
      doubts.push_back(fmt::format("{}: the errors are larger after than before (mean {} before, {} after).",
                                   set.title, length_text(before), length_text(after)));
  }
  return doubts;
}

/// Drawn by the script; where there is none, a sentence stands there.
std::string arm_section(const Page& page, bool web) {
  if (!page.arm || !web) return "";
  return "<section><h2>The arm</h2>\n<div class=\"view3d\"><noscript><p>The view of the arm in 3-D needs "
         "scripts; all numbers stand below.</p></noscript></div></section>\n";
}

/// Whether the script has something to draw.
bool has_data(const Page& page) {
  return page.plan || std::any_of(page.poses.begin(), page.poses.end(),
                                  [](const PagePoses& set) { return !set.poses.empty(); });
}

// Bytes, with some room for what closes the page; and poses for the script.
constexpr std::size_t largest_page = 1490000;
constexpr std::size_t most_drawn = 3000;

// Nothing is ever fetched, whatever the script does.
constexpr const char* closed =
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'\">\n";

}  // namespace

// Browsers take a backslash for a slash, and leave control characters and a blank at the start out before they look.
bool is_local(const std::string& href) {
  return !href.empty() && href[0] != '/' && href[0] != ' ' &&
         std::none_of(href.begin(), href.end(), [](char c) {
           return c == ':' || c == '\\' || static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
         });
}

bool has_web_parts() { return !web_script().empty(); }

std::string html(const Page& page, bool web) {
  web = web && has_web_parts() && has_data(page);
  std::string out = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{2}"
      "<meta name=\"viewport\" content=\"width=device-width, "
      "initial-scale=1\">\n<title>{0}</title>\n<style>\n{1}{3}</style>\n"
      "</head>\n<body>\n<main>\n<header><h1>{0}</h1>\n",
      escaped(page.title), page_style, closed, web ? web_style() : "");
  if (!page.summary.empty()) out += fmt::format("<p class=\"lead\">{}</p>\n", escaped(page.summary));
  out += "</header>\n";
  if (const std::vector<std::string> doubts = doubts_of(page); !doubts.empty()) {
    out += "<section class=\"doubts\"><h2>Do not rely on this yet</h2>\n<ul>\n";
    for (const std::string& doubt : doubts) out += fmt::format("<li>{}</li>\n", escaped(doubt));
    out += "</ul></section>\n";
  }
  if (!page.facts.empty()) {
    out += "<dl class=\"facts\">\n";
    for (const PageFact& f : page.facts) {
      out += fmt::format("<div><dt>{}</dt><dd>{}</dd></div>\n", escaped(f.name), escaped(f.value));
    }
    out += "</dl>\n";
  }
  out += arm_section(page, web);
  if (page.plan) out += plan_section(*page.plan);
  for (const PageSection& section : page.sections) out += free_section(section);
  for (std::size_t k = 0; k < page.poses.size(); ++k)
    out += poses_section(page.poses[k], k, page.poses.size());
  for (const PageSection& section : page.further) out += free_section(section);
  out += results_table(page);
  out += limits_of_the_data(page);
  out += parameter_table(page);
  std::string links;
  for (const PageLink& link : page.links) {
    if (is_local(link.href)) {
      links += fmt::format("<li><a href=\"{}\">{}</a></li>\n", escaped(link.href), escaped(link.text));
    }
  }
  if (!links.empty()) out += fmt::format("<nav><h2>Beside this page</h2><ul>\n{}</ul></nav>\n", links);
  if (!page.made_by.empty()) {
    out += fmt::format("<footer>{}{}</footer>\n", escaped(page.made_by),
                       has_web_parts() ? "" : ", built without the 3-D view and the plots to choose from");
  }
  out += "</main>\n";
  if (web) {
    const std::size_t taken = out.size() + web_script().size();
    std::string data = web_data(page, most_drawn);
    for (std::size_t most = most_drawn / 2; taken + data.size() > largest_page && most > 50; most /= 2)
      data = web_data(page, most);
    out += "<script type=\"application/json\" id=\"data\">" + data + "</script>\n<script>";
    out += web_script();
    out += "</script>\n";
  }
  return out + "</body>\n</html>\n";
}

}  // namespace flexcomp::host
