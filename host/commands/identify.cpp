#include "identification/identify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "commands/accuracy.hpp"
#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "errors.hpp"
#include "files/write_file.hpp"
#include "measurement/observation.hpp"
#include "report/results.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

const std::map<std::string, ModelKind> models{{"full", ModelKind::full},
                                              {"geometric", ModelKind::geometric},
                                              {"no-gravity", ModelKind::no_gravity},
                                              {"no-stiffness", ModelKind::no_stiffness}};
const std::map<std::string, FrameChoice> frame_choices{{"nominal", FrameChoice::nominal},
                                                       {"fit", FrameChoice::fit}};

struct Identify {
  CommonOptions common;
  std::string robot;
  std::string data;
  std::string model = "full";
  std::string frames;
  std::string out;
  std::string report;
  bool force = false;
  bool plain = false;

  void run() const;
};

nlohmann::ordered_json confounded_json(const std::vector<Confounded>& list) {
  nlohmann::ordered_json j = nlohmann::ordered_json::array();
  for (const Confounded& c : list) j.push_back({{"parameter", c.parameter}, {"with", c.with}});
  return j;
}

std::string in_degrees(const std::array<double, joint_count>& q) {
  std::string text;
  for (const double v : q) text += fmt::format(" {:9.3f}", degrees(v));
  return text;
}

/// Every identified number with its standard deviation, in the units of files.
std::string parameter_table(const Identification& r, const RobotFile& robot) {
  std::string text = fmt::format("  {:<44} {:>14} {:>12}\n", "parameter", "value", "+- (1 sigma)");
  for (const Parameter& p : parameters_of(r.calibration.terms, robot.nominal)) {
    const double sigma = r.calibration.sigma[p.terms.front()] / p.si_per_file_unit();
    text += fmt::format("  {:<44} {:>14.6g} {:>12.2g}\n", p.name,
                        p.get(r.calibration.terms) / p.si_per_file_unit(), sigma);
  }
  return text;
}

