// SPDX-License-Identifier: Apache-2.0
#include "commands/result_text.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include "commands/colour.hpp"
#include "units.hpp"

namespace flexcomp::host {

std::string difference_table(const SetDifference& d) {
  std::string text;
  if (!d.changes.empty()) {
    text += painted(fmt::format("  {:<40} {:>12} {:>14} {:>11} {:>11}", "parameter", "old", "new", "tool mm",
                                "tool deg"),
                    Colour::head, STDOUT_FILENO) +
            "\n";
  }
  for (const ParameterChange& c : d.changes) {
    const auto shown = [&c](double si) { return fmt::format("{:.6g}", si / c.unit.si_per_file_unit()); };
    text += fmt::format("  {:<40} {:>12} -> {:>11} {:>11.4f} {:>11.5f}\n", c.name, shown(c.before),
                        shown(c.after), c.at_tool.largest_m * 1e3, degrees(c.at_tool.largest_rad));
  }
  text += fmt::format("  {} change, {} stay as they are", d.changes.size(), d.unchanged);
  if (!d.changes.empty()) {
    text += fmt::format(
        "\n  at the tool: {} on average, up to {:.4f} mm and {:.5f} deg (over {} random poses; beside a "
        "parameter: its own part, at most)",
        painted(fmt::format("{:.4f} mm", d.at_tool.mean_m * 1e3), Colour::note, STDOUT_FILENO),
        d.at_tool.largest_m * 1e3, degrees(d.at_tool.largest_rad), d.poses);
  }
  return text;
}

}  // namespace flexcomp::host
