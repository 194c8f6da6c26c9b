// SPDX-License-Identifier: Apache-2.0
// The page: well-formed, self-contained, escaped, and its numbers are those that were put in.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "report/html.hpp"
#include "report/page.hpp"
#include "report/plots.hpp"
#include "report/pose_errors.hpp"
#include "report/results.hpp"
#include "report/style.hpp"
#include "report/web_bundle.hpp"
#include "report/web_data.hpp"
#include "support/robot_files.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Page example(std::size_t count) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> angle(-2, 2);
  Page page;
  page.title = "Calibration of an arm";
  PagePoses set;
  set.title = "Validation";
  set.before = "uncorrected";
  set.after = "corrected";
  set.noise_floor_m = 6e-5;
  for (std::size_t k = 0; k < count; ++k) {
    PagePose pose;
    for (double& q : pose.q_rad) q = angle(random);
    for (std::size_t i = 0; i < 3; ++i) {
      pose.before_m[i] = 1e-3 * normal(random);
      pose.after_m[i] = 2e-5 * normal(random);
    }
    pose.before_rad = 1e-3 * std::abs(normal(random));
    pose.after_rad = 1e-4 * std::abs(normal(random));
    set.poses.push_back(pose);
  }
  page.poses.push_back(set);
  page.parameters = {{"link1.theta_deg", -0.08012, 0.00034},
                     {"joint_compliance[joint=2].rad_per_nm", 1.4992e-5, 1.3e-5},
                     {"base.x_mm", 0.3, std::nullopt}};
  page.confounded = {{"base.z_mm", {"link1.d_mm"}}, {"joint_compliance[joint=1].rad_per_nm", {}}};
  page.made_by = "flexcomp";
  return page;
}

/// All of these are in a text, and none of those.
void expect_parts(const std::string& text, const std::vector<std::string>& wanted,
                  const std::vector<std::string>& never = {}) {
  for (const std::string& part : wanted) EXPECT_THAT(text, HasSubstr(part));
  for (const std::string& part : never) EXPECT_THAT(text, Not(HasSubstr(part)));
}

std::size_t occurrences(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

/// Every element that is opened is closed, in order; nothing else is asked of HTML5 that this program writes. Not by
/// std::regex, which recurses over a long path until the stack is full.
std::string unbalanced(const std::string& text) {
  std::vector<std::string> open;
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1)) {
    const bool closes = text.compare(at, 2, "</") == 0;
    const std::size_t first = at + (closes ? 2 : 1);
    const std::size_t last = text.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789", first);
    const std::size_t end = text.find('>', at);
    if (last == first || end == std::string::npos) continue;  // <!doctype, or no element
    const std::string name = text.substr(first, last - first);
    if (name == "meta" || text[end - 1] == '/') continue;
    if (!closes) {
      open.push_back(name);
    } else if (open.empty() || open.back() != name) {
      return "</" + name + "> closes " + (open.empty() ? "nothing" : open.back());
    } else {
      open.pop_back();
    }
  }
  return open.empty() ? "" : open.back() + " stays open";
}

/// The page without what stands in its script elements, of which there must be these many.
std::string without_scripts(std::string page, std::size_t scripts) {
  std::size_t found = 0;
  for (std::size_t at = page.find("<script"); at != std::string::npos; at = page.find("<script", at)) {
    const std::size_t end = page.find("</script>", at);
    if (end == std::string::npos) return "a script stays open";
    page.erase(at, end + 9 - at);
    ++found;
  }
  EXPECT_EQ(found, scripts);
  return page;
}

TEST(Report, IsWellFormedAndSelfContained) {
  for (const std::size_t count : {1U, 2U, 30U, 300U}) {
    for (const bool web : {false, true}) {
      const bool scripted = web && has_web_parts();
      const std::string page = without_scripts(html(example(count), web), scripted ? 2 : 0);
      EXPECT_EQ(unbalanced(page), "") << count << " poses";
      EXPECT_EQ(occurrences(page, "<svg "), 11U);
      for (const char* never :
           {"<script", "<link", "<img", "src=", "url(", "@import", "nan", "inf ", "-inf", "https:"}) {
        EXPECT_THAT(page, Not(HasSubstr(never))) << count << " poses";
      }
      // The only address is the name of the SVG language, which nobody fetches; and nothing may be fetched at all.
      EXPECT_EQ(occurrences(page, "http:"), occurrences(page, "http://www.w3.org/2000/svg"));
      EXPECT_THAT(page, HasSubstr("default-src 'none'"));
    }
  }
}

TEST(Report, TheScriptFitsIntoAPage) {
  if (!has_web_parts()) GTEST_SKIP() << "built with FLEXCOMP_REPORT_WEB=OFF";
  for (const char* never : {"</script", "<!--", "https://"})
    EXPECT_EQ(web_script().find(never), std::string_view::npos) << never;
  for (const char* never : {"</style", "url(", "@import"})
    EXPECT_EQ(web_style().find(never), std::string_view::npos) << never;
  // Passed on with their licences.
  for (const char* wanted : {"three", "Permission is hereby granted"})
    EXPECT_NE(web_script().substr(0, 5000).find(wanted), std::string_view::npos) << wanted;
  EXPECT_LT(web_script().size(), 800000U);
}

