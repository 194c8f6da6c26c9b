// SPDX-License-Identifier: Apache-2.0
#include "commands/hints.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "bus/controller_client.hpp"
#include "errors.hpp"
#include "nearest.hpp"

namespace flexcomp::host {

namespace {

/// The file beside the one that is not there, whose name is nearest: a slip in the name or in its ending, not in both, for
/// endings are alike anyway.
std::string nearest_file(const std::string& path) {
  namespace fs = std::filesystem;
  const fs::path wanted(path);
  const fs::path folder = wanted.has_parent_path() ? wanted.parent_path() : fs::path(".");
  std::error_code error;
  std::vector<std::string> stems;    // of files with the same ending
  std::vector<std::string> endings;  // of files with the same stem
  std::size_t seen = 0;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    if (++seen > 10000) return {};
    if (!at->is_regular_file(error)) continue;
    const fs::path& file = at->path();
    if (file.extension() == wanted.extension()) stems.push_back(file.stem().string());
    if (file.stem() == wanted.stem()) endings.push_back(file.extension().string());
  }
  std::sort(stems.begin(), stems.end());
  std::sort(endings.begin(), endings.end());
  std::string near = nearest(wanted.stem().string(), stems);
  if (!near.empty()) {
    near += wanted.extension().string();
  } else if (const std::string ending = nearest(wanted.extension().string(), endings); !ending.empty()) {
    near = wanted.stem().string() + ending;
  }
  return near.empty() ? "" : (wanted.has_parent_path() ? (wanted.parent_path() / near).string() : near);
}

/// What the terminal adds to an error by its code. "{}" stands for the library's text, which stays where there is nothing.
struct Wording {
  ErrorCode code;
  std::string_view place;  ///< option in place of the file
  std::string_view field;  ///< option in place of the field
  std::string_view expected;
  std::string_view found;
};

constexpr std::string_view which_columns = "{} (--columns says which)";
constexpr std::string_view force_goes_on = "{} --force goes on all the same";
constexpr auto wordings = std::to_array<Wording>({
    {ErrorCode::looks_like_radians, "", "", "", "{} (--force takes them as degrees)"},
    {ErrorCode::long_links, "", "",
     "{}; 'flexcomp import' of this file gives the same arm with beta_deg in their place", ""},
    {ErrorCode::unnamed_effect, "", "", "{} (--allow-unnamed pushes the others too)", ""},
    {ErrorCode::unreachable_pose, "", "", "{} (--frame says where F0 is)", ""},
    {ErrorCode::several_branches, "", "", "--start q1,…,q6, {}", ""},
    {ErrorCode::no_reflectors, "", "", "{} for --measure reflectors", ""},
    {ErrorCode::search_state, "", "", "a state that `plan --state` wrote", ""},
    {ErrorCode::too_few_poses, "", "--poses", "", ""},
    {ErrorCode::fixed_parameter, "--fix", "", "", ""},
    {ErrorCode::implausible_data, "", "", "", force_goes_on},
    {ErrorCode::distant_base, "", "", "", "{}; --frames fit lets the measurement frame lie anywhere"},
    {ErrorCode::held_out_was_fitted, "", "--holdout", "{}: held-out rows must not be those of --data", ""},
    {ErrorCode::no_result_file, "", "", "{} of identify --json or validate --json", ""},
    {ErrorCode::another_arm, "", "", "",
     "{}, or other --base and --tip (flexcomp import makes a robot file of this URDF)"},
    {ErrorCode::ambiguous_dialect, "", "", "{} (--delimiter and --decimal say which)", ""},
    {ErrorCode::ambiguous_decimal_mark, "", "", "--decimal comma, or {}", ""},
    {ErrorCode::several_orientations, "", "", "", "{} (--columns chooses)"},
    {ErrorCode::ambiguous_column, "", "", which_columns, ""},
    {ErrorCode::unknown_layout, "", "", "{} or --columns (such as name,x,y,z,sigma,-)", ""},
    {ErrorCode::no_length_unit, "", "", "{} or by --unit", ""},
    {ErrorCode::no_angle_unit, "", "", "{} or by --angle-unit", ""},
    {ErrorCode::no_angle_convention, "", "",
     "{}: --angles fixed-xyz (SpatialAnalyzer), moving-xyz (Stäubli) or rotation-vector", ""},
    {ErrorCode::log_without_joints, "", "", "{}, or --joint-columns or --map", ""},
    {ErrorCode::ambiguous_joint_column, "", "", "{} (--map or --joint-columns says which)", ""},
    {ErrorCode::ambiguous_time_column, "", "", "{} (--map says which)", ""},
    {ErrorCode::ambiguous_log_decimal_mark, "", "", "decimal: in --map, or {}", ""},
    {ErrorCode::ambiguous_name_column, "", "", "{} (name: in --map says which)", ""},
    {ErrorCode::no_joint_unit, "", "", "{} or by --joint-unit", ""},
    {ErrorCode::no_names, "", "--join name", "", "{} (--join order or time)"},
    {ErrorCode::repeated_point, "", "",
     "{} (--repeats: the pose was measured again; --names: what in the name is the pose)", ""},
    {ErrorCode::moving_arm, "", "", "{}, or a smaller --tolerance", ""},
});

/// The options behind the arguments of library calls.
constexpr std::array<std::array<std::string_view, 2>, 10> argument_options{{{"base", "--base"},
                                                                            {"tip", "--tip"},
                                                                            {"flange", "--flange"},
                                                                            {"columns", "--columns"},
                                                                            {"angles", "--angles"},
                                                                            {"angle_unit", "--angle-unit"},
                                                                            {"coverage", "--coverage"},
                                                                            {"names", "--names"},
                                                                            {"by_order", "--join order"},
                                                                            {"by_time", "--join time"}}};

std::string filled(std::string_view pattern, const std::string& text) {
  std::string out(pattern.empty() ? std::string_view("{}") : pattern);
  if (const auto at = out.find("{}"); at != std::string::npos) out.replace(at, 2, text);
  return out;
}

Wording wording_of(ErrorCode code) {
  const auto at =
      std::find_if(wordings.begin(), wordings.end(), [code](const Wording& w) { return w.code == code; });
  return at == wordings.end() ? Wording{} : *at;
}

std::string option_of(const InputError& e) {
  if (e.code() != ErrorCode::argument) return filled(wording_of(e.code()).field, e.field());
  for (const auto& [argument, option] : argument_options) {
    if (argument == e.field()) return std::string(option);
  }
  return e.field();
}

std::string of_input(const InputError& e, const std::string& command) {
  switch (e.code()) {
    case ErrorCode::no_such_file: {
      const std::string near = nearest_file(e.file());
      return near.empty() ? "" : fmt::format("there is {}", near);
    }
    case ErrorCode::missing_column:
      if (command == "import") return {};
      return "\"flexcomp import --joints LOG.csv\" makes a data file of an instrument's export and a robot's "
             "log";
    case ErrorCode::not_xml:
      if (command != "import" || e.file().ends_with(".urdf") || e.file().ends_with(".xml")) return {};
      return "an instrument's points become data with --joints LOG.csv --robot ROBOT.yaml";
    case ErrorCode::no_common_points:
      return "--names takes the points' names apart, as --names '*::{pose}_{reflector}'; --join order asks "
             "for none";
    case ErrorCode::looks_like_radians:
      return "\"flexcomp import --joint-unit rad\" reads a log in radians";
    default:
      return {};
  }
}

std::string of_bus(const BusError& e) {
  const std::string& where = e.address();
  // Who cannot be reached cannot be asked for its status either.
  const bool silent = dynamic_cast<const NoAnswer*>(&e) != nullptr || e.code() == ErrorCode::no_can_sockets ||
                      e.code() == ErrorCode::bus_not_opened;
  if (!silent) {
    return fmt::format("\"flexcomp status --of {}\" says what this controller is, holds and does", where);
  }
  if (e.code() == ErrorCode::no_can_sockets)
    return "\"modprobe can_raw\" loads the kernel's CAN, where it has one; \"hil/with-vcan COMMAND\" gives "
           "any "
           "machine a bus to try";
  if (where.starts_with("can:")) {
    return fmt::format(
        "\"ip -details link show {}\" says whether the interface is up and at which bit rate; then check the "
        "node's number, wiring and power",
        where.substr(4, where.find(':', 4) - 4));
  }
  if (where.starts_with("modbus-rtu:"))
    return "check device, baud rate, parity and unit (modbus-rtu:DEVICE:BAUD:PARITY:UNIT); --timeout waits "
           "longer";
  return "check that the controller is on and reachable, its port and unit (modbus-tcp:HOST:PORT:UNIT); "
         "--timeout waits longer";
}

}  // namespace

