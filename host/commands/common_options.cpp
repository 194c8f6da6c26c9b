// SPDX-License-Identifier: Apache-2.0
#include "commands/common_options.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include "commands/colour.hpp"
#include "files/write_file.hpp"
#include "json.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

namespace fs = std::filesystem;

bool same_file(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty()) return false;
  std::error_code error;
  const fs::file_status status = fs::status(a, error);
  if (fs::exists(status)) return fs::is_regular_file(status) && fs::equivalent(a, b, error) && !error;
  // What is not there yet is where it will be written.
  try {
    return written_path(a) == written_path(b);
  } catch (const std::runtime_error&) {
    return false;  // cannot be written at all, which is said when it is
  }
}

CLI::Validator number_that(const std::function<bool(double)>& fits, const std::string& expected,
                           const std::string& in_help) {
  return {[fits, expected](const std::string& text) {
            // The same reader as for files: it takes no "nan", no "inf" and nothing that overflows. Blanks stand before
            // numbers in a list, "1, 2, 3".
            const auto value = parse_si(CLI::detail::trim_copy(text), unit::si);
            return value && fits(*value) ? std::string()
                                         : fmt::format("expected {}, found '{}'", expected, text);
          },
          in_help};
}

}  // namespace

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

void refuse_same_file(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs) {
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    const NamedFile& out = outputs[k];
    for (const NamedFile& in : inputs) {
      if (same_file(out.path, in.path)) {
        throw CLI::ValidationError(
            out.option, fmt::format("{} is read as {}: give another file to write", out.path, in.option));
      }
    }
    for (std::size_t other = 0; other < k; ++other) {
      if (same_file(out.path, outputs[other].path)) {
        throw CLI::ValidationError(out.option, fmt::format("{} is written as {} already: give another file",
                                                           out.path, outputs[other].option));
      }
    }
  }
}

CLI::Validator finite_number() {
  return number_that([](double) { return true; }, "a finite number", "");
}

CLI::Validator positive_number() {
  return number_that([](double value) { return value > 0; }, "a finite number above 0", "POSITIVE");
}

CLI::Validator non_negative_number() {
  return number_that([](double value) { return value >= 0; }, "a finite number, 0 or more", "NONNEGATIVE");
}

CLI::Validator number_between(double low, double high) {
  return number_that([low, high](double value) { return value >= low && value <= high; },
                     fmt::format("a number from {:g} to {:g}", low, high),
                     fmt::format("FLOAT in [{:g} - {:g}]", low, high));
}

}  // namespace flexcomp::host