TEST(Report, ShownPosesAreTheLargestAndAnEvenPartOfTheRest) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> size(0, 1e-3);
  for (const std::size_t count : {0U, 1U, 99U, 100U, 101U, 5000U}) {
    std::vector<PagePose> poses(count);
    for (PagePose& p : poses) p.after_m = {size(random), -size(random), size(random)};
    const std::vector<std::size_t> shown = shown_poses(poses, 100);
    EXPECT_EQ(shown.size(), std::min<std::size_t>(count, 100));
    EXPECT_TRUE(std::ranges::is_sorted(shown));
    EXPECT_EQ(std::ranges::adjacent_find(shown), shown.end()) << "none twice";
    std::vector<std::size_t> by_size(count);
    for (std::size_t k = 0; k < count; ++k) by_size[k] = k;
    const auto length = [&](std::size_t k) {
      return std::hypot(poses[k].after_m[0], poses[k].after_m[1], poses[k].after_m[2]);
    };
    std::ranges::sort(by_size, [&](std::size_t a, std::size_t b) { return length(a) > length(b); });
    for (std::size_t k = 0; k < std::min<std::size_t>(count, 5); ++k)
      EXPECT_TRUE(std::ranges::binary_search(shown, by_size[k])) << k;
    if (count < 5000) continue;
    // Every tenth of the data has its part.
    for (std::size_t from = 0; from < count; from += count / 10) {
      const auto low = std::ranges::lower_bound(shown, from);
      const auto high = std::ranges::lower_bound(shown, from + count / 10);
      EXPECT_GE(high - low, 7) << from;
    }
  }
}

TEST(Report, StaysBelowItsSizeWhateverIsPutIn) {
  for (const bool web : {false, true}) {
    for (const std::size_t sets : {1U, 4U, 12U}) {
      Page page = example(12000);
      PagePoses& set = page.poses[0];
      for (int k = 0; k < 15; ++k) {
        PageCovariate c{"covariate " + std::to_string(k), {}};
        for (std::size_t n = 0; n < set.poses.size(); ++n)
          c.values.push_back(std::sin(static_cast<double>(n)) * 123.456789);
        c.on_paper = k < 5;
        set.covariates.push_back(c);
      }
      while (page.poses.size() < sets) page.poses.push_back(page.poses[0]);
      const std::string text = html(page, web);
      EXPECT_LT(text.size(), 1500000U) << sets << " sets";
      EXPECT_THAT(text, HasSubstr("mean position error over 12000 poses"));
    }
  }
}

TEST(Report, TheScriptGetsTheNumbersThatWerePutIn) {
  Page page = example(50);
  PagePoses& set = page.poses[0];
  set.title = "</script><!-- \"quoted\" \\ \x01 \xff";
  set.covariates = {{"time [s]", {}, true}};
  for (std::size_t k = 0; k < 50; ++k) {
    set.covariates[0].values.push_back(3600.0 * static_cast<double>(k));
    set.poses[k].line = k + 2 + (k > 40 ? 5 : 0);  // five lines without a pose
  }
  set.poses[7].outlier = true;
  MeasurementFrames frames;
  frames.f.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  frames.e.position_m = {0.01, -0.02, 0.03};
  set.frames = frames;
  const std::string text = web_data(page, 3000);
  EXPECT_EQ(text.find('<'), std::string::npos);
  const auto j = nlohmann::json::parse(text);
  const auto& s = j.at("sets").at(0);
  EXPECT_EQ(s.at("title").get<std::string>().substr(0, 22), "</script><!-- \"quoted\"");
  ASSERT_EQ(s.at("q").size(), 300U);
  for (std::size_t k = 0; k < 50; ++k) {
    for (std::size_t i = 0; i < 6; ++i) {
      EXPECT_NEAR(s.at("q").at(6 * k + i).get<double>() * j.at("joint_unit_deg").get<double>(),
                  degrees(set.poses[k].q_rad[i]), 6e-4);
    }
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(s.at("before").at(3 * k + i).get<double>() * s.at("before_unit_mm").get<double>(),
                  set.poses[k].before_m[i] * 1e3, 1e-5);
      EXPECT_NEAR(s.at("after").at(3 * k + i).get<double>() * s.at("after_unit_mm").get<double>(),
                  set.poses[k].after_m[i] * 1e3, 1e-5);
    }
    EXPECT_NEAR(s.at("turned_after").at(k).get<double>() * s.at("after_unit_deg").get<double>(),
                degrees(*set.poses[k].after_rad), 1e-6);
    EXPECT_EQ(s.at("line").at(k), set.poses[k].line);
    EXPECT_EQ(s.at("covariates").at(0).at("values").at(k).get<double>(), 3600.0 * static_cast<double>(k));
  }
  EXPECT_EQ(s.at("outlier"), nlohmann::json({7}));
  EXPECT_NEAR(s.at("floor_mm").get<double>(), 0.06, 1e-9);
  // From the frame of the measurement back to F0.
  const Eigen::Vector3d e(1, -2, 5);
  const Eigen::Vector3d back = frames.f.orientation.inverse() * e;
  for (std::size_t row = 0; row < 3; ++row) {
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i)
      sum += s.at("turn").at(row).at(i).get<double>() * e[static_cast<Eigen::Index>(i)];
    EXPECT_NEAR(sum, back[static_cast<Eigen::Index>(row)], 1e-4);
  }
  EXPECT_EQ(s.at("point"), nlohmann::json({0.01, -0.02, 0.03}));
  // Numbers that are none must not end the page.
  set.poses[0].after_m = {std::nan(""), HUGE_VAL, -HUGE_VAL};
  set.covariates[0].values[0] = std::nan("");
  EXPECT_TRUE(nlohmann::json::accept(web_data(page, 3000)));
  // A part of the poses is numbered.
  const auto part = nlohmann::json::parse(web_data(page, 20)).at("sets").at(0);
  EXPECT_EQ(part.at("number").size(), 20U);
  EXPECT_EQ(part.at("total"), 50);
}

