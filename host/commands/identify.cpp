// SPDX-License-Identifier: Apache-2.0
#include "identification/identify.hpp"
#include "commands/outputs.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "commands/accuracy.hpp"
#include "commands/colour.hpp"
#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "errors.hpp"
#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "files/tolerance_file.hpp"
#include "files/write_file.hpp"
#include "measurement/observation.hpp"
#include "report/results.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

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
  std::vector<std::string> fix;
  std::string tolerances;
  bool force = false;
  bool plain = false;
  bool unbounded = false;

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

/// `NAME` or `NAME=VALUE`, the value in the unit that the name ends with.
FixedParameter fixed_parameter(const std::string& text, const Robot& robot) {
  const std::size_t equals = text.rfind('=');
  // joint_compliance[joint=2].rad_per_nm has an equals sign of its own.
  const bool has_value = equals != std::string::npos && text.find(']', equals) == std::string::npos;
  FixedParameter fixed{has_value ? text.substr(0, equals) : text, 0};
  if (!has_value) return fixed;
  for (const Parameter& p : paper_model(robot.nominal, ModelKind::full, true).parameters) {
    if (p.name != fixed.name) continue;
    const auto value = parse_si(text.substr(equals + 1), p.unit);
    if (!value) throw InputError("--fix", 0, fixed.name, "a number", "'" + text.substr(equals + 1) + "'");
    fixed.value_si = *value;
  }
  return fixed;  // identify() refuses a name that the model does not have
}

/// What is said of one fitted parameter, in the unit of files.
struct Row {
  std::string name;
  double value = 0;
  double sigma = 0;
  double low = 0;
  double high = 0;
  bool at_bound = false;
  /// Different from the nominal arm beyond chance: zero lies outside the 95 % interval.
  bool significant() const { return low > 0 || high < 0; }
};

std::vector<Row> rows_of(const Identification& r) {
  std::vector<Row> rows;
  const Unknowns& fitted = r.identifiability.fitted;
  const Eigen::VectorXd units = units_of(fitted, r.fit.estimate.set);
  for (std::size_t p = 0; p < fitted.parameters.size(); ++p) {
    const Parameter& parameter = fitted.parameters[p];
    const double unit = parameter.si_per_file_unit();
    const Eigen::Index i = static_cast<Eigen::Index>(fitted.frames.size() + p);
    rows.push_back({parameter.name, parameter.get(r.fit.estimate.set) / unit,
                    std::sqrt(std::max(0.0, r.fit.covariance(i, i))) * units[i] / unit,
                    r.fit.interval[p].low / unit, r.fit.interval[p].high / unit, r.fit.at_bound[p]});
  }
  return rows;
}

/// Every identified number with its standard deviation and interval, in the units of files.
std::string parameter_table(const std::vector<Row>& rows) {
  std::string text = painted(fmt::format("  {:<44} {:>14} {:>12}  {}", "parameter", "value", "+- (1 sigma)",
                                         "95 % interval"),
                             Colour::head, STDOUT_FILENO) +
                     "\n";
  for (const Row& row : rows) {
    text += fmt::format("  {:<44} {:>14.6g} {:>12.2g}  {:.4g} … {:.4g}{}\n", row.name, row.value, row.sigma,
                        row.low, row.high,
                        row.at_bound        ? "  (one-sided: at its bound)"
                        : row.significant() ? ""
                                            : "  (may be none)");
  }
  return text;
}

std::string payload_advice(const std::vector<PayloadGain>& gains, const TermSet& set,
                           const std::vector<Parameter>& parameters) {
  std::string text =
      "  All rows have one payload. Measuring every second pose without it would make known better:";
  for (const PayloadGain& gain : gains) {
    const auto p = std::find_if(parameters.begin(), parameters.end(),
                                [&](const Parameter& q) { return q.name == gain.parameter; });
    const double unit = p->si_per_file_unit();
    text += fmt::format("\n    {:<44} +- {:.2g} instead of {:.2g} (value {:.2g})", gain.parameter,
                        gain.sigma_with_both / unit, gain.sigma / unit, p->get(set) / unit);
  }
  return text;
}

