// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/numbers.hpp"
#include "commands/outputs.hpp"
#include "files/calibration_file.hpp"
#include "files/csv.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "input_error.hpp"
#include "model/effects.hpp"
#include "report/page.hpp"
#include "report/parameters.hpp"
#include "report/pose_errors.hpp"
#include "units.hpp"

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
  PagePoses poses_of(const std::string& text) const;
};

/// "NAME=VALUE" at the first equals sign.
std::pair<std::string, std::string> pair_of(const std::string& text, const char* form) {
  const auto at = text.find('=');
  if (at == std::string::npos || at == 0 || at + 1 == text.size()) {
    throw InputError("command line", 0, "", form, "'" + text + "'");
  }
  return {text.substr(0, at), text.substr(at + 1)};
}

struct ErrorColumns {
  std::array<std::size_t, joint_count> q{};
  std::array<std::size_t, 3> d{};
  std::optional<std::size_t> turned;
};

ErrorColumns columns_of(const CsvTable& table) {
  ErrorColumns c;
  for (std::size_t j = 0; j < joint_count; ++j)
    c.q[j] = table.require(fmt::format("q{}_deg", j + 1), "joint readings");
  c.d[0] = table.require("dx_mm", "the position error");
  c.d[1] = table.require("dy_mm", "the position error");
  c.d[2] = table.require("dz_mm", "the position error");
  c.turned = table.find("distance_deg");
  return c;
}

PagePoses Report::poses_of(const std::string& text) const {
  const auto [name, files] = pair_of(text, errors_form);
  const auto comma = files.find(',');
  if (comma == std::string::npos)
    throw InputError("command line", 0, "--errors", errors_form, "'" + text + "'");
  const CsvTable before = read_csv(files.substr(0, comma));
  const CsvTable after = read_csv(files.substr(comma + 1));
  if (before.rows.size() != after.rows.size()) {
    throw InputError(after.path, 0, "",
                     fmt::format("as many rows as {} ({})", before.path, before.rows.size()),
                     fmt::format("{}", after.rows.size()));
  }
  const ErrorColumns b = columns_of(before), a = columns_of(after);
  PagePoses set;
  set.title = name;
  set.before = "uncorrected";
  set.after = "corrected";
  if (noise_floor_mm > 0) set.noise_floor_m = noise_floor_mm * 1e-3;
  for (std::size_t k = 0; k < before.rows.size(); ++k) {
    const CsvRow &rb = before.rows[k], &ra = after.rows[k];
    PagePose pose;
    for (std::size_t j = 0; j < joint_count; ++j) pose.q_rad[j] = before.number(rb, b.q[j], unit::degree);
    for (std::size_t i = 0; i < 3; ++i) {
      pose.before_m[i] = before.number(rb, b.d[i], unit::mm);
      pose.after_m[i] = after.number(ra, a.d[i], unit::mm);
    }
    if (b.turned && a.turned) {
      pose.before_rad = before.number(rb, *b.turned, unit::degree);
      pose.after_rad = after.number(ra, *a.turned, unit::degree);
    }
    set.poses.push_back(pose);
  }
  // Whatever of the context stands beside the joints, under the names of data files.
  static constexpr std::array<std::array<const char*, 2>, 3> recorded{
      {{"payload_kg", "payload [kg]"}, {"temp_c", "temperature [°C]"}, {"time_s", ""}}};
  for (const auto& [column, shown] : recorded) {
    const auto at = before.find(column);
    if (!at) continue;
    std::vector<double> values;
    for (const CsvRow& row : before.rows) values.push_back(before.number(row, *at, unit::si));
    set.covariates.push_back(column == std::string_view("time_s") ? time_covariate(std::move(values))
                                                                  : PageCovariate{shown, std::move(values)});
  }
  return set;
}