TEST(Report, EscapesWhatPeopleAndFilesSay) {
  const std::string evil = "<script>alert('1')</script> & \"more\"";
  Page page = example(3);
  page.title = page.summary = page.made_by = evil;
  page.doubts = {evil};
  page.facts = {{evil, evil}};
  page.missing = {evil};
  page.cure_rad = {{0.1, 0.2, 0.3, 0.4, 0.5, 0.6}};
  page.results = {{evil, 3, 1e-3, 1e-4, evil}};
  page.links = {{"beside.html", evil},
                {"javascript:alert(1)", "bad"},
                {"//elsewhere", "bad"},
                {"https://elsewhere", "bad"}};
  page.poses[0].title = page.poses[0].about = page.poses[0].before = page.poses[0].after = evil;
  page.parameters[0].name = page.confounded[0].parameter = page.confounded[0].with[0] = evil;
  EXPECT_EQ(unbalanced(without_scripts(html(page), has_web_parts() ? 2 : 0)), "");
  const std::string text = html(page, false);
  EXPECT_EQ(unbalanced(text), "");
  expect_parts(text, {"&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt; &amp; &quot;more&quot;"},
               {"<script", "javascript:", "elsewhere"});
}

TEST(Report, ShowsTheNumbersThatWerePutIn) {
  Page page = example(0);
  PagePose pose;
  pose.before_m = {3e-3, 0, 4e-3};
  pose.after_m = {0, 3e-5, 4e-5};
  page.poses[0].poses = {pose};
  const std::string text = html(page, false);
  EXPECT_THAT(text,
              HasSubstr("<span class=\"before\">5.00 mm</span> → <span class=\"after\">0.0500 mm</span>"));
  EXPECT_THAT(text, HasSubstr("100.0 ×"));
  EXPECT_THAT(text, Not(HasSubstr("mean [deg]"))) << "no orientation is known";
  expect_parts(
      text, {"<td>-0.08012</td><td>0.00034</td><td class=\"text\">deg</td><td>236</td></tr>",
             "<tr class=\"pale\"><th scope=\"row\">joint_compliance[joint=2].rad_per_nm</th><td>1.5e-5</td>"
             "<td>1.3e-5</td><td class=\"text\">rad/(N·m)</td>",
             "<code>base.z_mm</code>: absorbed by <code>link1.d_mm</code>"});
  // The one that carries says so in the table too.
  page.parameters.push_back({"link1.d_mm", 0.4, 0.01});
  EXPECT_THAT(html(page, false),
              HasSubstr("<td class=\"text\">mm</td><td>40.0</td><td class=\"text\">base.z_mm</td>"));
}

TEST(Report, NothingGivenLeavesNoTrace) {
  Page page;
  page.title = "Empty";
  const std::string text = html(page);
  EXPECT_EQ(unbalanced(text), "");
  for (const char* never : {"<section", "<svg", "<table", "<dl", "<ul", "<footer"})
    EXPECT_THAT(text, Not(HasSubstr(never)));
  page.poses.emplace_back();
  EXPECT_THAT(html(page), HasSubstr("No poses."));
}

/// All coordinates of a drawing.
std::vector<double> coordinates(const std::string& svg) {
  std::vector<double> found;
  for (std::size_t at = svg.find(" d=\""); at != std::string::npos; at = svg.find(" d=\"", at)) {
    at += 4;
    const std::size_t end = svg.find('"', at);
    while ((at = svg.find_first_of("-0123456789", at)) < end) {
      std::size_t length = 0;
      found.push_back(std::stod(svg.substr(at, 24), &length));
      at += length;
    }
    at = end;
  }
  return found;
}

void expect_inside_the_frame(const std::string& svg) {
  EXPECT_EQ(unbalanced(svg), "");
  for (const double v : coordinates(svg)) {
    ASSERT_GE(v, 0) << svg;
    ASSERT_LE(v, 360) << svg;
  }
}

/// Where the dots of a drawing are: "M1 2h0", and from there "m-3-4h0".
std::vector<std::pair<double, double>> dots(const std::string& svg) {
  std::vector<std::pair<double, double>> found;
  for (std::size_t at = svg.find(" d=\""); at != std::string::npos; at = svg.find(" d=\"", at + 1)) {
    double x = 0, y = 0;
    for (std::size_t k = at + 4; svg[k] != '"'; ++k) {
      if (svg[k] != 'M' && svg[k] != 'm') continue;
      const char* text = svg.c_str() + k + 1;
      char* end = nullptr;
      const double first = std::strtod(text, &end);
      const double second = std::strtod(end, &end);
      const bool relative = svg[k] == 'm';
      x = first + (relative ? x : 0);
      y = second + (relative ? y : 0);
      if (*end == 'h') found.emplace_back(x, y);
    }
  }
  EXPECT_GT(found.size(), 100U);
  return found;
}

