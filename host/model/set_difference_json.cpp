// SPDX-License-Identifier: Apache-2.0
#include "model/set_difference_json.hpp"

#include "json.hpp"
#include "units.hpp"

namespace flexcomp::host {

Json to_json(const SetDifference& d) {
  Json result;
  result["unchanged"] = d.unchanged;
  result["tool"] = {{"mean_mm", d.at_tool.mean_m * 1e3},
                    {"largest_mm", d.at_tool.largest_m * 1e3},
                    {"largest_deg", degrees(d.at_tool.largest_rad)},
                    {"poses", d.poses}};
  result["parameters"] = Json::array();
  for (const ParameterChange& c : d.changes) {
    result["parameters"].push_back({{"name", c.name},
                                    {"old", c.before / c.unit.si_per_file_unit()},
                                    {"new", c.after / c.unit.si_per_file_unit()},
                                    {"unit", c.unit.name},
                                    {"tool_mm", c.at_tool.largest_m * 1e3},
                                    {"tool_deg", degrees(c.at_tool.largest_rad)}});
  }
  return result;
}

}  // namespace flexcomp::host
