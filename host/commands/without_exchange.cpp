// SPDX-License-Identifier: Apache-2.0
// What the commands are in a build without foreign formats (FLEXCOMP_EXCHANGE=OFF): import and export say so, as does
// compensate of a program.
#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "commands/commands.hpp"
#include "commands/program_targets.hpp"
#include "files/text.hpp"
#include "input_error.hpp"

namespace flexcomp::host {
namespace {

constexpr const char* absent = "not in this build, which has no foreign formats (FLEXCOMP_EXCHANGE=OFF)";

void add_absent(CLI::App& app, const char* name) {
  CLI::App* command = app.add_subcommand(name, std::string("Is ") + absent);
  command->prefix_command();
  command->callback([name] { throw CLI::ValidationError(name, std::string("is ") + absent); });
}

}  // namespace

void add_import(CLI::App& app) { add_absent(app, "import"); }
void add_export(CLI::App& app) { add_absent(app, "export"); }

void ProgramTargets::add_to(CLI::App&) {}

bool ProgramTargets::read(const std::string& path) {
  constexpr std::array<std::string_view, 6> programs{".src", ".mod", ".modx", ".prg", ".sys", ".dtx"};
  const std::string ending = lower(std::filesystem::path(path).extension().string());
  if (std::find(programs.begin(), programs.end(), ending) != programs.end())
    throw InputError(path, 0, "", "targets in a .csv",
                     std::string("a robot's program, whose reader is ") + absent);
  return false;
}

TargetsFile ProgramTargets::commands(const Robot&, bool) const { return {}; }
std::string ProgramTargets::corrected(const Robot&, const std::vector<Answer>&) const { return {}; }
const std::string& ProgramTargets::name(std::size_t) const { return format_; }

}  // namespace flexcomp::host