TEST(Report, EverythingIsDrawnInsideTheFrame) {
  // Zeros, equal numbers, six decades, an outlier: what makes axes go wrong.
  const std::vector<ErrorPairs> cases{
      {{0, 0, 0}, {0, 0, 0}, "mm", std::nullopt},
      {{1, 1, 1}, {1, 1, 1}, "mm", 0.06},
      {{1e3, 1, 5}, {1e-3, 0, 2e-3}, "mm", std::nullopt},
      {{1}, {0.5}, "mm", 7.0},
      {{1e-9, 2e-9}, {1e-12, 1e-10}, "deg", std::nullopt},
      {std::vector<double>(2000, 0.1), std::vector<double>(2000, 99.0), "mm", 0.06}};
  for (const ErrorPairs& errors : cases) {
    for (const std::string& svg : {plot_in_order(errors), plot_sorted(errors), plot_histogram(errors)}) {
      expect_inside_the_frame(svg);
      EXPECT_LT(occurrences(svg, "class=\"tick\""), 40U) << svg;
    }
  }
  for (const std::size_t count : {50U, 3000U}) {
    std::vector<PagePose> poses(count);
    std::vector<double> values(count, 7);
    EXPECT_EQ(unbalanced(plot_against(poses, values, "q1 [deg]", "joint 1")), "") << "all at the same angle";
    for (std::size_t k = 0; k < count; ++k) {
      values[k] = std::sin(static_cast<double>(k)) * 170;
      poses[k].after_m = {1e-4 * std::cos(static_cast<double>(3 * k)), 0, 1e-5};
    }
    poses[7].after_m = {1, -1, 1};
    for (const auto& [x, y] : dots(plot_against(poses, values, "q1 [deg]", "joint 1"))) {
      ASSERT_GE(x, 0);
      ASSERT_LE(x, 360);
      ASSERT_GE(y, 0);
      ASSERT_LE(y, 220);
    }
  }
}

/// A text of a drawing.
struct Text {
  std::string kind, anchor, what;
  double x = 0, y = 0;
  double width() const {  // of the page's usual font at 11 units, from above
    double count = 0;
    for (const char c : what) count += (c & 0xC0) != 0x80 ? 1 : 0;
    return 6.4 * count;
  }
  double from() const { return anchor == "middle" ? x - width() / 2 : anchor == "end" ? x - width() : x; }
};

std::vector<Text> texts(const std::string& svg) {
  std::vector<Text> found;
  const auto attribute = [](const std::string& head, const std::string& name) {
    const std::size_t at = head.find(" " + name + "=\"");
    if (at == std::string::npos) return std::string();
    const std::size_t from = at + name.size() + 3;
    return head.substr(from, head.find('"', from) - from);
  };
  for (std::size_t at = svg.find("<text"); at != std::string::npos; at = svg.find("<text", at + 1)) {
    const std::size_t end = svg.find('>', at);
    const std::string head = svg.substr(at, end - at);
    if (head.find("transform") != std::string::npos) continue;
    Text t;
    t.kind = attribute(head, "class");
    t.anchor = attribute(head, "text-anchor");
    t.x = std::stod(attribute(head, "x"));
    t.y = std::stod(attribute(head, "y"));
    t.what = svg.substr(end + 1, svg.find('<', end) - end - 1);
    found.push_back(t);
  }
  return found;
}

/// Ticks that can be read: inside the drawing, none over another or over the name of the axis, none twice.
void expect_readable(const std::string& svg) {
  std::vector<Text> along, up;
  for (const Text& t : texts(svg)) {
    EXPECT_GE(t.from(), 0) << t.what << "\n" << svg;
    EXPECT_LE(t.from() + t.width(), 360) << t.what << "\n" << svg;
    if (t.kind != "tick" || t.what == "noise") continue;
    (t.anchor == "middle" ? along : up).push_back(t);
    EXPECT_TRUE(t.anchor == "middle" || t.from() >= 16) << t.what << " lies on the name of the axis";
  }
  for (const auto* list : {&along, &up}) {
    for (std::size_t a = 0; a < list->size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        const Text &s = (*list)[a], &t = (*list)[b];
        EXPECT_NE(s.what, t.what) << svg;
        const bool beside = s.from() > t.from() + t.width() || t.from() > s.from() + s.width();
        EXPECT_TRUE(beside || std::abs(s.y - t.y) > 9) << s.what << " and " << t.what << "\n" << svg;
      }
    }
  }
}

