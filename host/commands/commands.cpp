// SPDX-License-Identifier: Apache-2.0
#include "commands/commands.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "commands/colour.hpp"
#include "commands/hints.hpp"
#include "errors.hpp"

namespace flexcomp::host {

namespace {

int status(ExitStatus s) { return static_cast<int>(s); }

/// A stream that the caller has closed is opened to nowhere: the next file would get its number, and messages in it.
void open_standard_streams() {
  for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; ++fd) {
    if (::fcntl(fd, F_GETFD) == -1 && ::open("/dev/null", O_RDWR) == -1) return;
  }
}

void give_hint(const std::string& text) {
  if (!text.empty()) print_message("hint:", Colour::note, text);
}

int give_up(ExitStatus s, const std::exception& e, const CLI::App& app) {
  std::fflush(stdout);  // in one file the message stands behind what it is about
  print_message("flexcomp:", Colour::bad, message(e));
  const std::vector<CLI::App*> commands = app.get_subcommands();
  give_hint(hint(e, commands.empty() ? "" : commands.front()->get_name()));
  return status(s);
}

/// Asking for help or the version ends here too, with 0.
int give_up(const CLI::ParseError& e, const CLI::App& app, const std::vector<std::string>& arguments) {
  if (app.get_subcommands().empty() && !arguments.empty() && !arguments.front().starts_with('-')) {
    print_message("flexcomp:", Colour::bad, fmt::format("\"{}\" is no command", arguments.front()));
  } else if (app.exit(e) == 0) {
    return status(ExitStatus::done);
  }
  give_hint(usage_hint(app, arguments));
  return status(ExitStatus::usage);
}

}  // namespace

int run(int argc, char** argv) {
  open_standard_streams();
  CLI::App app{
      "Rigid-flexible calibration of robot arms: from measured points to corrected joint commands in the "
      "controller.\n"
      "Exit status: 0 done; 1 a fault of the machine or of this program (a file that cannot be written); 2 "
      "usage; 3 input refused; 4 the bus or the device refused or did not answer; 5 done, but the "
      "result is not trustworthy, or what a controller made of a command cannot be told now.",
      "flexcomp"};
  app.set_version_flag("--version", "flexcomp " FLEXCOMP_VERSION);
  app.require_subcommand(1);
  add_simulate(app);
  add_plan(app);
  add_identify(app);
  add_validate(app);
  add_diagnose(app);
  add_predict(app);
  add_compensate(app);
  add_push(app);
  add_pull(app);
  add_status(app);
  add_rollback(app);
  add_erase(app);
  add_probe(app);
  add_report(app);
  add_export(app);
  add_study(app);
  add_import(app);
  add_keygen(app);
  add_trust(app);
  add_completion(app);
  // The help text would end in the middle of a line.
  for (CLI::App* command : app.get_subcommands({})) command->footer(command->get_footer() + "\n");
  const std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
  try {
    app.parse(argc, argv);
    return status(ExitStatus::done);
  } catch (const CLI::ParseError& e) {
    return give_up(e, app, arguments);
  } catch (const ArgumentError& e) {
    return give_up(usage_error(e), app, arguments);
  } catch (const InputError& e) {
    return give_up(ExitStatus::input_refused, e, app);
  } catch (const BusError& e) {
    return give_up(ExitStatus::bus, e, app);
  } catch (const DoubtfulResult& e) {
    return give_up(ExitStatus::not_trustworthy, e, app);
  } catch (const std::exception& e) {
    return give_up(ExitStatus::failed, e, app);
  }
}

}  // namespace flexcomp::host
