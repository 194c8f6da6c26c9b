// SPDX-License-Identifier: Apache-2.0
#include "files/cell_file.hpp"

#include "files/capsule.hpp"
#include "files/yaml_field.hpp"

namespace flexcomp::host {

Cell load_cell(const std::string& path) {
  const YamlField root = YamlField::load(path);
  root.require_keys({"tracker_mm", "obstacles", "safety", "smr_radius_mm", "acceptance_deg"});
  Cell cell;
  cell.path = path;
  if (const auto tracker = root.find("tracker_mm")) cell.tracker_m = tracker->vector3(unit::mm);
  if (const auto obstacles = root.find("obstacles")) {
    for (const YamlField& field : obstacles->items()) cell.obstacles.push_back(read_fixed_capsule(field));
  }
  if (const auto safety = root.find("safety")) {
    cell.safety = safety->number(unit::si);
    if (cell.safety < 0) throw safety->error("a factor of 0 or more");
  }
  if (const auto radius = root.find("smr_radius_mm")) {
    cell.smr_radius_m = radius->number(unit::mm, 0, "a radius above 0");
  }
  if (const auto acceptance = root.find("acceptance_deg")) {
    cell.acceptance_rad = acceptance->number(unit::degree, 0, "an angle above 0 and at most 180 degrees");
    if (cell.acceptance_rad > pi) throw acceptance->error("an angle above 0 and at most 180 degrees");
  }
  return cell;
}

}  // namespace flexcomp::host