TEST(Report, TicksCanBeReadOnAnyAxis) {
  // 40.313 … 40.314, seconds since 1970, six decades, all the same.
  for (const auto& [low, high] : std::vector<std::pair<double, double>>{{40.3131, 40.3134},
                                                                        {1763749284.0, 1763749584.0},
                                                                        {-2500, 2500},
                                                                        {1e-9, 7e-9},
                                                                        {0, 12345678},
                                                                        {-0.0213, 0.0198},
                                                                        {5, 5}}) {
    for (const bool log : {false, true}) {
      if (log && !(low > 0)) continue;
      Curves c{"Any", "x", "rms [mm]", {}, log, {{"", {{low, low}, {high, high}}, CurveStyle::line}}};
      const std::string svg = plot_curves(c);
      expect_readable(svg);
      EXPECT_GE(texts(svg).size(), 4U) << svg;
    }
    std::vector<PagePose> poses(20);
    std::vector<double> values;
    for (std::size_t k = 0; k < poses.size(); ++k) {
      values.push_back(low + (high - low) * static_cast<double>(k) / 19);
      poses[k].after_m[0] = high * 1e-3 * static_cast<double>(k);
    }
    expect_readable(plot_against(poses, values, "time [s]", "the time"));
  }
  for (const double factor : {1.0, 30.0, 1e3, 3e4, 1e6}) {
    for (const double unit : {1e-6, 0.05, 2500.0}) {
      const ErrorPairs errors{{unit * factor, unit * factor / 2}, {unit, unit * 2}, "mm", std::nullopt};
      for (const std::string& svg : {plot_in_order(errors), plot_sorted(errors), plot_histogram(errors)})
        expect_readable(svg);
    }
  }
  // The ends of a logarithmic axis are named whatever lies between.
  const ErrorPairs errors{{5, 4, 3}, {2e-4, 2e-4, 2e-4}, "mm", std::nullopt};
  std::vector<std::string> named;
  for (const Text& t : texts(plot_sorted(errors))) named.push_back(t.what);
  EXPECT_THAT(named, ::testing::IsSupersetOf({"0.0002", "5"}));
  // No half poses.
  for (const Text& t : texts(plot_histogram({{1, 2}, {1, 2}, "mm", std::nullopt}))) {
    EXPECT_TRUE(t.anchor != "end" || t.what.find('.') == std::string::npos) << t.what;
  }
}

TEST(Report, TheLegendLiesAboveTheCurves) {
  Curves c{"Six", "x", "y", {}, false, {}};
  for (int k = 0; k < 6; ++k)
    c.curves.push_back({"a curve with a rather long name, number " + std::to_string(k),
                        {{0, 1}, {1, 1.0 + k}},
                        CurveStyle::line});
  const std::string svg = plot_curves(c);
  expect_readable(svg);
  double lowest = 0, top = 1e9;
  for (const Text& t : texts(svg)) {
    if (t.kind == "entry") lowest = std::max(lowest, t.y);
    if (t.kind == "tick") top = std::min(top, t.y);
  }
  EXPECT_GT(lowest, 60);
  EXPECT_LT(lowest, top) << "the uppermost tick is at the top of the frame";
  // Each curve has its own colour and the noise its own.
  for (int k = 1; k <= 6; ++k) EXPECT_EQ(occurrences(svg, "class=\"line c" + std::to_string(k) + "\""), 2U);
  EXPECT_EQ(svg.find("floor"), std::string::npos);
}

/// Relative luminance and contrast as WCAG 2.1 has them.
double luminance(const std::string& colour) {
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double v = std::stoi(colour.substr(2 * k, 2), nullptr, 16) / 255.0;
    sum += std::array{0.2126, 0.7152, 0.0722}[k] *
           (v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
  }
  return sum;
}

TEST(Report, CurvesStandOutInEveryScheme) {
  const std::string style = page_style;
  const std::size_t dark = style.find("prefers-color-scheme: dark");
  for (const std::size_t scheme : {std::size_t{0}, dark}) {
    const auto colour = [&](const std::string& name) {
      const std::size_t at = style.find("--" + name + ": #", scheme);
      EXPECT_NE(at, std::string::npos) << name;
      return style.substr(at + name.size() + 5, 6);
    };
    const double paper = luminance(colour("paper"));
    std::vector<std::string> seen;
    for (const char* name : {"c1", "c2", "c3", "c4", "c5", "c6", "before", "after", "x", "y", "z", "floor"}) {
      const double own = luminance(colour(name));
      const double contrast = (std::max(own, paper) + 0.05) / (std::min(own, paper) + 0.05);
      EXPECT_GE(contrast, 3) << name;
      seen.push_back(colour(name));
    }
    std::ranges::sort(seen);
    EXPECT_EQ(std::ranges::adjacent_find(seen), seen.end());
  }
}

TEST(Report, OfManyPosesTheWorstAreDrawnAndTheRestIsSaid) {
  Page page = example(5000);
  page.poses[0].poses[1234].after_m = {0.5, 0, 0};
  page.poses[0].poses[4321].before_m = {0.9, 0, 0};
  ErrorPairs errors;
  for (const PagePose& p : page.poses[0].poses) {
    errors.before.push_back(std::hypot(p.before_m[0], p.before_m[1], p.before_m[2]) * 1e3);
    errors.after.push_back(std::hypot(p.after_m[0], p.after_m[1], p.after_m[2]) * 1e3);
  }
  errors.unit = "mm";
  const std::string svg = plot_in_order(errors);
  for (const char* which : {"before", "after"}) {
    const std::size_t at = svg.find(std::string("class=\"fine ") + which);
    ASSERT_NE(at, std::string::npos);
    const std::vector<std::pair<double, double>> found = dots(svg.substr(at, svg.find("/>", at) - at));
    EXPECT_EQ(found.size(), 1000U);
    std::vector<double> heights;
    heights.reserve(found.size());
    for (const auto& [x, y] : found) heights.push_back(y);
    std::ranges::sort(heights);
    EXPECT_GT(heights[1] - heights[0], 20) << which << ": the one that is far off";
  }
  const std::string text = html(page, false);
  EXPECT_THAT(text, HasSubstr("1000 of 5000 poses are drawn"));
  EXPECT_THAT(text, HasSubstr("700 of 5000 poses are drawn"));
  EXPECT_THAT(html(example(500), false), Not(HasSubstr("poses are drawn")));
}

