// SPDX-License-Identifier: Apache-2.0
#include "files/yaml_text.hpp"

#include <yaml-cpp/yaml.h>

#include <cstddef>

namespace flexcomp::host {

std::string yaml_number(std::string text) {
  const std::size_t e = text.find('e');
  if (e != std::string::npos && text.find('.') == std::string::npos) text.insert(e, ".0");
  return text;
}

std::string yaml_number(double si, const Unit& unit) { return yaml_number(format_si(si, unit)); }

std::string yaml_quoted(const std::string& text) {
  YAML::Emitter emitter;
  emitter << YAML::DoubleQuoted << text;
  return emitter.c_str();
}

}  // namespace flexcomp::host
