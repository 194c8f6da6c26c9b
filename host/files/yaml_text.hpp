// SPDX-License-Identifier: Apache-2.0
/// \file
/// Formats numbers and strings as YAML.
#ifndef FLEXCOMP_HOST_FILES_YAML_TEXT_HPP
#define FLEXCOMP_HOST_FILES_YAML_TEXT_HPP

#include <string>

#include "units.hpp"

namespace flexcomp::host {

/// Formats a number for YAML 1.1 readers, to which 1e-05 is text and 1.0e-05 a number.
std::string yaml_number(std::string text);
/// Formats a number with the digits from which the identical double is read back.
std::string yaml_number(double si, const Unit& unit);

/// Quotes a text with double quotes and escapes.
std::string yaml_quoted(const std::string& text);

}  // namespace flexcomp::host

#endif
