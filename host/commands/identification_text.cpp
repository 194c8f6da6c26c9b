// SPDX-License-Identifier: Apache-2.0
#include "commands/result_text.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "commands/colour.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

std::string in_degrees(const std::array<double, joint_count>& q) {
  std::string text;
  for (const double v : q) text += fmt::format(" {:9.3f}", degrees(v));
  return text;
}

/// Every identified number with its standard deviation and interval, in the units of files.
std::string parameter_table(const std::vector<FittedParameter>& rows) {
  std::string text = painted(fmt::format("  {:<44} {:>14} {:>12}  {}", "parameter", "value", "+- (1 sigma)",
                                         "95 % interval"),
                             Colour::head, STDOUT_FILENO) +
                     "\n";
  for (const FittedParameter& row : rows) {
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

}  // namespace

std::vector<std::string> text_lines(const Identification& r, const Robot& robot, const std::string& data,
                                    std::size_t rows, const std::string& out) {
  std::vector<std::string> lines;
  const auto say = [&lines](const std::string& line) { lines.push_back(line); };
  say(fmt::format(
      "{}: {} rows of {}; {} of {} parameters are identifiable{}", data, rows, robot.name, r.identifiable,
      r.parameters,
      r.frame_parameters > 0 ? fmt::format(", and {} frame parameters", r.frame_parameters) : std::string()));
  for (const Confounded& c : r.identifiability.confounded) {
    std::string with;
    for (const std::string& w : c.with) with += (with.empty() ? "" : ", ") + w;
    say(fmt::format("  {} not identifiable: {}", c.parameter,
                    with.empty() ? "nothing measured here depends on it" : "absorbed by " + with));
  }
  const std::vector<FittedParameter> table = fitted_parameters(r);
  say(parameter_table(table));
  say(accuracy_table(r.before, r.after));
  say(fmt::format("  {} after {} steps; chi-square per degree of freedom {:.3g}; condition {:.3g}; O1 {:.3g}",
                  r.fit.converged ? "converged" : "NOT converged", r.fit.iterations, r.fit.chi2_per_dof(),
                  r.condition, r.o1));
  say(fmt::format("{}: written", out));

  if (r.pure_error) say(repeats_text(*r.pure_error));
  if (!r.identifiability.payload_gains.empty())
    say(payload_advice(r.identifiability.payload_gains, r.fit.estimate.set,
                       r.identifiability.fitted.parameters));

  return lines;
}

std::string doubts_text(const Identification& r) {
  std::string message = joined(r.doubts);
  if (!r.identifiability.suggested_poses.empty()) {
    message += fmt::format("\n  These {} poses (joint readings in degrees, payload) would identify them:",
                           r.identifiability.suggested_poses.size());
    for (const SuggestedPose& c : r.identifiability.suggested_poses)
      message += fmt::format("\n   {}  {:.3f} kg", in_degrees(c.q_rad), c.payload_kg);
  }
  return message;
}

}  // namespace flexcomp::host