TEST(Report, HistogramsOfTheScriptCountAllPoses) {
  Page page = example(5000);
  page.poses[0].poses[17].after_m = {};
  const auto set = nlohmann::json::parse(web_data(page, 3000)).at("sets").at(0);
  EXPECT_EQ(set.at("number").size(), 3000U);
  for (const char* kind : {"size", "x", "turned"}) {
    const auto& of = set.at("histograms").at(kind);
    for (const char* which : {"before", "after", "both", "before_log", "after_log", "both_log"}) {
      if (!of.contains(which)) {
        EXPECT_EQ(std::string(kind), "x") << "what is signed has no logarithm";
        continue;
      }
      const auto& h = of.at(which);
      const double low = h.at("low"), high = h.at("high");
      const bool both = std::string(which).starts_with("both");
      ASSERT_EQ(h.at("counts").size(), both ? 2U : 1U);
      for (std::size_t n = 0; n < h.at("counts").size(); ++n) {
        const bool after = both ? n == 1 : std::string(which).starts_with("after");
        const auto counts = h.at("counts").at(n).get<std::vector<std::size_t>>();
        std::vector<std::size_t> expected(counts.size());
        for (const PagePose& p : page.poses[0].poses) {
          const auto& e = after ? p.after_m : p.before_m;
          const double value = std::string(kind) == "size" ? 1e3 * std::hypot(e[0], e[1], e[2])
                               : std::string(kind) == "x"  ? 1e3 * e[0]
                                                           : degrees(after ? *p.after_rad : *p.before_rad);
          std::size_t k = 0;
          while (k + 1 < counts.size()) {
            const double share = static_cast<double>(k + 1) / static_cast<double>(counts.size());
            if (value < (h.at("log") ? low * std::pow(high / low, share) : low + share * (high - low))) break;
            ++k;
          }
          ++expected[k];
        }
        std::size_t moved = 0, sum = 0;
        for (std::size_t k = 0; k < counts.size(); ++k) {
          sum += counts[k];
          moved += counts[k] > expected[k] ? counts[k] - expected[k] : expected[k] - counts[k];
        }
        EXPECT_EQ(sum, 5000U) << kind << " " << which;
        EXPECT_LE(moved, 2U) << kind << " " << which << ": up to rounding at an edge";
      }
    }
    // Of what is left alone the classes are its own: more than one has poses.
    const auto alone = of.at("after").at("counts").at(0).get<std::vector<std::size_t>>();
    EXPECT_GT(std::ranges::count_if(alone, [](std::size_t n) { return n > 0; }), 8) << kind;
  }
}

TEST(Report, SmallAndFarNumbersKeepTheirDigits) {
  Page page = example(30);
  PagePoses& set = page.poses[0];
  set.covariates = {{"clock [s]", {}}};
  for (std::size_t k = 0; k < 30; ++k) {
    set.covariates[0].values.push_back(1763749284.25 + 10 * static_cast<double>(k));
    for (double& e : set.poses[k].after_m) e *= 1e-6;  // 2e-11 m
  }
  const auto s = nlohmann::json::parse(web_data(page, 3000)).at("sets").at(0);
  for (std::size_t k = 0; k < 30; ++k) {
    EXPECT_NEAR(s.at("covariates").at(0).at("values").at(k).get<double>(), set.covariates[0].values[k], 0.3);
    for (std::size_t i = 0; i < 3; ++i) {
      const double mm = s.at("after").at(3 * k + i).get<double>() * s.at("after_unit_mm").get<double>();
      EXPECT_NEAR(mm, set.poses[k].after_m[i] * 1e3, 1e-11);
    }
  }
  // Whatever it is, it is not nothing.
  const std::string text = html(page, false);
  expect_parts(text, {" nm</span>", "&gt; 1000 × smaller"}, {"0.00000"});
  set.exact = true;
  EXPECT_THAT(html(page, false), Not(HasSubstr("× smaller")));
}

TEST(Report, ErrorsThatGrowRaiseTheAlarm) {
  Page page = example(40);
  EXPECT_THAT(html(page, false), Not(HasSubstr("Do not rely")));
  for (PagePose& p : page.poses[0].poses) std::swap(p.before_m, p.after_m);
  const std::string text = html(page, false);
  expect_parts(text, {"Do not rely on this yet", "larger after than before", "× larger</td>"});
}

