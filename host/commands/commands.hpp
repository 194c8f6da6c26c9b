// SPDX-License-Identifier: Apache-2.0
/// \file
/// The commands of `flexcomp`. Each lives in commands/NAME.cpp and adds itself as a subcommand whose callback does the
/// work; what goes wrong is thrown (errors.hpp) and becomes an exit status in main.cpp.
#ifndef FLEXCOMP_HOST_COMMANDS_COMMANDS_HPP
#define FLEXCOMP_HOST_COMMANDS_COMMANDS_HPP

#include <CLI/CLI.hpp>

namespace flexcomp::host {

void add_simulate(CLI::App& app);
void add_plan(CLI::App& app);
void add_identify(CLI::App& app);
void add_validate(CLI::App& app);
void add_diagnose(CLI::App& app);
void add_predict(CLI::App& app);
void add_compensate(CLI::App& app);
void add_push(CLI::App& app);
void add_pull(CLI::App& app);
void add_status(CLI::App& app);
void add_rollback(CLI::App& app);
void add_probe(CLI::App& app);
void add_report(CLI::App& app);
void add_export(CLI::App& app);
void add_study(CLI::App& app);
void add_import(CLI::App& app);
void add_completion(CLI::App& app);

}  // namespace flexcomp::host

#endif