std::string message(const std::exception& error) {
  if (const auto* e = dynamic_cast<const InputError*>(&error)) {
    const Wording w = wording_of(e->code());
    return InputError(filled(w.place, e->file()), e->line(), option_of(*e), filled(w.expected, e->expected()),
                      filled(w.found, e->found()))
        .what();
  }
  const auto* bus = dynamic_cast<const BusError*>(&error);
  if (bus != nullptr && bus->code() == ErrorCode::unknown_robot)
    return fmt::format("{}: give its file with --robot", error.what());
  return error.what();
}

CLI::ValidationError usage_error(const ArgumentError& e) {
  return CLI::ValidationError(std::string(wording_of(e.code()).field), e.what());
}

std::string hint(const std::exception& error, const std::string& command) {
  if (const auto* input = dynamic_cast<const InputError*>(&error)) return of_input(*input, command);
  if (const auto* bus = dynamic_cast<const BusError*>(&error)) return of_bus(*bus);
  if (const auto* open = dynamic_cast<const OutcomeOpen*>(&error)) {
    const std::string& where = open->address();
    return fmt::format("\"flexcomp status --of {}\" says which set runs{}", where,
                       command == "push" ? fmt::format("; \"flexcomp push --to {} --resume\" with the same "
                                                       "file settles it",
                                                       where)
                                         : "");
  }
  const auto* doubtful = dynamic_cast<const DoubtfulResult*>(&error);
  if (doubtful != nullptr && doubtful->code() == ErrorCode::poor_fit)
    return "\"flexcomp diagnose\" with the same robot and data looks for the effect that the model lacks";
  return {};
}

std::string usage_hint(const CLI::App& app, const std::vector<std::string>& arguments) {
  std::vector<std::string> commands;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    commands.push_back(command->get_name());
  if (arguments.empty()) return "\"flexcomp --help\" lists the commands";
  const std::string& first = arguments.front();
  if (std::find(commands.begin(), commands.end(), first) == commands.end()) {
    const std::string near = first.starts_with('-') ? "" : nearest(first, commands);
    return near.empty() ? "\"flexcomp --help\" lists the commands"
                        : fmt::format("did you mean \"flexcomp {}\"?", near);
  }
  const CLI::App* const command = app.get_subcommand(first);
  std::vector<std::string> options;
  for (const CLI::Option* option : command->get_options()) {
    for (const std::string& name : option->get_lnames()) options.push_back("--" + name);
  }
  for (const std::string& argument : arguments) {
    if (!argument.starts_with("--")) continue;
    const std::string name = argument.substr(0, argument.find('='));
    if (std::find(options.begin(), options.end(), name) != options.end()) continue;
    const std::string near = nearest(name, options);
    if (!near.empty()) return fmt::format("did you mean {}?", near);
  }
  return fmt::format("\"flexcomp {} --help\" has its options and an example", first);
}

}  // namespace flexcomp::host