std::string repeats_text(const PureError& e) {
  std::string text = fmt::format(
      "  {} rows repeat {} poses: they scatter by {:.4f} mm per axis (95 %: {:.4f} … {:.4f})", e.rows,
      e.groups, e.sigma_position_m * 1e3, e.position_interval_m.low * 1e3, e.position_interval_m.high * 1e3);
  if (e.sigma_orientation_rad > 0) text += fmt::format(" and {:.4f} deg", degrees(e.sigma_orientation_rad));
  text += fmt::format(", {:.3g} times the declared noise", std::sqrt(e.chi2_per_dof_whitened));
  if (e.lack_of_fit_p) {
    // Two repeats never show much: that they show nothing does not mean that there is nothing.
    text += fmt::format("; {} (lack of fit p = {:.2g})",
                        *e.lack_of_fit_p < 0.01 ? "the model misses more than that"
                                                : "they do not show that the model misses more",
                        *e.lack_of_fit_p);
  }
  return text;
}

nlohmann::ordered_json repeats_json(const std::optional<PureError>& e) {
  if (!e) return nullptr;
  const auto or_null = [](const std::optional<double>& v) {
    return v ? nlohmann::ordered_json(*v) : nlohmann::ordered_json();
  };
  return {{"groups", e->groups},
          {"rows", e->rows},
          {"sigma_mm", e->sigma_position_m * 1e3},
          {"sigma_mm_interval95", {e->position_interval_m.low * 1e3, e->position_interval_m.high * 1e3}},
          {"sigma_deg", degrees(e->sigma_orientation_rad)},
          {"chi2_per_dof", e->chi2_per_dof_whitened},
          {"lack_of_fit_f", or_null(e->lack_of_fit_f)},
          {"lack_of_fit_p", or_null(e->lack_of_fit_p)}};
}