void Identify::run() const {
  const RobotFile robot_file = load_robot(robot);
  const DataFile file = load_data(data, robot_file, {force});
  std::vector<std::string> warnings = file.warnings;
  const std::vector<Observation> rows = observe(file, robot_file, &warnings);
  IdentifyOptions options;
  options.model = models.at(model);
  if (!frames.empty()) options.frames = frame_choices.at(frames);
  options.force = force;
  options.seed = common.seed;
  options.estimator.robust = !plain;
  const Identification r = identify(robot_file, rows, data, options);
  if (!r.outliers.empty()) {
    std::string lines;
    const std::size_t shown = std::min<std::size_t>(r.outliers.size(), 8);
    for (std::size_t k = 0; k < shown; ++k) lines += fmt::format(" {}", rows[r.outliers[k]].line);
    warnings.push_back(fmt::format("{}: {} of {} rows lie outside the bulk and count less: lines{}{}", data,
                                   r.outliers.size(), rows.size(), lines,
                                   shown < r.outliers.size() ? " …" : ""));
  }
  common.warn(warnings);
  save_calibration(out, r.calibration, robot_file);

  common.say(fmt::format("{}: {} rows of {}; {} of {} parameters are identifiable{}", data, rows.size(),
                         robot_file.name, r.identifiable, r.parameters,
                         r.frame_parameters > 0
                             ? fmt::format(", and {} numbers of the frames", r.frame_parameters)
                             : std::string()));
  for (const Confounded& c : r.confounded) {
    std::string with;
    for (const std::string& w : c.with) with += (with.empty() ? "" : ", ") + w;
    common.say(
        fmt::format("  {} cannot be known: {}", c.parameter,
                    with.empty() ? "nothing measured here depends on it" : "it is carried by " + with));
  }
  common.say(parameter_table(r, robot_file));
  common.say(accuracy_table(r.before, r.after));
  common.say(
      fmt::format("  {} after {} steps; chi-square per degree of freedom {:.3g}; condition {:.3g}; O1 {:.3g}",
                  r.fit.converged ? "converged" : "NOT converged", r.fit.iterations, r.fit.chi2_per_dof(),
                  r.condition, r.o1));
  common.say(fmt::format("{}: written", out));

  nlohmann::ordered_json parameters = nlohmann::ordered_json::array();
  for (const Parameter& p : parameters_of(r.calibration.terms, robot_file.nominal)) {
    parameters.push_back({{"name", p.name},
                          {"value", p.get(r.calibration.terms) / p.si_per_file_unit()},
                          {"sigma", r.calibration.sigma[p.terms.front()] / p.si_per_file_unit()}});
  }
  nlohmann::ordered_json cure = nlohmann::ordered_json::array();
  for (const auto& q : r.cure) {
    nlohmann::ordered_json pose = nlohmann::ordered_json::array();
    for (const double v : q) pose.push_back(degrees(v));
    cure.push_back(pose);
  }
  std::vector<std::size_t> outlier_lines;
  for (const std::size_t k : r.outliers) outlier_lines.push_back(rows[k].line);
  common.write_json({{"parameters", r.parameters},
                     {"identifiable", r.identifiable},
                     {"confounded", confounded_json(r.confounded)},
                     {"missing", r.missing},
                     {"cure_deg", cure},
                     {"frame_parameters", r.frame_parameters},
                     {"poses", rows.size()},
                     {"condition", r.condition},
                     {"o1", r.o1},
                     {"converged", r.fit.converged},
                     {"iterations", r.fit.iterations},
                     {"newton_decrement", r.fit.newton_decrement},
                     {"chi2_per_dof", r.fit.chi2_per_dof()},
                     {"degrees_of_freedom", r.fit.degrees_of_freedom},
                     {"outlier_lines", outlier_lines},
                     {"before", to_json(r.before)},
                     {"after", to_json(r.after)},
                     {"values", parameters}});
  if (!report.empty()) {
    write_file(report, html(page_of(r, rows, robot_file, data)));
    common.say(report + ": written");
  }
  if (r.doubts.empty()) return;
  std::string message = joined(r.doubts);
  if (!r.cure.empty()) {
    message += fmt::format("\n  These {} poses (joint readings in degrees) would cure it:", r.cure.size());
    for (const auto& q : r.cure) message += "\n   " + in_degrees(q);
  }
  throw DoubtfulResult(fmt::format("{}: not trustworthy: {}", out, message));
}

}  // namespace

void add_identify(CLI::App& app) {
  auto options = std::make_shared<Identify>();
  CLI::App* command = app.add_subcommand("identify",
                                         "Parameters with uncertainty from measured poses, positions or "
                                         "reflector points");
  add_robot_option(*command, options->robot);
  command
      ->add_option("--data", options->data,
                   "Measured data: joint readings [deg] and poses, positions or reflectors [mm]")
      ->type_name("D.csv")
      ->required();
  command
      ->add_option(
          "--model", options->model,
          "full: geometry, joint compliance and link gravity (39 parameters); geometric; no-gravity; "
          "no-stiffness")
      ->check(CLI::IsMember(models))
      ->capture_default_str();
  command
      ->add_option("--frames", options->frames,
                   "nominal: the instrument measures in Fb and the tool point is known; fit: both are "
                   "fitted. Default: "
                   "fit where the nominal frames are off by more than 20 mm or 2 degrees")
      ->check(CLI::IsMember(frame_choices));
  command->add_option("-o,--output", options->out, "Calibration file")->type_name("CAL.yaml")->required();
  command->add_flag("--plain", options->plain, "Every row counts in full: no protection from outliers");
  command->add_option("--report", options->report, "Self-contained page of the result")->type_name("F.html");
  add_force_option(*command, options->force);
  options->common.add_seed_to(*command);
  options->common.add_to(*command);
  command->footer(
      "Example:\n  flexcomp identify --robot tx60l.yaml --data measured.csv -o cal.yaml\n"
      "Exit status 5: the calibration was written, but the data know less than random poses would (the "
      "message names what is missing and poses that cure it), or the fit did not converge.");
  command->callback([options] { options->run(); });
}

}  // namespace flexcomp::host
