// SPDX-License-Identifier: Apache-2.0
/// \file
/// Formats numbers and strings as YAML.
#ifndef FLEXCOMP_HOST_FILES_YAML_TEXT_HPP
#define FLEXCOMP_HOST_FILES_YAML_TEXT_HPP

#include <string>

#include "units.hpp"

namespace flexcomp::host {

/// A number as YAML 1.1 readers also take it for one: 1e-05 is text to them, 1.0e-05 is not.
std::string yaml_number(std::string text);
/// With the digits from which the identical double is read back.
std::string yaml_number(double si, const Unit& unit);

/// In double quotes, whatever it holds.
std::string yaml_quoted(const std::string& text);

}  // namespace flexcomp::host

#endif
