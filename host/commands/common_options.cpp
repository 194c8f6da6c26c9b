// SPDX-License-Identifier: Apache-2.0
#include "commands/common_options.hpp"

#include <fmt/format.h>

#include <cstdio>

#include "commands/colour.hpp"
#include "files/write_file.hpp"
#include "json.hpp"

namespace flexcomp::host {

void CommonOptions::add_to(CLI::App& app) {
  app.add_option("--json", json, "Write the machine-readable result to FILE")->type_name("FILE");
  app.add_flag("--quiet", quiet, "No text on standard output");
}

void CommonOptions::add_seed_to(CLI::App& app) {
  app.add_option("--seed", seed, "Seed of the random numbers; the same seed gives the same file")
      ->capture_default_str();
}

void CommonOptions::say(const std::string& text) const {
  if (!quiet) fmt::print("{}\n", text);
}

void CommonOptions::warn(const std::vector<std::string>& warnings) const {
  std::fflush(stdout);  // in one file a warning stands where it was said
  for (const std::string& w : warnings) print_message("warning:", Colour::note, w);
}

void CommonOptions::write_json(const Json& result) const {
  if (!json.empty()) write_file(json, result.dump(2) + "\n");
}

void CommonOptions::write_report(const std::string& path, const std::function<Page()>& make) const {
  if (path.empty()) return;
  write_file(path, html(make()));
  say(path + ": written");
}

void add_robot_option(CLI::App& app, std::string& path) {
  app.add_option("--robot", path, "Robot file (nominal geometry, limits, tool, payload)")
      ->type_name("ROBOT.yaml")
      ->required();
}

CLI::Option* add_force_option(CLI::App& app, bool& force) {
  return app.add_flag("--force", force,
                      "Go on where input is only suspicious (readings that look like radians)");
}

}  // namespace flexcomp::host
