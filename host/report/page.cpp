// SPDX-License-Identifier: Apache-2.0
#include "report/page.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "report/html.hpp"
#include "report/sections.hpp"
#include "report/style.hpp"
#include "report/web_bundle.hpp"
#include "report/web_data.hpp"

namespace flexcomp::host {
namespace {

/// Drawn by the script; where there is none, a sentence stands there.
std::string arm_section(const Page& page, bool web) {
  if (!page.arm || !web) return "";
  return "<section><h2>The arm</h2>\n<div class=\"view3d\"><noscript><p>The view of the arm in 3-D needs "
         "scripts; all numbers stand below.</p></noscript></div></section>\n";
}

/// Whether the script has something to draw.
bool has_data(const Page& page) {
  return page.plan ||
         std::ranges::any_of(page.poses, [](const PagePoses& set) { return !set.poses.empty(); });
}

// Bytes, with some room for what closes the page; and poses for the script.
constexpr std::size_t largest_page = 1490000;
constexpr std::size_t most_drawn = 3000;

// Nothing is ever fetched, whatever the script does.
constexpr const char* closed =
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'\">\n";

/// The script with its data, so many poses of it as the page has room for.
std::string script(const Page& page, std::size_t taken) {
  taken += web_script().size();
  std::string data = web_data(page, most_drawn);
  for (std::size_t most = most_drawn / 2; taken + data.size() > largest_page && most > 50; most /= 2)
    data = web_data(page, most);
  return fmt::format("<script type=\"application/json\" id=\"data\">{}</script>\n<script>{}</script>\n", data,
                     web_script());
}

}  // namespace

// Browsers take a backslash for a slash, and leave control characters and a blank at the start out before they look.
bool is_local(const std::string& href) {
  return !href.empty() && href[0] != '/' && href[0] != ' ' && std::ranges::none_of(href, [](char c) {
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
  out += "</header>\n" + doubts_section(page) + facts_list(page) + arm_section(page, web);
  if (page.plan) out += plan_sections(*page.plan);
  for (const PageSection& section : page.sections) out += free_section(section);
  for (std::size_t k = 0; k < page.poses.size(); ++k)
    out += poses_section(page.poses[k], k, page.poses.size());
  for (const PageSection& section : page.further) out += free_section(section);
  out += results_section(page) + identifiability_sections(page) + parameters_section(page) + links_list(page);
  if (!page.made_by.empty()) {
    out += fmt::format("<footer>{}{}</footer>\n", escaped(page.made_by),
                       has_web_parts() ? "" : ", built without the 3-D view and the plots to choose from");
  }
  out += "</main>\n";
  if (web) out += script(page, out.size());
  return out + "</body>\n</html>\n";
}

}  // namespace flexcomp::host
