// SPDX-License-Identifier: Apache-2.0
/// \file
/// The commands of `flexcomp`. Each lives in commands/NAME.cpp and adds itself as a subcommand whose callback does the
/// work; what goes wrong is thrown (errors.hpp) and becomes an exit status in run().
///
/// A command is thin: options in, one library call, then text, JSON and page out. Where the rest is:
/// - JSON of a result beside its type: MODULE/RESULT_json (planning/plan_json.hpp).
/// - Pages in report/: RESULT_page or results.hpp.
/// - Text for the terminal here: RESULT_text; only commands/ knows colours and option names.
/// - Errors of library code carry a code (error_code.hpp); hints.cpp adds the options and hints that belong to it.
#pragma once

namespace CLI {
class App;
}

namespace flexcomp::host {

/// The whole of `flexcomp`: reads the command line, runs one command and turns what was thrown into the exit status.
int run(int argc, char** argv);

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
void add_erase(CLI::App& app);
void add_keygen(CLI::App& app);
void add_trust(CLI::App& app);
void add_probe(CLI::App& app);
void add_report(CLI::App& app);
void add_export(CLI::App& app);
void add_study(CLI::App& app);
void add_import(CLI::App& app);
void add_completion(CLI::App& app);

}  // namespace flexcomp::host
