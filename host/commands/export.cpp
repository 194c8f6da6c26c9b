#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "files/calibration_file.hpp"
#include "files/robot_file.hpp"
#include "files/robot_header.hpp"
#include "files/write_file.hpp"

namespace flexcomp::host {
namespace {

struct Export {
  CommonOptions common;
  std::string robot;
  std::string format;
  std::string out;

  void run() const;
};

void Export::run() const {
  const RobotFile file = load_robot(robot);
  write_file(out, robot_header(file));
  const std::string hash = hex(nominal_hash(file.nominal));
  common.say(fmt::format("{}: nominal robot {} as the C constant {}, nominal hash {}…", out, file.name,
                         c_identifier(file.name), hash.substr(0, 12)));
  common.write_json({{"robot", file.name},
                     {"format", format},
                     {"constant", c_identifier(file.name)},
                     {"nominal_hash", hash},
                     {"output", out}});
}

}  // namespace

void add_export(CLI::App& app) {
  auto options = std::make_shared<Export>();
  CLI::App* command =
      app.add_subcommand("export",
                         "The nominal robot as source text for a controller's build.\n"
                         "A parameter set is accepted only where the controller has the very geometry, to "
                         "the last bit, for which\n"
                         "the set was made. The exported header holds it so: link lengths and angles in m "
                         "and rad, limits, gravity,\n"
                         "tool and payload of the robot file. Give its constant to flexcomp_init().");
  add_robot_option(*command, options->robot);
  command
      ->add_option("--as", options->format, "Format; there is one, c: a header for flexcomp.h, for C and C++")
      ->type_name("FORMAT")
      ->required()
      ->check(CLI::IsMember({"c"}));
  command->add_option("-o,--output", options->out, "Header to write")->type_name("ROBOT.h")->required();
  options->common.add_to(*command);
  command->footer(
      "Example:\n"
      "  flexcomp export --robot tx60l.yaml --as c -o tx60l.h\n"
      "and in the controller:\n"
      "  #include \"tx60l.h\"\n"
      "  arm = flexcomp_init(&memory, sizeof memory, &staubli_tx60l, NULL, &flash);\n"
      "The constant has the robot's name; the comment in the header shows the nominal hash, of which\n"
      "\"flexcomp push\" says when a controller has another one. Export again when the robot file changes.");
  command->callback([options] { options->run(); });
}

}  // namespace flexcomp::host
