// SPDX-License-Identifier: Apache-2.0
#include "commands/result_text.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

#include "commands/colour.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

std::string line(const char* what, const ErrorStatistics& s) {
  return fmt::format("  {:<24} {:>10.4f} {:>10.4f} {:>10.4f}{}", what, s.mean_m * 1e3, s.rms_m * 1e3,
                     s.max_m * 1e3, s.mean_rad ? fmt::format(" {:>10.5f}", degrees(*s.mean_rad)) : "");
}

std::string head_line(const ErrorStatistics& s) {
  const std::string head =
      fmt::format("  {:<24} {:>10} {:>10} {:>10}{}", "position error", "mean mm", "rms mm", "max mm",
                  s.mean_rad ? fmt::format(" {:>10}", "mean deg") : "");
  return painted(head, Colour::head, STDOUT_FILENO) + "\n";
}

}  // namespace

std::string accuracy_table(const ErrorStatistics& corrected) {
  return head_line(corrected) + line("corrected", corrected);
}

std::string accuracy_table(const Before& before, const ErrorStatistics& after) {
  std::string text = head_line(after);
  text += line("before, nominal frames", before.nominal_frames) + "\n";
  if (before.fitted_frames) text += line("before, fitted frames", *before.fitted_frames) + "\n";
  const ErrorStatistics& then = before.fitted_frames ? *before.fitted_frames : before.nominal_frames;
  text +=
      painted(line("after", after), after.mean_m < then.mean_m ? Colour::good : Colour::bad, STDOUT_FILENO) +
      "\n";
  text.pop_back();
  return text;
}

void add_outlier_warning(std::vector<std::string>& warnings, const std::string& data,
                         const std::vector<Observation>& rows, const std::vector<std::size_t>& outliers) {
  if (outliers.empty()) return;
  std::string lines;
  const std::size_t shown = std::min<std::size_t>(outliers.size(), 8);
  for (std::size_t k = 0; k < shown; ++k) lines += fmt::format(" {}", rows[outliers[k]].line);
  warnings.push_back(fmt::format("{}: {} of {} rows lie outside the bulk and count less: lines{}{}", data,
                                 outliers.size(), rows.size(), lines, shown < outliers.size() ? " …" : ""));
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += (text.empty() ? "" : "\n  ") + line;
  return text;
}

}  // namespace flexcomp::host
