// SPDX-License-Identifier: Apache-2.0
#include "commands/result_text.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "diagnosis/messages.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

std::string chance(double p) { return p < 1e-3 ? "< 0.001" : fmt::format("{:.2g}", p); }

}  // namespace

std::vector<std::string> effect_lines(const Diagnosis& d, const Robot& robot) {
  std::vector<std::string> lines;
  if (!d.effects.empty()) {
    lines.push_back(fmt::format("  {:<40} {:>12} {:>9} {:>8} {:>10}  {}", "effect", "largest mm", "rms mm",
                                "p", "delta BIC", "to the controller"));
  }
  for (const FoundEffect& e : d.effects) {
    lines.push_back(fmt::format("  {:<40} {:>12.4f} {:>9.4f} {:>8} {:>10.1f}  {}", name(e.id),
                                e.largest_m * 1e3, e.rms_m * 1e3, chance(e.p_value), e.delta_bic,
                                e.pushed ? "yes" : "no: of the measurement"));
    for (const std::string& line : sizes(e)) lines.push_back("      " + line);
    if (!e.confounded_with.empty())
      lines.push_back("      these data cannot tell it from: " + rivals_text(e));
  }
  for (const EffectId& id : unnamed_effects(d, robot)) lines.push_back("  " + name(id) + ": " + in_words(id));
  if (d.remainder) {
    if (const std::string text = remainder_sentence(*d.remainder); !text.empty())
      lines.push_back("  " + text);
  }
  if (d.where) {
    lines.push_back(fmt::format("  where {}: {}", d.verdict == Verdict::unnamed ? "the gap is" : "it was",
                                where_sentence(*d.where)));
  }
  for (const NotTestable& n : d.not_testable) lines.push_back("  not tested: " + not_testable_text(n));
  return lines;
}

std::vector<std::string> gap_lines(const Diagnosis& d, const std::optional<HeldOut>& others) {
  std::vector<std::string> lines;
  const auto line = [&lines](const std::string& what, const ErrorStatistics& before,
                             const ErrorStatistics& after, double floor_m) {
    const double gap = gap_of(before.rms_m, floor_m), left = gap_of(after.rms_m, floor_m);
    std::string turned;
    if (before.rms_rad && after.rms_rad)
      turned = fmt::format("; {:.5f} -> {:.5f} deg", degrees(*before.rms_rad), degrees(*after.rms_rad));
    lines.push_back(fmt::format("  {:<24} {:>9.4f} {:>9.4f} {:>12.4f} {:>9.4f} -> {:.4f}{}", what,
                                before.rms_m * 1e3, after.rms_m * 1e3, floor_m * 1e3, gap * 1e3, left * 1e3,
                                turned));
  };
  lines.push_back(fmt::format("  {:<24} {:>9} {:>9} {:>12} {:>9}", "position error, rms mm", "before",
                              "after", "noise alone", "gap"));
  line("fitted rows", d.error_before, d.error_after, d.noise_floor_m);
  if (others) line("held-out rows", others->before, others->after, others->noise_floor_m);
  lines.push_back(fmt::format("  chi-square per degree of freedom {:.3g} before, {:.3g} after",
                              d.chi2_per_dof_before, d.chi2_per_dof_after));
  return lines;
}

std::vector<std::string> next_steps(const Diagnosis& d, const std::string& calibration,
                                    const std::string& plan) {
  std::vector<std::string> steps;
  std::vector<std::string> measurement;
  bool confounded = false;
  for (const FoundEffect& e : d.effects) {
    if (!e.pushed) measurement.push_back(name(e.id));
    confounded = confounded || !e.confounded_with.empty();
  }
  if (!d.doubts.empty()) {
    steps.push_back(fmt::format("{} is not to be pushed: see why below", calibration));
  } else if (std::any_of(d.after.terms.terms.begin(), d.after.terms.terms.end(),
                         [](const Term<double>& t) { return t.effect == Effect::unnamed; })) {
    steps.push_back(
        fmt::format("into the controller: flexcomp push --to BUS {} --allow-unnamed (an effect that nobody "
                    "understands is pushed only if you say so)",
                    calibration));
  } else if (d.verdict == Verdict::unnamed && d.effects.empty() && !d.remainder) {
    steps.push_back(
        "before anything is pushed: look for a wrong convention, unit or joint in the data, or noise that "
        "was declared too small; nothing was added to the model");
  } else {
    steps.push_back(fmt::format("into the controller: flexcomp push --to BUS {}", calibration));
  }
  if (!measurement.empty()) {
    steps.push_back(fmt::format(
        "{} {} to the measurement, not to the arm: predict and validate use {}, push leaves {} out",
        list_of(measurement), measurement.size() == 1 ? "belongs" : "belong",
        measurement.size() == 1 ? "it" : "them", measurement.size() == 1 ? "it" : "them"));
  }
  if (confounded && !d.discriminating_poses.empty()) {
    steps.push_back(plan.empty()
                        ? "to tell the rivals apart: --plan POSES.csv writes the poses that do; measure them "
                          "and diagnose all rows together"
                        : fmt::format("to tell the rivals apart: measure the poses of {} and diagnose all "
                                      "rows together",
                                      plan));
  } else if (confounded) {
    steps.emplace_back(
        "no poses were found that tell the rivals apart: their corrections are the same, either will do");
  }
  if (!d.not_testable.empty()) {
    steps.emplace_back(
        "to have the untested effects tested too: record the columns that they need, and let them vary");
  }
  return steps;
}

}  // namespace flexcomp::host