TEST(Report, WhatLiesFarFromTheRestIsMarked) {
  Page page = example(40);
  EXPECT_THAT(html(page, false), Not(HasSubstr("class=\"apart\"")));
  page.poses[0].poses[3].outlier = true;
  const std::string text = html(page, false);
  EXPECT_EQ(occurrences(text, "class=\"apart\""), 8U) << "in order, and against six joints and the order";
  EXPECT_THAT(text, HasSubstr("A diamond: it lies far from the rest."));
  EXPECT_THAT(text, HasSubstr("1 of 40 poses is an outlier and down-weighted: 4."));
}

TEST(Report, LinksNeverLeadIntoTheNetwork) {
  Page page = example(1);
  const std::vector<std::string> bad{"/\\evil.example",  "\\\\evil.example",     "\x01//evil.example",
                                     "/\t/evil.example", " //evil.example",      "\t//evil.example",
                                     "/evil.example",    "h\nttps:evil.example", "x\\..\\evil.example"};
  for (const std::string& href : bad) page.links.push_back({href, "bad"});
  page.links.push_back({"beside here.html#part", "good"});
  const std::string text = html(page, false);
  EXPECT_THAT(text, Not(HasSubstr("evil.example")));
  EXPECT_THAT(text, HasSubstr("href=\"beside here.html#part\""));
}

TEST(Report, TextThatIsNoUtf8IsReplaced) {
  for (const auto& [text, expected] :
       std::vector<std::pair<std::string, std::string>>{{"é€😀", "é€😀"},
                                                        {"\xff", "\uFFFD"},
                                                        {"a\xe9z", "a\uFFFDz"},
                                                        {"\xc0\xaf", "\uFFFD\uFFFD"},
                                                        {"\xed\xa0\x80", "\uFFFD\uFFFD\uFFFD"},
                                                        {"\xf4\x90\x80\x80", "\uFFFD\uFFFD\uFFFD\uFFFD"},
                                                        {"\xe2\x82", "\uFFFD\uFFFD"},
                                                        {"\xc3<", "\uFFFD&lt;"}})
    EXPECT_EQ(escaped(text), expected);
}

TEST(Report, WordsInTablesStandOnTheLeftAndMayWrap) {
  Page page;
  page.title = "Study";
  page.sections.push_back(
      {"Result",
       {},
       {"arm", "model", "score", "remark"},
       {{"TX60L", "rigid-flexible", "0.9", ""},
        {"TX60L", "geometric", "–", "off by half or more: link1.d_mm, link1.a_mm, link2.theta_deg"}},
       {}});
  const std::string text = html(page, false);
  EXPECT_THAT(text, HasSubstr("<th scope=\"col\" class=\"text\">model</th><th scope=\"col\">score</th>"));
  EXPECT_THAT(text, HasSubstr("<td>–</td><td class=\"text long\">off by"));
}

TEST(Report, WhatCarriesIsAColumnWhereSomethingListedCarries) {
  Page page = example(2);
  page.confounded = {{"base.z_mm", {"frame_f.z_mm"}}};
  EXPECT_THAT(html(page, false), Not(HasSubstr(">carries</th>")));
  page.parameters.push_back({"frame_f.z_mm", 900, 0.02});
  const std::string text = html(page, false);
  EXPECT_THAT(text, HasSubstr(">carries</th>"));
  EXPECT_THAT(text, HasSubstr("frame_f: the base"));
}

TEST(Report, FramesAreAmongTheParameters) {
  Calibration calibration;
  calibration.frames.emplace();
  calibration.frames->f.position_m = {2.1, -0.3, 0.05};
  calibration.frames->f.orientation =
      Eigen::Quaterniond(Eigen::AngleAxisd(radians(30), Eigen::Vector3d::UnitZ()));
  calibration.frames->e.position_m = {0, 0, 0.01};
  calibration.covariance.emplace();
  calibration.covariance->parameters = {"frame_f.x_mm", "frame_f.rz_deg", "frame_e.z_mm"};
  calibration.covariance->factor = Eigen::MatrixXd::Zero(3, 3);
  calibration.covariance->factor << 3e-5, 0, 0, 0, radians(0.004), 0, 3e-5, 0, 4e-5;
  Page page;
  add_parameters(page, calibration, support::tx60l());
  const auto find = [&](const std::string& name) {
    const auto at = std::ranges::find(page.parameters, name, &PageParameter::name);
    return at == page.parameters.end() ? PageParameter{"none", 0, std::nullopt} : *at;
  };
  EXPECT_NEAR(find("frame_f.x_mm").value, 2100, 1e-9);
  EXPECT_NEAR(find("frame_f.x_mm").sigma.value(), 0.03, 1e-9);
  EXPECT_NEAR(find("frame_f.rz_deg").value, 30, 1e-9);
  EXPECT_NEAR(find("frame_f.rz_deg").sigma.value(), 0.004, 1e-9);
  EXPECT_NEAR(find("frame_e.z_mm").sigma.value(), 0.05, 1e-9);
  EXPECT_EQ(find("frame_e.rz_deg").name, "none") << "was not fitted";
  calibration.covariance->own = Eigen::Vector3d(4e-5, 0, 0);
  page.parameters.clear();
  add_parameters(page, calibration, support::tx60l());
  EXPECT_NEAR(find("frame_f.x_mm").sigma.value(), 0.05, 1e-9) << "with what the factor leaves out";
}