/// What `identify --json` and `validate --json` write.
PageResult result_of(const std::string& text) {
  const auto [name, path] = pair_of(text, result_form);
  std::ifstream file(path);
  if (!file) throw InputError(path, 0, "", "a result of --json", "no such file");
  try {
    const auto j = nlohmann::json::parse(file);
    PageResult r;
    r.title = name;
    r.poses = j.at("poses");
    const auto& before = j.at("before");
    const bool fitted = before.contains("fitted_frames");
    r.before_m = before.at(fitted ? "fitted_frames" : "nominal_frames").at("mean_mm").get<double>() * 1e-3;
    r.after_m = j.at("after").at("mean_mm").get<double>() * 1e-3;
    r.remark = fmt::format("before: nominal arm{}; chi-square per degree of freedom {:.3g}",
                           fitted ? ", frames fitted" : "", j.at("chi2_per_dof").get<double>());
    return r;
  } catch (const nlohmann::json::exception& e) {
    throw InputError(path, 0, "", "a result of identify --json or validate --json", e.what());
  }
}

void Report::run() const {
  std::vector<NamedFile> read{{"--robot", robot}, {"--calibration", calibration}};
  for (const std::string& text : errors) {
    const std::string files = pair_of(text, errors_form).second;
    const auto comma = std::min(files.find(','), files.size());
    read.push_back({"--errors", files.substr(0, comma)});
    read.push_back({"--errors", files.substr(std::min(comma + 1, files.size()))});
  }
  for (const std::string& text : results) read.push_back({"--result", pair_of(text, result_form).second});
  refuse_same_file(read, {{"-o", out}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  Page page;
  page.arm = robot_file;
  page.title = title.empty() ? "Calibration of " + robot_file.name : title;
  page.summary = summary;
  for (const std::string& text : facts) {
    const auto [name, value] = pair_of(text, "NAME=VALUE");
    page.facts.push_back({name, value});
  }
  for (const std::string& text : errors) page.poses.push_back(poses_of(text));
  for (const std::string& text : results) page.results.push_back(result_of(text));
  for (const std::string& text : links) {
    const auto [href, name] = pair_of(text, link_form);
    if (!is_local(href))
      throw InputError("command line", 0, "--link", "a page beside this one, as other.html",
                       "'" + href + "'");
    page.links.push_back({href, name});
  }
  if (!calibration.empty()) add_parameters(page, load_calibration(calibration, robot_file), robot_file);
  Calibration now;
  stamp(now, robot_file);
  page.made_by = fmt::format("flexcomp {}, {}", now.tool_version, now.date);
  const std::string text = html(page);
  write_file(out, text);
  common.say(out + ": written");
  common.write_json({{"page", out}, {"bytes", text.size()}});
}

}  // namespace

void add_report(CLI::App& app) {
  auto options = std::make_shared<Report>();
  CLI::App* command =
      app.add_subcommand("report", "One self-contained page of what is known about a calibration");
  add_robot_option(*command, options->robot);
  command->add_option("--calibration", options->calibration, "Its parameters with uncertainty")
      ->type_name("CAL.yaml");
  command
      ->add_option("--errors", options->errors,
                   "Where an arm went: two files with q1_deg … q6_deg, dx_mm dy_mm dz_mm and, where known, "
                   "distance_deg, payload_kg, temp_c, time_s; "
                   "may be given several times")
      ->type_name(errors_form)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command
      ->add_option("--result", options->results,
                   "A result of identify --json or validate --json, as a line of a table")
      ->type_name(result_form)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--link", options->links, "A page beside this one")
      ->type_name(link_form)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--fact", options->facts, "A line of the box at the top")
      ->type_name("NAME=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--title", options->title, "Heading");
  command->add_option("--summary", options->summary, "A sentence below it");
  command->add_option("--noise-floor-mm", options->noise_floor_mm, "Drawn into the plots of errors")
      ->check(non_negative_number());
  command->add_option("-o,--output", options->out, "Page to write")->type_name("F.html")->required();
  options->common.add_to(*command);
  command->footer(
      "Example:\n  flexcomp report --robot tx60l.yaml --calibration cal.yaml -o calibration.html");
  command->callback([options] { options->run(); });
}

}  // namespace flexcomp::host
