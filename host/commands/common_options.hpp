// SPDX-License-Identifier: Apache-2.0
/// \file
/// What the options of commands have in common: those that every command has, checks of numbers and of files that are
/// named twice, and the two ways in which a command speaks: text for people, JSON for machines.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "json.hpp"
#include "measurement/measured_data.hpp"
#include "model/paper_model.hpp"
#include "named_values.hpp"
#include "report/page.hpp"

namespace flexcomp::host {

struct CommonOptions {
  std::string json;
  bool quiet = false;
  std::uint64_t seed = 1;

  void add_to(CLI::App& app);       ///< --json, --quiet
  void add_seed_to(CLI::App& app);  ///< --seed, wherever randomness is used

  /// A line for people on standard output, unless quiet.
  void say(const std::string& text) const;
  /// Warnings go to standard error, also when quiet: they say that something may be wrong.
  void warn(const std::vector<std::string>& warnings) const;
  /// The result as a file, where one is asked for.
  void write_json(const Json& result) const;
  /// The page that `make` gives as a file, where one is asked for, with a line that says so.
  void write_report(const std::string& path, const std::function<Page()>& make) const;
};

/// A subcommand with an Options of its own, whose run() it calls.
template <class Options>
std::pair<CLI::App&, Options&> add_command(CLI::App& app, const std::string& name, const std::string& about) {
  CLI::App* const command = app.add_subcommand(name, about);
  const auto options = std::make_shared<Options>();
  command->callback([options] { options->run(); });
  return {*command, *options};
}

/// An option whose value is called `type` in the help.
template <class Value>
CLI::Option* add_value(CLI::App& command, const std::string& name, Value& value, const std::string& type,
                       const std::string& help) {
  return command.add_option(name, value, help)->type_name(type);
}

/// --robot, required.
void add_robot_option(CLI::App& app, std::string& path);
/// --force: go on where input is only suspicious.
CLI::Option* add_force_option(CLI::App& app, bool& force);

/// A file of a run and the option that names it. An empty path is an option that was not given.
struct NamedFile {
  std::string option;
  std::string path;
};

/// Call before the first byte is written. An output that is an input as well would be taken for the input by the next run
/// (a program would be corrected twice); of two outputs in one file the last would win. The same file is told by what it is,
/// whatever it is called: other spellings, symbolic and hard links. Devices and pipes may be named twice.
/// \throws CLI::ValidationError  (usage) naming both options
void refuse_same_file(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs);

// Checks of options that are numbers with a fraction. CLI11's own let "nan" pass, for no comparison with it is true.
/// Each refuses what is no number, nan, and what is beyond a double. One of them belongs to every option that is a double.
CLI::Validator finite_number();
CLI::Validator positive_number();
CLI::Validator non_negative_number();
CLI::Validator number_between(double low, double high);

}  // namespace flexcomp::host