void Identify::run() const {
  refuse_same_file({{"--robot", robot}, {"--data", data}, {"--tolerances", tolerances}},
                   {{"-o", out}, {"--report", report}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  const MeasuredData file = load_data(data, robot_file, {force});
  std::vector<std::string> warnings = file.warnings;
  const std::vector<Observation> rows = observe(file, robot_file, &warnings);
  IdentifyOptions options;
  options.model = model_kinds.at(model);
  if (!frames.empty()) options.frames = frame_choices.at(frames);
  options.force = force;
  options.seed = common.seed;
  options.estimator.robust = !plain;
  options.physical = !unbounded;
  for (const std::string& text : fix) options.fixed.push_back(fixed_parameter(text, robot_file));
  if (!tolerances.empty()) options.tolerances = load_tolerances(tolerances);
  const Identification r = identify(robot_file, rows, data, options);
  add_outlier_warning(warnings, data, rows, r.outliers);
  common.warn(warnings);
  save_calibration(out, r.calibration, robot_file);

  common.say(fmt::format(
      "{}: {} rows of {}; {} of {} parameters are identifiable{}", data, rows.size(), robot_file.name,
      r.identifiable, r.parameters,
      r.frame_parameters > 0 ? fmt::format(", and {} frame parameters", r.frame_parameters) : std::string()));
  for (const Confounded& c : r.identifiability.confounded) {
    std::string with;
    for (const std::string& w : c.with) with += (with.empty() ? "" : ", ") + w;
    common.say(fmt::format("  {} not identifiable: {}", c.parameter,
                           with.empty() ? "nothing measured here depends on it" : "absorbed by " + with));
  }
  const std::vector<Row> table = rows_of(r);
  common.say(parameter_table(table));
  common.say(accuracy_table(r.before, r.after));
  common.say(
      fmt::format("  {} after {} steps; chi-square per degree of freedom {:.3g}; condition {:.3g}; O1 {:.3g}",
                  r.fit.converged ? "converged" : "NOT converged", r.fit.iterations, r.fit.chi2_per_dof(),
                  r.condition, r.o1));
  common.say(fmt::format("{}: written", out));

  if (r.pure_error) common.say(repeats_text(*r.pure_error));
  if (!r.identifiability.payload_gains.empty())
    common.say(payload_advice(r.identifiability.payload_gains, r.fit.estimate.set,
                              r.identifiability.fitted.parameters));

  nlohmann::ordered_json parameters = nlohmann::ordered_json::array();
  for (const Row& row : table) {
    parameters.push_back({{"name", row.name},
                          {"value", row.value},
                          {"sigma", row.sigma},
                          {"interval95", {row.low, row.high}},
                          {"at_bound", row.at_bound},
                          {"significant", row.significant()}});
  }
  nlohmann::ordered_json cure = nlohmann::ordered_json::array();
  nlohmann::ordered_json cure_payload = nlohmann::ordered_json::array();
  for (const SuggestedPose& c : r.identifiability.suggested_poses) {
    nlohmann::ordered_json pose = nlohmann::ordered_json::array();
    for (const double v : c.q_rad) pose.push_back(degrees(v));
    cure.push_back(pose);
    cure_payload.push_back(c.payload_kg);
  }
  nlohmann::ordered_json gains = nlohmann::ordered_json::array();
  for (const PayloadGain& gain : r.identifiability.payload_gains)
    gains.push_back({{"parameter", gain.parameter}, {"sigma_ratio", gain.sigma_with_both / gain.sigma}});
  std::vector<std::size_t> outlier_lines;
  for (const std::size_t k : r.outliers) outlier_lines.push_back(rows[k].line);
  common.write_json({{"parameters", r.parameters},
                     {"identifiable", r.identifiable},
                     {"confounded", confounded_json(r.identifiability.confounded)},
                     {"missing", r.identifiability.missing},
                     {"cure_deg", cure},
                     {"cure_payload_kg", cure_payload},
                     {"second_payload_gains", gains},
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
                     {"pure_error", repeats_json(r.pure_error)},
                     {"before", to_json(r.before)},
                     {"after", to_json(r.after)},
                     {"values", parameters}});
  if (!report.empty()) {
    write_file(report,
               html(page_of(r, rows, robot_file, data, compare_models(robot_file, rows, data, options),
                            !options.fixed.empty() || !options.tolerances.empty())));
    common.say(report + ": written");
  }
  if (r.doubts.empty()) return;
  std::string message = joined(r.doubts);
  if (!r.identifiability.suggested_poses.empty()) {
    message += fmt::format("\n  These {} poses (joint readings in degrees, payload) would identify them:",
                           r.identifiability.suggested_poses.size());
    for (const SuggestedPose& c : r.identifiability.suggested_poses)
      message += fmt::format("\n   {}  {:.3f} kg", in_degrees(c.q_rad), c.payload_kg);
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
      ->check(CLI::IsMember(model_kinds))
      ->capture_default_str();
  command
      ->add_option("--frames", options->frames,
                   "nominal: the instrument measures in Fb and the tool point is known; fit: both are "
                   "fitted. Default: "
                   "fit where the nominal frames are off by more than 20 mm or 2 degrees")
      ->check(CLI::IsMember(frame_choices));
  command->add_option("-o,--output", options->out, "Calibration file")->type_name("CAL.yaml")->required();
  command
      ->add_option(
          "--fix", options->fix,
          "Do not fit this parameter, it is known: NAME (zero) or NAME=VALUE in the unit that the name "
          "ends with; may be given again")
      ->type_name("NAME[=VALUE]")
      ->allow_extra_args(false);
  command
      ->add_option(
          "--tolerances", options->tolerances,
          "How far from the drawing parameters may be, used as prior knowledge. A file with "
          "`tolerances:` and per line NAME: SIGMA, or NAME: {expected: VALUE, sigma: SIGMA}, in the unit "
          "that the name ends with; * stands for any text (link*.d_mm: 0.2)")
      ->type_name("T.yaml");
  command->add_flag(
      "--unbounded", options->unbounded,
      "Compliances may come out negative (default: as small as zero, with a one-sided interval)");
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
