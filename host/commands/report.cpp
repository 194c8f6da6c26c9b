// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "files/calibration_file.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "input_error.hpp"
#include "json.hpp"
#include "report/results.hpp"
#include "report/stored_results.hpp"

namespace flexcomp::host {
namespace {

constexpr const char* errors_form = "TITLE=BEFORE.csv,AFTER.csv";
constexpr const char* result_form = "TITLE=RESULT.json";
constexpr const char* link_form = "HREF=TEXT";

struct Report {
  CommonOptions common;
  std::string robot;
  std::string calibration;
  std::string title;
  std::string summary;
  std::vector<std::string> errors;
  std::vector<std::string> results;
  std::vector<std::string> links;
  std::vector<std::string> facts;
  double noise_floor_mm = 0;
  std::string out;

  void run() const;
};

/// "NAME=VALUE" at the first equals sign.
std::pair<std::string, std::string> pair_of(const std::string& text, const char* form) {
  const auto at = text.find('=');
  if (at == std::string::npos || at == 0 || at + 1 == text.size()) {
    throw InputError("command line", 0, "", form, "'" + text + "'");
  }
  return {text.substr(0, at), text.substr(at + 1)};
}

/// "TITLE=BEFORE.csv,AFTER.csv"
struct ErrorFiles {
  std::string title;
  std::string before;
  std::string after;
};

ErrorFiles error_files(const std::string& text) {
  const auto [title, files] = pair_of(text, errors_form);
  const auto comma = files.find(',');
  if (comma == std::string::npos)
    throw InputError("command line", 0, "--errors", errors_form, "'" + text + "'");
  return {title, files.substr(0, comma), files.substr(comma + 1)};
}

void Report::run() const {
  std::vector<NamedFile> read{{"--robot", robot}, {"--calibration", calibration}};
  for (const std::string& text : errors) {
    const ErrorFiles files = error_files(text);
    read.push_back({"--errors", files.before});
    read.push_back({"--errors", files.after});
  }
  for (const std::string& text : results) read.push_back({"--result", pair_of(text, result_form).second});
  refuse_same_file(read, {{"-o", out}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  Page page = titled_page(title.empty() ? "Calibration of " + robot_file.name : title, robot_file);
  page.summary = summary;
  for (const std::string& text : facts) {
    const auto [name, value] = pair_of(text, "NAME=VALUE");
    page.facts.push_back({name, value});
  }
  for (const std::string& text : errors) {
    const ErrorFiles files = error_files(text);
    page.poses.push_back(
        errors_before_and_after(files.title, files.before, files.after, noise_floor_mm * 1e-3));
  }
  for (const std::string& text : results) {
    const auto [name, path] = pair_of(text, result_form);
    page.results.push_back(stored_result(name, path));
  }
  for (const std::string& text : links) {
    const auto [href, name] = pair_of(text, link_form);
    if (!is_local(href))
      throw InputError("command line", 0, "--link", "a page beside this one, as other.html",
                       "'" + href + "'");
    page.links.push_back({href, name});
  }
  if (!calibration.empty()) add_parameters(page, load_calibration(calibration, robot_file), robot_file);
  const std::string text = html(page);
  write_file(out, text);
  common.say(out + ": written");
  common.write_json({{"page", out}, {"bytes", text.size()}});
}

}  // namespace

void add_report(CLI::App& app) {
  auto [command, options] =
      add_command<Report>(app, "report", "One self-contained page of what is known about a calibration");
  add_robot_option(command, options.robot);
  add_value(command, "--calibration", options.calibration, "CAL.yaml", "Its parameters with uncertainty");
  add_value(command, "--errors", options.errors, errors_form,
            "Where an arm went: two files with q1_deg … q6_deg, dx_mm dy_mm dz_mm and, where known, "
            "distance_deg, payload_kg, temp_c, time_s; "
            "may be given several times")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  add_value(command, "--result", options.results, result_form,
            "A result of identify --json or validate --json, as a line of a table")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  add_value(command, "--link", options.links, link_form, "A page beside this one")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  add_value(command, "--fact", options.facts, "NAME=VALUE", "A line of the box at the top")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command.add_option("--title", options.title, "Heading");
  command.add_option("--summary", options.summary, "A sentence below it");
  command.add_option("--noise-floor-mm", options.noise_floor_mm, "Drawn into the plots of errors")
      ->check(non_negative_number());
  add_value(command, "-o,--output", options.out, "F.html", "Page to write")->required();
  options.common.add_to(command);
  command.footer("Example:\n  flexcomp report --robot tx60l.yaml --calibration cal.yaml -o calibration.html");
}

}  // namespace flexcomp::host
