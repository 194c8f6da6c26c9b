// The page: well-formed, self-contained, escaped, and its numbers are those that were put in.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "report/page.hpp"
#include "report/plots.hpp"
#include "report/shown_poses.hpp"
#include "report/web_bundle.hpp"
#include "report/web_data.hpp"
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
  for (const char* wanted : {"three", "uplot", "Permission is hereby granted"})
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
    EXPECT_TRUE(std::is_sorted(shown.begin(), shown.end()));
    EXPECT_EQ(std::adjacent_find(shown.begin(), shown.end()), shown.end()) << "none twice";
    std::vector<std::size_t> by_size(count);
    for (std::size_t k = 0; k < count; ++k) by_size[k] = k;
    const auto length = [&](std::size_t k) {
      return std::hypot(poses[k].after_m[0], poses[k].after_m[1], poses[k].after_m[2]);
    };
    std::sort(by_size.begin(), by_size.end(),
              [&](std::size_t a, std::size_t b) { return length(a) > length(b); });
    for (std::size_t k = 0; k < std::min<std::size_t>(count, 5); ++k)
      EXPECT_TRUE(std::binary_search(shown.begin(), shown.end(), by_size[k])) << k;
    if (count < 5000) continue;
    // Every tenth of the data has its part.
    for (std::size_t from = 0; from < count; from += count / 10) {
      const auto low = std::lower_bound(shown.begin(), shown.end(), from);
      const auto high = std::lower_bound(shown.begin(), shown.end(), from + count / 10);
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
      EXPECT_NEAR(s.at("before").at(3 * k + i).get<double>() * j.at("error_unit_mm").get<double>(),
                  set.poses[k].before_m[i] * 1e3, 1e-5);
      EXPECT_NEAR(s.at("after").at(3 * k + i).get<double>() * j.at("error_unit_mm").get<double>(),
                  set.poses[k].after_m[i] * 1e3, 1e-5);
    }
    EXPECT_NEAR(s.at("turned_after").at(k).get<double>() * j.at("angle_unit_deg").get<double>(),
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
  const std::string text = html(page, false);
  EXPECT_THAT(text,
              HasSubstr("<span class=\"before\">5.00 mm</span> → <span class=\"after\">0.0500 mm</span>"));
  EXPECT_THAT(text, HasSubstr("100.0 ×"));
  EXPECT_THAT(text, Not(HasSubstr("mean [deg]"))) << "no orientation is known";
  EXPECT_THAT(text, HasSubstr("<td>-0.08012</td><td>0.00034</td><td>deg</td><td>236</td><td></td>"));
  EXPECT_THAT(
      text,
      HasSubstr(
          "<tr class=\"pale\"><th scope=\"row\">joint_compliance[joint=2].rad_per_nm</th><td>1.5e-5</td>"
          "<td>1.3e-5</td><td>rad/(N·m)</td>"));
  EXPECT_THAT(text, HasSubstr("<code>base.z_mm</code>: carried by <code>link1.d_mm</code>"));
  // The one that carries says so in the table too.
  page.parameters.push_back({"link1.d_mm", 0.4, 0.01});
  EXPECT_THAT(
      html(page, false),
      HasSubstr("<td>0.400</td><td>0.010</td><td>mm</td><td>40.0</td><td><code>base.z_mm</code></td>"));
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
      EXPECT_EQ(unbalanced(svg), "");
      for (const double v : coordinates(svg)) {
        ASSERT_GE(v, 0) << svg;
        ASSERT_LE(v, 360) << svg;
      }
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
