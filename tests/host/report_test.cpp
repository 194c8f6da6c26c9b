// The page: well-formed, self-contained, escaped, and its numbers are those that were put in.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "report/page.hpp"
#include "report/plots.hpp"

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

TEST(Report, IsWellFormedAndSelfContained) {
  for (const std::size_t count : {1U, 2U, 30U, 300U}) {
    const std::string page = html(example(count));
    EXPECT_EQ(unbalanced(page), "") << count << " poses";
    EXPECT_EQ(occurrences(page, "<svg "), 10U);
    for (const char* never : {"<script", "<link", "<img", "src=", "url(", "@import", "nan", "inf ", "-inf"}) {
      EXPECT_THAT(page, Not(HasSubstr(never))) << count << " poses";
    }
    // The only address is the name of the SVG language, which nobody fetches.
    EXPECT_EQ(occurrences(page, "http"), occurrences(page, "http://www.w3.org/2000/svg"));
  }
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
  const std::string text = html(page);
  EXPECT_EQ(unbalanced(text), "");
  EXPECT_THAT(text, Not(HasSubstr("<script")));
  EXPECT_THAT(text, Not(HasSubstr("javascript:")));
  EXPECT_THAT(text, Not(HasSubstr("elsewhere")));
  EXPECT_THAT(text, HasSubstr("&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt; &amp; &quot;more&quot;"));
}

TEST(Report, ShowsTheNumbersThatWerePutIn) {
  Page page = example(0);
  PagePose pose;
  pose.before_m = {3e-3, 0, 4e-3};
  pose.after_m = {0, 3e-5, 4e-5};
  page.poses[0].poses = {pose};
  const std::string text = html(page);
  EXPECT_THAT(text,
              HasSubstr("<span class=\"before\">5.00 mm</span> → <span class=\"after\">0.0500 mm</span>"));
  EXPECT_THAT(text, HasSubstr("100.0 ×"));
  EXPECT_THAT(text, Not(HasSubstr("mean [deg]"))) << "no orientation is known";
  EXPECT_THAT(text, HasSubstr("<td>-0.08012</td><td>0.00034</td><td>deg</td><td>236</td>"));
  EXPECT_THAT(
      text,
      HasSubstr(
          "<tr class=\"pale\"><th scope=\"row\">joint_compliance[joint=2].rad_per_nm</th><td>1.5e-5</td>"
          "<td>1.3e-5</td><td>rad/(N·m)</td>"));
  EXPECT_THAT(text, HasSubstr("<code>base.z_mm</code>: carried by <code>link1.d_mm</code>"));
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
      EXPECT_EQ(unbalanced(svg), "");
      for (const double v : coordinates(svg)) {
        ASSERT_GE(v, 0) << svg;
        ASSERT_LE(v, 360) << svg;
      }
      EXPECT_LT(occurrences(svg, "class=\"tick\""), 40U) << svg;
    }
  }
  std::vector<PagePose> poses(50);
  for (const std::size_t joint : {0U, 5U}) {
    EXPECT_EQ(unbalanced(plot_against_joint(poses, joint)), "") << "all at the same angle";
    poses[7].after_m = {1, -1, 1};
    for (const double v : coordinates(plot_against_joint(poses, joint))) {
      ASSERT_GE(v, 0);
      ASSERT_LE(v, 360);
    }
  }
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
    EXPECT_EQ(unbalanced(svg), "");
    EXPECT_THAT(svg, Not(HasSubstr("nan")));
    EXPECT_THAT(svg, Not(HasSubstr("inf")));
    for (const double v : coordinates(svg)) {
      ASSERT_GE(v, 0) << svg;
      ASSERT_LE(v, 360) << svg;
    }
  }
  EXPECT_EQ(plot_curves({"Empty", "x", "y", {}, false, {}}), "");
  // Steps hold their value until the next: no slanting line.
  const std::string steps =
      plot_curves({"Steps", "x", "y", {}, false, {{"", {{0, 1}, {1, 2}, {3, 5}}, CurveStyle::steps}}});
  const std::size_t line = steps.find("class=\"line after\" d=\"");
  ASSERT_NE(line, std::string::npos);
  EXPECT_EQ(occurrences(steps.substr(line, steps.find("/>", line) - line), "L"), 0U);
}

}  // namespace
}  // namespace flexcomp::host