TEST(Report, OneStepIsNoCourse) {
  Diagnosis d;
  d.error_before.rms_m = d.error_after.rms_m = 5e-5;
  d.steps = {{"the model at the start", 5e-5, 1.0, 1.1}};
  d.places = {{}, {}};
  d.places_left = d.places;
  const std::string nothing = html(page_of(d, {}, support::tx60l(), "data.csv", std::nullopt), false);
  expect_parts(nothing, {"chi-square, left-out poses"}, {"<svg", "after each step", "Blue"});
  d.error_after.rms_m = 4e-5;
  d.noise_floor_m = 1e-5;
  d.places[0].explains = 0.8;
  d.steps.push_back({"something added", 4e-5, 1.0, 1.1});
  EXPECT_EQ(occurrences(html(page_of(d, {}, support::tx60l(), "data.csv", std::nullopt), false), "<svg"), 2U);
}

TEST(Report, TheModelsSayWhatTheyWereFittedWithout) {
  const std::string words =
      "fitted anew to these rows, without the fixed parameters and tolerances of this run.";
  const Identification r;
  EXPECT_THAT(html(page_of(r, {}, support::tx60l(), "data.csv", {ModelFit{}}, true), false),
              HasSubstr(words));
  EXPECT_THAT(html(page_of(r, {}, support::tx60l(), "data.csv", {ModelFit{}}, false), false),
              Not(HasSubstr("the fixed parameters")));
}

TEST(Report, DotsShrinkWithTheirNumber) {
  for (const auto& [count, kind] : std::vector<std::pair<std::size_t, std::string>>{
           {60, "dots"}, {61, "mid"}, {200, "mid"}, {300, "mid"}, {301, "fine"}}) {
    const std::string svg =
        plot_against(example(count).poses[0].poses, std::vector<double>(count, 1), "q1 [deg]", "joint 1");
    for (const char* axis : {"x", "y", "z"})
      EXPECT_EQ(occurrences(svg, "class=\"" + kind + " " + axis + "\""), 1U) << count;
  }
}

TEST(Report, APlanIsDrawnToTheEndOfItsSearch) {
  Page page;
  page.title = "Plan";
  PagePlan& plan = page.plan.emplace();
  plan.limits_rad.fill({-1, 1});
  plan.q_rad.resize(3);
  plan.progress = {{2000, 40.3131}};
  EXPECT_EQ(occurrences(html(page, false), "<svg"), 1U) << "one dot is no course";
  plan.evaluations = 80000;
  const std::string text = html(page, false);
  ASSERT_EQ(occurrences(text, "<svg"), 2U);
  const std::string svg = text.substr(text.rfind("<svg"));
  EXPECT_THAT(svg, HasSubstr(">0</text>")) << "from the start";
  EXPECT_THAT(svg, HasSubstr(">80</text>")) << "to the end";
  expect_readable(svg.substr(0, svg.find("</svg>")));
}

TEST(Report, CurvesAndBarsAreDrawnInsideTheFrame) {
  // One value for all, zeros, a band wider than the line, noise above everything, each way to draw a curve.
  std::vector<std::string> drawings;
  for (const double level : {0.0, 1.0, -3e-9, 2e6}) {
    for (const CurveStyle style :
         {CurveStyle::usual, CurveStyle::joined, CurveStyle::line, CurveStyle::dots, CurveStyle::steps}) {
      Curves c{"A level", "x", "y", {}, false, {}};
      c.curves.push_back(
          {"level", {{0, level}, {1, level}, {2, level}}, style, "x", {{level - 2, level + 1}}});
      drawings.push_back(plot_curves(c));
      c.floor = 7.0;
      c.x_texts = {"a", "b", "c"};
      drawings.push_back(plot_curves(c));
      c.curves[0].points.resize(1);
      drawings.push_back(plot_curves(c));
    }
  }
  drawings.push_back(plot_bars({"Nothing", "mm", {}, {}, {}}));
  drawings.push_back(plot_bars({"Zeros", "mm", {"a", "b"}, {0, 0}, {0, 0}}));
  drawings.push_back(plot_bars({"A long name", "mm", {std::string(60, 'w') + "<&>", "b"}, {1e-9, 3e-9}, {}}));
  drawings.push_back(plot_bars({"Ten", "mm", std::vector<std::string>(10, "link3.theta"),
                                std::vector<double>(10, 0.8), std::vector<double>(10, 0.3)}));
  for (const std::string& svg : drawings) {
    expect_inside_the_frame(svg);
    expect_parts(svg, {}, {"nan", "inf"});
  }
  EXPECT_EQ(plot_curves({"Empty", "x", "y", {}, false, {}}), "");
  // Steps hold their value until the next: no slanting line.
  const std::string steps =
      plot_curves({"Steps", "x", "y", {}, false, {{"", {{0, 1}, {1, 2}, {3, 5}}, CurveStyle::steps}}});
  const std::size_t line = steps.find("class=\"line c1\" d=\"");
  ASSERT_NE(line, std::string::npos);
  EXPECT_EQ(occurrences(steps.substr(line, steps.find("/>", line) - line), "L"), 0U);
}

}  // namespace
}  // namespace flexcomp::host
