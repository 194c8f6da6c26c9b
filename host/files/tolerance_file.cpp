// SPDX-License-Identifier: Apache-2.0
#include "files/tolerance_file.hpp"

#include "files/yaml_field.hpp"

namespace flexcomp::host {

std::vector<Tolerance> load_tolerances(const std::string& path) {
  const YamlField root = YamlField::load(path);
  root.require_keys({"tolerances"});
  const YamlField list = root.at("tolerances");
  list.require_keys(list.keys());  // each once
  std::vector<Tolerance> out;
  for (const std::string& pattern : list.keys()) {
    const YamlField field = list.at(pattern);
    Tolerance t{pattern, 0, 0, path, field.line()};
    if (field.is_mapping()) {
      field.require_keys({"expected", "sigma"});
      t.expected = field.number_or("expected", unit::si, 0);
      t.sigma = field.at("sigma").number(unit::si, 0, "a standard deviation above 0");
    } else {
      t.sigma = field.number(unit::si, 0, "a standard deviation above 0");
    }
    out.push_back(t);
  }
  return out;
}

}  // namespace flexcomp::host
